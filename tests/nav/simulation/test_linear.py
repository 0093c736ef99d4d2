"""Linear runs: the linear part of those on shared gains, with the means that are known of them."""

import dataclasses

import jax
import numpy as np
import pytest

import nav_jax as nj
from nav_jax.filter.experiment import Setup
from nav_jax.simulation import campaign, linear
from nav_jax.simulation.levels import LINEAR, STATISTICS

RATE = 20.0
KEY = jax.random.key(8)
GNSS = nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=[(2.5, 5.0)])
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([1.0, 1.0, 5.0]))
SCENARIO = nj.Scenario(nj.motions.lemniscate(6.0, RATE), [GNSS], START)
ERRORS = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-7)", RATE)
FILTERS = {"right": ERRORS, "calm": nj.ImuErrors("WN(sigma2=1e-5)", "WN(sigma2=1e-8)", RATE)}
HOW = {"key": KEY, "smooth": False, "chunk_size": None, "workers": None, "devices": None, "progress": False}


@pytest.fixture(scope="module")
def setup():
    return Setup(SCENARIO, RATE)


def runs(setup, gains, num_runs):
    return campaign._compare(setup, ERRORS, FILTERS, num_runs=num_runs, gains=gains, **HOW)


def test_they_are_what_runs_on_shared_gains_are_to_first_order(setup):
    """Of the same draws: a difference of second order, which is four times as small where the errors are half."""
    whole, half = (linear.with_errors(setup.experiment, ERRORS, factor) for factor in (0.1, 0.05))
    keys = nj.filter.run_keys(KEY, 0, 8)
    gains = nj.filter.gains_of(setup.experiment, ERRORS)
    exact = runs(setup, LINEAR, 8)["right"].error[:, -1, :9].T
    off = []
    for factor, (experiment, truth) in ((0.1, whole), (0.05, half)):
        inputs = nj.filter.draw_inputs(experiment, truth, keys)
        error = nj.filter.run_filter(experiment, ERRORS, inputs, gains).judgement.error[-1, :9]
        off.append(np.asarray(error) - factor * exact)
    assert np.abs(off[0]).max() < 0.01 * np.abs(exact).max()
    ratio = np.linalg.norm(off[0], axis=1) / np.linalg.norm(off[1], axis=1)
    np.testing.assert_allclose(ratio, 4.0, rtol=0.05)


def test_their_means_are_known(setup):
    """2048 runs of two filters, at every epoch: 4.5 standard errors, of 48 numbers."""
    found = runs(setup, LINEAR, 2048)
    known = linear.known_means(setup, ERRORS, FILTERS, smooth=False)
    assert known is not None
    for name in FILTERS:
        for statistic, of in STATISTICS.items():
            values = of(found[name])
            se = values.std(axis=0, ddof=1) / np.sqrt(len(values))
            assert np.abs((values.mean(axis=0) - known[name][statistic]) / se).max() < 4.5, (name, statistic)


def test_what_is_known_is_what_an_analysis_says(setup):
    analysis = nj.analyse(SCENARIO, ERRORS, FILTERS)
    known = linear.known_means(setup, ERRORS, FILTERS, smooth=False)
    assert known is not None
    for name in FILTERS:
        np.testing.assert_allclose(known[name]["nees"], analysis[name].nees("pose") / 6, rtol=1e-9)
        # a mean length is between 0.798 (along a line) and 0.921 (all directions alike) of the root of a mean square
        ratio = known[name]["position"] / analysis[name].rms("position")
        assert np.all((ratio > np.sqrt(2 / np.pi)) & (ratio < np.sqrt(8 / (3 * np.pi)) + 1e-12))


@pytest.mark.parametrize(
    ("what", "is_known"),
    [
        ({}, True),
        ({"smooth": True}, False),
        ({"truth": nj.RecordedErrors(np.zeros((200, 3)), np.zeros((200, 3)), RATE)}, False),
        ({"truth": nj.ImuErrors("WN(sigma2=1e-4) + BI(B=1e-4)", "WN(sigma2=1e-7)", RATE)}, False),
        ({"aiding": nj.GnssVelocity(horizontal=0.1, vertical=0.2, lever_arm=(1.0, 0.0, 0.0))}, False),
    ],
    ids=["a model", "a smoother", "a recording", "noise of long memory", "a sensor that asks for the body rate"],
)
def test_nobody_knows_them_of(what, is_known, setup):
    if "aiding" in what:
        setup = Setup(dataclasses.replace(SCENARIO, aiding=[what["aiding"]]), RATE)
    truth, smooth = what.get("truth", ERRORS), what.get("smooth", False)
    assert (linear.known_means(setup, truth, FILTERS, smooth=smooth) is not None) == is_known


def test_all_errors_become_as_small():
    """Covariances of start, noise, states and constants; what fades, what is believed and a step's noise stay."""
    motion = nj.motions.lemniscate(6.0, RATE)
    baro = nj.Barometer(height="WN(sigma2=0.01) + GM(beta=0.1, variance=0.04)", offset_sd=2.0, believed=0.3)
    truth = nj.ImuErrors(
        "WN(sigma2=1e-4) + QN(q2=1e-6) + DR(omega=1e-5) + MAT32(beta=0.1, variance=1e-4)",
        ["GM(beta=0.1, variance=1e-8)", "RW(gamma2=1e-9)", "WN(sigma2=1e-8)"],
        RATE,
        accel_bias_sd=0.1,
        deterministic=[nj.imu.ScaleFactor(1e-3, 1e-3)],
        gravity=nj.imu.GravityDisturbance(deflection=1e-5, anomaly=1e-4, distance=500.0),
        output=nj.imu.Output(accel_step=1e-3, gyro_step=1e-5),
    )
    before = Setup(nj.Scenario(motion, [baro], START), RATE).experiment
    after, small = linear.with_errors(before, truth, 0.1)
    banks = [e.bank(complete=True) for e in (truth, small)]
    for name in ("driving", "initial", "white"):
        of, less = (getattr(b, name) for b in banks)
        np.testing.assert_allclose(less, 0.01 * np.asarray(of), rtol=1e-12, atol=1e-30, err_msg=name)
    np.testing.assert_array_equal(banks[1].transition, banks[0].transition)
    assert banks[0].travel is not None
    assert banks[1].travel is not None
    np.testing.assert_array_equal(banks[1].travel.inverse, banks[0].travel.inverse)
    np.testing.assert_allclose(banks[1].travel.variance, 0.01 * np.asarray(banks[0].travel.variance), rtol=1e-12)
    np.testing.assert_allclose(after.initial.covariance, 0.01 * np.asarray(before.initial.covariance))
    np.testing.assert_allclose(after.timeline.drawn.initial, 0.01 * np.asarray(before.timeline.drawn.initial))
    np.testing.assert_array_equal(after.timeline.own.initial, before.timeline.own.initial)
    (sensor,), (was,) = after.sensors, before.sensors
    np.testing.assert_array_equal(sensor.believed, was.believed)
    frequency = np.array([0.01, 0.2])
    np.testing.assert_allclose(sensor.noise[0].psd(frequency), 0.01 * was.noise[0].psd(frequency))
