"""What is in a record: simulated drives with rest, gaps, biases and clocks that are apart, all of them known."""

from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.recorded.clocks import Offset

RATE = 50.0
BIAS = np.deg2rad([0.05, -0.1, 0.2])
MOUNT = Rotation.from_euler("ZYX", [0.6, -0.3, 0.2])
ORIGIN = np.array([0.8, 0.1, 400.0])


def drive(offset=0.0, seed=2, rest=10.0):
    """At rest, then round a racetrack whose straights are driven faster and slower; the IMU along axes of its own."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 120.0, 1 / RATE)
    speed = np.where(time < rest, 0.0, 6.0 * (1 - np.exp(-(time - rest).clip(0) / 3)))
    speed = speed + np.where(time < rest, 0.0, 1.5 * np.sin(0.4 * (time - rest)))
    speed = np.convolve(np.pad(speed, 25, mode="edge"), np.ones(51) / 51, mode="valid")
    moved = (time - rest).clip(0)
    course = 0.8 * np.sin(0.15 * moved) + 0.05 * moved
    velocity = speed[:, None] * np.column_stack([np.cos(course), np.sin(course), 0 * course])
    position = np.cumsum(velocity, axis=0) / RATE
    path = nj.Trajectory.from_euler(time, position, np.column_stack([0 * course, 0 * course, course]))
    imu, exact = nj.perfect_imu(path)
    n = len(imu)
    gyro = imu.gyro @ MOUNT.as_matrix() + BIAS + rng.normal(0.0, 2e-3, (n, 3))
    accel = imu.accel @ MOUNT.as_matrix() + rng.normal(0.0, 0.03, (n, 3))
    at = slice(0, None, 10)
    fixes = nj.recorded.GnssRecord(
        exact.time[at],
        exact.position[at] + rng.normal(0.0, 0.003, exact.position[at].shape),
        ORIGIN,
        velocity=exact.velocity[at] + rng.normal(0.0, 0.03, exact.velocity[at].shape),
        quality=np.where(np.arange(len(exact.time[at])) % 5 == 0, 2, 1),
        kinds={1: "fix", 2: "float"},
    )
    return imu.time + offset, gyro, accel, fixes


@pytest.mark.parametrize("offset", [0.0, 0.33, -0.715])
def test_clocks_that_are_apart(offset):
    found = nj.recorded.inspect_record(*drive(offset))
    assert set(found.time_offsets) == {"positions", "velocities"}
    for value, se in found.time_offsets.values():
        assert se < 0.06
        assert abs(value - offset) < max(4 * se, 0.01)
    turns, speed = (o for o in found.offsets if o.fixes == "velocities")
    assert min(turns.best, speed.best) > 0.8


def test_velocities_of_a_moment_ago():
    """As of receivers that give the mean over the past interval: the two offsets differ by half of it."""
    time, gyro, accel, fixes = drive(0.2)
    late = nj.recorded.GnssRecord(fixes.time + 0.1, fixes.position, velocity=fixes.velocity)
    at = nj.recorded.GnssRecord(fixes.time, fixes.position)
    by_velocity = nj.recorded.inspect_record(time, gyro, accel, late).time_offsets["velocities"]
    by_position = nj.recorded.inspect_record(time, gyro, accel, at).time_offsets["positions"]
    assert by_position[0] - by_velocity[0] == pytest.approx(0.1, abs=0.02)


def test_rest_tells_biases_gravity_and_tilt():
    time, gyro, accel, fixes = drive()
    found = nj.recorded.inspect_record(time, gyro, accel, fixes)
    (rest,) = found.rests
    assert rest.start == pytest.approx(0.0, abs=0.1)
    assert 7.0 < rest.end < 10.0
    np.testing.assert_allclose(rest.gyro, BIAS, rtol=0, atol=5e-4)
    assert rest.gravity == pytest.approx(9.80665, abs=5e-3)
    # levelling knows the tilt of the IMU, whatever its heading
    R = MOUNT.as_matrix()  # takes the axes of the IMU to those of the body, which is level
    np.testing.assert_allclose(rest.tilt, [np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0])], rtol=0, atol=2e-3)
    assert found.course[0] == pytest.approx(11.0, abs=1.0)
    assert found.course[1] >= 2.0


def test_gaps_rates_and_stamps():
    time, gyro, accel, fixes = drive()
    keep = np.ones(len(time), dtype=bool)
    keep[1000:1100] = False
    keep[3000] = False
    found = nj.recorded.inspect_record(np.round(time, 3)[keep], gyro[keep], accel[keep], fixes.select(np.arange(400)))
    assert found.imu.rate == pytest.approx(RATE, rel=1e-4)
    assert [round(length, 3) for _, length in found.imu.gaps] == [2.02, 0.04]
    assert found.imu.gaps[0][0] == pytest.approx(time[999])
    assert found.fixes.rate == pytest.approx(5.0)
    text = repr(found)
    parts = ("2 gaps, the longest of 2.02 s after", "fixes at 5 Hz", "80 x 2 (float)", "of rest", "normal gravity")
    assert not [part for part in parts if part not in text]
    assert found.to_dict()["imu"]["gaps"][0][1] == pytest.approx(2.02)


def test_what_a_record_does_not_tell():
    time, gyro, accel, fixes = drive()
    noise = np.random.default_rng(0).normal(size=(2, *gyro.shape))
    found = nj.recorded.inspect_record(time, 0.01 * noise[0], noise[1], fixes)
    assert found.time_offsets == {}
    assert "not told by this record" in repr(found)
    away = nj.recorded.inspect_record(time, gyro, accel, fixes.shifted(1e6))
    assert "never there at the same time" in repr(away)
    alone = nj.recorded.inspect_record(time, gyro, accel)
    assert alone.fixes is None
    assert alone.offsets == ()
    with pytest.raises(ValueError, match="does not increase"):
        nj.recorded.inspect_record(time[::-1], gyro, accel)


def test_offsets_of_a_real_drive(shared):
    """Found by others: 0.32 s, and velocities of an eighth of a second before their time."""
    d = np.load(shared / "data" / "real_drive.npz")
    time = d["imu_clock"][0] + d["imu_clock"][1] * (d["imu_ms"] - d["imu_ms"][0]) / 1000
    llh = np.column_stack([d["gnss_lat_lon_deg"], d["gnss_height"]])
    ned = np.column_stack(pymap3d.geodetic2ned(*llh.T, *llh[0]))
    fixes = nj.recorded.GnssRecord(d["gnss_time"].astype(float), ned, velocity=d["gnss_velocity_ned"].astype(float))
    gyro, accel = np.deg2rad(d["imu_gyro_mdps"] / 1e3), d["imu_accel_mg"] * 9.80665e-3
    found = nj.recorded.inspect_record(time, gyro, accel, fixes)
    offsets = {name: value for name, (value, _) in found.time_offsets.items()}
    assert offsets["positions"] == pytest.approx(0.32, abs=0.04)
    assert offsets["positions"] - offsets["velocities"] == pytest.approx(0.125, abs=0.03)


def test_signals_that_disagree_make_an_offset_less_sure():
    """By the root of chi-square over its degrees of freedom, and not surer than they are where they agree."""
    inspected, none = nj.recorded.inspect_record(*drive()), np.zeros(3)

    def offsets(*values):
        signals = zip(("turns", "speed"), values, strict=True)
        told = tuple(Offset("positions", s, none, none + 0.9, v, 0.03, 99) for s, v in signals)
        return replace(inspected, offsets=told).time_offsets["positions"]

    assert offsets(0.1, 0.12) == pytest.approx((0.11, 0.03 / np.sqrt(2)))
    assert offsets(0.0, 0.3) == pytest.approx((0.15, 0.15))
