"""Do records share their parameters, and which model predicts them: by hand, by size and power, bad input."""

import itertools
from dataclasses import replace

import jax
import numpy as np
import pytest
from drawn import assert_shows
from helpers import Told, assert_same_result
from programs import MEDIUM, NUM_RECORDS, blank, draws, sets_of_records, with_variance
from scipy import stats

import gmwm_jax as gj
from gmwm_jax.multisignal import stationarity as module


@pytest.fixture(scope="module")
def records():
    return sets_of_records(1, 1)[0]


@pytest.fixture(scope="module")
def joint(records):
    return gj.fit_records(records, "WN + GM", weights="two-step")


@pytest.fixture(scope="module")
def varied():
    return gj.fit_records(sets_of_records(1, 2, spread=0.7)[0], "WN + GM", weights="two-step")


@pytest.fixture(scope="module")
def same_test(joint):
    return gj.multisignal.near_stationarity(joint, 300, key=jax.random.key(4))


# -- record by record -------------------------------------------------------------------------------------------------


def test_single_fits_are_fits(joint, records):
    for single, r, wv in zip(joint.singles, joint.records, records, strict=True):
        alone = gj.fit(wv, "WN + GM", weights=r.omega)
        assert single.objective == pytest.approx(alone.objective, rel=1e-8)
        assert single.objective <= r.objective


def test_cochran_by_hand(varied):
    """Each parameter and all together, with a loop; variance between records as DerSimonian & Laird write it."""
    comparison = gj.multisignal.compare_records(varied)
    x = np.array([[np.log(float(v)) for p in f.model.processes for v in p.values] for f in varied.singles])
    psi = varied.records[0].covariance  # the same for records of a length
    np.testing.assert_allclose(comparison.estimates, x, rtol=1e-9)
    np.testing.assert_allclose(comparison.covariances[2], psi, rtol=1e-6)
    for i, spread in enumerate(comparison.spreads):
        w, Q = 1 / psi[i, i], 0.0
        for own in x[:, i]:
            Q += w * (own - x[:, i].mean()) ** 2
        assert spread.statistic == pytest.approx(Q, rel=1e-6)
        assert spread.p_value == pytest.approx(stats.chi2.sf(Q, 3), rel=1e-4)
        assert spread.between == pytest.approx(np.sqrt(max(0, x[:, i].var(ddof=1) - psi[i, i])), rel=1e-5, abs=1e-9)
        assert spread.observed == pytest.approx(x[:, i].std(ddof=1), rel=1e-9)
        assert spread.low == pytest.approx(np.exp(x[:, i].min()), rel=1e-9)
    total = sum((row - x.mean(axis=0)) @ np.linalg.solve(psi, row - x.mean(axis=0)) for row in x)
    assert comparison.statistic == pytest.approx(total, rel=1e-6)
    assert comparison.dof == 9
    assert comparison.p_value == pytest.approx(stats.chi2.sf(total, 9), rel=1e-4, abs=1e-12)
    np.testing.assert_allclose(comparison.between_covariance, np.cov(x, rowvar=False) - psi, rtol=1e-6, atol=1e-12)


def test_who_varies_is_found(joint, varied):
    same, other = gj.multisignal.compare_records(joint), gj.multisignal.compare_records(varied)
    assert same.p_value > 1e-3
    assert other.p_value < 1e-6
    assert other["GM", "beta"].p_value < 1e-6
    assert other["GM", "beta"].between == pytest.approx(0.7, rel=0.8)  # of four records
    assert other["WN", "sigma2"].p_value > 1e-3
    assert "same parameters? chi-square" in str(other)
    assert len(other.plot().axes) == 3
    assert_shows(other.plot(), gj.plotting.record_comparison_data(other))
    with pytest.raises(KeyError, match=r"No parameter \('WN', 'beta'\); there are \('WN', 'sigma2'\)"):
        other["WN", "beta"]


