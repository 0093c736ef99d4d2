"""Which stretch of a record a wavelet variance comes from: sums of squared coefficients, block by block."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import integer
from gmwm_jax.variance.haar import check_num_levels, one_record


class BlockSums(NamedTuple):
    """What `block_sums` returns: by each of B blocks and J levels."""

    squares: Float[Array, "B J"]
    """Sum of the squares of the coefficients that belong to the block; over all blocks M_j nu_j^2."""
    counts: Float[Array, "B J"]
    """Number of these coefficients; over all blocks M_j."""

    @property
    def left_out(self) -> Float[Array, "B J"]:
        """nu_j^2 from the coefficients of all blocks but one; NaN where that leaves none."""
        counts, squares = (jnp.sum(a, axis=0, keepdims=True) - a for a in (self.counts, self.squares))
        return jnp.where(counts > 0, squares / jnp.maximum(counts, 1.0), jnp.nan)


def block_sums(x: Any, block: int, num_levels: int | None = None) -> BlockSums:
    """Sum the squared Haar MODWT coefficients of one record by blocks of time, as a pure JAX function.

    A coefficient belongs to the block in which the newer half of its filter begins. Beyond spans of a block it sees
    other blocks as well.

    Parameters
    ----------
    x
        Record, shape (N,).
    block
        Samples in a block; the last one may have fewer. Static under jit.
    num_levels
        J, by default floor(log2 N) - 1. Static under jit.

    Returns
    -------
    BlockSums

    Raises
    ------
    ValueError
        The record is too short, or has another shape: vmap over channels; a block without samples.

    Examples
    --------
    >>> sums = gj.variance.block_sums(np.array([1.0, -1.0, 1.0, -1.0, 0.0, 0.0]), block=3, num_levels=1)
    >>> sums.squares.tolist(), sums.counts.tolist()
    ([[2.0], [1.25]], [[2.0], [3.0]])
    """
    x = one_record(x)
    return _block_sums(x, integer("block", block, 1), check_num_levels(x.shape[0], num_levels))


@partial(jax.jit, static_argnums=(1, 2))
def _block_sums(x: Float[Array, " N"], block: int, num_levels: int) -> BlockSums:
    N, S = x.shape[0], x - jnp.mean(x)
    squares, counts = [], []
    for j in range(1, num_levels + 1):
        n = 2 ** (j - 1)
        D = S[n:] - S[:-n]
        first, num = n, D.shape[0]  # the newer half of the first filter begins at sample n
        last = -(first + num) % block
        padded = jnp.pad(D * D / 4.0**j, (first, last))
        sums = jnp.sum(padded.reshape(-1, block), axis=1)
        inside = jnp.clip(jnp.arange(len(sums) + 1) * block, first, first + num)
        missing = -(-N // block) - len(sums)
        squares.append(jnp.pad(sums, (0, missing)))
        counts.append(jnp.pad(jnp.diff(inside).astype(x.dtype), (0, missing)))
        S = S[n:] + S[:-n]
    return BlockSums(jnp.stack(squares, axis=1), jnp.stack(counts, axis=1))
