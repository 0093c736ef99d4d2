"""Designs for truths that are in the family, or have no part in it; what a calibration adds to the error."""

import jax
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


START = setups.START


@pytest.fixture(scope="module")
def fits():
    return setups.fits()


def test_an_interval_of_the_navigation_error(fits):
    """The spread over draws is that of the delta method; the loss by not knowing is never negative."""
    accel, gyro = fits
    scenario = nj.Scenario(nj.motions.lemniscate(10.0, setups.RATE), setups.aiding(6.0, 10.0), START, every=10)
    c = nj.calibration_effect(scenario, accel, gyro, key=jax.random.key(1), num_draws=64)
    low, high = c.interval("position")
    assert np.all(low <= c.rms["position"])
    assert np.all(c.rms["position"] <= high)
    spread = np.std(np.log(c.used["position"]), axis=0)[-1]
    assert spread == pytest.approx(c.delta_sd["position"][-1], rel=0.35)  # 3 sigma of 64 draws, and the curvature
    for used, best in zip(c.used["position"], c.best["position"], strict=True):
        assert np.all(best <= used * (1 + 1e-9))
    assert c.loss("position")[-1] >= 0
    assert "perfect calibration" in repr(c)


def test_a_design_for_a_random_walk():
    """The truth is in the family: found, and named as what it is."""
    truth = nj.ImuErrors(gj.WN(6e-5) + gj.RW(1e-7), gj.WN(1.5e-6), setups.RATE)
    scenario = nj.Scenario(nj.motions.lemniscate(12.0, setups.RATE), setups.aiding(6.0, 12.0), START, every=20)
    d = nj.design(scenario, truth, max_accel=1, max_gyro=0)
    white, walk = d.candidates
    assert walk.name == "1 RW accel, 0 GM gyro"
    k = walk.covariances[0].epoch()
    assert walk.loss < white.loss
    assert walk.loss == pytest.approx(walk.loss_naive, abs=1e-6)
    right = d.right[0].rms("position")[k]
    assert walk.covariances[0].rms("position")[k] == pytest.approx(right, rel=1e-3)
    assert float(walk.errors.models[0].processes[1].gamma2) == pytest.approx(1e-7, rel=0.02)


def test_a_truth_of_higher_order_has_no_part_in_the_family():
    """Then there is nothing naive to compare with; more states do no harm."""
    truth = nj.ImuErrors(gj.WN(6e-5) + gj.MAT32(1e-4, 0.01), gj.WN(1.5e-6), setups.RATE)
    scenario = nj.Scenario(nj.motions.lemniscate(12.0, setups.RATE), setups.aiding(6.0, 12.0), START, every=20)
    d = nj.design(scenario, truth, max_accel=1, max_gyro=0)
    assert [c.naive is None for c in d.candidates] == [False, True]
    assert d.candidates[1].covariances_naive == ()
    assert d.candidates[1].loss < d.candidates[0].loss
    assert "-" in repr(d).splitlines()[3]
    k = d.right[0].epoch()
    for c in d.candidates:
        assert c.covariances[0].rms("position")[k] >= d.right[0].rms("position")[k] * (1 - 1e-9)
