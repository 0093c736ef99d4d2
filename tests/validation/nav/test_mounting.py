"""Mountings are as good as they claim: over many simulated drives, and on two real ones whose mounting others found."""

from dataclasses import replace

import numpy as np
import pytest
from nav import cars, real_drives
from scipy import stats

import nav_jax as nj
from nav_jax.recorded import GnssRecord, find_mounting

DRIVES = 100
SIGMA = 4.0
"""Of all bands."""
BIAS = 0.3
"""Standard deviations. Springs lift an antenna ahead of the axle, which leaves some hundredths of a degree of pitch."""


def simulated(seed):
    """All that a user's drives differ by; the clock and the slope across the road are drawn as is believed of them."""
    rng = np.random.default_rng(seed)
    road = cars.Road(crown=np.deg2rad(1.0) * rng.normal())
    duration, hz = rng.uniform(120.0, 600.0), rng.choice([1.0, 5.0])
    drive = cars.car(rng, duration=duration, hz=hz, road=road, errors=cars.Errors(accel_bias=0.1))
    return drive, 0.03 * rng.normal()


@pytest.mark.parametrize("velocities", [True, False], ids=["velocities", "positions"])
def test_errors_are_as_large_as_claimed(judge, velocities):
    """Coverage about each axis, and NEES of all three: bands are those of binomial and chi-square, 4 sigma."""
    errors, C = [], []
    for seed in range(DRIVES):
        drive, late = simulated(seed)
        fixes = GnssRecord(drive.fixes_time + late, drive.position, velocity=drive.velocity if velocities else None)
        found = find_mounting(nj.Imu(drive.time, drive.gyro, drive.accel, drive.rate), fixes)
        errors.append(drive.error(found.euler))
        C.append(found.covariance)
    errors, C = np.array(errors), np.array(C)
    ratio = errors / np.sqrt(np.diagonal(C, axis1=1, axis2=2))
    covered = np.mean(np.abs(ratio) < 1.96, axis=0)
    low = 0.95 - SIGMA * np.sqrt(0.95 * 0.05 / DRIVES)
    judge("coverage of 95 % intervals about front, right, down", covered, low, 1.0, num_draws=DRIVES)
    nees = np.mean(np.einsum("ri,ri->r", errors, np.linalg.solve(C, errors[..., None])[..., 0])) / 3
    low, high = stats.chi2.ppf(stats.norm.cdf([-SIGMA, SIGMA]), 3 * DRIVES) / (3 * DRIVES)
    judge("mean NEES / 3", nees, low, high, num_draws=DRIVES)
    most = BIAS + SIGMA / np.sqrt(DRIVES)
    judge("mean of error / sd", np.mean(ratio, axis=0), -most, most, num_draws=DRIVES)
    # and that is little: pitch and yaw are known better than anybody sees them
    assert np.rad2deg(np.sqrt(np.mean(errors[:, 1:] ** 2))) < 0.4


OTHERS = {
    "roof": (real_drives.roof_record, 0.25, [-6.75, 5.07], [0.16, 0.2]),
    "loop": (real_drives.loop_record, 0.0, [-0.9, -0.7], [0.2, 0.2]),
}
"""Pitch and yaw in deg, as filters that estimate them found, and how sure; of the loop nobody says how sure."""


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("velocities", [True, False], ids=["velocities", "positions"])
def test_real_cars_are_as_others_found(name, velocities):
    """In 3 combined standard deviations; the roll, that nobody knows of, is within 3 of what roads may do."""
    record, averaged, angles, sure = OTHERS[name]
    imu, fixes = record()
    fixes = fixes if velocities else replace(fixes, velocity=None)
    found = find_mounting(imu, fixes, averaged=averaged)
    off = np.rad2deg(found.euler[1:]) - angles
    assert (np.abs(off) < 3 * np.hypot(sure, np.rad2deg(found.sd[1:]))).all(), found
    assert abs(found.euler[0]) < 3 * found.sd[0]
    assert (np.rad2deg(found.sd) < [1.3, 0.5, 0.8]).all()


@pytest.mark.parametrize("name", OTHERS)
def test_parts_of_a_real_drive_agree(name):
    """Two halves, each by itself: in 3 of their standard deviations, but for the roads, which may be others."""
    record, averaged, _, _ = OTHERS[name]
    imu, fixes = record()
    middle = float(imu.time[len(imu) // 2])
    parts = [nj.recorded.between(imu, end=middle), nj.recorded.between(imu, middle)]
    a, b = (find_mounting(part, fixes, averaged=averaged) for part in parts)
    sd = np.sqrt(a.sd**2 + b.sd**2)
    assert (np.abs(a.euler - b.euler) < 3 * sd).all(), (a, b)


def test_a_real_drive_on_another_clock():
    imu, fixes = real_drives.roof_record()
    for later in (-30.0, 30.0):
        with pytest.raises(ValueError, match="does not feel what the fixes show"):
            find_mounting(imu, fixes.shifted(later))
