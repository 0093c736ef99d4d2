"""Wavelet variances drawn from theory: their skewness by brute force, their moments by number."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import gmwm_jax as gj
from gmwm_jax.variance._skewness import wv_skewness
from gmwm_jax.variance.replicates import theory_draws

MIXED = "WN(sigma2=1.0) + GM(beta=0.01, variance=0.2) + RW(gamma2=1e-6)"


def by_matrices(model, num_samples, J):
    """From the whole covariance of the coefficients of each scale."""
    found = []
    for j in range(1, J + 1):
        half, M = 2 ** (j - 1), num_samples - 2**j + 1
        lag, mean = jnp.arange(float(num_samples)), 0.0
        column = np.zeros(num_samples)
        for p in model.processes:
            halves = jnp.full(num_samples, float(half))
            unit = jax.jit(p.unit_haar_covariance)(p.shape, lag, 1 - 2 * (lag % 2), halves, halves)
            column += float(p.amplitude) * np.asarray(unit)
            mean += np.sqrt(float(p.amplitude)) * float(p.unit_haar_mean(jnp.asarray(float(half))))
        C, mu = scipy.linalg.toeplitz(column[:M]), np.full(M, mean)
        third = 8 * np.sum((C @ C) * C) + 24 * mu @ C @ C @ mu
        found.append(third / (2 * np.sum(C * C) + 4 * mu @ C @ mu) ** 1.5)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(("text", "num_samples"), [(MIXED, 1500), ("WN(sigma2=1.0) + DR(omega=0.01)", 90)])
def test_skewness(text, num_samples):
    """To one per cent where few coefficients are independent, else that of a chi-square variable, which is less."""
    model = gj.parse_model(text)
    V = np.asarray(gj.variance.wv_covariance(model, num_samples))
    ours, exact = wv_skewness(model, num_samples, V), by_matrices(model, num_samples, len(V))
    few = num_samples / 2.0 ** np.arange(1, len(V) + 1) < 16
    assert few.sum() >= 3
    np.testing.assert_allclose(ours[few], exact[few], rtol=1e-2)
    assert np.all(ours[~few] <= exact[~few] * 1.001)
    np.testing.assert_allclose(ours[~few], exact[~few], rtol=0.35)


def test_draws_are_positive_and_lean_to_the_right():
    """Their three moments, and their tail against that of records, are in tests/validation."""
    model, num_samples = gj.parse_model("RW(gamma2=1.0)"), 2000
    wv = gj.wavelet_variance(np.asarray(gj.simulate(model, num_samples, key=jax.random.key(0))))
    V = np.asarray(gj.variance.wv_covariance(model, num_samples))
    draws = theory_draws(model, wv, V)(jax.random.split(jax.random.key(1), 64))
    assert draws.shape == (64, wv.num_scales)
    assert np.all(draws > 0)
    expected = np.asarray(model.wavelet_variance(wv.scales))
    assert np.all(np.abs(draws.mean(axis=0) - expected) < 4.5 * np.sqrt(np.diag(V) / 64))
    assert draws[:, -1].mean() > np.median(draws[:, -1])
