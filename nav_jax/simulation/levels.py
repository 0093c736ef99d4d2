"""Two-level Monte Carlo: a cheap level whose mean is known, or that has many runs, and few with gains of their own."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import probability
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.text_table import number as written
from nav_jax.filter.layout import JUDGED
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.linear import KnownMeans
from nav_jax.simulation.ranking import common_runs
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.distributions import t_quantile
from nav_jax.statistics.levels import TwoLevelMean, controlled_mean, num_dear, two_level_mean

TWO_LEVEL: Final = "two-level"
"""What `nav_jax.compare` calls it."""
LINEAR: Final = "linear"
"""Runs on shared gains, made linear."""
PILOT = 64
"""Runs with their own gains from which the number of them is chosen."""
_JUDGED = ("position", "nees")
"""By which that number is chosen: what is printed."""
_WORTH = 0.5
"""Share of runs with their own gains from which on all of them have their own."""
_APART = 5.0
"""Standard errors by which the mean of linear runs may miss the one that is known of them."""


def _length(block: str) -> Callable[[Runs], Float64[np.ndarray, "R E"]]:
    return lambda runs: np.linalg.norm(runs.error[:, :, JUDGED[block]], axis=2)


STATISTICS: Mapping[str, Callable[[Runs], Float64[np.ndarray, "R E"]]] = {
    "position": _length("position"),
    "velocity": _length("velocity"),
    "attitude": _length("attitude"),
    "nees": lambda runs: runs.nees["pose"] / runs.dof["pose"],
}
"""What is averaged over runs: lengths of errors in SI, and the NEES of the pose over its degrees of freedom.

