"""Wavelet variances drawn from theory against those of records."""

import jax
import numpy as np
from helpers import assert_mean

import gmwm_jax as gj
from gmwm_jax.variance._skewness import wv_skewness
from gmwm_jax.variance.replicates import theory_draws, variance_draws


def test_draws_have_three_moments(judge):
    model, num_samples = gj.parse_model("RW(gamma2=1.0)"), 2000
    wv = gj.wavelet_variance(np.asarray(gj.simulate(model, num_samples, key=jax.random.key(0))))
    V = np.asarray(gj.variance.wv_covariance(model, num_samples))
    nu = np.asarray(model.wavelet_variance(wv.scales))
    z = (theory_draws(model, wv, V)(jax.random.split(jax.random.key(1), 40_000)) - nu) / np.sqrt(np.diag(V))
    moments = {"mean": (z, 0.0), "variance": (z**2, 1.0), "skewness": (z**3, wv_skewness(model, num_samples, V))}
    for name, (draws, expected) in moments.items():
        judge(f"{name} of draws off theory, in standard errors", assert_mean(draws, expected), 0, 4.5, num_draws=40_000)
    plain = (variance_draws(nu, V)(jax.random.split(jax.random.key(1), 40_000)) - nu) / np.sqrt(np.diag(V))
    assert_mean(plain**3, 2 * np.sqrt(np.diag(V)) / nu)


def test_the_tail_is_that_of_records(judge):
    """Share of wavelet variances beyond the 99 % quantile of the draws, at the longest span, in 20,000 records."""
    model, num_samples, num = gj.parse_model("WN(sigma2=1.0)"), 500, 20_000
    x = np.asarray(jax.random.normal(jax.random.key(2), (num, num_samples)))
    wv = gj.wavelet_variance(x[0])
    J, V = wv.num_scales, np.asarray(gj.variance.wv_covariance(model, num_samples))
    tau = 2**J
    sums = np.concatenate([np.zeros((num, 1)), np.cumsum(x, axis=1)], axis=1)
    half = sums[:, tau // 2 :] - sums[:, : -tau // 2]
    nu = np.mean(((half[:, tau // 2 :] - half[:, : -tau // 2]) / tau) ** 2, axis=1)
    draws = theory_draws(model, wv, V)(jax.random.split(jax.random.key(3), 100_000))[:, -1]
    beyond = np.mean(nu > np.quantile(draws, 0.99))
    band = 4.5 * np.sqrt(0.01 * 0.99 * (1 / num + 1 / 100_000))
    judge("share of records beyond the 99 % quantile", beyond, 0.01 - band, 0.01 + band, num_draws=num)
