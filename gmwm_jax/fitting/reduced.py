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
    """The reduced objective at each of S points, and what belongs to it."""

    half: Float[Array, " S"]
    """Q/2."""
    gradient: Float[Array, "S C"]
    hessian: Float[Array, "S C C"]
    amplitudes: Float[Array, "S P"]
    passive: Bool[Array, "S F"]
    """Which of the free ones are not zero."""


def fold(u: Float[Array, "*S C"], bounds: Float[Array, "*#S C 2"]) -> Float[Array, "*S C"]:
    """Reflect coordinates at the ends of their intervals.

    Beyond an end the wavelet variance no longer changes: a search that steps out would find no slope to come back.
    """
    low, high = bounds[..., 0], bounds[..., 1]
    width = high - low
    v = jnp.mod(u - low, 2 * width)
    return low + jnp.where(v > width, 2 * width - v, v)


def objective(layout: Layout, u: Float[Array, "S C"], data: Data) -> Float[Array, " S"]:
    """Q at given shapes, minimal over the amplitudes."""
    residual = project(layout, design(layout, _shape_columns(layout, u, data), data), data).residual
    return jnp.sum(residual * residual, axis=-1)


def reduced(layout: Layout, u: Float[Array, "S C"], data: Data, guess: Bool[Array, "S F"]) -> Reduced:
    """The reduced objective with its derivatives at given shapes; the guess is which amplitudes are not zero."""
    columns, slopes, bends = _derivatives(layout, u, data)
    whole = design(layout, columns, data)
    inner = project(layout, whole, data, guess)
    owners, free, r = layout.owners, layout.free, inner.residual[..., None]
    amplitudes = inner.amplitudes[:, : layout.num_shapes]
    if data.wanted is not None:  # a component that is absent has no slope either
        present = data.wanted[: layout.num_shapes].astype(slopes.dtype)
        amplitudes, slopes = amplitudes * present[None], slopes * present[owners][None, :, None]
    amplitudes = _some(amplitudes, owners)
    moved = amplitudes[..., None] * slopes
    gradient, bent = -(moved @ r)[..., 0], (bends @ r[:, None])[..., 0]
    hessian = moved @ moved.mT - amplitudes[..., None] * jnp.einsum("sad,abd->sab", bent, _blocks(layout))
    if len(free):
        length = jnp.sqrt(jnp.sum(_some(whole, free) ** 2, axis=-2))
        own = (owners[:, None] == free[None, :]).astype(float)
        mixed = moved @ inner.B - own[None] * (slopes @ r) / length[:, None, :]
        mixed = mixed * inner.passive.astype(mixed.dtype)[:, None, :]
        factor = cho_factor(passive_system(inner.G, inner.passive))
        hessian = hessian - mixed @ cho_solve(factor, mixed.mT)
    half = jnp.sum(inner.residual**2, axis=-1) / 2
    return Reduced(half, gradient, (hessian + hessian.mT) / 2, inner.amplitudes, inner.passive)


def _blocks(layout: Layout) -> Float[np.ndarray, "C C D"]:
    """Where the second derivatives of a component, D for each of its coordinates, stand in a matrix of all: ones."""
    owners = layout.owners
    same = owners[:, None] == owners[None, :]
    place = np.arange(len(owners))[None, :] - np.searchsorted(owners, owners)[:, None]
    widest = max(kind.num_coordinates for kind, _ in layout.runs)
    return (same[..., None] & (place[..., None] == np.arange(widest))).astype(float)


def _some(array: Float[Array, "*S N"], at: np.ndarray) -> Float[Array, "*S M"]:
    """Entries of the last axis; mostly all of them, which is no operation."""
    return array if np.array_equal(at, np.arange(array.shape[-1])) else array[..., at]


def _shape_columns(layout: Layout, u: Float[Array, "S C"], data: Data) -> Float[Array, "S K J"]:
    """Unit wavelet variances of the components with a free shape, whitened."""
    coordinates = u if layout.bounded else fold(u, data.bounds[None])
    rows, at = [], 0
    for kind, count in layout.runs:
        num = kind.num_coordinates
        own = coordinates[:, at : at + num * count].reshape(-1, count, num)
        rows.append(_units(kind, data.tau)(own))
        at += num * count
    return jnp.concatenate(rows, axis=1) @ data.whitener.T


def _derivatives(
    layout: Layout, u: Float[Array, "S C"], data: Data
) -> tuple[Float[Array, "S K J"], Float[Array, "S C J"], Float[Array, "S C D J"]]:
    """Whitened columns, their slopes along each coordinate, and the second derivatives along it and its neighbours.

    D is the largest number of coordinates of a component; entries beyond its own are zero.
    """
    widest = max(kind.num_coordinates for kind, _ in layout.runs)
    columns, slopes, bends, at = [], [], [], 0
    for kind, count in layout.runs:
        num = kind.num_coordinates
        rows, own = slice(at, at + num * count), (len(u), num * count)
        v, d, dd = _with_slopes(
            kind, data.tau, u[:, rows].reshape(-1, count, num),
            None if layout.bounded else data.bounds[rows].reshape(count, num, 2),
        )  # fmt: skip
        columns.append(v)
        slopes.append(d.reshape(*own, -1))
        bends.append(jnp.pad(dd.reshape(*own, num, -1), ((0, 0), (0, 0), (0, widest - num), (0, 0))))
        at = rows.stop
    W = data.whitener.T
    return jnp.concatenate(columns, axis=1) @ W, jnp.concatenate(slopes, axis=1) @ W, jnp.concatenate(bends, axis=1) @ W


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


