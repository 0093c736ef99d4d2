"""Offsets of clocks by turns and by speed: known ones of simulated cars, whose tyres slip and whose roads slope."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import nav_jax as nj

RATE = 50.0
G = 9.80665
SIGNALS = [(fixes, signal) for fixes in ("positions", "velocities") for signal in ("turns", "speed")]


def wandering(rng, num, seconds, sd):
    """Noise that is correlated over so many seconds, and smooth over half a second."""
    x = rng.normal(size=num)
    for tau in (seconds, 0.5):
        keep = np.exp(-1 / (RATE * tau))
        x = lfilter([1 - keep], [1.0, -keep], x)
    return sd * x / x.std()


def integral(x):
    """By trapezes."""
    return np.append(0.0, np.cumsum(x[1:] + x[:-1]) / 2 / RATE)


def car(
    rng, *, duration=120.0, hz=2.0, offset=None, slip=None, ahead=None, speed=(12.0, 4.0), turning=0.12, slope=0.02,
    vibration=0.3, gyro=0.01, position=0.1, velocity=0.1,
):  # fmt: skip
    """Time, gyro and accel of an IMU along axes of its own; fixes whose clock is behind by an offset; the offset.

    The rear axle goes in a direction that is off the front by `slip` times the acceleration to the side, the antenna
    is `ahead` of it, m. What is None is drawn. `speed` is its mean and standard deviation, and so are `turning`
    (rad/s), `slope` (rad) and the noise of samples and fixes.
    """
    offset = rng.uniform(-0.8, 0.8) if offset is None else offset
    slip = rng.uniform(0.0, 0.006) if slip is None else slip
    ahead = rng.uniform(0.0, 2.0) if ahead is None else ahead
    num = round(duration * RATE) + 1
    t = np.arange(num) / RATE
    v = np.maximum(speed[0] + wandering(rng, num, 8.0, speed[1]), 0.5)
    turn = wandering(rng, num, 4.0, turning) * speed[0] / np.maximum(v, speed[0] / 2)
    yaw = integral(turn)
    forward = np.exp(1j * yaw)
    axle = v * np.exp(1j * (yaw - slip * v * turn))
    place = integral(axle) + ahead * forward
    felt = np.gradient(axle, t) / forward
    force = np.column_stack([felt.real + G * wandering(rng, num, 20.0, slope), felt.imag, np.full(num, -G)])
    R = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    rates = np.column_stack([0 * turn, 0 * turn, turn])
    samples = [
        (x[1:] + x[:-1]) / 2 @ R + sd * rng.normal(size=(num - 1, 3)) for x, sd in ((rates, gyro), (force, vibration))
    ]
    k = np.arange(0, num, round(RATE / hz))
    seen = [np.column_stack([x.real, x.imag, 0 * x.real])[k] for x in (place, np.gradient(place, t))]
    seen = [x + sd * rng.normal(size=x.shape) for x, sd in zip(seen, (position, velocity), strict=True)]
    return t[:-1], *samples, nj.recorded.GnssRecord(t[k] - offset, seen[0], velocity=seen[1]), offset


EXACT = {"slope": 0.0, "vibration": 0.0, "gyro": 0.0, "position": 1e-4, "velocity": 1e-4}


def told(offset):
    """As an inspection has it."""
    return offset.best > 0.3 and offset.se < 0.2


def deviations(drives, most=1.0):
    """Errors in standard errors of all that is told, by kind of fixes and signal."""
    found = {kind: [] for kind in SIGNALS}
    for *imu, fixes, offset in drives:
        for o in nj.recorded.clock_offsets(*imu, fixes, most=most):
            if told(o):
                found[o.fixes, o.signal].append((o.value - offset) / o.se)
    return found


@pytest.mark.parametrize("hz", [1.0, 5.0])
def test_exact_fixes_tell_an_offset_exactly(hz):
    *imu, fixes, offset = car(np.random.default_rng(1), hz=hz, slip=0.003, ahead=1.5, **EXACT)
    for o in nj.recorded.clock_offsets(*imu, fixes):
        assert o.value == pytest.approx(offset, abs=4e-3), (o.fixes, o.signal)


@pytest.mark.parametrize("slip", [0.0, 0.006])
def test_slip_that_is_not_usual_is_in_the_standard_error(slip):
    *imu, fixes, offset = car(np.random.default_rng(2), slip=slip, ahead=1.0, **EXACT)
    for o in nj.recorded.clock_offsets(*imu, fixes):
        assert abs(o.value - offset) < (2.2 * o.se if o.signal == "turns" else 4e-3), (o.fixes, o.signal)
        assert o.signal == "speed" or abs(o.value - offset) > 0.02


def test_at_a_constant_speed_an_antenna_ahead_looks_like_an_offset():
    *imu, fixes, offset = car(np.random.default_rng(3), ahead=1.5, speed=(10.0, 0.01))
    for o in nj.recorded.clock_offsets(*imu, fixes):
        if o.signal == "turns":
            assert o.se > 0.1
            assert abs(o.value - offset) < 3 * o.se
        else:
            assert not told(o)


def test_standard_errors_are_those_of_errors():
    """Of gentle drives, where an antenna ahead is hard to tell from an offset: mean squares, 4 sigma."""
    rng = np.random.default_rng(4)
    drives = [car(rng, speed=(8.0, 1.5), turning=0.05, position=0.03) for _ in range(12)]
    for kind, z in deviations(drives).items():
        low, high = stats.chi2.ppf(stats.norm.cdf([-4, 4]), len(z)) / len(z)
        assert low < np.mean(np.square(z)) < high, kind
