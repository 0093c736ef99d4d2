"""Where a recorded drive stands, told before the filter runs: by the samples of its IMU, and by fixes of velocity.

A small variance alone does not tell a stop: a car that rolls off a slope with its engine off has none either. So a stop
is two windows or more, one after the other, in which (Skog et al. 2010, with the last two conditions added)

- specific force and body rate vary by less than they do at rest,
- the mean specific force is that of the first of these windows,
- and every fix of velocity, where there are any, is zero by what it says of itself.

After its end the vehicle has to have moved before another one begins.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.standstill import AbstractStandstill
from nav_jax.imu.imu import Imu
from nav_jax.recorded.gnss.record import GnssRecord

_TIMES_REST = 3.0
"""What varies more than this many times as much as is usual where fixes of velocity are zero, moves."""
_SIGMAS = 4.0
_LEAST_SD = 0.02
"""m/s: fixes of velocity that say that they are better are not believed."""
_USUAL_SD = 0.1
"""m/s, of fixes of velocity that say nothing of themselves."""


def stops(
    imu: Imu,
    fixes: GnssRecord | None = None,
    *,
    accel_sd: Real | None = None,
    gyro_sd: Real | None = None,
    window: Real = 0.5,
    same_force: Real = 0.1,
) -> tuple[tuple[float, float], ...]:
    """Find where the vehicle of a record stands.

    Parameters
    ----------
    imu
        The record.
    fixes
        With velocities, on the clock of the IMU; none if left out.
    accel_sd, gyro_sd
        Standard deviations in m/s^2 and rad/s, of the three axes together, below which samples of a window are those of
        a vehicle at rest; an engine that runs is in them. Left out, they are three times the median of the windows in
        which fixes say that it stands.
    window
        s.
    same_force
        m/s^2, by which the mean specific force of a window may differ from that of the first one.

    Returns
    -------
    Beginning and end of each stop in s, whole windows.

    Raises
    ------
    ValueError
        Neither velocities nor both standard deviations; a number that is not positive; a window of fewer than four
        samples or longer than half of the record.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.static(duration=4.0, rate=20.0))
    >>> nj.recorded.stops(samples, accel_sd=0.1, gyro_sd=0.01)
    ((0.0, 4.0),)
    """
    length, same = number("window", window), number("same_force", same_force)
    size = round(length * imu.rate)
    num = len(imu) // size if size else 0
    if size < 4 or num < 2:
        raise ValueError(
            f"A window of {length:g} s has {size} samples at {imu.rate:g} Hz, and the record {num} of them: it takes "
            "four samples and two windows."
        )
    force, rate = (x[: num * size].reshape(num, size, 3) for x in (imu.accel, imu.gyro))
    spread = [np.sqrt(x.var(axis=1).sum(axis=1)) for x in (force, rate)]
    begin = imu.time[: num * size : size]
    still = np.ones(num, dtype=bool) if fixes is None else _still(fixes, begin, size / imu.rate)
    for what, sd, given in zip(("accel_sd", "gyro_sd"), spread, (accel_sd, gyro_sd), strict=True):
        still &= sd < _limit(what, sd, given, fixes, still)
    mean = force.mean(axis=1)
    found, at = [], 0
    while at < num - 1:
        if not (still[at] and still[at + 1] and np.linalg.norm(mean[at + 1] - mean[at]) < same):
            at += 1
            continue
        last = at + 1
        while last + 1 < num and still[last + 1] and np.linalg.norm(mean[last + 1] - mean[at]) < same:
            last += 1
        found.append((float(begin[at]), float(begin[last] + size / imu.rate)))
        at = last + 1
        while at < num and still[at]:  # rolls, perhaps: what is smooth and pulls otherwise is no other stop
            at += 1
    return tuple(found)


def _limit(what: str, sd: np.ndarray, given: Any, fixes: GnssRecord | None, still: Bool[np.ndarray, " W"]) -> float:
    if given is not None:
        return number(what, given)
    if fixes is None:
        raise ValueError(
            f"Give fixes with velocities, or the standard deviations at rest: {what} is missing, and samples alone do "
            "not tell it."
        )
    return _TIMES_REST * float(np.median(sd[still])) if still.any() else 0.0


def _still(fixes: GnssRecord, begin: Float64[np.ndarray, " W"], length: float) -> Bool[np.ndarray, " W"]:
    """The windows in which every velocity is zero, and that have one inside or within half a window."""
    if fixes.velocity is None:
        raise ValueError("The fixes have no velocities: state the standard deviations at rest, accel_sd and gyro_sd.")
    there = np.isfinite(fixes.velocity[:, :2]).all(axis=1)
    time, v = fixes.time[there], fixes.velocity[there, :2]
    sd = np.full(len(time), _USUAL_SD)
    if fixes.velocity_covariance is not None:
        C = fixes.velocity_covariance[there]
        sd = np.maximum(np.sqrt(np.maximum(C[:, 0, 0], C[:, 1, 1])), _LEAST_SD)
    moves = np.concatenate([[0], np.cumsum(np.hypot(*v.T) > _SIGMAS * sd)])
    first = np.searchsorted(time, begin - length / 2)
    last = np.searchsorted(time, begin + 1.5 * length)
    return (last > first) & (moves[last] == moves[first])


def standing(sensor: AbstractStandstill, intervals: Sequence[tuple[float, float]]) -> Fixes:
    """Make the fixes of a sensor that knows of nothing but stops: zero, at its rate from the beginning of each on.

    Parameters
    ----------
    sensor
        Such as ``nj.aiding.ZeroVelocity(rate=5.0, sd=0.02)``.
    intervals
        Beginning and end of each stop in s, such as of `stops`.

    Raises
    ------
    ValueError
        There is no stop, or none lasts a period.

    Examples
    --------
    >>> fixes = nj.recorded.standing(nj.aiding.ZeroVelocity(rate=2.0, sd=0.02), [(3.0, 4.2)])
    >>> fixes.time.tolist()
    [3.5, 4.0]
    """
    period = 1 / sensor.rate
    times = [a + period * np.arange(1, int((b - a) / period + 1e-9) + 1) for a, b in intervals]
    time = np.concatenate([np.zeros(0), *times])
    if not len(intervals):
        raise ValueError(f"There is no stop for {sensor.name}: leave it out.")
    if not len(time):
        raise ValueError(f"No stop of {len(intervals)} lasts the {period:g} s of a period of {sensor.name}.")
    return Fixes(sensor, time, np.zeros((len(time), len(sensor.axes))))
