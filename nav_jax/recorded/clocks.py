"""By how much the clock of an IMU is ahead of that of fixes: from what both see of turns and of changes of speed.

Between two fixes the course of a vehicle changes by the integral of its turn rate about the vertical, where the mean
specific force points, and its speed by that of the specific force along it. On a level way the latter is linear in the
integrals of the three axes of an accelerometer, however it is mounted; a bias is a constant times the time. An antenna
at a distance l ahead of the rear axle has a course that is ahead of the heading by l/v times the turn rate w: turn
rates over speeds are fitted too, or they would look like an offset, and at a constant speed nothing tells the two
apart. Rear tyres slip outwards by an angle that grows with w v, which next to a lead looks like twice as large an
offset the other way: what is usual goes off, and what is not known of it is part of the standard error. Fits by least
squares at many offsets tell that of the smallest residuals.

Changes from fix to fix share a fix, and slopes last: what a first fit leaves is correlated. An autoregression of it
makes the rows of a second fit white (Cochrane and Orcutt 1949), in which a course counts as much as the speed. The
standard error is the larger one of that by the jackknife over blocks of the record, and of the root mean square
distance of other offsets by their likelihood: where all blocks tell the same minimum of several, the first is too
small. It is too small where the fit lacks more of the vehicle: trust an offset that several signals tell.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.recorded.gnss.record import GnssRecord

_STEP = 0.02
"""s between offsets that are tried; between them a parabola goes."""

_FINE = 20
"""Parts of a step, for the likelihood between them."""

_COARSE = 5
"""Steps between those of the first fit."""

_ORDER = 8
"""Of the autoregression of what a fit leaves; less where there are less than ten times as many intervals."""

_BLOCKS = 10
"""Of the jackknife."""

_NEAR = 0.25
"""s, over twice which to each side a turn rate is taken: less is noise, and more rounds off how turns begin."""

_SLIP = (0.003, 0.002)
"""rad per m/s^2 to the side, of rear tyres, and how far others are from it: 0 if they are rigid, 0.006 if soft. Set
with two recordings of cars at hand, which have 0.003 and 0.0055 and so do not confirm it."""

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
    down = -accel.mean(axis=0)
    about = gyro @ down[:, None] / max(float(np.linalg.norm(down)), 1e-9)  # noise of other axes would fit as a lead
    found = []
    for source, (at, velocity, width) in sources.items():
        for signal, data in (("turns", about), ("speed", accel)):
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
    once = _summed(np.diff(time)[:, None] * data[:-1])  # a sample holds until the next
    size = np.ones(len(at))
    if signal == "turns":
        size, once = np.maximum(np.hypot(*velocity.T), _MOVING), np.hstack([once, _rate(time, once)])
    twice = _summed(np.diff(time)[:, None] * (once[1:] + once[:-1]) / 2)
    ends = 0.0 if width is None else width.max(initial=0.0) / 2
    first, last = time[0] + ends - tried[0], time[-1] - ends - tried[-1]
    rows = rows[(at[rows] >= first) & (at[rows + 1] <= last)]
    y = y[rows]
    if len(rows) < _FEWEST or not np.ptp(y) > 0:
        return Offset(source, signal, tried, np.full(len(tried), np.nan), np.nan, np.nan, len(rows))
    weight = (size[rows] + size[rows + 1])[:, None] / 2  # a course has the less noise, the faster it goes

    def design(tau: float) -> np.ndarray:
        """Integrals, times, and changes from each velocity to the next."""
        seen = _at(time, once, at + tau) if width is None else _mean(time, twice, at + tau, width)
        if signal == "turns":
            angle, rate = seen.T
            seen = np.column_stack([angle - _SLIP[0] * size * rate, rate / size])
        return weight * np.column_stack([seen[rows + 1] - seen[rows], at[rows + 1] - at[rows], y])

    rough = _products(design, tried[::_COARSE], np.ones(1), 1)[:, 0]
    k = int(np.argmin(_residual(rough)))
    white = _whitening(design(tried[::_COARSE][k]) @ np.append(-_solution(rough)[k], 1.0))
    sums = _products(design, tried, white, _BLOCKS)
    whole = sums.sum(axis=1)
    residual = _residual(whole)
    correlation = np.sqrt(np.clip(1 - residual / _residual(whole[:, -2:, -2:]), 0.0, 1.0))  # beyond times alone
    value = _lowest(tried, residual)
    parts = np.array([_lowest(tried, _residual(whole - sums[:, b])) for b in range(_BLOCKS)])
    jackknife = np.sqrt((_BLOCKS - 1) / _BLOCKS * np.sum((parts - parts.mean()) ** 2))
    se = np.max([jackknife, _spread(tried, residual, value, len(y))])  # NaN where one is
    slip = 2 * _SLIP[1] * weight.mean() if signal == "turns" else 0.0
    return Offset(source, signal, tried, correlation, value, float(np.hypot(se, slip)), len(y))


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


def _rate(time: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """By central differences of fourth order: an offset goes with the third derivative of an angle, or a lead."""
    near, far = (_at(time, angle, time + h) - _at(time, angle, time - h) for h in (_NEAR, 2 * _NEAR))
    return (8 * near - far) / (12 * _NEAR)


def _whitening(left: np.ndarray) -> np.ndarray:
    """Factors of a value and those before it, of which the sum is white: autoregression by Yule and Walker."""
    order = min(_ORDER, len(left) // 10)
    lags = np.array([left[k:] @ left[: len(left) - k] for k in range(order + 1)])
    lags[0] = (1 + 1e-6) * lags[0] + 1e-300  # without noise it would be singular
    return np.append(1.0, -solve_toeplitz(lags[:-1], lags[1:]))


def _products(
    design: Callable[[float], np.ndarray], offsets: np.ndarray, white: np.ndarray, blocks: int
) -> Float64[np.ndarray, "T b n n"]:
    """Sums of products of all columns, at each offset and in each block of rows."""
    found = []
    for tau in offsets:
        X = np.asarray(lfilter(white, 1.0, design(tau), axis=0))
        starts = np.arange(blocks) * len(X) // blocks
        found.append(np.add.reduceat(X[:, :, None] * X[:, None, :], starts, axis=0))
    return np.array(found)


def _solution(sums: Float64[np.ndarray, "T n n"]) -> Float64[np.ndarray, "T m"]:
    """Of a fit of the last column by the others."""
    return np.einsum("tij,tj->ti", np.linalg.pinv(sums[:, :-1, :-1], hermitian=True), sums[:, :-1, -1])


def _residual(sums: Float64[np.ndarray, "T n n"]) -> Float64[np.ndarray, " T"]:
    """Sums of squares that it leaves."""
    return np.maximum(sums[:, -1, -1] - np.einsum("ti,ti->t", _solution(sums), sums[:, :-1, -1]), 1e-300)


def _lowest(tried: np.ndarray, residual: np.ndarray) -> float:
    """Where a parabola through the smallest of the logarithms and its neighbours is lowest; NaN at an end."""
    k = int(np.argmin(residual))
    if k in (0, len(tried) - 1):
        return float("nan")
    a, b, c = np.log(residual[k - 1 : k + 2])
    bend = a - 2 * b + c
    return float(tried[k] + (0.5 * (a - c) / bend if bend > 0 else 0.0) * _STEP)


def _spread(tried: np.ndarray, residual: np.ndarray, value: float, num: int) -> float:
    """Root mean square distance of offsets from a value by their likelihood: -log L is n/2 times log residuals."""
    fine = np.linspace(tried[0], tried[-1], _FINE * (len(tried) - 1) + 1)
    minus = num / 2 * CubicSpline(tried, np.log(residual))(fine)
    weights = np.exp(minus.min() - minus)
    return float(np.sqrt(weights @ (fine - value) ** 2 / weights.sum()))
