"""Columns of time in every way in which they are written."""

import numpy as np
import pytest

from gmwm_jax._internal import stamps

K = np.arange(5)


def test_numbers_are_exact():
    ns = 1_700_000_000_000_000_000 + K * 10_000_000
    np.testing.assert_allclose(stamps.seconds_of(ns, 1e-9), K / 100, rtol=1e-15)
    times = np.datetime64("2026-01-01T00:00:00", "us") + K * np.timedelta64(4000, "us")
    np.testing.assert_allclose(stamps.seconds_of(times), K / 250, rtol=1e-15)
    falling = stamps.seconds_of(np.array([250, 255, 4, 9], dtype=np.uint8), 1e-3)
    assert falling[2] < 0  # unsigned differences would wrap round to huge values
    with pytest.raises(ValueError, match=r"holds <U1.*no numbers"):
        stamps.seconds_of(np.array(["a", "b"]))


@pytest.mark.parametrize(
    "texts",
    [
        ["2026-01-31T23:59:59.5", "2026-02-01T00:00:00.75"],
        ["2026-01-31 23:59:59.500Z", "2026-02-01 00:00:00.750Z"],
        ["2026-01-31T23:59:59.5+01:00", "2026-02-01T00:00:00.75+01:00"],
        ["31.01.2026 23:59:59,5", "01.02.2026 00:00:00,75"],
        ["2026/01/31 23:59:59.5", "2026/02/01 00:00:00.75"],
        ["23:59:59.5", "00:00:00.75"],
        [' "23:59:59.5" ', "0:00:00.75"],
    ],
)
def test_texts(texts):
    np.testing.assert_allclose(stamps.since_first(stamps.from_text(np.array(texts))), [0, 1.25], rtol=1e-15)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["01/31/2026 10:00:00"], "holds '01/31/2026 10:00:00', and no number or stamp"),
        (["yesterday"], "holds 'yesterday'"),
        (["10:00:00", "x"], "holds 'x' among times of day"),
        (["2026-01-31T10:00:00Z", "2026-01-31T10:00:00+01:00"], "several zones"),
    ],
)
def test_texts_that_are_no_stamps(texts, message):
    with pytest.raises(ValueError, match=message):
        stamps.from_text(np.array(texts))


def test_an_offset_from_utc_is_taken_off():
    texts = ["2026-01-31T10:00:00Z", "2026-01-31 12:30:00+02:30", "2026-01-31T07:15-02:45", "2026-01-31T10:00:00"]
    at = [stamps.from_text(np.array([text]))[0] for text in texts]
    assert at == [np.datetime64("2026-01-31T10:00", "ns")] * 4


def test_seconds_go_on_over_the_end_of_a_week():
    np.testing.assert_array_equal(
        stamps.over_weeks(np.array([604799.0, 604799.9, 0.8, 1.7])), [604799.0, 604799.9, 604800.8, 604801.7]
    )
    for seconds in ([5000.0, 0.0, 1.0], [604799.0, 100_000.0], [1.7e9, 5.0], []):  # a clock that was reset
        np.testing.assert_array_equal(stamps.over_weeks(np.array(seconds)), seconds)


def test_two_columns():
    week = stamps.pair(["GPS week", "tow"], [np.array([2209, 2209, 2210]), np.array([604799.0, 604799.5, 0.25])])
    np.testing.assert_allclose(week, [0, 0.5, 1.25])
    nano = stamps.pair(["stamp_sec", "stamp_nanosec"], [np.array([5, 5, 6]), np.array([0, 500_000_000, 250_000_000])])
    np.testing.assert_allclose(nano, [0, 0.5, 1.25])
    date = stamps.from_text(np.array(["2026-01-31", "2026-02-01"]))
    time = stamps.from_text(np.array(["23:59:59.5", "00:00:00.75"]))
    np.testing.assert_allclose(stamps.pair(["date", "time"], [date, time]), [0, 1.25])
    with pytest.raises(ValueError, match="the names a, b say none of it"):
        stamps.pair(["a", "b"], [K, K])
    with pytest.raises(ValueError, match="a date and a time of day, in this order"):
        stamps.pair(["time", "date"], [time, date])


def test_counters_that_wrap():
    np.testing.assert_array_equal(stamps.unwrapped((K + 65533) % 65536, 65536), K + 65533)
