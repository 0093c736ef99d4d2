"""What is in a record, on one page: rates, gaps, rest, gravity, the attitude at the start, clocks that are apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import increasing, real_array
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import Real
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.kinematics.wgs84 import normal_gravity
from nav_jax.recorded.alignment import velocities
from nav_jax.recorded.clocks import Offset, clock_offsets
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.mounting import Mounting, mounting_by

_GAP = 1.5
"""Steps in one from which on samples or fixes are missing."""

_WINDOW = 1.0
"""s, in which rest is looked for."""

_SHORTEST = 2.0
"""s of rest that are an interval."""

_CALM = 3.0
"""Times the scatter of the calmest window, that is still rest."""

_MOST_SCATTER = (0.6, 0.1)
"""m/s^2 and rad/s in a window: more is no rest, however calm the rest of the record is."""

_STILL = 0.5
"""m/s, below which fixes are at rest."""

_TOLD = (0.3, 0.2)
"""Correlation from which on, and standard error in s up to which, an offset of clocks is told."""

_LISTED = 8
"""Intervals of rest on the page."""

_DEGREES = 180 / np.pi


@dataclass(frozen=True)
class Rest:
    """An interval of rest, and the means of the sensors in it."""

    start: float
    end: float
    accel: tuple[float, float, float]
    gyro: tuple[float, float, float]

    @property
    def gravity(self) -> float:
        """Magnitude of the mean specific force, m/s^2."""
        return float(np.linalg.norm(self.accel))

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch in rad, as the specific force tells them."""
        x, y, z = self.accel
        return float(np.arctan2(-y, -z)), float(np.arctan2(x, np.hypot(y, z)))


