"""Intervals of variances at their nominal level: degrees of freedom, what is said of them, and robust warnings."""

import jax
import numpy as np
import pytest
from programs import MEDIUM, RATE, TRUTH, blank, simulated, white

import gmwm_jax as gj
from gmwm_jax.variance.haar import scales
from gmwm_jax.variance.power_law import (
    ALLAN,
    HADAMARD,
    MODIFIED_ALLAN,
    degrees_of_freedom_of_laws,
    local_degrees_of_freedom,
)

LAWS = {0: "QN(q2=1.0)", 1: "WN(sigma2=1.0)", 3: "RW(gamma2=1.0)"}


@pytest.mark.parametrize("law", LAWS)
def test_degrees_of_freedom_are_those_of_the_exact_covariance(law):
    """To 4e-4: between the lags that are taken, Simpson's rule."""
    levels = blank(MEDIUM).num_scales
    m, model = scales(levels) / 2, gj.parse_model(LAWS[law])
    V = np.diag(gj.variance.wv_covariance(model, MEDIUM, levels))
    exact = 2 * np.asarray(model.wavelet_variance(2 * m)) ** 2 / V
    np.testing.assert_allclose(degrees_of_freedom_of_laws(ALLAN, MEDIUM, m)[:, law], exact, rtol=4e-4)


@pytest.mark.parametrize(
    ("statistic", "difference", "averaged"),
    [(ALLAN, [1, -2, 1], False), (MODIFIED_ALLAN, [1, -2, 1], True), (HADAMARD, [1, -3, 3, -1], False)],
)
def test_degrees_of_freedom_are_those_of_a_quadratic_form(statistic, difference, averaged):
    """(tr G)^2/tr G^2 of the covariance of all differences of the phase, as matrices."""
    N, m = 200, np.array([1, 4, 32])
    laws = degrees_of_freedom_of_laws(statistic, N, m.astype(float))
    for n, found in zip(m, laws, strict=True):
        taps = np.zeros((len(difference) - 1) * n + 1)
        taps[::n] = difference
        taps = np.convolve(taps, np.ones(n)) if averaged else taps
        num = N + 2 - len(taps)
        assert num == statistic.num_terms(N, np.array([float(n)]))
        of_phase = np.stack([np.concatenate([np.zeros(k), taps, np.zeros(num - 1 - k)]) for k in range(num)])
        walk = np.tril(np.ones((N, N)))
        of_samples = of_phase @ np.vstack([np.zeros(N), walk])
        for law, form in {0: of_phase, 1: of_samples, 3: of_samples @ walk}.items():
            G = form @ form.T
            assert found[law] == pytest.approx(np.trace(G) ** 2 / np.sum(G * G), rel=1e-9)


def test_flicker_noise_lies_between_white_noise_and_a_random_walk():
    for statistic in (ALLAN, MODIFIED_ALLAN, HADAMARD):
        laws = degrees_of_freedom_of_laws(statistic, MEDIUM, scales(12) / 2)
        assert np.all(laws[3:, 3] < laws[3:, 2])
        assert np.all(laws[3:, 2] < laws[3:, 1])


def test_a_pure_law_is_recognised():
    """The variances of theory have the slope of the law, but for the margin against chance."""
    m = scales(10) / 2
    laws = degrees_of_freedom_of_laws(ALLAN, MEDIUM, m)
    for law, text in LAWS.items():
        nu = np.asarray(gj.parse_model(text).wavelet_variance(2 * m))
        found = local_degrees_of_freedom(ALLAN, MEDIUM, m, nu)
        np.testing.assert_allclose(found[2:8], laws[2:8, law], rtol=0.2)
        assert np.all(found <= laws[:, law] * 1.03)


@pytest.mark.slow
def test_bands_are_chi_square_and_narrower_than_those_of_weights():
    wv = simulated()
    fit = gj.fit(wv, "WN + GM", weights="two-step")
    for band, basis in ((wv.bands(), "local power law"), (wv.bands(fit.model), "WN + GM")):
        assert (band.basis, band.level, band.nominal) == (basis, 0.95, True)
        assert np.all((wv.ci_low < band.low) & (band.low < wv.variance))
        assert np.all((wv.variance < band.high) & (band.high < wv.ci_high))
    np.testing.assert_allclose(fit.shown.high, wv.bands(fit.model).high)
    exact = 2 * np.asarray(TRUTH.wavelet_variance(wv.scales)) ** 2 / np.diag(wv.covariance_under(TRUTH))
    np.testing.assert_allclose(wv.bands().dof, exact, rtol=0.35)
    assert np.all(wv.bands(level=0.5).high < wv.bands().high)


