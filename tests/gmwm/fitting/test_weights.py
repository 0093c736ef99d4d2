"""Weights from the covariance of the wavelet variance: what they are, and what they gain."""

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting.result import Status
from gmwm_jax.fitting.weights import covariance_weights

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")
NUM_SAMPLES, NUM_REPLICATES = 20_000, 200


@pytest.fixture(scope="module")
def records():
    """Wavelet variances of 200 records, as channels of one."""
    keys = jax.random.split(jax.random.key(4), NUM_REPLICATES)
    x = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key), out_axes=1))(keys)
    return gj.wavelet_variance(np.asarray(x))


def test_they_are_the_inverse_covariance_under_the_two_step_fit(records):
    wv = records[0]
    first, fit = (gj.fit(wv, "WN + GM", omega=omega) for omega in ("two-step", "covariance"))
    V = np.asarray(gj.variance.wv_covariance(first.model, NUM_SAMPLES, wv.num_scales))
    np.testing.assert_allclose(fit.omega @ V, np.eye(wv.num_scales), atol=1e-8)
    assert fit.weights == "covariance"
    assert fit.objective == pytest.approx(fit.residuals @ fit.omega @ fit.residuals, rel=1e-8)


def test_a_linear_model_is_generalised_least_squares(records):
    wv = records[1]
    fit = gj.fit(wv, "WN", omega="covariance")
    a = 1 / wv.scales
    expected = a @ fit.omega @ wv.variance / (a @ fit.omega @ a)
    assert float(fit.model.processes[0].sigma2) == pytest.approx(expected, rel=1e-9)


def test_iterated_weights_are_those_of_their_own_fit(records):
    fit = gj.fit(records[2], "WN + GM", omega="iterated")
    np.testing.assert_allclose(fit.omega, covariance_weights(fit.model, fit.wv_covariance), rtol=1e-4)
    assert fit.status is Status.converged


def test_what_has_no_covariance_is_refused(records):
    wv = records[0]
    short = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    for omega in ("covariance", "iterated"):
        with pytest.raises(ValueError, match=f'Weights "{omega}" need the covariance'):
            gj.fit(short, "WN", omega=omega)
    drift = gj.DR(1e-3)
    tau = wv.scales
    nu = np.asarray(drift.wavelet_variance(tau))
    only = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, num_samples=NUM_SAMPLES)
    with pytest.raises(ValueError, match="singular"):
        gj.fit(only, "DR", omega="covariance")
