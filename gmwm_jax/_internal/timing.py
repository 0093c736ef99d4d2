"""What stamps tell of time: the rate, their jitter and rounding, samples that are missing or were written twice."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gmwm_jax._internal.checks import finite_record

GAPS = ("refuse", "nan", "longest")
"""What may be done about missing samples."""

_GAP = 1.5
"""A step of more than so many samples may miss one, which jitter does not explain."""

_LOST = 0.7
"""Samples by which stamps must be late, and stay so, where one is missing."""

_WINDOW = 64
"""Samples before and after a long step that tell whether stamps stay late."""

_PACKETS = 0.02
"""Long steps among all beyond which stamps are those of packets, if the others are short."""

_SHORT = 0.9
"""Of samples: the steps within a packet, which are often none at all."""

_BLOCK = 256
"""Samples in which a clock wanders by less than its jitter."""

_SPARSE = 10
"""Times as many places as samples is no record with gaps, but several records."""

_UNSURE = 0.005
"""Relative standard deviation beyond which stamps tell no rate."""


WAYS_OUT = (
    'A gap that is closed silently changes every scale: gaps="nan" puts NaN where samples are missing and leaves out '
    'rows that were written twice, gaps="longest" takes the longest run.'
)
"""Said where a record with gaps is refused."""


class Timing(NamedTuple):
    """The time of a record."""

    rate: float
    """Hz: the slope of the number of the sample over its stamp, by least squares."""
    place: np.ndarray
    """Number of each row on the grid of the rate, (N,); rows that were written twice have that of the first."""
    start: float
    """Time of place 0 on the grid, in s on the clock of the stamps."""
    missing: int
    """Places without a row."""
    gaps: int
    """Runs of these."""
    longest: float
    """Of these, in s."""
    duplicated: int
    """Rows with the stamp and the values of the row before."""
    jitter: float
    """Root mean square of stamps about the grid within blocks of 256, in s."""
    rounding: float
    """To which stamps are rounded, in s; 0 where it cannot be seen."""

    def __str__(self) -> str:
        parts = [f"{self.missing} missing in {self.gaps} gaps (longest {self.longest:.4g} s)" if self.missing else
                 "none missing", f"{self.duplicated} written twice" if self.duplicated else "none written twice",
                 f"jitter of stamps {self.jitter:.3g} s" if self.jitter > 1e-9 else "no jitter"]  # fmt: skip
        return ", ".join([*parts, *([f"which are rounded to {self.rounding:g} s"] if self.rounding else [])])

    @property
    def grid(self) -> np.ndarray:
        """Times of the rows on the grid, in s on the clock of the stamps: stamps, smoothed."""
        return self.start + self.place / self.rate

    def kept(self, policy: str, ways_out: str = WAYS_OUT) -> slice | np.ndarray:
        """Return the rows that are left where missing samples are refused, or the longest run is taken.

        The message of a refusal ends in `ways_out`.

        Raises
        ------
        ValueError
            They are refused, and there are some, or rows that were written twice.
        """
        if not self.missing and not self.duplicated:
            return slice(None)
        if policy == "longest":
            rows = np.flatnonzero(np.diff(self.place, prepend=-1) > 0)
            ends = np.flatnonzero(np.diff(self.place[rows], append=self.place[-1] + 2) > 1)
            starts = np.concatenate([[0], ends[:-1] + 1])
            longest = int(np.argmax(ends - starts))
            return rows[starts[longest] : ends[longest] + 1]
        if policy == "nan":
            if self.place[-1] >= _SPARSE * len(self.place):
                raise ValueError(
                    f"{self.missing} samples are missing between {len(self.place)} that are there, {self.longest:.4g} "
                    's at once: this is not one record. gaps="longest" takes the longest run.'
                )
            return np.flatnonzero(np.diff(self.place, prepend=-1) > 0)
        if self.missing:
            at = int(np.flatnonzero(np.diff(self.place) > 1)[0]) + 1
            lost = int(self.place[at] - self.place[at - 1]) - 1
            raise ValueError(
                f"Time has a gap of {(lost + 1) / self.rate:.6g} s before index {at}, where the usual step is "
                f"{1 / self.rate:.6g} s: {self.missing} samples are missing in {self.gaps} gaps. {ways_out}"
            )
        at = int(np.flatnonzero(np.diff(self.place) == 0)[0]) + 1
        raise ValueError(f"{self.duplicated} rows were written twice, the first at index {at}. {ways_out}")


def timing(seconds: np.ndarray, repeated: Callable[[np.ndarray], np.ndarray] | None = None) -> Timing:
    """Find the rate and the gaps of a record from its stamps.

    A long step means missing samples if the stamps stay late after it, and jitter if they catch up. Rounded stamps,
    also ones of which several samples share one, are averaged out.

    Parameters
    ----------
    seconds
        Stamps in s, (N,).
    repeated
        Numbers of rows -> does each hold the values of the row before it? Asked where stamps are equal.

    Raises
    ------
    ValueError
        Stamps that fall back, are not finite, or tell no rate; fewer than two.
    """
    if len(seconds) < 2:
        raise ValueError(f"The column of time has {len(seconds)} value: a rate needs two.")
    finite_record(seconds, "the column of time", advice="")
    steps = np.diff(seconds)
    if np.any(steps < 0):
        i = int(np.argmax(steps < 0)) + 1
        raise ValueError(_not_increasing(seconds, i) + "The clock was reset, or this is not the column of time.")
    equal = np.flatnonzero(steps == 0) + 1
    twice = equal[repeated(equal)] if repeated is not None and len(equal) else equal[:0]
    once = np.delete(seconds, twice)
    if len(once) < 2:
        raise ValueError("All rows of the file are the same.")
    place = _places(once)
    rate, start, residual = _line(place, once)
    _check_sure(once, equal, rate, residual)
    jitter = _jitter(residual)
    holes = np.diff(place) - 1
    if len(twice):
        kept = np.ones(len(seconds), dtype=bool)
        kept[twice] = False
        place = place[np.cumsum(kept) - 1]
    return Timing(
        rate, place, start, int(holes.sum()), int(np.count_nonzero(holes)), float(holes.max()) / rate,
        len(twice), jitter, _rounding(once, jitter),
    )  # fmt: skip


def longest_rise(seconds: np.ndarray) -> slice:
    """Return the longest run of rows in which a clock does not fall back."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(seconds) < 0) + 1, [len(seconds)]])
    longest = int(np.argmax(np.diff(edges)))
    return slice(int(edges[longest]), int(edges[longest + 1]))


