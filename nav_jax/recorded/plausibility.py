"""What of a record contradicts the rest of it: said by name, before a filter makes numbers of it.

What cannot be is an error: fixes of another clock, places off the Earth, gravity that points up where the vehicle
starts. What no vehicle is known to do, or what looks like another unit, is a warning. Units are told by ratios: what
two sensors say of the same motion is regressed, and the ratio is named where the two go together closely.
"""

import warnings
from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import concrete
from gmwm_jax._internal.gravity import doubt
from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import AbstractReceiver
from nav_jax.filter.initial import InitialUncertainty, warn_of_attitude
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.geodetic import A, warn_of_far_origin
from nav_jax.kinematics.state import NavState

_BEGIN = 1.0
"""s, over which specific forces are averaged at the start."""

_UP = 0.5
"""Times gravity: a mean specific force that points down as much is that of no vehicle which starts."""

_TILTED = np.deg2rad(60.0)
"""rad between gravity and the specific force: 1.7 g along the ground for a second would do it."""

_WEIGHTLESS = (0.3, 0.6)
"""Times gravity: a specific force whose mean is less, and whose size is less in the mean, as that of a body which
tumbles is not, is that of a fall, or has lost its gravity."""

_FASTEST = 35.0
"""rad/s, of gyros with the widest common range, 2000 deg/s."""

_TOGETHER = 0.6
"""Correlation from which on two sensors are said to see the same motion."""

_SURE = 5.0
"""Standard errors of a ratio that it is from zero at least."""

_FEWEST = 10
"""Intervals of which one is told."""

_MOVING = 2.0
"""m/s, from which a velocity has a course."""

_NEAR = 0.1
"""By which a ratio may differ from that of two units."""

_WIDE = 50e3
"""m about the middle of the fixes, beyond which a flat Earth is another one."""

_WRONG = 25.0
"""Squares of innovations over those that the filter states, of the median fix: five standard deviations."""

_POSITIONS = {"feet taken for metres": 3.28084, "degrees taken for radians": np.rad2deg(1.0)}
_VELOCITIES = {
    "km/h taken for m/s": 3.6,
    "feet per second taken for m/s": 3.28084,
    "miles per hour taken for m/s": 2.23694,
    "knots taken for m/s": 1.94384,
}
"""Mistake -> ratio of accelerations of the fixes to those of the IMU. None is below one: a body that pitches with its
accelerations, or as its path does, adds a part of gravity, and such ratios mean nothing."""

_RATES = {"gyros in deg/s taken for rad/s": np.deg2rad(1.0), "gyros in rad/s converted once more": np.rad2deg(1.0)}
_MOUNTED = "the mounting of the IMU (nav_jax.recorded.find_mounting, mounting of a file) is another"

_HEIGHTS = {"feet beside metres": 3.28084, "metres beside feet": 0.3048}


class ImplausibleRecordWarning(UserWarning):
    """A warning that parts of a record contradict each other."""


def check_record(
    imu: Imu,
    aiding: Sequence[Fixes],
    position: Float64[np.ndarray, "3"],
    quaternion: Float64[np.ndarray, "4"],
    earth: AbstractEarth,
) -> None:
    """Raise on what cannot be.

    Raises
    ------
    ValueError
        Fixes before or after the record; positions off the Earth; gravity that points up where the record starts.
    """
    for fixes in aiding:
        _check_times(fixes, float(imu.epochs[0]), float(imu.epochs[-1]))
        if (p := _positions(fixes)) is not None:
            try:
                earth.check(p, None)
            except ValueError as error:
                raise ValueError(f"The fixes of {fixes.sensor.name}: {error}") from error
    _, force, g = _at_start(imu, position, quaternion, earth)
    if force[2] > _UP * g > 0:
        raise ValueError(
            f"Gravity points up at the start: turned by its attitude, the specific force is {force.round(2).tolist()} "
            f"m/s^2 north, east, down, and level and at rest it is -{g:.2f} down. Turn the samples by "
            "nav_jax.recorded.mounted, (pi, 0, 0) for an IMU upside down; change the sign of accelerometers that say "
            "+1 g along an axis that points down; or mend the attitude."
        )


