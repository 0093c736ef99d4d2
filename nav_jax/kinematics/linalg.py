"""Small matrices with runs as the last axis: every operation is elementwise over runs and compiles to vector code.

At 24 states and hundreds of runs the time goes into 3 x 3 blocks. Calls of LAPACK for each of them, or batched matrix
products, cost several times the arithmetic; sums of three products do not.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def matmul3(C: Float[Array, "3 3 *#R"], X: Float[Array, "3 K *#R"]) -> Float[Array, "3 K *#R"]:
    """C X for a 3 x 3 matrix C; either may be one for all runs."""
    return C[:, 0, None] * X[None, 0] + C[:, 1, None] * X[None, 1] + C[:, 2, None] * X[None, 2]


def transpose(X: Float[Array, "J K *R"]) -> Float[Array, "K J *R"]:
    """The transposed matrix of every run."""
    return jnp.swapaxes(X, 0, 1)


def symmetrise(P: Float[Array, "K K *R"]) -> Float[Array, "K K *R"]:
    """(P + P')/2, which rounding keeps from being P."""
    return (P + transpose(P)) / 2


def whiten(P: Float[Array, "K K Q"], e: Float[Array, "K R"]) -> Float[Array, "K R"]:
    """The vector y with y_i^2 summing to e' P^-1 e, each y_i depending on the first i components only.

    y = D^(-1/2) L^-1 e with P = L D L', so the sum over the first k is the form of the leading k x k block. Q is R,
    or 1 for a matrix that all runs share. NaN from the first pivot on that is not positive: P is singular there.
    """
    number = jnp.arange(P.shape[0])

    def eliminate(left, k):
        P, e = left
        pivot, row = P[k, k], P[k]
        good = pivot > 0
        safe = jnp.where(good, pivot, 1.0)
        y = jnp.where(good, e[k] / jnp.sqrt(safe), jnp.nan)
        # what is left of the others once this one is known; nobody asks again for those before
        column = P[:, k] / safe[None]
        return (P - column[:, None] * row[None], e - column * e[k][None]), y

    return jax.lax.scan(eliminate, (P, e), number)[1]


def log_det_and_trace(
    P: Float[Array, "K K *R"], S: Float[Array, "K K *R"]
) -> tuple[Float[Array, "*R"], Float[Array, "*R"]]:
    """Return log det P and tr(P^-1 S) of symmetric matrices, P positive definite; NaN where it is not.

    By elimination, P = L D L': each pivot leaves the Schur complement of P, and of L^-1 S L^-T what belongs to it.
    """
    log_det, trace = jnp.zeros(P.shape[2:]), jnp.zeros(P.shape[2:])
    while P.shape[0]:
        pivot, s = P[0, 0], S[0, 0]
        log_det, trace = log_det + jnp.log(pivot), trace + s / pivot
        column, row = P[1:, 0] / pivot[None], P[0, 1:]
        both = column[:, None] * S[0, None, 1:]
        P = P[1:, 1:] - column[:, None] * row[None]
        S = S[1:, 1:] - both - transpose(both) + s[None, None] * column[:, None] * column[None]
    return log_det, trace


def factor(P: Float[Array, "K K"]) -> Float[Array, "K K"]:
    """Lower triangular L with L L' = P for a positive semi-definite P; a zero pivot gives a zero column.

    Unlike a library's Cholesky it takes singular matrices (a state known exactly, two that are one) and has finite
    derivatives there.
    """
    number = jnp.arange(P.shape[0])

    def eliminate(P, k):
        pivot = P[k, k]
        positive = pivot > 0
        safe = jnp.where(positive, pivot, 1.0)
        column = jnp.where(positive, P[:, k] / jnp.sqrt(safe), 0.0)
        rest = number != k
        return jnp.where(rest[:, None] & rest[None], P - column[:, None] * column[None], 0.0), column

    # a loop, as 60 states written out take seconds to compile
    return jax.lax.scan(eliminate, P, number)[1].T if len(number) else P


def root(x: Float[Array, "*R"]) -> Float[Array, "*R"]:
    """Square root, 0 of what is not positive; its derivative there is 0 and not infinite."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)
