"""Sensitivities, error budget, effect of a calibration, design and tuning: each against a second computation."""

import dataclasses
import inspect
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.backend import get_backend
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.parameters import AidingLines, ErrorLines
from nav_jax.lincov import _search

REFERENCE, AIDING = setups.SCENARIO.reference, setups.SCENARIO.aiding
SCENARIO, START, TRUTH, FEWER = setups.SCENARIO, setups.START, setups.TRUTH, setups.FEWER


@pytest.fixture(scope="module")
def slopes():
    return nj.sensitivities(SCENARIO, TRUTH, FEWER)


@pytest.fixture(scope="module")
def budget():
    return nj.error_budget(SCENARIO, TRUTH, FEWER)


# -- parameters on the real line --------------------------------------------------------------------------------------


@pytest.mark.slow
def test_lines_are_the_parameters():
    lines = ErrorLines(TRUTH)
    assert lines.names[:3] == ("accel WN sigma2", "accel GM_1 beta", "accel GM_1 variance")
    assert lines.names[-1] == "gyro bias sd"
    assert len(lines.names) == len(lines.start) == 9
    np.testing.assert_allclose(lines.values(lines.start), [6e-5, 0.01, 4e-5, 0.0005, 1e-4, 1.5e-6, 0.002, 3e-7, 1e-4])
    other = lines.build(lines.start + jnp.log(2.0))
    assert [float(m.processes[0].sigma2) for m in other.models] == pytest.approx([1.2e-4] * 3 + [3e-6] * 3)
    np.testing.assert_allclose(other.bias_sd, [0, 0, 0, 2e-4, 2e-4, 2e-4])
    axes = ErrorLines(nj.ImuErrors([gj.WN(1e-4), gj.WN(2e-4), gj.WN(1e-4)], gj.WN(1e-6), setups.RATE))
    assert axes.names == ("accel x WN sigma2", "accel y WN sigma2", "accel z WN sigma2", "gyro WN sigma2")
    unequal = ErrorLines(nj.ImuErrors(gj.WN(1e-4), gj.WN(1e-6), setups.RATE, accel_bias_sd=[0.0, 0.1, 0.2]))
    assert unequal.names == ("accel WN sigma2", "gyro WN sigma2", "accel y bias sd", "accel z bias sd")
    built = unequal.build(unequal.start + jnp.log(jnp.array([2.0, 3.0, 4.0, 5.0])))
    np.testing.assert_allclose(built.bias_sd, [0, 0.4, 1.0, 0, 0, 0])
    np.testing.assert_allclose(unequal.values(unequal.start), [1e-4, 1e-6, 0.1, 0.2])
    kinds = [nj.imu.ScaleFactor([1e-3, 0.0, 2e-3], 3e-3), nj.imu.GSensitivity(1e-6)]
    constants = ErrorLines(nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), setups.RATE, deterministic=kinds))
    assert constants.names == ("accel x scale sd", "accel z scale sd", "gyro scale sd", "gyro g-sensitivity sd")
    np.testing.assert_allclose(constants.values(constants.start), [1e-3, 2e-3, 3e-3, 1e-6])
    doubled = constants.build(constants.start + jnp.log(2.0)).deterministic
    np.testing.assert_allclose(doubled[0].sd, 2 * kinds[0].sd)
    np.testing.assert_allclose(doubled[1].sd, 2 * kinds[1].sd)
    aiding = AidingLines(AIDING)
    assert aiding.names[:2] == ("gnss_position n, e sd", "gnss_position d sd")
    louder = aiding.believe(jnp.log(jnp.arange(1.0, 6.0)))
    np.testing.assert_allclose(louder[0].believed, AIDING[0].believed * jnp.array([1.0, 1.0, 2.0]))
    np.testing.assert_allclose(louder[2].believed, 5 * AIDING[2].believed)


