"""What wheels do not do, and how sure one is of that: in turns, over bumps, on hills and on an engine that shakes."""

import dataclasses

import numpy as np
import pytest

import nav_jax as nj

RATE = 100.0
AXLE = nj.aiding.NonHolonomic(10.0, right=0.03, down=0.04)


def sd_of(fixes):
    return np.sqrt(np.diagonal(fixes.covariance, axis1=1, axis2=2))


def drive(height):
    """20 s straight on at 5 m/s, the body level, at a height over the time: samples, and how fast it moves down."""
    time = np.arange(0.0, 20.0, 1 / RATE)
    position = np.column_stack([5.0 * time, 0 * time, -height(time)])
    imu, exact = nj.perfect_imu(nj.Trajectory.from_euler(time, position, np.zeros((len(time), 3))))
    return imu, lambda t: np.interp(t, exact.time, exact.velocity[:, 2])


def bump(time):
    """8 cm high, under the wheels for 0.6 s."""
    return np.where(np.abs(time - 10.0) < 0.3, 0.04 * (1 + np.cos(np.pi * (time - 10.0) / 0.3)), 0.0)


def test_over_a_bump_they_are_as_unsure_as_wheels_go_up_and_down():
    imu, falls = drive(bump)
    fixes, trusting = (nj.recorded.constrained(AXLE, imu, bumps=b) for b in (1.0, 0.0))
    down = falls(fixes.time)
    assert np.abs(down / sd_of(trusting)[:, 1]).max() > 5.0
    assert np.abs(down / sd_of(fixes)[:, 1]).max() < 3.0
    # and before and after it, and sideways, as ever
    away = np.abs(fixes.time - 10.0) > 1.9
    np.testing.assert_allclose(sd_of(fixes)[away, 1], 0.04, rtol=0.01)
    np.testing.assert_array_equal(sd_of(fixes)[:, 0], sd_of(trusting)[:, 0])


def test_a_hill_and_an_engine_are_no_bumps():
    imu, falls = drive(lambda t: 10.0 * (1 - np.cos(np.pi * t / 20.0)))
    assert np.abs(falls(imu.time)).max() > 1.5
    np.testing.assert_allclose(sd_of(nj.recorded.constrained(AXLE, imu))[:, 1], 0.04, rtol=0.02)
    shaken = imu.accel + 3.0 * np.sin(2 * np.pi * 31.0 * imu.time)[:, None]
    shaken = dataclasses.replace(imu, accel=shaken)
    np.testing.assert_allclose(sd_of(nj.recorded.constrained(AXLE, shaken))[:, 1], 0.04, rtol=0.1)


def test_what_is_wrong_is_said():
    imu, _ = drive(bump)
    with pytest.raises(ValueError, match="bumps"):
        nj.recorded.constrained(AXLE, imu, bumps=-1.0)
    with pytest.raises(ValueError, match="slip"):
        nj.recorded.constrained(AXLE, imu, slip=-1.0)
