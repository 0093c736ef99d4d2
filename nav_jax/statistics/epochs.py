"""The epoch at which filters are judged."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float64

Outages = Mapping[str, Sequence[tuple[float, float]]]

_TOLERANCE = 1e-6
"""s."""


def outage_intervals(outages: Outages) -> tuple[tuple[float, float], ...]:
    """Of all sensors, each interval once, by start."""
    return tuple(sorted({(float(a), float(b)) for intervals in outages.values() for a, b in intervals}))


def judged_epoch(
    time: Float64[np.ndarray, " E"],
    outages: Outages,
    fix_times: Mapping[str, Float64[np.ndarray, " _"]],
    at: float | None = None,
) -> int:
    """Number of the epoch at which filters are judged.

    Parameters
    ----------
    time
        The epochs, s.
    outages, fix_times
        Of each sensor.
    at
        Time in s, the nearest epoch is taken. By default the end of the outage that ends last, where errors are
        largest: the last epoch that is not after it and has no new fix yet; without outage the last epoch.

    Raises
    ------
    ValueError
        A time outside the run.
    """
    if at is not None:
        if not time[0] <= at <= time[-1]:
            raise ValueError(f"at={at!r} s is outside the runs: {time[0]:g} .. {time[-1]:g} s.")
        return int(np.argmin(np.abs(time - at)))
    ends = [b for a, b in outage_intervals(outages) if a <= time[-1]]
    if not ends:
        return len(time) - 1
    before = np.flatnonzero(_before_end(max(ends), time, outages, fix_times))
    return int(before[-1]) if len(before) else len(time) - 1


def inside_outages(
    time: Float64[np.ndarray, " E"], outages: Outages, fix_times: Mapping[str, Float64[np.ndarray, " _"]]
) -> Bool[np.ndarray, " E"]:
    """Epochs inside an outage, its end with it; parameters as of `judged_epoch`."""
    inside = np.zeros(len(time), dtype=bool)
    for start, end in outage_intervals(outages):
        inside |= (time > start + _TOLERANCE) & _before_end(end, time, outages, fix_times)
    return inside


class Judged:
    """What results over time share that are judged at one epoch."""

    time: Float64[np.ndarray, " E"]
    outages: Outages
    fixes: Mapping[str, Float64[np.ndarray, " _"]]

    def epoch(self, at: float | None = None) -> int:
        """Number of the epoch at which filters are judged, see `judged_epoch`."""
        return judged_epoch(self.time, self.outages, self.fixes, at)

    @property
    def outage_intervals(self) -> tuple[tuple[float, float], ...]:
        """Of all sensors, each interval once, by start."""
        return outage_intervals(self.outages)


def _before_end(end: float, time: np.ndarray, outages: Outages, fix_times: Mapping[str, np.ndarray]) -> np.ndarray:
    """Epochs not after the end of an outage: it may or may not take the fix at its very end with it."""
    fix = min(_next_fixes(end, outages, fix_times), default=np.inf)
    return (time <= end + _TOLERANCE) & (time < fix - _TOLERANCE)


def _next_fixes(over: float, outages: Outages, fix_times: Mapping[str, np.ndarray]) -> Iterable[float]:
    """The first fix of each sensor whose outage ends then."""
    for sensor, times in fix_times.items():
        if any(abs(end - over) < _TOLERANCE for _, end in outages.get(sensor, ())):
            yield times[times > over - _TOLERANCE].min(initial=np.inf)
