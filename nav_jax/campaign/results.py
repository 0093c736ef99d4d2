"""What a campaign says of itself: how far it is, what it takes, and the statistics of every epoch."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64, Int64

from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.limits import as_bytes
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from nav_jax.simulation.stopping import Stopped

_MOST_NAMED = 5
"""Chunks that a sentence names."""

Chunks = Mapping[str, tuple[int, ...]]


def named(chunks: Chunks) -> str:
    """Name chunks as text, the first ones where there are many."""
    flat = [f"{scenario} {chunk}" for scenario, of in chunks.items() for chunk in of]
    more = f" and {len(flat) - _MOST_NAMED} more" if len(flat) > _MOST_NAMED else ""
    return ", ".join(flat[:_MOST_NAMED]) + more


@dataclass(frozen=True, repr=False)
class CampaignStatus:
    """What is there of a campaign, and what is not.

    Attributes
    ----------
    path
        Of the store.
    num_chunks, chunk_size
        Of each scenario, and runs in each of them.
    missing
        Scenario -> numbers of the chunks that are not there, whatever the reason; none beyond a stop.
    damaged
        Those of them that were there once.
    failed
        Scenario and chunk -> why it could not be computed.
    stopped
        Scenario -> how a rule has stopped it before the largest number of runs.
    """

    path: str
    num_chunks: int
    chunk_size: int
    missing: Chunks
    damaged: Chunks
    failed: Mapping[tuple[str, int], str]
    stopped: Mapping[str, Stopped] = field(default_factory=dict)

    @property
    def num_missing(self) -> int:
        """Chunks that are not there, of all scenarios."""
        return sum(map(len, self.missing.values()))

    @property
    def complete(self) -> bool:
        """Whether all is there, of a scenario that was stopped all up to there."""
        return not self.num_missing

    def __repr__(self) -> str:
        lines = [f"Campaign in {self.path}: {len(self.missing)} scenarios x {self.num_chunks * self.chunk_size} runs"]
        for scenario, chunks in self.missing.items():
            if (ended := self.stopped.get(scenario)) is not None:
                lines.append(f"{scenario}: stopped at {ended.looks[-1]} of {ended.most} runs ({ended.rule.text})")
            else:
                lines.append(f"{scenario}: {self.num_chunks - len(chunks)} of {self.num_chunks} chunks are done")
        if any(self.damaged.values()):
            lines.append(f"damaged, to be computed again: {named(self.damaged)}")
        lines += [f"{scenario} {chunk} failed: {why}" for (scenario, chunk), why in self.failed.items()]
        return "\n".join(lines)


@dataclass(frozen=True, repr=False)
class Cost:
    """What a campaign takes, from a few chunks of each scenario that were computed.

    Attributes
    ----------
    first_seconds
        CPU s of the first chunk of each scenario in a process, preparing and compiling included, summed.
    chunk_seconds
        CPU s of a later chunk of each scenario, summed.
    num_chunks
        Of each scenario.
    chunk_bytes, frame_bytes
        On disk, of a chunk of each scenario, summed, and of what is there before them.
    """

    first_seconds: float
    chunk_seconds: float
    num_chunks: int
    chunk_bytes: int
    frame_bytes: int

    def cpu_seconds(self, workers: int = 1) -> float:
        """CPU s of the whole campaign in so many processes, each of which compiles."""
        first = min(workers, self.num_chunks)
        return first * self.first_seconds + (self.num_chunks - first) * self.chunk_seconds

    @property
    def num_bytes(self) -> int:
        """On disk, of the whole campaign."""
        return self.frame_bytes + self.num_chunks * self.chunk_bytes

    def __repr__(self) -> str:
        return (
            f"about {self.cpu_seconds():.3g} s of CPU time ({self.first_seconds:.3g} s before the second chunks in "
            f"each process) and {as_bytes(self.num_bytes)} on disk"
        )


@saved(not_finite=("mean_nees", "mean_nis"))
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Statistics(Drawable, Saved):
    """Of one filter over all its good runs: E epochs.

    Attributes
    ----------
    name
        Of the filter.
    num_good
        Runs behind the numbers.
    time
        Epochs, s.
    mean_error, rms_error, rms_sd
        Of each column of `nav_jax.filter.layout.JUDGED`: the mean error, its root mean square, and that of the standard
        deviation that the filter claims.
    mean_length
        Position, velocity, attitude -> mean length of the error.
    mean_nees
        Group of states -> mean NEES, NaN where there is none.
    dof
        Group -> number of its states.
    coverage
        Group -> share of runs in the region that the filter claims with `contents.COVERAGE_LEVEL`.
    mean_nis, nis_time
        Sensor -> mean NIS and times of its fixes.
    histogram
        Counts of errors of position, velocity and attitude over the sigma that the filter claims, of all epochs,
        between `contents.EDGES`, with what lies beyond at either end.
    outages
        Sensor -> (start, end) of each, in s.
    """

    name: str
    num_good: int
    time: Float64[np.ndarray, " E"]
    mean_error: Float64[np.ndarray, "E col"]
    rms_error: Float64[np.ndarray, "E col"]
    rms_sd: Float64[np.ndarray, "E col"]
    mean_length: Mapping[str, Float64[np.ndarray, " E"]]
    mean_nees: Mapping[str, Float64[np.ndarray, " E"]]
    dof: Mapping[str, int]
    coverage: Mapping[str, Float64[np.ndarray, " E"]]
    mean_nis: Mapping[str, Float64[np.ndarray, " _"]]
    nis_time: Mapping[str, Float64[np.ndarray, " _"]]
    histogram: Int64[np.ndarray, "9 bin"]
    outages: Mapping[str, tuple[tuple[float, float], ...]]

    def plot(self, *, log: bool = True, level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
        """Draw mean errors of every epoch, what the filter claims of them, and its consistency.

        Parameters
        ----------
        log
            Logarithmic errors; else linear ones.
        level
            Of the intervals of means, and of the bands of a consistent filter.
        axes
            Six Axes to draw into, as in two rows of three; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_statistics`.
        """
        return self._draw(log=log, level=level, axes=axes)

    def __repr__(self) -> str:
        last = {block: float(curve[-1]) for block, curve in self.mean_length.items()}
        said = ", ".join(f"{block} {value:.4g}" for block, value in last.items())
        return f"{self.name}: {self.num_good} good runs, {len(self.time)} epochs; mean lengths at the last: {said}"
