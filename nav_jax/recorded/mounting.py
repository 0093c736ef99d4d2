"""How an IMU sits in a vehicle on wheels: turned to the vehicle's axes as stated, or as found from the drive itself.

A vehicle on wheels goes where it points. The velocities of the fixes are so the vehicle's front axis, level but for the
slope of the road, and their changes less gravity are the specific force along its axes, their turns its turn rates. The
IMU has both along axes of its own: the rotation between the two is Wahba's problem, solved by Davenport's method and
from there by least squares, in which biases, a distance from the rear axle and soft springs have a place beside it.

What is left of a window is no white noise: slopes across the road, body roll and clocks last for many. The covariance
is therefore that by the jackknife over blocks of windows (to first order: Bell and McCaffrey 2002), beside what is
believed of biases and of the road. A minute has six blocks, whose scatter is small by chance now and then: so much of
the covariance that independent windows would have is added as Morel, Bokossa and Neerchal (2003) do. Large residuals,
as those of a vehicle that backs out of a yard, count less (Huber).

References
----------
Bell, R. M., McCaffrey, D. F. (2002), Bias reduction in standard errors for linear regression with multi-stage samples.
Survey Methodology 28(2).
Huber, P. J. (1964), Robust estimation of a location parameter. Annals of Mathematical Statistics 35(1).
Morel, J. G., Bokossa, M. C., Neerchal, N. K. (2003), Small sample correction for the variance of GEE estimators.
Biometrical Journal 45(4).
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import increasing, number, real_array
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
_SETTLED = 10
"""Iterations, after which scales are kept: medians may jump to and fro for ever."""
_ITERATIONS = 50
_SMALL = 1e-9
"""rad of a last step."""
_SURE = np.deg2rad(10.0)
"""rad, beyond which a mounting is not told."""
_ALIKE = 0.3
"""Correlation of what an IMU feels with what fixes show, below which they are not of one drive."""
_FACTOR = 1.5
"""By which the one is larger than the other at most, beyond what noise does: units are factors of 1.9 and more."""
_GRAVITY = (0.8, 1.25)
"""Between which the specific force is, as a part of gravity."""
_SPRINGS = 0.1
"""Standard deviation of the part by which springs add to accelerations: a body that leans lets gravity in."""
_CROSS_SLOPE = np.deg2rad(1.0)
"""rad, of the mean of a drive: roads fall by 2 % to their sides."""
_ANGLES = ("roll", "pitch", "yaw")
_AXES = ("front", "right", "down")


class _Signal(NamedTuple):
    """What both an IMU and fixes know of a motion."""

    name: str
    at: tuple[int, int]
    """Sensor and axis of the vehicle."""
    least: float
    """Standard deviation from which on it says something: gentler motion is noise or the lean of a road."""
    most: float
    """That is shown, unless more is felt: single fixes that are wrong exceed it."""


_SIGNALS = (
    _Signal("specific forces along the way", (0, 0), 0.3, 5.0),
    _Signal("specific forces across it", (0, 1), 0.3, 5.0),
    _Signal("turn rates", (1, 2), 0.03, 1.0),
)

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
    covariance: Float64[np.ndarray, "3 3"]
    """Of its rotation vector, but for the slope across the road."""


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
    direction of travel; the roll against a road that is level across, on the mean of the drive. Where hardly anybody
    turns or brakes, slopes of the road alone tell the yaw; its errors are then up to half as large again as claimed.

    Parameters
    ----------
    imu
        Along its own axes, on the clock of the fixes: `inspect_record` tells an offset.
    fixes
        With velocities, or positions from which they follow.
    averaged
        s before a fix of which its velocity is the mean, as for `nj.Gnss`; without meaning for positions.
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
        with each other: clocks that are apart, axes of a left-handed system, accelerometers of the other sign, units;
        fixes whose times do not increase.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.racetrack(duration=90.0, rate=20.0, attitude="level"))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10], velocity=exact.velocity[::10])
    >>> found = nj.recorded.find_mounting(nj.recorded.mounted(samples, (0.0, 0.0, -1.5)), fixes)
    >>> round(float(found.euler[2]), 2)  # yaw
    1.5
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
    return mounting_by(time, steps * imu.gyro, steps * imu.accel, fixes, belief, late, number("gravity", gravity))


def mounting_by(
    epochs: Float64[np.ndarray, " E"],
    turns: Float64[np.ndarray, "E-1 3"],
    pushes: Float64[np.ndarray, "E-1 3"],
    fixes: GnssRecord,
    belief: Belief = _BELIEF,
    late: float = 0.0,
    gravity: float = STANDARD_GRAVITY,
) -> Mounting:
    """The same by increments of gyro and accelerometer between epochs in any steps; velocities are `late` by some s.

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
    _check_gravity(w, gravity)
    fit = _fitted(w, belief.units())
    _check_alike(w, fit)
    _check_told(w, fit)
    q = np.asarray(rotation.quat_from_dcm(jnp.asarray(fit.C)))
    covariance = fit.covariance + np.diag([belief.cross_slope**2, 0.0, 0.0])
    euler = np.asarray(rotation.euler_from_quat(jnp.asarray(q)))
    return Mounting(euler, covariance, num)


