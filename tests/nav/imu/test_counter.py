"""Random numbers by counter: the hash against that of JAX, the numbers against the normal law."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.random import threefry_2x32
from scipy import stats

import nav_jax as nj
from nav_jax.imu._counter import counter_keys, gaussians, normals, threefry


def numbers(num_runs, streams, count):
    """Pairs (T, S, R) of the first counts."""
    keys = counter_keys(nj.filter.run_keys(jax.random.key(4), 0, num_runs))
    streams = np.array(streams, dtype=np.uint32)
    return np.asarray(jax.jit(jax.vmap(lambda t: normals(keys, streams, t)))(jnp.arange(count, dtype=jnp.uint32)))


def test_the_hash_is_that_of_jax():
    key = jnp.array([0x13198A2E, 0x03707344], dtype=jnp.uint32)
    x, y = (jax.random.bits(jax.random.key(seed), (50,), jnp.uint32) for seed in (1, 2))
    ours = jnp.concatenate(threefry((key[0], key[1]), (x, y)))
    np.testing.assert_array_equal(ours, threefry_2x32(key, jnp.concatenate([x, y])))


def test_the_numbers_are_normal_and_independent():
    """Kolmogorov-Smirnov on 240,000 numbers; correlations between runs, streams, halves and neighbours to 4.5 sigma."""
    z = numbers(4, (7, 8, 4_000_000_000), 20_000)
    assert z.dtype == np.complex64
    x = np.stack([np.real(z), np.imag(z)], axis=1)
    assert stats.kstest(x.ravel(), "norm").pvalue > 1e-4
    for power, expected in ((1, 0.0), (2, 1.0), (3, 0.0), (4, 3.0), (5, 0.0), (6, 15.0)):
        spread = np.sqrt((stats.norm.moment(2 * power) - expected**2) / x.size)
        assert abs(np.mean(x.astype(float) ** power) - expected) < 4.5 * spread
    # squares too: the halves of a pair have a distance in common, and are independent all the same
    for columns in (x.reshape(20_000, -1), x.reshape(20_000, -1) ** 2):
        both = np.hstack([columns[:-1], columns[1:]])
        off = np.corrcoef(both, rowvar=False) - np.eye(48)
        assert np.abs(off[:24]).max() < 4.5 / np.sqrt(20_000)


def test_a_number_depends_on_key_stream_and_counter_alone():
    x = numbers(3, (7, 8), 10)
    np.testing.assert_array_equal(numbers(2, (8,), 4)[:, 0], x[:4, 1, :2])


def test_a_pair_is_the_transform_of_its_words():
    """Against the same in double precision: squared distance to 1e-6 of itself or of 1, direction to 1e-6."""
    words = np.random.default_rng(5).integers(0, 2**32, (2, 100_000), dtype=np.uint32)
    words[0, :40] = 2 ** np.arange(40, dtype=float).clip(max=31)  # the tail
    z = np.asarray(gaussians((jnp.asarray(words[0]), jnp.asarray(words[1])))).astype(complex)
    square = -2 * np.log((words[0] + 0.5) / 2.0**32)
    np.testing.assert_allclose(np.abs(z) ** 2, square, rtol=1e-6, atol=1e-6)
    direction = np.exp(1j * np.pi * words[1].view(np.int32) / 2.0**31)
    np.testing.assert_allclose(z, np.abs(z) * direction, atol=6e-6)


def test_extreme_words_are_finite():
    far, near = jnp.zeros(4, dtype=jnp.uint32), jnp.full(4, 2**32 - 1, dtype=jnp.uint32)
    turns = jnp.array([0, 2**30, 2**31, 2**32 - 1], dtype=jnp.uint32)
    z = np.asarray(gaussians((far, turns)))
    np.testing.assert_allclose(z, 6.7637 * np.array([1, 1j, -1, 1]), atol=1e-4)
    np.testing.assert_array_equal(np.abs(np.asarray(gaussians((near, turns)))), 0.0)
