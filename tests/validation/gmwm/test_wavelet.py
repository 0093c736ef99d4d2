"""The wavelet variance of simulated records: coverage, expectation."""

import numpy as np
import pytest

import gmwm_jax as gj


def in_batches(x, **options):
    """More records than samples, as many at a time as there are samples."""
    parts = [gj.wavelet_variance(x[:, i : i + len(x)], **options) for i in range(0, x.shape[1], len(x))]
    fields = ("variance", "ci_low", "ci_high")
    return (parts[0].scales, *(np.hstack([getattr(p, field) for p in parts]) for field in fields))


@pytest.mark.parametrize("method", ["modwt", "dwt"])
def test_interval_covers_white_noise(method, judge):
    """2,000 records of 512 samples of white noise: coverage of nu^2 = 1/tau at 95 %, band of 4 binomial sigmas.

    With few degrees of freedom the MODWT's eta is a convention, conservative for white noise: no upper bound there.
    """
    num, J = 2000, 6
    x = np.random.default_rng(6).normal(size=(512, num))
    scales, _, low, high = in_batches(x, num_levels=J, method=method)
    truth = 1 / scales[:, None]
    covered = np.mean((low <= truth) & (truth <= high), axis=1)
    sigma = np.sqrt(0.95 * 0.05 / num)
    high = 0.95 + 4 * sigma if method == "dwt" else 1
    judge(f"coverage of 95 % intervals, {method}", covered, 0.95 - 4 * sigma, high, num_draws=num)


def test_dwt_has_the_expectation_of_the_modwt(judge):
    """R's wv leaves a factor 2^j in the DWT. Mean over 4,000 records of white noise, 4 sigmas of the mean."""
    x = np.random.default_rng(7).normal(size=(256, 4000))
    _, wv, _, _ = in_batches(x, num_levels=4, method="dwt")
    error = wv.std(axis=1) / np.sqrt(wv.shape[1])
    off = (wv.mean(axis=1) - 1 / 2.0 ** np.arange(1, 5)) / error
    judge("mean of the DWT off theory, in standard errors", off, -4, 4, num_draws=wv.shape[1])
