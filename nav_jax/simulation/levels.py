"""Two-level Monte Carlo: many runs on shared gains, corrected by a few whose filters have their own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Key

from gmwm_jax._internal.checks import integer, number, probability
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.progress import Progress
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.text_table import number as written
from gmwm_jax._internal.typing import Real
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.simulation.campaign import compare
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.ranking import common_runs
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.distributions import t_quantile
from nav_jax.statistics.levels import TwoLevelMean, num_dear, two_level_mean

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
        return t_quantile(probability("level", level), len(self._rows()[1]) - 1) * se

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
        if len(self._rows()[1]) < 2:
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


def two_level(
    scenario: Scenario,
    truth: ImuErrors | RecordedErrors,
    filters: Mapping[str, ImuErrors] | ImuErrors | None = None,
    *,
    num_runs: int,
    key: Key[Any, ""],
    excess: Real = 0.05,
    workers: int | None = None,
    progress: Progress = False,
) -> TwoLevel:
    """Compare filters with gains of their own at little more than the cost of shared ones.

    Gains that are computed once along the reference are exact to first order in the errors, so that a run on them and
    the same run on its own gains err alike. The mean of many of the first, plus the mean difference of a few, is the
    mean of the second without bias (Giles 2015). How many differences it takes follows from a pilot of 64: at the epoch
    at which filters are judged, and there for position and NEES of all filters, the variance should be at most 1 +
    excess times that of `num_runs` runs with their own gains, as far as the pilot can tell. Where that would take half
    of the runs or more, all have their own.

    Parameters
    ----------
    scenario, truth, filters, key, workers, progress
        See `compare`.
    num_runs
        Number of runs on shared gains.
    excess
        See above.

    Returns
    -------
    TwoLevel
        `mean` and `difference` at every epoch, and what linearisation costs: their ``correction``.

    Raises
    ------
    ValueError
        As in `compare`; an excess that is not positive, fewer than two runs.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.simulation.two_level(scenario, truth, num_runs=8, key=jax.random.key(0))
    >>> found.mean("filter").value.shape
    (10,)
    """
    num_runs = integer("num_runs", num_runs, 2)
    excess = number("excess", excess)
    how = {"key": key, "workers": workers, "progress": progress}
    shared = compare(scenario, truth, filters, num_runs=num_runs, gains="reference", **how)
    num_runs = _num_runs(shared)  # of an interrupted one
    own = compare(scenario, truth, filters, num_runs=min(_PILOT, num_runs), gains="estimate", **how)
    pilot = TwoLevel(shared, own, excess)
    wanted = _num_own(pilot, num_runs)
    if wanted > pilot.num_own:
        own = compare(scenario, truth, filters, num_runs=wanted, gains="estimate", **how)
    return TwoLevel(shared, own, excess)


def _num_runs(of: Comparison) -> int:
    return len(next(iter(of.runs.values())))


def _num_own(pilot: TwoLevel, num_runs: int) -> int:
    """By the worst of all filters; all runs where the pilot cannot tell."""
    if len(pilot._rows()[1]) < 2:
        return num_runs
    k = pilot.shared.epoch()
    ratios = np.array([pilot.mean(model, of).ratio[k] for model in pilot.shared for of in _JUDGED])
    worst = float(np.nanmax(ratios, initial=0.0))
    wanted = num_dear(worst, num_runs, pilot.excess)
    return num_runs if wanted > _WORTH * num_runs else wanted
