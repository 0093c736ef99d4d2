"""The fits of many sub-models of one model, in one compiled call.

A sub-model is the superset with the columns of the absent components set to zero: a mask, so that the same program
serves them all, vmapped. Each has the starting points of its own lattice, and finds the minimum that `fit` finds.
"""

import itertools
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.estimator import as_fit, starting_points
from gmwm_jax.fitting.problem import Problem, pose
from gmwm_jax.fitting.refit import fitted_variances, starts_around
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.search import NUM_DESCENTS, NUM_ROUNDS, SIZE, Data, Layout, Solution, minimise, minimise_near
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.variance.wavelet import WaveletVariance

Subset = tuple[int, ...]
"""Positions of the components of a sub-model in its superset."""


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


def sweep(
    superset: Composite,
    subsets: Sequence[Subset],
    wv: WaveletVariance,
    omega: Float[np.ndarray, "J J"],
    *,
    weights: str,
    rate: float | None,
    level: float,
    key: PRNGKey | None = None,
) -> Sweep:
    """Fit sub-models of one model to the wavelet variance of one channel, all with the same weights.

    Parameters
    ----------
    superset, subsets
        The model and the positions of the components of each sub-model.
    wv, omega
        One channel and its weights.
    weights, rate, level, key
        As of the fits that come out.
    """
    tau_max = float(wv.scales[-1])
    problem = pose(superset, tau_max)
    parts = [pose(Composite([superset.processes[i] for i in s]), tau_max) for s in subsets]
    at = {position: i for i, position in enumerate(problem.order)}
    places = [[at[s[i]] for i in part.order] for s, part in zip(subsets, parts, strict=True)]
    present = np.zeros((len(subsets), len(problem.processes)), dtype=bool)
    for row, place in zip(present, places, strict=True):
        row[place] = True

    _, nodes = starting_points(problem, tau_max, key)
    made: dict[str, np.ndarray] = {}
    for part in parts:
        if repr(part.searched) not in made:
            made[repr(part.searched)] = starting_points(part, tau_max, key)[0]
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

    whitener = np.linalg.cholesky(omega).T
    y = whitener @ wv.variance
    unit = float(np.max(np.abs(y))) / SIZE
    data = y / unit, whitener / unit, wv.scales, problem.bounds, problem.shapes, problem.held
    found = _in_chunks(partial(_minimise_all, problem.layout, data), placements, nodes, present, size=_CHUNK)
    fits = []
    for m, (part, place) in enumerate(zip(parts, places, strict=True)):
        own = Solution(*(leaf[m] for leaf in found))
        own = own._replace(coordinates=own.coordinates[columns[m]], amplitudes=own.amplitudes[place])
        num = NUM_ROUNDS * NUM_DESCENTS if problem.searched else 1
        fits.append(as_fit(part, own, wv, omega, unit=unit, num_descents=num, weights=weights, rate=rate, level=level))
    found = found._replace(objective=found.objective * unit**2)
    return Sweep(problem, present, found, tuple(fits))


def _columns(problem: Problem, part: Problem, place: list[int]) -> list[int]:
    """Where the search coordinates of a part stand among those of the whole."""
    every = np.arange(len(problem.bounds))
    found = [np.atleast_1d(every[problem.layout.position(i)]) for i in place[: part.layout.num_shapes]]
    return [int(c) for own in found for c in own]


def _in_chunks(function: Any, *arrays: np.ndarray, size: int, advance: Callable[[int], Any] | None = None) -> Solution:
    """Map over leading axes, some at a time; the last chunk is filled up, another size would compile again."""
    num, parts = len(arrays[0]), []
    for first in range(0, num, size):
        at = np.minimum(np.arange(first, first + size), num - 1)
        parts.append(jax.tree.map(np.asarray, function(*(a[at] for a in arrays))))
        if advance:
            advance(min(size, num - first))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:num], *parts)


