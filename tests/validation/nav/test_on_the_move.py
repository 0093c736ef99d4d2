"""Alignments on the move are as good as they claim: over many draws, and on a real drive."""

import numpy as np
import pytest
from nav import moving, real_drives
from scipy import stats
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.recorded import GnssRecord, align_on_the_move, between

DRAWS = 150
CASES = {
    "velocities": (True, moving.Errors(), None),
    "velocities on an Earth that turns": (True, moving.Errors(), moving.EARTH),
    "positions on an Earth that turns": (False, moving.Errors(), moving.EARTH),
    "a poor IMU": (True, moving.Errors((0.2, 0.005), (0.03, 2e-3), (0.1, 0.1, 0.2)), None),
}


@pytest.mark.parametrize("case", CASES)
def test_errors_are_as_large_as_claimed(case):
    """Biases, noise and fixes are drawn: attitude and velocity by their covariance, and each angle, 5 sigma."""
    velocities, errors, earth = CASES[case]
    drive = moving.car(earth=earth)
    clean = moving.fixes(drive, velocities=velocities)
    first = 1000 * (1 + list(CASES).index(case))  # draws of its own
    found, C, misfit = [], [], []
    for seed in range(first, first + DRAWS):
        imu, fixes = moving.with_errors(drive, clean, errors, seed)
        start = align_on_the_move(imu, fixes, earth=earth, **moving.stated(errors))
        found.append(moving.errors_of(start, drive))
        C.append(np.asarray(start.initial.covariance))
        misfit.append(start.misfit)
    found, C = np.array(found), np.array(C)
    for name, part in {"attitude": slice(6, 9), "velocity": slice(3, 6), "all": slice(0, 9)}.items():
        e, own = found[:, part], C[:, part, part]
        size = e.shape[1]
        low, high = stats.chi2.ppf(stats.norm.cdf([-5, 5]), size * DRAWS) / (size * DRAWS)
        nees = np.mean(np.einsum("ri,ri->r", e, np.linalg.solve(own, e[..., None])[..., 0])) / size
        assert low < nees < high, (name, nees)
    ratio = np.mean(found**2 / np.diagonal(C, axis1=1, axis2=2), axis=0)[6:]
    low, high = stats.chi2.ppf(stats.norm.cdf([-5, 5]), DRAWS) / DRAWS
    assert ((low < ratio) & (ratio < high)).all(), ratio
    rows = 3 * len(clean.time[clean.time <= 30.0])
    assert abs(np.mean(misfit) - 1) < 5 * np.sqrt(2 / (rows - 9) / DRAWS)


def test_noise_makes_no_heading():
    """At a constant velocity, with noise of the accelerometers that looks as large as a turn: refused each time."""
    drive = moving.turned(*nj.perfect_imu(nj.motions.straight(duration=36.0, rate=moving.RATE)), (0.3, -0.2, 2.0))
    clean = moving.fixes(drive)
    for densities in ((0.01, 3e-4), (0.1, 2e-3), (0.5, 4e-3)):
        errors = moving.Errors((0.2, 0.02), densities, (0.1, 0.1, 0.2))
        for seed in range(10):
            imu, fixes = moving.with_errors(drive, clean, errors, seed)
            with pytest.raises(ValueError, match="tells the heading"):
                align_on_the_move(imu, fixes, **moving.stated(errors))


def aligned(part, record):
    """With what is known of that car; None where the motion does not tell the heading."""
    try:
        return align_on_the_move(
            part, record, averaged=0.25, lever_arm=(0.0, -0.05, 0.0),
            accel_bias_sd=0.2, gyro_bias_sd=np.deg2rad(0.3), accel_noise=0.05, gyro_noise=np.deg2rad(0.05),
        )  # fmt: skip
    except ValueError:
        return None


def test_a_real_drive():
    """Windows of 30 s over a drive of nine minutes: against a filter that has all fixes, in 3 of its claimed sigmas.

    Nothing of what it is fastened to is used but the mounting, by which body and vehicle are the same.
    """
    imu, (fixes, *more), filter, options = real_drives.roof()
    known = nj.navigate(imu, [fixes, *more], filter, **options | {"smooth": True})
    record = GnssRecord(fixes.time, fixes.value[:, :3], covariance=fixes.covariance[:, :3, :3],
                        velocity=fixes.value[:, 3:], velocity_covariance=fixes.covariance[:, 3:, 3:])  # fmt: skip
    headings, tilts = [], []
    # what happens in between, such as straights and stops, is refused or told less well
    for begin in np.arange(imu.time[0] + 15.0, imu.epochs[-1] - 40.0, 30.0):
        start = aligned(between(imu, float(begin)), record)
        if start is None:
            continue
        i = int(np.argmin(np.abs(known.time - start.time)))
        q = Rotation.from_quat(np.roll([known.trajectory.quaternion[i], start.quaternion], -1, axis=1))
        psi = (q[1] * q[0].inv()).as_rotvec()
        sd = np.sqrt(np.diag(start.initial.covariance)[6:] + known.sd[i, 6:9] ** 2)
        headings.append(psi[2] / sd[2])
        tilts.append(psi[:2] / sd[:2])
    assert len(headings) >= 8
    assert np.abs(headings).max() < 3.0, headings
    assert np.abs(tilts).max() < 4.0, tilts
