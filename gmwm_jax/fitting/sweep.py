"""The fits of many sub-models of one model, in one compiled call.

A sub-model is the superset with the columns of the absent components set to zero: a mask, so that the same program
serves them all, vmapped. Each has the starting points of its own lattice, and finds the minimum that `fit` finds.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.chunks import chunks
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting.estimator import as_fit
from gmwm_jax.fitting.problem import Problem
from gmwm_jax.fitting.reduced import Data, Layout
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.search import SIZE, Solution, minimise, minimise_near
from gmwm_jax.fitting.weights import Given, root_of
from gmwm_jax.processes.base import Composite

_CHUNK = 16
"""Sub-models at once: a descent takes as many steps as the longest beside it."""
_REPLICATES = 64
"""Fits to replicates at once."""


class Sweep(NamedTuple):
    """M sub-models fitted to one wavelet variance."""

    problem: Problem
    """Of the superset."""
    present: Bool[np.ndarray, "M P"]
    """Which components are in, in the order of the problem."""
    solution: Solution
    """In the coordinates of the superset; those of absent components mean nothing."""
    fits: tuple[Fit, ...]

    def again(
        self, variances: Float[np.ndarray, "B J"], advance: Callable[[int], Any] | None = None
    ) -> Float[np.ndarray, "M B J"]:
        """Wavelet variances of every sub-model fitted again to other ones, near its own fit.

        Parameters
        ----------
        variances
            Wavelet variances, positive.
        advance
            Called with the number of fits done since the last call.
        """
        problem, fits = self.problem, self.fits
        tau, omega = fits[0].wv.scales, fits[0].omega
        whitener = root_of(omega)
        y = variances @ whitener.T
        unit = float(np.max(np.abs(y))) / SIZE
        data = whitener / unit, tau, problem.bounds, problem.shapes, problem.held
        starts = np.stack([problem.starts_around(at) for at in self.solution.coordinates])
        m, b = np.divmod(np.arange(len(fits) * len(y)), len(y))
        call = partial(_minimise_all_near, problem.layout, data)
        found = _in_chunks(call, y[b] / unit, starts[m], self.present[m], size=_REPLICATES, advance=advance)
        fitted = problem.fitted_variances(found, tau)
        return fitted.reshape(len(fits), len(y), -1)


def sweep(
    whole: Fit,
    superset: Composite,
    subsets: Sequence[tuple[int, ...]],
    *,
    key: PRNGKey | None = None,
    advance: Callable[[int], Any] | None = None,
) -> Sweep:
    """Fit sub-models of one model to the wavelet variance that the model itself was fitted to, with its weights.

    Parameters
    ----------
    whole
        A fit of the superset, whose data, weights, rate and level all sub-models share.
    superset, subsets
        The model without estimates, and the positions of the components of each sub-model.
    key
        As of `fit`.
    advance
        Called with the number of sub-models fitted since the last call.
    """
    wv, omega = whole.wv, whole.omega
    weights = whole.weights if whole.weights.first is None else Given(omega)
    tau_max = float(wv.scales[-1])
    problem = Problem.of(superset, tau_max)
    parts = [Problem.of(Composite([superset.processes[i] for i in s]), tau_max) for s in subsets]
    at = {position: i for i, position in enumerate(problem.order)}
    places = [[at[s[i]] for i in part.order] for s, part in zip(subsets, parts, strict=True)]
    present = np.zeros((len(subsets), len(problem.processes)), dtype=bool)
    for row, place in zip(present, places, strict=True):
        row[place] = True

    _, nodes = problem.starting_points(key)
    made: dict[str, Array | np.ndarray] = {}
    for part in parts:
        if repr(part.searched) not in made:
            made[repr(part.searched)] = part.starting_points(key)[0]
    lattices = [made[repr(part.searched)] for part in parts]
    num_rows = max(len(nodes), *map(len, lattices))
    rows = np.arange(num_rows)
    placements = np.repeat(problem.bounds[None, None, :, 0], len(parts), axis=0).repeat(num_rows, axis=1)
    columns = [_columns(problem, part, place) for part, place in zip(parts, places, strict=True)]
    moving = np.zeros((len(parts), len(problem.bounds)), dtype=bool)
    for full, free, own, at_columns in zip(placements, moving, lattices, columns, strict=True):
        full[:, at_columns] = own[rows % len(own)]
        free[at_columns] = True
    nodes = np.where(moving[:, None], nodes[rows % len(nodes)], problem.bounds[:, 0])

    whitener = root_of(omega)
    y = whitener @ wv.variance
    unit = float(np.max(np.abs(y))) / SIZE
    data = y / unit, whitener / unit, wv.scales, problem.bounds, problem.shapes, problem.held
    call = partial(_minimise_all, problem.layout, data)
    found = _in_chunks(call, placements, nodes, present, size=_CHUNK, advance=advance)
    fits = []
    for m, (part, place) in enumerate(zip(parts, places, strict=True)):
        own = Solution(*(leaf[m] for leaf in found))
        own = own._replace(coordinates=own.coordinates[columns[m]], amplitudes=own.amplitudes[place])
        options: Any = {"unit": unit, "num_descents": problem.num_descents, "weights": weights}
        fits.append(as_fit(part, own, wv, omega, rate=whole.rate, level=whole.level, **options))
    found = found._replace(objective=found.objective * unit**2)
    return Sweep(problem, present, found, tuple(fits))


def _columns(problem: Problem, part: Problem, place: list[int]) -> list[int]:
    """Where the search coordinates of a part stand among those of the whole."""
    every = np.arange(len(problem.bounds))
    found = [np.atleast_1d(every[problem.layout.position(i)]) for i in place[: part.layout.num_shapes]]
    return [int(c) for own in found for c in own]


def _in_chunks(function: Any, *arrays: np.ndarray, size: int, advance: Callable[[int], Any] | None = None) -> Solution:
    """Map over leading axes, some at a time."""
    num, parts = len(arrays[0]), []
    for rows, count in chunks(num, size):
        parts.append(jax.tree.map(np.asarray, function(*(a[rows] for a in arrays))))
        if advance:
            advance(count)
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:num], *parts)


@few_at_a_time
@partial(jax.jit, static_argnums=0)
def _minimise_all(layout: Layout, data: Any, placements: Any, nodes: Any, present: Any) -> Solution:
    def one(placements: Array, nodes: Array, present: Array) -> Solution:
        return minimise(layout, placements, nodes, Data(*data, wanted=present))

    return jax.vmap(one)(placements, nodes, present)


@few_at_a_time
@partial(jax.jit, static_argnums=0)
def _minimise_all_near(layout: Layout, data: Any, y: Any, starts: Any, present: Any) -> Solution:
    def one(y: Array, starts: Array, present: Array) -> Solution:
        return minimise_near(layout, starts, Data(y, *data, wanted=present))

    return jax.vmap(one)(y, starts, present)
