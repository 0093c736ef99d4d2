"""By how much the clock of an IMU is ahead of that of fixes: from what both see of turns and of changes of speed.

Between two fixes the course of a vehicle changes by the integral of its turn rate, and its speed by that of the
specific force along it. On a level way both are linear in the integrals of the three axes of gyro and accelerometer,
however the IMU is mounted, plus a constant times the time. An antenna at a distance l ahead of the rear axle has a
course that is ahead of the heading by l/v times the turn rate: turn rates over speeds are fitted too, or they would
look like an offset, and at a constant speed nothing tells the two apart. Fits by least squares at many offsets tell
that of the smallest residuals. Its standard error is the larger one of that by the jackknife over blocks of the record,
and that by the curvature of the likelihood: where all blocks tell the same minimum of several, the first is too small.
Either is too small where the fit lacks something of the vehicle: trust an offset that several signals tell.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.recorded.gnss.record import GnssRecord

_STEP = 0.02
"""s between offsets that are tried; between them a parabola goes."""

_BLOCKS = 10
"""Of the jackknife."""

_NEAR = 5
"""Steps to each side of a minimum, for its curvature."""

_MOVING = 1.5
"""m/s, from which a velocity has a course."""

_FEWEST = 30
"""Intervals that an offset needs."""


@dataclass(frozen=True, eq=False)
class Offset:
    """By how much one clock is ahead, as one kind of signal tells it.

    Attributes
    ----------
    fixes, signal
        ``positions`` or ``velocities``, and ``turns`` or ``speed``.
    tried
        Offsets in s, shape (T,).
    correlation
        Of the fit at each of them, shape (T,).
    value, se
        s; NaN where the record does not tell.
    num
        Of intervals between fixes.
    """

    fixes: str
    signal: str
    tried: Float64[np.ndarray, " T"]
    correlation: Float64[np.ndarray, " T"]
    value: float
    se: float
    num: int

    @property
    def best(self) -> float:
        """The largest correlation."""
        return float(np.nanmax(self.correlation, initial=-1.0))


def clock_offsets(
    time: Float64[np.ndarray, " N"],
    gyro: Float64[np.ndarray, "N 3"],
    accel: Float64[np.ndarray, "N 3"],
    fixes: GnssRecord,
    *,
    most: Real = 2.0,
) -> list[Offset]:
    """What is to be added to the times of fixes so that they are on the clock of an IMU, by each pair of signals.

    Velocities and positions of one receiver may differ: velocities are often means over a past interval.

    Parameters
    ----------
    time, gyro, accel
        Samples of the IMU along any axes.
    fixes
        Positions, and velocities if there are.
    most
        s: larger offsets are not tried.

    Examples
    --------
    >>> imu, exact = nj.perfect_imu(nj.motions.lemniscate(duration=120.0, rate=50.0))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::25] - 0.3, exact.position[::25])
    >>> turns, speed = nj.recorded.clock_offsets(imu.time, imu.gyro, imu.accel, fixes)
    >>> round(turns.value, 1), round(speed.value, 1)
    (0.3, 0.3)
    """
    span = number("most", most)
    tried = _STEP * np.arange(-np.ceil(span / _STEP), np.ceil(span / _STEP) + 1)
    sources: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray | None]] = {"positions": _of_positions(fixes)}
    if fixes.velocity is not None:
        there = np.isfinite(fixes.velocity[:, :2]).all(axis=1)
        sources["velocities"] = (fixes.time[there], fixes.velocity[there, :2], None)
    found = []
    for source, (at, velocity, width) in sources.items():
        for signal, data in (("turns", gyro), ("speed", accel)):
            found.append(_offset(source, signal, tried, time, data, at, velocity, width))
    return found


def _of_positions(fixes: GnssRecord) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean velocities between fixes, their midpoints, and how long the intervals are."""
    width = np.diff(fixes.time)
    return fixes.time[:-1] + width / 2, np.diff(fixes.position[:, :2], axis=0) / width[:, None], width


