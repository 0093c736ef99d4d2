"""The recordings of real drives, as a careful engineer sets them up by what is known of them, with public names."""

from pathlib import Path

import numpy as np
import pytest

import nav_jax as nj
from nav_jax import recorded

FOLDER = Path(__file__).parents[2] / "../shared/data"
G = 9.80665


def white(density, rate):
    """Of a density in SI/sqrt(Hz)."""
    return f"WN(sigma2={float(density**2 * rate)!r})"


def walk(density, rate):
    """Of a density in SI/s/sqrt(Hz)."""
    return f"RW(gamma2={float(density**2 / rate)!r})"


def matrices(sd):
    return np.einsum("fi,ij->fij", sd**2, np.eye(sd.shape[1]))


def opened(name):
    path = FOLDER / name
    if not path.exists():
        pytest.skip("needs the recordings of ../shared/data")
    return np.load(path)


def local(given):
    """Positions about the first fix, and that fix."""
    geodetic = np.column_stack([np.deg2rad(given["gnss_lat_lon_deg"]), given["gnss_height"].astype(float)])
    return np.asarray(nj.kinematics.geodetic.ned_from_geodetic(geodetic, geodetic[0])), geodetic[0]


def roof_record():
    """A car, 549 s: an IMU on its roof at 100 Hz, RTK at 4 Hz whose velocities are means of the past 0.25 s.

    The samples are along the axes of the IMU, but for turns by right angles.
    """
    given = opened("real_drive.npz")
    ms, turn = given["imu_ms"], given["imu_to_frd"].T
    # samples come 0.32 s after they were taken; the clock of the sensor is even
    label = given["imu_clock"][0] + given["imu_clock"][1] * (ms[[0, -1]] - ms[0]) / 1000 - 0.32
    rate = (len(ms) - 1) / (label[1] - label[0])
    gyro, accel = np.deg2rad(given["imu_gyro_mdps"] * 1e-3) @ turn, given["imu_accel_mg"] * 1e-3 * G @ turn
    imu = nj.Imu(label[0] + np.arange(len(ms)) / rate, gyro, accel, rate)
    p, origin = local(given)
    sd = np.hypot(np.where((given["gnss_Q"] == 1)[:, None], given["gnss_sd_neu"], 0.3), 0.01)
    return imu, recorded.GnssRecord(
        given["gnss_time"], p, origin, matrices(sd), given["gnss_velocity_ned"].astype(float),
        matrices(np.hypot(given["gnss_velocity_sd_neu"], 0.02)),
    )  # fmt: skip


def roof():
    """The same, to be navigated with what is known of it."""
    imu, record = roof_record()
    imu, rate, time = recorded.mounted(imu, np.deg2rad([0.0, -6.75, 5.07])), imu.rate, record.time
    start = recorded.align_by_course(imu, record)
    there = (time > start.time) & (time < imu.epochs[-1] - 0.2)
    receiver = nj.Gnss(
        4.0, horizontal=0.012, vertical=0.02, horizontal_velocity=0.03, vertical_velocity=0.05,
        lever_arm=(0.0, -0.05, 0.0), averaged=0.25, time_offset_sd=0.02,
    )  # fmt: skip
    both, errors = both_of(record.select(there))
    imu = recorded.between(imu, start.time)
    filter = nj.ImuErrors(
        f"{white(0.015, rate)} + {walk(6e-4, rate)}",
        f"{white(np.deg2rad(0.02), rate)} + {walk(np.deg2rad(1e-4), rate)}",
        rate,
        accel_bias_sd=0.2,
        gyro_bias_sd=np.deg2rad(0.3),
    )
    fixes = [nj.Fixes(receiver, time[there], both, errors), on_wheels(imu)]
    fixes.append(recorded.standing(nj.aiding.ZeroVelocity(5.0, sd=0.02), recorded.stops(imu, record.shifted(-0.125))))
    options = {"vibration": nj.imu.VibrationNoise(accel=0.09, gyro=0.1)}
    return imu, fixes, filter, started(start) | options


def loop_record():
    """A car, 176 s: a calm IMU at 100 Hz, a receiver at 2 Hz that says how good it is, its axes front, left, up.

    Of its velocities it says 0.26 m/s, which is modest: innovations are 0.05 m/s wherever all fixes are used. The
    samples are along the axes of the IMU, but for turns by right angles.
    """
    given = opened("real_loop1.npz")
    time, flip = given["imu_time"], np.array([1.0, -1.0, -1.0])
    rate = (len(time) - 1) / (time[-1] - time[0])
    gyro, accel = (given[f"imu_{s}"].astype(float) * flip for s in ("gyro", "accel"))
    imu = nj.Imu(time[0] + np.arange(len(time)) / rate, gyro, accel, rate)
    p, origin = local(given)
    sd, sd_v = (given[f"gnss_{of}sd_ned"].astype(float) for of in ("", "velocity_"))
    v = given["gnss_velocity_ned"].astype(float)
    return imu, recorded.GnssRecord(given["gnss_time"], p, origin, matrices(sd), v, matrices(sd_v))


def loop():
    """The same, to be navigated with what is known of it."""
    imu, record = loop_record()
    imu, rate, at = recorded.mounted(imu, np.deg2rad([0.0, -0.9, -0.7])), imu.rate, record.time
    start = recorded.align_by_course(imu, record, speed=3.0)
    there = (at > start.time) & (at < imu.epochs[-1] - 0.2)
    receiver = nj.Gnss(2.0, horizontal=0.36, vertical=0.5, horizontal_velocity=0.26, vertical_velocity=0.26)
    fixes = nj.Fixes(receiver, at[there], *both_of(record.select(there)))
    imu = recorded.between(imu, start.time)
    filter = nj.ImuErrors(
        f"{white(0.01, rate)} + {walk(6e-4, rate)}",
        f"{white(np.deg2rad(0.02), rate)} + {walk(np.deg2rad(1e-4), rate)}",
        rate,
        accel_bias_sd=0.2,
        gyro_bias_sd=np.deg2rad(0.3),
    )
    options = {"vibration": nj.imu.VibrationNoise(accel=0.09, gyro=0.1)}
    return imu, [fixes, on_wheels(imu)], filter, started(start) | options


def both_of(record):
    """Positions and velocities side by side, and the covariance of both."""
    C = np.zeros((len(record), 6, 6))
    C[:, :3, :3], C[:, 3:, 3:] = record.covariance, record.velocity_covariance
    return np.hstack([record.position, record.velocity]), C


def on_wheels(imu):
    """The constraint of a car whose rear axle is somewhere behind and below, mounted by a degree and a half."""
    axle = nj.aiding.NonHolonomic(
        10.0, right=0.03, down=0.04, lever_arm=(-1.0, 0.0, 1.2), lever_arm_sd=0.7,
        mount_sd=np.deg2rad(1.5), mount_noise=f"RW(gamma2={(7e-4) ** 2 / 10!r})",
    )  # fmt: skip
    return recorded.constrained(axle, imu)


def started(start):
    initial = nj.InitialUncertainty(0.5, 0.3, np.deg2rad([2.0, 2.0, 5.0]))
    return {
        "position": start.position,
        "velocity": start.velocity,
        "quaternion": start.quaternion,
        "initial": initial,
        "every": 10,
    }
