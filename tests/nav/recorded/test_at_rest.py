"""A start at rest: against attitudes that are known, and by its claim over many draws."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.recorded import align_at_rest

RATE = 50.0
DRAWS = 300
EARTH = nj.Wgs84((np.deg2rad(46.5), 0.1, 400.0))
WE = 7.292115e-5 * np.cos(np.deg2rad(46.5))


def standing(euler, *, earth=EARTH, num=500, bias=(0.0, 0.0), noise=0.0, seed=0):
    """Samples at rest, by the rotation matrix of these angles."""
    C = Rotation.from_euler("ZYX", np.asarray(euler)[::-1]).as_matrix()
    zero = np.zeros(3)
    f = -C.T @ np.asarray(earth.gravity_n(zero)) + bias[0]
    w = C.T @ np.asarray(earth.rate_n(zero)) + bias[1]
    rng = np.random.default_rng(seed)
    shaken = noise * rng.normal(size=(2, num, 3))
    return nj.Imu(np.arange(num) / RATE, w + 0.01 * shaken[1] * (noise > 0), f + shaken[0], RATE), C


@pytest.mark.parametrize("euler", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.5), (-0.5, 1.0, -3.0)])
def test_perfect_sensors_tell_the_whole_attitude(euler):
    imu, C = standing(euler)
    start = align_at_rest(imu, earth=EARTH, gyro_bias_sd=1e-9)
    found = Rotation.from_quat(np.roll(start.quaternion, -1)).as_matrix()
    np.testing.assert_allclose(found, C, atol=1e-9)
    np.testing.assert_allclose(start.gyro_bias, 0.0, atol=1e-14)
    assert start.time == imu.epochs[-1]


@pytest.mark.slow
def test_errors_are_as_large_as_claimed():
    """Over biases that are drawn: each angle by its standard deviation, and all by their covariance, 4.5 sigma."""
    rng = np.random.default_rng(1)
    sds, found = (0.02, np.deg2rad(0.1 / 3600)), []
    for _ in range(DRAWS):
        imu, C = standing((0.2, -0.1, 1.0), bias=[sd * rng.normal(size=3) for sd in sds], num=20)
        start = align_at_rest(imu, earth=EARTH, accel_bias_sd=sds[0], gyro_bias_sd=sds[1])
        turned = Rotation.from_quat(np.roll(start.quaternion, -1)).as_matrix() @ C.T
        found.append(Rotation.from_matrix(turned).as_rotvec())
    C = np.asarray(start.initial.covariance)[6:, 6:]
    low, high = stats.chi2.ppf(stats.norm.cdf([-4.5, 4.5]), DRAWS) / DRAWS
    ratio = np.mean(np.square(found), axis=0) / np.diag(C)
    assert ((low < ratio) & (ratio < high)).all(), ratio
    low, high = stats.chi2.ppf(stats.norm.cdf([-4.5, 4.5]), 3 * DRAWS) / DRAWS
    assert low < np.mean(np.einsum("ri,ij,rj->r", found, np.linalg.inv(C), found)) < high
    assert np.sqrt(C[0, 0]) == pytest.approx(0.02 / 9.807, rel=1e-3)
    assert C[2, 2] == pytest.approx((sds[1] / WE) ** 2 + C[0, 0] * np.tan(np.deg2rad(46.5)) ** 2, rel=1e-3)


def test_a_mems_is_told_that_it_has_no_heading():
    imu, C = standing((0.1, 0.0, 0.7))
    with pytest.raises(ValueError, match=r"Gyros with 36 deg/h of bias do not tell a heading: .* is 10.4 deg/h"):
        align_at_rest(imu, earth=EARTH, gyro_bias_sd=np.deg2rad(0.01))
    with pytest.raises(ValueError, match="on an Earth that does not turn do not tell a heading"):
        align_at_rest(imu)
    start = align_at_rest(imu, earth=EARTH, gyro_bias_sd=np.deg2rad(0.01), yaw=0.7, yaw_sd=0.1)
    np.testing.assert_allclose(Rotation.from_quat(np.roll(start.quaternion, -1)).as_matrix(), C, atol=1e-9)
    with pytest.raises(ValueError, match="Give the standard deviation of the yaw"):
        align_at_rest(imu, yaw=0.7)


def test_what_is_no_rest_is_said():
    imu, _ = standing((0.1, 0.0, 0.7))
    with pytest.raises(ValueError, match="Gravity points up in this body"):
        align_at_rest(nj.recorded.mounted(imu, (np.pi, 0.0, 0.0)), yaw=0.0, yaw_sd=0.1)
    in_g = nj.Imu(imu.time, imu.gyro, imu.accel / 9.80665, RATE)
    with pytest.raises(ValueError, match=r"The mean specific force is 1 m/s\^2 and gravity 9.807: .* if it is in g"):
        align_at_rest(in_g, yaw=0.0, yaw_sd=0.1)


@pytest.mark.slow
def test_the_start_is_one_of_navigate():
    imu, _ = standing((0.02, 0.01, 0.7), noise=0.01)
    start = align_at_rest(imu, earth=EARTH, yaw=0.7, yaw_sd=0.05, accel_bias_sd=0.01, position_sd=0.1)
    later = nj.Imu(start.time + imu.time, imu.gyro, imu.accel, RATE)
    filter = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=RATE, accel_bias_sd=0.01)
    given = {name: getattr(start, name) for name in ("position", "velocity", "quaternion", "initial")}
    found = nj.navigate(later, [], filter, **given, earth=EARTH, every=10)
    assert np.all(np.abs(found.trajectory.position[-1]) < 4.5 * found.sd[-1, :3])
