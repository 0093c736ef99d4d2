"""The robust wavelet variance against its definition, against R, and under outliers; how sure it is."""

import jax
import mpmath
import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
from gmwm.textbook import efficiency_that_r_calls, g, truncated_moment

import gmwm_jax as gj
from gmwm_jax.variance.haar import degrees_of_freedom, interval_factors
from gmwm_jax.variance.robust import biweight, robust_wavelet_variance, widening

EFFICIENCIES = (0.5, 0.6, 0.75, 0.95, 0.99)


def haar(x, level):
    """Coefficients by definition, from the sums of 2^(level-1) samples."""
    n = 2 ** (level - 1)
    sums = np.convolve(x, np.ones(n), "valid")
    return (sums[n:] - sums[:-n]) / (2 * n)


def by_bisection(W, efficiency):
    """The outermost fall of the mean of g through a, from a grid and Brent's method."""
    c, a, _ = biweight(efficiency)

    def excess(log_v):
        return np.mean(g(W / np.exp(log_v / 2), c)) - a

    grid = np.log(np.median(W**2)) + np.linspace(-3, 3, 121)
    values = np.array([excess(x) for x in grid])
    (falls,) = np.nonzero((values[:-1] > 0) & (values[1:] <= 0))
    root = scipy.optimize.brentq(excess, grid[falls[-1]], grid[falls[-1] + 1], xtol=1e-14)
    return np.exp(root)


def white(num, seed=0):
    return np.random.default_rng(seed).standard_normal(num)


# -- constants -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
def test_constants_from_truncated_moments(efficiency):
    """g = sum_i binomial(4, i) (-1)^i r^(2+2i) / c^2i at 50 digits: a, E g^2 and E g (Z^2 - 1) are sums of moments."""
    with mpmath.workdps(50):
        c = mpmath.mpf(biweight(efficiency).c)
        terms = [(mpmath.binomial(4, i) * (-1) ** i / c ** (2 * i), 2 + 2 * i) for i in range(5)]
        squares = [(mpmath.binomial(8, i) * (-1) ** i / c ** (2 * i), 4 + 2 * i) for i in range(9)]
        a = sum(w * truncated_moment(k, c) for w, k in terms)
        c_2 = sum(w * (truncated_moment(k + 2, c) - truncated_moment(k, c)) for w, k in terms) / mpmath.sqrt(2)
        variance = sum(w * truncated_moment(k, c) for w, k in squares) - a * a
        assert biweight(efficiency).consistency == pytest.approx(float(a), rel=1e-12)
        assert float(c_2**2 / variance) == pytest.approx(efficiency, rel=1e-11)


@pytest.mark.parametrize("efficiency", EFFICIENCIES)
@pytest.mark.parametrize("rho", [0.2, -0.5, 0.9])
def test_the_polynomial_is_the_covariance_of_g(efficiency, rho):
    """Cov(g(X), g(Y)) / slope^2 = 2 rho^2 p(rho^2), both integrals by quadrature, the slope by a difference."""
    c, a, polynomial = biweight(efficiency)
    nodes, weights = np.polynomial.legendre.leggauss(300)
    x, w = 12 * nodes, 12 * weights * np.exp(-72 * nodes**2) / np.sqrt(2 * np.pi)
    inner, v = c * nodes, c * weights  # X inside, where g is a polynomial
    X, Y = inner[:, None], inner[None, :]
    density = np.exp(-(X**2 - 2 * rho * X * Y + Y**2) / (2 * (1 - rho**2))) / (2 * np.pi * np.sqrt(1 - rho**2))
    covariance = (v * g(inner, c)) @ density @ (v * g(inner, c)) - a**2
    slope = (w @ g(x * np.exp(1e-4), c) - w @ g(x * np.exp(-1e-4), c)) / 4e-4  # in log nu^2
    expected = 2 * rho**2 * np.polyval(polynomial[::-1], rho**2)
    assert covariance / slope**2 == pytest.approx(expected, rel=1e-4)
    assert polynomial[0] == 1
    assert np.sum(polynomial) == pytest.approx(1 / efficiency, rel=1e-11)


# -- the solver ------------------------------------------------------------------------------------------------------


def records():
    rng = np.random.default_rng(3)
    spiked = white(20_000, 1)
    spiked[rng.choice(20_000, 50)] += 30 * rng.standard_normal(50)
    return {
        "white": white(20_000),
        "walk": 1e6 + np.cumsum(white(20_000)),
        "spiked": spiked,
        "small units": 1e-9 * white(16_385),
        "one block": white(8192),
        "one block and one": white(8193),
        "uniform": rng.uniform(size=8191),
        "quantised": np.round(2 * white(20_000)),
    }


