"""Influence of scales, weights, samples and minutes: against finite differences, and against refitting by `fit`."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from drawn import assert_shows
from helpers import assert_same_result

import gmwm_jax as gj
from gmwm_jax.variance.haar import haar_wavelet_variance

MODEL = "WN + GM"
RATE = 20.0


@pytest.fixture(scope="module")
def rec():
    x = gj.simulate(gj.WN(1.0) + gj.GM(0.03, 0.2), 20_000, key=jax.random.key(1))
    return gj.Recording.from_array(np.asarray(x), rate=RATE, units="rad/s", channels=["gyro_x"])


@pytest.fixture(scope="module")
def found(rec):
    return gj.fitting.influence(rec, MODEL)


@pytest.fixture(scope="module")
def of_variance(found):
    """A fit to another wavelet variance, with the intervals that go with it."""

    def refit(nu, weights=None):
        wv, ratio = found.wv, nu / found.wv.variance
        there = replace(wv, variance=nu, ci_low=wv.ci_low * ratio, ci_high=wv.ci_high * ratio)
        return values(gj.fit(there, MODEL, weights=weights))

    return refit


def values(fit):
    return np.array([v for p in fit.model.processes for v in p.values])


def weights_of(wv):
    return 1 / (wv.ci_high - wv.ci_low) ** 2


@pytest.mark.slow
def test_the_estimates_are_those_of_the_fit(found, rec):
    np.testing.assert_allclose(found.values, values(gj.fit(rec, MODEL)), rtol=1e-8)
    assert found.names == ("WN sigma2", "GM beta", "GM variance")


def test_by_variance_is_the_difference_of_refits(found, of_variance):
    nu, h = found.wv.variance, 1e-3
    for k in (0, 4, 9):
        d = np.zeros_like(nu)
        d[k] = h * nu[k]
        slope = (of_variance(nu + d) - of_variance(nu - d)) / (2 * h * nu[k])
        np.testing.assert_allclose(found.by_variance[:, k], slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())


def test_by_weights_is_the_difference_of_refits(found, of_variance):
    nu, w, h = found.wv.variance, weights_of(found.wv), 1e-2
    for k in (0, 4):
        scale = np.ones_like(w)
        scale[k] = 1 + h
        slope = (of_variance(nu, w * scale) - of_variance(nu, w / scale)) / (2 * np.log(1 + h))
        np.testing.assert_allclose(found.by_weights[:, k], slope, rtol=1e-3)


def test_elasticities_and_leverages_sum_to_what_they_must(found):
    """Of amplitudes to one, of times to none: in other units the variances are others, and nothing else is."""
    np.testing.assert_allclose(found.elasticities.sum(axis=1), [1.0, 0.0, 1.0], atol=1e-8)
    assert found.leverage.sum() == pytest.approx(3, abs=0.1)  # but for the curvature of what does not fit


@pytest.mark.slow
def test_by_sample_is_the_difference_of_refits(found, rec, of_variance):
    x = rec.data[:, 0].copy()
    slope = found.by_sample(rec)
    assert slope.shape == (3, len(x))
    np.testing.assert_allclose(slope @ x / found.values, [2.0, 0.0, 2.0], atol=1e-8)
    np.testing.assert_allclose(slope.sum(axis=1), 0.0, atol=1e-10)  # a constant changes nothing
    direction = np.zeros_like(x)
    direction[5000:5200] = 1.0
    h = 1e-3
    ends = [of_variance(np.asarray(haar_wavelet_variance(x + s * h * direction))) for s in (1, -1)]
    np.testing.assert_allclose(slope @ direction, (ends[0] - ends[1]) / (2 * h), rtol=1e-4)


def test_without_a_scale_is_the_fit_without_it(found, of_variance):
    w = weights_of(found.wv)
    for k in (0, 5, 12):
        kept = w.copy()
        kept[k] = 0.0
        refitted = of_variance(found.wv.variance, kept) - found.values
        np.testing.assert_allclose(found.without_scale[:, k], refitted, atol=1e-7 * np.abs(found.values).max())
    # to first order, of what matters; for models that are linear to all, see below
    large = np.abs(found.without_scale) > 0.1 * np.abs(found.without_scale).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found.without_scale_linear[large], found.without_scale[large], rtol=0.5)


def test_without_a_block_is_the_fit_without_it(found, rec, of_variance):
    assert found.block == 50.0  # a twentieth
    np.testing.assert_array_equal(found.block_times, 50.0 * np.arange(20))
    for b in (0, 7):
        refitted = of_variance(found.block_variances[b]) - found.values
        np.testing.assert_allclose(found.without_block[:, b], refitted, atol=1e-7 * np.abs(found.values).max())
    sums = gj.variance.block_sums(rec.data[:, 0], 1000)
    np.testing.assert_allclose(found.block_variances, sums.left_out, rtol=1e-12)
    large = np.abs(found.without_block) > 0.3 * np.abs(found.without_block).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found.without_block_linear[large], found.without_block[large], rtol=0.25)


def test_a_minute_that_was_touched_stands_out(rec):
    x = rec.data[:, 0].copy()
    x[7000:7100] += np.random.default_rng(3).normal(size=100) * 5
    touched = gj.fitting.influence(replace(rec, data=x[:, None]), MODEL)
    assert touched.without_block is not None
    change = touched.without_block[0] / touched.values[0]
    assert np.argmax(np.abs(change)) == 7
    assert change[7] < 0


def test_weights_given_and_values_held(found):
    model = gj.WN() + gj.GM(beta=gj.Fixed(0.03))
    given = gj.fitting.influence(found.wv, model, weights=weights_of(found.wv))
    assert given.names == ("WN sigma2", "GM variance")
    A = np.stack([gj.WN(1.0).wavelet_variance(found.wv.scales), gj.GM(0.03, 1.0).wavelet_variance(found.wv.scales)], 1)
    W = np.diag(weights_of(found.wv))
    # linear least squares, in which nothing is left to first order
    B = np.linalg.solve(A.T @ W @ A, A.T @ W)
    np.testing.assert_allclose(given.by_variance, B, rtol=1e-7, atol=1e-10 * np.abs(B).max())
    np.testing.assert_allclose(given.leverage, np.diag(A @ B), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(given.without_scale_linear, given.without_scale, rtol=1e-5, atol=1e-10)


@pytest.mark.slow
def test_a_component_at_zero_has_no_influence_and_no_elasticity(found):
    zero = gj.fitting.influence(found.wv, "WN + GM + RW")
    assert zero.values[3] == 0
    np.testing.assert_array_equal(zero.by_variance[3], 0.0)
    assert np.all(np.isnan(zero.elasticities[3]))
    assert "-" in repr(zero)


def test_it_prints_draws_and_saves_itself(found, tmp_path):
    text = repr(found)
    assert "WN + GM of gyro_x" in text
    assert "leverage" in text
    assert "from " in text
    assert_shows(found.plot(), gj.plotting.influence_data(found))
    only_scales = gj.fitting.influence(found.wv, MODEL)
    assert len(only_scales.plot().axes) == 1
    assert "without" in repr(only_scales)
    for result in (found, only_scales):
        assert_same_result(gj.load(result.save(tmp_path / "x.json")), result)
    d = found.to_xarray()
    assert d["elasticity"].sel(parameter="GM beta").shape == (found.wv.num_scales,)
    assert d["without_block"].dims == ("parameter", "block")


def test_what_it_refuses(found, rec):
    with pytest.raises(ValueError, match="no blocks of time"):
        gj.fitting.influence(found.wv, MODEL, block=10.0)
    with pytest.raises(ValueError, match="no blocks of time"):
        gj.fitting.influence(found.wv, MODEL).block_times  # noqa: B018
    with pytest.raises(ValueError, match="leaves nothing"):
        gj.fitting.influence(rec, MODEL, block=990.0)
    with pytest.raises(ValueError, match="takes one channel"):
        gj.fitting.influence(gj.datasets.simulated("mti-g", 2000), MODEL)
    with pytest.raises(TypeError, match=r"takes a Recording|parameter 'data'"):
        gj.fitting.influence(rec.data, MODEL)
    with pytest.raises(ValueError, match="20000 samples was fitted"):
        found.by_sample(rec.data[:100])
    x = rec.data.copy()
    x[50:60] = np.nan
    with pytest.raises(ValueError, match="complete record"):
        gj.fitting.influence(gj.Recording.from_array(x, rate=RATE, units="rad/s", gaps=True), MODEL)
    with pytest.raises(ValueError, match="free parameters"):
        gj.fitting.influence(found.wv, "WN + 8*GM")
