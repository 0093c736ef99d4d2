"""The random numbers of time loops, as many as it takes to see five sigma."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import nav_jax as nj
from nav_jax.imu._counter import counter_keys, normals


@pytest.mark.slow
def test_tails_to_five_sigma():
    """Of 61 million numbers of each half 35 beyond 5 sigma; every count and every even moment to 4.5 sigma."""
    keys, streams = counter_keys(nj.filter.run_keys(jax.random.key(12), 0, 256)), np.arange(24, dtype=np.uint32)
    draw = jax.jit(jax.vmap(lambda t: normals(keys, streams, t)))
    beyond, powers, products, total = np.zeros((2, 5)), np.zeros((2, 3)), np.zeros(3), 0
    for block in range(10):
        z = draw(jnp.arange(1000 * block, 1000 * (block + 1), dtype=jnp.uint32)).ravel()
        halves = np.asarray(z.real, dtype=float), np.asarray(z.imag, dtype=float)
        for i, x in enumerate(halves):
            beyond[i] += [(np.abs(x) > k).sum() for k in range(1, 6)]
            powers[i] += [(x**p).sum() for p in (2, 4, 6)]
        x, y = halves
        products += [(x * y).sum(), (x**2 * y**2 - 1).sum(), (x**3 * y).sum()]
        total += z.size
    p = 2 * stats.norm.sf(np.arange(1, 6))
    assert (np.abs(beyond - total * p) < 4.5 * np.sqrt(total * p)).all()
    for k, power in enumerate((2, 4, 6)):
        mean, spread = stats.norm.moment(power), np.sqrt(stats.norm.moment(2 * power) - stats.norm.moment(power) ** 2)
        assert (np.abs(powers[:, k] / total - mean) < 4.5 * spread / np.sqrt(total)).all()
    # variances of xy, x^2 y^2 and x^3 y of independent normals
    assert (np.abs(products) < 4.5 * np.sqrt(np.array([1.0, 8.0, 15.0]) * total)).all()
