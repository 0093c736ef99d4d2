"""Recorded drives with an antenna and a wheel on lever arms: navigated and tuned; the fixes are made by SciPy."""

import dataclasses

import numpy as np
import pytest
from nav import setups
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj

RATE = 20.0
SECONDS = 60
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
ERRORS = nj.ImuErrors(gj.WN(1e-2), gj.WN(1e-5), RATE)
GNSS, WHEEL = setups.on_arms()
SCALE = 0.03
"""Of this drive: 1.5 standard deviations."""


@pytest.fixture(scope="module")
def drive():
    """IMU, times and values of the fixes, the start as far as it is known, and the truth."""
    imu, truth = nj.perfect_imu(nj.motions.lemniscate(float(SECONDS), RATE, attitude="navigation"), RATE)
    rng = np.random.default_rng(11)
    sd = np.sqrt([float(m.processes[0].sigma2) for m in ERRORS.models])
    noise = rng.standard_normal((len(imu), 6)) * sd
    noisy = dataclasses.replace(imu, accel=imu.accel + noise[:, :3], gyro=imu.gyro + noise[:, 3:])
    attitude = Rotation.from_quat(truth.quaternion, scalar_first=True)
    at = np.arange(20, SECONDS * 20 + 1, 20)
    antenna = (
        truth.position[at] + attitude[at].apply(setups.ARM) + rng.standard_normal((len(at), 3)) * [0.05, 0.05, 0.1]
    )
    # not at the end, where no rate is known
    half = np.arange(10, SECONDS * 20, 10)
    rate = (imu.gyro[half - 1] + imu.gyro[half]) / 2
    wheel = attitude[half].inv().apply(truth.velocity[half]) + np.cross(rate, setups.WHEEL_ARM)
    wheel[:, 0] *= 1 + SCALE
    wheel += rng.standard_normal(wheel.shape) * [0.03, 0.05, 0.05]
    e = rng.standard_normal(9) * np.sqrt(np.diag(START.covariance))
    start = {
        "position": truth.position[0] + e[:3],
        "velocity": truth.velocity[0] + e[3:6],
        "quaternion": (Rotation.from_rotvec(e[6:]) * attitude[0]).as_quat(scalar_first=True),
        "initial": START,
    }
    return noisy, (truth.time[at], antenna), (truth.time[half], wheel), start, truth


def navigated(drive, gnss, wheel=WHEEL, **options):
    imu, antenna, speed, start, _ = drive
    return nj.navigate(imu, [nj.Fixes(gnss, *antenna), nj.Fixes(wheel, *speed)], ERRORS, **start, **options)


def errors(solution, truth):
    """Estimate minus truth in p, v and the rotation vector, at whole seconds."""
    at = np.searchsorted(solution.time, np.arange(1.0, SECONDS + 0.5) - 1e-6)
    rows = np.round(solution.time[at] * RATE).astype(int)
    mine, exact = (
        Rotation.from_quat(x.quaternion[i], scalar_first=True) for x, i in ((solution.trajectory, at), (truth, rows))
    )
    e = [
        solution.trajectory.position[at] - truth.position[rows],
        solution.trajectory.velocity[at] - truth.velocity[rows],
    ]
    return np.concatenate([*e, (mine * exact.inv()).as_rotvec()], axis=1), solution.sd[at, :9]


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True])
def test_the_estimate_lies_within_its_band(drive, smooth):
    """All errors within 4.5 standard deviations, and innovations as large as stated, 4.5 sigma of their number."""
    solution = navigated(drive, GNSS, smooth=smooth)
    e, sd = errors(solution, drive[-1])
    assert np.abs(e / sd).max() < 4.5
    # far better than the arms are long
    assert sd[-1, :3].max() < 0.1
    for nis, K in zip(solution.nis.values(), (3, 3), strict=True):
        assert abs(nis.mean() / K - 1) < 4.5 * np.sqrt(2 / (K * len(nis)))


@pytest.mark.slow
def test_an_arm_that_the_filter_does_not_know_is_a_bias(drive):
    """The height of the antenna is taken for that of the IMU, and so the forward arm, up to what turns tell."""
    solution = navigated(drive, nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1))
    e, sd = errors(solution, drive[-1])
    assert np.abs(e[:, 2] / sd[:, 2]).min() > 4.5
    truth = drive[-1]
    arm = Rotation.from_quat(truth.quaternion[20::20], scalar_first=True).apply(setups.ARM)
    assert np.mean(e[:, 2]) == pytest.approx(np.mean(arm[:, 2]), abs=0.2)
    # and one sees it: an arm turns, a position does not
    assert solution.nis["gnss_position"].mean() / 3 > 1 + 4.5 * np.sqrt(2 / (3 * SECONDS))


@pytest.mark.slow
def test_a_scale_factor_that_the_filter_does_not_know_is_seen(drive):
    """A wheel that is taken for exact has innovations far larger than stated."""
    exact = nj.Odometer(2.0, speed=0.03, sideways=0.05, lever_arm=setups.WHEEL_ARM)
    nis = navigated(drive, GNSS, exact).nis["odometer"]
    assert nis.mean() / 3 > 1 + 4.5 * np.sqrt(2 / (3 * len(nis)))


@pytest.mark.slow
def test_tuning_finds_the_noise_and_that_of_the_wheel(drive):
    """White noise of the accelerometers from four times too much, within 4 standard errors; so the aiding sensors'."""
    imu, antenna, speed, start, _ = drive
    guess = nj.ImuErrors(gj.WN(4e-2), ERRORS.models[3], RATE)
    fixes = [nj.Fixes(GNSS, *antenna), nj.Fixes(WHEEL, *speed)]
    found = nj.tune(imu, fixes, guess, tune_aiding=True, hold=["gyro WN sigma2"], every=10, **start)
    assert found.converged
    truth = dict(zip(found.names, [1e-2, 1e-5, 1.0, 1.0, 1.0, 1.0], strict=True))
    assert found.names[2:] == (
        "gnss_position n, e sd",
        "gnss_position d sd",
        "odometer speed sd",
        "odometer right, down sd",
    )
    sought = np.array([name != "gyro WN sigma2" for name in found.names])
    assert found.observable[sought].all()
    z = np.log(found.value / list(truth.values()))[sought] / found.se[sought]
    assert np.abs(z).max() < 4
    assert np.log(4) / found.se[0] > 4