def _windows(
    epochs: np.ndarray, gyro: np.ndarray, accel: np.ndarray, fixes: GnssRecord, late: float, gravity: float
) -> _Windows:
    if len(fixes) > 1:
        increasing("The time of the fixes", fixes.time)
    time, v, half = _velocities(fixes, late)
    step = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    many = max(1, int(np.ceil(_WINDOW / step - 1e-6)))
    rows = np.arange(0, len(time), many)
    a, b = rows[:-1], rows[1:]
    speed = np.hypot(*v.T[:2])
    usable = time[b] - time[a] < 1.5 * many * step
    usable &= (time[a] - _SHIFT - half >= epochs[0]) & (time[b] + _SHIFT + half <= epochs[-1])
    usable &= (speed[a] >= _SPEED) & (speed[b] >= _SPEED)
    a, b = a[usable], b[usable]
    width = (time[b] - time[a])[:, None]
    both = np.stack([accel, gyro], axis=1)
    before, felt, after = (
        (_smoothed(epochs, both, time[b] + by, half) - _smoothed(epochs, both, time[a] + by, half)) / width[:, None]
        for by in (-_SHIFT, 0.0, _SHIFT)
    )
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


def _smoothed(
    epochs: np.ndarray, integrals: Float64[np.ndarray, "E 2 3"], time: Float64[np.ndarray, " K"], half: float
) -> Float64[np.ndarray, "K 2 3"]:
    """Means over `half` s to both sides: as fixes smooth what they show, what is felt has to be smoothed."""
    if half == 0.0:
        return _window.at(epochs, integrals, time)
    twice = _window.integral(epochs, integrals)
    return (_window.at(epochs, twice, time + half) - _window.at(epochs, twice, time - half)) / (2 * half)