def test_a_channel_without_noise_has_no_lines():
    quiet = nj.ImuErrors([gj.WN(0.0), gj.WN(1e-4), gj.WN(0.0)], gj.WN(0.0), setups.RATE, gyro_bias_sd=1e-4)
    lines = ErrorLines(quiet)
    assert lines.names == ("accel y WN sigma2", "gyro bias sd")
    np.testing.assert_allclose(lines.values(lines.start + 1.0), np.e * np.array([1e-4, 1e-4]))
    other = lines.build(lines.start + 1.0)
    np.testing.assert_allclose([float(m.processes[0].sigma2) for m in other.models], [0, np.e * 1e-4, 0, 0, 0, 0])
    silent = ErrorLines(nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), setups.RATE))
    assert silent.names == ()
    assert silent.build(silent.start).models[0].processes[0].sigma2 == 0.0


# -- sensitivities ----------------------------------------------------------------------------------------------------


def rms(truth, believed, believed_initial=None, **changed):
    scenario = dataclasses.replace(SCENARIO, **changed)
    c = nj.analyse(scenario, truth, believed, believed_initial=believed_initial)["filter"]
    return np.linalg.norm(c.sd[-1, :2])


def changed(errors, name, x):
    """The errors with x added to one line."""
    lines = ErrorLines(errors)
    return lines.build(lines.start.at[lines.names.index(name)].add(x))


@pytest.mark.parametrize(
    ("side", "name"), [("truth", "accel GM_2 beta"), ("filter", "accel GM variance"), ("truth", "gyro bias sd")]
)
def test_sensitivities_are_differences_of_analyses(slopes, side, name):
    (column,) = [i for i, s in enumerate(zip(slopes.sides, slopes.names, strict=True)) if s == (side, name)]
    h = 1e-3
    high, low = (
        rms(changed(TRUTH, name, x), FEWER) if side == "truth" else rms(TRUTH, changed(FEWER, name, x)) for x in (h, -h)
    )
    difference = (high - low) / (2 * h)
    assert slopes.derivative["horizontal"][-1, column] == pytest.approx(difference, rel=1e-4)
    assert slopes.elasticity("horizontal")[-1, column] == pytest.approx(difference / rms(TRUTH, FEWER), rel=1e-4)


@pytest.mark.slow
def test_sensitivity_to_a_partial_autocorrelation():
    """What is named is what is moved: both coefficients, by the recursion, as the first partial one alone changes."""

    def truth(z, r2=-0.4):
        r1 = np.tanh(z / 2)
        return nj.ImuErrors(gj.WN(0.0), gj.AR(2)(r1 * (1 - r2), r2, 1e-6), setups.RATE)

    z, h = 2 * np.arctanh(0.9), 1e-3
    s = nj.sensitivities(SCENARIO, truth(z), FEWER)
    assert [n for n, side in zip(s.names, s.sides, strict=True) if side == "truth"][:3] == [
        "gyro AR(2) phi partial 1", "gyro AR(2) phi partial 2", "gyro AR(2) sigma2",
    ]  # fmt: skip
    high, low = (nj.analyse(SCENARIO, truth(x), FEWER)["filter"].rms("position")[-1] for x in (z + h, z - h))
    assert s.derivative["position"][-1, 0] == pytest.approx((high - low) / (2 * h), rel=1e-4)
    assert np.isfinite(s.derivative["position"]).all()


def test_sensitivities_to_fixes_and_start(slopes):
    """Twice differentiated by hand: standard deviations believed and true of a barometer, and those of the start."""
    h = 1e-3
    at = {s: i for i, s in enumerate(zip(slopes.sides, slopes.names, strict=True))}

    def louder(true, believed):
        sensors = (*AIDING[:2], nj.Barometer(1.0, height=0.5 * np.exp(true), believed=0.5 * np.exp(believed)))
        return rms(TRUTH, FEWER, aiding=sensors)

    for side, one in (("truth", (h, 0.0)), ("filter", (0.0, h))):
        difference = (louder(*one) - louder(*(-x for x in one))) / (2 * h)
        seen = slopes.derivative["horizontal"][-1, at[side, "barometer sd"]]
        assert seen == pytest.approx(difference, rel=1e-4, abs=1e-9)
    starts = [nj.InitialUncertainty(0.05, 0.02, 0.002 * np.exp(x)) for x in (h, -h)]
    true = [rms(TRUTH, FEWER, initial=s, believed_initial=START) for s in starts]
    seen = slopes.derivative["horizontal"][-1, at["truth", "start attitude sd"]]
    assert seen == pytest.approx((true[0] - true[1]) / (2 * h), rel=1e-4, abs=1e-9)