@partial(jax.jit, static_argnums=0)
def _minimise_all(layout: Layout, data: Any, placements: Any, nodes: Any, present: Any) -> Solution:
    def one(placements: Array, nodes: Array, present: Array) -> Solution:
        return minimise(layout, placements, nodes, Data(*data, wanted=present))

    return jax.vmap(one)(placements, nodes, present)


def resweep(
    swept: Sweep, variances: Float[np.ndarray, "B J"], advance: Callable[[int], Any] | None = None
) -> Float[np.ndarray, "M B J"]:
    """Wavelet variances of every sub-model fitted again to other ones, near its fit, with the same weights.

    Parameters
    ----------
    swept
        Where to start, and the weights.
    variances
        Wavelet variances, positive.
    advance
        Called with the number of fits done since the last call.
    """
    problem, fits = swept.problem, swept.fits
    tau, omega = fits[0].wv.scales, fits[0].omega
    whitener = np.linalg.cholesky(omega).T
    y = variances @ whitener.T
    unit = float(np.max(np.abs(y))) / SIZE
    data = whitener / unit, tau, problem.bounds, problem.shapes, problem.held
    starts = np.stack([starts_around(at, problem.bounds) for at in swept.solution.coordinates])
    m, b = np.divmod(np.arange(len(fits) * len(y)), len(y))
    call = partial(_minimise_all_near, problem.layout, data)
    found = _in_chunks(call, y[b] / unit, starts[m], swept.present[m], size=_REPLICATES, advance=advance)
    fitted = np.asarray(fitted_variances(problem.layout, problem.shapes, found, tau))
    return fitted.reshape(len(fits), len(y), -1)


@partial(jax.jit, static_argnums=0)
def _minimise_all_near(layout: Layout, data: Any, y: Any, starts: Any, present: Any) -> Solution:
    def one(y: Array, starts: Array, present: Array) -> Solution:
        return minimise_near(layout, starts, Data(y, *data, wanted=present))

    return jax.vmap(one)(y, starts, present)


def submodels(superset: Composite) -> list[Subset]:
    """All sub-models of a model, from small to large; components that can be swapped count once.

    A component whose amplitude is held is in all of them.
    """
    groups: dict[Hashable, list[int]] = {}
    for i, p in enumerate(superset.processes):
        groups.setdefault(_identity(p), []).append(i)
    choices = [
        [members] if _is_held(superset.processes[members[0]]) else [members[:k] for k in range(len(members) + 1)]
        for members in groups.values()
    ]
    found = [tuple(sorted(itertools.chain(*parts))) for parts in itertools.product(*choices)]
    return sorted((s for s in found if s), key=lambda s: (len(s), s))


def common_superset(models: Sequence[Composite]) -> tuple[Composite, list[Subset]]:
    """The smallest model that contains all of the given ones, and where in it each of them is."""
    processes: list[AbstractProcess] = []
    subsets: list[Subset] = []
    for model in models:
        free = list(range(len(processes)))
        places = []
        for p in model.processes:
            place = next((i for i in free if _identity(processes[i]) == _identity(p)), None)
            if place is None:
                place = len(processes)
                processes.append(p)
            else:
                free.remove(place)
            places.append(place)
        subsets.append(tuple(sorted(places)))
    return Composite(processes), subsets


def components(model: Composite) -> Counter[Hashable]:
    """What a model is made of, whatever the order and the starting values: how often each component."""
    return Counter(_identity(p) for p in model.processes)


def text_of(model: Composite) -> str:
    """A model without starting values, as ``WN + 2*GM``."""
    counts: Counter[str] = Counter()
    for p in model.processes:
        held = ", ".join(f"{name}={float(getattr(p, name)):.6g} fixed" for name in p.fixed)
        counts[f"{p.kind}({held})" if held else p.kind] += 1
    return " + ".join(f"{count}*{name}" if count > 1 else name for name, count in counts.items())


def _identity(p: AbstractProcess) -> Hashable:
    """What tells a component from others: its kind, and the values that are held."""
    return type(p), tuple((name, float(getattr(p, name))) for name in p.fixed)


def _is_held(p: AbstractProcess) -> bool:
    return p.parameters[-1].name in p.fixed
