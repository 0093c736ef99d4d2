"""How an IMU sits in a vehicle on wheels: turned to the vehicle's axes as stated, or as found from the drive itself.

A vehicle on wheels goes where it points. The velocities of the fixes are so the vehicle's front axis, level but for the
slope of the road, and their changes less gravity are the specific force along its axes, their turns its turn rates. The
IMU has both along axes of its own: the rotation between the two is Wahba's problem, solved by Davenport's method and
from there by least squares, in which biases, a distance from the rear axle and soft springs have a place beside it.

What is left of a window is no white noise: slopes across the road, body roll and clocks last for many. The covariance
is therefore that by the jackknife over blocks of windows (to first order: Bell and McCaffrey 2002), beside what is
believed of biases and of the road. Large residuals, as those of a vehicle that backs out of a yard, count less (Huber).

References
----------
Bell, R. M., McCaffrey, D. F. (2002), Bias reduction in standard errors for linear regression with multi-stage samples.
Survey Methodology 28(2).
Huber, P. J. (1964), Robust estimation of a location parameter. Annals of Mathematical Statistics 35(1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number, real_array
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.recorded import _window
from nav_jax.recorded._wahba import davenport
from nav_jax.recorded.alignment import velocities
from nav_jax.recorded.gnss.record import GnssRecord

_WINDOW = 1.0
"""s at least, over which velocities change."""
_SPEED = 2.0
"""m/s at both ends of a window, from which a velocity tells where a vehicle points."""
_FEWEST = 30
"""Windows."""
_BLOCK = 10
"""Windows whose residuals may have to do with each other."""
_SHIFT = 0.1
"""s, by which windows are shifted for slopes in time."""
_HUBER = 2.0
"""Standard deviations from which on a residual counts less."""
_LEAST = 1e-6
"""m/s^2 and rad/s, below which nothing is told from rounding."""
_ITERATIONS = 50
_SMALL = 1e-9
"""rad of a last step."""
_SURE = np.deg2rad(10.0)
"""rad, beyond which a mounting is not told."""
_ALIKE = 0.3
"""Correlation of what an IMU feels with what fixes show, below which they are not of one drive."""
_SPRINGS = 0.1
"""Standard deviation of the part by which springs add to accelerations: a body that leans lets gravity in."""
_CROSS_SLOPE = np.deg2rad(1.0)
"""rad, of the mean of a drive: roads fall by 2 % to their sides."""
_ANGLES = ("roll", "pitch", "yaw")
_AXES = ("front", "right", "down")


_NUM = 13
"""Unknown are the rotation, biases of accelerometers and gyros, two springs, the distance ahead, and the clock."""


class Belief(NamedTuple):
    """Standard deviations, see `find_mounting`."""

    accel_bias: float = 0.1
    gyro_bias: float = 0.02
    ahead: float = 3.0
    clock: float = 0.03
    cross_slope: float = _CROSS_SLOPE

    def units(self) -> Float64[np.ndarray, " n"]:
        """Of what is unknown: one for the rotation, standard deviations for the rest."""
        return np.repeat([1.0, self.accel_bias, self.gyro_bias, _SPRINGS, self.ahead, self.clock], [3, 3, 3, 2, 1, 1])


_BELIEF = Belief()


class _Windows(NamedTuple):
    """Between fixes: what the IMU feels along its axes, and what the fixes show along those of the vehicle."""

    felt: Float64[np.ndarray, "K 2 3"]
    """Means of specific force and turn rate."""
    later: Float64[np.ndarray, "K 2 3"]
    """How they grow with the time at which they are taken, 1/s."""
    shown: Float64[np.ndarray, "K 2 3"]
    along: Float64[np.ndarray, "K 3"]
    """Acceleration."""
    turn: Float64[np.ndarray, " K"]
    """Of the course, rad/s."""
    speed: Float64[np.ndarray, " K"]


class _Fit(NamedTuple):
    C: Float64[np.ndarray, "3 3"]
    x: Float64[np.ndarray, " n"]
    """The rest, in units of what is believed."""
    covariance: Float64[np.ndarray, "n n"]


@dataclass(frozen=True, eq=False)
class Mounting:
    """How an IMU sits in a vehicle, see `find_mounting`.

    Attributes
    ----------
    euler
        Roll, pitch, yaw in rad of the axes of the IMU in those of the vehicle: what `mounted` takes.
    covariance
        Of the rotation vector (rad) along front, right, down by which the truth is turned from it, shape (3, 3).
    num_windows
        Of the fixes that told it.
    """

    euler: Float64[np.ndarray, "3"]
    covariance: Float64[np.ndarray, "3 3"]
    num_windows: int

    @property
    def sd(self) -> Float64[np.ndarray, "3"]:
        """Standard deviations in rad about front, right and down."""
        return np.sqrt(np.diag(self.covariance))

    def __repr__(self) -> str:
        rows = [
            [name, f"{x:.2f}", axis, f"{sd:.2g}"]
            for name, x, axis, sd in zip(_ANGLES, *(np.rad2deg(self.euler), _AXES, np.rad2deg(self.sd)), strict=True)
        ]
        table = format_table(["of the IMU", "deg", "about", "sd [deg]"], rows, left=1)
        return f"Mounting, by {self.num_windows} windows between fixes\n{table}"

    def to_dict(self) -> dict[str, Any]:
        """As numbers of JSON, with angles in deg too."""
        return {
            "euler_deg": dict(zip(_ANGLES, np.rad2deg(self.euler).tolist(), strict=True)),
            "sd_deg": dict(zip(_AXES, np.rad2deg(self.sd).tolist(), strict=True)),
            "euler": self.euler.tolist(),
            "covariance": self.covariance.tolist(),
            "num_windows": self.num_windows,
        }


def mounted(imu: Imu, euler: Any) -> Imu:
    """The samples along the axes of the body, from those along the axes of an IMU that is mounted otherwise.

    Parameters
    ----------
    imu
        Along its own axes.
    euler
        Roll, pitch, yaw in rad of the axes of the IMU in those of the body, as those of a body in n: (pi, 0, 0) is an
        IMU upside down.

    Raises
    ------
    ValueError
        Angles beyond 2 pi, which are in deg.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.static(duration=2.0, rate=20.0))
    >>> nj.recorded.mounted(samples, (np.pi, 0.0, 0.0)).accel[0].round(5).tolist()
    [0.0, 0.0, 9.80665]
    """
    return replace(imu, gyro=turned(imu.gyro, euler), accel=turned(imu.accel, euler))


def turned(vectors: Float64[np.ndarray, "N 3"], euler: Any) -> Float64[np.ndarray, "N 3"]:
    """Vectors along the axes of the body, from those along axes that have this roll, pitch and yaw in it."""
    angles = real_array("The mounting (roll, pitch, yaw)", euler, (3,))
    if np.abs(angles).max() > 2 * np.pi:
        raise ValueError(f"The mounting is roll, pitch, yaw in rad, and is {angles.tolist()}: np.deg2rad converts deg.")
    q = rotation.quat_from_euler(jnp.asarray(angles)[:, None])
    return np.asarray(rotation.rotate(q, jnp.asarray(vectors.T))).T


def find_mounting(
    imu: Imu,
    fixes: GnssRecord,
    *,
    averaged: Real = 0.0,
    accel_bias_sd: Real = _BELIEF.accel_bias,
    gyro_bias_sd: Real = _BELIEF.gyro_bias,
    cross_slope_sd: Real = _BELIEF.cross_slope,
    ahead_sd: Real = _BELIEF.ahead,
    clock_sd: Real = _BELIEF.clock,
    gravity: Real = STANDARD_GRAVITY,
) -> Mounting:
    """Find how an IMU sits in a vehicle on wheels, from a drive of a minute or more with turns and stops.

    Nothing has to be known of its axes. Gravity and turns tell which one points down, braking and turning which one
    forwards. A vehicle that only drives backwards is taken for one that drives forwards. The pitch is that against the
    direction of travel; the roll against a road that is level across, on the mean of the drive.

    Parameters
    ----------
    imu
        Along its own axes, on the clock of the fixes: `inspect_record` tells an offset.
    fixes
        With velocities, or positions from which they follow.
    averaged
        s before a fix of which its velocity is the mean, as for `nj.Gnss`.
    accel_bias_sd, gyro_bias_sd
        Standard deviations of what the biases may be, m/s^2 and rad/s. They are estimated beside the mounting.
    cross_slope_sd
        Standard deviation in rad of the mean slope across the road, which nothing tells from a roll of the mounting.
    ahead_sd
        Standard deviation in m of how far IMU and antenna are ahead of the rear axle, which is estimated too.
    clock_sd
        Standard deviation in s of what the clocks may still be apart, which is estimated too.
    gravity
        m/s^2.

    Raises
    ------
    ValueError
        Too few fixes at speed, motion that does not tell it to 10 deg, or samples and fixes that have nothing to do
        with each other: clocks that are apart, axes of a left-handed system, accelerometers of the other sign.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.racetrack(duration=90.0, rate=20.0, straight=40.0, turn=20.0,
    ...     attitude="navigation"))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10], velocity=exact.velocity[::10])
    >>> found = nj.recorded.find_mounting(nj.recorded.mounted(samples, (0.0, 0.0, -1.5)), fixes)
    >>> found.euler.round(2).tolist()
    [-0.0, -0.0, 1.5]
    """
    belief = Belief(
        number("accel_bias_sd", accel_bias_sd, zero_ok=True),
        number("gyro_bias_sd", gyro_bias_sd, zero_ok=True),
        number("ahead_sd", ahead_sd, zero_ok=True),
        number("clock_sd", clock_sd, zero_ok=True),
        number("cross_slope_sd", cross_slope_sd, zero_ok=True),
    )
    late = number("averaged", averaged, zero_ok=True) / 2
    time, steps = imu.epochs, np.full((len(imu), 1), 1 / imu.rate)
    return mounting_by(time, steps * imu.gyro, steps * imu.accel, fixes, belief, late, float(gravity))


def mounting_by(
    epochs: Float64[np.ndarray, " E"],
    turns: Float64[np.ndarray, "E-1 3"],
    pushes: Float64[np.ndarray, "E-1 3"],
    fixes: GnssRecord,
    belief: Belief = _BELIEF,
    late: float = 0.0,
    gravity: float = STANDARD_GRAVITY,
) -> Mounting:
    """The same by increments of gyro and accelerometer between epochs in any steps; fixes are `late` by some s.

    Raises
    ------
    ValueError
        See `find_mounting`.
    """
    gyro, accel = (np.concatenate([np.zeros((1, 3)), np.cumsum(x, axis=0)]) for x in (turns, pushes))
    w = _windows(epochs, gyro, accel, fixes, late, gravity)
    if (num := len(w.turn)) < _FEWEST:
        raise ValueError(
            f"Only {num} windows of {_WINDOW:g} s between fixes, in the record of {epochs[0]:g} to {epochs[-1]:g} s, "
            f"are faster than {_SPEED:g} m/s, and the mounting of the IMU is told by {_FEWEST} or more: state it, or "
            "look at the clocks of both."
        )
    units = belief.units()
    fit = _fitted(w, units)
    _check(w, fit)
    q = np.asarray(rotation.quat_from_dcm(jnp.asarray(fit.C)))
    covariance = fit.covariance[:3, :3] + np.diag([belief.cross_slope**2, 0.0, 0.0])
    euler = np.asarray(rotation.euler_from_quat(jnp.asarray(q)))
    return Mounting(euler, covariance, num)


def _windows(
    epochs: np.ndarray, gyro: np.ndarray, accel: np.ndarray, fixes: GnssRecord, late: float, gravity: float
) -> _Windows:
    time, v = _velocities(fixes)
    time = time - late
    step = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    many = max(1, int(np.ceil(_WINDOW / step - 1e-6)))
    rows = np.arange(0, len(time), many)
    a, b = rows[:-1], rows[1:]
    speed = np.hypot(*v.T[:2])
    usable = (
        (time[a] - _SHIFT >= epochs[0]) & (time[b] + _SHIFT <= epochs[-1]) & (time[b] - time[a] < 1.5 * many * step)
    )
    usable &= (speed[a] >= _SPEED) & (speed[b] >= _SPEED)
    a, b = a[usable], b[usable]
    width = (time[b] - time[a])[:, None]
    before, felt, after = (_means(epochs, (accel, gyro), time[a] + by, time[b] + by) for by in (-_SHIFT, 0.0, _SHIFT))
    later = (after - before) / (2 * _SHIFT)
    # course and climb in the middle and how they change: Euler rates of a body without roll
    course, climb = np.arctan2(v[:, 1], v[:, 0]), np.arctan2(-v[:, 2], speed)
    turn = (np.diff([course[a], course[b]], axis=0)[0] + np.pi) % (2 * np.pi) - np.pi
    middle, pitch = course[a] + turn / 2, (climb[a] + climb[b]) / 2
    turn, lift = turn / width[:, 0], (climb[b] - climb[a]) / width[:, 0]
    C = np.asarray(rotation.dcm_from_quat(rotation.quat_from_euler(jnp.stack([0.0 * pitch, pitch, middle]))))
    to_body = np.moveaxis(C, 2, 0).swapaxes(1, 2)
    change = (v[b] - v[a]) / width
    along = np.einsum("kij,kj->ki", to_body, change)
    force = np.einsum("kij,kj->ki", to_body, change - np.array([0.0, 0.0, gravity]))
    rate = np.column_stack([-turn * np.sin(pitch), lift, turn * np.cos(pitch)])
    return _Windows(felt, later, np.stack([force, rate], axis=1), along, turn, (speed[a] + speed[b]) / 2)


def _means(epochs: np.ndarray, integrals: Sequence[np.ndarray], start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Over windows, shape (K, sensors, 3)."""
    whole = np.stack([[np.interp(t, epochs, x) for x in y.T] for y in integrals for t in (start, end)])
    return np.moveaxis(whole[1::2] - whole[::2], 2, 0) / (end - start)[:, None, None]


