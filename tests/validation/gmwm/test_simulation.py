"""Simulated records against theory."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import rows, sample_covariance, sample_mean
from helpers import assert_covariance, assert_mean

from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.simulation import simulate
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.haar import haar_wavelet_variance

NUM_RECORDS = 2000


def many(model, num_samples, key, num_records=NUM_RECORDS):
    """Records in rows."""
    draw = jax.jit(jax.vmap(lambda k: simulate(model, num_samples, key=k)))
    return np.asarray(draw(jax.random.split(key, num_records)))


wavelet_variances = jax.jit(jax.vmap(haar_wavelet_variance))


@pytest.mark.parametrize("case", rows())
def test_means_and_covariances_of_samples(case, key, judge):
    """E(x_t) and Cov(x_s, x_t) over 4000 records for s, t at the start, next to it, and 65 and 199 samples on."""
    at = np.array([0, 1, 64, 199])
    sets = case.parameters[:: max(1, len(case.parameters) // 7)]
    draw = jax.jit(jax.vmap(lambda values, k: case.cls(*values).simulate(200, k)[at], in_axes=(None, 0)))
    for values in sets:
        x = np.asarray(draw(tuple(map(jnp.asarray, values)), jax.random.split(key, 4000)))
        mean, covariance = sample_mean(case, values, 200)[at], sample_covariance(case, values, 200)[np.ix_(at, at)]
        if not np.any(covariance):
            np.testing.assert_allclose(x, np.broadcast_to(mean, x.shape), rtol=1e-14)
            continue
        off = assert_mean(x, mean)
        judge("means of samples, in standard errors", off, 0, 4.5, num_draws=4000)
        s, t = np.tril_indices(len(at))
        off = assert_covariance(x[:, s], x[:, t], covariance[s, t], mean_a=mean[s], mean_b=mean[t])
        judge("covariances of samples, in standard errors", off, 0, 4.5, num_draws=4000)


@pytest.mark.parametrize("case", rows())
def test_wavelet_variances_of_records(case, key, judge):
    """The mean over 500 records of 1024 samples is the theoretical wavelet variance, at 9 scales."""
    draw = jax.jit(jax.vmap(lambda values, k: case.cls(*values).simulate(1024, k), in_axes=(None, 0)))
    for values in case.parameters[:: max(1, len(case.parameters) // 7)]:
        seen = wavelet_variances(draw(tuple(map(jnp.asarray, values)), jax.random.split(key, 500)))
        expected = case.cls(*values).wavelet_variance(2.0 ** np.arange(1, 10))
        off = assert_mean(seen, expected, atol=1e-9 * np.asarray(expected))
        judge("wavelet variances, in standard errors", off, 0, 4.5, num_draws=500)


def test_wavelet_variance_of_a_sum(key):
    model = WN(1.0) + QN(0.5) + RW(1e-5) + DR(1e-4) + GM(0.1, 0.5) + GM(0.003, 0.3)
    x = many(model, 1024, key, num_records=500)
    assert_mean(wavelet_variances(jnp.asarray(x)), model.wavelet_variance(2.0 ** np.arange(1, 10)))