def warn_of_record(
    imu: Imu, aiding: Sequence[Fixes], start: NavState, initial: InitialUncertainty, earth: AbstractEarth | None
) -> None:
    """Warn of what no vehicle does, and of what looks like another unit; the start is one of one run."""
    earth = FlatEarth() if earth is None else earth
    position, velocity, quaternion = (np.asarray(x)[:, 0] for x in (start.p, start.v, start.q))
    warn_of_attitude(initial, stacklevel=4)
    with np.errstate(all="ignore"):  # of what is not finite a filter speaks
        found = _doubts(imu, aiding, position, velocity, quaternion, initial, earth)
    for text in found:
        warnings.warn(text, ImplausibleRecordWarning, stacklevel=3)
    for fixes in aiding:
        if not earth.is_flat and (p := _positions(fixes)) is not None:
            warn_of_far_origin(p, stacklevel=4)


def _doubts(
    imu: Imu,
    aiding: Sequence[Fixes],
    position: Float64[np.ndarray, "3"],
    velocity: Float64[np.ndarray, "3"],
    quaternion: Float64[np.ndarray, "4"],
    initial: InitialUncertainty,
    earth: AbstractEarth,
) -> list[str]:
    found = [*_of_forces(imu, position, quaternion, earth), *_of_rates(imu)]
    receivers = [f for f in aiding if isinstance(f.sensor, AbstractReceiver)]
    for fixes in receivers:
        found += _of_motion(imu, fixes)
        p = _positions(fixes)
        if p is None:
            continue
        found += _of_start(fixes, p, float(imu.epochs[0]), position, velocity, initial)
        if earth.is_flat:
            spread = float(np.median(np.linalg.norm(p - np.median(p, axis=0), axis=1)))
            if spread > _WIDE:
                found.append(
                    f"Half of the fixes of {fixes.sensor.name} lie more than {spread / 1e3:.4g} km from their middle, "
                    f"where gravity is tilted by {np.rad2deg(spread / A):.2g} deg, and the Earth is flat: give "
                    "earth=nav_jax.Wgs84(origin). Or a unit is another."
                )
        for other in aiding:
            if isinstance(other.sensor, Barometer):
                found += _of_heights(other, fixes, p)
    return found


def warn_of_innovations(name: str, nis: Float64[np.ndarray, " F"], components: int) -> None:
    """Warn where what a filter says of its innovations is far from what they are."""
    if len(nis) < _FEWEST or not np.median(nis) > _WRONG * components:
        return
    off = np.sqrt(np.median(nis) / components)
    warnings.warn(
        f"The innovations of {name} are {off:.3g} times as large as the filter states, of the median fix: its numbers "
        "mean nothing. Look at the units and axes of both, the mounting of the IMU, the attitude at the start, the "
        "clocks (nav_jax.recorded.inspect_record), and at last at the noise model.",
        ImplausibleRecordWarning,
        stacklevel=3,
    )


def warn_of_open_outages(aiding: Sequence[Fixes]) -> None:
    """Warn of outages that no fix follows, which a smoother cannot bridge."""
    for fixes in aiding:
        last = fixes.time[fixes.given][-1]
        for a, b in fixes.outages:
            if a > last:
                warnings.warn(
                    f"No fix of {fixes.sensor.name} comes after the outage {a:g} to {b:g} s, the last one is at "
                    f"{last:g} s: the smoother has nothing behind it and says there what the filter says.",
                    ImplausibleRecordWarning,
                    stacklevel=3,
                )


def _check_times(fixes: Fixes, first: float, last: float) -> None:
    """Up to what a schedule forgives."""
    time, slack = fixes.time, 1e-6
    before, after = time < first - slack, time > last + slack
    num = int(before.sum() + after.sum())
    if not num:
        return
    where = " and ".join(f"{m.sum()} {word} it" for m, word in ((before, "before"), (after, "after")) if m.any())
    way_out = (
        "Their clocks count something else: bring the fixes to that of the IMU."
        if num == len(time)
        else f"Leave them out, those before {first:.10g} s and those after {last:.10g} s, or look at the clocks."
    )
    raise ValueError(
        f"{num} of {len(time)} fixes of {fixes.sensor.name}, which are of {time[0]:.10g} to {time[-1]:.10g} s, lie "
        f"outside the run of the IMU from {first:.10g} to {last:.10g} s, {where}. {way_out}"
    )


def _positions(fixes: Fixes) -> Float64[np.ndarray, "F 3"] | None:
    sensor = fixes.sensor
    return fixes.value[:, :3] if isinstance(sensor, AbstractReceiver) and "position" in sensor.parts else None


