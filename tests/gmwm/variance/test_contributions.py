"""Which block a squared wavelet coefficient belongs to, against coefficients one by one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj


def coefficients(x, level):
    """Index of the sample in which the newer half begins, and W."""
    tau, n = 2**level, 2 ** (level - 1)
    ends = range(tau - 1, len(x))
    W = [(x[t - n + 1 : t + 1].sum() - x[t - tau + 1 : t - n + 1].sum()) / tau for t in ends]
    return np.array([t - n + 1 for t in ends]), np.array(W)


@pytest.mark.slow
@pytest.mark.parametrize(("num", "block"), [(100, 7), (100, 25), (64, 64), (97, 1), (100, 90)])
def test_each_coefficient_belongs_to_one_block(num, block):
    x = np.random.default_rng(num).normal(size=num) + 3.0
    found = gj.variance.block_sums(x, block)
    J, B = found.squares.shape[1], -(-num // block)
    assert found.squares.shape == (B, J)
    for level in range(1, J + 1):
        at, W = coefficients(x, level)
        for b in range(B):
            own = W[at // block == b]
            np.testing.assert_allclose(found.squares[b, level - 1], np.sum(own**2), rtol=1e-10, atol=1e-13)
            assert found.counts[b, level - 1] == len(own)
            rest = W[at // block != b]
            expected = np.mean(rest**2) if len(rest) else np.nan
            np.testing.assert_allclose(found.left_out[b, level - 1], expected, rtol=1e-10)
    whole = found.squares.sum(axis=0) / found.counts.sum(axis=0)
    np.testing.assert_allclose(whole, gj.variance.haar_wavelet_variance(x), rtol=1e-12)


def test_it_is_pure():
    x = jnp.asarray(np.random.default_rng(1).normal(size=(3, 50)))
    together = jax.jit(jax.vmap(lambda r: gj.variance.block_sums(r, 10).left_out))(x)
    np.testing.assert_allclose(together[1], gj.variance.block_sums(x[1], 10).left_out, rtol=1e-12)
    slope = jax.grad(lambda r: gj.variance.block_sums(r, 10).squares[2, 1])(x[0])
    h = 1e-5
    for t in (20, 31):
        ends = [gj.variance.block_sums(x[0].at[t].add(s * h), 10).squares[2, 1] for s in (1, -1)]
        np.testing.assert_allclose(slope[t], (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-9)


def test_what_it_refuses():
    with pytest.raises(ValueError, match="block"):
        gj.variance.block_sums(np.arange(10.0), 0)
    with pytest.raises(ValueError, match="vmap"):
        gj.variance.block_sums(np.ones((10, 2)), 2)