@pytest.mark.parametrize("efficiency", [0.6, 0.95])
@pytest.mark.parametrize("name", records())
def test_against_bisection(name, efficiency):
    x = records()[name]
    seen = robust_wavelet_variance(x, 7, efficiency=efficiency)
    expected = [by_bisection(haar(x - x.mean(), j), efficiency) for j in range(1, 8)]
    np.testing.assert_allclose(seen, expected, rtol=1e-10)


def test_a_start_far_from_the_root():
    """Two sizes of coefficients far apart, the smaller in the majority; the root beside the median is taken."""
    x = np.cumsum(2 * np.where(np.arange(50_000) % 5 == 0, 1e4, 1.0) * white(50_000))
    seen = robust_wavelet_variance(x, 1)
    W = haar(x, 1)
    expected = by_bisection(np.where(np.abs(W) > 1e3, 1e3, W), 0.6)
    assert seen[0] == pytest.approx(expected, rel=1e-10)
    assert seen[0] < 1


def test_where_there_is_no_root_by_chance_it_is_the_maximum():
    """A quarter of the coefficients far out, at a scale of a few degrees of freedom: no scale reaches a."""
    c, a, _ = biweight(0.6)
    x = np.cumsum(2 * np.where(np.arange(60) % 2 == 0, 1e4, 1.0) * white(60))
    W = np.where(np.abs(haar(x, 1)) > 100, np.inf, haar(x, 1))
    largest = scipy.optimize.minimize_scalar(
        lambda log_v: -np.mean(g(W / np.exp(log_v / 2), c)), bounds=(-6, 2), method="bounded", options={"xatol": 1e-9}
    )
    assert -largest.fun < a
    assert robust_wavelet_variance(x, 1)[0] == pytest.approx(np.exp(largest.x), rel=1e-4)


@pytest.mark.parametrize("factor", [-1.0, 2.0**-40, 1e7])
def test_scale_and_offset(factor):
    x = white(5000)
    seen = robust_wavelet_variance(factor * x + 3 * abs(factor))
    np.testing.assert_allclose(seen, factor**2 * robust_wavelet_variance(x), rtol=1e-9)


def test_every_way_in_is_the_same(tmp_path):
    x = white(30_000)
    x.tofile(tmp_path / "x.f64")
    mapped = np.memmap(tmp_path / "x.f64", dtype=np.float64, mode="r")
    expected = gj.wavelet_variance(x, efficiency=0.6)
    blocks = (x[i : i + 700] for i in range(0, 30_000, 700))
    for way in (mapped, blocks, gj.Recording.from_array(x, rate=10.0, units="1")):
        seen = gj.wavelet_variance(way, efficiency=0.6, scratch=tmp_path)
        np.testing.assert_array_equal(seen.variance, expected.variance)
        np.testing.assert_array_equal(seen.ci_low, expected.ci_low)
        assert seen.efficiency == 0.6
    two = gj.wavelet_variance(np.column_stack([x, x[::-1]]), efficiency=0.6)
    np.testing.assert_array_equal(two.variance[:, 0], expected.variance)
    assert two[1].efficiency == 0.6


# -- R ---------------------------------------------------------------------------------------------------------------


def test_what_r_calls_60_percent_is_73():
    assert efficiency_that_r_calls(0.6) == pytest.approx(0.7270, abs=1e-4)


# -- how sure it is --------------------------------------------------------------------------------------------------


def test_robustness_costs_efficiency():
    """Of independent coefficients: the robust variance scatters more, at 0.6 more than at 0.9, and is not biased."""
    rng, draws = np.random.default_rng(20261121), []
    for _ in range(64):
        e = rng.standard_normal(999)
        walk = np.concatenate([[0.0], np.cumsum(2 * e)])
        draws.append([np.mean(e**2), *(robust_wavelet_variance(walk, 1, efficiency=at)[0] for at in (0.9, 0.6))])
    classic, high, low = np.var(draws, axis=0)
    assert classic < high < low < 4 * classic
    np.testing.assert_allclose(np.mean(draws, axis=0), 1.0, atol=4.5 * np.sqrt(2 / 0.6 / 999 / 64))


