"""Small least squares over x >= 0, or low <= x <= high: minimise |y - B x|^2 for a handful of columns, in batches.

Block principal pivoting (Portugal, Judice & Vicente 1994; Kim & Park 2011): exchange every index that violates its sign
between the active and the passive set, and fall back to Murty's single exchange, which is finite, when that does not
reduce their number. One small solve an iteration, no inner loop: cheap for batches, where Lawson & Hanson's loops in
loops run as long as the slowest element.

Normal equations are enough here: an error of size eps kappa in x lies along directions in which the objective is flat
like 1/kappa, so the objective is wrong by eps^2 kappa only.
"""

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import cho_factor, cho_solve
from jaxtyping import Bool, Float

from gmwm_jax.fitting._batch import while_each

_RIDGE = 1e-13
"""Relative to the unit columns: keeps the Cholesky factor finite where two columns are equal to rounding."""
_TOLERANCE = 1e-12
"""Of the gradient relative to |y|: below it an inactive column is not worth bringing in."""
_FULL_EXCHANGES = 3
_MAX_EXCHANGES = 60


def solve_passive(G: Float[Array, "S P P"], b: Float[Array, "S P"], passive: Bool[Array, "S P"]) -> Float[Array, "S P"]:
    """Solve G x = b on the passive set, with x = 0 elsewhere. G has a unit diagonal."""
    f = passive.astype(G.dtype)
    return cho_solve(cho_factor(passive_system(G, passive)), (b * f)[:, :, None])[:, :, 0] * f


def passive_system(G: Float[Array, "S P P"], passive: Bool[Array, "S P"]) -> Float[Array, "S P P"]:
    """G on the passive set, the identity elsewhere; positive definite."""
    f = passive.astype(G.dtype)
    return G * f[:, :, None] * f[:, None, :] + (1 - f + _RIDGE)[:, :, None] * np.eye(G.shape[-1])[None]


def solve_nonnegative(
    G: Float[Array, "S P P"], b: Float[Array, "S P"], size: Float[Array, " S"], guess: Bool[Array, "S P"]
) -> tuple[Float[Array, "S P"], Bool[Array, "S P"]]:
    """Minimise x'G x/2 - b'x over x >= 0.

    Parameters
    ----------
    G, b
        B'B and B'y for columns of unit length.
    size
        |y|, the scale against which a gradient counts as zero.
    guess
        The columns that are tried first.

    Returns
    -------
    x
        The solution.
    passive
        The columns that carry a positive coefficient.
    """

    def exchange(state: tuple) -> tuple:
        passive, _, wrong, *rest = state
        passive = passive ^ _exchanged(wrong, rest[1])
        x = solve_passive(G, b, passive)
        wrong = jnp.where(passive, x < 0, b - _times(G, x) > _TOLERANCE * size[:, None])
        return passive, x, wrong, *_counted(wrong, *rest)

    # the first exchange makes the columns of the guess passive
    passive, x, *_ = while_each(_unfinished, exchange, (_none(b), jnp.zeros_like(b), guess, *_start(b)))
    return jnp.maximum(x, 0.0), passive


def solve_between(
    G: Float[Array, "S P P"],
    b: Float[Array, "S P"],
    size: Float[Array, " S"],
    guess: Bool[Array, "S P"],
    low: Float[Array, "S P"],
    high: Float[Array, "S P"],
) -> tuple[Float[Array, "S P"], Bool[Array, "S P"]]:
    """Minimise x'G x/2 - b'x over low <= x <= high.

    Parameters
    ----------
    G, b, size, guess
        As of `solve_nonnegative`.
    low, high
        The lower ends are finite, the upper ones may be infinite.

    Returns
    -------
    x
        The solution.
    passive
        The columns whose coefficient is inside.
    """

    def at(passive: Array, upper: Array) -> Array:
        ends = jnp.where(upper, high, low)
        held = jnp.where(passive, 0.0, ends)
        return jnp.where(passive, solve_passive(G, b - _times(G, held), passive), ends)

    def exchange(state: tuple) -> tuple:
        passive, x, wrong, *rest, upper = state
        moved = _exchanged(wrong, rest[1])
        upper = jnp.where(moved, passive & (x > high), upper)
        passive = passive ^ moved
        x = at(passive, upper)
        pull = b - _times(G, x)
        outwards = jnp.where(upper, -pull, pull)
        wrong = jnp.where(passive, (x < low) | (x > high), outwards > _TOLERANCE * size[:, None])
        return passive, x, wrong, *_counted(wrong, *rest), upper

    passive, x, *_ = while_each(_unfinished, exchange, (_none(b), low, guess, *_start(b), _none(b)))
    return jnp.clip(x, low, high), passive


def _times(G: Float[Array, "S P P"], x: Float[Array, "S P"]) -> Float[Array, "S P"]:
    return (G @ x[:, :, None])[:, :, 0]


def _none(b: Float[Array, "S P"]) -> Bool[Array, "S P"]:
    return jnp.zeros(b.shape, dtype=bool)


def _start(b: Float[Array, "S P"]) -> tuple[Array, Array, Array]:
    """The fewest wrong ones so far, how many more full exchanges may not make them fewer, and the number of all."""
    batch, num = b.shape
    return jnp.full(batch, num + 1), jnp.full(batch, _FULL_EXCHANGES), jnp.zeros(batch, dtype=int)


def _counted(wrong: Bool[Array, "S P"], fewest: Array, patience: Array, count: Array) -> tuple[Array, Array, Array]:
    num_wrong = jnp.sum(wrong, axis=1)
    patience = jnp.where(num_wrong < fewest, _FULL_EXCHANGES, patience - 1)
    return jnp.minimum(fewest, num_wrong), patience, count + 1


def _unfinished(state: tuple) -> Bool[Array, " S"]:
    _, _, wrong, _, _, count, *_ = state
    return (jnp.any(wrong, axis=1) | (count == 0)) & (count < _MAX_EXCHANGES)


def _exchanged(wrong: Bool[Array, "S P"], patience: Array) -> Bool[Array, "S P"]:
    """All that are wrong, or the last of them when that has not made them fewer."""
    index = np.arange(wrong.shape[-1])[None]
    last = index == jnp.max(jnp.where(wrong, index, -1), axis=1, keepdims=True)
    return jnp.where(patience[:, None] > 0, wrong, last)