def _velocities(fixes: GnssRecord) -> tuple[np.ndarray, np.ndarray]:
    """Times and velocities: those of the file, and derivatives of positions where it has none, also of none down."""
    if fixes.velocity is None:
        return velocities(fixes)
    there = np.isfinite(fixes.velocity[:, :2]).all(axis=1)
    v = fixes.velocity[there].copy()
    if not np.isfinite(v[:, 2]).all() and there.sum() > 2:
        v[:, 2] = np.gradient(fixes.position[there, 2], fixes.time[there])
    return fixes.time[there], v


def _fitted(w: _Windows, units: Float64[np.ndarray, " n"]) -> _Fit:
    size = np.array([[0.5], [0.05]])  # m/s^2 and rad/s, which roads do
    shown, felt = ((x / size).reshape(-1, 3) for x in (w.shown, w.felt))
    C = np.asarray(rotation.dcm_from_quat(jnp.asarray(davenport(shown, felt))))
    x, prior = np.zeros(_NUM), np.repeat([0.0, 1.0], [3, _NUM - 3])
    for _ in range(_ITERATIONS):
        left, slope = _rows(w, C, x, units)
        sd = 1.4826 * np.median(np.abs(left), axis=0) + _LEAST
        weight = np.minimum(1.0, _HUBER * sd / np.maximum(np.abs(left), sd)) / sd**2
        scores = np.einsum("kin,ki,ki->kn", slope, weight, left)
        H = np.einsum("kin,ki,kim->nm", slope, weight, slope) + np.diag(prior)
        step = np.linalg.solve(H, scores.sum(axis=0) - prior * x)
        if np.abs(step[:3]).max() < _SMALL:
            break
        C = np.asarray(_window.matrices(jnp.asarray(step[:3]))) @ C
        x[3:] += step[3:]
    # a score that is cut off has no slope
    inside = (np.abs(left) <= _HUBER * sd) / sd**2
    starts = np.arange(0, len(scores), _BLOCK)
    parts = np.add.reduceat(np.einsum("kin,ki,kim->knm", slope, inside, slope), starts)
    H = parts.sum(axis=0) + np.diag(prior)
    # what a fit without a block would change
    jumps = np.linalg.solve(H - parts, np.add.reduceat(scores, starts)[:, :, None])[:, :, 0]
    P = np.linalg.inv(H)
    return _Fit(C, x, (1 - 1 / len(jumps)) * jumps.T @ jumps + P @ np.diag(prior) @ P)