@dataclass(frozen=True)
class Stamps:
    """Times of samples or fixes.

    Attributes
    ----------
    num
        Of them.
    start, end, step
        First, last, and median step, s.
    gaps
        Time before and length of each step in which some are missing, s.
    scatter
        Standard deviation of the times about even steps between the gaps, s.
    """

    num: int
    start: float
    end: float
    step: float
    gaps: tuple[tuple[float, float], ...]
    scatter: float

    @property
    def rate(self) -> float:
        """Hz, of the steps without gaps."""
        lost = sum(length for _, length in self.gaps)
        return (self.num - 1 - len(self.gaps)) / (self.end - self.start - lost)


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Drawable):
    """What `inspect_record` finds.

    Attributes
    ----------
    imu
        Times of the samples.
    fixes
        Times of the fixes, if there are any.
    rests
        Intervals of rest.
    normal_gravity
        At the place of the fixes, m/s^2; None where it is not known.
    course
        Time, speed and course (rad) at which the vehicle first is faster than 2 m/s, on the clock of the fixes.
    offsets
        Of the clocks, by several signals.
    qualities
        Number of fixes of each quality.
    mounting
        Of the IMU, taken for one of a vehicle on wheels, see `find_mounting`; or in words why there is none.
    series
        For figures: name -> times and values.
    """

    imu: Stamps
    fixes: Stamps | None
    rests: tuple[Rest, ...]
    normal_gravity: float | None
    course: tuple[float, float, float] | None
    offsets: tuple[Offset, ...]
    qualities: Mapping[str, int]
    mounting: Mounting | str = "there are no fixes"
    series: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    @property
    def time_offsets(self) -> dict[str, tuple[float, float]]:
        """``positions`` and ``velocities`` -> what is to be added to their times, s, and its standard error.

        The mean over the signals that tell it, by their standard errors; a source of which none does has no entry.
        Where the signals disagree, its standard error is as much larger as they do (Birge 1932).
        """
        return _agreed(self.offsets)

    def to_dict(self) -> dict[str, Any]:
        """What it says, as numbers and texts."""
        return {
            "imu": _stamps_dict(self.imu),
            "fixes": None if self.fixes is None else _stamps_dict(self.fixes),
            "qualities": dict(self.qualities),
            "rests": [
                {"start": r.start, "end": r.end, "accel": list(r.accel), "gyro": list(r.gyro), "gravity": r.gravity,
                 "roll": r.tilt[0], "pitch": r.tilt[1]}
                for r in self.rests
            ],
            "normal_gravity": self.normal_gravity,
            "course": None if self.course is None else dict(zip(("time", "speed", "course"), self.course, strict=True)),
            "time_offsets": [
                {"fixes": o.fixes, "signal": o.signal, "offset": o.value, "se": o.se, "correlation": o.best}
                for o in self.offsets
            ],
            "mounting": self.mounting.to_dict() if isinstance(self.mounting, Mounting) else None,
        }  # fmt: skip

    def __repr__(self) -> str:
        lines = [_stamps_line("IMU", self.imu, "samples")]
        if self.fixes is not None:
            lines.append(_stamps_line("Fixes", self.fixes, "fixes"))
            if self.qualities:
                lines.append("  " + ", ".join(f"{n} x {q}" for q, n in self.qualities.items()))
            both = min(self.imu.end, self.fixes.end) - max(self.imu.start, self.fixes.start)
            lines.append(
                f"  both are there for {both:.6g} s" if both > 0
                else "  they are never there at the same time: their clocks count something else"
            )  # fmt: skip
        lines += ["", *self._rest_lines()]
        if self.course is not None:
            time, speed, course = self.course
            begin = f"{time:.10g} s: {speed:.3g} m/s, course {_DEGREES * course:.1f} deg"
            lines += ["", f"Faster than 2 m/s first at {begin}"]
        if self.offsets:
            rows = [
                [o.fixes, o.signal, number(o.value, 4), number(o.se, 2), f"{o.best:.3f}", str(o.num),
                 "" if _is_told(o) else "not told by this record"]
                for o in self.offsets
            ]  # fmt: skip
            head = ["fixes", "signal", "offset [s]", "se", "correlation", "intervals", ""]
            lines += ["", "To be added to the times of the fixes (time_offset, beyond what a configuration states)"]
            lines.append(format_table(head, rows, left=2))
            lines += [f"{source}: {value:.3f} +- {se:.3f} s" for source, (value, se) in self.time_offsets.items()]
        if self.fixes is not None:
            found = isinstance(self.mounting, Mounting)
            beside = "if it is that of a vehicle on wheels, and beyond what a configuration states."
            lines += ["", f"{self.mounting}\n{beside}" if found else self.mounting]
        return "\n".join(lines)

    def _rest_lines(self) -> list[str]:
        if not self.rests:
            return ["No rest of 2 s or more: nothing is known of biases and tilt."]
        total = sum(r.end - r.start for r in self.rests)
        lines = [f"{len(self.rests)} intervals of rest, {total:.4g} s in all"]
        rows = [
            [f"{r.start:.10g}", f"{r.end:.10g}", f"{r.gravity:.4f}", *(f"{_DEGREES * a:.2f}" for a in r.tilt),
             " ".join(f"{_DEGREES * w:.3f}" for w in r.gyro)]
            for r in self.rests[:_LISTED]
        ]  # fmt: skip
        head = ["from", "to", "|f| [m/s^2]", "roll", "pitch [deg]", "gyro x y z [deg/s]"]
        lines.append(format_table(head, rows, left=0))
        if len(self.rests) > _LISTED:
            lines.append(f"and {len(self.rests) - _LISTED} more")
        if self.normal_gravity is not None:
            off = 1e3 * (np.mean([r.gravity for r in self.rests]) / self.normal_gravity - 1)
            known = f"normal gravity is {self.normal_gravity:.4f} m/s^2 there"
            lines.append(f"{known}; |f| is {off:+.1f} thousandths off it")
        return lines


