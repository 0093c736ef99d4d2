"""A drive of five minutes on the ellipsoid, simulated elsewhere, beside what two other filters make of it."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.kinematics.geodetic import dcm_ned_from_ecef, ned_from_geodetic

RATE = 100.0
HOUR = 3600.0


@pytest.fixture(scope="module")
def drive(shared):
    with np.load(shared / "reference" / "sim300.npz") as data:
        known = {k: data[k].astype(float) for k in data}
    return known, json.loads((shared / "reference" / "sim300.json").read_text())["results"]


def believed():
    """The generating values: noise, Gauss-Markov biases of 600 s, constant scale factors."""
    arw, vrw = np.deg2rad(0.2) / np.sqrt(HOUR), 0.05 / np.sqrt(HOUR)
    gyro_sd, accel_sd = np.deg2rad(20) / HOUR, 500e-5
    gyro = gj.WN(arw**2 * RATE) + gj.GM(1 / (600 * RATE), gyro_sd**2)
    accel = gj.WN(vrw**2 * RATE) + gj.GM(1 / (600 * RATE), accel_sd**2)
    scale = nj.imu.ScaleFactor(accel_sd=1e-3, gyro_sd=1e-3)
    return nj.ImuErrors(accel, gyro, RATE, deterministic=[scale])


@pytest.fixture(scope="module")
def navigated(drive):
    known, _ = drive
    origin = known["init_lla"]
    time = np.arange(len(known["dtheta"])) / RATE
    imu = nj.imu.imu_of_samples(time, known["dtheta"] * RATE, known["dv"] * RATE, RATE)
    n, _, d = known["gnss_sd"]
    sensor = nj.GnssPosition(1.0, horizontal=n, vertical=d, lever_arm=known["lever_arm"], outages=[(180.5, 240.5)])
    fixes = nj.Fixes(sensor, known["gnss_time"], ned_from_geodetic(known["gnss_lla"], origin))
    assert (fixes.given == known["gnss_use"].astype(bool)).all()
    sd = known["init_sd"]
    truth = to_n(known, origin)
    return nj.navigate(
        imu,
        [fixes],
        believed(),
        position=np.zeros(3),
        velocity=known["init_velocity"],
        quaternion=Rotation.from_euler("ZYX", known["init_rpy"][::-1]).as_quat(scalar_first=True),
        initial=nj.InitialUncertainty(position_sd=sd[:3], velocity_sd=sd[3:6], attitude_sd=sd[6:]),
        earth=nj.Wgs84(origin),
        reference=truth,
    )


def to_n(known, origin):
    lla = known["truth_lla"]
    turn = dcm_ned_from_ecef(*origin[:2]) @ dcm_ned_from_ecef(lla[:, 0], lla[:, 1]).transpose(0, 2, 1)
    q = Rotation.from_matrix(turn @ known["truth_dcm"]).as_quat(scalar_first=True)
    v = np.einsum("kij,kj->ki", turn, known["truth_velocity"])
    return nj.Trajectory(known["truth_time"], ned_from_geodetic(lla, origin), v, q, origin=origin)


def test_it_is_as_good_as_other_filters(drive, navigated):
    """RMS within 10 % of theirs, claims at the end of the outage within 5 %, and the error that they have there."""
    known, others = drive
    time = navigated.time
    at = np.searchsorted(known["truth_time"], time - 1e-6)
    truth = to_n(known, known["init_lla"])
    error = navigated.trajectory.position - truth.position[at]
    used = (time > 60) & ~((time > 180) & (time <= 241)) & (np.abs(time - np.rint(time)) < 1e-6)
    rms = np.sqrt(np.mean(error[used] ** 2, axis=0))
    theirs = np.array([o["rms_pos_ned_m"] for o in others.values()])
    assert (rms < 1.1 * theirs.max(axis=0)).all()
    assert (rms > 0.9 * theirs.min(axis=0)).all()
    end = int(np.argmin(np.abs(time - 240)))
    claimed = np.array([o["outage_end_claimed_sd_ned"] for o in others.values()])[:, :2]
    assert (navigated.sd[end, :2] < 1.05 * claimed.max(axis=0)).all()
    assert (navigated.sd[end, :2] > 0.95 * claimed.min(axis=0)).all()
    assert 30 < np.hypot(*error[end, :2]) < 33