def _units(kind: type[AbstractProcess], tau: Array) -> Any:
    """The same of a batch of coordinates, as one batch: a map in a map is traced twice."""

    def columns(z: Float[Array, "*B D"]) -> Float[Array, "*B J"]:
        return jax.vmap(_unit(kind, tau))(z.reshape(-1, z.shape[-1])).reshape(*z.shape[:-1], -1)

    return columns


def _with_slopes(
    kind: type[AbstractProcess], tau: Array, z: Float[Array, "S N D"], bounds: Float[Array, "N D 2"] | None
) -> tuple[Float[Array, "S N J"], Float[Array, "S N D J"], Float[Array, "S N D D J"]]:
    """The columns of N components of a kind, the slopes along each coordinate, and the differences of these.

    Coordinates are reflected at bounds, if there are any.
    """
    num = z.shape[-1]
    # at each point and, for the differences, beside it, along all directions
    moves = _STEP * np.concatenate([np.zeros((1, num)), np.eye(num)])
    points = jnp.broadcast_to(z[:, :, None, None] + moves[None, None, :, None], (*z.shape[:2], num + 1, num, num))
    directions = jnp.broadcast_to(np.eye(num)[None, None, None], points.shape)
    ends = None if bounds is None else bounds[None, :, None, None]
    values, slopes = jax.jvp(
        lambda v: _units(kind, tau)(v if ends is None else fold(v, ends)), (points,), (directions,)
    )
    return values[:, :, 0, 0], slopes[:, :, 0], (slopes[:, :, 1:] - slopes[:, :, :1]) / _STEP


def design(layout: Layout, shape_columns: Float[Array, "S K J"] | None, data: Data) -> Float[Array, "S J P"]:
    """Whitened columns of all components, of one point where no shape is free."""
    rest = [
        kind.unit_wavelet_variance(shape, data.tau)
        for kind, shape in zip(layout.kinds[layout.num_shapes :], data.shapes, strict=True)
    ]
    rows = [] if shape_columns is None else [shape_columns]
    if rest:
        others = (jnp.stack(rest) @ data.whitener.T)[None]
        rows.append(others if shape_columns is None else jnp.repeat(others, len(shape_columns), axis=0))
    return jnp.concatenate(rows, axis=1).mT


class Projection(NamedTuple):
    """The inner problem at given shapes."""

    residual: Float[Array, "S J"]
    amplitudes: Float[Array, "S P"]
    B: Float[Array, "S J F"]
    """Columns of the free amplitudes, of unit length."""
    G: Float[Array, "S F F"]
    passive: Bool[Array, "S F"]


def project(
    layout: Layout, design: Float[Array, "S J P"], data: Data, guess: Bool[Array, "S F"] | None = None
) -> Projection:
    """Solve for the free amplitudes; the guess is which of them are not zero, by default all."""
    free, num = layout.free, len(design)
    held = np.setdiff1d(np.arange(len(layout.kinds)), free)
    y = jnp.broadcast_to(data.y[None], (num, *data.y.shape))
    if len(held):
        y = y - design[:, :, held] @ data.amplitudes[held]
    given = jnp.broadcast_to(jnp.asarray(data.amplitudes)[None], (num, len(layout.kinds)))
    everything = jnp.ones((num, len(free)), dtype=bool)
    if not len(free):
        return Projection(y, given, design[:, :, :0], jnp.zeros((num, 0, 0)), everything)
    columns = _some(design, free)
    length = jnp.sqrt(jnp.sum(columns * columns, axis=1))
    if data.wanted is not None:  # a column of zeros gets no amplitude
        columns = jnp.where(data.wanted[free][None, None], columns, 0.0)
    B = columns / length[:, None, :]
    G, b = B.mT @ B, (B.mT @ y[:, :, None])[:, :, 0]
    size, guess = jnp.sqrt(jnp.sum(y * y, axis=1)), everything if guess is None else guess
    if data.limits is None:
        x, passive = solve_nonnegative(G, b, size, guess)
        found = x / length
    else:
        low, high = (data.limits[None, free, end] for end in (0, 1))
        x, passive = solve_between(G, b, size, guess, low * length, high * length)
        # those at an end are there to the last bit
        at_end = jnp.where(x >= high * length, high, low)
        found = jnp.where(passive, jnp.clip(x / length, low, high), at_end)
    amplitudes = given.at[:, free].set(found) if len(held) else found
    return Projection(y - (B @ x[:, :, None])[:, :, 0], amplitudes, B, G, passive)
