"""Receivers on records: position and velocity of one file together, covariances of each fix, states of their own."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import nav_jax as nj
from nav_jax.app.record_file import FIXES
from nav_jax.kinematics.rotation import rotate

RATE = 20.0
ARM = np.array([1.0, 0.5, -1.5])
FILTER = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", RATE)
START = nj.InitialUncertainty(0.1, 0.1, 0.01)


@pytest.fixture(scope="module")
def drive():
    """Samples, start, and a file of fixes of an antenna on an arm with covariances that change."""
    rng = np.random.default_rng(5)
    samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=RATE, attitude="navigation"))
    imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.01, (200, 3)), RATE)
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    at = slice(10, None, 10)
    q = jnp.asarray(exact.quaternion[at].T)
    arm = np.asarray(rotate(q, jnp.broadcast_to(ARM[:, None], (3, 20)))).T
    rate = np.pad(samples.gyro, ((0, 1), (0, 0)), mode="edge")[at]
    swept = np.asarray(rotate(q, jnp.asarray(np.cross(rate, ARM).T))).T
    root = 0.05 * rng.normal(size=(20, 6, 6)) + 0.1 * np.eye(6)
    C = root @ root.transpose(0, 2, 1)
    noise = np.einsum("fij,fj->fi", np.linalg.cholesky(C), rng.normal(size=(20, 6)))
    record = nj.recorded.GnssRecord(
        exact.time[at],
        exact.position[at] + arm + noise[:, :3],
        covariance=C[:, :3, :3],
        velocity=exact.velocity[at] + swept + noise[:, 3:],
        velocity_covariance=C[:, 3:, 3:],
    )
    return imu, start | {"initial": START}, record, C


def test_both_of_a_receiver_are_its_positions_and_its_velocities(drive):
    """One sensor with both, or two: the same estimates and claims, 1e-9, where nothing is estimated of the receiver."""
    imu, start, record, _ = drive
    known = {"lever_arm": tuple(ARM)}
    two = nj.navigate(imu, [record.position_fixes(**known), record.velocity_fixes(**known)], FILTER, **start)
    one = nj.navigate(imu, [record.fixes(**known)], FILTER, **start)
    np.testing.assert_allclose(one.trajectory.position, two.trajectory.position, atol=1e-9)
    np.testing.assert_allclose(one.sd, two.sd, rtol=1e-8, atol=1e-13)
    np.testing.assert_allclose(one.nis["gnss"], two.nis["gnss_position"] + two.nis["gnss_velocity"], rtol=1e-7)
    assert one.fixes[0].sensor.rate == pytest.approx(2.0)


def test_an_arm_is_found_with_a_covariance_of_each_fix(drive):
    """Whole covariances, 6 by 6: the positions are as good as with a known arm, and better than without any."""
    imu, start, record, C = drive

    def off(**sensor):
        fixes = dataclasses.replace(record.fixes(**sensor), covariance=C)
        return nj.navigate(imu, [fixes], FILTER, **start)

    known, found, lost = off(lever_arm=tuple(ARM)), off(lever_arm_sd=2.0), off()
    assert found.sd[-1, 0] > known.sd[-1, 0]
    assert np.mean(found.nis["gnss"]) < 9.0 < np.mean(lost.nis["gnss"])
    apart = [np.abs(x.trajectory.position[-1] - known.trajectory.position[-1]) for x in (found, lost)]
    assert (apart[0] < 4 * found.sd[-1, :3]).all()
    assert apart[1].max() > apart[0].max()


def test_withheld_fixes_of_both_are_judged_by_their_positions(drive):
    imu, start, record, _ = drive
    solution = nj.navigate(imu, [record.fixes(lever_arm=tuple(ARM), outages=[(4.0, 6.0)])], FILTER, **start)
    kept = solution.withheld["gnss"]
    assert kept.judged == [0, 1]
    assert kept.covariance.shape == (5, 6, 6)
    assert "horizontal error at the end [m]" in repr(kept)


def test_a_whole_receiver_in_the_configuration_of_a_record(drive, tmp_path):
    """Its settings, and standard deviations of positions and velocities apart; the rate is that of the fixes."""
    _, _, record, _ = drive
    table = np.column_stack([record.time, record.position, record.velocity])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time,north,east,down,vn,ve,vd", comments="")
    section = FIXES["gnss"](
        type="gnss", file="a.csv", format="table", horizontal="10 cm", vertical=0.2, horizontal_velocity=0.3,
        vertical_velocity=0.4, lever_arm_sd="5 cm", averaged="250 ms", drift="GM(beta=0.1, variance=0.01)",
    )  # fmt: skip
    fixes, read = section.read(tmp_path, None)
    sensor = fixes.sensor
    np.testing.assert_allclose(sensor.believed, [0.1, 0.1, 0.2, 0.3, 0.3, 0.4])
    assert (sensor.averaged, len(sensor.states), len(read)) == (0.25, 6, 20)
    assert sensor.rate == pytest.approx(2.0)
    np.testing.assert_allclose(fixes.value, table[:, 1:], rtol=1e-12)
