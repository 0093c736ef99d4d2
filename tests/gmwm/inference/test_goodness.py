"""The chi-square test of fit: its algebra, its size, and whether it finds where a wrong model fails."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS
from scipy import stats

import gmwm_jax as gj

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")
NUM_SAMPLES, NUM_RECORDS = 20_000, 8
LEVELS = 9
"""Up to spans of 512 samples, where 39 degrees of freedom make a variance nearly normal."""


@pytest.fixture(scope="module")
def records():
    keys = jax.random.split(jax.random.key(14), NUM_RECORDS)
    x = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key), out_axes=1))(keys)
    return gj.wavelet_variance(np.asarray(x), num_levels=LEVELS)


@pytest.mark.slow
def test_with_the_inverse_covariance_it_is_the_objective(records):
    """Sargan's and Hansen's J, with degrees of freedom to match."""
    fit = gj.fit(records[0], "WN + GM", weights="iterated")
    test = gj.goodness_of_fit(fit)
    assert test.dof == LEVELS - 3
    assert test.statistic == pytest.approx(fit.objective, rel=1e-3)
    assert test.p_value == pytest.approx(stats.chi2.sf(test.statistic, LEVELS - 3), rel=1e-9)


@pytest.mark.slow
def test_a_wrong_model_is_found_where_it_fails(records):
    test = gj.goodness_of_fit(gj.fit(records[3], "WN"))
    assert test.p_value < 1e-6
    assert np.abs(test.pulls[3:]).max() > 5
    assert "!!!" in repr(test)
    right = gj.goodness_of_fit(gj.fit(records[3], "WN + GM"))
    assert right.p_value > 1e-3
    assert np.abs(right.pulls).max() < SIGMAS


def test_a_model_that_is_held_has_all_degrees_of_freedom(records):
    """Then the test is Wald's with the covariance of the data."""
    held = gj.WN(gj.Fixed(1.0)) + gj.GM(beta=gj.Fixed(0.03), variance=gj.Fixed(0.2))
    fit = gj.fit(records[5], held)
    test = gj.goodness_of_fit(fit)
    expected = fit.residuals @ np.linalg.solve(fit.wv_covariance, fit.residuals)
    assert test.dof == LEVELS
    assert test.statistic == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(test.pulls, fit.residuals / np.sqrt(np.diag(fit.wv_covariance)), rtol=1e-9)


def test_without_theory_there_is_no_test(records):
    wv = records[0]
    bare = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    with pytest.raises(ValueError, match="needs the number of samples"):
        gj.goodness_of_fit(gj.fit(bare, "WN"))
