"""Wavelet variance with missing samples: coverage of its intervals, and replicates."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from helpers import assert_mean

import gmwm_jax as gj
from gmwm_jax.fitting.refit import refit
from gmwm_jax.variance.gaps import find_pairs, gap_wavelet_variance
from gmwm_jax.variance.haar import scales
from gmwm_jax.variance.replicates import record_draws


def scattered(num, share, seed=0):
    return np.random.default_rng(seed).random(num) >= share


def blocks(num, share, length=40, seed=0):
    """Samples missing in blocks."""
    gone = np.random.default_rng(seed).choice(num // length, round(share * num / length), replace=False)
    return ~np.isin(np.arange(num) // length, gone)


def with_gaps(x, present):
    return np.where(present, x, np.nan)


WALK, WANDERING = "WN(sigma2=1.0) + RW(gamma2=0.005)", "WN(sigma2=1.0) + GM(beta=0.05, variance=1.0)"


@pytest.mark.parametrize("share", [0.01, 0.1])
@pytest.mark.parametrize("pattern", [scattered, blocks])
@pytest.mark.parametrize("text", [WALK, WANDERING])
def test_coverage(text, pattern, share, judge):
    """600 records: intervals of the wavelet variance cover 95 % or more, those of the parameters 95 %.

    Four standard errors of a coverage are 3.6 %; those of a standard deviation 12 %.
    """
    num, J, count = 2048, 9, 600
    model, present = gj.parse_model(text), pattern(num, share)
    keys = jax.random.split(jax.random.key(7), count)
    records = np.asarray(jax.vmap(lambda k: gj.simulate(model, num, key=k))(keys))
    nu = gap_wavelet_variance(records, find_pairs(present, J))
    truth = np.asarray(model.wavelet_variance(scales(J)))
    wv = gj.wavelet_variance(with_gaps(records[0], present), gaps="pairs", num_levels=J)
    np.testing.assert_allclose(wv.variance, nu[0], rtol=1e-12)
    # what the interval of one record is wider by is nearly that of all
    low, high = wv.ci_low / wv.variance, wv.ci_high / wv.variance
    covered = np.mean((nu * low < truth) & (truth < nu * high), axis=0)
    judge("coverage of 95 % intervals of the variance", covered, 0.95 - 0.036, 1, num_draws=count)

    fit = gj.fit(wv, " + ".join(p.kind for p in model.processes), weights="two-step")
    refits = refit(fit, nu)
    assert np.all(refits.converged)
    at_truth = replace(fit, model=model)
    error = np.sqrt(np.diag(at_truth.covariance))
    z = (np.log(refits.values) - np.asarray(model.unconstrained())) / error
    covered = np.mean(np.abs(z) < 1.96, axis=0)
    judge("coverage of 95 % intervals of parameters", covered, 0.95 - 0.036, 0.95 + 0.036, num_draws=count)


def test_replicates_by_records_leave_out_what_is_missing(judge):
    """Mean and scatter of 600 wavelet variances are those of theory within 4.5 standard errors."""
    present = scattered(500, 0.4)
    x = np.random.default_rng(3).standard_normal(500)
    fit = gj.fit(gj.wavelet_variance(with_gaps(x, present), gaps="pairs", num_levels=4), "WN")
    nu = record_draws(fit.model, fit.wv)(jax.random.split(jax.random.key(1), 600))
    judge("bias of replicates, in standard errors", assert_mean(nu, fit.fitted), 0, 4.5, num_draws=600)
    spread = np.std(nu, axis=0) / np.sqrt(np.diag(fit.wv_covariance))
    band = 4.5 / np.sqrt(1200) + 0.03  # and the error of the theory
    judge("scatter of replicates over theory", spread, 1 - band, 1 + band, num_draws=600)


def test_a_bootstrap_with_gaps(judge):
    """The scatter of 128 replicates is that of theory within 4.5 standard errors."""
    x, present = np.random.default_rng(3).standard_normal(500), scattered(500, 0.4)
    fit = gj.fit(gj.wavelet_variance(with_gaps(x, present), gaps="pairs", num_levels=4), "WN")
    boot = gj.bootstrap(fit, 128, key=jax.random.key(1), route="records")
    assert boot.num_failed == 0
    spread = np.std(np.log(boot.good[:, 0])) / np.sqrt(fit.covariance[0, 0])
    band = 4.5 / np.sqrt(256)
    judge("scatter of estimates over theory", spread, 1 - band, 1 + band, num_draws=128)
