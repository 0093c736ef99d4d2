"""Analyses with an antenna and a wheel on arms, its scale factor a state: each against a second computation."""

import dataclasses

import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")

RATE = 20.0
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
TRUTH = nj.ImuErrors(gj.WN(6e-4) + gj.GM(0.05, 2e-4), gj.WN(1.5e-6), RATE)
WHITE = nj.ImuErrors(gj.WN(8e-4), gj.WN(1.5e-6), RATE)
SCENARIO = nj.Scenario(
    nj.motions.lemniscate(12.0, RATE, attitude="navigation"), setups.on_arms(), START, every=10, output_interval=2.0
)


def covariances(truth=TRUTH, **changed):
    return nj.analyse(dataclasses.replace(SCENARIO, **changed), truth, WHITE)["filter"]


def test_sensitivities_are_differences_of_analyses():
    """Of a filter that believes too little: by the true noise of the IMU, of the antenna and of the wheel."""
    slopes = nj.sensitivities(SCENARIO, TRUTH, WHITE)
    at = {s: i for i, s in enumerate(zip(slopes.sides, slopes.names, strict=True))}
    h = 1e-3

    def of_imu(x):
        return {"truth": nj.ImuErrors(gj.WN(6e-4) + gj.GM(0.05, 2e-4 * np.exp(x)), gj.WN(1.5e-6), RATE)}

    def of_antenna(x):
        antenna = nj.GnssPosition(
            1.0, horizontal=0.05 * np.exp(x), vertical=0.1, believed=(0.05, 0.1), lever_arm=setups.ARM
        )
        return {"aiding": (antenna, SCENARIO.aiding[1])}

    def of_wheel(x):
        wheel = nj.Odometer(
            2.0, speed=0.03, sideways=0.05, believed=(0.03 * np.exp(x), 0.05), lever_arm=setups.WHEEL_ARM, scale_sd=0.02
        )
        return {"aiding": (SCENARIO.aiding[0], wheel)}

    cases = {
        ("truth", "accel GM variance"): of_imu,
        ("truth", "gnss_position n, e sd"): of_antenna,
        ("filter", "odometer speed sd"): of_wheel,
    }
    for case, louder in cases.items():
        high, low = (covariances(**louder(x)).rms("position") for x in (h, -h))
        np.testing.assert_allclose(
            slopes.derivative["position"][:, at[case]], (high - low) / (2 * h), rtol=1e-4, atol=1e-9, err_msg=str(case)
        )


def test_the_budget_has_the_scale_factor_and_adds_up():
    """Every component at every epoch, 1e-8; the part of the antenna is that of another analysis."""
    budget = nj.error_budget(SCENARIO, TRUTH, WHITE)
    assert budget.sources[-3:] == ("gnss_position", "odometer scale", "odometer")
    whole = covariances()
    np.testing.assert_allclose(budget.part.sum(axis=0), whole.sd[:, :9] ** 2, rtol=1e-8)
    rows = dict(zip(budget.sources, budget.part, strict=True))
    # of an antenna twice as noisy, with the gains of the same filter, a part is four times as large
    antenna = nj.GnssPosition(1.0, horizontal=0.1, vertical=0.2, believed=(0.05, 0.1), lever_arm=setups.ARM)
    more = covariances(aiding=(antenna, SCENARIO.aiding[1])).sd[:, :9] ** 2 - whole.sd[:, :9] ** 2
    np.testing.assert_allclose(rows["gnss_position"], more / 3, rtol=1e-6, atol=1e-14)
    assert (rows["odometer scale"][:, :3].sum(axis=1) > 0).all()


def test_a_design_with_them():
    """What candidates claim is true of them; that with a process comes to the right filter, and none is better."""
    found = nj.design(SCENARIO, TRUTH, max_accel=1, max_gyro=0, max_steps=20)
    white, full = found.candidates
    assert (white.num_accel, full.num_accel) == (0, 1)
    right = found.right[0]
    for c in found.candidates:
        mine = c.covariances[0]
        # the score judges all epochs together
        assert 0.8 < np.mean(mine.nees("navigation")) / 9 < 1.25
        assert np.all(mine.rms("position") >= right.rms("position") * (1 - 1e-9))
    assert full.loss <= white.loss
    np.testing.assert_allclose(full.covariances[0].sd[:, :9], right.sd[:, :9], rtol=1e-2)
    np.testing.assert_allclose(full.covariances[0].rms_claimed("position"), right.rms("position"), rtol=1e-2)
