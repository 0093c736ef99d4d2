"""The attitude of a vehicle that moves: from accelerations that its IMU feels and its receiver sees.

Accelerometers feel in b what fixes show in n. Their integrals over a window differ by the attitude at its beginning,
whatever it is: no part of it has to be known, and no axis has to point forwards. Wahba's problem gives a first answer
(optimisation-based alignment: Wu and Pan 2013), least squares from there one that knows what biases and noise do: gyro
biases of a fraction of a degree a second turn a MEMS by more in a window than its heading is uncertain.

References
----------
Wu, Y., Pan, X. (2013), Velocity/position integration formula, part I: application to in-flight coarse alignment. IEEE
Transactions on Aerospace and Electronic Systems 49(2).
"""

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number, real_array
from gmwm_jax._internal.typing import Real
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.recorded import _window
from nav_jax.recorded._attitude_fit import Belief, Window, fitted
from nav_jax.recorded.alignment import Start
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.start_summary import start_dict, start_table

_FEWEST = 6
"""Fixes: velocities have three unknown at the beginning, attitude and biases nine, and something must be left over."""
_MOST = 600
"""Fixes, of which each makes three rows of matrices that are dense."""
_SURE = np.deg2rad(10.0)
"""rad of heading, beyond which filters that linearise do not work."""


@dataclass(frozen=True, eq=False)
class StartOnTheMove(Start):
    """Where a record starts in the middle of a drive, with what that leaves unknown.

    Position and velocity are those of the IMU.

    Attributes
    ----------
    accel_bias, gyro_bias
        As the window shows them, m/s^2 and rad/s; zero where they were said to be.
    initial
        Of the start: position, velocity and attitude with their correlations.
    misfit
        Mean normalised square of what the fit leaves, 1 if noise and biases are as stated.
    """

    accel_bias: Float64[np.ndarray, "3"]
    gyro_bias: Float64[np.ndarray, "3"]
    initial: InitialUncertainty
    misfit: float

    def __repr__(self) -> str:
        return f"{start_table(self)}\nmean normalised square of what the fit leaves: {self.misfit:.3g}"

    def to_dict(self) -> dict[str, Any]:
        """As numbers of JSON, with angles in deg too."""
        return start_dict(self) | {"accel_bias": self.accel_bias.tolist(), "misfit": self.misfit}


