"""Small least squares over x >= 0, or low <= x <= high: minimise |y - B x|^2 for a handful of columns, vmapped.

Block principal pivoting (Portugal, Judice & Vicente 1994; Kim & Park 2011): exchange every index that violates its sign
between the active and the passive set, and fall back to Murty's single exchange, which is finite, when that does not
reduce their number. One small solve an iteration, no inner loop: cheap under vmap, where Lawson & Hanson's nested loops
run as long as the slowest element.

Normal equations are enough here: an error of size eps kappa in x lies along directions in which the objective is flat
like 1/kappa, so the objective is wrong by eps^2 kappa only.
"""

import jax.numpy as jnp
from jax import Array, lax
from jax.scipy.linalg import cho_factor, cho_solve
from jaxtyping import Bool, Float

_RIDGE = 1e-13
"""Relative to the unit columns: keeps the Cholesky factor finite where two columns are equal to rounding."""
_TOLERANCE = 1e-12
"""Of the gradient relative to |y|: below it an inactive column is not worth bringing in."""
_FULL_EXCHANGES = 3
_MAX_EXCHANGES = 60


def solve_passive(G: Float[Array, "P P"], b: Float[Array, " P"], passive: Bool[Array, " P"]) -> Float[Array, " P"]:
    """Solve G x = b on the passive set, with x = 0 elsewhere. G has a unit diagonal."""
    f = passive.astype(G.dtype)
    return cho_solve(cho_factor(passive_system(G, passive)), b * f) * f


def passive_system(G: Float[Array, "P P"], passive: Bool[Array, " P"]) -> Float[Array, "P P"]:
    """G on the passive set, the identity elsewhere; positive definite."""
    f = passive.astype(G.dtype)
    return G * f[:, None] * f[None, :] + jnp.diag(1 - f + _RIDGE)


def solve_nonnegative(
    G: Float[Array, "P P"], b: Float[Array, " P"], size: Float[Array, ""], guess: Bool[Array, " P"]
) -> tuple[Float[Array, " P"], Bool[Array, " P"]]:
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
    num = b.shape[0]
    index = jnp.arange(num)

    def unfinished(state: tuple) -> Array:
        _, _, wrong, _, _, count = state
        return (jnp.any(wrong) | (count == 0)) & (count < _MAX_EXCHANGES)

    def exchange(state: tuple) -> tuple:
        passive, _, wrong, fewest, patience, count = state
        last = index == jnp.max(jnp.where(wrong, index, -1))
        passive = passive ^ jnp.where(patience > 0, wrong, last)
        x = solve_passive(G, b, passive)
        wrong = jnp.where(passive, x < 0, b - G @ x > _TOLERANCE * size)
        num_wrong = jnp.sum(wrong)
        patience = jnp.where(num_wrong < fewest, _FULL_EXCHANGES, patience - 1)
        return passive, x, wrong, jnp.minimum(fewest, num_wrong), patience, count + 1

    # the first exchange makes the columns of the guess passive
    none = jnp.zeros(num, dtype=bool)
    start = (none, jnp.zeros(num), guess, jnp.asarray(num + 1), jnp.asarray(_FULL_EXCHANGES), jnp.asarray(0))
    passive, x, *_ = lax.while_loop(unfinished, exchange, start)
    return jnp.maximum(x, 0.0), passive


def solve_between(
    G: Float[Array, "P P"],
    b: Float[Array, " P"],
    size: Float[Array, ""],
    guess: Bool[Array, " P"],
    low: Float[Array, " P"],
    high: Float[Array, " P"],
) -> tuple[Float[Array, " P"], Bool[Array, " P"]]:
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
    index = jnp.arange(b.shape[0])

    def at(passive: Array, upper: Array) -> Array:
        ends = jnp.where(upper, high, low)
        held = jnp.where(passive, 0.0, ends)
        return jnp.where(passive, solve_passive(G, b - G @ held, passive), ends)

    def unfinished(state: tuple) -> Array:
        _, _, _, wrong, _, _, count = state
        return (jnp.any(wrong) | (count == 0)) & (count < _MAX_EXCHANGES)

    def exchange(state: tuple) -> tuple:
        passive, upper, x, wrong, fewest, patience, count = state
        last = index == jnp.max(jnp.where(wrong, index, -1))
        moved = jnp.where(patience > 0, wrong, last)
        upper = jnp.where(moved, passive & (x > high), upper)
        passive = passive ^ moved
        x = at(passive, upper)
        pull = b - G @ x
        outwards = jnp.where(upper, -pull, pull)
        wrong = jnp.where(passive, (x < low) | (x > high), outwards > _TOLERANCE * size)
        num_wrong = jnp.sum(wrong)
        patience = jnp.where(num_wrong < fewest, _FULL_EXCHANGES, patience - 1)
        return passive, upper, x, wrong, jnp.minimum(fewest, num_wrong), patience, count + 1

    none = jnp.zeros(b.shape, dtype=bool)
    start = (none, none, low, guess, jnp.asarray(len(index) + 1), jnp.asarray(_FULL_EXCHANGES), jnp.asarray(0))
    passive, _, x, *_ = lax.while_loop(unfinished, exchange, start)
    return jnp.clip(x, low, high), passive
