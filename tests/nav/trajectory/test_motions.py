"""Generators: derivatives, attitudes, closed forms, and R's lemniscate to 1e-9."""

import jax.numpy as jnp
import numpy as np
import pytest
from nav.cases import MOTIONS, POINTS, vertical_loop

from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.kinematics import rotation
from nav_jax.trajectory import motions
from nav_jax.trajectory.attitudes import coordinated_attitude


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
def test_velocity_is_the_rate_of_position(motion):
    """Central differences of sixth order at 100 Hz: their error is 1e-8 m/s where a ramp begins."""
    ref = motion()
    p, h = ref.position, 1 / ref.rate
    rate = (45 * (p[4:-2] - p[2:-4]) - 9 * (p[5:-1] - p[1:-5]) + p[6:] - p[:-6]) / (60 * h)
    np.testing.assert_allclose(rate, ref.velocity[3:-3], atol=2e-8)
    assert ref.rate == 100.0
    assert ref.is_even


@pytest.mark.parametrize("name", ["lemniscate", "straight", "circle", "racetrack", "climb", "helix", "waypoints"])
def test_a_coordinated_turn_has_no_lateral_force_and_no_slip(name):
    ref = MOTIONS[name]()
    q = jnp.asarray(ref.quaternion.T)
    along = np.asarray(rotation.rotate_back(q, jnp.asarray(ref.velocity.T)))
    np.testing.assert_allclose(along[0], np.linalg.norm(ref.velocity, axis=1), atol=1e-11)
    np.testing.assert_allclose(along[1:], 0.0, atol=1e-11)
    acceleration = np.gradient(ref.velocity, 1 / ref.rate, axis=0)[5:-5]
    lateral = rotation.rotate_back(q[:, 5:-5], jnp.asarray((acceleration - [0, 0, STANDARD_GRAVITY]).T))[1]
    np.testing.assert_allclose(lateral, 0.0, atol=2e-3)


def test_bank_of_a_circle():
    ref = motions.circle(60.0, radius=100.0, speed=20.0)
    roll, pitch, yaw = ref.euler.T
    np.testing.assert_allclose(np.tan(roll), 20.0**2 / 100 / STANDARD_GRAVITY, rtol=1e-11)
    np.testing.assert_allclose(pitch, 0.0, atol=1e-13)
    np.testing.assert_allclose(yaw, 0.2 * ref.time, atol=1e-11)


def test_published_lemniscate(shared):
    data = np.load(shared / "data" / "trajectory_lemniscate_ned.npz")["data"]
    ref = motions.lemniscate(600.0, attitude="navigation")
    np.testing.assert_allclose(ref.time, data[:, 0], atol=1e-9)
    np.testing.assert_allclose(ref.position, data[:, 1:4], atol=1e-9)
    np.testing.assert_allclose(ref.euler, data[:, 4:], atol=1e-9)


def test_lemniscate_closed_form():
    ref = motions.lemniscate(60.0, 50.0, size=20.0, period=30.0)
    w = 2 * np.pi / 30
    np.testing.assert_allclose(ref.position[:, 0], 20 * np.sin(w * ref.time), atol=1e-12)
    np.testing.assert_allclose(ref.position[:, 1], 10 * np.sin(2 * w * ref.time), atol=1e-12)
    np.testing.assert_allclose(ref.velocity[:, 1], 20 * w * np.cos(2 * w * ref.time), atol=1e-12)


def test_racetrack_closes_at_constant_speed():
    ref = motions.racetrack(160.0, speed=20.0, straight=20.0, turn=20.0)
    np.testing.assert_allclose(ref.position[[8000, -1]], 0.0, atol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(ref.velocity, axis=1), 20.0, rtol=1e-13)
    np.testing.assert_allclose(ref.position[2000], [400.0, 0, 0], atol=1e-10)
    bends = np.diff(ref.velocity, 2, axis=0) * 100**2
    assert np.abs(np.diff(bends, axis=0)).max() < 0.02  # m/s^3 from sample to sample: the jerk has no jumps


def test_climb_and_helix_heights():
    ref = motions.climb(100.0, speed=20.0, climb=2.0, start=20.0, end=60.0, ramp=10.0)
    np.testing.assert_allclose(ref.position[:2001, 2], 0.0, atol=1e-14)
    np.testing.assert_allclose(ref.position[6000:, 2], -2.0 * 30, rtol=1e-11)
    np.testing.assert_allclose(motions.helix(10.0, climb=3.0).position[-1, 2], -30.0, rtol=1e-13)


def test_waypoints_are_met():
    times = np.arange(7) * 10.0
    ref = motions.waypoints(POINTS, times=times)
    np.testing.assert_allclose(ref.position[::1000], POINTS, atol=1e-10)
    assert len(motions.waypoints(POINTS[:4], times=times[:4])) == 3001


def test_given_attitudes():
    ref = motions.circle(10.0, attitude=(0.1, 0.2, 0.3))
    np.testing.assert_allclose(ref.euler, [[0.1, 0.2, 0.3]] * len(ref), atol=1e-14)
    each = np.linspace(0, 1, 1001)[:, None] * [1.0, 0.5, 8.0]
    np.testing.assert_allclose(motions.circle(10.0, attitude=each).euler, each, atol=1e-13)
    level = motions.helix(10.0, climb=5.0, attitude="level").euler
    np.testing.assert_allclose(level[:, :2], 0.0, atol=1e-14)
    np.testing.assert_allclose(level[:, 2], 0.1 * np.arange(1001) / 100, atol=1e-12)


def test_a_loop_passes_the_vertical():
    """At 30 m/s on 50 m the specific force points to the centre of the loop all the way round."""
    ref = motions.from_path(vertical_loop, 50.0, 0.6, duration=10.0, rate=100.0, name="loop")
    angle = 0.5 * 0.6 * ref.time
    expected = np.stack([np.cos(angle), 0 * angle, np.sin(angle), 0 * angle], axis=1)
    np.testing.assert_allclose(ref.quaternion, expected, atol=1e-11)


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: motions.lemniscate(1.005, 100.0), "whole number"),
        (lambda: motions.lemniscate(-1.0), "duration .* must be a positive"),
        (lambda: motions.lemniscate(rate=0.0), "sampling rate"),
        (lambda: motions.lemniscate(size=np.nan), "size"),
        (lambda: motions.lemniscate(attitude="banked"), "coordinated"),
        (lambda: motions.circle(1.0, attitude=(1.0, 2.0)), r"shape \(3,\)"),
        (lambda: motions.circle(1.0, attitude=(1.0, 2.0, np.nan)), "NaN"),
        (lambda: motions.racetrack(turn=8.0, ramp=5.0), "no room for two ramps"),
        (lambda: motions.climb(20.0, ramp=8.0), "no room for two ramps"),
        (lambda: motions.waypoints(POINTS[:3], speed=1.0), "at least four"),
        (lambda: motions.waypoints(POINTS), "either speed"),
        (lambda: motions.waypoints([*POINTS[:4], POINTS[3]], speed=1.0), "Waypoint 4"),
        (lambda: motions.waypoints(POINTS, times=[0, 1, 2, 3, 3, 4, 5]), "Waypoint 4"),
        (lambda: coordinated_attitude(np.zeros((2, 3)), np.zeros((2, 3))), "no velocity at epoch 0"),
        (lambda: coordinated_attitude(np.ones((2, 3)), np.array([[0, 0, 9.80665]] * 2)), "no specific force"),
    ],
)
def test_refusals(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()
