"""Every statistic against SciPy's own tests and distributions; every interval, band and test by simulation.

In the simulations each epoch is a replicate of its own, so that one call serves thousands.
"""

import json

import numpy as np
import pytest
import scipy.stats

from nav_jax.statistics.distributions import num_runs_needed, t_test_power
from nav_jax.statistics.summaries import (
    coverage,
    holm,
    interval_coverage,
    mean_curve,
    mean_nees,
    mean_norm,
    paired,
    rms,
)

SIGMAS = 4.0
REPLICATES = 8000
RNG = np.random.default_rng


def assert_share(seen, expected, num=REPLICATES, *, below=0.0, above=0.0):
    """A share of `num` independent trials equals the expected one within 4 sigma; `below`, `above`: known defects."""
    band = SIGMAS * np.sqrt(expected * (1 - expected) / num)
    assert expected - below - band <= seen <= expected + above + band, (seen, expected, band)


def share_holding(curve, truth):
    return np.mean((curve.low <= truth) & (truth <= curve.high))


# means and RMS


def test_mean_norm_is_the_mean_with_students_interval():
    error = RNG(1).normal(size=(12, 7, 3))
    length = np.sqrt(np.sum(error**2, axis=-1))
    seen = mean_norm(error, 0.9)
    expected = scipy.stats.ttest_1samp(length, 0.0).confidence_interval(0.9)
    np.testing.assert_allclose(seen.value, length.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(seen.se, scipy.stats.sem(length), rtol=1e-12)
    np.testing.assert_allclose((seen.low, seen.high), (expected.low, expected.high), rtol=1e-11)
    assert (seen.level, seen.num_runs) == (0.9, 12)


def test_no_length_is_negative():
    error = np.array([0.1, 5.0])[:, None, None] * np.ones((2, 1, 3))
    assert mean_norm(error).low == 0
    assert mean_curve(error[..., 0]).low < 0


def test_exact_start_has_an_interval_of_zero_width():
    for curve in (mean_norm(np.zeros((5, 2, 3))), rms(np.zeros((5, 2, 3)))):
        for x in (curve.value, curve.low, curve.high, curve.se):
            np.testing.assert_array_equal(x, np.zeros(2))


@pytest.mark.parametrize(("num_runs", "scale"), [(10, [1, 1, 1]), (50, [1, 1, 1]), (50, [1, 0.3, 0.02])])
def test_interval_of_the_mean_holds(num_runs, scale):
    """At 10 runs the skewness of a length costs half a percent."""
    error = RNG(2).normal(size=(num_runs, REPLICATES, 3)) * scale
    truth = np.linalg.norm(RNG(3).normal(size=(4_000_000, 3)) * scale, axis=-1).mean()
    assert_share(share_holding(mean_norm(error), truth), 0.95, below=0.005)


def test_rms_per_component_and_of_the_length():
    error = RNG(4).normal(size=(20, 5, 3)) * [1.0, 2.0, 3.0]
    each, whole = rms(error, per_component=True), rms(error)
    np.testing.assert_allclose(each.value, np.sqrt(np.mean(error**2, axis=0)), rtol=1e-13)
    np.testing.assert_allclose(whole.value**2, np.sum(each.value**2, axis=1), rtol=1e-12)
    for i in range(3):
        alone = rms(error[..., i : i + 1])
        for name in ("value", "low", "high", "se"):
            np.testing.assert_allclose(getattr(each, name)[:, i], getattr(alone, name), rtol=1e-12)


def test_rms_of_light_tails_has_the_interval_of_gauss():
    """+-1: no scatter of the squares at all, and the chi-square interval of N Gaussian values remains."""
    error = np.where(RNG(5).random(size=(30, 1, 1)) < 0.5, -1.0, 1.0)
    seen = rms(error)
    assert seen.value == 1
    assert seen.low == pytest.approx(np.sqrt(30 / scipy.stats.chi2.ppf(0.975, 30)), rel=1e-11)
    assert seen.high == pytest.approx(np.sqrt(30 / scipy.stats.chi2.ppf(0.025, 30)), rel=1e-11)
    assert seen.se == pytest.approx(1 / np.sqrt(60), rel=1e-11)


@pytest.mark.parametrize("num_runs", [5, 10, 50])
@pytest.mark.parametrize("scale", [[1.0], [1, 1, 1], [1, 0.5, 0.05]], ids=["line", "ball", "ellipsoid"])
def test_interval_of_the_rms_holds(num_runs, scale):
    """The two estimates of its degrees of freedom cost or add up to 2 %, less with more runs."""
    error = RNG(6).normal(size=(num_runs, REPLICATES, len(scale))) * scale
    seen = share_holding(rms(error), np.linalg.norm(scale))
    assert_share(seen, 0.95, below=0.08 / num_runs, above=0.02)


def test_interval_of_the_rms_with_heavy_tails():
    """Student with 6 degrees of freedom, whose fourth moment 50 runs hardly know: 92 % instead of 95 %."""
    error = RNG(7).standard_t(6, size=(50, REPLICATES, 3))
    assert_share(share_holding(rms(error), np.sqrt(3 * 6 / 4)), 0.95, below=0.04)
    light = RNG(7).uniform(-1, 1, size=(50, REPLICATES, 3))
    assert share_holding(rms(light), 1.0) > 0.95


def test_standard_errors_are_those_of_replicates():
    """Whose scatter 8000 values know to 0.8 %. That of the RMS, the larger of two estimates, is 4 % too large."""
    error = RNG(8).normal(size=(200, REPLICATES, 3)) * [1, 0.5, 0.2]
    for curve, large in ((mean_norm(error), 1.0), (rms(error), 1.04)):
        assert np.mean(curve.se) == pytest.approx(large * np.std(curve.value), rel=SIGMAS * 0.008)


# consistency


def test_band_of_the_mean_nees():
    seen = mean_nees(RNG(10).chisquare(6, size=(50, 10)), 6)
    np.testing.assert_allclose((seen.low, seen.high), scipy.stats.chi2.ppf([0.025, 0.975], 300) / 50, rtol=1e-11)
    # as stated for the R package
    assert (round(seen.low, 3), round(seen.high, 3)) == (5.078, 6.997)
    np.testing.assert_array_equal(seen.inside, (seen.low <= seen.value) & (seen.value <= seen.high))
    assert (seen.dof, seen.num_runs, seen.level) == (6, 50, 0.95)


@pytest.mark.parametrize(("dof", "num_runs", "level"), [(3, 10, 0.95), (6, 50, 0.9), (1, 4, 0.99)])
def test_band_holds_its_share_of_independent_epochs(dof, num_runs, level):
    seen = mean_nees(RNG(11).chisquare(dof, size=(num_runs, REPLICATES)), dof, level)
    assert_share(seen.share_inside, level)


@pytest.mark.parametrize("num_epochs", [1, 10])
def test_verdict_takes_no_epochs_for_independent(num_epochs):
    """300 epochs in a row alike: a wrong verdict in 5 % of all cases, not in most of them."""
    rng, num = RNG(12), 1000
    wrong = []
    for _ in range(num):
        nees = np.repeat(rng.chisquare(3, size=(50, num_epochs)), 300 // num_epochs, axis=1)
        wrong.append(mean_nees(nees, 3).verdict != "consistent")
    assert_share(np.mean(wrong), 0.05, num)


def test_verdicts():
    nees = RNG(13).chisquare(6, size=(50, 100))
    assert mean_nees(nees, 6).verdict == "consistent"
    assert mean_nees(1.2 * nees, 6).verdict == "optimistic"
    assert mean_nees(0.8 * nees, 6).verdict == "conservative"
    seen = mean_nees(nees, 6)
    assert seen.average == pytest.approx(nees.mean(), rel=1e-13)
    logs = np.log([seen.average_low, seen.average, seen.average_high])
    half = scipy.stats.t.ppf(0.975, 49) * scipy.stats.sem(nees.mean(axis=1)) / nees.mean()
    np.testing.assert_allclose(np.diff(logs), half, rtol=1e-11)
    # two runs and a high level know nothing, and say so without a warning
    assert mean_nees(nees[:2], 6, 1 - 1e-6).average_high == np.inf
    assert mean_nees(np.zeros((3, 2)), 6).verdict == "conservative"


@pytest.mark.parametrize("num_runs", [2, 10, 50, 500])
@pytest.mark.parametrize("level", [0.5, 0.7, 0.95])
@pytest.mark.parametrize("confidence", [0.7, 0.95])
def test_band_of_the_coverage_is_the_acceptance_region(num_runs, level, confidence):
    """Neither tail is more probable than half of what the confidence leaves, and would be if it began a run sooner."""
    seen = coverage(np.ones((num_runs, 1)), 3, level, confidence)
    low, high = round(seen.low * num_runs), round(seen.high * num_runs)
    of, tail = scipy.stats.binom(num_runs, level), (1 - confidence) / 2
    assert of.cdf(low - 1) < tail <= of.cdf(low)
    assert of.sf(high) <= tail < of.sf(high - 1)


def test_coverage_counts_runs():
    nees = RNG(14).chisquare(4, size=(40, 6))
    seen = coverage(nees, 4, 0.7, 0.9)
    covered = np.sum(nees <= scipy.stats.chi2.ppf(0.7, 4), axis=0)
    np.testing.assert_allclose(seen.value, covered / 40, rtol=1e-13)
    for low, high, k in zip(seen.interval_low, seen.interval_high, covered, strict=True):
        expected = scipy.stats.binomtest(int(k), 40).proportion_ci(0.9, method="exact")
        assert (low, high) == pytest.approx((expected.low, expected.high), rel=1e-10)
    all_or_none = coverage(np.array([[0.0, 99.0]] * 10), 4)
    np.testing.assert_array_equal(all_or_none.value, [1, 0])
    assert (all_or_none.interval_high[0], all_or_none.interval_low[1]) == (1, 0)
    one_sided = 0.025**0.1
    np.testing.assert_allclose((all_or_none.interval_low[0], all_or_none.interval_high[1]), (one_sided, 1 - one_sided))


def test_band_and_interval_of_the_coverage_hold():
    """Exact ones, so as much as they claim or more."""
    for dof, level in ((3, 0.95), (6, 0.7)):
        seen = coverage(RNG(15).chisquare(dof, size=(50, REPLICATES)), dof, level)
        low, high = round(50 * seen.low), round(50 * seen.high)
        expected = scipy.stats.binom.cdf(high, 50, level) - scipy.stats.binom.cdf(low - 1, 50, level)
        assert expected >= 0.95
        assert_share(seen.share_inside, expected)
        assert_share(np.mean((seen.interval_low <= level) & (level <= seen.interval_high)), 0.95, above=0.05)


def test_interval_coverage_by_component():
    rng = RNG(16)
    sd = np.broadcast_to([1.0, 2.0, 0.0, 1.0], (2000, 3, 4))
    error = rng.normal(size=(2000, 3, 4)) * [1.0, 1.0, 1.0, 2.0]
    seen = interval_coverage(error, sd, 0.9)
    z = scipy.stats.norm.ppf(0.95)
    for i, factor in ((0, 1.0), (1, 2.0), (3, 0.5)):
        np.testing.assert_allclose(seen.value[:, i], np.mean(np.abs(error[..., i]) <= z * sd[..., i], axis=0))
        for share in seen.value[:, i]:
            assert_share(share, 2 * scipy.stats.norm.cdf(factor * z) - 1, 2000)
    # an axis without a state claims nothing: neither right nor wrong
    for x in (seen.value, seen.interval_low, seen.interval_high):
        assert np.all(np.isnan(x[:, 2]))
    assert seen.share_inside == np.mean(seen.inside[:, [0, 1, 3]])
    assert np.isnan(interval_coverage(error[..., 2:3], sd[..., 2:3]).share_inside)


# pairs


def test_paired_is_the_paired_t_test():
    rng = RNG(20)
    a = rng.normal(size=30)
    b = a + 0.3 + 0.5 * rng.normal(size=30)
    seen, expected = paired(a, b, 0.9), scipy.stats.ttest_rel(a, b)
    interval = expected.confidence_interval(0.9)
    assert seen.difference == pytest.approx(np.mean(a - b), rel=1e-12)
    assert seen.se == pytest.approx(scipy.stats.sem(a - b), rel=1e-12)
    assert seen.p == pytest.approx(expected.pvalue, rel=1e-10)
    assert (seen.low, seen.high) == pytest.approx((interval.low, interval.high), rel=1e-11)
    assert (seen.num_runs, seen.level) == (30, 0.9)
    assert paired(b, a).difference == -seen.difference


@pytest.mark.parametrize("num_runs", [2, 10, 50])
def test_paired_finds_nothing_in_5_percent_of_nothing(num_runs):
    """Two models with equal errors that are correlated, as on common random numbers."""
    shared, own = RNG(21).normal(size=(2000, num_runs, 3)), RNG(22).normal(size=(2, 2000, num_runs, 3))
    a, b = np.linalg.norm(shared + 0.5 * own, axis=-1)
    found = [paired(x, y) for x, y in zip(a, b, strict=True)]
    assert_share(np.mean([test.p < 0.05 for test in found]), 0.05, 2000)
    assert all((test.p < 0.05) == (test.low > 0 or test.high < 0) for test in found)


@pytest.mark.parametrize(("effect", "expected"), [(1.0, 10), (0.5, 34), (0.2, 199)])
def test_sample_sizes_of_the_tables(effect, expected):
    """Two-sided paired t test, size 5 %, power 80 %, as in Cohen's tables and the programs that replaced them."""
    assert num_runs_needed(effect, 1.0, 0.05, 0.8) == expected


@pytest.mark.parametrize("size", [0.05, 0.001])
@pytest.mark.parametrize("effect", [5.0, 1.3, 0.3, 0.04])
@pytest.mark.parametrize("power", [0.5, 0.8, 0.99])
def test_sample_size_is_the_least_with_the_power(size, effect, power):
    def by_scipy(n):
        of = scipy.stats.nct(n - 1, effect * np.sqrt(n))
        critical = scipy.stats.t.isf(size / 2, n - 1)
        return of.sf(critical) + np.nan_to_num(of.cdf(-critical))  # NaN where it is next to nothing

    n = num_runs_needed(-effect, 1.0, size, power)
    if n > 10_000:  # Guenther's
        assert by_scipy(n + 1) >= power > by_scipy(n - 2)
        return
    assert by_scipy(n) >= power
    assert n == 2 or by_scipy(n - 1) < power
    assert t_test_power(effect, n, size) == pytest.approx(by_scipy(n), rel=1e-6)


def test_sample_size_is_enough():
    """Simulated: tests with so many runs find the difference in 80 %."""
    n = num_runs_needed(0.7, 1.0, 0.05, 0.8)
    draws = RNG(23).normal(0.7, size=(2000, n))
    found = [paired(x, np.zeros(n)).p < 0.05 for x in draws]
    assert_share(np.mean(found), t_test_power(0.7, n, 0.05), 2000)


def test_sample_size_far_out():
    """Where the noncentral t of SciPy has no value; the next larger of both formulas is the same at their border."""
    assert t_test_power(np.inf, 2, 0.05) == pytest.approx(1.0, rel=1e-11)
    assert t_test_power(50.0, 2, 0.05) == pytest.approx(1.0, abs=1e-6)
    assert num_runs_needed(1.0, 0.0, 0.05, 0.8) == 2
    assert num_runs_needed(1.0, 1.0, 0.05, 0.01) == 2
    assert num_runs_needed(1e-6, 1.0, 0.05, 0.8) == pytest.approx(7.849e12, rel=1e-4)
    assert abs(num_runs_needed(0.0280161, 1.0, 0.05, 0.8) - num_runs_needed(0.0280155, 1.0, 0.05, 0.8)) <= 2


def test_pairs_without_scatter():
    a = np.arange(5.0)
    same, shifted = paired(a, a), paired(a + 2, a)
    assert (same.difference, same.se, same.p, same.num_runs_needed) == (0, 0, 1, None)
    assert (shifted.difference, shifted.low, shifted.high, shifted.p, shifted.num_runs_needed) == (2, 2, 2, 0, 2)
    # no difference with scatter, and one of rounding
    assert paired(np.array([1.0, -1.0]), np.zeros(2)).num_runs_needed is None
    assert paired(np.array([1.0, -1.0 + 1e-12]), np.zeros(2)).num_runs_needed is None


def test_holm():
    np.testing.assert_allclose(holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_array_equal(holm(np.array([0.6, 0.9])), [1, 1])
    assert holm(np.array([])).size == 0
    assert holm(np.array([0.2])) == 0.2
    # three tests of nothing: at least one claim in 1 - (1 - 0.05/3)^3 of the tables
    draws = RNG(24).random(size=(4000, 3))
    assert_share(np.mean([holm(p).min() < 0.05 for p in draws]), 1 - (1 - 0.05 / 3) ** 3, 4000)
    with pytest.raises(ValueError, match="P-values lie between 0 and 1"):
        holm(np.array([0.5, np.nan]))


# R


@pytest.fixture(scope="module")
def r_results(shared):
    return json.loads((shared / "reference" / "nav_mc_lemniscate.json").read_text())["results"]


def test_bands_judge_the_curves_of_r(r_results):
    """N = 50. NEES and coverage of the right model are in the bands at most epochs, those of the wrong one are not."""
    of_nees = mean_nees(np.ones((50, 1)), 6)
    of_coverage = {level: coverage(np.ones((50, 1)), 6, level) for level in (0.7, 0.95)}

    def share(model, key, band):
        t, v = (np.array(r_results[model][key][x]) for x in "tv")
        v = v[t > 10]
        return np.mean((band.low - 1e-9 <= v) & (v <= band.high + 1e-9))

    for key, band in [("nees_idx1_6", of_nees), *((f"coverage_a{q:.2f}_idx1_6", c) for q, c in of_coverage.items())]:
        assert share("correct", key, band) > 0.85, key
        assert share("partial", key, band) < 0.1, key
        assert share("wrong", key, band) < 0.01, key


def test_the_difference_that_r_does_not_test():
    """Wrong less right model at the end of R's outage: 1.683 m, standard error 0.583 m in 50 pairs."""
    rng = RNG(25)
    x = rng.normal(size=50)
    x = 1.683 + (x - x.mean()) / scipy.stats.sem(x) * 0.583
    seen = paired(x, np.zeros(50))
    assert seen.p == pytest.approx(0.0058, abs=1e-4)
    assert seen.num_runs_needed == 50
    # R's own example has ten
    assert seen.num_runs_needed > 10


# what is refused


@pytest.mark.parametrize(
    "ask",
    [
        lambda R: mean_curve(np.ones((R, 4))),
        lambda R: mean_norm(np.ones((R, 4, 3))),
        lambda R: rms(np.ones((R, 4, 3))),
        lambda R: mean_nees(np.ones((R, 4)), 3),
        lambda R: coverage(np.ones((R, 4)), 3),
        lambda R: interval_coverage(np.ones((R, 4, 2)), np.ones((R, 4, 2))),
        lambda R: paired(np.ones(R), np.ones(R)),
    ],
)
@pytest.mark.parametrize("num_runs", [0, 1])
def test_too_few_runs(ask, num_runs):
    with pytest.raises(ValueError, match=f"has {num_runs} runs, and this statistic takes 2 or more"):
        ask(num_runs)
    ask(2)


@pytest.mark.parametrize(
    "ask",
    [
        lambda x: mean_curve(x[..., 0]),
        mean_norm,
        rms,
        lambda x: mean_nees(x[..., 0], 3),
        lambda x: coverage(x[..., 0], 3),
        lambda x: interval_coverage(x, np.ones_like(x)),
        lambda x: interval_coverage(np.ones_like(x), x),
        lambda x: paired(x[:, 1, 0], np.ones(6)),
        lambda x: paired(np.ones(6), x[:, 1, 0]),
    ],
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_failed_runs(ask, value):
    x = np.ones((6, 4, 3))
    x[[2, 5], 1] = value
    with pytest.raises(ValueError, match="NaN or infinite values in 2 of 6 runs, the first of them run 2"):
        ask(x)


@pytest.mark.parametrize("level", [0.0, 1.0, 95, -0.5, np.nan])
def test_levels(level):
    x = np.ones((3, 4, 3))
    for ask in (mean_norm, rms, lambda x, q: mean_nees(x[..., 0], 3, q), lambda x, q: coverage(x[..., 0], 3, q)):
        with pytest.raises(ValueError, match="level is a probability between 0 and 1, and is"):
            ask(x, float(level))
    with pytest.raises(ValueError, match="confidence is a probability"):
        coverage(x[..., 0], 3, 0.95, float(level))
    with pytest.raises(ValueError, match="power is a probability"):
        paired(x[:, 0, 0], x[:, 0, 0], 0.95, float(level))


def test_what_does_not_fit():
    x = np.ones((3, 4))
    for ask in (mean_nees, coverage):
        with pytest.raises(ValueError, match="dof must be an integer of 1 or more, and is 0"):
            ask(x, 0)
        with pytest.raises(ValueError, match=r"at least zero, and the least one here is -1\.0"):
            ask(-x, 3)
        with pytest.raises(ValueError, match="no epoch"):
            ask(x[:, :0], 3)
    with pytest.raises(ValueError, match="3 of one model and 2 of the other"):
        paired(x[:, 0], x[:2, 0])
    with pytest.raises(ValueError, match=r"Errors of shape \(3, 4\) and standard deviations of shape \(3, 2\)"):
        interval_coverage(x, x[:, :2])
    with pytest.raises(ValueError, match=r"A standard deviation is at least zero, and the least one here is -1\.0"):
        interval_coverage(x, -x)
