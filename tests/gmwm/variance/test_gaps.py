"""Wavelet variance with missing samples: against its definition, its covariance and intervals, and all doors to it."""

import jax
import numpy as np
import pytest
import scipy.linalg
from helpers import assert_mean

import gmwm_jax as gj
from gmwm_jax.variance import gap_covariance as theory
from gmwm_jax.variance.blocked import host_wavelet_variance
from gmwm_jax.variance.gaps import find_pairs, gap_wavelet_variance, quadratic_forms_times, white_widening
from gmwm_jax.variance.haar import degrees_of_freedom, interval_factors, scales


def scattered(num, share, seed=0):
    return np.random.default_rng(seed).random(num) >= share


def blocks(num, share, length=40, seed=0):
    """Samples missing in blocks."""
    gone = np.random.default_rng(seed).choice(num // length, round(share * num / length), replace=False)
    return ~np.isin(np.arange(num) // length, gone)


def brute_force(x, present, level):
    """nu_j^2 from the MODWT's weight of each pair, counted window by window, and moved to unbiasedness lag by lag."""
    num, tau = len(x), 2**level
    h = np.repeat([1.0, -1.0], tau // 2) / tau
    M = num - tau + 1
    U = np.zeros((num, num))
    for start in range(M):
        U[start : start + tau, start : start + tau] += np.outer(h, h)
    inside = np.correlate(h, h, "full")[tau - 1 :]
    total = 0.0
    for k in range(1, tau):
        there = present[k:] & present[:-k]
        D = inside[k] - np.diagonal(U, k)[there]
        weight = inside[k] / np.sum(there) + (np.mean(D) - D) * (num - k) / (M * np.sum(there))
        total -= np.sum(weight * (x[k:] - x[:-k])[there] ** 2)
    return total


def with_gaps(x, present):
    return np.where(present, x, np.nan)


# -- the estimator ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("present", [scattered(90, 0.2), blocks(90, 0.2, 6), scattered(90, 0.0)])
def test_the_variance_by_pairs_is_its_definition(present):
    x = np.random.default_rng(1).standard_normal(90).cumsum()
    pairs = find_pairs(present)
    nu = gap_wavelet_variance(np.stack([x, 3 * x[::-1]]), pairs)
    expected = [brute_force(x, present, j) for j in range(1, pairs.num_levels + 1)]
    np.testing.assert_allclose(nu[0], expected, rtol=1e-10)
    expected = [9 * brute_force(x[::-1], present, j) for j in range(1, pairs.num_levels + 1)]
    np.testing.assert_allclose(nu[1], expected, rtol=1e-10)


@pytest.mark.parametrize("num", [64, 1000, 4097])
def test_nothing_missing_is_the_modwt(num):
    x = 1e4 + np.random.default_rng(num).standard_normal(num).cumsum()
    J = num.bit_length() - 1  # one more level than usual
    pairs = find_pairs(np.ones(num, dtype=bool), J)
    np.testing.assert_allclose(gap_wavelet_variance(x[None], pairs)[0], host_wavelet_variance(x, J), rtol=1e-9)
    np.testing.assert_allclose(white_widening(pairs)[: J - 4], 1.0, atol=0.02)


@pytest.mark.parametrize("present", [scattered(512, 0.2), blocks(512, 0.25)], ids=["scattered", "blocks"])
def test_the_variance_by_pairs_is_unbiased(present, key):
    model = gj.WN(1.0) + gj.RW(0.02)
    records = np.asarray(jax.vmap(lambda k: gj.simulate(model, 512, key=k))(jax.random.split(key, 1000)))
    nu = gap_wavelet_variance(records, find_pairs(present))
    assert_mean(nu, np.asarray(model.wavelet_variance(scales(nu.shape[1]))))


def test_a_lag_without_a_pair_ends_the_scales():
    two_blocks = (np.arange(64) < 16) | (np.arange(64) >= 48)  # no pair at lags 16 .. 32
    assert find_pairs(two_blocks).num_levels == 4
    with pytest.raises(ValueError, match=r"No two of the 32 samples .* lie 16 samples apart: there are 4 levels, and"):
        find_pairs(two_blocks, 5)
    with pytest.raises(ValueError, match="lie 1 samples apart: there are 0 levels"):
        find_pairs(np.arange(64) % 2 == 0)


# -- how sure it is --------------------------------------------------------------------------------------------------


def matrices(present):
    """Q_j, dense, from products with unit vectors: they are x' Q_j x by the test of the definition."""
    return [np.array(Q) for Q in quadratic_forms_times(np.eye(len(present)), find_pairs(present))]


@pytest.mark.parametrize("present", [scattered(300, 0.1), scattered(300, 0.5), blocks(300, 0.2, 20)])
def test_the_widening_for_white_noise(present):
    """Against dense matrices; the ends, which it takes by their mean, matter at the two longest spans."""
    Q = matrices(present)
    V = np.asarray(gj.variance.wv_covariance(gj.WN(1.0), 300, len(Q)))
    expected = [2 * np.sum(q**2) / v for q, v in zip(Q, np.diag(V), strict=True)]
    seen = white_widening(find_pairs(present))
    np.testing.assert_allclose(seen[:-2], expected[:-2], rtol=0.06)
    np.testing.assert_allclose(seen[-2:], np.maximum(expected[-2:], 1), rtol=0.3)


def covariance_matrix(model, num):
    t = np.arange(num)
    lag = np.abs(t[:, None] - t)
    S = np.zeros((num, num))
    for p in model.processes:
        if p.kind == "RW":
            S += float(p.amplitude) * np.minimum.outer(t + 1.0, t + 1.0)
        elif p.kind != "DR":
            S += np.asarray(p.autocovariance(lag.astype(float)))
    return S


@pytest.mark.parametrize(
    ("text", "present"),
    [
        ("WN(sigma2=2.0) + RW(gamma2=0.05)", scattered(300, 0.1)),
        ("WN(sigma2=2.0) + RW(gamma2=0.05)", blocks(300, 0.2, 20)),
        ("QN(q2=1.0)", scattered(300, 0.1)),
    ],
)
def test_covariance_against_dense_matrices(text, present):
    """2 tr(Q Sigma Q Sigma). The sum over frequencies is put to the test by the columns of a root of Sigma as draws."""
    model, Q = gj.parse_model(text), matrices(present)
    S = covariance_matrix(model, 300)
    expected = np.array([[2 * np.trace(a @ S @ b @ S) for a in Q] for b in Q])
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    pairs = find_pairs(present)
    root = theory._root_of_spectrum(model, pairs.size)
    exact = 2 * theory._gram(quadratic_forms_times(np.linalg.cholesky(S + 1e-12 * np.eye(300)).T, pairs), root)
    assert np.max(np.abs(exact - expected) / size) < 1e-3
    seen = theory.gap_covariance(model, pairs)
    assert np.max(np.abs(seen - expected) / size) < 0.06
    assert scipy.linalg.eigvalsh(seen / size)[0] > 0


@pytest.mark.slow
def test_covariance_with_a_drift_and_without_gaps():
    present, noise = scattered(200, 0.1), gj.WN(1.0) + gj.GM(0.1, 1.0)
    Q, S = matrices(present), covariance_matrix(noise, 200)
    pairs = find_pairs(present)
    mu = 0.05 * np.arange(1, 201)
    expected = [[4 * mu @ a @ S @ b @ mu for a in Q] for b in Q]
    seen = theory.gap_covariance(noise + gj.DR(0.05), pairs) - theory.gap_covariance(noise, pairs)
    np.testing.assert_allclose(seen, expected, rtol=5e-3, atol=5e-3 * np.max(expected))
    complete = theory.gap_covariance(noise, find_pairs(np.ones(200, dtype=bool)))
    np.testing.assert_allclose(complete, np.asarray(gj.variance.wv_covariance(noise, 200)), rtol=1e-8, atol=1e-11)


@pytest.mark.slow
def test_gaps_widen_intervals_as_the_theory_says():
    """Half of the samples of white noise: 3.5 times the variance at the shortest span, twice that of all scales taken
    together, which is what half of the information costs.
    """
    x, present = np.random.default_rng(0).standard_normal(20_000), scattered(20_000, 0.5)
    complete, gappy = gj.wavelet_variance(x), gj.wavelet_variance(with_gaps(x, present), gaps="pairs")
    pairs = find_pairs(present)
    short = np.cumsum(gappy.variance) / (gappy.scales - 1) / gappy.variance
    J = gappy.num_scales
    w = 1 + (white_widening(pairs)[:J] - 1) * np.maximum(short**2, 1)
    low, _ = interval_factors(np.maximum(degrees_of_freedom(20_000, J) / w, 1))
    np.testing.assert_allclose(gappy.ci_low, gappy.variance * low, rtol=1e-11)
    fits = [gj.fit(wv, "WN") for wv in (complete, gappy)]
    widths = [np.sqrt(f.covariance[0, 0]) for f in fits]
    assert 0.97 * np.sqrt(2) < widths[1] / widths[0] < np.sqrt(3.5)


# -- the doors ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gappy():
    """Two channels, of which only the second has gaps; the first samples of it are missing."""
    x = np.random.default_rng(3).standard_normal((3000, 2))
    x[:, 1] = with_gaps(x[:, 1], scattered(3000, 0.1) & (np.arange(3000) > 5))
    return x


def test_every_way_in_is_the_same(gappy, tmp_path):
    expected = gj.wavelet_variance(gappy[:, 1], gaps="pairs", rate=10.0)
    masked = np.ma.masked_invalid(gappy[:, 1])
    recording = gj.Recording.from_array(gappy, rate=10.0, units="1", channels=["a", "b"], gaps=True)
    blocks_of_it = (gappy[i : i + 700, 1] for i in range(0, 3000, 700))
    several = gj.wavelet_variance(recording)
    for seen in (
        gj.wavelet_variance(masked, gaps="pairs", rate=10.0),
        gj.wavelet_variance(blocks_of_it, gaps="pairs", rate=10.0, scratch=tmp_path),
        gj.wavelet_variance(recording["b"]),
        several["b"],
    ):
        np.testing.assert_array_equal(seen.variance, expected.variance)
        np.testing.assert_array_equal(seen.ci_low, expected.ci_low)
        np.testing.assert_array_equal(seen.present, ~np.isnan(gappy[:, 1]))
    a = gj.wavelet_variance(gappy[:, 0], rate=10.0)
    np.testing.assert_allclose(several["a"].variance, a.variance[: several.num_scales], rtol=1e-9)
    missing = int(np.sum(np.isnan(gappy)))
    assert f"3000 samples ({missing} missing, {missing / 30:.3g} %) at 10 Hz" in repr(expected)
    assert f"(0 to {missing} missing, up to" in repr(several)
    complete = gj.wavelet_variance(gappy[:, 0], gaps="pairs")
    assert complete.present is None
    np.testing.assert_array_equal(complete.variance, a.variance)


@pytest.mark.slow
def test_a_fit_knows_the_gaps(gappy):
    wv = gj.wavelet_variance(gappy[:, 1], gaps="pairs", rate=10.0)
    fit = gj.fit(wv, "WN", weights="covariance")
    assert "samples (" in fit.summary()
    assert "missing" in fit.summary()
    e = fit.parameters()["WN", "sigma2"]
    assert e.ci_low < 1 < e.ci_high
    # with all of the covariance as weights nearly what the samples hold: sqrt(2/number of them)
    assert np.log(e.ci_high / e.ci_low) / 2 / 1.96 == pytest.approx(np.sqrt(2 / np.sum(wv.present)), rel=0.1)
    assert gj.goodness_of_fit(fit).p_value > 1e-3
    slopes = gj.fitting.slope_regression(gj.allan_deviation(wv), {"WN": (0.1, 10.0)})
    assert slopes.table["WN", "N"].ci_low > 0


def test_replicates_leave_out_what_is_missing():
    """Eight records and eight refits; how they scatter, and how often intervals cover, is in tests/validation."""
    present = scattered(500, 0.4)
    x = np.random.default_rng(3).standard_normal(500)
    fit = gj.fit(gj.wavelet_variance(with_gaps(x, present), gaps="pairs", num_levels=4), "WN")
    boot = gj.bootstrap(fit, 8, key=jax.random.key(1), route="records")
    assert boot.num_failed == 0
    assert boot.variances.shape == (8, 4)
    np.testing.assert_allclose(boot.variances[:, 0].mean(), fit.fitted[0], rtol=0.2)
    np.testing.assert_allclose(boot.good[:, 0], boot.variances[:, 0] * 2, rtol=0.3)


def test_a_recording_with_gaps(gappy, tmp_path):
    recording = gj.Recording.from_array(gappy, rate=10.0, units="deg/s", channels=["a", "b"], gaps=True)
    missing = int(np.sum(np.isnan(gappy)))
    assert recording.num_missing == {"a": 0, "b": missing}
    assert repr(recording).splitlines()[-1].endswith(f" {missing}")
    back = gj.read_recording(gj.save_recording(recording, tmp_path / "x.npz"))
    assert back.gaps
    np.testing.assert_array_equal(back.data, recording.data)
    np.savetxt(tmp_path / "x.csv", gappy[:50], delimiter=",")
    read = gj.read_recording(tmp_path / "x.csv", rate=10.0, units="1", gaps="nan")
    np.testing.assert_array_equal(read.data, gappy[:50])
    with pytest.raises(ValueError, match=r"NaN.*at index.*gaps=\"nan\".*gaps=\"longest\""):
        gj.read_recording(tmp_path / "x.csv", rate=10.0, units="1")


def test_the_figure_of_a_recording_with_gaps():
    """A long one is drawn as bins: their mean is that of the samples there, and there is none in an outage."""
    x = 1 + np.arange(20_000) % 2.0
    x[:9000:2] = np.nan
    x[9000:15_000] = np.nan
    figure = gj.Recording.from_array(x, rate=1.0, units="1", gaps=True).plot()
    mean = figure.axes[0].lines[0].get_ydata()
    middle = np.linspace(0, 20_000, len(mean))
    np.testing.assert_allclose(mean[middle < 8900], 2.0)
    assert np.all(np.isnan(mean[(middle > 9100) & (middle < 14_900)]))
    np.testing.assert_allclose(mean[middle > 15_100], 1.5)


def test_bad_input(gappy):
    x = gappy[:, 1]
    with pytest.raises(ValueError, match=r"NaN or infinite, the first .* at index 0.*gaps=\"pairs\""):
        gj.wavelet_variance(x)
    with pytest.raises(ValueError, match=r"gaps is None .* and is 'skip'"):
        gj.wavelet_variance(x, gaps="skip")
    with pytest.raises(ValueError, match="MODWT: leave method out, or gaps"):
        gj.wavelet_variance(x, gaps="pairs", method="dwt")
    with pytest.raises(ValueError, match="complete record: leave efficiency out"):
        gj.wavelet_variance(x, gaps="pairs", efficiency=0.6)
    with pytest.raises(ValueError, match="All 20 samples of x are missing"):
        gj.wavelet_variance(np.full(20, np.nan), gaps="pairs")
    with pytest.raises(ValueError, match=r"x is infinite at 1 samples, the first at index 7"):
        gj.wavelet_variance(np.where(np.arange(3000) == 7, np.inf, x), gaps="pairs")
    with pytest.raises(ValueError, match="x does not change"):
        gj.wavelet_variance(np.where(np.isnan(x), x, 4.2), gaps="pairs")
    with pytest.raises(ValueError, match="at least 4 samples, and the record has 3"):
        gj.wavelet_variance(np.array([1.0, np.nan, 2.0, 0.0]), gaps="pairs")
    alternating = np.arange(2048) % 2.0 + 1e-9 * np.random.default_rng(0).standard_normal(2048)
    alternating[~scattered(2048, 0.3)] = np.nan
    with pytest.raises(ValueError, match=r"the span of \d+ samples is not positive.*levels, and not 9"):
        gj.wavelet_variance(alternating, gaps="pairs", num_levels=9)
    data = np.where(np.isnan(gappy), np.nan, np.array([1.0, 2.0]) + np.array([1.0, 0.0]) * gappy)
    with pytest.raises(ValueError, match="channel 'b' is constant"):
        gj.Recording.from_array(data, rate=1.0, units="1", channels=["a", "b"], gaps=True)