def test_weights_of_fits_stay_as_they_were():
    """Nothing of a fit changes: its weights are from ci_low and ci_high, which are R's."""
    wv = simulated()
    eta = np.maximum((MEDIUM - wv.scales + 1) / wv.scales, 1)
    np.testing.assert_allclose(wv.ci_high, wv.variance * gj.variance.haar.interval_factors(eta)[1])


def test_an_allan_deviation_has_the_same():
    adev = gj.allan_deviation(simulated())
    np.testing.assert_allclose(adev.bands().high ** 2 / 2, simulated().bands().high)
    assert "intervals at their nominal level, dof of the local power law" in repr(adev)


def test_what_an_interval_is_is_said():
    wv = simulated()
    assert "intervals at their nominal level, dof of the local power law" in repr(wv)
    bare = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    assert "intervals of the weights of fits, wider than their level says" in repr(bare)
    np.testing.assert_array_equal(bare.shown.high, bare.ci_high)
    assert gj.fit(wv, "WN").to_dict()["dof_of"] == "fitted model"


def test_what_has_no_band_says_so():
    wv = simulated()
    bare = gj.variance.WaveletVariance.from_table(wv.scales, wv.variance, wv.ci_low, wv.ci_high)
    with pytest.raises(ValueError, match="need the number of samples"):
        bare.bands()
    with pytest.raises(ValueError, match="need its theory"):
        bare.bands(TRUTH)
    several = gj.wavelet_variance(white(2 * MEDIUM).reshape(-1, 2), rate=RATE)
    with pytest.raises(ValueError, match="A model belongs to one channel"):
        several.bands(TRUTH)
    assert several.bands().low.shape == several.variance.shape


def test_a_record_with_gaps_has_bands_under_a_model():
    x = white(2000)
    x[300:320] = np.nan
    wv = gj.wavelet_variance(x, gaps="pairs")
    with pytest.raises(ValueError, match=r"a model of one channel: wv\.bands\(fit\.model\)"):
        wv.bands()
    assert wv.bands(gj.parse_model("WN(sigma2=1.0)")).nominal
    assert not wv.shown.nominal


def test_a_robust_band_is_wider():
    x = white(MEDIUM)
    classic, robust = gj.wavelet_variance(x), gj.wavelet_variance(x, efficiency=0.6)
    assert np.all(robust.bands().dof[:8] < classic.bands().dof[:8])


# -- a robust variance that lies far below ----------------------------------------------------------------------------


def test_a_robust_variance_far_below_the_classic_one_is_warned_of(tmp_path):
    x = white(MEDIUM)
    x[7::2000] += 300.0
    wv = gj.wavelet_variance(x, efficiency=0.6, rate=RATE)
    (said,) = wv.warnings
    ratio = wv.classic / wv.variance
    j = int(np.argmax(ratio))
    assert f"is {ratio[j]:.3g} times below the classic one at a span of {wv.times[j]:.4g} s" in said
    assert f"warning: {said}" in repr(wv)
    assert said in gj.load(wv.save(tmp_path / "robust.json")).warnings
    fit = gj.fit(wv, "WN", throw=False)
    assert f"warning: {said}" in repr(fit)


def test_a_clean_record_is_not_warned_of():
    assert gj.wavelet_variance(white(MEDIUM), efficiency=0.6).warnings == ()
    assert gj.wavelet_variance(white(MEDIUM)).warnings == ()


@pytest.mark.slow
def test_the_root_that_few_degrees_of_freedom_have_misled(shared):
    """At level 18 of the x accelerometer of a real unit the robust root is 18 times below the classic variance."""
    rec = gj.read_recording(shared / "data" / "adis_16405_imu1.rda")["accel_x"]
    (said,) = gj.wavelet_variance(rec, efficiency=0.6).warnings
    assert "accel_x is 17.6 times below the classic one at a span of 2621 s" in said


@pytest.mark.slow
def test_a_walk_on_a_real_gyro_is_a_misfit(shared):
    """White noise and a random walk have an N with an interval of 0.15 %, and miss the data by tens of sigmas."""
    rec = gj.read_recording(shared / "data" / "adis_16405_imu1.rda")["gyro_x"]
    fit = gj.fit(rec, "WN + RW")
    assert np.nanmax(np.abs(fit.chi_square.pulls)) > 30
    assert fit.misfit in repr(fit)


def test_bands_of_several_channels():
    """They are those of each."""
    x = np.asarray(jax.random.normal(jax.random.key(3), (MEDIUM, 2)))
    both = gj.wavelet_variance(x)
    np.testing.assert_allclose(both.bands().high[:, 1], both[1].bands().high, rtol=1e-12)
