"""Covariance of the wavelet variance against the scatter of simulated records."""

import jax
import numpy as np
import pytest
from gmwm.cases import SUMS
from helpers import assert_covariance

from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.simulation import simulate
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.covariance import wv_covariance
from gmwm_jax.variance.haar import haar_wavelet_variance


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
