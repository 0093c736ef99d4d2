"""Two-level Monte Carlo: many runs on shared gains, corrected by a few whose filters have their own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import probability
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.text_table import number as written
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.ranking import common_runs
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.distributions import t_quantile
from nav_jax.statistics.levels import TwoLevelMean, num_dear, two_level_mean

TWO_LEVEL: Final = "two-level"
"""What `nav_jax.compare` calls it."""
_PILOT = 64
"""Runs with their own gains from which the number of them is chosen."""
_JUDGED = ("position", "nees")
"""By which that number is chosen: what is printed."""
_WORTH = 0.5
"""Share of runs with their own gains from which on all of them have their own."""


def _length(block: str) -> Callable[[Runs], Float64[np.ndarray, "R E"]]:
    return lambda runs: np.linalg.norm(runs.errors(block), axis=2)


STATISTICS: Mapping[str, Callable[[Runs], Float64[np.ndarray, "R E"]]] = {
    "position": _length("position"),
    "velocity": _length("velocity"),
    "attitude": _length("attitude"),
    "nees": lambda runs: runs.nees["pose"] / runs.dof["pose"],
}
"""What is averaged over runs: lengths of errors in SI, and the NEES of the pose over its degrees of freedom."""


@saved()
@dataclass(frozen=True, eq=False, repr=False)
class TwoLevel(Drawable, Saved):
    """Means over runs whose filters have their own gains, from few of them and many on shared ones.

    Attributes
    ----------
    shared
        All runs, on gains along the reference.
    own
        The first of them, each with its own gains.
    excess
        Of the variance over that of as many runs with their own gains, at most.
    """

    shared: Comparison
    own: Comparison
    excess: float

    def __post_init__(self) -> None:
        if list(self.shared) != list(self.own):
            raise ValueError("Both levels have the same filters.")

    @property
    def num_runs(self) -> int:
        """Number of runs on shared gains."""
        return _num_runs(self.shared)

    @property
    def num_own(self) -> int:
        """Number of those that have runs with their own gains, too."""
        return _num_runs(self.own)

    @property
    def num_common(self) -> int:
        """Number of runs of both kinds in which no filter failed."""
        return len(self._rows()[1])

    def mean(self, model: str, statistic: str = "position") -> TwoLevelMean:
        """Mean over runs at every epoch, of filters with gains of their own.

        Parameters
        ----------
        model
            Name of the filter.
        statistic
            ``position`` (m), ``velocity`` (m/s), ``attitude`` (rad): lengths of errors; ``nees`` of the pose, over dof.

        Raises
        ------
        ValueError
            Fewer than two common runs, or no such statistic.
        """
        return two_level_mean(*self._values(model, statistic))

    def difference(self, model: str, other: str, statistic: str = "position") -> TwoLevelMean:
        """Mean over runs of one filter minus another, in the same runs; parameters and errors as of `mean`."""
        ours, theirs = self._values(model, statistic), self._values(other, statistic)
        return two_level_mean(*(a - b for a, b in zip(ours, theirs, strict=True)))

    def plot(self, *, level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
        """Draw mean position errors with what is certain of them, and what shared gains leave out.

        Parameters
        ----------
        level
            Of the intervals.
        axes
            Two Axes to draw into; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_two_level`.
        """
        return self._draw(level=level, axes=axes)

    def half_width(self, se: Any, level: float = 0.95) -> Any:
        """Half of Student's interval, with the degrees of freedom of the runs with gains of their own."""
        return t_quantile(probability("level", level), self.num_common - 1) * se

    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Runs in which no filter failed: on shared gains, and of these the ones with good runs of their own."""
        many = common_runs(self.shared.runs)
        return many, np.intersect1d(many, common_runs(self.own.runs))

    def _values(self, model: str, statistic: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if statistic not in STATISTICS:
            raise ValueError(f"{statistic!r} is none of {', '.join(STATISTICS)}.")
        of = STATISTICS[statistic]
        many, few = self._rows()
        cheap = of(self.shared[model])
        return cheap[many], cheap[few], of(self.own[model])[few]

    def __repr__(self) -> str:
        k = self.shared.epoch()
        along = self.shared.reference.name or "a trajectory"
        lines = [
            f"Two levels along {along}: {self.num_runs} runs on shared gains, {self.num_own} of them with their own too"
        ]
        if self.num_own == self.num_runs:
            lines.append("All runs have gains of their own: on shared ones they err too differently to stand for them.")
        if self.num_common < 2:
            return "\n".join([*lines, "No means: it takes 2 or more runs in which no model failed."])
        rows = []
        for model in self.shared:
            cells = [model]
            for statistic, digits in (("position", 4), ("nees", 3)):
                found = self.mean(model, statistic)
                cells.append(f"{written(found.value[k], digits)} ± {written(self.half_width(found.se[k]), 2)}")
                cells.append(f"{found.correction[k]:+.2g} ± {written(self.half_width(found.correction_se[k]), 2)}")
            rows.append(cells)
        head = ["", "position [m]", "own - shared [m]", "NEES/dof", "own - shared"]
        lines.append(f"means at {self.shared.runs[next(iter(self.shared))].time[k]:g} s with 95 % intervals")
        lines.append(format_table(head, rows, left=1))
        return "\n".join(lines)


def two_levels(run: Callable[[str, int], Comparison], num_runs: int, excess: float) -> TwoLevel:
    """Run as many with gains of their own as a pilot says, see `nav_jax.simulation.two_level`.

    Parameters
    ----------
    run
        Kind of gains, number of runs -> the first runs with them.
    num_runs
        Number of runs on shared gains.
    excess
        See `TwoLevel`.
    """
    shared = run("reference", num_runs)
    num_runs = _num_runs(shared)  # of an interrupted one
    own = run("estimate", min(_PILOT, num_runs))
    pilot = TwoLevel(shared, own, excess)
    wanted = _num_own(pilot, num_runs)
    return TwoLevel(shared, run("estimate", wanted), excess) if wanted > pilot.num_own else pilot


def _num_runs(of: Comparison) -> int:
    return len(next(iter(of.runs.values())))


def _num_own(pilot: TwoLevel, num_runs: int) -> int:
    """By the worst of all filters; all runs where the pilot cannot tell."""
    if pilot.num_common < 2:
        return num_runs
    k = pilot.shared.epoch()
    ratios = np.array([pilot.mean(model, of).ratio[k] for model in pilot.shared for of in _JUDGED])
    worst = float(np.nanmax(ratios, initial=0.0))
    wanted = num_dear(worst, num_runs, pilot.excess)
    return num_runs if wanted > _WORTH * num_runs else wanted
