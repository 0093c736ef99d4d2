"""Runs, epochs and searches that need more than there is: refused before anything is computed, near the truth."""

import time
import tracemalloc

import jax
import numpy as np
import pytest

import nav_jax as nj
from gmwm_jax._internal.memory import MEMORY_VARIABLE, OutOfMemoryError
from nav_jax.filter.experiment import Setup
from nav_jax.simulation.collected import Collected

RATE = 20.0


@pytest.fixture(scope="module")
def scenario():
    reference = nj.motions.lemniscate(duration=10.0, rate=RATE)
    return nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])


@pytest.fixture(scope="module")
def truth():
    return nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=RATE)


def at_once(ask, error, message):
    begin = time.perf_counter()
    with pytest.raises(error, match=message):
        ask()
    assert time.perf_counter() - begin < 5


def test_too_many_runs(scenario, truth):
    asked = {"num_runs": 10**12, "key": jax.random.key(0)}
    message = "1000000000000 runs of 1 filters with 10 epochs each would take about .* TB of memory.*ask for fewer runs"
    at_once(lambda: nj.compare(scenario, truth, **asked), OutOfMemoryError, message)
    at_once(lambda: nj.monte_carlo(scenario, truth, **asked), OutOfMemoryError, message)


@pytest.mark.parametrize(("duration", "rate"), [(1e12, 100.0), (10.0, 1e13)])
def test_too_long_a_trajectory(duration, rate):
    for motion in (nj.motions.lemniscate, nj.motions.static, nj.motions.circle):
        at_once(
            lambda motion=motion: motion(duration=duration, rate=rate),
            OutOfMemoryError,
            "A trajectory of .* Hz would take about .* shorter duration or a lower rate",
        )


def test_too_many_processes_of_a_design(scenario, truth):
    for name in ("max_accel", "max_gyro"):
        at_once(lambda name=name: nj.design(scenario, truth, **{name: 1000}), ValueError, f"{name} is 10 .* is 1000")


def test_covariances_are_estimated(scenario, truth, monkeypatch):
    monkeypatch.setenv(MEMORY_VARIABLE, "1kB")
    at_once(lambda: nj.analyse(scenario, truth), OutOfMemoryError, "Covariances of 1 filters in .* segments would take")


def test_runs_take_what_is_estimated(scenario, truth):
    setup, num = Setup(scenario, RATE), 2000
    tracemalloc.start()
    try:
        collected = Collected(setup, num)
        taken = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert collected.error.shape[0] == num
    np.testing.assert_allclose(Collected.bytes_of(setup, num), taken, rtol=0.05)
