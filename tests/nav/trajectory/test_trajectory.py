"""Trajectories: what they check, how they interpolate and smooth."""

import numpy as np
import pytest
from nav.cases import angle_between

from nav_jax.trajectory import motions
from nav_jax.trajectory.trajectory import Trajectory

T = np.arange(11) / 10.0
P = np.stack([5 * T, T**2, -T], axis=1)
EULER = np.stack([0.1 * T, -0.2 * T, 3 + T], axis=1)


def test_from_euler():
    ref = Trajectory.from_euler(T, P, EULER, name="walk")
    np.testing.assert_allclose(ref.euler, EULER, atol=1e-13)  # yaw passes 180 deg without a jump
    np.testing.assert_allclose(ref.velocity, np.stack([5 + 0 * T, 2 * T, -1 + 0 * T], axis=1), atol=1e-11)
    assert (ref.rate, len(ref), ref.is_even) == (10.0, 11, True)
    assert ref.duration == pytest.approx(1.0)
    assert not ref.position.flags.writeable
    text = str(ref)
    assert "Trajectory 'walk': 11 epochs at 10 Hz, 1 s from 0 s" in text
    assert "yaw [deg]" in text


def test_wrapped_yaw_is_the_same_trajectory():
    wrapped = EULER.copy()
    wrapped[:, 2] = (wrapped[:, 2] + np.pi) % (2 * np.pi) - np.pi
    a, b = Trajectory.from_euler(T, P, EULER), Trajectory.from_euler(T, P, wrapped)
    np.testing.assert_allclose(a.quaternion, b.quaternion, atol=1e-14)
    np.testing.assert_allclose(b.euler, EULER, atol=1e-13)
    assert angle_between(a.resampled(37.0), b.resampled(37.0)) < 1e-13