def drift_of(seconds: np.ndarray, clock: np.ndarray) -> tuple[float, float]:
    """Return by how much a clock runs faster than a second one, in parts per million, and its standard deviation.

    The slope of the first over the second by least squares, at the rows where the second changes (a receiver gives a
    new time once a second, say).

    Raises
    ------
    ValueError
        The second clock changes fewer than three times, or runs at another speed altogether.
    """
    good = np.isfinite(clock) & (np.diff(clock, prepend=np.nan) > 0)
    if np.count_nonzero(good) < 3:
        raise ValueError("The second clock changes fewer than three times: it tells no drift.")
    x, y = clock[good], seconds[good]
    x, y = x - x.mean(), y - y.mean()
    slope = float(x @ y / (x @ x))
    if abs(slope - 1) > 0.01:
        raise ValueError(f"The column of time runs {slope:.4g} times as fast as the second clock: a unit is wrong.")
    residual = y - slope * x
    return 1e6 * (slope - 1), 1e6 * float(np.sqrt(residual @ residual / (len(x) - 2) / (x @ x)))


def _not_increasing(seconds: np.ndarray, i: int) -> str:
    return f"Time does not increase at index {i}: {seconds[i - 1]:.16g} s is followed by {seconds[i]:.16g} s. "


def _places(seconds: np.ndarray) -> np.ndarray:
    """Number of each sample on the grid."""
    count = len(seconds)
    block = min(_WINDOW, max(1, (count - 1) // 8))
    step = float(np.median(seconds[block:] - seconds[:-block])) / block
    steps = np.diff(seconds)
    if step <= 0:
        i = int(np.argmax(steps <= 0)) + 1
        raise ValueError(_not_increasing(seconds, i) + "Times were written with too few digits to tell a rate.")
    place = np.arange(count)
    long = np.flatnonzero(steps > _GAP * step) + 1  # rows before which samples may be missing
    if not len(long):
        return place
    late = (seconds - seconds[0]) / step - place
    edges = np.concatenate([[0], long, [count]])
    mean = np.concatenate([[0.0], np.cumsum(late)])
    lost = np.zeros(count, dtype=np.int64)
    if len(long) <= 20_000:
        for k, row in enumerate(long, start=1):
            before = np.median(late[max(edges[k - 1], row - _WINDOW) : row])
            after = np.median(late[row : min(edges[k + 1], row + _WINDOW)])
            lost[row] = _whole(float(after - before))
    else:  # stamps of arrival that come in bursts: means, which need no loop
        first, last = np.maximum(edges[:-2], long - _WINDOW), np.minimum(edges[2:], long + _WINDOW)
        before = (mean[long] - mean[first]) / (long - first)
        after = (mean[last] - mean[long]) / (last - long)
        lost[long] = [_whole(jump) for jump in (after - before).tolist()]
    others = steps[steps <= _GAP * step]
    if len(long) > _PACKETS * count and np.median(others) < _SHORT * step:  # the first and last packet may be parts
        usual = float(np.median(steps[long - 1]))
        for row in (long[0], long[-1]):
            lost[row] = _whole((float(steps[row - 1]) - usual) / step)
    return place + np.cumsum(lost)


def _whole(jump: float) -> int:
    return max(round(jump), 0) if jump > _LOST else 0


def _line(place: np.ndarray, seconds: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Rate, time of place 0, and what stamps differ from the grid, in s."""
    x, y = seconds - seconds.mean(), place - place.mean()
    # pairwise sums, of a million terms good to 12 digits; BLAS would start its threads
    rate = float(f"{np.sum(x * y) / np.sum(x * x):.12g}")
    return rate, float(seconds.mean() - place.mean() / rate), x - y / rate


def _check_sure(seconds: np.ndarray, equal: np.ndarray, rate: float, residual: np.ndarray) -> None:
    """Raise where the rate is not known to half a percent, or single stamps are equal among ones that are exact."""
    count, span = len(seconds), seconds[-1] - seconds[0]
    unsure = np.sqrt(12 * np.mean(residual**2) / max(count - 2, 1)) / span
    few = 0 < len(equal) < 0.02 * count and _jitter(residual) * rate < 0.2 and len(equal) > count - len(seconds)
    if unsure > _UNSURE or (few and np.any(np.diff(seconds) == 0)):
        at = int(np.argmin(np.diff(seconds))) + 1
        if seconds[at] == seconds[at - 1]:
            raise ValueError(_not_increasing(seconds, at) + "Times were written with too few digits.")
        raise ValueError(
            f"The stamps differ from even steps by {np.sqrt(np.mean(residual**2)):.3g} s, and tell the rate of "
            f"{rate:.4g} Hz to {100 * unsure:.1g} % only: leave out time=... and give rate=..., or mend them."
        )


def _jitter(residual: np.ndarray) -> float:
    whole = len(residual) // _BLOCK * _BLOCK
    if not whole:
        return float(np.std(residual))
    return float(np.sqrt(np.mean(np.var(residual[:whole].reshape(-1, _BLOCK), axis=1))))


def _rounding(seconds: np.ndarray, jitter: float) -> float:
    """The power of ten of which all stamps are multiples, where the jitter is that of rounding to it."""
    few = seconds[:10_000] - seconds[0]
    for digits in range(10):
        unit = 10.0**-digits
        off = np.abs(few / unit - np.round(few / unit))
        if np.all(off < 1e-3 + 1e-15 * np.abs(few) / unit):
            return unit if 0.15 * unit < jitter < 0.6 * unit else 0.0
    return 0.0