def inspect_record(
    time: Any, gyro: Any, accel: Any, fixes: GnssRecord | None = None, *, most_offset: Real = 2.0
) -> Inspection:
    """Look at a record before it is navigated; nothing needs to be even, aligned or on one clock yet.

    Parameters
    ----------
    time
        Of the samples of the IMU in s, shape (N,); steps may be uneven.
    gyro, accel
        rad/s and m/s^2, along any axes, shape (N, 3). Tilt is right where they are those of the body.
    fixes
        Of a receiver.
    most_offset
        s: clocks are not looked at beyond.

    Raises
    ------
    ValueError
        Arrays of wrong shape, NaN, times that do not increase.

    Examples
    --------
    >>> imu, exact = nj.perfect_imu(nj.motions.racetrack(duration=60.0, rate=50.0, straight=40.0, turn=20.0))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::25], exact.position[::25])
    >>> found = nj.recorded.inspect_record(imu.time, imu.gyro, imu.accel, fixes)
    >>> round(found.imu.rate, 6), found.imu.gaps
    (50.0, ())
    """
    t = real_array("The time of an IMU", time, (None,))
    increasing("The time of an IMU", t)
    w = real_array("The gyro of an IMU", gyro, (len(t), 3))
    f = real_array("The accel of an IMU", accel, (len(t), 3))
    imu = _stamps(t)
    sizes = {"specific force": f, "turn rate": w}
    series = {name: _windows(t, np.linalg.norm(x, axis=1)) for name, x in sizes.items()}
    if fixes is None:
        return Inspection(imu, None, _rests(t, w, f, None), None, None, (), {}, series=series)
    increasing("The time of the fixes", fixes.time)
    offsets = tuple(clock_offsets(t, w, f, fixes, most=most_offset))
    told = [o for o in offsets if _is_told(o)]
    shift = told[0].value if told else 0.0
    at, v = velocities(fixes)
    speed = np.hypot(*v.T[:2])
    series["speed of the fixes"] = (at, speed)
    fast = np.flatnonzero(speed >= 2.0)
    course = None
    if len(fast):
        k = fast[0]
        course = (float(at[k]), float(speed[k]), float(np.arctan2(v[k, 1], v[k, 0])))
    qualities: dict[str, int] = {}
    if fixes.quality is not None:
        for q, n in zip(*np.unique(fixes.quality, return_counts=True), strict=True):
            qualities[f"{q} ({fixes.kinds.get(int(q), 'unknown')})"] = int(n)
    gravity = None if fixes.origin is None else float(normal_gravity(np.sin(fixes.origin[0]) ** 2, fixes.origin[2]))
    rests = _rests(t, w, f, (at + shift, speed))
    ahead, _ = _agreed(offsets).get("positions" if fixes.velocity is None else "velocities", (0.0, 0.0))
    mounting = _mounting(t, w, f, fixes.shifted(ahead), gravity)
    return Inspection(imu, _stamps(fixes.time), rests, gravity, course, offsets, qualities, mounting, series)


def _agreed(offsets: Sequence[Offset]) -> dict[str, tuple[float, float]]:
    found = {}
    for source in dict.fromkeys(o.fixes for o in offsets):
        told = [o for o in offsets if o.fixes == source and _is_told(o)]
        if told:
            weights = np.array([1 / max(o.se, 1e-6) ** 2 for o in told])
            values = np.array([o.value for o in told])
            value = np.sum(weights * values) / weights.sum()
            misfit = np.sum(weights * (values - value) ** 2) / max(len(told) - 1, 1)
            found[source] = (float(value), float(np.sqrt(max(misfit, 1.0) / weights.sum())))
    return found


def _mounting(t: np.ndarray, w: np.ndarray, f: np.ndarray, fixes: GnssRecord, gravity: float | None) -> Mounting | str:
    """A sample holds until the next."""
    steps = np.diff(t)[:, None]
    there = STANDARD_GRAVITY if gravity is None else gravity
    try:
        return mounting_by(t, steps * w[:-1], steps * f[:-1], fixes, gravity=there)
    except ValueError as e:
        return str(e)


