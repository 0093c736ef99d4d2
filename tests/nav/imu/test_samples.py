"""Coning and sculling: against motions of closed form, and what a record says that its numbers are."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.kinematics import strapdown

DT = 0.01
FREE = nj.FlatEarth(0.0)


def led(imu):
    """Velocity and attitude after the samples, from rest and level."""
    start = (jnp.zeros(3), jnp.zeros(3), jnp.array([1.0, 0.0, 0.0, 0.0]))
    _, v, q = strapdown.integrate(*start, jnp.asarray(imu.gyro), jnp.asarray(imu.accel), jnp.full(len(imu), DT), FREE)
    return np.asarray(v)[-1], Rotation.from_quat(np.asarray(q)[-1], scalar_first=True)


def means(of, num):
    """Means over samples of a function of time, to rounding."""
    return np.array([quad_vec(of, k * DT, (k + 1) * DT, epsabs=1e-14)[0] for k in range(num)]) / DT


ANGLE, TURN = np.deg2rad(1.0), 2 * np.pi * 10.0


def coning(t):
    """Body rate of an axis that goes round a cone of half angle 1 deg ten times a second; it comes back each time."""
    # C = exp(angle [cos, sin, 0]): the rate about the axis of the cone is -turn (1 - cos(angle))
    return np.array(
        [
            -np.sin(ANGLE) * TURN * np.sin(TURN * t),
            np.sin(ANGLE) * TURN * np.cos(TURN * t),
            -TURN * (1 - np.cos(ANGLE)),
        ]
    )


def test_a_cone_is_no_drift():
    """127 deg/h where it is neglected, and less than 9.8 deg/h about the axis of the cone."""
    num = 100  # ten rounds
    gyro, still = means(coning, num), np.zeros((num, 3))
    drift = {}
    for samples in ("held", "averages"):
        _, q = led(nj.imu.imu_of_samples(np.arange(num) * DT, gyro, still, 1 / DT, samples=samples))
        drift[samples] = abs(np.rad2deg(q.as_rotvec()[2]) * 3600)
    assert drift["held"] == pytest.approx(127, rel=0.01)
    assert drift["averages"] < 9.8


def test_sculling_is_no_force():
    """Swinging by 1 deg in phase with 5 m/s^2 at 10 Hz has a mean force of 0.0436 m/s^2, of which 2.8e-3 were lost."""

    def rate(t):
        return np.array([ANGLE * TURN * np.cos(TURN * t), 0.0, 0.0])

    def force(t):
        return np.array([0.0, 5.0 * np.sin(TURN * t), 0.0])

    def along(t):
        angle = ANGLE * np.sin(TURN * t)
        return force(t)[1] * np.array([0.0, np.cos(angle), np.sin(angle)])

    num = 100
    truth = quad_vec(along, 0.0, num * DT, epsabs=1e-12, limit=1000)[0]
    off = {}
    for samples in ("held", "averages"):
        imu = nj.imu.imu_of_samples(np.arange(num) * DT, means(rate, num), means(force, num), 1 / DT, samples=samples)
        off[samples] = abs(led(imu)[0] - truth)[2] / (num * DT)
    assert truth[2] == pytest.approx(0.0436, rel=1e-2)
    assert off["held"] == pytest.approx(2.81e-3, rel=0.03)
    assert off["averages"] < 2.2e-4


@pytest.mark.slow
def test_instants_are_joined_to_means():
    """Their mean is of second order in the interval: 10 s of slow turning are right to 1e-4."""
    time = np.arange(1001) * DT
    gyro = np.stack([0.2 * np.sin(time), 0.1 * np.cos(2 * time), 0.05 * time], axis=1)
    accel = np.stack([np.cos(time), np.sin(3 * time), 0 * time - 9.8], axis=1)
    of_means = nj.imu.imu_of_samples(time[:-1], means(lambda t: np.array(
        [0.2 * np.sin(t), 0.1 * np.cos(2 * t), 0.05 * t]), 1000), means(lambda t: np.array(
            [np.cos(t), np.sin(3 * t), -9.8]), 1000), 100.0)  # fmt: skip
    of_instants = nj.imu.imu_of_samples(time, gyro, accel, 100.0, samples="instants")
    assert len(of_instants) == 1000
    (v, q), (v_, q_) = led(of_means), led(of_instants)
    np.testing.assert_allclose(v_, v, rtol=0, atol=1e-3)
    assert (q * q_.inv()).magnitude() < 1e-4


@pytest.mark.parametrize(("stamps", "shift"), [("begin", 0.0), ("middle", 0.5), ("end", 1.0)])
def test_a_stamp_marks_what_one_says(stamps, shift):
    time = 5.0 + np.arange(50) * DT
    imu = nj.imu.imu_of_samples(time, np.zeros((50, 3)), np.zeros((50, 3)), 100.0, stamps=stamps)
    np.testing.assert_allclose(imu.time, time - shift * DT, rtol=0, atol=1e-12)


def test_held_samples_stay_as_they_are():
    time, x = np.arange(50) * DT, np.random.default_rng(0).normal(size=(2, 50, 3))
    imu = nj.imu.imu_of_samples(time, *x, 100.0, samples="held")
    np.testing.assert_array_equal(imu.gyro, x[0])
    np.testing.assert_array_equal(imu.accel, x[1])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"samples": "mean"}, "samples is one of held, averages, instants, and is 'mean'"),
        ({"stamps": "start"}, "stamps is one of begin, middle, end, and is 'start'"),
        ({"samples": "instants", "stamps": "end"}, "leave stamps out"),
    ],
)
def test_what_is_unknown_is_refused(options, said):
    with pytest.raises(ValueError, match=said):
        nj.imu.imu_of_samples(np.arange(9.0), np.zeros((9, 3)), np.zeros((9, 3)), 1.0, **options)


def test_a_file_of_increments_says_so(tmp_path):
    """Increments of KF-GINS, stamped when they were read out."""
    rng = np.random.default_rng(1)
    rows = np.column_stack([456300 + np.arange(30) / 20, rng.normal(size=(30, 6)) * 1e-3])
    rows[:, 6] -= 9.8 / 20
    file = tmp_path / "imu.txt"
    np.savetxt(file, rows, "%.17g")
    imu = nj.read_imu(file, format="kf-gins", samples="averages", stamps="end")
    np.testing.assert_allclose(imu.time, rows[:, 0] - 1 / 20, rtol=0, atol=1e-6)
    plain = nj.read_imu(file, format="kf-gins")
    expected = nj.imu.imu_of_samples(plain.time, plain.gyro, plain.accel, plain.rate)
    np.testing.assert_array_equal(imu.gyro, expected.gyro)
    assert np.abs(imu.accel - plain.accel).max() > 0
