"""When what happens in a run: the IMU samples cut at fixes and outputs into segments of equal length.

A time loop with a decision in every step costs several times the arithmetic. So the loop is two loops: over segments,
each of which ends with an update or an output, and over the covariance steps inside, all of which are alike. Segments
that are too short are filled up with pieces of length zero, which change nothing. A fix between two samples cuts the
sample in two pieces of the same rate and specific force: nothing is moved to the grid and no fix is lost.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

_LONGEST = 10.0
"""s, of a segment of several steps: what is constant in it, as the gradient of gravity, may not get old."""
_ON_GRID = 1e-6
"""Of a sample: what is nearer to an epoch is at it."""


@dataclass(frozen=True)
class Schedule:
    """M segments of G covariance steps of n pieces."""

    time: Float[np.ndarray, " M"]
    """s, of the end of each segment."""
    pattern: Int[np.ndarray, "M G"]
    """Which kind of covariance step: a row of `dt` and `ends`."""
    dt: Float[np.ndarray, "U n"]
    """s, length of the pieces of each kind."""
    ends: Float[np.ndarray, "U n"]
    """1 where a piece ends its IMU sample."""
    event: Int[np.ndarray, " E"]
    """The segment that ends at each of the times asked for."""

    @property
    def num_pieces(self) -> int:
        """Pieces in a segment, fillers included."""
        return self.pattern.shape[1] * self.dt.shape[1]

    @property
    def samples(self) -> Int[np.ndarray, " L"]:
        """IMU sample of each of all L pieces; of one that fills up, the next."""
        ends = self.ends[self.pattern].ravel().astype(int)
        return np.cumsum(ends) - ends


def make_schedule(epochs: Float[np.ndarray, " E"], events: Float[np.ndarray, " K"], every: int = 1) -> Schedule:
    """Cut a run at its events.

    Parameters
    ----------
    epochs
        The N + 1 epochs of N IMU samples, s.
    events
        Times of fixes and outputs, increasing, within the run.
    every
        Number n of pieces in a covariance step.

    Raises
    ------
    ValueError
        An event outside the run.
    """
    num = len(epochs) - 1
    step = (epochs[-1] - epochs[0]) / num
    position = np.interp(events, epochs, np.arange(num + 1.0))
    outside = (events < epochs[0] - _ON_GRID * step) | (events > epochs[-1] + _ON_GRID * step)
    if outside.any():
        raise ValueError(
            f"{outside.sum()} of {len(events)} fixes or outputs lie outside the run from {epochs[0]:g} to "
            f"{epochs[-1]:g} s, the first at {events[outside][0]:g} s."
        )
    near = np.abs(position - np.rint(position)) < _ON_GRID
    # rounded, so that what two sensors measure at once is one event
    position = np.where(near, np.rint(position), np.round(position, 9))
    # in units of samples: the pieces' boundaries are all epochs and all events
    cuts, bounds = np.unique(position), np.union1d(position, np.arange(num + 1.0))
    bounds = bounds[bounds <= (cuts[-1] if len(cuts) else 0)]
    at = np.searchsorted(bounds, cuts)
    lengths = np.diff(at, prepend=0)
    longest = min(_segment_length(lengths, every), max(int(_LONGEST / step) // every, 1) * every)
    # long ways between events are several segments
    ends_at = np.concatenate([_split(int(a - n), int(a), longest) for a, n in zip(at, lengths, strict=True)])
    starts_at = np.concatenate([[0], ends_at[:-1]])
    size = np.diff(bounds)
    is_end = bounds[1:] == np.rint(bounds[1:])
    dt, ends = np.zeros((len(ends_at), longest)), np.zeros((len(ends_at), longest))
    for i, (a, b) in enumerate(zip(starts_at, ends_at, strict=True)):
        dt[i, : b - a], ends[i, : b - a] = size[a:b] * step, is_end[a:b]
    rounded = np.round(np.concatenate([dt / step, ends], axis=1).reshape(len(ends_at), 2, -1, every), 9)
    kinds = np.moveaxis(rounded, 1, 2).reshape(-1, 2 * every)
    unique, pattern = np.unique(kinds, axis=0, return_inverse=True)
    times = epochs[0] + bounds[ends_at] * step
    return Schedule(
        times,
        pattern.reshape(len(ends_at), -1),
        unique[:, :every] * step,
        unique[:, every:],
        np.searchsorted(ends_at, at)[np.searchsorted(cuts, position)],
    )


def _segment_length(lengths: Int[np.ndarray, " K"], every: int) -> int:
    """The length, a multiple of `every`, that makes all segments together cheapest."""
    update = 10  # an update or an output costs about as much as ten steps
    candidates = {-(-int(n) // every) * every for n in (*lengths, 1) if n}
    return min(candidates, key=lambda size: (sum(-(-int(n) // size) or 1 for n in lengths) * (size + update), size))


def _split(first: int, last: int, longest: int) -> Int[np.ndarray, " k"]:
    """Ends of the segments that lead from one piece to another; one, of length zero, where there is no way to go."""
    return np.append(np.arange(first + longest, last, longest), last)
