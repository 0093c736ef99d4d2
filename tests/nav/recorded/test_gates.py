"""Gates on recorded drives: what is refused, and that it is as if it had never been."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import nav_jax as nj
from nav_jax.filter.gating import gated_update
from nav_jax.recorded import RefusedFixesWarning
from nav_jax.recorded.gates import runs_of

RATE = 20.0
WRONG = 7


@pytest.fixture(scope="module")
def record():
    samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=20.0, rate=RATE))
    rng = np.random.default_rng(3)
    imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (len(samples), 3)), RATE)
    p, time = exact.position[20::20], exact.time[20::20]
    gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    fixes = nj.Fixes(gnss, time, p + rng.normal(0.0, 0.02, p.shape))
    height = nj.Fixes(nj.Barometer(height=0.5), time, -p[:, 2:])
    filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=RATE)
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    return imu, fixes, height, filter, start | {"initial": nj.InitialUncertainty(0.1, 0.1, 0.01), "every": 10}


def off(fixes, rows, by=(3.0, 0.0, 0.0)):
    value = fixes.value.copy()
    value[rows] += by
    return dataclasses.replace(fixes, value=value)


def test_a_wide_gate_changes_nothing(record):
    imu, fixes, height, filter, start = record
    plain = nj.navigate(imu, [fixes, height], filter, **start)
    found = nj.navigate(imu, [fixes, height], filter, **start, gate=1 - 1e-12)
    np.testing.assert_allclose(found.trajectory.position, plain.trajectory.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.sd, plain.sd, rtol=1e-9)
    assert not plain.refused
    assert not any(x.any() for x in found.refused.values())
    assert "Gate of gnss_position: 0 of 20 fixes refused" in repr(found)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_fix_that_is_refused_might_as_well_not_be_there(record, smooth):
    """As where it is withheld, of which the normalised square is known by its whole covariance."""
    imu, fixes, height, filter, start = record
    wrong, at = off(fixes, WRONG), fixes.time[WRONG]
    outage = {"gnss_position": [(at - 0.1, at + 0.1)]}
    expected = nj.navigate(imu, [wrong, height], filter, **start, outages=outage, smooth=smooth)
    found = nj.navigate(imu, [wrong, height], filter, **start, gate={"gnss_position": 0.9999}, smooth=smooth)
    assert set(found.refused) == {"gnss_position"}
    assert np.flatnonzero(found.refused["gnss_position"]).tolist() == [WRONG]
    np.testing.assert_allclose(found.trajectory.position, expected.trajectory.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.sd, expected.sd, rtol=1e-9)
    others = np.arange(len(fixes.time)) != WRONG
    np.testing.assert_allclose(found.nis["gnss_position"][others], expected.nis["gnss_position"], rtol=1e-6)
    assert f"1 of 20 fixes refused, at {at:g} s" in repr(found)


def test_its_normalised_square_is_that_of_all_components(record):
    imu, fixes, _, filter, start = record
    wrong, at = off(fixes, WRONG), fixes.time[WRONG]
    withheld = nj.navigate(imu, [wrong], filter, **start, outages=[(at - 0.1, at + 0.1)]).withheld["gnss_position"]
    found = nj.navigate(imu, [wrong], filter, **start, gate=0.999).nis["gnss_position"]
    assert found[WRONG] == pytest.approx(withheld.nis[0], rel=1e-9)
    assert found[WRONG] > stats.chi2.ppf(0.999, 3)


def test_what_is_refused_in_a_row_is_warned_of(record, tmp_path):
    imu, fixes, height, filter, start = record
    wrong = off(fixes, slice(6, 12), by=(40.0, 0.0, 0.0))
    with pytest.warns(RefusedFixesWarning, match=r"refused 6 fixes of gnss_position in a row from 7 s on, and 6 of 20"):
        found = nj.navigate(imu, [wrong, height], filter, **start, gate=0.999)
    assert "6 of 20 fixes refused, at 7 (6 in a row) s" in repr(found)
    again = nj.load(found.save(tmp_path / "drive.npz"))
    np.testing.assert_array_equal(again.refused["gnss_position"], found.refused["gnss_position"])


@pytest.mark.parametrize(
    ("gate", "said"),
    [
        (99.9, "The gate of gnss_position is the probability with which a good fix passes"),
        (1.0, "from 0.5 to below 1, and this is 1.0"),
        (0.001, "from 0.5 to below 1, and this is 0.001"),
        (float("nan"), "The gate of gnss_position"),
        ({"gps": 0.99}, "There is no sensor 'gps' for a gate; there are gnss_position, barometer"),
    ],
)
def test_a_gate_that_is_none_is_refused(record, gate, said):
    imu, fixes, height, filter, start = record
    with pytest.raises(ValueError, match=said):
        nj.navigate(imu, [fixes, height], filter, **start, gate=gate)


def test_rows_of_what_is_refused():
    assert runs_of(np.array([False, True, True, False, True])) == [(1, 2), (4, 1)]
    assert runs_of(np.zeros(3, dtype=bool)) == []


def test_an_update_by_sensors_against_dense_algebra():
    """Two sensors of two and one scalars, three runs: one takes both, one refuses the first, one the second."""
    rng = np.random.default_rng(0)
    n, runs, sizes = 5, 3, (2, 1)
    A = rng.normal(size=(n, n, runs))
    P, H, r = np.einsum("ikr,jkr->ijr", A, A), rng.normal(size=(3, n, runs)), np.array([0.5, 0.7, 0.2])
    residual = np.array([[0.1, 40.0, 0.1], [0.2, -30.0, 0.1], [0.1, 0.3, 50.0]])
    limits = stats.chi2.ppf(0.999, sizes)
    given = (jnp.asarray(x) for x in (P, H, residual, r, np.ones(3)))
    after, update, c, _, passed = gated_update(*given, sizes, jnp.asarray(limits))
    assert passed.T.tolist() == [[True, True], [False, True], [True, False]]
    assert not np.any(np.asarray(update.gain)[:2, :, 1])
    for k in range(runs):
        cov, x = P[:, :, k], np.zeros(n)
        for own in (slice(0, 2), slice(2, 3)):
            h = H[own, :, k]
            S = h @ cov @ h.T + np.diag(r[own])
            nu = residual[own, k] - h @ x
            if nu @ np.linalg.solve(S, nu) <= limits[own.start // 2]:
                K = np.linalg.solve(S, h @ cov).T
                x, cov = x + K @ nu, cov - K @ h @ cov
        np.testing.assert_allclose(after[:, :, k], cov, atol=1e-10)
        np.testing.assert_allclose(c[:, k], x, atol=1e-10)
