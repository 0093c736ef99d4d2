"""Simulated drives of a car whose IMU is mounted anyhow, with the attitude that an alignment should find."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import nav_jax as nj

RATE = 50.0
EARTH = nj.Wgs84((0.8, 0.1, 400.0))


@dataclass(frozen=True)
class Drive:
    """Samples without errors, and what belongs to them at the epochs: C takes b to n."""

    imu: nj.Imu
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    C: np.ndarray


@dataclass(frozen=True)
class Errors:
    """Standard deviations: constant biases, densities of white noise, accelerometers first; fixes."""

    biases: tuple[float, float] = (0.05, 0.003)
    densities: tuple[float, float] = (0.01, 3e-4)
    velocity: tuple[float, float, float] = (0.05, 0.05, 0.1)
    position: float = 0.02


def car(euler=(0.3, -0.2, 2.0), *, earth=None, duration=36.0):
    """A car that turns twice, at 8 m/s; its IMU has these angles in it."""
    track = nj.motions.racetrack(duration=duration, rate=RATE, speed=8.0, straight=6.0, turn=10.0, ramp=3.0)
    return turned(*nj.perfect_imu(track, earth=earth), euler)


def turned(imu, exact, euler):
    """The same vehicle with its IMU at these angles."""
    M = Rotation.from_euler("ZYX", np.asarray(euler)[::-1]).as_matrix()
    C = Rotation.from_quat(np.roll(exact.quaternion, -1, axis=1)).as_matrix() @ M
    return Drive(replace(imu, gyro=imu.gyro @ M, accel=imu.accel @ M), exact.time, exact.position, exact.velocity, C)


def fixes(drive, *, every=25, velocities=True, arm=(0.0, 0.0, 0.0)):
    """Without errors, of an antenna on an arm; its velocity is the derivative of its positions."""
    p = drive.position + drive.C @ np.asarray(arm)
    v = drive.velocity + np.gradient(drive.C @ np.asarray(arm), drive.time, axis=0, edge_order=2)
    return nj.recorded.GnssRecord(drive.time[::every], p[::every], velocity=v[::every] if velocities else None)


def with_errors(drive, clean, errors, seed):
    """Samples and fixes with errors that are drawn."""
    rng = np.random.default_rng(seed)
    imu = drive.imu
    noisy = [
        x + errors.biases[i] * rng.normal(size=3) + errors.densities[i] * np.sqrt(imu.rate) * rng.normal(size=x.shape)
        for i, x in enumerate((imu.accel, imu.gyro))
    ]
    p = clean.position + errors.position * rng.normal(size=clean.position.shape)
    v = clean.velocity
    if v is not None:
        v = v + np.asarray(errors.velocity) * rng.normal(size=v.shape)
    return replace(imu, accel=noisy[0], gyro=noisy[1]), replace(clean, position=p, velocity=v)


def stated(errors):
    """Arguments of an alignment that knows these errors."""
    return {
        "velocity_sd": errors.velocity,
        "position_sd": errors.position,
        "accel_bias_sd": errors.biases[0],
        "gyro_bias_sd": errors.biases[1],
        "accel_noise": errors.densities[0],
        "gyro_noise": errors.densities[1],
    }


def errors_of(start, drive):
    """Estimate less truth: position, velocity, rotation vector in n."""
    i = round((start.time - drive.time[0]) * drive.imu.rate)
    found = Rotation.from_quat(np.roll(start.quaternion, -1)).as_matrix()
    psi = Rotation.from_matrix(found @ drive.C[i].T).as_rotvec()
    return np.concatenate([start.position - drive.position[i], start.velocity - drive.velocity[i], psi])
