"""The GMWM estimator: separable least squares on the wavelet variance, solved for its global minimum.

Minimise over theta   Q(theta) = (nu_hat - nu(theta))' Omega (nu_hat - nu(theta))   (Guerrier et al. 2013).

A model is linear in its amplitudes c >= 0 once the shapes u (log correlation times) are given: nu = A(u) c. With
Omega = L L', y = L' nu_hat and B(u) = L' A(u), the amplitudes follow exactly from a small non-negative least-squares
problem, and what is left is a smooth function of the few shapes alone (variable projection, Golub & Pereyra 1973):

    r(u) = y - B(u) c(u),    c(u) = argmin_{c >= 0} |y - B(u) c|.

A component that the data do not want gets exactly zero; nothing crawls along a boundary. Levenberg-Marquardt runs on r
from many starts at once (`minimise`), and the lowest end is taken. Its Jacobian is Kaufman's (1975): dr = -P dB c,
with P the projection off the passive columns; the gradient dr' r = -r' dB c is exact, and what is left out of dr is
proportional to r.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array, lax
from jaxtyping import Bool, Float, Int

from gmwm_jax.fitting._nnls import solve_nonnegative, solve_passive
from gmwm_jax.processes.base import AbstractProcess, sum_arrays

NUM_ROUNDS = 2
NUM_DESCENTS = 12
"""Descents in a round."""
SIZE = 1e3
"""Largest entry of L' nu_hat as the search sees it, whatever the weights: its tolerances then mean the same always."""
_MAX_STEPS = 100
_TOLERANCE = 1e-9


class Layout(NamedTuple):
    """What is static in a fit, one entry a component; components with a free shape come first."""

    kinds: tuple[type[AbstractProcess], ...]
    free_shape: tuple[bool, ...]
    free_amplitude: tuple[bool, ...]

    @property
    def num_shapes(self) -> int:
        """K, the number of components with a shape to search for."""
        return sum(self.free_shape)

    @property
    def num_coordinates(self) -> int:
        """C, the number of search coordinates; most components have one."""
        return sum(kind.num_coordinates for kind in self.kinds[: self.num_shapes])

    def position(self, component: int) -> int | slice:
        """Where the search coordinates of a component stand: an index if it has one, else a slice."""
        first = sum(kind.num_coordinates for kind in self.kinds[:component])
        num = self.kinds[component].num_coordinates
        return first if num == 1 else slice(first, first + num)


class Data(NamedTuple):
    """What a fit depends on and may change without a new compilation."""

    y: Float[Array, " J"]
    """L' nu_hat."""
    whitener: Float[Array, "J J"]
    """L' with Omega = L L'."""
    tau: Float[Array, " J"]
    bounds: Float[Array, "C 2"]
    """Ends of the search coordinates."""
    shapes: tuple[tuple[Float[Array, ""], ...], ...]
    """Given shapes of the components whose shape is not free, in order."""
    amplitudes: Float[Array, " P"]
    """Amplitudes of all components; read where they are not free."""
    wanted: Bool[Array, " P"] | None = None
    """Components that may have a variance, among those whose amplitude is free; None for all."""


class Solution(NamedTuple):
    """The minimum, and what is needed to judge it."""

    coordinates: Float[Array, " C"]
    amplitudes: Float[Array, " P"]
    objective: Float[Array, ""]
    slope: Float[Array, ""]
    """Largest |dQ/du| over the coordinates: what moving a correlation time by a factor e would still gain."""
    num_agreeing: Int[Array, ""]
    """How many descents ended within 1e-6 relative of the minimum."""


def smallest_slope(objective: Any) -> Any:
    """The slope below which a search is at its minimum, for data of `SIZE`.

    The first-order gain of moving a correlation time by a tenth of its logarithm is then below 1e-5 of the objective.
    """
    return 1e-4 * objective + 1e-10 * SIZE**2


def fold(u: Float[Array, " C"], bounds: Float[Array, "C 2"]) -> Float[Array, " C"]:
    """Reflect coordinates at the ends of their intervals.

    Beyond an end the wavelet variance no longer changes: a search that steps out would find no slope to come back.
    """
    low, high = bounds[:, 0], bounds[:, 1]
    width = high - low
    v = jnp.mod(u - low, 2 * width)
    return low + jnp.where(v > width, 2 * width - v, v)