def align_on_the_move(
    imu: Imu,
    fixes: GnssRecord,
    *,
    window: Real = 30.0,
    velocity_sd: Any = None,
    position_sd: Any = None,
    accel_bias_sd: Real = 0.0,
    gyro_bias_sd: Real = 0.0,
    accel_noise: Real = 0.0,
    gyro_noise: Real = 0.0,
    averaged: Real = 0.0,
    lever_arm: Any = (0.0, 0.0, 0.0),
    earth: AbstractEarth | None = None,
) -> StartOnTheMove:
    """Find roll, pitch and heading of a vehicle that moves, without knowing anything of them.

    The heading is told by horizontal accelerations: a turn or two, or braking and speeding up, in the window. Where the
    fixes have velocities, these are fitted; otherwise the positions, whose errors have then to be independent, as those
    of RTK are. What is claimed is the covariance of the fit, with the information on the attitude as it is observed, so
    that noise alone makes no heading; where what is left is larger than stated, it grows with that.

    Not of the fit are scale factors and misalignments, of gyros above all: they turn the attitude by a part of all
    turns in the window. Of 0.3 % and 2 mrad, and turns of 2 rad in 60 s, tilts were off by 0.15 deg and claimed to be
    known to 0.03; a `gyro_noise` of 1e-3 rad/s/sqrt(Hz), or a shorter window, made the claim true.

    Parameters
    ----------
    imu
        Along the axes of the body, on the clock of the fixes. The window begins with it, or with the first fix in it.
    fixes
        With velocities, or positions from which they follow.
    window
        s. The result is of the last fix in it, and fixes after that are for the filter.
    velocity_sd, position_sd
        m/s and m, one number or north, east, down, in place of what the file says; needed where it says nothing.
    accel_bias_sd, gyro_bias_sd
        Standard deviations of what the biases may be, m/s^2 and rad/s. They are estimated too.
    accel_noise, gyro_noise
        White noise of the samples, m/s^2/sqrt(Hz) and rad/s/sqrt(Hz): that of the drive, vibration included.
    averaged
        s before a fix of which its velocity is the mean, as for `nj.Gnss`.
    lever_arm
        From the IMU to the antenna in b, m.
    earth
        Its gravity and its rate; a `FlatEarth` unless given.

    Raises
    ------
    ValueError
        The motion does not tell the heading to 10 deg; fixes that are too few or too many, or none of whose velocities
        and positions has a standard deviation; positions that are none on this Earth.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=30.0, rate=20.0))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10], velocity=exact.velocity[::10])
    >>> start = nj.recorded.align_on_the_move(samples, fixes, velocity_sd=0.05, position_sd=0.1, accel_bias_sd=0.05)
    >>> round(float(abs(start.quaternion @ exact.quaternion[-1])), 6)  # cosine of half the angle between the two
    1.0
    """
    earth = FlatEarth() if earth is None else earth
    belief = Belief(
        (number("accel_bias_sd", accel_bias_sd, zero_ok=True), number("gyro_bias_sd", gyro_bias_sd, zero_ok=True)),
        (number("accel_noise", accel_noise, zero_ok=True), number("gyro_noise", gyro_noise, zero_ok=True)),
    )
    arm = real_array("lever_arm", lever_arm, (3,))
    part, positions, late = _selected(imu, fixes, number("window", window), number("averaged", averaged, zero_ok=True))
    earth.check(part.position, part.origin)
    there = _variances("position", position_sd, part.covariance, len(part))
    taken = there if positions else _variances("velocity", velocity_sd, part.velocity_covariance, len(part))
    w = _arranged(imu, part, taken, arm, earth, positions=positions, late=late)
    end = fitted(w, belief)
    sd = np.inf if end.covariance is None else float(np.sqrt(end.covariance[-1, -1]))
    if not sd <= _SURE:
        raise ValueError(_untold(w, part, sd, end.misfit))
    C = end.covariance
    assert C is not None  # or its standard deviation were infinite
    out = end.attitude @ arm
    if end.position is None:
        # the antenna is where the last fix is; truth - estimate of the IMU has [C l x] psi in it
        after = w.imu.epochs[-1] - part.time[-1]
        position = part.position[-1] + after * end.velocity - out
        by = np.vstack([np.hstack([np.zeros((3, 3)), _window.skew(out)]), np.eye(6)])
        C = by @ C @ by.T
        C[:3, :3] += there[-1]
    else:
        position = end.position
    q = np.asarray(rotation.quat_from_dcm(jnp.asarray(end.attitude)))
    initial = InitialUncertainty(covariance=(C + C.T) / 2)
    return StartOnTheMove(
        float(w.imu.epochs[-1]), position, end.velocity, q, end.accel_bias, end.gyro_bias, initial, end.misfit
    )


