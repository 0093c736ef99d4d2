"""The perfect IMU returns the reference: every generator, every epoch, several rates, recorded references."""

import jax.numpy as jnp
import numpy as np
import pytest
from nav.cases import MOTIONS, angle_between, vertical_loop

from nav_jax.imu.imu import Imu, NoisyReferenceWarning, perfect_imu
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.earth import FlatEarth
from nav_jax.trajectory import motions
from nav_jax.trajectory.trajectory import Trajectory


def integrated(imu, start, earth):
    """What the mechanisation makes of an IMU, step by step."""
    first = (jnp.asarray(x[0]) for x in (start.position, start.velocity, start.quaternion))
    steps = jnp.full(len(imu), 1 / imu.rate)
    run = strapdown.integrate(*first, jnp.asarray(imu.gyro), jnp.asarray(imu.accel), steps, earth)
    return Trajectory(start.time, *(np.asarray(x) for x in run))


@pytest.mark.parametrize("name", ["coordinated", "navigation"])
def test_bar_lemniscate_of_300_seconds(name):
    """The bar is 1e-6 m and 1e-8 rad. What is left is rounding, and grows with the 30,000 steps.

    Of positions of 100 m and velocities of 20 m/s it is 1e-9 m or 2e-10 m by the instructions of the processor, and 50
    times that is allowed; of angles, as many steps times the unit roundoff.
    """
    ref = motions.lemniscate(300.0, 100.0, attitude=name)
    imu, returned = perfect_imu(ref)
    run = integrated(imu, returned, FlatEarth())
    for found in (run, returned):
        np.testing.assert_allclose(found.position, ref.position, atol=5e-8)
        assert angle_between(found, ref) < 1e-11
    np.testing.assert_allclose(run.velocity, returned.velocity, atol=1e-9)
    np.testing.assert_allclose(returned.velocity, ref.velocity, atol=3e-5)


@pytest.mark.parametrize("name", MOTIONS)
def test_every_motion_comes_back(name):
    ref = MOTIONS[name]()
    imu, returned = perfect_imu(ref)
    run = integrated(imu, returned, FlatEarth())
    np.testing.assert_allclose(run.position, ref.position, atol=5e-8)
    np.testing.assert_allclose(run.position, returned.position, atol=1e-8)
    assert angle_between(run, ref) < 1e-11
    assert (len(imu), imu.rate, imu.duration) == (len(ref) - 1, 100.0, pytest.approx(ref.duration))
    np.testing.assert_allclose(imu.epochs, ref.time, atol=1e-12)


@pytest.mark.parametrize(("rate", "bound"), [(10.0, 1e-7), (50.0, 1e-10), (400.0, 1e-10)])
def test_other_rates(rate, bound):
    """Measured 8e-9, 3e-12 and 1e-13 m: the error falls with a high power of the interval."""
    ref = motions.lemniscate(6000 / rate, rate, attitude="navigation")
    np.testing.assert_allclose(perfect_imu(ref)[1].position, ref.position, atol=bound)


def test_mechanised_velocity_is_that_of_euler_and_maclaurin():
    """Its first term is dt^2/12 times the derivative of the specific force in b; the next is 1000 times smaller."""
    ref = motions.lemniscate(60.0, 100.0, attitude="navigation")
    imu, returned = perfect_imu(ref)
    q = jnp.asarray(ref.quaternion[1:-1].T)
    change = strapdown.matvec(strapdown.dcm_from_quat(q), jnp.asarray(np.diff(imu.accel, axis=0).T * imu.rate)).T
    expected = -change / imu.rate**2 / 12
    np.testing.assert_allclose((returned.velocity - ref.velocity)[1:-1], expected, atol=2e-8)
    assert np.abs(expected).max() > 1e-5


def test_values_at_rest_and_in_a_turn():
    imu, _ = perfect_imu(motions.static(300.0, 20.0), earth=FlatEarth(9.8056))
    np.testing.assert_allclose(imu.gyro, 0.0, atol=1e-13)
    np.testing.assert_allclose(imu.accel, [[0.0, 0.0, -9.8056]] * 6000, atol=1e-12)
    imu, _ = perfect_imu(motions.circle(60.0, radius=50.0, speed=10.0, attitude="level"))
    np.testing.assert_allclose(imu.gyro, [[0, 0, 0.2]] * 6000, atol=1e-12)
    np.testing.assert_allclose(imu.accel, [[0, 2.0, -9.80665]] * 6000, atol=1e-8)