def _offset(
    source: str,
    signal: str,
    tried: np.ndarray,
    time: np.ndarray,
    data: np.ndarray,
    at: np.ndarray,
    velocity: np.ndarray,
    width: np.ndarray | None,
) -> Offset:
    """One signal of one source; `width` where velocities are means over intervals of that length."""
    y, rows = _changes(signal, at, velocity)
    speed = np.maximum(np.hypot(*velocity.T), _MOVING)
    once = _summed(np.diff(time)[:, None] * data[:-1])  # a sample holds until the next
    twice = _summed(np.diff(time)[:, None] * (once[1:] + once[:-1]) / 2) if width is not None else once
    ends = 0.0 if width is None else width.max(initial=0.0) / 2
    first, last = time[0] + ends - tried[0], time[-1] - ends - tried[-1]
    rows = rows[(at[rows] >= first) & (at[rows + 1] <= last)]
    y = y[rows]
    nothing = np.full(len(tried), np.nan)
    if len(rows) < _FEWEST or not np.ptp(y) > 0:
        return Offset(source, signal, tried, nothing, np.nan, np.nan, len(rows))
    blocks = np.minimum(np.arange(len(rows)) * _BLOCKS // len(rows), _BLOCKS - 1)
    starts = np.searchsorted(blocks, np.arange(_BLOCKS))
    sums = []
    for tau in tried:
        means = _at(time, once, at + tau) if width is None else _mean(time, twice, at + tau, width)
        columns = [means[rows + 1] - means[rows], at[rows + 1] - at[rows]]
        if signal == "turns":  # over half an interval to each side
            half = np.median(np.diff(at)) / 2
            lead = (_at(time, once, at + tau + half) - _at(time, once, at + tau - half)) / (2 * half * speed[:, None])
            columns.append(lead[rows + 1] - lead[rows])
        X = np.column_stack([*columns, y])
        sums.append(np.add.reduceat(X[:, :, None] * X[:, None, :], starts, axis=0))
    sums = np.array(sums)
    whole = sums.sum(axis=1)
    variance = len(y) * np.var(y)
    residual = _residual(whole)
    correlation = np.sqrt(np.clip(1 - residual / variance, 0.0, 1.0))
    value = _lowest(tried, residual)
    parts = np.array([_lowest(tried, _residual(whole - sums[:, b])) for b in range(_BLOCKS)])
    jackknife = np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((parts - parts.mean()) ** 2))
    se = max(float(jackknife), _by_curvature(residual, len(y))) if np.isfinite(jackknife) else np.nan
    return Offset(source, signal, tried, correlation, float(value), se, len(y))


def _changes(signal: str, at: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes of course or speed from one velocity to the next, and which of them are of use."""
    speed = np.hypot(*velocity.T)
    steps = np.diff(at)
    usable = steps < 1.5 * np.median(steps)
    if signal == "speed":
        return np.diff(speed), np.flatnonzero(usable)
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    turns = (np.diff(course) + np.pi) % (2 * np.pi) - np.pi
    moving = speed > _MOVING
    return turns, np.flatnonzero(usable & moving[1:] & moving[:-1])


def _summed(areas: np.ndarray) -> np.ndarray:
    """An integral at all times from those over the steps between them."""
    return np.concatenate([np.zeros((1, areas.shape[1])), np.cumsum(areas, axis=0)])


def _at(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(at, time, x) for x in values.T])


def _mean(time: np.ndarray, integral: np.ndarray, at: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Over intervals about their midpoints."""
    return (_at(time, integral, at + width / 2) - _at(time, integral, at - width / 2)) / width[:, None]


def _residual(sums: Float64[np.ndarray, "T n n"]) -> Float64[np.ndarray, " T"]:
    """Sums of squares that a fit of the last column by the others leaves."""
    A, b = sums[:, :-1, :-1], sums[:, :-1, -1]
    x = np.einsum("tij,tj->ti", np.linalg.pinv(A, hermitian=True), b)
    return np.maximum(sums[:, -1, -1] - np.einsum("ti,ti->t", x, b), 1e-300)


def _lowest(tried: np.ndarray, residual: np.ndarray) -> float:
    """Where a parabola through the smallest of the logarithms and its neighbours is lowest; NaN at an end."""
    k = int(np.argmin(residual))
    if k in (0, len(tried) - 1):
        return float("nan")
    a, b, c = np.log(residual[k - 1 : k + 2])
    bend = a - 2 * b + c
    return float(tried[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0) * _STEP)


def _by_curvature(residual: np.ndarray, num: int) -> float:
    """Standard error of the offset of the smallest residuals: -log L is n/2 times their logarithm."""
    k = int(np.clip(np.argmin(residual), _NEAR, len(residual) - 1 - _NEAR))
    a, b, c = np.log(residual[[k - _NEAR, k, k + _NEAR]])
    curvature = num / 2 * (a - 2 * b + c) / (_NEAR * _STEP) ** 2
    return float(1 / np.sqrt(curvature)) if curvature > 0 else 0.0