def test_covariance_against_all_pairs_of_coefficients():
    """Dense sums of 2 C^2 p(rho^2) over every pair, for a model with short and long correlation."""
    num, J = 300, 6
    model = gj.WN(1.0) + gj.GM(0.05, 2.0)
    C = scipy.linalg.toeplitz(np.where(np.arange(num) == 0, 1.0, 0.0) + 2 * np.exp(-0.05 * np.arange(num)))
    rows = [np.apply_along_axis(haar, 0, np.eye(num), j) for j in range(1, J + 1)]
    seen = np.asarray(gj.variance.wv_covariance(model, num, J, efficiency=0.6))
    p = biweight(0.6).polynomial[::-1]
    nu = [(A @ C @ A.T)[0, 0] for A in rows]
    for j in range(J):
        for k in range(J):
            cross = rows[j] @ C @ rows[k].T
            expected = np.mean(2 * cross**2 * np.polyval(p, cross**2 / (nu[j] * nu[k])))
            assert seen[j, k] == pytest.approx(expected, rel=1e-8)


def test_the_widening_is_that_of_an_octave():
    """Between nothing and 1/efficiency; at long spans the integral over the octave's correlation."""
    s = (np.arange(4_000_000) + 0.5) / 40_000
    y = ((np.sin(2 * np.pi * s) - np.sin(np.pi * s)) / (np.pi * s)) ** 2
    for efficiency in EFFICIENCIES:
        seen = widening(efficiency, 20)
        assert np.all((seen > 1) & (seen < 1 / efficiency))
        p = biweight(efficiency).polynomial
        excess = 2 * np.mean(y * (np.polyval(p[::-1], y) - 1)) * 100
        assert seen[-1] - 1 == pytest.approx(excess, rel=1e-4)


def test_intervals_have_the_classic_form():
    wv = gj.wavelet_variance(white(5000), efficiency=0.75, level=0.9)
    eta = degrees_of_freedom(5000, wv.num_scales) / widening(0.75, wv.num_scales)
    low, high = interval_factors(eta, 0.9)
    np.testing.assert_allclose(wv.ci_low, wv.variance * low, rtol=1e-14)
    np.testing.assert_allclose(wv.ci_high, wv.variance * high, rtol=1e-14)


# -- outliers --------------------------------------------------------------------------------------------------------


def contaminated(x, kind, rng):
    """1 % outliers of 10 sigma: one burst, or single samples."""
    y, count = x.copy(), len(x) // 100
    if kind == "burst":
        first = rng.integers(len(x) - count)
        y[first : first + count] += 10 * rng.standard_normal(count)
    else:
        y[rng.choice(len(x), count, replace=False)] += 10 * rng.choice([-1, 1], count)
    return y


@pytest.mark.slow
@pytest.mark.parametrize(("num", "efficiency"), [(10_000, 0.6), (100_000, 0.9)])
@pytest.mark.parametrize("seed", range(3))
def test_parameters_under_a_burst(seed, num, efficiency):
    """WN + RW: both robust estimates stay in the intervals of the clean record, the classic white noise doubles.

    At 0.6 the outliers bias by -1.3 %, at 0.9 by less than 0.1 %; the half width of the interval is 2.9 % and 0.9 %.
    """
    model = gj.WN(1.0) + gj.RW(1e-2)
    x = np.asarray(gj.simulate(model, num, key=jax.random.key(seed)))
    y = contaminated(x, "burst", np.random.default_rng(seed))
    clean, classic = (gj.fit(gj.wavelet_variance(r), "WN + RW").parameters() for r in (x, y))
    robust = gj.fit(gj.wavelet_variance(y, efficiency=efficiency), "WN + RW").parameters()
    assert all(e.ci_low < r.value < e.ci_high for e, r in zip(clean, robust, strict=True))
    assert classic["WN", "sigma2"].value > 1.5 * clean["WN", "sigma2"].ci_high


def test_white_noise_under_single_outliers():
    """Its classic estimate doubles; the robust one moves by -4 %, for 1 % far outliers reach two coefficients each.

    Records of 1,000 samples: 98 % of the robust estimates lie in the clean interval, here 45 of 50 at least. The bias
    is the same at any length, and so beyond the interval of a long record.
    """
    shifts, inside = [], 0
    for seed in range(50):
        x = white(1000, seed)
        y = contaminated(x, "single", np.random.default_rng(seed + 10_000))
        clean, classic = gj.wavelet_variance(x, num_levels=1), gj.wavelet_variance(y, num_levels=1)
        robust = gj.wavelet_variance(y, num_levels=1, efficiency=0.6).variance[0]
        inside += clean.ci_low[0] < robust < clean.ci_high[0]
        assert classic.variance[0] > 1.3 * clean.ci_high[0]
        shifts.append(robust / gj.wavelet_variance(x, num_levels=1, efficiency=0.6).variance[0] - 1)
    assert inside >= 45
    assert np.mean(shifts) == pytest.approx(-0.0402, abs=4.5 * 0.010 / np.sqrt(50))


