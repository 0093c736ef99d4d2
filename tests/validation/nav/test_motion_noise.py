"""Noise in motion: p values where the noise at rest holds, coverage of factors at zero and above, bands of 4 sigma."""

import numpy as np
import pytest
from nav.recorded.test_motion_noise import SECONDS, WINDOW, shaken
from nav.recorded.test_tuning import TRUTH, drive

import nav_jax as nj

RECORDS = 40


def band(p, n):
    """Where a fraction of n draws is, 4 sigma about p."""
    half = 4 * np.sqrt(p * (1 - p) / n)
    return p - half, p + half


@pytest.fixture(scope="module")
def at_rest():
    found = []
    for seed in range(100, 100 + RECORDS):
        imu, fixes, start = drive(seed, SECONDS)
        found.append(nj.recorded.noise_in_motion(imu, fixes, TRUTH, window=WINDOW, every=4, **start))
    return found


def test_where_the_noise_at_rest_holds_a_test_says_so(at_rest, judge):
    """At the edge a ratio is zero half of the time; that two axes tell something of each other makes it more often."""
    assert all(f.converged for f in at_rest)
    below = np.mean([f.p_of_all < 0.1 for f in at_rest])
    judge("p of all axes < 0.1, noise at rest", below, 0.0, band(0.1, RECORDS)[1], num_draws=RECORDS)
    below = np.mean([f.p < 0.1 for f in at_rest])
    judge("p of an axis < 0.1, noise at rest", below, 0.0, band(0.1, 6 * RECORDS)[1], num_draws=6 * RECORDS)
    covered = np.mean([f.ci_low == 0 for f in at_rest])
    judge("coverage of factors of zero, 95 %", covered, band(0.95, 6 * RECORDS)[0], 1.0, num_draws=6 * RECORDS)


def test_factors_of_a_record_that_vibrates_are_covered(judge):
    covered, ratios = [], []
    for seed in range(200, 200 + RECORDS):
        imu, fixes, start, density = shaken(seed)
        one = nj.imu.VibrationNoise(1.0, 1.0, WINDOW).densities(imu)
        kappa = density.sum(axis=0) / one.sum(axis=0)
        found = nj.recorded.noise_in_motion(imu, fixes, TRUTH, window=WINDOW, every=4, **start)
        assert found.converged
        covered.append((found.ci_low <= kappa) & (kappa <= found.ci_high))
        ratios.append(found.factor / kappa)
    n = 6 * RECORDS
    # an interval that ends at zero covers more often than it says
    judge("coverage of factors of vibration, 95 %", np.mean(covered), band(0.95, n)[0], 1.0, num_draws=n)
    ratios = np.array(ratios)
    off = (ratios.mean(axis=0) - 1) / (ratios.std(axis=0, ddof=1) / np.sqrt(RECORDS))
    judge("bias of factors of vibration, in standard errors", off[[0, 3, 5]], -4.0, 4.0, num_draws=RECORDS)
