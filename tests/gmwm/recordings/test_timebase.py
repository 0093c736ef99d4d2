"""The rate that a column of time tells, and every column that tells none."""

import math

import numpy as np
import pytest

from gmwm_jax.recordings._timebase import rate_of_time


def test_rate_of_time():
    index = np.arange(1001)
    jitter = np.random.default_rng(4).uniform(-0.2, 0.2, size=1001)
    jitter[[0, -1]] = 0
    assert rate_of_time((index + jitter) / 128.0) == pytest.approx(128.0, rel=1e-12)
    assert rate_of_time(index * 5, "ms") == pytest.approx(200.0, rel=1e-12)
    assert rate_of_time(1_700_000_000_000_000_000 + index * 10_000_000, "ns") == pytest.approx(100.0, rel=1e-12)
    assert rate_of_time(index, "min") == pytest.approx(1 / 60, rel=1e-12)
    stamps = np.datetime64("2026-01-01T00:00:00", "us") + index * np.timedelta64(4000, "us")
    assert rate_of_time(stamps) == pytest.approx(250.0, rel=1e-12)


def test_counters_of_unsigned_type_that_fall_back_are_seen():
    """Unsigned differences wrap round to huge values; the check must not."""
    with pytest.raises(ValueError, match="does not increase at index 2"):
        rate_of_time(np.array([250, 255, 4, 9], dtype=np.uint8), "ms")


@pytest.mark.parametrize(
    ("time", "unit", "message"),
    [
        ([0.0, 1.0, 1.0, 2.0], "s", "does not increase at index 2: 1.0 is followed by 1.0"),
        ([0.0, 1.0, 2.0, 1.5], "s", "does not increase at index 3"),
        ([0.0, 1.0, 2.0, 4.0, 5.0], "ms", "gap of 0.002 s before index 3.*usual step is 0.001 s"),
        ([0.0, math.nan, 2.0], "s", "column of time holds 1 values that are NaN.*index 1"),
        ([0.0], "s", "has 1 value: a rate needs two"),
        (["a", "b"], "s", "holds <U1.*no numbers"),
        ([0.0, 1.0], "day", "Unknown unit of time 'day'; it is one of: s, ms, us, ns, min, h"),
    ],
)
def test_time_that_tells_no_rate(time, unit, message):
    with pytest.raises(ValueError, match=message):
        rate_of_time(np.array(time), unit)
