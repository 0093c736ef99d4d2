"""Bias, scatter and coverage of fits to simulated records."""

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.app.web.library import published
from gmwm_jax.fitting.result import Status

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.01, variance=0.1)")
"""Correlation time of 100 samples; the two components cross at a span of about 30."""


NUM_SAMPLES, NUM_REPLICATES, CHUNK = 100_000, 200, 50


@pytest.fixture(scope="module")
def replicates():
    """200 fits of WN + GM to records of 100,000 samples."""
    draw = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key)))
    keys = jax.random.split(jax.random.key(2026), NUM_REPLICATES)
    fits = []
    for start in range(0, NUM_REPLICATES, CHUNK):
        x = np.asarray(draw(keys[start : start + CHUNK])).T
        fits += list(gj.fit(gj.wavelet_variance(x, rate=10.0), "WN + GM").values())
    return fits


def test_every_replicate_converges_inside_the_parameter_space(replicates):
    assert all(f.status is Status.converged and not f.at_boundary for f in replicates)


@pytest.fixture(scope="module")
def two_step_replicates(replicates):
    """The same records, fitted with weights that do not depend on the scatter of the data."""
    fits = []
    for start in range(0, NUM_REPLICATES, CHUNK):
        part = [f.wv for f in replicates[start : start + CHUNK]]
        columns = (np.column_stack([getattr(w, k) for w in part]) for k in ("variance", "ci_low", "ci_high"))
        names = tuple(str(i) for i in range(CHUNK))
        wv = gj.variance.WaveletVariances(part[0].scales, *columns, NUM_SAMPLES, 0.95, 10.0, names, ("1",) * CHUNK)
        fits += list(gj.fit(wv, "WN + GM", weights="two-step").values())
    return fits


def mean_error(fits):
    """Mean relative error of each parameter, and its standard error."""
    values = np.array([[e.value for e in f.parameters()] for f in fits]) / [1.0, 0.01, 0.1] - 1
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(fits))


def test_no_parameter_is_biased(two_step_replicates, judge):
    """Mean error of every parameter within 3 standard errors of zero."""
    mean, error = mean_error(two_step_replicates)
    judge("bias in standard errors", mean / error, -3, 3, num_draws=NUM_REPLICATES)


def test_default_weights_cost_no_more_than_a_small_bias(replicates, judge):
    """Weights from the data favour scales that came out low: 4/eta, 1.5 % at the hump of this process (span 380).

    So documented in `fit`; beyond that nothing, within 3 standard errors.
    """
    mean, error = mean_error(replicates)
    eta = NUM_SAMPLES / 380
    beyond = (np.abs(mean) - 4 / eta) / error
    judge("bias beyond the one stated, in standard errors", beyond, -np.inf, 3, num_draws=NUM_REPLICATES)


def test_standard_errors_are_the_scatter(replicates, judge):
    """Mean theoretical over empirical standard deviation on the log scale; 4 sigmas of a deviation of 200 draws."""
    logs = np.array([np.asarray(f.model.unconstrained()) for f in replicates])
    theory = np.mean([np.sqrt(np.diag(f.covariance)) for f in replicates], axis=0)
    ratio, band = theory / logs.std(axis=0, ddof=1), 4 / np.sqrt(2 * NUM_REPLICATES)
    judge("standard error over scatter", ratio, 1 - band, 1 + band, num_draws=NUM_REPLICATES)


def test_intervals_cover(replicates, judge):
    """95 % intervals of parameters and of continuous-time quantities hold the truth in 90 to 98 % of the records.

    200 draws: the binomial sigma is 1.5 %.
    """
    tables = {
        "parameters": (lambda f: f.parameters(), [1.0, 0.01, 0.1]),
        "continuous": (lambda f: f.continuous(), [0.1, 0.1, 2 * 0.1 * 0.1, 10.0]),
    }
    for name, (table, truth) in tables.items():
        covered = np.mean(
            [[e.ci_low <= t <= e.ci_high for e, t in zip(table(f), truth, strict=True)] for f in replicates], axis=0
        )
        judge(f"coverage of 95 % intervals, {name}", covered, 0.90, 0.98, num_draws=NUM_REPLICATES)


def test_no_fit_is_above_the_truth(replicates):
    """The minimum lies below the objective at the true parameters: no fit is stuck in a wrong basin."""
    assert all(f.objective <= gj.fitting.objective(f.wv, TRUTH) for f in replicates)


def test_at_the_limit_the_intervals_of_what_is_left_cover(judge):
    """60 records too short for their correlation time: many fits end as a random walk, and report its q only.

    q = 2 beta variance; a 95 % interval of 60 draws holds it at least 0.95 - 3 x 0.028 of the time.
    """
    truth, rate = gj.GM(beta=2e-5, variance=1.0), 10.0
    keys = jax.random.split(jax.random.key(11), 60)
    x = np.column_stack([np.asarray(gj.simulate(truth, 20_000, key=k)) for k in keys])
    fits = list(gj.fit(gj.wavelet_variance(x, rate=rate), "GM").values())
    walks = [f for f in fits if f.at_boundary]
    assert len(walks) > 10, "the case was chosen so that this happens"
    for f in walks:
        assert np.isnan([e.value for e in f.parameters()]).all()
        assert np.isnan(f.continuous()["GM", "tau_c"].value)
    q = [f.continuous()["GM", "q"] for f in fits]
    covered = np.mean([e.ci_low <= 2 * 2e-5 * rate <= e.ci_high for e in q])
    judge("coverage of 95 % intervals of q at the limit", covered, 0.95 - 3 * 0.028, 1, num_draws=60)


def test_the_mtig_model_at_a_million_samples(judge):
    """100 records of 10^6 samples of the MTi-G's gyro X (RW + 2 GM): coverage of every parameter in 90 to 98 %.

    Below 90 % only beyond what 100 draws can show: the band is widened by 2 binomial sigmas, 4.4 %. Benchmarks have
    the table for 200 records.
    """
    truth = gj.datasets.sensor_models("mti-g")["gyro_x"]
    keys = jax.random.split(jax.random.key(7), 100)
    fits = []
    for start in range(0, 100, 50):
        x = np.column_stack([np.asarray(gj.simulate(truth, 1_000_000, key=k)) for k in keys[start : start + 50]])
        fits += list(gj.fit(gj.wavelet_variance(x, rate=100.0), "RW + 2*GM", throw=False).values())
    expected = [float(v) for p in truth.processes for v in p.values]
    assert all(f.status is Status.converged for f in fits)
    covered = np.mean(
        [[e.ci_low <= t <= e.ci_high for e, t in zip(f.parameters(), expected, strict=True)] for f in fits], axis=0
    )
    judge("coverage of 95 % intervals, RW + 2 GM", covered, 0.90 - 0.044, 1, num_draws=100)


def test_some_descent_came_to_the_minimum():
    """However far the search goes on from where descents stop: of this key none was counted."""
    wv = published("mti-g")["accel_x"]
    fit = gj.fit(wv, "WN + RW + 4*GM", throw=False, key=jax.random.key(6))
    assert fit.agreement >= 1 / 16
