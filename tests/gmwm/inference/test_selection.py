"""Model selection: the sub-models, their fits against single ones, and what is recommended on data of known origin."""

import json
from collections import Counter
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import assert_shows
from helpers import Told
from programs import FAINT, LARGE, drawn_channels
from scipy.special import chdtrc

import gmwm_jax as gj
from gmwm_jax.fitting import sweep as module
from gmwm_jax.inference._submodels import common_superset, submodels, text_of
from gmwm_jax.inference.selection import tangents

SUPERSET = "WN + QN + RW + GM"


@pytest.fixture(scope="module")
def data():
    return drawn_channels(FAINT, LARGE, 3, 1)


@pytest.fixture(scope="module")
def selection(data):
    return gj.select(data["0"], SUPERSET)


# -- which models ------------------------------------------------------------------------------------------------------


def test_all_submodels_once():
    superset = gj.parse_model("3*GM + WN + QN + RW + DR")
    names = [text_of(gj.Composite([superset.processes[i] for i in s])) for s in submodels(superset)]
    assert len(names) == len(set(names)) == 4 * 2**4 - 1
    assert names[0] == "GM"
    assert names[-1] == "3*GM + WN + QN + RW + DR"


def test_held_components():
    """One held altogether is in all; one with a held shape is another than a free one."""
    superset = gj.parse_model("WN(sigma2=2.0 fixed) + GM(beta=0.1 fixed) + 2*GM")
    names = [text_of(gj.Composite([superset.processes[i] for i in s])) for s in submodels(superset)]
    assert len(names) == 2 * 3
    assert all("WN(sigma2=2 fixed)" in n for n in names)
    assert "WN(sigma2=2 fixed) + GM(beta=0.1 fixed) + GM" in names


def test_common_superset():
    superset, subsets = common_superset([gj.parse_model(m) for m in ("WN + GM", "RW + 2*GM", "QN")])
    assert text_of(superset) == "WN + 2*GM + RW + QN"
    assert [text_of(gj.Composite([superset.processes[i] for i in s])) for s in subsets] == [
        "WN + GM",
        "2*GM + RW",
        "QN",
    ]


# -- their fits --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("model", ["WN + RW", "WN + GM", "QN + RW + GM", SUPERSET])
def test_a_candidate_is_a_fit(data, selection, model):
    alone = gj.fit(data["0"], model, weights=selection.superset.omega)
    ours = selection[model].fit
    assert ours.objective == pytest.approx(alone.objective, rel=1e-9)
    np.testing.assert_allclose(ours.fitted, alone.fitted, rtol=1e-6)
    assert ours.at_boundary == alone.at_boundary
    assert ours.status is alone.status is gj.fitting.Status.converged


def test_nested_models_never_fit_better(selection):
    kinds = {c.name: Counter(p.kind for p in gj.parse_model(c.name).processes) for c in selection.values()}
    pairs = [(a, b) for a in selection for b in selection if a != b and kinds[a] <= kinds[b]]
    assert len(pairs) > 20
    for small, large in pairs:
        assert selection[large].objective <= selection[small].objective * (1 + 1e-9)


def test_tangents_are_the_derivative(selection):
    fit = selection["WN + GM"].fit
    eta, columns = np.asarray(fit.model.unconstrained()), []
    for i in fit.active:
        h = np.zeros(len(eta))
        h[i] = 1e-5
        up, down = (
            np.asarray(fit.model.with_unconstrained(jnp.asarray(e)).wavelet_variance(fit.wv.scales))
            for e in (eta + h, eta - h)
        )
        columns.append((up - down) / 2e-5)
    np.testing.assert_allclose(tangents(fit), np.stack(columns, axis=1), rtol=1e-7, atol=1e-9)


@pytest.mark.slow
def test_second_selection_compiles_nothing(data, selection):
    before = module._minimise_all._cache_size()
    gj.select(data["1"], SUPERSET)
    assert module._minimise_all._cache_size() == before


# -- the ranking -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_numbers_of_a_candidate(selection):
    best = selection.best
    assert best.difference == best.standard_error == 0
    assert selection.candidates[0] is best
    sound = [c for c in selection.candidates if c.sound]
    assert [c.criterion for c in sound] == sorted(c.criterion for c in sound)
    for c in sound:
        assert c.criterion == pytest.approx(c.objective + 2 * c.num_parameters)  # weights of the covariance
        assert c.difference == pytest.approx(c.criterion - best.criterion)
        if c.worse_than:  # of weights that are the inverse covariance the objective is the chi-square itself
            assert c.p_value == pytest.approx(chdtrc(c.fit.wv.num_scales - c.num_parameters, c.objective), abs=1e-6)
        else:
            assert c.p_value == pytest.approx(gj.goodness_of_fit(c.fit).p_value, rel=1e-6)
    assert selection["GM + WN"].fit is selection["WN + GM"].fit
    assert selection["WN + RW"].p_value < 1e-6
    assert selection["WN + RW"].worse_than


