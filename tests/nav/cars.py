"""Simulated drives of a car, by NumPy and SciPy alone: what its IMU feels, however it is mounted, and its fixes.

The rear axle goes along its front axis, up and down a road that slopes, on wheels that do not slip. Body and IMU are on
springs: the nose lifts when the car speeds up, and the body leans outwards in turns, as the road leans now to one side,
now to the other. IMU and antenna are in one place ahead of the axle. Everything follows from the positions of that
place: velocities and accelerations are their differences, specific forces are along the axes of the body.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

GRAVITY = 9.80665
_DOWN = np.array([0.0, 0.0, GRAVITY])
_SMOOTH = 0.5
"""s, over which no driver and no road changes anything."""
_MEAN_SPEED = 12.0
"""m/s."""


@dataclass(frozen=True)
class Road:
    """Slopes in rad along and across (standard deviations), the mean one across, springs in rad per g, m ahead."""

    slope: float = 0.03
    lean: float = 0.015
    crown: float = 0.0
    springs: float = 0.05
    ahead: float = 1.5


@dataclass(frozen=True)
class Errors:
    """Standard deviations: of constant biases and of each sample (m/s^2, rad/s), and of fixes (m/s, m)."""

    accel_bias: float = 0.05
    gyro_bias: float = 0.002
    vibration: float = 0.3
    gyro: float = 0.01
    velocity: float = 0.05
    position: float = 0.01


FLAT = Road(0.0, 0.0, 0.0, 0.0, 0.0)
EXACT = Errors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Drive:
    """Means of turn rate and specific force over each step, along the axes of the IMU; fixes; the mounting."""

    rate: float
    time: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    fixes_time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    mounting: Rotation
    """From the axes of the IMU to those of the body."""

    @property
    def euler(self):
        """Roll, pitch, yaw of the IMU in the body, rad."""
        return self.mounting.as_euler("ZYX")[::-1]

    def error(self, euler):
        """Of a mounting that is found: rotation vector in the body by which the true one is turned from it, rad."""
        return (self.mounting * Rotation.from_euler("ZYX", np.asarray(euler)[::-1]).inv()).as_rotvec()


def any_rotation(rng):
    """Each as likely as each other."""
    return Rotation.from_quat(rng.normal(size=4))


def car(
    rng, *, duration=120.0, rate=50.0, hz=5.0, mounting=None, road=Road(), errors=Errors(), averaged=0.0,
    turning=0.12, hurry=4.0, backs=None,
):  # fmt: skip
    """A drive that is drawn.

    Parameters
    ----------
    rng
        Of NumPy; drives of one state of it differ by the rest only.
    duration, rate, hz
        s, and the rates of IMU and fixes.
    mounting
        Drawn from all rotations unless given.
    road, errors
        What there is beside the motion.
    averaged
        s before a fix of which its velocity is the mean.
    turning, hurry
        Standard deviations of turn rate (rad/s, at 12 m/s) and speed (m/s).
    backs
        From when to when it drives backwards, s.
    """
    mounting = any_rotation(rng) if mounting is None else mounting
    num = round(duration * rate)
    t = np.arange(num + 1) / rate
    speed = np.maximum(_MEAN_SPEED + _wandering(rng, num + 1, rate, 8.0, hurry), 0.5)
    if backs is not None:  # to a stop and back within five seconds
        forwards = np.interp(t, [backs[0] - 5, backs[0], backs[1], backs[1] + 5], [1.0, 0.0, 0.0, 1.0])
        backwards = np.interp(t, [backs[0], backs[0] + 5, backs[1] - 5, backs[1]], [0.0, 1.0, 1.0, 0.0])
        speed = speed * forwards - 4.0 * backwards
    # narrow turns are slow ones
    turn = _wandering(rng, num + 1, rate, 4.0, turning) * _MEAN_SPEED / np.maximum(np.abs(speed), 6.0)
    yaw = np.cumsum(turn) / rate + rng.uniform(-3.0, 3.0)
    climb = _wandering(rng, num + 1, rate, 20.0, road.slope)
    roll = _wandering(rng, num + 1, rate, 5.0, road.lean) + road.crown - road.springs * speed * turn / GRAVITY
    pitch = climb + road.springs * np.gradient(speed, t) / GRAVITY

    axle_velocity = (
        speed[:, None] * Rotation.from_euler("ZYX", np.column_stack([yaw, climb, 0 * yaw])).as_matrix()[..., 0]
    )
    axle = np.cumsum((axle_velocity[1:] + axle_velocity[:-1]) / 2 / rate, axis=0)
    body = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
    place = np.concatenate([np.zeros((1, 3)), axle]) + body.apply([road.ahead, 0.0, 0.0])
    velocity = np.gradient(place, t, axis=0)
    force = body.inv().apply(np.gradient(velocity, t, axis=0) - _DOWN)
    accel, gyro = (force[1:] + force[:-1]) / 2, (body[:-1].inv() * body[1:]).as_rotvec() * rate
    accel = accel + rng.normal(size=3) * errors.accel_bias + rng.normal(size=accel.shape) * errors.vibration
    gyro = gyro + rng.normal(size=3) * errors.gyro_bias + rng.normal(size=gyro.shape) * errors.gyro

    k = np.arange(round(averaged * rate), num + 1, round(rate / hz))
    velocity = (place[k] - place[k - round(averaged * rate)]) / averaged if averaged else velocity[k]
    noise = rng.normal(size=(2, len(k), 3)) * np.array([errors.position, errors.velocity])[:, None, None]
    return Drive(
        rate, t[:-1], mounting.inv().apply(gyro), mounting.inv().apply(accel),
        t[k], place[k] + noise[0], velocity + noise[1], mounting,
    )  # fmt: skip


def _wandering(rng, num, rate, correlated, sd):
    """Noise that is smooth and is correlated over so many s, with a standard deviation that is exactly this one."""
    x = rng.normal(size=num)
    for tau in (correlated, _SMOOTH):
        keep = np.exp(-1 / (rate * tau))
        x = lfilter([1 - keep], [1, -keep], x)
    return sd * x / x.std()
