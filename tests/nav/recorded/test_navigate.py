"""Plain navigation on sensor arrays: the filter of the Monte Carlo, without a reference."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.parameters import AidingLines
from nav_jax.filter.status import Status
from nav_jax.recorded.navigation import prepare_navigation, run_record
from nav_jax.recorded.reference import ReferenceErrors

REFERENCE = nj.motions.lemniscate(6.0, setups.RATE)
ERRORS = nj.ImuErrors(gj.WN(6e-5) + gj.AR1(0.998, 1e-8), gj.WN(1.5e-6), setups.RATE)
START = nj.InitialUncertainty(0.1, 0.05, 0.005)
SENSORS = (
    nj.GnssPosition(3.0, horizontal=0.3, vertical=0.5),
    nj.GnssVelocity(1.0, horizontal=0.05, vertical=0.1, outages=((2.5, 4.5),)),
    nj.Barometer(2.0, height=0.5, first=0.0),
)


@pytest.fixture(scope="module")
def emulated():
    """One run of the Monte Carlo, what came of it, and the same numbers as arrays."""
    e = nj.filter.prepare(nj.Scenario(REFERENCE, SENSORS, START), rate=setups.RATE)
    inputs = nj.filter.draw_inputs(e, ERRORS, nj.filter.run_keys(jax.random.key(8), 0, 1))
    outcome = nj.filter.run_filter(e, ERRORS, inputs)
    perfect, truth = nj.perfect_imu(REFERENCE, setups.RATE)
    errors = np.zeros((600, 6))
    errors[setups.samples(e)] = np.asarray(setups.given(e, inputs).errors.per_step).reshape(-1, 6)
    imu = replace(perfect, accel=perfect.accel + errors[:, :3], gyro=perfect.gyro + errors[:, 3:])
    times = np.cumsum(np.asarray(e.timeline.dt)[np.asarray(e.timeline.pattern)].sum(axis=(1, 2)))
    aiding, column = [], 0
    for sensor, (_, segments) in zip(SENSORS, e.fixes, strict=True):
        K, at = len(sensor.axes), np.asarray(segments)
        aiding.append(nj.Fixes(sensor, times[at], np.asarray(inputs.z)[at, column : column + K, 0]))
        column += K
    start = {
        n: np.asarray(getattr(inputs.start, f))[:, 0]
        for n, f in zip(("position", "velocity", "quaternion"), "pvq", strict=True)
    }
    return e, outcome, imu, tuple(aiding), start, truth, times


def navigate(emulated, **options):
    _, _, imu, aiding, start, *_ = emulated
    given = {"imu": imu, "aiding": aiding, "filter": ERRORS, **start, "initial": START, **options}
    return nj.navigate(given.pop("imu"), given.pop("aiding"), given.pop("filter"), **given)


@pytest.mark.slow
def test_it_is_the_run_of_the_monte_carlo(emulated):
    """The same numbers give the same estimate, deviations and innovations."""
    _, outcome, *_, times = emulated
    solution = navigate(emulated)
    assert solution.status is Status.ok
    # at every output and fix
    rows = [int(np.flatnonzero(np.abs(solution.time - t) < 1e-9)[0]) for t in times]
    np.testing.assert_allclose(solution.sd[rows], np.asarray(outcome.judgement.sd)[:, :, 0], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(solution.sensor_errors[rows, :3], outcome.state.x[:, :, 0], rtol=1e-8, atol=1e-12)
    for seen, expected in zip(("position", "velocity", "quaternion"), outcome.state[:3], strict=True):
        expected = np.asarray(expected)[:, :, 0]
        sign = np.sign(np.sum(expected[0] * getattr(solution.trajectory, seen)[0])) if seen == "quaternion" else 1.0
        np.testing.assert_allclose(getattr(solution.trajectory, seen)[rows], sign * expected, rtol=0, atol=1e-8)
    column = 0
    for sensor, fixes in zip(SENSORS, emulated[3], strict=True):
        K = len(sensor.axes)
        m = [int(np.flatnonzero(np.abs(times - t) < 1e-9)[-1]) for t in fixes.time]
        nu = np.asarray(outcome.innovation)[m, column : column + K, 0]
        np.testing.assert_allclose(solution.innovation[sensor.name], nu, rtol=0, atol=1e-8)
        s = np.asarray(outcome.variance)[m, column : column + K, 0]
        np.testing.assert_allclose(solution.nis[sensor.name], (nu**2 / s).sum(axis=1), rtol=1e-7)
        column += K
    assert "finished" in repr(solution)
    assert "NIS of barometer" in repr(solution)


@pytest.mark.slow
def test_free_inertial_navigation_returns_the_motion():
    imu, truth = nj.perfect_imu(REFERENCE, setups.RATE)
    solution = nj.navigate(
        imu,
        (),
        ERRORS,
        position=truth.position[0],
        velocity=truth.velocity[0],
        quaternion=truth.quaternion[0],
        initial=nj.InitialUncertainty(),
        output_interval=2.0,
    )
    np.testing.assert_allclose(solution.trajectory.position, truth.position, rtol=0, atol=1e-8)
    np.testing.assert_allclose(solution.trajectory.time, truth.time, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(solution.time, solution.trajectory.time)
    assert np.all(np.diff(solution.sd[1:, 0]) > 0)
    assert len(solution.before) == 0
    assert solution.nis == {}


@pytest.mark.slow
def test_fewer_covariance_steps(emulated):
    one, ten = navigate(emulated), navigate(emulated, every=10)
    common = np.flatnonzero(np.isin(np.round(one.time, 9), np.round(ten.time, 9)))
    np.testing.assert_allclose(ten.sd, one.sd[common], rtol=1e-3)
    assert len(ten.trajectory) < len(one.trajectory) / 5


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 10])
def test_both_sides_of_a_fix_are_those_of_the_update(emulated, every):
    """The barometer measures -p_d alone: what it changes follows from both sides' claims by the textbook's formula."""
    baro = emulated[3][2]
    solution = navigate(emulated, aiding=(baro,), every=every)
    before = solution.before
    np.testing.assert_allclose(before.time, baro.time, rtol=0, atol=1e-9)
    assert before.time[0] == 0.0  # a fix at the very start
    assert solution.time[-1] == before.time[-1] == 6.0  # and at the very end
    rows = np.searchsorted(solution.time, before.time - 1e-9)
    variance = before.sd[:, 2] ** 2
    gain = variance / (variance + float(baro.sensor.believed[0]) ** 2)
    innovation = baro.value[:, 0] + before.position[:, 2]
    np.testing.assert_allclose(innovation, solution.innovation["barometer"][:, 0], rtol=0, atol=1e-8)
    moved = solution.trajectory.position[rows, 2] - before.position[:, 2]
    np.testing.assert_allclose(moved, -gain * innovation, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(solution.sd[rows, 2] ** 2, (1 - gain) * variance, rtol=1e-7)
    # the start is what was given, before its fix
    np.testing.assert_allclose(before.sd[0, :9] ** 2, np.diag(START.covariance), rtol=1e-12)
    np.testing.assert_allclose(before.position[0], emulated[4]["position"], rtol=0, atol=1e-12)


def test_a_filter_that_fails_says_so(emulated):
    imu = emulated[2]
    accel = imu.accel.copy()
    accel[300:310] = 1e308
    broken = replace(imu, accel=accel)
    with pytest.raises(RuntimeError, match="became infinite or NaN"):
        navigate(emulated, imu=broken)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quaternion": np.array([1.0, 0.1, 0.0, 0.0])}, "length 1"),
        ({"filter": ERRORS.at_rate(50.0)}, r"at_rate\(100\)"),
        ({"position": np.zeros(2)}, "position"),
        ({"velocity": np.array([0.0, np.nan, 0.0])}, "velocity"),
        ({"every": 0}, "every"),
        ({"output_interval": 100.0}, "longer than the record"),
        ({"aiding": (nj.Fixes(SENSORS[2], np.array([7.0]), np.zeros((1, 1))),)}, "outside the run"),
        ({"aiding": (nj.Fixes(SENSORS[2], np.array([1.0]), np.zeros((1, 1))),) * 2}, "one name"),
    ],
)
def test_bad_input(emulated, options, message):
    with pytest.raises(ValueError, match=message):
        navigate(emulated, **options)


@pytest.mark.parametrize(
    ("options", "message"), [({"initial": 0.1}, "InitialUncertainty"), ({"earth": 9.8}, "AbstractEarth")]
)
def test_a_start_or_an_earth_of_another_class(emulated, options, message, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # which is not there outside of tests
    with pytest.raises(ValueError, match=f"must be of the class {message}"):
        navigate(emulated, **options)
    with pytest.raises(ValueError, match=f"must be of the class {message}"):
        nj.Scenario(REFERENCE, SENSORS, **options)


def spread(num, seed):
    """Covariances of fixes, no two alike."""
    factors = np.random.default_rng(seed).normal(size=(num, 3, 3)) * [0.3, 0.2, 0.5] + 0.3 * np.eye(3)
    return factors @ factors.transpose(0, 2, 1)


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True])
def test_each_fix_has_its_own_covariance(emulated, smooth):
    """As many sensors of one covariance each, with one fix, say the same."""
    gnss, velocity, baro = emulated[3]
    C = spread(len(gnss.time), 3)[:6]
    few = nj.Fixes(gnss.sensor, gnss.time[:6], gnss.value[:6], C)
    own = navigate(emulated, aiding=(few, velocity, baro), smooth=smooth)
    single = [
        nj.Fixes(nj.GnssPosition(covariance=c, name=f"gnss {i}"), few.time[i : i + 1], few.value[i : i + 1])
        for i, c in enumerate(C)
    ]
    apart = navigate(emulated, aiding=(*single, velocity, baro), smooth=smooth)
    np.testing.assert_allclose(own.trajectory.position, apart.trajectory.position, rtol=0, atol=1e-9)
    np.testing.assert_allclose(own.sd, apart.sd, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(own.nis["gnss_position"], [apart.nis[f"gnss {i}"][0] for i in range(6)], rtol=1e-8)


@pytest.mark.slow
def test_a_factor_on_what_is_believed_is_one_on_what_fixes_state(emulated):
    """That is what `tune` seeks."""
    gnss = emulated[3][0]
    C = spread(len(gnss.time), 5)
    own, larger = (nj.Fixes(gnss.sensor, gnss.time, gnss.value, a) for a in (C, 4 * C))
    e = navigate(emulated, aiding=(larger,))
    options = {**emulated[4], "every": 1, "output_interval": 1.0, "earth": None}
    done = prepare_navigation(emulated[2], (own,), ERRORS, **options)
    doubled = AidingLines(done.sensors).believe(jnp.full(2, np.log(2.0)))
    outcome = run_record(done.timeline, doubled, done.inputs, ERRORS, START)
    nis = (outcome.innovation**2 / outcome.variance)[done.fixes[0]].sum(axis=(1, 2))
    np.testing.assert_allclose(nis, e.nis["gnss_position"], rtol=1e-8)


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.zeros((2, 1, 1)), "2 of 2 covariances of barometer are not positive definite, the first at 1 s"),
        (np.full((2, 1, 1), np.nan), "NaN"),
    ],
)
def test_bad_covariances(covariance, message):
    with pytest.raises(ValueError, match=message):
        nj.Fixes(SENSORS[2], np.array([1.0, 2.0]), np.zeros((2, 1)), covariance)


@pytest.mark.parametrize(
    ("time", "value", "message"),
    [
        (np.zeros(0), np.zeros((0, 1)), "has no fix"),
        (np.array([1.0, 1.0]), np.zeros((2, 1)), "increase"),
        (np.array([1.0, 2.0]), np.array([[0.0], [np.nan]]), "barometer"),
        (np.array([1.0, 2.0]), np.zeros((2, 3)), "barometer"),
    ],
)
def test_bad_fixes(time, value, message):
    with pytest.raises(ValueError, match=message):
        nj.Fixes(SENSORS[2], time, value)


def test_what_is_known_exactly_is_no_part_of_a_mean():
    """As the velocity at the start of a vehicle that stood there: its covariance is singular."""
    errors = ReferenceErrors(np.arange(2.0), np.zeros((2, 9)), np.ones((2, 9)), {"velocity": np.array([np.nan, 6.0])})
    assert "velocity 2" in repr(errors)
