"""The chi-square test of fit: its size, and the variance of its pulls."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS

import gmwm_jax as gj

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")


NUM_SAMPLES, NUM_RECORDS = 20_000, 400


LEVELS = 9
"""Up to spans of 512 samples, where 39 degrees of freedom make a variance nearly normal."""


@pytest.fixture(scope="module")
def records():
    keys = jax.random.split(jax.random.key(14), NUM_RECORDS)
    x = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key), out_axes=1))(keys)
    return gj.wavelet_variance(np.asarray(x), num_levels=LEVELS)


def test_size_and_pulls(records, judge):
    """p below 5 % in 3 to 7.5 % of 400 records, widened by 4.5 binomial sigmas; every pull has the variance 1."""
    fits = gj.fit(records, "WN + GM", weights="two-step")
    tests = [gj.goodness_of_fit(f) for f in fits.values()]
    share = np.mean([t.p_value < 0.05 for t in tests])
    sigma = np.sqrt(0.05 * 0.95 / NUM_RECORDS)
    low, high = max(0.0, 0.03 - SIGMAS * sigma), 0.075 + SIGMAS * sigma
    judge("share of p below 5 %", share, low, high, num_draws=NUM_RECORDS)
    off = (np.mean([t.statistic for t in tests]) - 6) / np.sqrt(12 / NUM_RECORDS)
    judge("mean chi-square off its degrees of freedom, in sigmas", off, -SIGMAS, SIGMAS, num_draws=NUM_RECORDS)
    variance = np.var([t.pulls for t in tests], axis=0)
    band = SIGMAS * np.sqrt(2 / NUM_RECORDS)
    judge("variance of pulls", variance, 1 - band, 1 + band, num_draws=NUM_RECORDS)