def _shape_columns(layout: Layout, u: Float[Array, " C"], data: Data) -> Float[Array, "K J"]:
    """Unit wavelet variances of the components with a free shape, whitened."""
    coordinates = fold(u, data.bounds)
    rows, start, at = [], 0, 0
    kinds = layout.kinds[: layout.num_shapes]
    while start < len(kinds):  # one vmap for each run of equal kinds
        kind, stop = kinds[start], start
        while stop < len(kinds) and kinds[stop] is kind:
            stop += 1

        def column(z: Array, kind: type[AbstractProcess] = kind) -> Array:
            return kind.unit_wavelet_variance(kind.shape_from_coordinate(z), data.tau)

        num = kind.num_coordinates
        own = coordinates[at : at + num * (stop - start)]
        rows.append(jax.vmap(column)(own if num == 1 else own.reshape(-1, num)))
        start, at = stop, at + num * (stop - start)
    return jnp.concatenate(rows) @ data.whitener.T


def _design(layout: Layout, shape_columns: Float[Array, "K J"] | None, data: Data) -> Float[Array, "J P"]:
    rest = [
        kind.unit_wavelet_variance(shape, data.tau)
        for kind, shape in zip(layout.kinds[layout.num_shapes :], data.shapes, strict=True)
    ]
    rows = [] if shape_columns is None else [shape_columns]
    if rest:
        rows.append(jnp.stack(rest) @ data.whitener.T)
    return jnp.concatenate(rows).T


class _Projection(NamedTuple):
    """The inner problem at given shapes."""

    residual: Float[Array, " J"]
    amplitudes: Float[Array, " P"]
    B: Float[Array, "J F"]
    """Columns of the free amplitudes, of unit length."""
    G: Float[Array, "F F"]
    passive: Bool[Array, " F"]


def _project(layout: Layout, design: Float[Array, "J P"], data: Data) -> _Projection:
    free = [i for i, f in enumerate(layout.free_amplitude) if f]
    held = [i for i, f in enumerate(layout.free_amplitude) if not f]
    y = data.y
    if held:
        y = y - design[:, held] @ data.amplitudes[jnp.asarray(held)]
    if not free:
        empty = jnp.zeros((0, 0))
        return _Projection(y, data.amplitudes, design[:, :0], empty, jnp.zeros(0, dtype=bool))
    columns = design[:, free]
    length = jnp.sqrt(jnp.sum(columns * columns, axis=0))
    if data.wanted is not None:  # a column of zeros gets no amplitude
        columns = jnp.where(data.wanted[jnp.asarray(free)], columns, 0.0)
    B = columns / length[None, :]
    G, b = B.T @ B, B.T @ y
    x, passive = solve_nonnegative(G, b, jnp.sqrt(jnp.sum(y * y)))
    amplitudes = data.amplitudes.at[jnp.asarray(free)].set(x / length)
    return _Projection(y - B @ x, amplitudes, B, G, passive)


def _residual_function(layout: Layout):
    """(r(u), c(u)), with Kaufman's Jacobian as the derivative of r."""

    @jax.custom_jvp
    def residual(u: Array, data: Data) -> tuple[Array, Array]:
        inner = _project(layout, _design(layout, _shape_columns(layout, u, data), data), data)
        return inner.residual, inner.amplitudes

    @residual.defjvp
    def residual_jvp(primals, tangents):
        (u, data), (du, _) = primals, tangents
        # each column depends on its own coordinates only: one derivative has the first of all, a second the second ..
        turns = [
            (at, jax.jvp(lambda v: _shape_columns(layout, v, data), (u,), (jnp.asarray(direction),)))
            for at, direction in _turns(layout)
        ]
        inner = _project(layout, _design(layout, turns[0][1][0], data), data)
        amplitudes = inner.amplitudes[: layout.num_shapes]
        v = sum_arrays(slopes.T @ (amplitudes * du[at]) for at, (_, slopes) in turns)
        projected = inner.B @ solve_passive(inner.G, inner.B.T @ v, inner.passive)
        out = inner.residual, inner.amplitudes
        return out, (projected - v, jnp.zeros_like(inner.amplitudes))  # nobody differentiates the amplitudes

    return residual


def _turns(layout: Layout) -> list[tuple[Int[np.ndarray, " K"], Float[np.ndarray, " C"]]]:
    """For the first, second, .. coordinate: where each component has it, and the direction that moves all of them.

    A component without one stands with its last, which that direction leaves where it is.
    """
    nums = np.array([kind.num_coordinates for kind in layout.kinds[: layout.num_shapes]])
    first = np.cumsum(nums) - nums
    turns = []
    for i in range(max(nums)):
        direction = np.zeros(sum(nums))
        direction[(first + i)[nums > i]] = 1.0
        turns.append((first + np.minimum(i, nums - 1), direction))
    return turns


