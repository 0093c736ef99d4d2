"""Threads: as many as the cores this process may use, or as the environment says."""

import os
import threading

import numpy as np
import pytest

from gmwm_jax._internal.cores import THREADS_VARIABLE, num_threads
from gmwm_jax.variance.blocked import host_wavelet_variance
from gmwm_jax.variance.robust import robust_wavelet_variance


def test_the_cores_of_this_process(monkeypatch):
    monkeypatch.delenv(THREADS_VARIABLE, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 128)
    if hasattr(os, "sched_getaffinity"):
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5, 7})
        assert num_threads() == 3
        monkeypatch.delattr(os, "sched_getaffinity")
    assert num_threads() == 128


def test_the_environment_says_fewer(monkeypatch):
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    assert num_threads() == 2
    for wrong in ("0", "-1", "two", "1.5"):
        monkeypatch.setenv(THREADS_VARIABLE, wrong)
        with pytest.raises(ValueError, match="GMWM_JAX_NUM_THREADS is a positive number of threads"):
            num_threads()


@pytest.mark.slow
@pytest.mark.parametrize("estimator", [host_wavelet_variance, robust_wavelet_variance])
def test_no_more_threads_are_started(monkeypatch, estimator):
    """Of a record of many blocks, and the numbers do not depend on it but in the last digits."""
    x = np.random.default_rng(0).normal(size=3_000_000)
    seen, started = [], threading.Thread.start

    def counted(thread):
        seen.append(thread)
        started(thread)

    found = {}
    for threads in (1, 3):
        seen.clear()
        monkeypatch.setenv(THREADS_VARIABLE, str(threads))
        monkeypatch.setattr(threading.Thread, "start", counted)
        found[threads] = estimator(x)
        assert 1 <= len(seen) <= threads
    np.testing.assert_allclose(found[1], found[3], rtol=1e-12)