def test_a_loop_through_the_vertical_and_a_wrapped_yaw():
    ref = motions.from_path(vertical_loop, 50.0, 0.6, duration=60.0, rate=100.0)
    imu, returned = perfect_imu(ref)
    np.testing.assert_allclose(returned.position, ref.position, atol=5e-8)
    np.testing.assert_allclose(imu.gyro, [[0, 0.6, 0]] * 6000, atol=1e-11)
    again = Trajectory.from_euler(ref.time, ref.position, ref.euler, velocity=ref.velocity)  # pitch folds at 90 deg
    np.testing.assert_allclose(perfect_imu(again)[0].gyro, imu.gyro, atol=1e-8)


def test_resampling_to_the_rate_of_the_imu():
    ref = motions.lemniscate(30.0, 50.0)
    imu, returned = perfect_imu(ref, rate=200.0)
    fine = motions.lemniscate(30.0, 200.0)
    assert (imu.rate, len(imu)) == (200.0, 6000)
    np.testing.assert_allclose(returned.position, fine.position, atol=1e-8)
    uneven = np.delete(np.arange(len(ref)), [70, 71])
    kept = Trajectory(*(x[uneven] for x in (ref.time, ref.position, ref.velocity, ref.quaternion)))
    imu, returned = perfect_imu(kept, rate=50.0)
    assert np.ptp(np.diff(imu.time)) < 1e-12
    np.testing.assert_allclose(returned.position, ref.position, atol=1e-5)


def test_quantised_reference_warns_and_smoothing_mends_it(shared):
    data = np.load(shared / "data" / "trajectory_example_2_ned.npz")["data"][:6001]
    ref = Trajectory.from_euler(data[:, 0], data[:, 1:4], data[:, 4:], name="example_2")
    with pytest.warns(NoisyReferenceWarning, match=r"noise of x 1\.\d, y 1\.\d, z 16 .*smoothed"):
        imu, _ = perfect_imu(ref)
    assert np.abs(imu.accel).max() > 500
    smooth = ref.smoothed(0.5)
    imu, returned = perfect_imu(smooth)  # a warning would be an error here
    assert np.abs(imu.accel).max() < 18
    moved = (smooth.position - ref.position).std(axis=0)
    assert moved.max() < 0.01  # metres; the heights have jumps of 0.1 m
    np.testing.assert_allclose(returned.position, smooth.position, atol=1e-6)


def test_smooth_motions_do_not_warn_at_any_rate():
    """Vehicles that turn fast change their specific force by more than noise does, but not to and fro."""
    for rate in (2.0, 5.0, 10.0):
        perfect_imu(motions.circle(600 / rate, rate, radius=20.0, speed=10.0, attitude=(0.0, 0.0, 0.0)))
        perfect_imu(motions.lemniscate(600 / rate, rate, attitude="navigation"))


TIME = np.arange(50) / 10.0
ZERO = np.zeros((50, 3))


def test_imu_prints_itself():
    text = str(Imu(TIME, ZERO, ZERO + 1.0, 10.0))
    assert text.startswith("Imu: 50 samples at 10 Hz, 5 s from 0 s")
    assert "accel z  m/s^2" in text


def fast(angle):
    euler = np.outer(np.arange(50), [0, 0, angle])
    return Trajectory.from_euler(TIME, ZERO, euler)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: Imu(TIME, ZERO, ZERO * np.nan, 10.0), "accel of an IMU holds 150 values that are NaN"),
        (lambda: Imu(TIME[::-1], ZERO, ZERO, 10.0), "does not increase"),
        (lambda: Imu(TIME, ZERO, ZERO, 20.0), r"from 0 to 0.1 s \(index 0\) is no sample of 20 Hz"),
        (lambda: Imu(np.where(TIME > 2, TIME + 0.1, TIME), ZERO, ZERO, 10.0), r"from 2 to 2.2 s \(index 20\)"),
        (lambda: Imu(TIME, ZERO, ZERO, -1.0), "sampling rate"),
        (lambda: perfect_imu(fast(1.6)), "turns by 91.67 deg, and a sample may have 85.9"),
        (lambda: perfect_imu(fast(0.1), rate=0.3), "has 1 sample"),
    ],
)
def test_refusals(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()