def _without_derivatives(search: Callable[..., Solution]) -> Callable[..., Solution]:
    """A search that raises where it is differentiated.

    Kaufman's Jacobian leads to the minimum and is not how the minimum moves with the data; loops that end when they
    have converged have no derivative at all. Derivatives that came out of them would be zero, or wrong.
    """
    guarded = jax.custom_jvp(search, nondiff_argnums=(0,))

    @guarded.defjvp
    def refuse(layout: Layout, primals: Any, tangents: Any) -> Any:
        raise NotImplementedError(
            f"The estimate of {' + '.join(kind.kind for kind in layout.kinds)} has no derivatives in its data: "
            f"`{search.__name__}` is a search. Differentiate `gmwm_jax.fitting.objective`, or take the standard errors "
            "of a fit, which are those of its first-order expansion."
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
    component that the first round wasted (at zero, or doubling another) finds its place.
    """
    if layout.num_shapes == 0:
        return _linear(layout, data)

    residual = jax.jit(_residual_function(layout))

    def value(u: Array) -> Array:
        r, _ = residual(u, data)
        return jnp.sum(r * r)

    def exchanged(u: Array) -> Array:
        """All placements that differ from u in one component, as many as the lattice has."""
        rows = []
        for k in range(layout.num_shapes):
            at = layout.position(k)
            share = nodes[k :: layout.num_shapes, at]
            rows.append(jnp.broadcast_to(u, (share.shape[0], u.shape[0])).at[:, at].set(share))
        return jnp.concatenate(rows)

    def search(best: Solution, first: Array) -> tuple[Solution, None]:
        candidates = jnp.where(first, lattice, exchanged(best.coordinates))
        starts = _best_apart(layout, candidates, jax.vmap(value)(candidates))
        ends = jax.vmap(lambda start: _descend(residual, start, data))(starts)
        lowest = jnp.minimum(best.objective, jnp.min(ends.objective))
        num_here = jnp.sum(ends.objective <= lowest * (1 + 1e-6))
        num_agreeing = num_here + jnp.where(best.objective <= lowest * (1 + 1e-6), best.num_agreeing, 0)
        end = _lowest(ends)
        better = _score(end) < _score(best)
        best = jax.tree.map(lambda new, old: jnp.where(better, new, old), end, best)
        return best._replace(num_agreeing=num_agreeing), None

    start = Solution(
        lattice[0], jnp.zeros(len(layout.kinds)), jnp.asarray(jnp.inf), jnp.asarray(jnp.inf), jnp.asarray(0)
    )
    return lax.scan(search, start, jnp.arange(NUM_ROUNDS) == 0)[0]


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
    residual = jax.jit(_residual_function(layout))
    ends = jax.vmap(lambda start: _descend(residual, start, data))(starts)
    end = _lowest(ends)
    return end._replace(num_agreeing=jnp.sum(ends.objective <= end.objective * (1 + 1e-6)))


def _linear(layout: Layout, data: Data) -> Solution:
    """The minimum where no shape is free."""
    inner = _project(layout, _design(layout, None, data), data)
    objective = jnp.sum(inner.residual * inner.residual)
    return Solution(jnp.zeros(0), inner.amplitudes, objective, jnp.zeros(()), jnp.asarray(1))


def _descend(residual: Any, start: Float[Array, " C"], data: Data) -> Solution:
    """Levenberg-Marquardt from one start."""
    method = optx.LevenbergMarquardt(rtol=_TOLERANCE, atol=_TOLERANCE)
    end = optx.least_squares(residual, method, start, args=data, has_aux=True, max_steps=_MAX_STEPS, throw=False)
    # from the state, not the solution: the aux of optimistix 0.1's solution is one accepted step behind its value
    r, jac, amplitudes = end.state.f_info.residual, end.state.f_info.jac.as_matrix(), end.state.aux
    objective = jnp.sum(r * r)
    objective = jnp.where(jnp.isfinite(objective), objective, jnp.inf)
    slope = jnp.max(jnp.abs(2 * r @ jac))
    return Solution(fold(end.value, data.bounds), amplitudes, objective, slope, jnp.asarray(1))


def _lowest(ends: Solution) -> Solution:
    return jax.tree.map(lambda leaf: leaf[jnp.argmin(jax.vmap(_score)(ends))], ends)


def _score(end: Solution) -> Float[Array, ""]:
    """The objective; of equal ones, that with fewer components wins: a GM at a limit could share with WN or RW."""
    return end.objective * (1 + 1e-11 * jnp.sum(jnp.where(end.amplitudes > 0, 1.0, 0.0)))


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