def test_records_without_an_estimate_are_left_out(joint):
    """A component that one record does not show: it has no place on the log scale."""
    wv = blank(MEDIUM)
    none = with_variance(wv, 1.0 / wv.scales)
    fit = gj.fit_records([*(r.wv for r in joint.records[:3]), none], "WN + GM", weights="two-step")
    assert "GM" in fit.singles[3].at_boundary
    comparison = gj.multisignal.compare_records(fit)
    assert comparison["GM", "variance"].num_left_out == 1
    assert comparison["GM", "variance"].dof == 2
    assert comparison["WN", "sigma2"].num_left_out == 0
    assert comparison.dof == 2 * 3
    assert "1 left out" in str(comparison)


@pytest.mark.slow
def test_what_is_zero_for_all_is_zero_for_each():
    """A record that took white noise on would have a faster and smaller share of the process left, not another one."""
    truth = gj.parse_model("GM(beta=2.0, variance=1.0)")
    wvs = [with_variance(blank(MEDIUM), row) for row in draws(truth, MEDIUM, NUM_RECORDS, 3)]
    fit = gj.fit_records(wvs, "WN + GM", weights="two-step")
    assert fit.at_boundary == {"WN": "at boundary: zero"}
    free = [gj.fit(wv, "WN + GM", weights=r.omega).model for wv, r in zip(wvs, fit.records, strict=True)]
    assert max(float(model.processes[0].sigma2) for model in free) > 0.05
    assert all(float(single.model.processes[0].sigma2) == 0 for single in fit.singles)
    comparison = gj.multisignal.compare_records(fit)
    assert comparison.dof == 6
    assert comparison.p_value > 1e-3


# -- near-stationarity ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_share_of_objectives(joint, same_test):
    """The p-value counts the data in; a replicate is a joint fit of its own records, with weights of their own."""
    at_least = np.sum(same_test.objective >= joint.objective)
    assert same_test.p_value == (1 + at_least) / 301
    assert same_test.p_value > 0.01
    assert "p = " in str(same_test)
    assert_shows(same_test.plot(), gj.plotting.near_stationarity_data(same_test))
    assert same_test.plot().axes[0].get_xlabel() == "joint objective"


@pytest.mark.slow
@pytest.mark.parametrize("omega", [None, "two-step"])
def test_a_replicate_is_a_joint_fit(records, omega):
    """Also where one record is shorter."""
    part = {k: getattr(records[0], k)[:11] for k in ("scales", "variance", "ci_low", "ci_high")}
    fit = gj.fit_records([replace(records[0], num_samples=6_000, **part), *records[1:]], "WN + GM", weights=omega)
    variances = np.zeros((3, NUM_RECORDS, blank(MEDIUM).num_scales))
    for i, draw in enumerate(module._draws(fit, "variances")):
        nu = draw(jax.random.split(jax.random.key(i), 3))
        variances[:, i, : nu.shape[1]] = nu
    ours, converged = module._objectives(fit, variances)
    assert converged.all()
    for b in range(3):
        own = []
        for i, r in enumerate(fit.records):
            nu = variances[b, i, : r.wv.num_scales]
            width = {k: nu * getattr(r.wv, k) / r.wv.variance for k in ("ci_low", "ci_high")}
            own.append(replace(r.wv, variance=nu, **width))
        assert ours[b] == pytest.approx(gj.fit_records(own, "WN + GM", weights=omega).objective, rel=1e-6)


@pytest.mark.slow
def test_replicates_from_simulated_records(joint, same_test):
    """Objectives of the same size as those of variances drawn from theory."""
    slow = gj.multisignal.near_stationarity(joint, 8, key=jax.random.key(8), route="records")
    assert slow.num_failed == 0
    assert slow.objective.shape == (8,)
    assert 0.3 < np.mean(slow.objective) / np.mean(same_test.objective) < 3