@pytest.mark.parametrize(("efficiency", "share"), [(0.6, 0.24), (0.75, 0.3), (0.5, 0.18)])
def test_breakdown(efficiency, share):
    """Far outliers among independent coefficients bias it downwards up to the breakdown point; beyond is an error."""
    num = 20_000

    def walk(share, size=1e6):
        far = np.arange(num) < share * num
        return np.cumsum(2 * np.where(np.random.default_rng(5).permutation(far), size, 1.0) * white(num))

    nu = gj.wavelet_variance(walk(share), num_levels=1, efficiency=efficiency).variance[0]
    assert 0.2 < nu < 1
    further = gj.wavelet_variance(walk(share, 1e9), num_levels=1, efficiency=efficiency).variance[0]
    assert further == pytest.approx(nu, rel=1e-3)
    with pytest.raises(ValueError, match=r"spans of 2 samples.*no robust scale.*classic"):
        gj.wavelet_variance(walk(0.4), num_levels=1, efficiency=efficiency)


# -- a fit -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_robust_fit_says_so_and_has_wider_intervals():
    x = np.asarray(gj.simulate(gj.WN(1.0) + gj.RW(1e-4), 20_000, key=jax.random.key(1)))
    classic, robust = (gj.fit(gj.wavelet_variance(x, efficiency=e), "WN + RW") for e in (None, 0.6))
    assert robust.summary().startswith("Robust (efficiency 0.6) GMWM fit of WN + RW")
    assert classic.summary().startswith("GMWM fit of WN + RW")
    assert (robust.to_dict()["efficiency"], classic.to_dict()["efficiency"]) == (0.6, None)
    expected = gj.variance.wv_covariance(robust.model, 20_000, robust.wv.num_scales, efficiency=0.6)
    np.testing.assert_array_equal(robust.wv_covariance, expected)
    ratio = np.diag(robust.covariance) / np.diag(classic.covariance)
    assert np.all((ratio > 1) & (ratio < 2))
    assert repr(robust.wv).startswith("Robust (efficiency 0.6) Haar wavelet variance of x")
    assert "robust (0.6)" in robust.plot().axes[0].get_title()


def test_the_allan_deviation_keeps_it():
    wv = gj.wavelet_variance(white(5000), efficiency=0.6, rate=1.0)
    adev = gj.allan_deviation(wv)
    assert adev.wv.efficiency == 0.6
    np.testing.assert_allclose(adev.deviation, np.sqrt(2 * wv.variance))
    classic = gj.fitting.slope_regression(
        gj.allan_deviation(gj.wavelet_variance(white(5000), rate=1.0)), {"WN": (1.0, 100.0)}
    )
    robust = gj.fitting.slope_regression(adev, {"WN": (1.0, 100.0)})

    def width(r):
        e = r.table["WN", "N"]
        return np.log(e.ci_high / e.ci_low)

    assert 1 < width(robust) / width(classic) < np.sqrt(1 / 0.6)


def test_a_drift_is_refused():
    wv = gj.wavelet_variance(white(1000), efficiency=0.6)
    with pytest.raises(ValueError, match=r"DR gives wavelet coefficients a mean.*classic"):
        gj.fit(wv, "WN + DR")
    with pytest.raises(ValueError, match="DR gives"):
        gj.variance.wv_covariance(gj.WN(1.0) + gj.DR(0.1), 1000, efficiency=0.6)


# -- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("efficiency", [0.0, 1.0, 0.499, 0.991, np.nan, -1.0])
def test_efficiencies_that_are_not_on_offer(efficiency):
    with pytest.raises(ValueError, match=r"efficiency must be a number between 0.5 and 0.99"):
        gj.wavelet_variance(white(100), efficiency=efficiency)
    with pytest.raises(ValueError, match="efficiency must be"):
        gj.variance.wv_covariance(gj.WN(1.0), 100, efficiency=efficiency)


def test_records_without_a_robust_scale():
    x = white(1000)
    with pytest.raises(ValueError, match="does not change"):
        gj.wavelet_variance(np.ones(1000), efficiency=0.6)
    with pytest.raises(ValueError, match=r"zero at spans of 2, 4, 8 samples: .* coarsely quantised.*half"):
        gj.wavelet_variance(np.repeat(x, 16), efficiency=0.6)
    assert np.all(gj.wavelet_variance(np.repeat(x, 16)).variance > 0)
    with pytest.raises(ValueError, match="beyond floating point"):
        gj.wavelet_variance(1e200 * x, efficiency=0.6)
    x[17] = np.nan
    with pytest.raises(ValueError, match=r"index 17"):
        gj.wavelet_variance(x, efficiency=0.6)
    with pytest.raises(ValueError, match="MODWT"):
        gj.wavelet_variance(white(100), efficiency=0.6, method="dwt")