def test_a_model_with_nothing_in_a_component_is_the_smaller_one():
    """Less variance than that of white noise at both ends: neither QN nor RW, and the larger models take no part."""
    wv = gj.wavelet_variance(np.asarray(gj.simulate("WN(sigma2=1.0)", 5000, key=jax.random.key(3))))
    exact = 1.0 / wv.scales * np.array([0.99, *np.ones(wv.num_scales - 2), 0.8])
    wv = replace(wv, variance=exact, ci_low=0.9 * exact, ci_high=1.1 * exact)
    s = gj.select(wv, "WN + RW + QN")
    assert s.recommended.name == s.best.name == "WN"
    assert {s["WN + RW"].contained_in, s["WN + QN"].contained_in, s["WN + RW + QN"].contained_in} == {"WN"}
    assert "3 more have a component at zero" in repr(s)


@pytest.mark.slow
def test_a_weak_random_walk_is_not_left_out():
    """Predicted as well without it, but then the longest spans scatter far too little: the model's own test says so.

    Of a record that shows it and of one that does not; more are drawn in tests/validation.
    """
    wv = drawn_channels(FAINT + gj.RW(1e-7), LARGE, 6, 5)
    shows, hides = (gj.select(wv[i], SUPERSET) for i in range(2))
    assert shows["WN + GM"].p_value < 0.01 <= shows.recommended.p_value
    assert shows.recommended is shows["WN + GM + RW"]
    assert hides["WN + GM"].p_value >= 0.01
    assert hides.recommended.p_value >= 0.01


@pytest.mark.slow
def test_optimism_by_replicates(data):
    """Near to twice the number of parameters, as far as 20 replicates can tell; more are drawn in tests/validation."""
    told = Told()
    s = gj.select(data["2"], SUPERSET, num_replicates=20, key=jax.random.key(4), progress=told)
    told.assert_whole(15 * (1 + 20 + 1))
    c = s["WN + GM"]
    assert 0 < c.optimism < 6 * c.num_parameters
    assert s.num_replicates == 20
    assert "20 replicates" in repr(s)


# -- the result --------------------------------------------------------------------------------------------------------


def test_text_and_json(data, selection):
    shown = repr(selection)
    assert "15 models within WN + QN + RW + GM, covariance weights" in shown
    assert shown.count("recommended") == 1
    out = json.loads(json.dumps(selection.to_dict(), allow_nan=False))
    assert out["recommended"] == selection.recommended.name
    assert len(out["candidates"]) == 15
    several = gj.fitting.Channels({"a": selection, "b": selection})
    assert list(several) == ["a", "b"]
    assert several["a"] is several[1] is selection
    assert "Model selections, of 15 models each" in repr(several)
    with pytest.raises(KeyError, match="No channel '7'"):
        several["7"]


@pytest.mark.slow
def test_progress_is_told_and_cancels(data, selection):
    told = Told()
    same = gj.select(data["0"], SUPERSET, progress=told)
    assert repr(same) == repr(selection)
    told.assert_whole(15 * 2, at_least=10)
    with pytest.raises(LookupError, match="enough"):
        gj.select(data["0"], SUPERSET, progress=Told(20))


def test_figure(selection):
    figure = selection.plot()
    assert_shows(figure, gj.plotting.selection_data(selection))
    ax = figure.axes[0]
    assert "WVIC" in ax.get_xlabel()
    assert selection.recommended.name in " ".join(t.get_text() for t in ax.get_yticklabels())


def test_bad_input(data, selection):
    wv = data["0"]
    with pytest.raises(ValueError, match="nothing to choose from"):
        gj.select(wv, "WN")
    with pytest.raises(ValueError, match="nothing to choose from"):
        gj.select(wv, "WN + GM", nested=False)
    with pytest.raises(ValueError, match="the same"):
        gj.select(wv, ["WN + GM", "GM + WN"], nested=False)
    with pytest.raises(ValueError, match="cannot be told apart"):
        gj.select(wv, "2*WN + GM")
    with pytest.raises(ValueError, match="two parametrisations"):
        gj.select(wv, ["WN + GM", "WN + AR1"])
    with pytest.raises(ValueError, match="free parameters"):
        gj.select(wv, "9*GM")
    with pytest.raises(ValueError, match="need a key"):
        gj.select(wv, "WN + RW", num_replicates=50)
    with pytest.raises(ValueError, match="too few"):
        gj.select(wv, "WN + RW", num_replicates=5, key=jax.random.key(0))
    with pytest.raises(TypeError, match="key"):
        gj.select(wv, "WN + RW", num_replicates=50, key=3)
    table = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    with pytest.raises(ValueError, match="Criteria need the covariance"):
        gj.select(table, "WN + RW")
    with pytest.raises(KeyError, match="no candidate"):
        selection["WN + DR"]
    with pytest.raises(ValueError, match="SIN"):
        gj.select(wv, "WN + SIN", weights=None)
