"""Weights from the covariance of the wavelet variance: what they are, and what they gain."""

from dataclasses import dataclass, replace
from typing import ClassVar

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting.result import Status
from gmwm_jax.fitting.weights import AbstractWeights, Covariance, Default

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")
NUM_SAMPLES, NUM_REPLICATES = 20_000, 8


@pytest.fixture(scope="module")
def records():
    """Wavelet variances of 8 records, as channels of one."""
    keys = jax.random.split(jax.random.key(4), NUM_REPLICATES)
    x = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key), out_axes=1))(keys)
    return gj.wavelet_variance(np.asarray(x))


@pytest.mark.slow
def test_they_are_the_inverse_covariance_under_the_two_step_fit(records):
    wv = records[0]
    first, fit = (gj.fit(wv, "WN + GM", weights=omega) for omega in ("two-step", "covariance"))
    V = np.asarray(gj.variance.wv_covariance(first.model, NUM_SAMPLES, wv.num_scales))
    np.testing.assert_allclose(fit.omega @ V, np.eye(wv.num_scales), atol=1e-8)
    assert fit.weights == gj.fitting.weights.Covariance()
    assert fit.objective == pytest.approx(fit.residuals @ fit.omega @ fit.residuals, rel=1e-8)


def test_a_linear_model_is_generalised_least_squares(records):
    wv = records[1]
    fit = gj.fit(wv, "WN", weights="covariance")
    a = 1 / wv.scales
    expected = a @ fit.omega @ wv.variance / (a @ fit.omega @ a)
    assert float(fit.model.processes[0].sigma2) == pytest.approx(expected, rel=1e-9)


def test_iterated_weights_are_those_of_their_own_fit(records):
    fit = gj.fit(records[2], "WN + GM", weights="iterated")
    np.testing.assert_allclose(fit.omega, fit.weights.omega(fit.wv, fit.model, fit.wv_covariance), rtol=1e-4)
    assert fit.status is Status.converged


@pytest.mark.slow
def test_weights_from_the_covariance_gain_and_never_lose(records):
    """Of all parameters; that estimates scatter by so much less is measured in tests/validation."""
    fits = gj.fit(records, "WN + GM", weights="covariance")
    assert len(fits.values()) == NUM_REPLICATES
    fit = fits[0]
    stated = fit.weights_efficiency(gj.fit(records[0], "WN + GM", weights="two-step").omega)
    assert stated.min() < 0.95
    assert stated.max() <= 1 + 1e-9
    np.testing.assert_allclose(fit.weights_efficiency(), 1.0, atol=0.02)
    assert "Weights on the diagonal only would have an efficiency of" in fit.summary()


def test_what_has_no_covariance_is_refused(records):
    wv = records[0]
    short = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    for omega in ("covariance", "iterated"):
        with pytest.raises(ValueError, match=f'Weights "{omega}" need the covariance'):
            gj.fit(short, "WN", weights=omega)
    drift = gj.DR(1e-3)
    tau = wv.scales
    nu = np.asarray(drift.wavelet_variance(tau))
    only = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, num_samples=NUM_SAMPLES)
    with pytest.raises(ValueError, match="singular"):
        gj.fit(only, "DR", weights="covariance")


def as_records(*channels):
    """Channels as records of one channel."""
    return [replace(wv, channels=("x",)) for wv in channels]


@dataclass(frozen=True)
class OfRatios(AbstractWeights):
    """1/fitted^2 on the diagonal, as any user may write it."""

    name: ClassVar[str] = "ratios"
    first: AbstractWeights = gj.fitting.weights.NAMED["two-step"]

    def omega(self, wv, model=None, V=None):
        return np.diag(np.asarray(model.wavelet_variance(wv.scales)) ** -2.0)


@pytest.mark.slow
def test_new_weights_are_one_class(records):
    """All doors take them: one channel, several records, replicates."""
    wv = records[0]
    fit = gj.fit(wv, "WN + GM", weights=OfRatios())
    before = gj.fit(wv, "WN + GM", weights="two-step")
    np.testing.assert_allclose(np.diag(fit.omega), before.fitted**-2.0, rtol=1e-12)
    assert "(ratios weights)" in fit.summary()
    joint = gj.fit_records(as_records(records[0], records[1]), "WN + GM", weights=OfRatios())
    np.testing.assert_allclose(joint.records[0].omega, joint.records[1].omega, rtol=1e-12)
    boot = gj.bootstrap(fit, 2, key=jax.random.key(0))
    assert boot.converged.all()
    assert gj.fit(wv, "WN + GM", weights=Covariance(first=Default())).status is Status.converged


def test_weights_that_need_a_fit_have_no_objective_without_one(records):
    with pytest.raises(ValueError, match="two-step weights need a first fit"):
        gj.fitting.objective(records[0], "WN(sigma2=1)", weights="two-step")


@pytest.mark.slow
def test_iterated_weights_of_records_are_those_of_their_joint_fit(records):
    joint = gj.fit_records(as_records(records[0], records[1]), "WN + GM", weights="iterated")
    for r in joint.records:
        V = np.asarray(gj.variance.wv_covariance(joint.model, NUM_SAMPLES, r.wv.num_scales))
        np.testing.assert_allclose(r.omega @ V, np.eye(len(V)), atol=1e-4)