They are NaN in runs that failed."""


@saved(added=("known",))
@dataclass(frozen=True, eq=False, repr=False)
class TwoLevel(Drawable, Saved):
    """Means over runs whose filters have their own gains, from few of them and a cheap level.

    Attributes
    ----------
    shared
        The cheap level, on gains along the reference: all runs, or, if `known`, linear ones: as many as `own` has.
    own
        The first of them, each with its own gains.
    excess
        Of the variance over that of as many runs with their own gains as were asked for, at most.
    known
        Filter -> statistic -> mean of the cheap level, if it is known without runs.
    """

    shared: Comparison
    own: Comparison
    excess: float
    known: Mapping[str, KnownMeans] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if list(self.shared) != list(self.own):
            raise ValueError("Both levels have the same filters.")

    @property
    def num_runs(self) -> int:
        """Number of runs of the cheap level."""
        return _num_runs(self.shared)

    @property
    def num_own(self) -> int:
        """Number of those that have runs with their own gains, too."""
        return _num_runs(self.own)

    @property
    def num_common(self) -> int:
        """Number of runs of both kinds in which no filter failed."""
        return len(self._rows()[1])

    @property
    def with_means(self) -> tuple[str, ...]:
        """Filters with two good runs of either kind; others are left out, and keep no run from these."""
        return tuple(n for n in self.own if min(self.shared[n].num_good, self.own[n].num_good) >= 2)

    @property
    def cheap(self) -> str:
        """What the runs of the cheap level are: ``linear``, or ``shared`` by their gains."""
        return "linear" if self.known else "shared"

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
            Fewer than two common runs, a filter that has not two good runs, or no such statistic.
        """
        cheap, of_the_same, own = self._values(model, statistic)
        if self.known:
            return controlled_mean(self.known[model][statistic], of_the_same, own)
        return two_level_mean(cheap, of_the_same, own)

    def difference(self, model: str, other: str, statistic: str = "position") -> TwoLevelMean:
        """Mean over runs of one filter minus another, in the same runs; parameters and errors as of `mean`."""
        ours, theirs = self._values(model, statistic), self._values(other, statistic)
        cheap, of_the_same, own = (a - b for a, b in zip(ours, theirs, strict=True))
        if self.known:
            return controlled_mean(self.known[model][statistic] - self.known[other][statistic], of_the_same, own)
        return two_level_mean(cheap, of_the_same, own)

    def plot(self, *, level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
        """Draw mean position errors with what is certain of them, and what the cheap level leaves out.

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
        """Runs in which no filter failed: of the cheap level, and of these the ones with good runs of their own."""
        many = common_runs(self.shared.runs)
        few = np.intersect1d(many, common_runs(self.own.runs))
        # of runs that all have their own gains, those that failed are no part of the mean
        return few if self.num_own == self.num_runs else many, few

    def _values(self, model: str, statistic: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if statistic not in STATISTICS:
            raise ValueError(f"{statistic!r} is none of {', '.join(STATISTICS)}.")
        if model in self.own and model not in self.with_means:
            raise ValueError(f"{model} has no mean: its runs with gains of their own: {self.own[model].counts()}.")
        of = STATISTICS[statistic]
        many, few = self._rows()
        cheap = of(self.shared[model])
        return cheap[many], cheap[few], of(self.own[model])[few]

    def __repr__(self) -> str:
        k, own = self.own.epoch(), self.num_own
        along = self.own.reference.name or "a trajectory"
        if self.known:
            counts = f"{own} runs with gains of their own, and what linear filters do in them, whose mean is known"
        else:
            counts = f"{self.num_runs} runs on shared gains, {own} of them with their own too"
        lines = [f"Two levels along {along}: {counts}"]
        failed = [f"{name}: {r.counts()}" for name, r in self.own.runs.items() if r.num_failed]
        if not self.known and own == self.num_runs and not failed:
            lines.append("All runs have gains of their own: on shared ones they err too differently to stand for them.")
        if failed:
            lines.append(
                f"Of runs with gains of their own only those count in which no filter failed. {'; '.join(failed)}"
            )
        if self.num_common < 2:
            return "\n".join([*lines, "No means: it takes 2 or more runs in which no model failed."])
        if self.known and (ratio := self._ratio()):
            lines.append(f"as sure as {_round(self.num_common / ratio)} runs with gains of their own")
        rows = []
        for model in self.own:
            cells = [model]
            if model not in self.with_means:
                rows.append([model, *"----"])
                continue
            for statistic, digits in (("position", 4), ("nees", 3)):
                found = self.mean(model, statistic)
                cells.append(f"{written(found.value[k], digits)} ± {written(self.half_width(found.se[k]), 2)}")
                cells.append(f"{found.correction[k]:+.2g} ± {written(self.half_width(found.correction_se[k]), 2)}")
            rows.append(cells)
        less = f"own - {self.cheap}"
        head = ["", "position [m]", f"{less} [m]", "NEES/dof", less]
        lines.append(f"means at {self.own.runs[next(iter(self.own))].time[k]:g} s with 95 % intervals")
        lines.append(format_table(head, rows, left=1))
        return "\n".join(lines)

    def _ratio(self) -> float:
        """Variance of the differences over that of the runs with gains of their own, of the worst that is judged."""
        k = self.own.epoch()
        ratios = [self.mean(model, of).ratio[k] for model in self.with_means for of in _JUDGED]
        return float(np.nanmax(ratios, initial=0.0))

    def _holds(self) -> bool:
        """Whether the runs of the cheap level may have the means that are known of them."""
        k = self.own.epoch()
        for model, known in self.known.items():
            for of in _JUDGED:
                values = STATISTICS[of](self.shared[model])[:, k]
                off = np.abs(values.mean() - known[of][k])
                if off > _APART * values.std(ddof=1) / np.sqrt(len(values)):
                    return False
        return True


def two_levels(
    run: Callable[[str, int], Comparison], num_runs: int, excess: float, known: Mapping[str, KnownMeans] | None
) -> TwoLevel:
    """Run as many with gains of their own as a pilot says, see `nav_jax.simulation.two_level`.

    Parameters
    ----------
    run
        Kind of gains, number of runs -> the first runs with them.
    num_runs
        As many with gains of their own would be as sure.
    excess
        See `TwoLevel`.
    known
        Means of linear runs, see `nav_jax.simulation.linear`; None where nobody knows them.
    """
    own = run("estimate", min(PILOT, num_runs))
    if known is not None:
        found = TwoLevel(run(LINEAR, _num_runs(own)), own, excess, known)
        # a pilot of differences with a long tail knows their variance badly: what came of it is looked at again
        while found.num_own < (wanted := _num_controlled(found, num_runs)) <= _WORTH * num_runs:
            found = TwoLevel(run(LINEAR, wanted), run("estimate", wanted), excess, known)
            if found.num_own < wanted:  # interrupted
                return found
        if wanted <= found.num_own:
            return found
    shared = run("reference", num_runs)
    num_runs = _num_runs(shared)  # of an interrupted one
    pilot = TwoLevel(shared, own, excess)
    wanted = _num_own(pilot, num_runs)
    return TwoLevel(shared, run("estimate", wanted), excess) if wanted > pilot.num_own else pilot


def _num_runs(of: Comparison) -> int:
    return min(map(len, of.runs.values()))


def _all_good(pilot: TwoLevel) -> bool:
    """Whether there are means, and of all runs: those that fail are others, of which the cheap level knows nothing."""
    return pilot.num_common >= 2 and not any(
        r.num_failed for r in (*pilot.own.runs.values(), *pilot.shared.runs.values())
    )


def _num_controlled(pilot: TwoLevel, num_runs: int) -> int:
    """By the worst of all filters: var(D) / n is var(own) (1 + excess) / num_runs; all where the pilot cannot tell."""
    if not (_all_good(pilot) and pilot._holds()):
        return num_runs + 1
    return math.ceil(num_runs * pilot._ratio() / (1 + pilot.excess))


def _num_own(pilot: TwoLevel, num_runs: int) -> int:
    """By the worst of all filters; all runs where the pilot cannot tell."""
    if not _all_good(pilot):
        return num_runs
    wanted = num_dear(pilot._ratio(), num_runs, pilot.excess)
    return num_runs if wanted > _WORTH * num_runs else wanted


def _round(n: float) -> str:
    """To two digits, as more are not known."""
    return f"{float(f'{n:.2g}'):,.0f}".replace(",", "\u2009")
