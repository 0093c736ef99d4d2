"""A fit says how well its model describes the data, and warns where it does not."""

import json
from dataclasses import replace

import numpy as np
import pytest
from programs import MEDIUM, drawn_channels, fitted, simulated

import gmwm_jax as gj
from gmwm_jax._internal.chi_square import chi_square, misses

WALK = gj.parse_model("WN(sigma2=1.0) + RW(gamma2=1e-6)")
"""A random walk that shows at the longest spans of `MEDIUM` samples only, or not at all."""


@pytest.fixture(scope="module")
def wrong():
    return gj.fit(simulated(), "WN")


def test_every_fit_prints_its_test_of_fit():
    fit = fitted()
    test = gj.goodness_of_fit(fit)
    j = int(np.argmax(np.abs(test.pulls)))
    lines = repr(fit).splitlines()
    assert "the search converged" in lines[1]
    assert lines[2] == (
        f"test of fit: chi-square {test.statistic:.4g} with {test.dof} degrees of freedom, p = {test.p_value:.2g}; "
        f"largest pull {test.pulls[j]:+.1f} at a span of {fit.wv.times[j]:.4g} s"
    )
    assert fit.misfit == ""
    assert "warning" not in repr(fit)


def test_a_misfit_is_said_before_the_estimates(wrong):
    text = repr(wrong)
    assert wrong.misfit.startswith("the model misses the data: the largest pull is ")
    assert text.index(f"warning: {wrong.misfit}") < text.index("Parameters per sample")
    assert "intervals assume that the model is right" in wrong.misfit


def test_a_misfit_is_in_all_that_leaves_a_fit(wrong):
    fits = gj.fitting.Channels({"x": wrong})
    assert f"warning: x: {wrong.misfit}" in repr(fits)
    content = json.loads(json.dumps(wrong.to_dict(), allow_nan=False))
    assert content["misfit"] == wrong.misfit
    assert content["test_of_fit"]["p_value"] < 1e-6
    assert abs(content["test_of_fit"]["largest_pull"]) == max(abs(p) for p in content["test_of_fit"]["pulls"])
    gyro = replace(wrong, wv=replace(wrong.wv, units=("rad/s",), channels=("gyro_x",)))
    comments = " ".join(line.lstrip("# ") for line in gyro.export("ros", step=0.01).splitlines())
    assert gyro.misfit in comments
    accel = replace(wrong, wv=replace(wrong.wv, units=("m/s^2",), channels=("accel_x",)))
    notes = [one["note"] for one in json.loads(gj.Fit.export_of([gyro, accel], "nav-jax"))]
    assert all(gyro.misfit in note for note in notes)


@pytest.mark.slow
def test_a_joint_fit_tests_the_mean_of_its_records():
    wv = simulated()
    for model, said in (("WN", True), ("WN + GM", False)):
        joint = gj.fit_records([wv, wv], model, weights="two-step")
        assert "test of fit of their mean: chi-square" in repr(joint)
        assert ("warning: the model misses the data" in repr(joint)) == said


def test_a_selection_of_wrong_models_says_where_its_winner_fails():
    selection = gj.select(simulated(), ["WN", "QN"], nested=False, weights="two-step")
    assert f"warning: {selection.recommended.fit.misfit}" in repr(selection)
    assert selection.recommended.fit.misfit


def test_without_theory_nothing_is_said(wrong):
    bare = replace(wrong, wv=replace(wrong.wv, num_samples=None))
    assert (bare.chi_square, bare.misfit) == (None, "")
    assert "test of fit" not in repr(bare)
    assert bare.to_dict()["test_of_fit"] is None


def test_a_model_with_as_many_parameters_as_scales_has_no_test():
    wv = gj.wavelet_variance(np.random.default_rng(0).standard_normal(MEDIUM), num_levels=1)
    assert "test of fit: none, every scale is fitted exactly" in repr(gj.fit(wv, "WN"))


def test_a_test_of_gamma_variables_is_of_their_own_tail():
    """Of one variance of two degrees of freedom: six times its mean is nothing, thirty times is a misfit."""
    V, none = np.eye(1), np.ones((1, 1))
    assert chi_square(np.array([5.0]), none, V).p_value < 1e-6
    assert not misses(np.array([5.0]), none, V, np.array([1.0]))
    assert misses(np.array([29.0]), none, V, np.array([1.0]))


@pytest.mark.slow
def test_p_is_of_the_model_and_not_of_weights_that_trust_the_small():
    """A random walk at zero by default weights, which all but one scale miss; of the same data by other weights too."""
    wv = drawn_channels(gj.parse_model("WN(sigma2=1.0) + RW(gamma2=1e-6)"), MEDIUM, 60, 17)
    fits = {name: list(gj.fit(wv, "WN + RW", weights=name, throw=False).values()) for name in ("default", "covariance")}
    apart = []
    for mine, best in zip(*fits.values(), strict=True):
        again, _ = mine._again
        assert mine.chi_square.dof == mine.wv.num_scales - len(again.active)
        apart.append((mine.chi_square.p_value < 0.01, best.chi_square.p_value < 0.01))
        plain = chi_square(*mine._residuals, mine.wv_covariance)
        np.testing.assert_array_equal(mine.chi_square.pulls, plain.pulls)
    assert np.max(np.sum(apart, axis=0)) <= 2
    assert np.sum([chi_square(*f._residuals, f.wv_covariance).p_value < 0.01 for f in fits["default"]]) > 4