def test_replicates_depend_on_their_key_alone(joint, same_test):
    few = gj.multisignal.near_stationarity(joint, 70, key=jax.random.key(4))
    np.testing.assert_allclose(few.objective, same_test.objective[:70], rtol=1e-6)


def test_an_interrupt_returns_what_is_done(joint, monkeypatch):
    done = []

    def interrupted(*arguments):
        if done:
            raise KeyboardInterrupt
        done.append(1)
        return objectives(*arguments)

    objectives = module._objectives
    monkeypatch.setattr(module, "_objectives", interrupted)
    test = gj.multisignal.near_stationarity(joint, 200, key=jax.random.key(1), progress=True)
    assert "64 replicates of 200 asked for" in str(test)
    with pytest.raises(KeyboardInterrupt):
        gj.multisignal.near_stationarity(joint, 200, key=jax.random.key(1))


def test_progress_is_told_and_cancels(joint):
    told = Told()
    gj.multisignal.near_stationarity(joint, 100, key=jax.random.key(1), progress=told)
    assert told.heard == [(0, 100), (64, 100), (100, 100)]
    with pytest.raises(LookupError, match="enough"):
        gj.multisignal.near_stationarity(joint, 100, key=jax.random.key(1), progress=Told(64))
    sets = Told()
    gj.multisignal.resample_records(joint, progress=sets)
    assert sets.heard == [(0, 35), (35, 35)]
    with pytest.raises(LookupError, match="enough"):
        gj.multisignal.resample_records(joint, progress=Told(0))


# -- cross-validation -------------------------------------------------------------------------------------------------

MODELS = ("WN", "WN + GM")


@pytest.fixture(scope="module")
def cv(records):
    return gj.multisignal.cross_validate(records, MODELS)


def test_cross_validation_by_hand(records, cv):
    """Every split by joint fits of its own, objectives by their definition; errors over records."""
    pairs = list(itertools.combinations(range(4), 2))
    assert cv.exact
    assert {tuple(np.flatnonzero(row)) for row in cv.splits} == set(pairs)
    e = {}
    for model in MODELS:
        own = np.full((6, 4), np.nan)
        for b, pair in enumerate(pairs):
            fit = gj.fit_records([records[i] for i in pair], model)
            for i in set(range(4)) - set(pair):
                own[b, i] = gj.fitting.objective(records[i], fit.model)
        assert cv[model].score == pytest.approx(np.nansum(own, axis=1).mean(), rel=1e-6)
        e[model] = np.nanmean(own, axis=0)
        assert cv[model].error == pytest.approx(2 * e[model].std(ddof=1) / 2, rel=1e-5)
        np.testing.assert_allclose(cv.left_out[list(cv).index(model)], e[model], rtol=1e-5)
    best = min(e, key=lambda m: e[m].mean())
    for model in MODELS:
        off = e[model] - e[best]
        assert cv[model].difference == pytest.approx(2 * off.mean(), rel=1e-4, abs=1e-6)
        near = 2 * off.mean() <= stats.t.ppf(0.975, 3) * off.std(ddof=1)
        assert cv[model].equivalent == near


def test_the_truth_is_recommended(cv):
    assert cv.recommended.model == "WN + GM"
    assert not cv["WN"].equivalent
    assert "WN + GM  " in str(cv)
    assert "recommended" in str(cv)
    assert [p.score for p in cv.scores] == sorted(p.score for p in cv.scores)
    assert len(cv.plot().axes[0].get_yticklabels()) == 2
    assert_shows(cv.plot(), gj.plotting.cross_validation_data(cv))
    with pytest.raises(KeyError, match="No model 'RW'; there are"):
        cv["RW"]


def test_random_splits_leave_all_out_equally_often(records):
    cv = gj.multisignal.cross_validate([*records, *records], ["WN"], max_splits=30, key=jax.random.key(1))
    assert not cv.exact
    assert cv.splits.shape == (24, 8)
    assert set(cv.splits.sum(axis=1)) == {4}
    assert set(cv.splits.sum(axis=0)) == {12}
    assert "24 random splits: estimated from 4" in str(cv)


