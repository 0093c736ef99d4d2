"""The start of a recorded drive: part of a record, stamps as loggers write them, attitude from the course."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import nav_jax as nj
from nav_jax.kinematics import rotation

RATE = 50.0
RACE = nj.motions.racetrack(duration=40.0, rate=RATE, straight=60.0, turn=20.0)
SI = {"gyro": "rad/s", "accel": "m/s^2"}


def table(imu, time):
    names = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    return dict(zip(names, np.column_stack([time, imu.gyro, imu.accel]).T, strict=True))


def test_a_part_of_a_record():
    imu, _ = nj.perfect_imu(RACE)
    part = nj.recorded.between(imu, 10.0, 20.0)
    assert (part.time[0], part.epochs[-1], len(part)) == (10.0, pytest.approx(20.0), 500)
    assert len(nj.recorded.between(imu)) == len(imu)
    with pytest.raises(ValueError, match=r"record is of 0 to 40 s, and no two samples lie in .*: 50 to 60 s"):
        nj.recorded.between(imu, 50.0, 60.0)


def test_stamps_that_are_rounded_are_read_at_the_rate():
    imu, _ = nj.perfect_imu(RACE)
    imu = replace(imu, time=3.0 + np.arange(len(imu)) / 152.3, rate=152.3)
    found = nj.read_imu(table(imu, np.round(imu.time, 3)), units=SI)
    np.testing.assert_allclose(found.time, imu.time, rtol=0, atol=2e-4)
    assert found.rate == pytest.approx(152.3, rel=1e-4)
    rng = np.random.default_rng(0)
    late = imu.time + rng.uniform(0.0, 0.4 / 152.3, len(imu))
    assert np.ptp(nj.read_imu(table(imu, late), units=SI).time - imu.time) < 3e-4
    there = np.delete(np.arange(len(imu)), 700)
    gappy = {name: x[there] for name, x in table(imu, np.round(imu.time, 3)).items()}
    with pytest.raises(ValueError, match="samples are missing in 1 gaps"):
        nj.read_imu(gappy, units=SI)


@pytest.mark.parametrize("with_velocity", [False, True])
def test_a_vehicle_heads_where_it_goes(with_velocity):
    """At rest at first; on the racetrack the roll of the motion is that of a coordinated turn, which is none here."""
    imu, exact = nj.perfect_imu(RACE)
    fixes = nj.recorded.GnssRecord(
        exact.time[::10], exact.position[::10], velocity=exact.velocity[::10] if with_velocity else None
    )
    start = nj.recorded.align_by_course(imu, fixes, speed=3.0)
    row = round(start.time * RATE)
    assert np.linalg.norm(exact.velocity[row]) >= 2.9
    np.testing.assert_allclose(start.velocity, exact.velocity[row], rtol=0, atol=0.05)
    np.testing.assert_allclose(start.position, exact.position[row], rtol=0, atol=0.1)
    turn = rotation.quat_multiply(
        jnp.asarray(start.quaternion), rotation.quat_conjugate(jnp.asarray(exact.quaternion[row]))
    )
    assert np.abs(np.asarray(rotation.quat_to_rotvec(turn))).max() < np.deg2rad(1.0)


def test_roll_and_pitch_from_the_specific_force():
    """On a slope that is banked: the course has neither."""
    euler = np.array([0.1, -0.05, 0.7])
    time = np.arange(0.0, 10.0, 0.02)
    v = 5.0 * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    position = time[:, None] * v + 0.5 * np.outer(time**2, [*0.06 * v[:2], 0.05])
    path = nj.Trajectory.from_euler(time, position, np.tile(euler, (500, 1)))
    imu, exact = nj.perfect_imu(path)
    fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10], velocity=exact.velocity[::10])
    start = nj.recorded.align_by_course(imu, fixes)
    found = np.asarray(rotation.euler_from_quat(jnp.asarray(start.quaternion)))
    np.testing.assert_allclose(found, euler, rtol=0, atol=0.015)


def test_a_vehicle_that_rests_has_no_course():
    imu, exact = nj.perfect_imu(nj.motions.static(duration=10.0, rate=RATE))
    fixes = nj.recorded.GnssRecord(exact.time[::10], exact.position[::10])
    with pytest.raises(ValueError, match=r"has a speed of 2 m/s, .*the fastest of 45 has 0 m/s\): state the attitude"):
        nj.recorded.align_by_course(imu, fixes)
