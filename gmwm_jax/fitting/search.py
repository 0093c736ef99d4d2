"""The GMWM estimator: separable least squares on the wavelet variance, solved for its global minimum.

Minimise over theta   Q(theta) = (nu_hat - nu(theta))' Omega (nu_hat - nu(theta))   (Guerrier et al. 2013).

A model is linear in its amplitudes c >= 0 once the shapes u (log correlation times) are given: nu = A(u) c. With
Omega = L L', y = L' nu_hat and B(u) = L' A(u), the amplitudes follow exactly from a small non-negative least-squares
problem, and what is left is a smooth function of the few shapes alone (variable projection, Golub & Pereyra 1973):

    r(u) = y - B(u) c(u),    c(u) = argmin_{c >= 0} |y - B(u) c|.

A component that the data do not want gets exactly zero; nothing crawls along a boundary. Newton's method runs on
Q(u) = |r(u)|^2 from many starts at once (`minimise`), and the lowest end is taken.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Float, Int

from gmwm_jax.fitting._descent import TOUCHES, descend
from gmwm_jax.fitting.reduced import Data, Layout, design, fold, objective, project

NUM_ROUNDS = 2
NUM_DESCENTS = 8
"""Descents in a round."""
_STEPS, _MAX_STEPS = 25, 100
"""Of each descent of a round, and of the one that goes on from the lowest end."""
SIZE = 1e3
"""Largest entry of L' nu_hat as the search sees it, whatever the weights: its tolerances then mean the same always."""


class Solution(NamedTuple):
    """The minimum, and what is needed to judge it."""

    coordinates: Float[Array, " C"]
    amplitudes: Float[Array, " P"]
    objective: Float[Array, ""]
    slope: Float[Array, ""]
    """Largest |dQ/du| over the coordinates: what moving a correlation time by a factor e would still gain."""
    num_agreeing: Int[Array, ""]
    """How many descents ended within 1e-6 relative of the lowest end."""


def smallest_slope(objective: Any) -> Any:
    """The slope below which a search is at its minimum, for data of `SIZE`.

    The first-order gain of moving a correlation time by a tenth of its logarithm is then below 1e-5 of the objective.
    """
    return 1e-4 * objective + 1e-10 * SIZE**2


def _without_derivatives(search: Callable[..., Solution]) -> Callable[..., Solution]:
    """A search that raises where it is differentiated.

    Loops that end when they have converged have no derivative that says how the minimum moves with the data.
    """
    guarded = jax.custom_jvp(search, nondiff_argnums=(0,))

    @guarded.defjvp
    def refuse(layout: Layout, primals: Any, tangents: Any) -> Any:
        raise NotImplementedError(
            f"The estimate of {' + '.join(kind.kind for kind in layout.kinds)} has no derivatives in its data: "
            f"`{search.__name__}` is a search. Differentiate `gmwm_jax.fitting.estimate`, which does."
        )

    return guarded


@_without_derivatives
def minimise(layout: Layout, lattice: Float[Array, "S C"], nodes: Float[Array, "G C"], data: Data) -> Solution:
    """Find the global minimum of the GMWM objective of one channel. Pure: jit and vmap it.

    Parameters
    ----------
    layout
        Components and what is free (static).
    lattice
        Placements of the components, see `gmwm_jax.fitting._start`; (1, 0) where no shape is free.
    nodes
        Coordinates at which single components are tried out afterwards.
    data
        Whitened wavelet variance and held values.

    Notes
    -----
    Round 0 evaluates the objective on the whole lattice and descends from the best placements that lie apart. Every
    further round takes the lowest end so far, moves one component at a time to every node, and descends again: a
    component that the first round wasted (at zero, or doubling another) finds its place. Descents of a round stop after
    `_STEPS`: most have arrived, and the others creep. The lowest end goes on until it is at its minimum.
    """
    if layout.num_shapes == 0:
        return _linear(layout, data)

    def exchanged(u: Array) -> Array:
        """All placements that differ from u in one component, as many as the lattice has."""
        rows = []
        for k in range(layout.num_shapes):
            at = layout.position(k)
            share = nodes[k :: layout.num_shapes, at]
            rows.append(jnp.broadcast_to(u, (share.shape[0], u.shape[0])).at[:, at].set(share))
        return jnp.concatenate(rows)

    def starts(best: Solution, turn: Array) -> Array:
        candidates = jnp.where(turn == 0, lattice, exchanged(best.coordinates))
        return _best_apart(layout, candidates, objective(layout, candidates, data))

    def search(best: Solution, turn: Array) -> tuple[Solution, None]:
        # which turn it is depends on no data, so that only one side is computed, under vmap as well
        last = turn == NUM_ROUNDS
        again = jnp.broadcast_to(best.coordinates, (NUM_DESCENTS, best.coordinates.shape[0]))
        at = lax.cond(last, lambda: again, lambda: starts(best, turn))
        ends = _ends(layout, at, data, jnp.where(last, _MAX_STEPS, _STEPS))
        lowest = jnp.minimum(best.objective, jnp.min(ends.objective))
        num_here = jnp.sum(ends.objective <= lowest * (1 + 1e-6))
        num_before = jnp.where(best.objective <= lowest * (1 + 1e-6), best.num_agreeing, 0)
        # the last round goes on from where those descents had stopped that agreed
        num_agreeing = jnp.where(last, best.num_agreeing, num_here + num_before)
        end = _lowest(ends)
        better = _score(end) < _score(best)
        best = jax.tree.map(lambda new, old: jnp.where(better, new, old), end, best)
        return best._replace(num_agreeing=num_agreeing), None

    start = Solution(
        lattice[0], jnp.zeros(len(layout.kinds)), jnp.asarray(jnp.inf), jnp.asarray(jnp.inf), jnp.asarray(0)
    )
    return lax.scan(search, start, jnp.arange(NUM_ROUNDS + 1))[0]