def _velocities(fixes: GnssRecord, late: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Times, velocities, and s to both sides of which these are means.

    Where the file has none, also none down, they are differences of positions.
    """
    if fixes.velocity is None:
        time, v = velocities(fixes)
        return time[1:-1], v[1:-1], float(np.median(np.diff(time)))
    there = np.isfinite(fixes.velocity[:, :2]).all(axis=1)
    v = fixes.velocity[there].copy()
    if not np.isfinite(v[:, 2]).all() and there.sum() > 2:
        v[:, 2] = np.gradient(fixes.position[there, 2], fixes.time[there])
    return fixes.time[there] - late, v, late


def _fitted(w: _Windows, units: Float64[np.ndarray, " n"]) -> _Fit:
    size = np.array([[0.5], [0.05]])  # m/s^2 and rad/s, which roads do
    shown, felt = ((x / size).reshape(-1, 3) for x in (w.shown, w.felt))
    C = np.asarray(rotation.dcm_from_quat(jnp.asarray(davenport(shown, felt))))
    x, prior = np.zeros(_NUM), np.repeat([0.0, 1.0], [3, _NUM - 3])
    # of a rotation nothing is known, which is within half a turn: what the drive does not tell makes nothing singular
    known = np.maximum(prior, np.pi**-2)
    sd, pull = np.full(6, np.inf), np.zeros((0, 6))
    for i in range(_ITERATIONS):
        left, slope = _rows(w, C, x, units)
        sd = 1.4826 * np.median(np.abs(left), axis=0) + _LEAST if i < _SETTLED else sd
        weight = np.minimum(1.0, _HUBER * sd / np.maximum(np.abs(left), sd)) / sd**2
        pull = weight * left
        scores = np.einsum("kin,ki->kn", slope, pull)
        H = np.einsum("kin,ki,kim->nm", slope, weight, slope) + np.diag(known)
        step = np.linalg.solve(H, scores.sum(axis=0) - prior * x)
        if np.abs(step[:3]).max() < _SMALL:
            break
        C = np.asarray(_window.matrices(jnp.asarray(step[:3]))) @ C
        x[3:] += step[3:]
    # a score that is cut off has no slope
    inside = (np.abs(left) <= _HUBER * sd) / sd**2
    starts = np.arange(0, len(scores), _BLOCK)
    bends = np.einsum("kin,ki,kim->knm", slope, inside, slope)
    bends[:, :3, :3] += _curvature(w.felt @ C.T, pull.reshape(-1, 2, 3))
    parts = np.add.reduceat(bends, starts)
    H = parts.sum(axis=0) + np.diag(known)
    if np.linalg.eigvalsh(H)[0] <= 0.0:
        return _Fit(C, np.full((3, 3), np.inf))
    # what a fit without a block would change
    jumps = np.linalg.solve(H - parts, np.add.reduceat(scores, starts)[:, :, None])[:, :, 0]
    P, by_blocks = np.linalg.inv(H), (1 - 1 / len(starts)) * jumps.T @ jumps
    believed = P @ np.diag(known) @ P
    larger = np.trace(np.linalg.solve(P[:3, :3], by_blocks[:3, :3])) / 3
    few = min(0.5, 3 / max(len(starts) - 3, 1))
    return _Fit(C, (by_blocks + believed + few * max(1.0, larger) * (P - believed))[:3, :3])


def _curvature(felt: Float64[np.ndarray, "K 2 3"], pull: Float64[np.ndarray, "K 2 3"]) -> Float64[np.ndarray, "K 3 3"]:
    """By what is left over, the information on the rotation is other than that of linear rows.

    With it felt times shown stands in place of felt times felt, so that noise of the samples makes no yaw.
    """
    outer = np.einsum("ksi,ksj->kij", pull, felt)
    return (outer + outer.swapaxes(1, 2)) / 2 - np.einsum("kii->k", outer)[:, None, None] * np.eye(3)


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


def _check_gravity(w: _Windows, gravity: float) -> None:
    size = float(np.median(np.linalg.norm(w.felt[:, 0], axis=1)))
    if not _GRAVITY[0] * gravity <= size <= _GRAVITY[1] * gravity:
        raise ValueError(
            f"The accelerometers feel {size:.4g} m/s^2 (median of {len(w.turn)} windows between fixes), and gravity is "
            f"{gravity:.4g} m/s^2: look at their units."
        )


def _signals(w: _Windows, fit: _Fit) -> list[tuple[np.ndarray, np.ndarray]]:
    """What is felt and what is shown of each, about its mean."""
    felt, found = w.felt @ fit.C.T, []
    for _, at, _, usual in _SIGNALS:
        x = felt[:, *at]
        most = max(usual, _FACTOR * np.abs(x).max())
        y = np.clip(w.shown[:, *at], -most, most)
        found.append((x - x.mean(), y - y.mean()))
    return found


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    return float(x @ y / max(np.linalg.norm(x) * np.linalg.norm(y), _LEAST**2))


def _check_alike(w: _Windows, fit: _Fit) -> None:
    """Whether samples and fixes are of one drive, by what moves enough to say so."""
    apart, factors = [], []
    for (name, _, least, _), (x, y) in zip(_SIGNALS, _signals(w, fit), strict=True):
        # of what is shown alone more is asked for: fixes are noisier
        if max(x.std(), y.std() / 3) < least:
            continue
        if not (r := _correlation(x, y)) >= _ALIKE:
            apart.append(f"{name} {r:.2f}")
        elif x @ y > _FACTOR * y @ y or _FACTOR * x @ x < x @ y:  # noise of either makes the one true, or the other
            factors.append(f"{name} {x.std() / y.std():.2g}")
    if apart:
        raise ValueError(
            "However the IMU is mounted, it does not feel what the fixes show (correlations: "
            f"{', '.join(apart)}): look at the clocks of both (inspect_record), at the sign of the accelerometers, "
            "which is -9.8 m/s^2 down at rest, at how noisy the fixes are, and whether the axes of gyros and "
            "accelerometers are the same ones of a right-handed system."
        )
    if factors:
        raise ValueError(
            f"What the IMU feels is not as large as what the fixes show (factors: {', '.join(factors)}): look at the "
            "units of both."
        )


def _check_told(w: _Windows, fit: _Fit) -> None:
    """By turns and braking that are both felt and shown: noise of fixes is as well explained by any yaw."""
    sd = np.sqrt(np.diag(fit.covariance))
    felt, shown = (np.concatenate(x) for x in zip(*_signals(w, fit)[:2], strict=True))
    r = _correlation(felt, shown)
    if sd.max() <= _SURE and r >= _ALIKE:
        return
    told = ", ".join(f"{x:.2g}" for x in np.rad2deg(sd))
    raise ValueError(
        f"The drive does not tell the mounting of the IMU to {np.rad2deg(_SURE):.3g} deg (1 sigma; it tells {told} "
        "about front, right, down): turns and braking tell the yaw, and the horizontal accelerations of its "
        f"{len(w.turn)} windows between fixes, an RMS of {np.sqrt(np.mean(shown**2)):.2g} m/s^2 by the fixes, have a "
        f"correlation of {r:.2f} with what is felt. State the mounting, or use a longer part of the drive."
    )
