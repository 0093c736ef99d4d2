"""Simulated drives with known truth: fixes kept from the filter, errors against the reference, and what is saved."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import arrays_of, assert_same_result
from scipy import stats

import nav_jax as nj
from gmwm_jax._internal.state_files import Content, write_state
from gmwm_jax._internal.states import State, to_state

RATE = 20.0
REFERENCE = nj.motions.lemniscate(duration=60.0, rate=RATE)
ERRORS = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-6) + RW(gamma2=1e-10)", rate=RATE)
START = nj.InitialUncertainty(position_sd=0.2, velocity_sd=0.1, attitude_sd=0.02)
OUTAGES = [(20.0, 30.0), (45.0, 50.0)]


@pytest.fixture(scope="module")
def drive():
    """An IMU whose errors are those of the filter, fixes with covariances of their own, and the start."""
    rng = np.random.default_rng(11)
    perfect, exact = nj.perfect_imu(REFERENCE)
    n = len(perfect)
    gyro = perfect.gyro + rng.normal(0.0, 1e-3, (n, 3)) + np.cumsum(rng.normal(0.0, 1e-5, (n, 3)), axis=0)
    imu = replace(perfect, gyro=gyro, accel=perfect.accel + rng.normal(0.0, 0.2, (n, 3)))
    time = exact.time[10::10]
    factors = rng.normal(size=(len(time), 3, 3)) * 0.1 + 0.1 * np.eye(3)
    C = factors @ factors.transpose(0, 2, 1)
    value = exact.position[10::10] + (factors @ rng.normal(size=(len(time), 3, 1)))[:, :, 0]
    gnss = nj.GnssPosition(horizontal=0.2, vertical=0.2, outages=OUTAGES)
    q = exact.quaternion[0]
    start = {
        "position": exact.position[0] + rng.normal(0.0, 0.2, 3),
        "velocity": exact.velocity[0] + rng.normal(0.0, 0.1, 3),
        "quaternion": q,
        "initial": START,
    }
    return imu, nj.Fixes(gnss, time, value, C), start, exact


@pytest.fixture(scope="module")
def solution(drive):
    imu, fixes, start, exact = drive
    return nj.navigate(imu, [fixes], ERRORS, **start, reference=exact)


def test_what_is_withheld_is_what_the_solution_says_there(drive, solution):
    _, fixes, *_ = drive
    withheld = solution.withheld["gnss_position"]
    np.testing.assert_array_equal(withheld.time, fixes.time[~fixes.given])
    rows = np.searchsorted(solution.time, withheld.time - 1e-9)
    predicted = solution.trajectory.position[rows]
    np.testing.assert_allclose(withheld.error, predicted - fixes.value[~fixes.given], rtol=0, atol=1e-12)
    variances = np.diagonal(withheld.covariance - fixes.covariance[~fixes.given], axis1=1, axis2=2)
    np.testing.assert_allclose(variances, solution.sd[rows, :3] ** 2, rtol=1e-9)
    np.testing.assert_array_equal(
        fixes.given, ~((fixes.time >= 20) & (fixes.time <= 30) | (fixes.time >= 45) & (fixes.time <= 50))
    )


@pytest.mark.slow
def test_a_filter_without_those_fixes_is_the_same(drive, solution):
    imu, fixes, start, _ = drive
    gnss = nj.GnssPosition(horizontal=0.2, vertical=0.2)
    few = nj.Fixes(gnss, fixes.time[fixes.given], fixes.value[fixes.given], fixes.covariance[fixes.given])
    other = nj.navigate(imu, [few], ERRORS, **start)
    np.testing.assert_allclose(other.trajectory.position[-1], solution.trajectory.position[-1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.nis["gnss_position"], solution.nis["gnss_position"], rtol=1e-8)
    assert other.withheld == {}


def test_innovations_come_in_the_unit_of_the_sensor(drive, solution):
    """That of the first component is measured minus predicted, whatever the covariance of the fix is."""
    _, fixes, *_ = drive
    before = solution.before
    rows = np.searchsorted(before.time, fixes.time[fixes.given] - 1e-9)
    difference = (fixes.value[fixes.given] - before.position[rows])[:, 0]
    np.testing.assert_allclose(solution.innovation["gnss_position"][:, 0], difference, rtol=0, atol=1e-9)
    claimed = np.sqrt(before.sd[rows, 0] ** 2 + fixes.covariance[fixes.given][:, 0, 0])
    np.testing.assert_allclose(solution.innovation_sd["gnss_position"][:, 0], claimed, rtol=1e-9)


def test_a_filter_that_is_right_says_so(solution):
    """Its innovations are white: their squares are chi-square distributed; and errors have the size that is claimed."""
    nis = solution.nis["gnss_position"]
    low, high = stats.chi2(3 * len(nis)).ppf([0.0005, 0.9995]) / len(nis)
    assert low < nis.mean() < high
    # the two ends of outages are nearly independent
    ends = np.array([row["nis"] for row in solution.withheld["gnss_position"].rows()])
    assert 0.0 < ends.mean() < 4.0
    for rms, claimed, _ in solution.errors.rms().values():
        assert 0.3 < rms / claimed < 2.5
    text = repr(solution)
    for part in ("95 % band [", "horizontal error at the end [m]", "RMS", "Errors against the reference at"):
        assert part in text


def test_errors_are_those_of_the_estimates(drive, solution):
    *_, exact = drive
    errors = solution.errors
    rows = np.searchsorted(solution.time, errors.time - 1e-9)
    known = exact.at(errors.time)
    np.testing.assert_allclose(errors.error[:, :3], (solution.trajectory.position[rows] - known.position), atol=1e-8)
    np.testing.assert_allclose(errors.error[:, 3:6], (solution.trajectory.velocity[rows] - known.velocity), atol=1e-8)
    np.testing.assert_allclose(errors.sd, solution.sd[rows, :9], rtol=1e-9)


def test_a_reference_that_is_shorter_or_elsewhere(drive):
    imu, fixes, start, exact = drive
    part = exact.at(exact.time[200:400])
    found = nj.navigate(imu, [fixes], ERRORS, **start, reference=part).errors
    assert found.time[0] >= part.time[0]
    assert found.time[-1] <= part.time[-1]
    away = nj.Trajectory(exact.time + 1000.0, exact.position, exact.velocity, exact.quaternion)
    with pytest.raises(ValueError, match="they have no time in common"):
        nj.navigate(imu, [fixes], ERRORS, **start, reference=away)


@pytest.mark.slow
def test_a_smoother_has_predictions_too(drive, solution):
    imu, fixes, start, exact = drive
    smooth = nj.navigate(imu, [fixes], ERRORS, **start, smooth=True, reference=exact)
    one, two = (s.withheld["gnss_position"] for s in (smooth, solution))
    np.testing.assert_allclose(one.error, two.error, rtol=0, atol=1e-9)
    position = [s.errors.rms()["position"] for s in (smooth, solution)]
    assert position[0][0] < position[1][0]


def test_tables_come_back(solution, tmp_path):
    for suffix in (".csv", ".npz"):
        path = solution.export(tmp_path / f"a{suffix}")
        again = nj.read_trajectory(path)
        np.testing.assert_allclose(again.position, solution.trajectory.position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(again.velocity, solution.trajectory.velocity, rtol=0, atol=1e-12)
    columns = np.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(columns["sd_position_n_m"], solution.sd[:, 0])
    np.testing.assert_array_equal(columns["sd_gyro_z_rad_s"], solution.sd[:, 14])
    np.testing.assert_array_equal(columns["accel_x_error_m_s2"], solution.sensor_errors[:, 0])
    origin = (0.8, 0.1, 400.0)
    solution.export(tmp_path / "b.csv", origin=origin)
    there = nj.read_trajectory(tmp_path / "b.csv", position="geodetic", origin=origin)
    np.testing.assert_allclose(there.position, solution.trajectory.position, rtol=0, atol=1e-7)
    with pytest.raises(ValueError, match=r"exported as \.csv, \.npz, \.kml, \.gpx"):
        solution.export(tmp_path / "a.txt")


def test_maps(solution, tmp_path):
    origin, start = (0.8, 0.1, 400.0), np.datetime64("2024-07-08T12:00:00")
    solution.export(tmp_path / "a.gpx", origin=origin, start=start, interval=5.0)
    points = nj.read_gnss(tmp_path / "a.gpx", origin=origin, clock="day")
    np.testing.assert_allclose(points.time, 43200 + np.arange(0.0, 61.0, 5.0), rtol=0, atol=1e-3)
    rows = np.searchsorted(solution.time, points.time - 43200 - 1e-9)
    np.testing.assert_allclose(points.position, solution.trajectory.position[rows], rtol=0, atol=1e-3)
    text = solution.export(tmp_path / "a.kml", origin=origin).read_text()
    assert text.count(",") == 2 * 61
    assert "<when>" not in text
    timed = solution.export(tmp_path / "b.kml", origin=origin, start=start).read_text()
    assert timed.count("<when>") == timed.count("<gx:coord>") == 61
    with pytest.raises(ValueError, match="give origin="):
        solution.export(tmp_path / "c.kml")


@pytest.mark.parametrize("suffix", [".npz", ".json", ".nc", ".zarr"])
def test_a_solution_comes_back_as_it_was(solution, tmp_path, suffix):
    path = solution.save(tmp_path / f"drive{suffix}")
    found = nj.load(path)
    assert_same_result(found, solution)
    assert_same_result(nj.recorded.Navigation.load(path), solution)
    assert repr(found) == repr(solution)
    if suffix != ".npz":
        return
    for figure in ("navigation_data", "innovations_data", "sensor_estimates_data", "withheld_data"):
        data = getattr(nj.plotting, figure)
        shown, before = arrays_of(data(found)), arrays_of(data(solution))
        assert shown
        for a, b in zip(shown, before, strict=True):
            np.testing.assert_array_equal(a, b)
    assert found.plot().axes


@pytest.mark.slow
def test_a_solution_without_aiding_comes_back(drive, tmp_path):
    imu, _, start, _ = drive
    free = nj.navigate(imu, [], ERRORS, **start)
    assert_same_result(nj.load(free.save(tmp_path / "free.json")), free)


def test_a_solution_whose_innovations_are_of_no_fixes_is_refused(solution, tmp_path):
    state = to_state(solution)
    for part, complaint in (
        ({"fixes": []}, "innovation is of gnss_position, and not of the fixes that were given"),
        ({"nis": {}}, "nis is of no sensor, and not of the fixes"),
    ):
        content = Content("nav_jax.Navigation", State({**state.tree, **part}, state.arrays))
        with pytest.raises(ValueError, match=complaint):
            nj.load(write_state(tmp_path / "x.npz", content))


def test_a_track_is_no_solution(solution, tmp_path):
    """Both may be .npz, and neither is taken for the other."""
    with pytest.raises(ValueError, match=r"track\.npz"):
        nj.load(solution.export(tmp_path / "track.npz"))
    with pytest.raises(ValueError, match=r"\.gpx"):
        solution.save(tmp_path / "track.gpx")


def test_a_dataset_with_units(solution):
    dataset = solution.to_xarray()
    assert dataset.position.attrs["units"] == "m"
    np.testing.assert_array_equal(dataset.gnss_position_nis, solution.nis["gnss_position"])
    np.testing.assert_array_equal(dataset.gnss_position_withheld_error, solution.withheld["gnss_position"].error)
    assert dataset.sd.sel(component="gyro_z").component_unit == "rad/s"
