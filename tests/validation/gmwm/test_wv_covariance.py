"""Covariance of the wavelet variance against the scatter of simulated records."""

import jax
import numpy as np
import pytest
from helpers import assert_covariance

from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.simulation import simulate
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.covariance import wv_covariance
from gmwm_jax.variance.haar import haar_wavelet_variance

SUMS = [
    WN(1.0) + GM(0.01, 0.5),
    WN(4.9e-5) + RW(4.8e-13) + GM(1.7e-3, 1.2e-7) + GM(8.8e-5, 1.2e-7),
    QN(1.0) + WN(0.1) + RW(1e-4),
    WN(1.0) + AR1(-0.7, 2.0) + AR1(0.99, 0.01),
    WN(1.0) + DR(0.01),
    RW(0.01) + DR(0.1) + GM(0.3, 1.0),
    WN(1.0) + QN(2.0) + RW(1e-3) + DR(1e-2) + GM(0.5, 1.0) + GM(1e-3, 2.0),
]


@pytest.mark.parametrize("model", [SUMS[0], WN(1.0) + RW(1e-3) + DR(5e-3)], ids=repr)
def test_monte_carlo(model, key, judge):
    """Sample covariances of 4000 records of N = 512, at all pairs of scales."""
    draw = jax.jit(jax.vmap(lambda k: haar_wavelet_variance(simulate(model, 512, key=k))))
    nu = np.asarray(draw(jax.random.split(key, 4000)))
    mean = np.asarray(model.wavelet_variance(2.0 ** np.arange(1, 9)))
    j, k = np.tril_indices(8)
    expected = np.asarray(wv_covariance(model, 512))[j, k]
    off = assert_covariance(nu[:, j], nu[:, k], expected, mean_a=mean[j], mean_b=mean[k])
    judge("covariances off theory, in standard errors", off, 0, 4.5, num_draws=4000)