def _at_start(
    imu: Imu, position: np.ndarray, quaternion: np.ndarray, earth: AbstractEarth
) -> tuple[float, Float64[np.ndarray, "3"], float]:
    """Size of the mean specific force, the force itself in n, and gravity, m/s^2."""
    f = imu.accel[imu.time <= imu.time[0] + _BEGIN].mean(axis=0)
    force = np.asarray(rotation.rotate(jnp.asarray(quaternion)[:, None], jnp.asarray(f)[:, None]))[:, 0]
    return float(np.linalg.norm(f)), force, float(np.linalg.norm(earth.gravity_n(jnp.asarray(position))))


def _of_forces(imu: Imu, position: np.ndarray, quaternion: np.ndarray, earth: AbstractEarth) -> list[str]:
    size, force, g = _at_start(imu, position, quaternion, earth)
    if not 5.0 < g < 15.0:  # a gravity of one's own
        return []
    units = doubt(imu.gyro, imu.accel)
    if units is not None:
        return [units]
    usual = float(np.linalg.norm(imu.accel, axis=1).mean())
    mean = float(np.linalg.norm(imu.accel.mean(axis=0)))
    if mean < _WEIGHTLESS[0] * g and usual < _WEIGHTLESS[1] * g:
        return [
            f"The specific force is {mean:.3g} m/s^2 in the mean over the record, and gravity is {g:.4g}: a body "
            "falls, or gravity was taken out, as of the linear acceleration of phones. A mechanisation needs it."
        ]
    tilt = float(np.arccos(np.clip(-force[2] / size, -1.0, 1.0)))
    if tilt > _TILTED:
        return [
            f"The specific force at the start, turned by its attitude, is {force.round(2).tolist()} m/s^2 north, east, "
            f"down, {np.rad2deg(tilt):.3g} deg off the vertical: the mounting of the IMU (nav_jax.recorded.mounted) or "
            "the attitude is another."
        ]
    return []


def _of_rates(imu: Imu) -> list[str]:
    usual = float(np.median(np.linalg.norm(imu.gyro, axis=1)))
    if usual <= _FASTEST:
        return []
    return [
        f"The gyros turn by {usual:.4g} rad/s in the median, beyond the 2000 deg/s of the widest ranges: they look "
        f"like deg/s ({np.deg2rad(usual):.3g} rad/s)."
    ]


def _of_start(
    fixes: Fixes,
    p: Float64[np.ndarray, "F 3"],
    first: float,
    position: Float64[np.ndarray, "3"],
    velocity: Float64[np.ndarray, "3"],
    initial: InitialUncertainty,
) -> list[str]:
    """The start may be wrong by ten standard deviations, and a vehicle may accelerate by 4 g up to the speed of sound.

    The nearest of the first fixes counts: one may be an outlier.
    """
    P = concrete(initial.covariance)
    if P is None:
        return []
    sd = np.sqrt(np.diag(P).clip(0))
    C = fixes.covariance
    of_fix = np.asarray(fixes.sensor.believed)[:3].max() if C is None else np.sqrt(C[:3, range(3), range(3)].max())
    dt = fixes.time[:3] - first
    gone = (np.linalg.norm(velocity) + 10 * sd[3:6].max()) * dt + np.minimum(20 * dt**2, 340 * dt)
    apart = np.linalg.norm(p[:3] - position, axis=1)
    beyond = apart - (100.0 + 10 * (sd[:3].max() + of_fix) + gone)
    i = int(np.argmin(beyond))
    if beyond[i] <= 0:
        return []
    return [
        f"The record starts {apart[i]:.4g} m from the fix of {fixes.sensor.name} at {fixes.time[i]:g} s, and the start "
        f"is claimed to be known to {sd[:3].max():.3g} m: both are north, east, down in m about one "
        "origin."
    ]


