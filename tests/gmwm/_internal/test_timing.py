"""What stamps tell: the rate, and every way in which loggers write them; and what tells nothing."""

import math

import numpy as np
import pytest

from gmwm_jax._internal.timing import drift_of, longest_rise, timing

N = 3000
K = np.arange(N)
LOST = np.isin(K, [100, 101, 102, 500, 505])
DRAWS = np.random.default_rng(4)


def tolerance(stamps, rate, n=N):
    """Five standard deviations of a slope by least squares over independent errors of stamps."""
    return 5 * np.std(stamps) * math.sqrt(12 / n) * rate / n * rate


@pytest.mark.parametrize("rate", [0.5, 10.0, 128.0, 152.3, 1000.0])
def test_even_stamps(rate):
    found = timing(K / rate)
    assert found.rate == pytest.approx(rate, rel=1e-11)
    assert (found.missing, found.gaps, found.duplicated, found.rounding) == (0, 0, 0, 0)
    assert found.jitter < 1e-10 / rate
    np.testing.assert_array_equal(found.place, K)
    np.testing.assert_allclose(found.grid, K / rate, rtol=0, atol=1e-9 / rate)
    assert "none missing" in str(found)


@pytest.mark.parametrize(("rate", "unit"), [(152.3, 1e-3), (99.7, 1e-3), (3000.0, 1e-3), (7.7, 0.1)])
def test_rounded_stamps(rate, unit):
    """Also ones of which three samples share one: rounding has the standard deviation unit / sqrt(12)."""
    found = timing(np.round(K / rate / unit) * unit)
    assert found.rate == pytest.approx(rate, abs=tolerance([0, unit], rate))
    assert found.missing == 0
    assert found.rounding == pytest.approx(unit)
    assert found.jitter == pytest.approx(unit / math.sqrt(12), rel=0.15)
    # what the line by least squares leaves of independent errors
    assert np.std(found.grid - K / rate) < 5 * unit / math.sqrt(12) * math.sqrt(2 / N)


@pytest.mark.parametrize("jitter", [0.0, 0.05, 0.15])
def test_missing_samples_are_counted_and_placed(jitter):
    stamps = (K / 200 + DRAWS.normal(size=N) * jitter / 200)[~LOST]
    found = timing(np.sort(stamps))
    assert (found.missing, found.gaps) == (5, 3)
    assert found.longest == pytest.approx(3 / 200, rel=1e-3)
    np.testing.assert_array_equal(found.place, K[~LOST])
    assert "5 missing in 3 gaps" in str(found)


def test_a_delay_that_is_caught_up_misses_nothing():
    late = K / 200
    late[300:320] = late[320]
    found = timing(late)
    assert found.missing == 0
    np.testing.assert_array_equal(found.place, K)


@pytest.mark.parametrize("size", [4, 16])
def test_bursts_miss_nothing(size):
    """Loggers that stamp a whole packet; with packets lost, samples are."""
    stamps = (np.floor(K / size) * size + size - 1) / 200
    assert timing(stamps).missing == 0
    kept = ~np.isin(K // size, [20, 90])
    assert timing(stamps[kept]).missing == 2 * size
    many = np.arange(60 * N)  # more long steps than are looked at one by one
    assert timing((np.floor(many / 2) * 2 + 1) / 200).missing == 0


def test_rows_that_were_written_twice():
    order = np.sort(np.r_[K, [50, 700]])
    found = timing(K[order] / 200, lambda rows: np.ones(len(rows), dtype=bool))
    assert (found.duplicated, found.missing) == (2, 0)
    np.testing.assert_array_equal(found.place, K[order])
    np.testing.assert_array_equal(order[found.kept("nan")], K)
    with pytest.raises(ValueError, match="2 rows were written twice, the first at index 51"):
        found.kept("refuse")


def test_what_is_done_about_gaps():
    found = timing(K[~LOST] / 200)
    np.testing.assert_array_equal(K[~LOST][found.kept("longest")], np.arange(506, N))
    np.testing.assert_array_equal(found.kept("nan"), np.arange(N - 5))
    with pytest.raises(
        ValueError, match=r"gap of 0\.02 s before index 100.*step is 0\.005 s: 5 .*gaps=\"nan\".*longest"
    ):
        found.kept("refuse")
    assert timing(K / 200).kept("refuse") == slice(None)
    with pytest.raises(ValueError, match="not one record"):
        timing(np.r_[K[:50], K[:50] + 10_000] / 200).kept("nan")


def test_the_longest_run_of_a_clock_that_falls_back():
    assert longest_rise(np.r_[K[:10], K[:30], K[:20]].astype(float)) == slice(10, 40)
    assert longest_rise(K / 2) == slice(0, N)


@pytest.mark.parametrize("ppm", [-40.0, 13.0])
@pytest.mark.parametrize("every", [1, 200])
def test_drift_against_a_second_clock(ppm, every):
    """Which may say a new time once a second only, with an error of 0.1 ms."""
    own = np.arange(60_000) / 200
    true = own / (1 + ppm * 1e-6)
    second = (true + DRAWS.normal(size=len(own)) * 1e-4)[K[0] :: every].repeat(every)
    found, deviation = drift_of(own, second)
    assert abs(found - ppm) < 5 * deviation
    used = len(own) / every
    # a clock that does not rise is not used, which takes some of the noise away where each sample has a time
    assert deviation == pytest.approx(100 * math.sqrt(12 / used) / 300, rel=0.3)


def test_second_clocks_that_tell_nothing():
    with pytest.raises(ValueError, match="fewer than three times"):
        drift_of(K / 200, np.zeros(N))
    with pytest.raises(ValueError, match=r"0\.001 times as fast as the second clock: a unit is wrong"):
        drift_of(K / 200, K * 5.0)


@pytest.mark.parametrize(
    ("seconds", "message"),
    [
        ([0.0, 1.0, 1.0, 2.0], "does not increase at index 2: 1 s is followed by 1 s"),
        ([0.0, 1.0, 2.0, 1.5], "does not increase at index 3.*clock was reset"),
        ([0.0, 0.0, 0.0, 0.0], "does not increase at index 1.*too few digits"),
        ([0.0, math.nan, 2.0], "column of time holds 1 values that are NaN.*index 1"),
        ([0.0], "has 1 value: a rate needs two"),
        (np.sort(DRAWS.uniform(size=50)), "differ from even steps by .* tell the rate"),
    ],
)
def test_time_that_tells_no_rate(seconds, message):
    with pytest.raises(ValueError, match=message):
        timing(np.array(seconds))


def test_a_single_stamp_that_is_wrong_is_seen():
    stamps = K / 200
    stamps[1000] = stamps[999]
    with pytest.raises(ValueError, match=r"does not increase at index 1000.*too few digits"):
        timing(stamps)