def test_quaternions_are_stored_without_jumps_of_sign():
    ref = Trajectory.from_euler(T, P, EULER)
    flipped = ref.quaternion * np.where(np.arange(11) % 2, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(Trajectory(T, P, ref.velocity, flipped).quaternion, ref.quaternion, atol=1e-14)


def test_resampling_finds_the_motion_between():
    """Cubic splines at 50 Hz: their error falls with the fourth power of the interval."""
    coarse, fine = motions.lemniscate(60.0, 50.0), motions.lemniscate(60.0, 125.0)
    found = coarse.resampled(125.0)
    assert len(found) == len(fine)
    np.testing.assert_allclose(found.position, fine.position, atol=1e-8)
    np.testing.assert_allclose(found.velocity, fine.velocity, atol=1e-6)
    assert angle_between(found, fine) < 1e-8
    rougher = motions.lemniscate(60.0, 25.0).resampled(125.0)
    ratio = (
        np.abs(rougher.position - fine.position)[500:-500].max()
        / np.abs(found.position - fine.position)[500:-500].max()
    )
    assert 12 < ratio < 20


def test_resampling_passes_pitch_of_90_degrees():
    time = np.arange(201) / 20.0
    pitch = 0.9 * time
    position = np.stack([np.sin(pitch), 0 * time, np.cos(pitch)], axis=1)
    euler = np.stack([0 * time, pitch, 0 * time], axis=1)
    fine = Trajectory.from_euler(time, position, euler).resampled(100.0)
    half = 0.45 * fine.time
    expected = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
    np.testing.assert_allclose(fine.quaternion, expected, atol=1e-8)


def test_resampling_makes_steps_even():
    jitter = T + np.where(np.arange(11) % 3 == 1, 0.004, 0.0)
    ref = Trajectory.from_euler(jitter, np.stack([jitter, jitter**2, 0 * jitter], axis=1), EULER)
    assert not ref.is_even
    even = ref.resampled(20.0)
    assert even.is_even
    np.testing.assert_allclose(even.position[:, 1], even.time**2, atol=1e-11)
    assert len(ref.resampled(3.0)) == 4


def test_smoothing_keeps_motion_and_removes_noise():
    """White noise of 1 cm on a lemniscate: the error falls by the root of the epochs in an interval, about."""
    ref = motions.lemniscate(60.0)
    noise = np.random.default_rng(2).normal(size=ref.position.shape) * 0.01
    noisy = Trajectory.from_euler(ref.time, ref.position + noise, ref.euler)
    smooth = noisy.smoothed(1.0)
    error = (smooth.position - ref.position).std()
    assert 0.7 * 0.01 / 10 < error < 1.3 * 0.01 / 10
    assert (smooth.velocity - ref.velocity).std() < 0.01
    np.testing.assert_allclose(ref.smoothed(1.0).position, ref.position, atol=1e-5)
    force = np.gradient(smooth.velocity - ref.velocity, 0.01, axis=0)
    assert 3.5 < force[300:-300].std() / (0.01 / 10) < 5.5  # the 4.5 of the documentation
    assert np.abs(force).max() < 0.2  # also at the ends
    np.testing.assert_array_equal(smooth.quaternion, noisy.quaternion)
    assert angle_between(ref.smoothed(1.0, attitude_knots=0.5), ref) < 1e-5


def test_plot_draws():
    figure = motions.circle(5.0).plot()
    assert figure.axes


NAN = P.copy()
NAN[3, 1] = np.nan


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda: Trajectory.from_euler([], np.zeros((0, 3)), np.zeros((0, 3))), "0 epochs"),
        (lambda: Trajectory.from_euler([0.0], P[:1], EULER[:1]), "1 epochs"),
        (lambda: Trajectory.from_euler(T[::-1], P, EULER), "does not increase at index 1"),
        (lambda: Trajectory.from_euler(np.where(T == 0.5, 0.4, T), P, EULER), "does not increase at index 5"),
        (lambda: Trajectory.from_euler(T, NAN, EULER), r"1 values that are NaN .* index 3, component 1"),
        (lambda: Trajectory.from_euler(T, np.ma.masked_invalid(NAN), EULER), "index 3, component 1"),
        (lambda: Trajectory.from_euler(T, P[:-1], EULER), r"shape \(11, 3\), time on axis 0, and this one \(10, 3\)"),
        (lambda: Trajectory.from_euler(T, P.T, EULER), r"shape \(11, 3\)"),
        (lambda: Trajectory.from_euler(T, P, EULER[:, :2]), r"shape \(N, 3\)"),
        (lambda: Trajectory.from_euler(T, P, EULER, velocity=P * 1j), "real numbers"),
        (lambda: Trajectory.from_euler(T, P, EULER, velocity=[[5.0, 1.0, 1.0]] * 11), "velocities down differ"),
        (lambda: Trajectory.from_euler(T, P, EULER, velocity=[[18.0, 1.0, -1.0]] * 11), "velocities north differ"),
        (lambda: Trajectory(T, P, P, np.ones((11, 4))), "unit length, and that at index 0 has 2"),
        (lambda: Trajectory.from_euler(T, P, EULER).resampled(0.0), "sampling rate"),
        (lambda: Trajectory.from_euler(T, P, EULER).resampled(0.5), "no two epochs"),
        (
            lambda: Trajectory.from_euler(np.where(T > 0.45, T + 2, T), P, EULER).resampled(5.0),
            "gap of 2.1 s after 0.4",
        ),
        (lambda: Trajectory.from_euler(T, P, EULER).smoothed(0.1), "needs two epochs"),
        (lambda: Trajectory.from_euler(T, P, EULER).smoothed(5.0), "do not fit"),
        (lambda: Trajectory.from_euler(T, P, EULER).smoothed(-1.0), "positive"),
    ],
)
def test_refusals(call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call()


def test_at_given_times():
    reference = motions.lemniscate(duration=10.0, rate=50.0)
    fine = motions.lemniscate(duration=10.0, rate=200.0)
    rows = np.array([0, 101, 777, 2000])
    found = reference.at(fine.time[rows])
    np.testing.assert_allclose(found.position, fine.position[rows], rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.velocity, fine.velocity[rows], rtol=0, atol=1e-4)
    with pytest.raises(ValueError, match="is known from 0 to 10 s, and is asked for from 9 to 11 s"):
        reference.at([9.0, 11.0])