def _selected(imu: Imu, fixes: GnssRecord, window: float, averaged: float) -> tuple[GnssRecord, bool, float]:
    """The fixes of a window, whether their positions are those to fit, and how old their velocities are in s."""
    seen = fixes.velocity is not None and np.isfinite(fixes.velocity[:, :2]).all(axis=1)
    positions = not np.any(seen)
    late = 0.0 if positions else averaged / 2
    when, slack = fixes.time - late, 1e-6 / imu.rate
    usable = (when >= imu.time[0] - slack) & (fixes.time <= imu.epochs[-1] + slack)
    if not positions:
        usable &= seen
    if usable.any():
        usable &= fixes.time <= when[usable][0] + window + late + slack
    num = int(usable.sum())
    if num < _FEWEST:
        span = f"{fixes.time[0]:g} to {fixes.time[-1]:g} s" if len(fixes) else "no time"
        raise ValueError(
            f"{num} fixes lie in the first {window:g} s that the IMU ({imu.time[0]:g} to {imu.epochs[-1]:g} s) and the "
            f"fixes ({span}) have in common, and an alignment on the move takes {_FEWEST}: make the window longer, "
            "or look at the clocks of both."
        )
    if num > _MOST:
        raise ValueError(
            f"{num} fixes lie in a window of {window:g} s, and at most {_MOST} are fitted: give fewer of them by "
            f"fixes.select(slice(None, None, {-(-num // _MOST)})), or a shorter window."
        )
    return fixes.select(usable), positions, late


def _variances(what: str, sd: Any, of_file: np.ndarray | None, num: int) -> Float64[np.ndarray, "K 3 3"]:
    """Covariances by what is given, or else by the file."""
    if sd is not None:
        given = np.broadcast_to(np.asarray(sd, dtype=float), (3,)) if np.ndim(sd) == 0 else sd
        given = real_array(f"{what}_sd", given, (3,))
        if not (given > 0).all():
            raise ValueError(f"{what}_sd must be positive, and is {given.tolist()}.")
        return np.broadcast_to(np.diag(given**2), (num, 3, 3))
    if of_file is None:
        raise ValueError(f"The fixes do not say how good a {what} is: give {what}_sd.")
    return of_file


def _arranged(
    imu: Imu,
    part: GnssRecord,
    noise: np.ndarray,
    arm: np.ndarray,
    earth: AbstractEarth,
    *,
    positions: bool,
    late: float,
) -> Window:
    """Cut the samples, and integrate what fixes and Earth say."""
    slack = 1e-6 / imu.rate
    epochs = imu.epochs
    begin = max(int(np.searchsorted(epochs, part.time[0] - late + slack, side="right")) - 1, 0)
    end = int(np.searchsorted(epochs, part.time[-1] - slack))
    imu = imu.part(begin, end)
    time = imu.epochs - imu.epochs[0]
    at_fixes = part.time - imu.epochs[0]
    when = at_fixes - late
    p = _window.at(at_fixes, part.position, time)
    v = np.gradient(part.position, part.time, axis=0) if positions or part.velocity is None else part.velocity
    known = _window.known(time, p, _window.at(when, np.nan_to_num(v), time), part.position[0], earth)
    z = part.position - part.position[0] if positions else v
    turned, added = _window.at(time, known.turned, when), _window.at(time, known.added[positions], when)
    aim = np.einsum("kij,kj->ki", turned, np.nan_to_num(z)) + added
    # a window turns by far too little for what is missing of one component to be felt in another
    told = np.isfinite(z)
    return Window(imu, part.position[0], when, known, aim, told, noise, arm, positions)


def _untold(w: Window, part: GnssRecord, sd: float, misfit: float) -> str:
    """Why a heading is refused."""
    told = "not at all" if not np.isfinite(sd) else f"to {np.rad2deg(sd):.3g} deg"
    v = np.gradient(part.position, part.time, axis=0) if w.positions or part.velocity is None else part.velocity
    changed = float(np.linalg.norm(np.ptp(v[:, :2], axis=0)))
    odd = f" What the fit leaves is {np.sqrt(misfit):.3g} times what is stated, which adds to it." if misfit > 2 else ""
    return (
        f"The motion from {part.time[0]:g} to {part.time[-1]:g} s tells the heading {told} (1 sigma), and a filter "
        f"needs {np.rad2deg(_SURE):.3g}: the horizontal velocity, which turns and brakes change, changes by "
        f"{changed:.3g} m/s.{odd} Begin the window elsewhere (nav_jax.recorded.between), make it longer, or start by "
        "align_by_course."
    )
