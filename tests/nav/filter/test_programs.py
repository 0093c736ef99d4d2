"""Preparing one scenario or record after another does not pile up compiled programs."""

import numpy as np
import pytest

import nav_jax as nj
from gmwm_jax._internal import programs
from nav_jax.recorded.navigation import prepare_navigation

RATE, LIMIT = 5.0, 6


def scenario(reference):
    nj.filter.prepare(nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)]), rate=RATE)


def record(reference):
    imu, _ = nj.perfect_imu(reference, RATE)
    errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=RATE)
    start = {"position": np.zeros(3), "velocity": np.zeros(3), "quaternion": np.array([1.0, 0.0, 0.0, 0.0])}
    prepare_navigation(imu, [], errors, **start, every=1, output_interval=1.0, earth=None)


@pytest.mark.slow
@pytest.mark.parametrize("prepare", [scenario, record])
def test_programs_of_many_lengths_are_bounded(prepare, monkeypatch):
    """Each length has programs of its own; beyond the limit there are never more than those of one preparation."""
    monkeypatch.setattr(programs, "MAX_PROGRAMS", -1)
    programs.bound_programs()
    monkeypatch.setattr(programs, "MAX_PROGRAMS", LIMIT)
    held = [0]
    for duration in (2.0, 3.0, 4.0, 5.0):
        prepare(nj.motions.lemniscate(duration=duration, rate=RATE))
        held.append(programs.num_programs())
    of_one = np.diff(held).max()
    assert of_one > 0
    assert max(held) <= LIMIT + of_one
    assert np.diff(held).min() < 0  # they were too many, and were forgotten
