r"""The smallest filter that navigates well: design of noise models by the navigation error that they make.

A filter with fewer states than the truth has processes should not believe a part of the truth, but what serves best
along the trajectories at hand. Over filter models WN + k GM on each axis the expected logarithmic score

    S = 1/2 mean over epochs of [ log det C + tr(C^-1 T) ],      T true, C claimed covariance of the navigation error,

is minimised by its gradient: linear covariances, differentiated through the whole run. It is a proper score: a filter
gains by small errors (log det C, once C is about T) and by claims that are true; ``error`` asks for small errors only.
Every structure (number of processes of accelerometers and of gyros) is a mask on one compiled program. They are sought
one after the other, smaller ones first: each search also starts from the best smaller filter with a weak process more.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import jax.numpy as jnp
import numpy as np

from gmwm_jax._internal.checks import integer
from gmwm_jax._internal.chunks import until_interrupted
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.progress import Progress
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from nav_jax.filter.experiment import Setup
from nav_jax.filter.joint_covariance import motion_of, noise_of
from nav_jax.filter.scenario import Scenario
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import states_in_filter
from nav_jax.lincov._family import Family, Structure
from nav_jax.lincov._search import Course, Ended, Search
from nav_jax.lincov.analysis import Covariances, analyse, model_of
from nav_jax.simulation.campaign import compare
from nav_jax.simulation.comparison import Comparison
from nav_jax.statistics.epochs import inside_outages

OBJECTIVES = ("score", "error")


@saved(not_finite=("loss", "loss_naive"))
@dataclass(frozen=True, eq=False)
class Candidate:
    """The best filter of one structure.

    Attributes
    ----------
    num_accel, num_gyro
        Gauss-Markov processes on each axis besides white noise.
    num_states
        Sensor states in all.
    errors
        What it believes.
    naive
        The best of the same structure that believes a part of the truth as it is; None where the truth has not as many
        processes of first order.
    loss, loss_naive
        Of both, the smaller the better; NaN where there is no `naive`.
    converged
        Whether the search came to its end.
    covariances, covariances_naive
        Of each scenario; empty where there is no `naive`.
    """

    num_accel: int
    num_gyro: int
    num_states: int
    errors: ImuErrors
    naive: ImuErrors | None
    loss: float
    loss_naive: float
    converged: bool
    covariances: tuple[Covariances, ...]
    covariances_naive: tuple[Covariances, ...]

    @property
    def name(self) -> str:
        """Such as ``2 GM accel, 1 GM gyro``, or ``1 GM + 1 RW accel, 0 GM gyro`` for a truth with random walks."""
        parts = []
        for sensor, channel in (("accel", 0), ("gyro", 3)):
            states = Counter(p.kind for p in self.errors.models[channel].processes if states_in_filter(p))
            kinds = [f"{num} {kind}" for kind, num in states.items()] or ["0 GM"]
            parts.append(f"{' + '.join(kinds)} {sensor}")
        return ", ".join(parts)


def _check(design: "Design") -> None:
    """Raise a ValueError for a design of nothing, in a file."""
    if not design.candidates or not design.scenarios or len(design.right) != len(design.scenarios):
        raise ValueError("There is no candidate in it, or not one analysis of each scenario.")


@saved(check=_check)
@dataclass(frozen=True, eq=False, repr=False)
class Design(Drawable, Saved, Labelled):
    """The result of `design`: the best filter of each structure, with fewer states first.

    Attributes
    ----------
    candidates
        One a structure.
    right
        Covariances of the filter that believes the truth, of each scenario.
    objective
        ``score`` or ``error``.
    truth, scenarios
        What they were designed for.
    complete
        Whether all structures were searched: false after an interrupt from the keyboard.
    """

    candidates: tuple[Candidate, ...]
    right: tuple[Covariances, ...]
    objective: str
    truth: ImuErrors
    scenarios: tuple[Scenario, ...]
    complete: bool = True

    @property
    def pareto(self) -> tuple[Candidate, ...]:
        """Candidates that no other with as few states surpasses."""
        front: list[Candidate] = []
        for c in self.candidates:
            if not front or c.loss < min(f.loss for f in front):
                front = [f for f in front if f.num_states < c.num_states] + [c]
        return tuple(front)

    def best(self, max_states: int | None = None) -> Candidate:
        """The best filter within a budget of sensor states.

        Raises
        ------
        ValueError
            No structure has so few states.
        """
        allowed = [c for c in self.candidates if max_states is None or c.num_states <= max_states]
        if not allowed:
            raise ValueError(
                f"No structure has {max_states} states or fewer; the smallest has {self.candidates[0].num_states}."
            )
        return min(allowed, key=lambda c: c.loss)

    def confirm(
        self, *, num_runs: int, key: Any, candidate: Candidate | None = None, **options: Any
    ) -> tuple[Comparison, ...]:
        """A Monte Carlo of a candidate, its naive counterpart and the right filter on fresh noise, for each scenario.

        Filters are named ``designed``, ``truncated`` (if there is one) and ``right``.

        Parameters
        ----------
        num_runs, key, options
            See `nav_jax.compare`.
        candidate
            The best unless told otherwise.
        """
        c = self.best() if candidate is None else candidate
        filters = {"designed": c.errors, "truncated": c.naive, "right": self.truth}
        filters = {name: f for name, f in filters.items() if f is not None}
        return tuple(compare(s, self.truth, filters, num_runs=num_runs, key=key, **options) for s in self.scenarios)

    def _arrays(self) -> Arrays:
        """A row a candidate, at the judged epochs as `table`."""
        names = ("num_states", "num_accel", "num_gyro", "loss", "loss_naive", "converged")
        variables = {name: Values("filter", [getattr(c, name) for c in self.candidates]) for name in names}
        front = {id(c) for c in self.pareto}
        variables["best"] = Values("filter", [id(c) in front for c in self.candidates])
        for end, of in (("", "covariances"), ("_truncated", "covariances_naive")):
            seen = zip(*(judged(getattr(c, of)) for c in self.candidates), strict=True)
            for (name, unit), column in zip(
                (("position", "m"), ("position_claimed", "m"), ("nees_over_9", "1")), seen, strict=True
            ):
                variables[f"{name}{end}"] = Values("filter", column, unit)
        coordinates = {"filter": Values("filter", [c.name for c in self.candidates])}
        attributes = {"objective": self.objective, "truth": repr(self.truth), "complete": int(self.complete)}
        return Arrays(variables, coordinates, attributes, ("filter",))

    def table(self) -> str:
        """States against error, at the judged epoch of each scenario (root mean square over the scenarios)."""
        head = [
            "filter",
            "states",
            self.objective,
            "position [m]",
            "claimed [m]",
            "NEES / 9",
            "truncated: position",
            "NEES / 9",
            "",
        ]
        on_front = {id(c) for c in self.pareto}
        rows = []
        for c in self.candidates:
            designed, naive = judged(c.covariances), judged(c.covariances_naive)
            cells = [number(x, 4) for x in designed] + ["-" if np.isnan(x) else number(x, 4) for x in naive[::2]]
            mark = " ".join(["*"] * (id(c) in on_front) + ["not converged"] * (not c.converged))
            rows.append([c.name, str(c.num_states), number(c.loss, 5), *cells, mark])
        position, claimed, nees = judged(self.right)
        states = str(len(self.truth.states))
        rows.append(["truth", states, "", *(number(x, 4) for x in (position, claimed, nees)), "", "", ""])
        return format_table(head, rows)

    def __repr__(self) -> str:
        where = ", ".join(s.reference.name or "trajectory" for s in self.scenarios)
        cut = "" if self.complete else " INTERRUPTED: the larger structures are missing."
        title = f"Filters designed for {where} by {self.objective}; * best for its number of states.{cut}"
        return f"{title}\n{self.table()}"


MAX_PROCESSES = 10
"""Gauss-Markov processes of an axis that a designed filter may have: one for each decade of correlation times is
plenty, and from a sample to the length of a flight there are fewer than ten."""


def design(
    scenario: Scenario | Sequence[Scenario],
    truth: ImuErrors,
    *,
    max_accel: int = 2,
    max_gyro: int = 2,
    max_states: int | None = None,
    objective: str = "score",
    num_starts: int = 1,
    max_steps: int = 60,
    progress: Progress = False,
) -> Design:
    """Find the best filter of each structure WN + k GM an axis, by its true error along trajectories.

    Where the truth has a random walk a process may be one too. An interrupt from the keyboard ends the search with the
    structures that are done.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth; one or a sequence of them. Epochs in outages count, their ends with them;
        all where there is none.
    truth
        Errors of the IMU.
    max_accel, max_gyro
        Most Gauss-Markov processes on an axis.
    max_states
        Structures with more sensor states are left out.
    objective
        ``score``: small errors and true claims of position, velocity and attitude; ``error``: a small position error.
    num_starts
        Searches of each structure from the best parts of the truth; one more starts from the best smaller structure.
    max_steps
        Of each search.
    progress
        Show a bar of structures (needs the extra ``app``); or a function of what is done and the total, which may
        cancel by raising.

    Raises
    ------
    ValueError
        No structure within the budget, no scenario, unknown objective; as of `nav_jax.analyse`.
    KeyboardInterrupt
        Before the first structure was done.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.design(scenario, truth, max_accel=1, max_gyro=0, max_steps=2)
    >>> sorted({candidate.num_states for candidate in found.candidates})
    [0, 3]
    """
    truth = model_of(truth)
    listed = (scenario,) if isinstance(scenario, Scenario) else scenario
    if not isinstance(listed, Sequence) or not all(isinstance(s, Scenario) for s in listed):
        raise ValueError(f"Scenarios are wanted, Scenario(reference, aiding, initial), and this is {scenario!r}.")
    scenarios = tuple(listed)
    if not scenarios:
        raise ValueError("Give at least one scenario.")
    if objective not in OBJECTIVES:
        raise ValueError(f"The objective is one of {', '.join(OBJECTIVES)}, and is {objective!r}.")
    for name, most in (("max_accel", max_accel), ("max_gyro", max_gyro)):
        if integer(name, most, 0) > MAX_PROCESSES:
            raise ValueError(
                f"{name} is {MAX_PROCESSES} processes an axis at most, and is {most}: each number up to it is a search "
                "of its own, for every number of the other sensor."
            )
    family = Family(truth, max_accel, max_gyro)
    num_starts, max_steps = integer("num_starts", num_starts, 1), integer("max_steps", max_steps, 1)
    structures = [
        s
        for s in sorted(product(range(max_accel + 1), range(max_gyro + 1)), key=sum)
        if max_states is None or family.num_states(s) <= max_states
    ]
    if not structures:
        raise ValueError(f"No structure has {max_states} sensor states or fewer.")
    courses = tuple(_course(s, truth) for s in scenarios)
    search = Search(courses, family, objective, num_starts, max_steps)
    found: dict[Structure, Ended] = {}
    with until_interrupted(found, len(structures), "structure", progress) as bar:
        for s in structures:
            found[s] = search(s, found)
            bar.update(1)
    candidates = [_candidate(family, scenarios, s, ended) for s, ended in found.items()]
    candidates.sort(key=lambda c: (c.num_states, c.loss))
    right = tuple(analyse(s, truth, {"right": truth})["right"] for s in scenarios)
    return Design(tuple(candidates), right, objective, truth, scenarios, complete=len(found) == len(structures))


def _candidate(family: Family, scenarios: Sequence[Scenario], structure: Structure, ended: Ended) -> Candidate:
    errors = family.errors(ended.best, structure)
    naive = None if ended.naive is None else family.errors(ended.naive, structure)
    filters = {"designed": errors} | ({} if naive is None else {"truncated": naive})
    found = [analyse(s, family.truth, filters) for s in scenarios]
    return Candidate(
        *structure,
        family.num_states(structure),
        errors,
        naive,
        ended.loss,
        ended.loss_naive,
        ended.converged,
        tuple(a["designed"] for a in found),
        () if naive is None else tuple(a["truncated"] for a in found),
    )


def _course(scenario: Scenario, truth: ImuErrors) -> Course:
    setup = Setup(scenario, truth.rate)
    time = setup.output_times
    inside = inside_outages(time, setup.outages, setup.fixes) if setup.outages else np.full(len(time), True)
    if not inside.any():
        raise ValueError("An outage has no epoch inside: give a shorter output_interval.")
    segments = jnp.asarray(setup.output_segments[inside])
    return Course(setup.experiment, motion_of(setup.experiment), noise_of(setup.experiment, truth), segments)


def judged(covariances: Sequence[Covariances]) -> tuple[float, float, float]:
    """RMS and claimed position error and NEES / 9 at the judged epochs; NaN of nothing."""
    if not covariances:
        return np.nan, np.nan, np.nan
    at = [(c, c.epoch()) for c in covariances]
    position, claimed = (
        float(np.sqrt(np.mean([x[k] ** 2 for x, k in rows])))
        for rows in ([(c.rms("position"), k) for c, k in at], [(c.rms_claimed("position"), k) for c, k in at])
    )
    return position, claimed, float(np.mean([c.nees("navigation")[k] / c.dof("navigation") for c, k in at]))
