"""The objective as a function of the shapes alone, the amplitudes solved for: its value, gradient and Hessian.

With residual r, columns b_i of the components, their derivatives b_i' along the search coordinates u_i, and amplitudes
c_i, the half objective Q/2 = |y - sum c_i b_i|^2/2 of both has

    d/du_i   = -c_i r'b_i'                           (at the solved amplitudes d/dc = 0: this is the whole gradient)
    d2/duidu = c_i c_j b_i''b_j' - [i = j] c_i r'b_i''
    d2/duidc = c_i b_i''b_j - [i = j] r'b_i'         d2/dcdc = b_i'b_j

and the Hessian of the reduced objective is the Schur complement over the columns that carry a positive amplitude
(Golub & Pereyra 1973; Ruano, Jones & Fleming 1991). The second derivatives b'' are differences of the first: they stand
beside the residual, where six digits do, and compile in half the time.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_factor, cho_solve
from jaxtyping import Bool, Float

from gmwm_jax.fitting._nnls import passive_system, solve_between, solve_nonnegative
from gmwm_jax.processes.base import AbstractProcess

_STEP = 1e-6
"""Of a search coordinate, the logarithm of a correlation time or alike."""


class Layout(NamedTuple):
    """What is static in a fit, one entry a component; components with a free shape come first."""

    kinds: tuple[type[AbstractProcess], ...]
    free_shape: tuple[bool, ...]
    free_amplitude: tuple[bool, ...]
    bounded: bool = False
    """Are coordinates and amplitudes held between bounds of the user? At these the objective has a slope, and nothing
    is gained by reflecting there."""

    @property
    def num_shapes(self) -> int:
        """K, the number of components with a shape to search for."""
        return sum(self.free_shape)

    @property
    def num_coordinates(self) -> int:
        """C, the number of search coordinates; most components have one."""
        return sum(kind.num_coordinates for kind in self.kinds[: self.num_shapes])

    @property
    def runs(self) -> tuple[tuple[type[AbstractProcess], int], ...]:
        """Runs of equal kinds among the components with a free shape, and their lengths."""
        runs: list[tuple[type[AbstractProcess], int]] = []
        for kind in self.kinds[: self.num_shapes]:
            if runs and runs[-1][0] is kind:
                runs[-1] = kind, runs[-1][1] + 1
            else:
                runs.append((kind, 1))
        return tuple(runs)

    @property
    def owners(self) -> np.ndarray:
        """The component of each search coordinate."""
        return np.repeat(np.arange(self.num_shapes), [k.num_coordinates for k in self.kinds[: self.num_shapes]])

    @property
    def free(self) -> np.ndarray:
        """The components whose amplitude is free."""
        return np.array([i for i, f in enumerate(self.free_amplitude) if f], dtype=int)

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
    limits: Float[Array, "P 2"] | None = None
    """Ends of the amplitudes of a bounded problem."""


class Reduced(NamedTuple):
    """The reduced objective at one point, and what belongs to it."""

    half: Float[Array, ""]
    """Q/2."""
    gradient: Float[Array, " C"]
    hessian: Float[Array, "C C"]
    amplitudes: Float[Array, " P"]
    passive: Bool[Array, " F"]
    """Which of the free ones are not zero."""


def fold(u: Float[Array, " C"], bounds: Float[Array, "C 2"]) -> Float[Array, " C"]:
    """Reflect coordinates at the ends of their intervals.

    Beyond an end the wavelet variance no longer changes: a search that steps out would find no slope to come back.
    """
    low, high = bounds[:, 0], bounds[:, 1]
    width = high - low
    v = jnp.mod(u - low, 2 * width)
    return low + jnp.where(v > width, 2 * width - v, v)


def objective(layout: Layout, u: Float[Array, " C"], data: Data) -> Float[Array, ""]:
    """Q at given shapes, minimal over the amplitudes."""
    inner = project(layout, design(layout, _shape_columns(layout, u, data), data), data)
    return jnp.sum(inner.residual * inner.residual)


def reduced(layout: Layout, u: Float[Array, " C"], data: Data, guess: Bool[Array, " F"]) -> Reduced:
    """The reduced objective with its derivatives at given shapes; the guess is which amplitudes are not zero."""
    columns, slopes, bends = _derivatives(layout, u, data)
    whole = design(layout, columns, data)
    inner = project(layout, whole, data, guess)
    owners, free, r = layout.owners, layout.free, inner.residual
    amplitudes = inner.amplitudes[: layout.num_shapes]
    if data.wanted is not None:  # a component that is absent has no slope either
        present = data.wanted[: layout.num_shapes].astype(slopes.dtype)
        amplitudes, slopes = amplitudes * present, slopes * present[owners][:, None]
    moved = amplitudes[owners][:, None] * slopes
    hessian = moved @ moved.T - _blocks(layout, amplitudes, bends @ r)
    if len(free):
        length = jnp.sqrt(jnp.sum(whole[:, free] * whole[:, free], axis=0))
        own = (owners[:, None] == free[None, :]).astype(slopes.dtype)
        mixed = moved @ inner.B - own * (slopes @ r)[:, None] / length[None, :]
        mixed = mixed * inner.passive.astype(mixed.dtype)[None, :]
        factor = cho_factor(passive_system(inner.G, inner.passive))
        hessian = hessian - mixed @ cho_solve(factor, mixed.T)
    return Reduced(jnp.sum(r * r) / 2, -moved @ r, (hessian + hessian.T) / 2, inner.amplitudes, inner.passive)


def _blocks(layout: Layout, amplitudes: Float[Array, " K"], bent: Float[Array, "C D"]) -> Float[Array, "C C"]:
    """c_i r'b_i'' of all components as a block diagonal matrix; row a of `bent` has r'b'' along coordinate a."""
    num, owners = layout.num_coordinates, layout.owners
    place = np.zeros((num, num), dtype=int)
    same = owners[:, None] == owners[None, :]
    first = np.searchsorted(owners, owners)
    place[same] = (np.arange(num)[None, :] - first[:, None])[same]
    blocks = jnp.take_along_axis(bent, jnp.asarray(place), axis=1)
    return jnp.where(same, amplitudes[owners][:, None] * blocks, 0.0)


def _shape_columns(layout: Layout, u: Float[Array, " C"], data: Data) -> Float[Array, "K J"]:
    """Unit wavelet variances of the components with a free shape, whitened."""
    coordinates = u if layout.bounded else fold(u, data.bounds)
    rows, at = [], 0
    for kind, count in layout.runs:  # one vmap for each run of equal kinds
        num = kind.num_coordinates
        own = coordinates[at : at + num * count].reshape(count, num)
        rows.append(jax.vmap(_unit(kind, data.tau))(own))
        at += num * count
    return jnp.concatenate(rows) @ data.whitener.T


def _derivatives(
    layout: Layout, u: Float[Array, " C"], data: Data
) -> tuple[Float[Array, "K J"], Float[Array, "C J"], Float[Array, "C D J"]]:
    """Whitened columns, their slopes along each coordinate, and the second derivatives along it and its neighbours.

    D is the largest number of coordinates of a component; entries beyond its own are zero.
    """
    widest = max(kind.num_coordinates for kind, _ in layout.runs)
    columns, slopes, bends, at = [], [], [], 0
    for kind, count in layout.runs:
        num = kind.num_coordinates
        rows = slice(at, at + num * count)
        v, d, dd = jax.vmap(_with_slopes(kind, data.tau, reflects=not layout.bounded))(
            u[rows].reshape(count, num), data.bounds[rows].reshape(count, num, 2)
        )
        columns.append(v)
        slopes.append(d.reshape(num * count, -1))
        bends.append(jnp.pad(dd.reshape(num * count, num, -1), ((0, 0), (0, widest - num), (0, 0))))
        at = rows.stop
    W = data.whitener.T
    return jnp.concatenate(columns) @ W, jnp.concatenate(slopes) @ W, jnp.concatenate(bends) @ W


def columns_and_slopes(
    layout: Layout, u: Float[Array, " C"], tau: Float[Array, " J"]
) -> tuple[Float[Array, "K J"], Float[Array, "C J"]]:
    """Unit wavelet variances of the components with a free shape, and their derivatives along each coordinate."""
    columns, slopes, at = [], [], 0
    for kind, count in layout.runs:
        num = kind.num_coordinates
        own, at = u[at : at + num * count].reshape(count, num), at + num * count

        v, d = jax.vmap(_with_exact_slopes(kind, tau))(own)
        columns.append(v)
        slopes.append(d.reshape(num * count, -1))
    return jnp.concatenate(columns), jnp.concatenate(slopes)


def _with_exact_slopes(kind: type[AbstractProcess], tau: Array) -> Any:
    def both(z: Float[Array, " D"]) -> tuple[Array, Array]:
        along = jax.vmap(lambda direction: jax.jvp(_unit(kind, tau), (z,), (direction,)))
        values, slopes = along(jnp.eye(kind.num_coordinates))
        return values[0], slopes

    return both


def _unit(kind: type[AbstractProcess], tau: Array) -> Any:
    def column(z: Float[Array, " D"]) -> Float[Array, " J"]:
        own = z[0] if kind.num_coordinates == 1 else z
        return kind.unit_wavelet_variance(kind.shape_from_coordinate(own), tau)

    return column


def _with_slopes(kind: type[AbstractProcess], tau: Array, *, reflects: bool) -> Any:
    """A function of the coordinates of a component: its column, the slopes, and their differences."""
    directions = np.eye(kind.num_coordinates)

    def both(z: Float[Array, " D"], bounds: Float[Array, "D 2"]) -> tuple[Array, Array, Array]:
        def along(at: Array, direction: Array) -> tuple[Array, Array]:
            return jax.jvp(lambda v: _unit(kind, tau)(fold(v, bounds) if reflects else v), (at,), (direction,))

        points = z[None] + _STEP * np.concatenate([np.zeros((1, len(directions))), directions])
        values, slopes = jax.vmap(lambda at: jax.vmap(lambda d: along(at, d))(jnp.asarray(directions)))(points)
        return values[0, 0], slopes[0], (slopes[1:] - slopes[:1]) / _STEP

    return both


def design(layout: Layout, shape_columns: Float[Array, "K J"] | None, data: Data) -> Float[Array, "J P"]:
    """Whitened columns of all components."""
    rest = [
        kind.unit_wavelet_variance(shape, data.tau)
        for kind, shape in zip(layout.kinds[layout.num_shapes :], data.shapes, strict=True)
    ]
    rows = [] if shape_columns is None else [shape_columns]
    if rest:
        rows.append(jnp.stack(rest) @ data.whitener.T)
    return jnp.concatenate(rows).T


class Projection(NamedTuple):
    """The inner problem at given shapes."""

    residual: Float[Array, " J"]
    amplitudes: Float[Array, " P"]
    B: Float[Array, "J F"]
    """Columns of the free amplitudes, of unit length."""
    G: Float[Array, "F F"]
    passive: Bool[Array, " F"]


def project(
    layout: Layout, design: Float[Array, "J P"], data: Data, guess: Bool[Array, " F"] | None = None
) -> Projection:
    """Solve for the free amplitudes; the guess is which of them are not zero, by default all."""
    free = layout.free
    held = np.setdiff1d(np.arange(len(layout.kinds)), free)
    y = data.y
    if len(held):
        y = y - design[:, held] @ data.amplitudes[held]
    if not len(free):
        empty = jnp.zeros((0, 0))
        return Projection(y, data.amplitudes, design[:, :0], empty, jnp.zeros(0, dtype=bool))
    columns = design[:, free]
    length = jnp.sqrt(jnp.sum(columns * columns, axis=0))
    if data.wanted is not None:  # a column of zeros gets no amplitude
        columns = jnp.where(data.wanted[free], columns, 0.0)
    B = columns / length[None, :]
    G, b = B.T @ B, B.T @ y
    everything = jnp.ones(len(free), dtype=bool)
    size, guess = jnp.sqrt(jnp.sum(y * y)), everything if guess is None else guess
    if data.limits is None:
        x, passive = solve_nonnegative(G, b, size, guess)
        amplitudes = data.amplitudes.at[free].set(x / length)
    else:
        low, high = data.limits[free].T
        x, passive = solve_between(G, b, size, guess, low * length, high * length)
        # those at an end are there to the last bit
        at_end = jnp.where(x >= high * length, high, low)
        amplitudes = data.amplitudes.at[free].set(jnp.where(passive, jnp.clip(x / length, low, high), at_end))
    return Projection(y - B @ x, amplitudes, B, G, passive)
