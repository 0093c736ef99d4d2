"""A start on the move: against attitudes that are known, by other ways, and by what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
from nav import moving
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.recorded import GnssRecord, align_on_the_move
from nav_jax.recorded._wahba import davenport

GOOD = moving.stated(moving.Errors())
ARM = (1.0, 0.5, -1.2)


def test_the_q_method_is_the_rotation_of_the_singular_value_decomposition():
    rng = np.random.default_rng(2)
    for _ in range(5):
        beta = rng.normal(size=(9, 3))
        alpha = Rotation.random(random_state=rng).apply(beta) + 0.1 * rng.normal(size=(9, 3))
        found = Rotation.from_quat(np.roll(davenport(alpha, beta), -1)).as_matrix()
        np.testing.assert_allclose(found, Rotation.align_vectors(alpha, beta)[0].as_matrix(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("euler", [(0.3, -0.2, 2.0), (np.pi, 0.4, -1.0)])
def test_perfect_sensors_tell_any_attitude(euler, velocities):
    """On the flat Earth what is integrated is what made the samples: nothing is left but rounding."""
    drive = moving.car(euler)
    start = align_on_the_move(drive.imu, moving.fixes(drive, velocities=velocities), **GOOD)
    assert start.time == 30.0
    np.testing.assert_allclose(moving.errors_of(start, drive), 0.0, atol=1e-9)
    np.testing.assert_allclose(start.gyro_bias, 0.0, atol=1e-9)
    assert start.misfit < 1e-9


@pytest.mark.parametrize("velocities", [True, False])
def test_perfect_sensors_on_an_earth_that_turns(velocities):
    """Trapezia of the Earth's part, between velocities that are interpolated over 0.5 s: some 1e-7 rad.

    Without its rate the heading is off by what the body turns with it, 30 s of 15 arcsec/s, of which the fit takes some
    for a bias.
    """
    drive = moving.car(earth=moving.EARTH)
    fixes = moving.fixes(drive, velocities=velocities)
    error = moving.errors_of(align_on_the_move(drive.imu, fixes, earth=moving.EARTH, **GOOD), drive)
    np.testing.assert_allclose(error[6:], 0.0, atol=1e-6)
    np.testing.assert_allclose(error[:6], 0.0, atol=1e-4)
    none = {"gyro_bias_sd": 0.0, "accel_bias_sd": 0.0}
    flat = nj.FlatEarth(float(moving.EARTH.gravity_n(np.zeros(3))[2]))
    wrong = moving.errors_of(align_on_the_move(drive.imu, fixes, earth=flat, **GOOD | none), drive)
    assert np.abs(wrong[6:]).max() > 1e-4


@pytest.mark.parametrize("velocities", [True, False])
def test_an_antenna_on_an_arm(velocities):
    """Its velocity is a mean over 0.1 s, and one-sided at both ends of the record."""
    drive = moving.car()
    start = align_on_the_move(drive.imu, moving.fixes(drive, velocities=velocities, arm=ARM), lever_arm=ARM, **GOOD)
    np.testing.assert_allclose(moving.errors_of(start, drive)[6:], 0.0, atol=1e-3)
    np.testing.assert_allclose(moving.errors_of(start, drive)[:6], 0.0, atol=5e-3)


def test_biases_that_are_found():
    """Constant ones, without noise: the fit has them as unknown, so that only its prior keeps something of them."""
    drive = moving.car()
    shift = np.array([0.002, -0.001, 0.003])
    imu = replace(drive.imu, gyro=drive.imu.gyro + shift)
    start = align_on_the_move(
        imu, moving.fixes(drive), **GOOD | {"velocity_sd": 1e-3, "gyro_noise": 0.0, "accel_noise": 0.0}
    )
    np.testing.assert_allclose(start.gyro_bias, shift, atol=2e-5)
    np.testing.assert_allclose(moving.errors_of(start, drive)[6:], 0.0, atol=1e-3)


def test_velocities_that_are_old_and_have_no_vertical_part():
    drive = moving.car()
    clean = moving.fixes(drive)
    v = np.column_stack([np.interp(clean.time - 0.125, drive.time, x) for x in drive.velocity.T])
    v[:, 2] = np.nan
    start = align_on_the_move(drive.imu, replace(clean, velocity=v), averaged=0.25, **GOOD)
    np.testing.assert_allclose(moving.errors_of(start, drive)[6:], 0.0, atol=1e-4)


def test_the_sd_of_the_file_counts():
    drive = moving.car()
    clean = moving.fixes(drive)
    C = np.broadcast_to(np.diag([0.05, 0.05, 0.1]) ** 2, (len(clean), 3, 3))
    told = replace(clean, velocity_covariance=C, covariance=np.broadcast_to(np.eye(3) * 4e-4, (len(clean), 3, 3)))
    own = align_on_the_move(drive.imu, told, **GOOD | {"velocity_sd": None, "position_sd": None})
    given = align_on_the_move(drive.imu, clean, **GOOD)
    np.testing.assert_allclose(own.initial.covariance, given.initial.covariance, rtol=1e-9, atol=1e-15)


def test_errors_larger_than_stated_are_claimed():
    drive = moving.car()
    clean = moving.fixes(drive)
    rng = np.random.default_rng(3)
    rough = replace(clean, velocity=clean.velocity + 0.5 * rng.normal(size=clean.velocity.shape))
    exact, odd = (align_on_the_move(drive.imu, f, **GOOD) for f in (clean, rough))
    assert 30 < odd.misfit < 100  # (0.5/0.05)^2, and vertically (0.5/0.1)^2
    ratio = odd.initial.covariance[8, 8] / exact.initial.covariance[8, 8]
    assert 0.5 * odd.misfit < ratio < 2 * odd.misfit


@pytest.mark.parametrize("noisy", [False, True])
def test_no_heading_without_a_change_of_velocity(noisy):
    """Nor one of noise, of which there is as much as of a good motion."""
    drive = moving.turned(*nj.perfect_imu(nj.motions.straight(duration=36.0, rate=moving.RATE)), (0.3, -0.2, 2.0))
    errors = moving.Errors((0.2, 0.02), (0.3, 4e-3), (0.1, 0.1, 0.2))
    imu, fixes = (
        moving.with_errors(drive, moving.fixes(drive), errors, 0) if noisy else (drive.imu, moving.fixes(drive))
    )
    with pytest.raises(
        ValueError, match=r"The motion from 0 to 30 s tells the heading .* a filter needs 10: .* by .* m/s"
    ):
        align_on_the_move(imu, fixes, **moving.stated(errors))


def test_what_is_missing_is_said():
    drive = moving.car()
    clean = moving.fixes(drive)
    with pytest.raises(ValueError, match=r"5 fixes lie in the first 2 s that .* takes 6"):
        align_on_the_move(drive.imu, clean, window=2.0, **GOOD)
    with pytest.raises(ValueError, match="0 fixes lie in the first 30 s"):
        align_on_the_move(drive.imu, clean.shifted(100.0), **GOOD)
    with pytest.raises(ValueError, match="do not say how good a velocity is: give velocity_sd"):
        align_on_the_move(drive.imu, clean, **GOOD | {"velocity_sd": None})
    with pytest.raises(ValueError, match="do not say how good a position is: give position_sd"):
        align_on_the_move(drive.imu, replace(clean, velocity=None), **GOOD | {"position_sd": None})
    with pytest.raises(ValueError, match=r"1501 fixes lie in a window of 30 s, .*slice\(None, None, 3\)"):
        align_on_the_move(drive.imu, moving.fixes(drive, every=1), **GOOD)
    with pytest.raises(ValueError, match="velocity_sd must be positive"):
        align_on_the_move(drive.imu, clean, **GOOD | {"velocity_sd": 0.0})
    elsewhere = GnssRecord(clean.time, clean.position, origin=np.array([0.9, 0.1, 400.0]), velocity=clean.velocity)
    with pytest.raises(ValueError, match="Positions are about the origin"):
        align_on_the_move(drive.imu, elsewhere, earth=moving.EARTH, **GOOD)


@pytest.mark.slow
def test_the_start_is_one_of_navigate():
    """From there on, with the fixes that follow: errors within what is claimed, 4.5 sigma."""
    drive = moving.car(duration=60.0)
    errors = moving.Errors()
    imu, fixes = moving.with_errors(drive, moving.fixes(drive), errors, 5)
    start = align_on_the_move(imu, fixes, **moving.stated(errors))
    given = {name: getattr(start, name) for name in ("position", "velocity", "quaternion", "initial")}
    sigma2 = [d**2 * moving.RATE for d in errors.densities]
    filter = nj.ImuErrors(
        f"WN(sigma2={sigma2[0]!r})",
        f"WN(sigma2={sigma2[1]!r})",
        rate=moving.RATE,
        accel_bias_sd=0.05,
        gyro_bias_sd=0.003,
    )
    later = fixes.select(fixes.time > start.time)
    aiding = later.position_fixes(horizontal=errors.position, vertical=errors.position)
    found = nj.navigate(nj.recorded.between(imu, start.time), [aiding], filter, **given, every=5)
    last = found.trajectory.quaternion[-1]
    psi = Rotation.from_matrix(
        Rotation.from_quat(np.roll(last, -1)).as_matrix() @ drive.C[-1].T @ np.eye(3)
    ).as_rotvec()
    assert (np.abs(psi) < 4.5 * found.sd[-1, 6:9]).all()
    assert (np.abs(found.trajectory.position[-1] - drive.position[-1]) < 4.5 * found.sd[-1, :3]).all()