def _is_told(offset: Offset) -> bool:
    return bool(offset.best >= _TOLD[0] and np.isfinite(offset.value) and offset.se <= _TOLD[1])


def _stamps(time: Float64[np.ndarray, " N"]) -> Stamps:
    steps = np.diff(time)
    usual = float(np.median(steps))
    wide = np.flatnonzero(steps > _GAP * usual)
    gaps = tuple((float(time[i]), float(steps[i])) for i in wide)
    # numbered through, so that a line fits through all parts between gaps
    index = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(steps / usual)))])
    slope = np.polyfit(index - index.mean(), time - time.mean(), 1)
    scatter = float(np.std(time - time.mean() - np.polyval(slope, index - index.mean()))) if len(time) > 2 else 0.0
    return Stamps(len(time), float(time[0]), float(time[-1]), usual, gaps, scatter)


def _stamps_dict(s: Stamps) -> dict[str, Any]:
    return {"num": s.num, "start": s.start, "end": s.end, "rate": s.rate, "gaps": [list(g) for g in s.gaps],
            "scatter": s.scatter}  # fmt: skip


def _stamps_line(what: str, s: Stamps, noun: str) -> str:
    gaps = "no gaps" if not s.gaps else (
        f"{len(s.gaps)} gaps, the longest of {max(length for _, length in s.gaps):.4g} s after "
        f"{max(s.gaps, key=lambda g: g[1])[0]:.10g} s"
    )  # fmt: skip
    return (
        f"{what}: {s.num} {noun} at {s.rate:.6g} Hz from {s.start:.10g} to {s.end:.10g} s; {gaps}; "
        f"times scatter by {1e3 * s.scatter:.2g} ms about even steps"
    )


def _windows(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over windows, at their middles."""
    starts = _starts(time)
    count = np.diff(np.append(starts, len(time)))
    return np.add.reduceat(time, starts) / count, np.add.reduceat(values, starts) / count


def _starts(time: np.ndarray) -> np.ndarray:
    """The first sample of each window that has any."""
    number = np.floor((time - time[0]) / _WINDOW).astype(int)
    return np.flatnonzero(np.diff(number, prepend=-1))


def _rests(
    time: np.ndarray, gyro: np.ndarray, accel: np.ndarray, speed: tuple[np.ndarray, np.ndarray] | None
) -> tuple[Rest, ...]:
    """Runs of windows that scatter little, and where fixes do not move.

    Where fixes are at rest, an engine that idles may shake the IMU; else it must be as calm as it ever is.
    """
    starts = _starts(time)
    ends = np.append(starts[1:], len(time))
    calm, still = np.ones(len(starts), dtype=bool), np.zeros(len(starts), dtype=bool)
    if speed is not None:
        at, v = speed
        for i, (a, b) in enumerate(zip(starts, ends, strict=True)):
            near = (at >= time[a] - _WINDOW / 2) & (at <= time[b - 1] + _WINDOW / 2)
            calm[i] = not near.any() or v[near].max() < _STILL
            still[i] = near.any() and v[near].max() < _STILL
    for data, most in ((accel, _MOST_SCATTER[0]), (gyro, _MOST_SCATTER[1])):
        scatter = np.array([np.linalg.norm(data[a:b].std(axis=0)) for a, b in zip(starts, ends, strict=True)])
        whole = ends - starts >= 0.5 * np.median(ends - starts)
        least = max(scatter[whole].min(), 1e-9)
        calm &= whole & (scatter <= np.where(still, most, min(_CALM * least, most)))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
    found = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        first, last = starts[a], ends[b - 1]
        if time[last - 1] - time[first] >= _SHORTEST - 0.1:
            force, rate = _mean(accel[first:last]), _mean(gyro[first:last])
            found.append(Rest(float(time[first]), float(time[last - 1]), force, rate))
    return tuple(found)


def _mean(vectors: np.ndarray) -> tuple[float, float, float]:
    x, y, z = vectors.mean(axis=0).tolist()
    return x, y, z
