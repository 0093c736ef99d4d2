"""Random numbers by counter: the hash against that of JAX, the numbers against the normal law."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.random import threefry_2x32
from scipy import stats

import nav_jax as nj
from nav_jax.imu._counter import counter_keys, gaussian, normals, threefry


def numbers(num_runs, streams, count):
    """Numbers (T, S, R) of the first counts."""
    keys = counter_keys(nj.filter.run_keys(jax.random.key(4), 0, num_runs))
    streams = np.array(streams, dtype=np.uint32)
    return np.asarray(jax.jit(jax.vmap(lambda t: normals(keys, streams, t)))(jnp.arange(count, dtype=jnp.uint32)))


def test_the_hash_is_that_of_jax():
    key = jnp.array([0x13198A2E, 0x03707344], dtype=jnp.uint32)
    x, y = (jax.random.bits(jax.random.key(seed), (50,), jnp.uint32) for seed in (1, 2))
    ours = jnp.concatenate(threefry((key[0], key[1]), (x, y)))
    np.testing.assert_array_equal(ours, threefry_2x32(key, jnp.concatenate([x, y])))


def test_the_numbers_are_normal_and_independent():
    """Kolmogorov-Smirnov on 200,000 numbers; correlations between runs, streams and neighbours to 4.5 sigma."""
    x = numbers(4, (7, 8, 4_000_000_000), 20_000)
    assert x.dtype == np.float32
    assert stats.kstest(x.ravel(), "norm").pvalue > 1e-4
    for power, expected in ((1, 0.0), (2, 1.0), (3, 0.0), (4, 3.0)):
        spread = np.sqrt((stats.norm.moment(2 * power) - expected**2) / x.size)
        assert abs(np.mean(x.astype(float) ** power) - expected) < 4.5 * spread
    columns = x.reshape(20_000, -1)
    both = np.hstack([columns[:-1], columns[1:]])
    off = np.corrcoef(both, rowvar=False) - np.eye(24)
    assert np.abs(off[:12]).max() < 4.5 / np.sqrt(20_000)


def test_a_number_depends_on_key_stream_and_counter_alone():
    x = numbers(3, (7, 8), 10)
    np.testing.assert_array_equal(numbers(2, (8,), 4)[:, 0], x[:4, 1, :2])


def test_extreme_words_are_finite_and_symmetric():
    words = jnp.array([0, 2**31 - 1, 2**31, 2**32 - 1, 5], dtype=jnp.uint32)
    x = np.asarray(gaussian(words))
    np.testing.assert_allclose(x[[1, 2]], [5.42, -5.42], atol=0.01)
    np.testing.assert_allclose(x[0], -x[3], rtol=1e-6)
    np.testing.assert_allclose(x[4], 5.5 * 2.0**-31 * np.sqrt(np.pi / 2), rtol=1e-5)