@pytest.mark.slow
def test_where_the_filter_is_right_its_parameters_do_not_matter():
    """The gains are optimal: derivatives by what is believed vanish; only position counts, the last of many optima."""
    s = nj.sensitivities(SCENARIO, TRUTH)
    of_filter = np.array(s.sides) == "filter"
    d = np.abs(s.derivative["position"][-1])
    assert d[of_filter].max() < 1e-7 * d[~of_filter].max()
    assert "d RMS / d log parameter" in repr(s)


# -- budget -----------------------------------------------------------------------------------------------------------


def test_parts_add_up_to_the_whole(budget):
    """Every component at every epoch, 1e-8."""
    whole = nj.analyse(SCENARIO, TRUTH, FEWER)["filter"].true
    np.testing.assert_allclose(budget.part.sum(axis=0), np.diagonal(whole, axis1=1, axis2=2)[:, :9], rtol=1e-8)
    np.testing.assert_allclose(budget.share("tilt").sum(axis=0), 1.0, rtol=1e-12)


@pytest.mark.slow
def test_a_part_is_an_analysis_without_the_others(budget):
    """Gyro noise alone: of a truth without anything else, with the gains of the same filter."""
    outage = {"outages": AIDING[0].outages}
    quiet = (
        nj.GnssPosition(1.0, horizontal=1e-9, vertical=1e-9, believed=(0.025, 0.05), **outage),
        nj.GnssVelocity(1.0, horizontal=1e-9, vertical=1e-9, believed=(0.01, 0.02), **outage),
        nj.Barometer(1.0, height=1e-9, believed=0.5),
    )
    truth = nj.ImuErrors(gj.WN(0.0), gj.WN(1.5e-6), setups.RATE)
    scenario = nj.Scenario(REFERENCE, quiet, every=10)
    alone = nj.analyse(scenario, truth, FEWER, believed_initial=START)["filter"]
    (row,) = [i for i, name in enumerate(budget.sources) if name == "gyro white"]
    np.testing.assert_allclose(budget.part[row], alone.sd[:, :9] ** 2, rtol=1e-6, atol=1e-16)


def test_sources_have_names(budget):
    assert budget.sources[:5] == ("accel white", "accel GM_1", "accel GM_2", "gyro white", "gyro GM")
    assert "gyro bias" in budget.sources
    assert budget.sources[-3:] == ("gnss_position", "gnss_velocity", "barometer")
    assert "all: RMS" in repr(budget)
    nothing = nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), setups.RATE)
    with pytest.raises(ValueError, match="no source of error"):
        nj.error_budget(nj.Scenario(REFERENCE, every=10), nothing, TRUTH)


def test_a_correlated_start_is_one_source():
    P = np.diag(np.full(9, 1e-4))
    P[0, 3] = P[3, 0] = 5e-5
    start = nj.InitialUncertainty(covariance=P)
    white = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE)
    b = nj.error_budget(dataclasses.replace(SCENARIO, initial=start), white)
    assert [s for s in b.sources if s.startswith("start")] == ["start"]


def test_other_numbers_compile_nothing(slopes, budget):
    lines = ErrorLines(TRUTH)
    truth = lines.build(lines.start + 0.25)
    held = get_backend().live_executables
    before = len(held())
    rms = nj.sensitivities(SCENARIO, truth, FEWER).rms["position"]
    square = nj.error_budget(SCENARIO, truth, FEWER).mean_square("position")
    assert len(held()) == before
    assert not np.allclose(rms, slopes.rms["position"], rtol=1e-2)
    assert not np.allclose(square, budget.mean_square("position"), rtol=1e-2)


# -- what a calibration leaves open -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fits():
    return setups.fits()


@pytest.mark.slow
def test_calibration_wants_fits(fits):
    blind = dataclasses.replace(fits[0])
    unknown = blind.covariance.copy()
    unknown[1] = unknown[:, 1] = np.nan
    blind.__dict__["covariance"] = unknown  # the cached property
    with pytest.raises(ValueError, match="no standard error of accel GM beta"):
        nj.calibration_effect(SCENARIO, blind, fits[1], key=jax.random.key(1))
    with pytest.raises(ValueError, match="A fit of gmwm_jax"):
        nj.calibration_effect(SCENARIO, "WN", fits[1], key=jax.random.key(1))
    with pytest.raises(ValueError, match="these are 2"):
        nj.calibration_effect(SCENARIO, fits[:1] * 2, fits[1], key=jax.random.key(1))


