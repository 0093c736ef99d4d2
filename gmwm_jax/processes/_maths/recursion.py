"""The first-order recursion behind every Markov simulation, in matrix products instead of a scan over samples."""

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Float

_BLOCK = 64


def first_order_recursion(
    phi: Float[Array, ""], e: Float[Array, " N"], start: Float[Array, ""] | float = 0.0
) -> Float[Array, " N"]:
    """x_t = phi x_{t-1} + e_t, t = 1..N, with x_0 = start.

    The record is cut into blocks of B samples: inside a block x = T e with the triangular Toeplitz matrix
    T_ab = phi^(a-b), and the block ends obey the same recursion with phi^B, solved by calling this function again. A
    scan of N steps takes 30 times as long on a CPU, cannot use both cores, and compiles no faster.

    Parameters
    ----------
    phi
        Coefficient, |phi| <= 1.
    e
        Innovations.
    start
        x_0.
    """
    num = e.shape[0]
    if num <= _BLOCK:

        def step(x, e_t):
            x = phi * x + e_t
            return x, x

        return lax.scan(step, jnp.asarray(start, dtype=e.dtype), e)[1]
    num_blocks = -(-num // _BLOCK)
    blocks = jnp.pad(e, (0, num_blocks * _BLOCK - num)).reshape(num_blocks, _BLOCK)
    # phi^0 apart: its derivative at phi = 0 would be NaN
    powers = jnp.concatenate([jnp.ones(1, dtype=e.dtype), phi ** jnp.arange(1, _BLOCK + 1, dtype=e.dtype)])
    a, b = jnp.arange(_BLOCK)[:, None], jnp.arange(_BLOCK)[None, :]
    toeplitz = jnp.where(a >= b, powers[jnp.maximum(a - b, 0)], 0.0)
    inside = blocks @ toeplitz.T
    ends = first_order_recursion(powers[_BLOCK], inside[:, -1], start)
    before = jnp.concatenate([jnp.asarray(start, dtype=e.dtype)[None], ends[:-1]])
    return (inside + before[:, None] * powers[None, 1:]).reshape(-1)[:num]