def _of_motion(imu: Imu, fixes: Fixes) -> list[str]:
    """Turns and accelerations of the fixes beside those of the IMU, of a vehicle that heads where it goes."""
    name, found = fixes.sensor.name, []
    p = _positions(fixes)
    tracks = []
    if p is not None and len(p) > 1:
        steps = np.diff(fixes.time)[:, None]
        tracks.append(("positions", fixes.time[:-1] + steps[:, 0] / 2, np.diff(p, axis=0) / steps, _POSITIONS))
    if p is None or fixes.value.shape[1] > 3:
        tracks.append(("velocities", fixes.time, fixes.value[:, -3:], _VELOCITIES))
    for what, at, v, mistakes in tracks:
        turned, by_gyros, pushed, by_accels, across = _seen(imu, at, v)
        ratio = _ratio(by_gyros, turned)
        if text := _named(ratio, _RATES):
            found.append(f"The {what} of {name} turn {ratio:.3g} times as much as the gyros, as of {text}.")
        elif _is_mirrored(ratio):
            found.append(
                f"The {what} of {name} turn right where the gyros turn left, {ratio:.3g} times as much. The axes of "
                "the body are front, right, down, and those of the fixes north, east, down: east and north may be "
                "swapped, or z of the IMU point up."
            )
        ratio = _ratio(by_accels, pushed)
        if text := _named(ratio, mistakes):
            found.append(
                f"The {what} of {name} speed up {ratio:.3g} times as much as the accelerometers say, as of {text}."
            )
        elif _is_mirrored(ratio):
            found.append(f"The {what} of {name} speed up where the accelerometers feel that it brakes: {_MOUNTED}.")
        elif ratio is None and (side := _ratio(pushed, across)) is not None and 0.5 < abs(side) < 2.0:
            found.append(
                f"The {what} of {name} speed up as the accelerometers feel to the {'right' if side > 0 else 'left'}, "
                f"and not ahead: {_MOUNTED}."
            )
    return found


def _seen(
    imu: Imu, at: Float64[np.ndarray, " F"], v: Float64[np.ndarray, "F 3"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Between successive velocities: turns about down in rad, and gains of speed in m/s^2, each of fixes and IMU.

    Not what is felt in turns: roads and wings bank. Last, what is felt to the right.
    """
    inside = (at >= imu.epochs[0]) & (at <= imu.epochs[-1])
    at, v = at[inside], v[inside]
    speed = np.hypot(v[:, 0], v[:, 1])
    steps = np.diff(at)
    usual = np.median(steps) if len(steps) else 0.0
    usable = (speed[1:] > _MOVING) & (speed[:-1] > _MOVING) & (steps < 1.5 * usual)
    course = np.arctan2(v[:, 1], v[:, 0])
    turned = (np.diff(course) + np.pi) % (2 * np.pi) - np.pi
    samples = np.stack([imu.gyro[:, 2], imu.accel[:, 0], imu.accel[:, 1]], axis=1)
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(samples, axis=0)])
    theta, gained, aside = (np.diff(np.interp(at, imu.epochs, x / imu.rate)) for x in sums.T)
    along, felt, across = (_centred((x / steps)[usable]) for x in (np.diff(speed), gained, aside))
    return turned[usable], theta[usable], along, felt, across


def _centred(x: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Less the mean: a tilt is a constant of an accelerometer, an offset one of a barometer."""
    return x - x.mean() if len(x) else x


def _of_heights(baro: Fixes, receiver: Fixes, p: Float64[np.ndarray, "F 3"]) -> list[str]:
    """What a barometer climbs beside what the fixes do, on a flat Earth: to a few thousandths in a hundred km."""
    inside = (baro.time >= receiver.time[0]) & (baro.time <= receiver.time[-1])
    climbed, height = -np.interp(baro.time[inside], receiver.time, p[:, 2]), baro.value[inside, 0]
    if len(height) < _FEWEST:
        return []
    ratio = _ratio(_centred(climbed), _centred(height))
    names = f"{baro.sensor.name} and of {receiver.sensor.name}"
    if _is_mirrored(ratio):
        return [f"The heights of {names} go opposite ways: one of them is a depth. Positions are north, east, down."]
    text = _named(ratio, _HEIGHTS)
    return [f"The heights of {names} change in the ratio {ratio:.3g}, as of {text}."] if text else []


def _ratio(x: Float64[np.ndarray, " n"], y: Float64[np.ndarray, " n"]) -> float | None:
    """Of y to x by least squares, where the two go together; the noise of y makes it no smaller."""
    power = float(np.sqrt((x @ x) * (y @ y))) if len(x) >= _FEWEST else 0.0
    if not power > 0:
        return None
    r = float(np.clip(x @ y / power, -1.0, 1.0))
    if abs(r) < _TOGETHER or r**2 * (len(x) - 2) < _SURE**2 * (1 - r**2):
        return None
    return float(x @ y / (x @ x))


def _named(ratio: float | None, mistakes: Mapping[str, float]) -> str | None:
    """The mistake of which a ratio is that, if there is one."""
    off = {} if ratio is None else {name: abs(ratio / r - 1) for name, r in mistakes.items()}
    nearest = min(off, key=off.__getitem__, default=None)
    return nearest if nearest is not None and off[nearest] < _NEAR else None


def _is_mirrored(ratio: float | None) -> bool:
    """Up to a bank of 60 deg."""
    return ratio is not None and -2.0 < ratio < -0.5