def test_a_model_with_values_keeps_them(records):
    held = gj.WN(gj.Fixed(2.0))
    cv = gj.multisignal.cross_validate(records, ["WN", held], num_estimation=3)
    assert cv.recommended.model == "WN"
    text = next(name for name in cv if name != "WN")
    assert cv[text].num_parameters == 0
    assert cv[text].score == pytest.approx(np.mean([gj.fitting.objective(wv, gj.WN(2.0)) for wv in records]), rel=1e-9)


def test_channels_apart(records):
    two = [
        gj.variance.WaveletVariances(
            wv.scales,
            *(np.column_stack([a, 2 * a]) for a in (wv.variance, wv.ci_low, wv.ci_high)),
            wv.num_samples,
            channels=("a", "b"),
            units=("1", "1"),
        )
        for wv in records
    ]
    found = gj.multisignal.cross_validate(two, ["WN"])
    assert list(found) == ["a", "b"]
    # the objective has no unit
    assert found["a"]["WN"].score == pytest.approx(found["b"]["WN"].score, rel=1e-9)
    assert [line.split()[:2] for line in str(found).splitlines()[-2:]] == [["a", "WN"], ["b", "WN"]]
    assert len(found.plot().axes) == 2


def test_bad_input(records, joint):
    with pytest.raises(ValueError, match=r"takes three records or more: of two, one alone would judge the other"):
        gj.multisignal.cross_validate(records[:2], ["WN"])
    with pytest.raises(ValueError, match="models is a list of models to compare, and not empty"):
        gj.multisignal.cross_validate(records, "WN")
    with pytest.raises(ValueError, match=r"A model is there twice: WN, WN"):
        gj.multisignal.cross_validate(records, ["WN", gj.WN()])
    with pytest.raises(ValueError, match=r"num_estimation=4 leaves none of 4 records"):
        gj.multisignal.cross_validate(records, ["WN"], num_estimation=4)
    with pytest.raises(ValueError, match=r"WN \+ 7\*GM has 15 free parameters and the shortest record 13 scales"):
        gj.multisignal.cross_validate(records, ["WN + 7*GM"])
    with pytest.raises(ValueError, match=r"8 records have 70 splits: give key=... to choose about 20"):
        gj.multisignal.cross_validate([*records, *records], ["WN"], max_splits=20)
    with pytest.raises(ValueError, match='route is "variances" or "records", and is \'fast\''):
        gj.multisignal.near_stationarity(joint, 10, key=jax.random.key(1), route="fast")
    with pytest.raises(TypeError, match="key"):
        gj.multisignal.near_stationarity(joint, 10, key=3)
    robust = gj.fit_records([replace(wv, estimator=gj.variance.Robust(0.6)) for wv in records], "WN")
    with pytest.raises(ValueError, match='robust wavelet variance is replicated by route="variances"'):
        gj.multisignal.near_stationarity(robust, 10, key=jax.random.key(1), route="records")
    held = gj.fit_records(records, gj.WN(gj.Fixed(1.0)))
    with pytest.raises(ValueError, match="is free and inside its range: there is nothing to compare"):
        gj.multisignal.compare_records(held)
    short = {k: getattr(records[0], k)[:2] for k in ("scales", "variance", "ci_low", "ci_high")}
    some = gj.fit_records([replace(records[0], **short), *records[1:]], "WN + GM")
    with pytest.raises(ValueError, match="3 free parameters and the wavelet variance 2 scales"):
        gj.multisignal.compare_records(some)


@pytest.mark.parametrize("suffix", [".npz", ".json"])
def test_they_come_back_from_files(same_test, cv, tmp_path, suffix):
    for given in (same_test, cv):
        assert_same_result(gj.load(given.save(tmp_path / f"x{suffix}")), given)