def _rows(w: _Windows, C: np.ndarray, x: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is left of specific forces and turn rates, (K, 6), and how it falls with each unknown, (K, 6, n).

    An antenna r ahead of the rear axle moves at an angle r w/v to the vehicle, by which accelerations along its way are
    turned. A body on springs leans by part of its acceleration, and as much of gravity adds to it.
    """
    num = len(w.turn)
    felt = w.felt @ C.T
    J = np.zeros((num, 2, 3, _NUM))
    J[..., :3] = _window.skew(felt)  # C f turned by e has e x C f more
    J[:, 0, :, 3:6] = J[:, 1, :, 6:9] = np.eye(3)
    J[:, 0, [0, 1], [9, 10]] = w.along[:, :2]
    J[:, 0, 0, 11] = -(w.turn**2)
    J[:, 0, 1, 11] = w.turn * w.along[:, 0] / w.speed
    J[..., 12] = w.later @ C.T
    J *= units
    left = felt - w.shown - J[..., 3:] @ x[3:]
    return left.reshape(num, 6), J.reshape(num, 6, _NUM)


def _check(w: _Windows, fit: _Fit) -> None:
    """Whether samples and fixes are of one drive, and whether it tells the mounting."""
    sd = np.sqrt(np.diag(fit.covariance)[:3])
    if not sd.max() <= _SURE:
        k = int(np.argmax(sd))
        raise ValueError(
            f"The drive tells the mounting of the IMU about the axis {_AXES[k]} to {np.rad2deg(sd[k]):.3g} deg (1 "
            f"sigma), and {np.rad2deg(_SURE):.3g} are asked for: turns and braking tell the yaw, and the accelerations "
            f"of its {len(w.turn)} windows between fixes have an RMS of "
            f"{np.sqrt(np.mean(np.sum(w.along[:, :2] ** 2, axis=1))):.2g} m/s^2. State the mounting, or use a longer "
            "part of the drive."
        )
    felt = w.felt @ fit.C.T
    pairs = {"specific forces along the way": (0, 0), "specific forces across it": (0, 1), "turn rates": (1, 2)}
    # what hardly changes has no correlation to speak of
    told = {
        name: np.corrcoef(felt[:, *k], w.shown[:, *k])[0, 1] for name, k in pairs.items() if np.ptp(w.shown[:, *k]) > 0
    }
    off = {name: r for name, r in told.items() if not r >= _ALIKE}
    if off:
        said = ", ".join(f"{name} {r:.2f}" for name, r in off.items())
        raise ValueError(
            f"However the IMU is mounted, it does not feel what the fixes show (correlations: {said}): look at the "
            "clocks of both (inspect_record), at the sign of the accelerometers, which is -9.8 m/s^2 down at rest, and "
            "whether the axes of gyros and accelerometers are the same ones of a right-handed system."
        )