# -- design -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def designed():
    return setups.designed()


@pytest.mark.slow
def test_designed_filters_beat_parts_of_the_truth(designed):
    """By the score that was asked for, and with claims that are nearer to the truth."""
    assert (designed.candidates[0].num_accel, designed.candidates[0].num_gyro) == (0, 0)
    for c in designed.candidates:
        assert c.loss < c.loss_naive
        k = c.covariances[0].epoch()
        said, naive = (x[0].nees("navigation")[k] / 9 for x in (c.covariances, c.covariances_naive))
        assert 0.8 < said < 1.25
        assert abs(np.log(said)) < max(abs(np.log(naive)), 0.1)
        assert c.converged
    # one more process does no harm
    assert designed.candidates[1].loss < designed.candidates[0].loss


@pytest.mark.slow
def test_no_filter_is_better_than_the_right_one(designed):
    """A proper score: of the truth it is least."""
    k = designed.right[0].epoch()
    for c in designed.candidates:
        assert c.covariances[0].rms("position")[k] >= designed.right[0].rms("position")[k] * (1 - 1e-9)


@pytest.mark.slow
def test_the_score_is_that_of_the_covariances(designed):
    """Recomputed from the result by dense algebra."""
    c = designed.best()
    inside = (c.covariances[0].time > 6.0) & (c.covariances[0].time <= 12.0)
    T, C = (a[inside, :9, :9] for a in (c.covariances[0].true, c.covariances[0].claimed))
    score = [(np.linalg.slogdet(c)[1] + np.trace(np.linalg.solve(c, t))) / 2 for t, c in zip(T, C, strict=True)]
    assert np.mean(score) == pytest.approx(c.loss, rel=1e-6)


@pytest.mark.slow
def test_results_of_a_design(designed):
    text = repr(designed)
    assert "0 GM accel, 1 GM gyro" in text
    assert [c.num_states for c in designed.candidates] == sorted(c.num_states for c in designed.candidates)
    assert designed.best(max_states=3).num_gyro == 0
    assert designed.pareto[-1] is designed.best()
    losses = [c.loss for c in designed.pareto]
    assert losses == sorted(losses, reverse=True)
    with pytest.raises(ValueError, match="the smallest has 3"):
        designed.best(max_states=1)
    assert designed.candidates[0].errors.biased == (3, 4, 5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"objective": "beauty"}, "objective is one of score, error"),
        ({"scenario": ()}, "at least one scenario"),
        ({"scenario": (nj.motions.static(2.0, setups.RATE),)}, "Scenarios are wanted"),
        ({"num_starts": 0}, "num_starts"),
        ({"max_states": 2}, "No structure has 2"),
    ],
)
def test_a_design_needs_its_input(options, message):
    scenario = nj.Scenario(nj.motions.static(2.0, setups.RATE), (), START)
    given = {"scenario": scenario, "truth": TRUTH} | options
    with pytest.raises(ValueError, match=message):
        inspect.unwrap(nj.design)(**given)  # below the type checks of the test run


def test_a_true_covariance_that_rounding_has_made_negative_is_no_bargain(monkeypatch):
    """As of a filter that believes in gyros with a variance of 1e38: a search that stepped there had stayed."""

    def loss(true):
        pair = SimpleNamespace(
            true=SimpleNamespace(navigation=true * jnp.eye(9)[None]),
            claimed=SimpleNamespace(navigation=jnp.eye(9)[None]),
        )
        monkeypatch.setattr(_search, "covariances_along", lambda *_: pair)
        course = SimpleNamespace(
            experiment=SimpleNamespace(initial=None), motion=None, noise=None, epochs=jnp.array([0])
        )
        return float(_search.mean_loss((course,), None, "score"))

    assert loss(2.0) == pytest.approx(9.0)
    assert np.isnan(loss(-1e6))
