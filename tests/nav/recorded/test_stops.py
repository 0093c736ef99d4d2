"""Where a drive stands: on simulated drives whose truth is known, and on a real one."""

from pathlib import Path

import numpy as np
import pytest

import nav_jax as nj
from nav_jax.recorded import GnssRecord, standing, stops

RATE = 100.0
REAL = Path(__file__).parents[3] / "../shared/data/real_drive.npz"
LIMITS = {"accel_sd": 0.3, "gyro_sd": 0.03}


def drive(*, shaken=0.02, rolls=0.0, seed=0):
    """20 s at rest, 10 s of driving with vibration, 10 s at rest, 20 s that roll (m/s^2) without any vibration."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 60.0, 1 / RATE)
    moves = (time >= 20.0) & (time < 30.0)
    pulls = np.where(moves & (time < 22.0), 2.0, np.where(moves & (time >= 28.0), -2.0, 0.0))
    pulls = np.where(time >= 40.0, rolls, pulls)
    speed = np.concatenate([[0.0], np.cumsum(pulls)[:-1]]) / RATE
    accel = np.stack([pulls, 0 * time, 0 * time - 9.81], axis=1) + shaken * rng.normal(size=(len(time), 3))
    accel[moves] += rng.normal(size=(moves.sum(), 3))
    gyro = 0.002 * rng.normal(size=(len(time), 3))
    gyro[moves] += 0.1 * rng.normal(size=(moves.sum(), 3))
    imu = nj.Imu(time, gyro, accel, RATE)
    at = np.arange(0.25, 60.0, 0.25)
    v = np.stack([np.interp(at, time, speed), 0 * at, 0 * at], axis=1) + 0.02 * rng.normal(size=(len(at), 3))
    C = np.broadcast_to(np.eye(3) * 0.02**2, (len(at), 3, 3))
    return imu, GnssRecord(at, np.zeros((len(at), 3)), velocity=v, velocity_covariance=C)


def test_a_vehicle_that_stands_twice():
    imu, fixes = drive()
    for found in (stops(imu, **LIMITS), stops(imu, fixes)):
        assert len(found) == 2
        np.testing.assert_allclose(found, [(0.0, 20.0), (30.0, 60.0)], atol=0.51)


def test_a_car_that_rolls_off_a_slope_stands_no_more():
    """It does not vibrate, but it is pulled, and fixes see it go."""
    imu, fixes = drive(rolls=0.3)
    for found in (stops(imu, **LIMITS), stops(imu, fixes)):
        assert found[-1][1] <= 40.5
    slowly, seen = drive(rolls=0.05)  # less than the forces of two windows may differ by
    assert stops(slowly, **LIMITS)[-1][1] == 60.0
    assert stops(slowly, seen)[-1][1] < 44.0


def test_one_window_is_no_stop():
    imu, _ = drive()
    moving = nj.recorded.between(imu, 19.5, 30.5)
    assert stops(moving, **LIMITS) == ()


def test_what_is_wrong_is_said():
    imu, fixes = drive()
    with pytest.raises(ValueError, match="Give fixes with velocities, or the standard deviations at rest: gyro_sd is"):
        stops(imu, accel_sd=0.3)
    with pytest.raises(ValueError, match="The fixes have no velocities"):
        stops(imu, GnssRecord(fixes.time, fixes.position))
    with pytest.raises(ValueError, match=r"A window of 0.02 s has 2 samples at 100 Hz"):
        stops(imu, fixes, window=0.02)
    with pytest.raises(ValueError, match="No stop of 1 lasts the 1 s of a period of zero_velocity"):
        standing(nj.aiding.ZeroVelocity(1.0, sd=0.02), [(3.0, 3.4)])
    with pytest.raises(ValueError, match="There is no stop for zero_velocity: leave it out"):
        standing(nj.aiding.ZeroVelocity(1.0, sd=0.02), [])


def test_their_fixes_are_zeros_inside():
    fixes = standing(nj.aiding.ZeroRate(4.0, sd=1e-3), [(1.0, 2.0), (5.0, 5.6)])
    np.testing.assert_allclose(fixes.time, [1.25, 1.5, 1.75, 2.0, 5.25, 5.5])
    assert not fixes.value.any()


@pytest.mark.skipif(not REAL.exists(), reason="needs the recordings of ../shared/data")
def test_a_real_drive():
    """Whatever is found, receivers see no motion there; and the stops that are plain to see are found."""
    given = np.load(REAL)
    ms = given["imu_ms"]
    label = given["imu_clock"] @ [1.0, 0.0] + given["imu_clock"][1] * (ms - ms[0]) / 1000
    turn = given["imu_to_frd"].T
    # even steps: the clock of the sensor is better than that
    time = label[0] - 0.32 + np.arange(len(ms)) * (label[-1] - label[0]) / (len(ms) - 1)
    rate = (len(ms) - 1) / (label[-1] - label[0])
    gyro, accel = np.deg2rad(given["imu_gyro_mdps"] * 1e-3) @ turn, given["imu_accel_mg"] * 9.80665e-3 @ turn
    imu = nj.Imu(time, gyro, accel, rate)
    sd = given["gnss_velocity_sd_neu"].astype(float)
    v, at = given["gnss_velocity_ned"].astype(float), given["gnss_time"] - 0.125
    fixes = GnssRecord(at, np.zeros_like(v), velocity=v, velocity_covariance=np.einsum("fi,ij->fij", sd**2, np.eye(3)))
    found = stops(imu, fixes)
    speed = np.hypot(*v.T[:2])
    for a, b in found:
        assert speed[(at >= a) & (at <= b)].max() < 0.1
    standing_still = sum(b - a for a, b in found)
    assert 40.0 < standing_still < 0.25 * np.sum(speed < 0.1)
    for sure in (10.0, 200.0, 263.0, 535.0):
        assert any(a < sure < b for a, b in found), sure
