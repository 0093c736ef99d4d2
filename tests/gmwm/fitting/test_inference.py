"""Standard errors and intervals: formulas, tables, and coverage by simulation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting import standard_errors as inference
from gmwm_jax.fitting.standard_errors import delta_method, parameter_covariance
from gmwm_jax.fitting.tables import LogQuantities

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.01, variance=0.1)")
"""Correlation time of 100 samples; the two components cross at a span of about 30."""


@pytest.mark.slow
def test_covariance_is_the_sandwich():
    """Against the formula in NumPy, for weights that are far from the inverse covariance."""
    wv = gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(0))), rate=1.0)
    fit = gj.fit(wv, "WN + GM")
    eta = np.asarray(fit.model.unconstrained())
    step = 1e-5
    A = np.column_stack(
        [
            (
                fit.model.with_unconstrained(jnp.asarray(eta + step * e)).wavelet_variance(wv.scales)
                - fit.model.with_unconstrained(jnp.asarray(eta - step * e)).wavelet_variance(wv.scales)
            )
            / (2 * step)
            for e in np.eye(3)
        ]
    )
    B = np.linalg.solve(A.T @ fit.omega @ A, A.T @ fit.omega)
    np.testing.assert_allclose(fit.covariance, B @ fit.wv_covariance @ B.T, rtol=1e-6)
    np.testing.assert_allclose(fit.wv_covariance, gj.variance.wv_covariance(fit.model, 2**14), rtol=1e-12)


def test_intervals_follow_the_log_scale():
    wv = gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(0))), rate=20.0)
    fit = gj.fit(wv, "WN + GM", level=0.8)
    z = normal_quantile(0.8)
    assert z == pytest.approx(1.2815515655446004)
    for e, sd in zip(fit.parameters(), np.sqrt(np.diag(fit.covariance)), strict=True):
        np.testing.assert_allclose([e.ci_low, e.ci_high], e.value * np.exp([-z * sd, z * sd]), rtol=1e-9)
    # N = sqrt(sigma2/f): half the error on the log scale; log q = log beta + log variance + const
    datasheet, continuous = fit.datasheet(), fit.continuous()
    sigma2, N = fit.parameters()["WN", "sigma2"], datasheet["WN", "N"]
    assert N.ci_high / N.value == pytest.approx(np.sqrt(sigma2.ci_high / sigma2.value), rel=1e-9, abs=0)
    a = np.array([0.0, 1.0, 1.0])
    q = continuous["GM", "q"]
    assert np.log(q.ci_high / q.value) == pytest.approx(z * np.sqrt(a @ fit.covariance @ a), rel=1e-9, abs=0)
    tau, beta = continuous["GM", "tau_c"], continuous["GM", "beta"]
    assert tau.value == pytest.approx(1 / beta.value, rel=1e-12, abs=0)
    assert tau.ci_low == pytest.approx(1 / beta.ci_high, rel=1e-9, abs=0)


def test_a_component_at_zero_has_an_upper_limit_which_moves_the_others():
    wv = gj.wavelet_variance(np.asarray(gj.simulate("WN(sigma2=1)", 2**14, key=jax.random.key(4))), rate=1.0)
    fit = gj.fit(wv, "WN + QN")
    alone = gj.fit(wv, "WN")
    if "QN" not in fit.at_boundary:
        pytest.fail("the key was chosen so that QN comes out as zero")
    e = fit.parameters()["QN", "q2"]
    assert (e.value, e.note) == (0.0, "at boundary: zero")
    assert 0 == e.ci_low < e.ci_high < 0.05
    white, known = fit.parameters()["WN", "sigma2"], alone.parameters()["WN", "sigma2"]
    assert white.ci_high == pytest.approx(known.ci_high, rel=1e-6)
    assert white.ci_low < known.ci_low
    json = fit.to_dict()
    assert json["parameters"][1]["ci_low"] == 0


@pytest.mark.slow
def test_a_lost_gauss_markov_process_has_no_correlation_time():
    wv = gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(0))), rate=1.0)
    fit = gj.fit(wv, "WN + 2*GM")
    lost = [label for label, note in fit.at_boundary.items() if note is gj.fitting.Outcome.ZERO]
    assert lost, "the key was chosen so that the second process comes out as zero"
    assert np.isnan(fit.parameters()[lost[0], "beta"].value)
    assert fit.parameters()[lost[0], "beta"].note == "not identified"
    assert fit.parameters()[lost[0], "variance"].value == 0
    assert np.isnan(fit.continuous()[lost[0], "tau_c"].value)
    assert lost[0] in repr(fit)


@pytest.mark.slow
def test_components_that_cannot_be_told_apart_have_no_interval():
    """Two processes held at one correlation time: any split of the variance fits alike. Their neighbour keeps its own.

    A pseudo-inverse alone would call the unseen direction certain.
    """
    wv = gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(0))), rate=1.0)
    twice = gj.fit(wv, "WN + GM(beta=0.01 fixed) + GM(beta=0.01 fixed)")
    once = gj.fit(wv, "WN + GM(beta=0.01 fixed)")
    assert twice.objective == pytest.approx(once.objective, rel=1e-9, abs=0)
    assert not twice.at_boundary
    for e in (*twice.parameters(), *twice.datasheet()):
        if e.component != "WN" and e.symbol in ("variance", "sigma", "sqrt(q)", "N_0"):
            assert e.note == "not told apart from others"
            assert np.isnan([e.ci_low, e.ci_high]).all()
    model = gj.WN(0.5) + gj.GM(0.01, 0.05) + gj.GM(0.01, 0.05)
    whitener = np.diag(1 / (wv.ci_high - wv.ci_low))
    covariance = parameter_covariance(model, (0, 2, 4), wv.scales, whitener, gj.variance.wv_covariance(model, 2**14))
    assert np.isnan(np.diag(np.asarray(covariance))).tolist() == [False, True, True]
    single = gj.WN(0.5) + gj.GM(0.01, 0.1)
    expected = parameter_covariance(single, (0, 2), wv.scales, whitener, gj.variance.wv_covariance(single, 2**14))
    assert float(covariance[0, 0]) == pytest.approx(float(expected[0, 0]), rel=1e-6, abs=0)
    errors = delta_method(ONE_AND_TWO, model, (0, 2, 4), covariance)
    assert np.isnan(np.asarray(errors)).tolist() == [False, True]


def ONE_AND_TWO(model):
    return jnp.log(jnp.stack([model.processes[0].sigma2, model.processes[1].variance]))


@pytest.mark.slow
def test_a_held_amplitude_of_zero_takes_no_interval_away():
    wv = gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(0))), rate=1.0)
    fit = gj.fit(wv, "WN + GM(variance=0 fixed)")
    alone = gj.fit(wv, "WN").parameters()["WN", "sigma2"]
    sigma2, beta = fit.parameters()["WN", "sigma2"], fit.parameters()["GM", "beta"]
    assert sigma2.ci_high == pytest.approx(alone.ci_high, rel=1e-9, abs=0)
    assert np.isnan(beta.value)
    assert beta.note == "not identified"


@pytest.mark.slow
def test_an_interval_of_13_decades_is_none():
    """An exact table of WN + RW and a model with two Gauss-Markov processes too many: no warning, no 0 .. inf."""
    tau = 2.0 ** np.arange(1, 17)
    nu = np.asarray(gj.parse_model("WN(sigma2=1) + RW(gamma2=1e-6)").wavelet_variance(tau))
    wv = gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, num_samples=2**18, rate=1.0)
    fit = gj.fit(wv, "WN + RW + 2*GM")
    for e in (*fit.parameters(), *fit.continuous(), *fit.datasheet()):
        assert np.isnan(e.ci_low) or e.ci_low < e.ci_high
        assert (e.ci_low, e.ci_high) != (0, np.inf)


def test_without_the_length_of_the_record_there_are_no_intervals():
    tau = 2.0 ** np.arange(1, 9)
    wv = gj.variance.WaveletVariance.from_table(tau, 1 / tau, 0.9 / tau, 1.2 / tau, rate=1.0)
    fit = gj.fit(wv, "WN")
    assert fit.covariance is None
    assert np.isnan(fit.parameters()["WN", "sigma2"].ci_low)
    assert "No intervals" in fit.summary()


@pytest.mark.slow
def test_the_dwt_has_no_overlapping_allan_deviation_and_no_intervals():
    x = np.asarray(gj.simulate("WN(sigma2=1)", 2**12, key=jax.random.key(4)))
    wv = gj.wavelet_variance(x, method="dwt", rate=1.0)
    assert gj.fit(wv, "WN").covariance is None
    with pytest.raises(ValueError, match="this one is of the dwt"):
        gj.allan_deviation(wv)


@pytest.mark.slow
def test_tables_compile_once():
    """Another fit reuses the compiled covariance and delta method, at a boundary as well."""
    fits = [
        gj.fit(gj.wavelet_variance(np.asarray(gj.simulate(TRUTH, 2**14, key=jax.random.key(i))), rate=1.0), "WN + GM")
        for i in range(2)
    ]
    fits[0].summary()
    programs = inference._sandwich, inference._tables
    before = [p._cache_size() for p in programs]
    fits[1].summary()
    white = gj.wavelet_variance(np.asarray(gj.simulate("WN(sigma2=1)", 2**14, key=jax.random.key(2))), rate=1.0)
    lost = gj.fit(white, "WN + GM")
    assert lost.at_boundary
    lost.summary()
    assert [p._cache_size() for p in programs] == before


def test_quantities_are_functions_of_the_model():
    quantities = gj.GM.continuous.filter
    logs = LogQuantities(((), quantities), 10.0)(TRUTH)
    np.testing.assert_allclose(np.exp(logs), [0.1, 2 * 0.1 * 0.1], rtol=1e-12)