@_without_derivatives
def minimise_near(layout: Layout, starts: Float[Array, "S C"], data: Data) -> Solution:
    """Find the lowest minimum that descents from given placements lead to: for data like others already fitted.

    Parameters
    ----------
    layout, data
        As of `minimise`.
    starts
        Coordinates.
    """
    if layout.num_shapes == 0:
        return _linear(layout, data)
    ends = _ends(layout, starts, data, jnp.asarray(_MAX_STEPS))
    end = _lowest(ends)
    return end._replace(num_agreeing=jnp.sum(ends.objective <= end.objective * (1 + 1e-6)))


def _linear(layout: Layout, data: Data) -> Solution:
    """The minimum where no shape is free."""
    inner = project(layout, design(layout, None, data), data)
    lowest = jnp.sum(inner.residual * inner.residual)
    return Solution(jnp.zeros(0), inner.amplitudes[0], lowest, jnp.zeros(()), jnp.asarray(1))


def _ends(layout: Layout, starts: Float[Array, "S C"], data: Data, max_steps: Int[Array, ""]) -> Solution:
    """Where descents end."""
    u, ends = descend(layout, starts, data, max_steps)
    lowest = jnp.where(jnp.isfinite(ends.half), 2 * ends.half, jnp.inf)
    slope = 2 * jnp.max(jnp.abs(ends.gradient), axis=-1)
    return Solution(_inside(layout, u, data), ends.amplitudes, lowest, slope, jnp.ones(len(starts), dtype=int))


def _inside(layout: Layout, u: Float[Array, "S C"], data: Data) -> Float[Array, "S C"]:
    """Coordinates within their ends; those that have come to one are there to the last bit."""
    if not layout.bounded:
        return fold(u, data.bounds[None])
    low, high = data.bounds[None, :, 0], data.bounds[None, :, 1]
    return jnp.where(u <= low + TOUCHES, low, jnp.where(u >= high - TOUCHES, high, u))


def _lowest(ends: Solution) -> Solution:
    at = jnp.argmin(_score(ends))
    return jax.tree.map(lambda leaf: leaf[at], ends)


def _score(end: Solution) -> Float[Array, "*S"]:
    """The objective; of equal ones, that with fewer components wins: a GM at a limit could share with WN or RW."""
    return end.objective * (1 + 1e-11 * jnp.sum(jnp.where(end.amplitudes > 0, 1.0, 0.0), axis=-1))


def _best_apart(layout: Layout, candidates: Float[Array, "S C"], objectives: Float[Array, " S"]) -> Float[Array, "D C"]:
    """The best candidates of which no two lie within a factor e of each other in all correlation times."""
    # a swap of two components is no difference; one of several coordinates is
    at = [layout.position(k) for k in range(layout.num_shapes)]
    single = np.array([i for i in at if isinstance(i, int)], dtype=int)
    rest = [candidates[:, i] for i in at if isinstance(i, slice)]
    ordered = jnp.concatenate([jnp.sort(candidates[:, single], axis=1), *rest], axis=1)

    def take(i: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        left, taken = state
        at = jnp.argmin(left)
        near = jnp.max(jnp.abs(ordered - ordered[at][None, :]), axis=1) < 1.0
        return jnp.where(near, jnp.inf, left), taken.at[i].set(at)

    finite = jnp.where(jnp.isfinite(objectives), objectives, jnp.inf)
    taken = jnp.zeros(NUM_DESCENTS, dtype=jnp.int32)
    return candidates[lax.fori_loop(0, NUM_DESCENTS, take, (finite, taken.astype(jnp.argmin(finite).dtype)))[1]]
