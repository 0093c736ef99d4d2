"""The filter as a whole: exact without noise, equal to a textbook filter and to R's, in any attitude."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups, textbook
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.status import Status
from nav_jax.imu.emulation import GivenErrors

EARTH = nj.FlatEarth(setups.GRAVITY)


def experiment(reference, aiding, **options):
    return nj.filter.prepare(nj.Scenario(reference, aiding, earth=EARTH, **options), rate=setups.RATE)


def white(scale=1.0):
    return nj.ImuErrors(gj.WN(setups.ACCEL_WN * scale), gj.WN(setups.GYRO_WN * scale), setups.RATE)


# fixes off the grid of the IMU, one run; tests that write inputs out share the program of the filter

OFF_GRID = (
    nj.GnssPosition(3.0, horizontal=0.5, vertical=1.0),
    nj.GnssVelocity(3.0, horizontal=0.05, vertical=0.1),
    nj.Barometer(1.0, height=0.5, first=0.0),
)
UNCERTAIN = nj.InitialUncertainty(1.0, 0.1, np.deg2rad([0.5, 0.5, 2.0]))


@pytest.fixture(scope="module")
def off_grid():
    """4 s: 12 fixes of GNSS, 5 of the barometer."""
    return experiment(nj.motions.lemniscate(4.0, setups.RATE), OFF_GRID, initial=UNCERTAIN)


# fixes on it, 16 runs

RUNS = 16


def on_grid(motion, scale=1.0, attitude_sd=0.005):
    """10 s along any motion; everything but the attitude may be a multiple."""
    sensors = (
        nj.GnssPosition(1.0, horizontal=0.5 * scale, vertical=1.0 * scale),
        nj.GnssVelocity(1.0, horizontal=0.05 * scale, vertical=0.1 * scale),
    )
    return experiment(motion, sensors, initial=nj.InitialUncertainty(0.5 * scale, 0.05 * scale, attitude_sd))


@pytest.fixture(scope="module")
def lemniscate():
    return nj.motions.lemniscate(10.0, setups.RATE)


def drawn(e, errors, key):
    return nj.filter.draw_inputs(e, errors, nj.filter.run_keys(key, 0, RUNS))


# without noise


@pytest.mark.slow
@pytest.mark.parametrize("gains", ["estimate", "reference"])
@pytest.mark.parametrize("every", [1, 10])
def test_without_noise_the_reference_comes_back(gains, every):
    """300 s of free inertial navigation: 1e-6 m and 1e-8 rad are asked for, rounding is left."""
    reference = nj.motions.lemniscate(300.0, setups.RATE)
    e = experiment(reference, (), every=every, output_interval=10.0)
    out = nj.filter.run_filter(
        e, white(), setups.quiet_inputs(e), nj.filter.gains_of(e, white()) if gains == "reference" else None
    )
    error = np.asarray(out.judgement.error)[:, :, 0]
    assert np.abs(error[:, :3]).max() < 1e-7
    assert np.abs(error[:, 6:9]).max() < 1e-9
    # and the truth it is judged against is the motion asked for
    np.testing.assert_allclose(e.timeline.truth.p[:, :, 0], reference.position[1000::1000], rtol=0, atol=1e-6)


@pytest.mark.slow
def test_without_noise_fixes_change_nothing(off_grid):
    out = nj.filter.run_filter(off_grid, white(), setups.quiet_inputs(off_grid))
    assert np.abs(np.asarray(out.judgement.error)[:, :9]).max() < 1e-8
    assert np.abs(np.asarray(out.innovation)).max() < 1e-8


# a textbook


def models():
    mild = gj.WN(setups.ACCEL_WN) + gj.AR1(0.998, 2e-9)
    two = gj.WN(setups.GYRO_WN) + gj.AR1(0.99, 3e-11) + gj.RW(1e-12)
    return {
        "white": white(),
        "mixed, with a drift": nj.ImuErrors(
            [mild, gj.WN(1e-5) + gj.DR(1e-6), gj.WN(1e-5)], two, setups.RATE, gyro_bias_sd=1e-4
        ),
    }


@pytest.mark.slow
@pytest.mark.parametrize("which", ["white", "mixed, with a drift"])
def test_a_run_is_that_of_a_textbook_filter(off_grid, key, which):
    """With noise and initial errors; two terms of ours against exponentials.

    State differences are measured in standard deviations, those of P relative to the standard deviations it holds.
    """
    errors, e = models()[which], off_grid
    inputs = nj.filter.draw_inputs(e, errors, nj.filter.run_keys(key, 0, 1))
    written = setups.given(e, inputs)
    # one draws its errors on the way, the other has them written out
    out = nj.filter.run_filter(e, errors, written if which == "white" else inputs)
    bank = textbook.Bank(errors.bank())
    times = np.asarray(e.timeline.dt)[np.asarray(e.timeline.pattern)].sum(axis=(1, 2)).cumsum()
    H = setups.derivative(OFF_GRID)
    R = np.diag(np.concatenate([s.believed for s in OFF_GRID]) ** 2)
    valid, z = np.asarray(e.timeline.valid) > 0, np.asarray(inputs.z)[:, :, 0]
    events = [(t, H[use], R[np.ix_(use, use)], z[m, use]) for m, (t, use) in enumerate(zip(times, valid, strict=True))]
    # the samples, once each: a sample cut in two appears twice among the pieces
    total = np.zeros((400, 6))
    per_step = np.asarray(written.errors.per_step)[..., 0]
    total[setups.samples(e)] = (np.asarray(e.timeline.imu) + per_step).reshape(-1, 6)
    P = np.zeros((9 + bank.size,) * 2)
    P[:9, :9], P[9:, 9:] = UNCERTAIN.covariance, bank.initial
    p, v, q = (np.asarray(a)[:, 0] for a in inputs.start[:3])
    dense = textbook.run(
        bank,
        (p, v, Rotation.from_quat(q, scalar_first=True).as_matrix()),
        P,
        total,
        1 / setups.RATE,
        events,
        np.array([0, 0, setups.GRAVITY]),
    )
    worst = [0.0, 0.0]
    ours, said = [np.asarray(a)[..., 0] for a in out.state], np.asarray(out.judgement.sd)[..., 0]
    for m, (p, v, C, x, P) in enumerate(dense):
        sd = np.sqrt(np.diag(P))
        turned = (Rotation.from_quat(ours[2][m], scalar_first=True) * Rotation.from_matrix(C).inv()).as_rotvec()
        off = np.concatenate([ours[0][m] - p, ours[1][m] - v, turned, ours[3][m] - x])
        worst[0] = max(worst[0], np.abs(off[sd > 0] / sd[sd > 0]).max())
        worst[1] = max(worst[1], np.abs(said[m, :9] / sd[:9] - 1).max())
    assert worst[0] < 1e-5
    assert worst[1] < 1e-6


# gains of the reference


def relative_difference(reference, key, scale, attitude_sd):
    """Greatest of all errors at all outputs between own gains and those of the reference, in standard deviations."""
    errors, e = white(scale**2), on_grid(reference, scale, attitude_sd)
    inputs = drawn(e, errors, key)
    own = nj.filter.run_filter(e, errors, inputs).judgement
    shared = nj.filter.run_filter(e, errors, inputs, nj.filter.gains_of(e, errors)).judgement
    off, sd = np.asarray(own.error) - np.asarray(shared.error), np.asarray(shared.sd)
    return np.max(np.abs(off[:, :9]) / sd[:, :9])


@pytest.mark.slow
def test_gains_of_the_reference_are_exact_to_first_order(lemniscate, key):
    """Everything a hundredth, and the filters differ by a hundredth of what they did, in standard deviations."""
    large, small = (relative_difference(lemniscate, key, *x) for x in ((1.0, 0.02), (0.01, 0.0002)))
    assert 1e-3 < large < 0.5
    assert 0.003 < small / large < 0.03


@pytest.mark.slow
def test_gains_part_where_the_attitude_is_far_off(lemniscate, key):
    """An initial error of 20 deg bends the filter: half a standard deviation and more between the two."""
    with pytest.warns(nj.filter.LinearisationWarning):
        assert relative_difference(lemniscate, key, 1.0, np.deg2rad(20.0)) > 0.5


# any attitude


def loop():
    """A loop in a vertical plane: pitch goes through 90 deg twice a turn."""
    t = np.arange(1001) / setups.RATE
    w, radius = 2 * np.pi / 8.0, 40.0
    p = np.stack([radius * np.sin(w * t), 0 * t, -radius * (1 - np.cos(w * t))], -1)
    v = radius * w * np.stack([np.cos(w * t), 0 * t, -np.sin(w * t)], -1)
    q = np.stack([np.cos(w * t / 2), 0 * t, np.sin(w * t / 2), 0 * t], -1)
    return nj.Trajectory.from_quaternion(t, p, q, velocity=v)


def wrapped():
    """A circle whose yaw is given between -180 and 180 deg."""
    reference = nj.motions.circle(10.0, setups.RATE, radius=5.0, speed=8.0)
    euler = reference.euler
    euler[:, 2] = (euler[:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(np.diff(euler[:, 2])).max() > 6
    return nj.Trajectory.from_euler(reference.time, reference.position, euler, velocity=reference.velocity)


@pytest.mark.slow
@pytest.mark.parametrize("motion", [loop, wrapped])
def test_no_attitude_is_singular(key, motion):
    """NEES of 16 runs, averaged over 10 epochs, in a band of 4.5 sigma as if no two epochs were correlated, doubled."""
    errors, e = white(), on_grid(motion(), scale=0.05)
    quiet = nj.filter.run_filter(e, errors, setups.quiet_inputs(e, num_runs=RUNS))
    assert np.abs(np.asarray(quiet.judgement.error)[:, :9]).max() < 1e-8
    out = nj.filter.run_filter(e, errors, drawn(e, errors, key))
    assert not np.any(out.status)
    navigation = np.asarray(out.judgement.nees)[:, 4].mean(axis=0)
    assert abs(navigation.mean() - 9) < 2 * 4.5 * np.sqrt(2 * 9 / 160)
    assert np.abs(np.asarray(out.judgement.error)[:, 6:9]).max() < np.deg2rad(3)


# status


@pytest.mark.slow
def test_a_run_that_overflows_is_marked_and_leaves_the_others_alone(lemniscate, key):
    errors, e = white(), on_grid(lemniscate)
    inputs = setups.given(e, drawn(e, errors, key))
    fine = nj.filter.run_filter(e, errors, inputs)
    huge = np.array(inputs.errors.per_step)
    huge[5, 3:5, 0, 0, 2] = 1e308
    given = GivenErrors(jnp.asarray(huge), inputs.errors.per_segment)
    out = nj.filter.run_filter(e, errors, inputs._replace(errors=given))
    expected = np.zeros(RUNS, int)
    expected[2] = Status.non_finite
    np.testing.assert_array_equal(out.status, expected)
    others = np.delete(np.arange(RUNS), 2)
    one, other = (np.asarray(o.judgement.error)[..., others] for o in (out, fine))
    np.testing.assert_array_equal(one, other)


def test_a_negative_variance_is_marked(lemniscate):
    """A covariance at the start that is none, which the public functions would refuse."""
    e = on_grid(lemniscate)
    P = jnp.diag(jnp.array([-1e4] + [1.0] * 8))
    # without fixes, which would mend it
    none = eqx.tree_at(lambda e: (e.initial.covariance, e.timeline.valid), e, (P, jnp.zeros_like(e.timeline.valid)))
    out = nj.filter.run_filter(none, white(), setups.quiet_inputs(none, num_runs=RUNS))
    np.testing.assert_array_equal(out.status, [Status.not_positive] * RUNS)
