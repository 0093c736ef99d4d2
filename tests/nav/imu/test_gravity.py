"""A disturbance of gravity: what it is made of, what accelerometers feel of it, and what it does to a filter."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import nav_jax as nj
from gmwm_jax import GM, WN
from nav_jax.filter.ekf import mechanise, mechanise_with_motion
from nav_jax.filter.error_model import blocks, full, propagate, transition
from nav_jax.filter.layout import NAVIGATION, error_state
from nav_jax.filter.parameters import ErrorLines
from nav_jax.imu.bank import alone, step_noise
from nav_jax.imu.emulation import Path, emulate, write_out
from nav_jax.imu.gravity import GravityDisturbance
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.state import NavState

ARCSEC, MGAL, G = np.deg2rad(1 / 3600), 1e-5, 9.80665
FIELD = GravityDisturbance(deflection=6 * ARCSEC, anomaly=30 * MGAL, distance=[20e3, 30e3, 40e3])


def errors_of(field, noise=0.0, rate=100.0):
    return nj.ImuErrors(WN(noise), WN(noise), rate, gravity=field)


def test_states_are_those_that_are_not_zero():
    assert FIELD.axes == (0, 1, 2)
    np.testing.assert_allclose(FIELD.sd, [6 * ARCSEC * G, 6 * ARCSEC * G, 30 * MGAL], rtol=1e-12)
    down = GravityDisturbance(anomaly=1e-4, distance=30e3)
    assert [str(s) for s in down.states] == ["gravity d disturbance"]
    bank = errors_of(down).bank()
    np.testing.assert_allclose(bank.initial, [[1e-8]])
    np.testing.assert_allclose(bank.travel.inverse, [1 / 30e3])
    np.testing.assert_array_equal(bank.errors(jnp.ones((1, 1))), np.zeros((6, 1)))
    np.testing.assert_array_equal(bank.gravity(jnp.full((1, 1), 2.0)), [[0.0], [0.0], [2.0]])
    assert errors_of(GravityDisturbance(distance=1e3)).bank().travel is None
    assert "sd [" in repr(errors_of(FIELD))
    layout = error_state(errors_of(FIELD).states)
    assert layout.block("gravity").components == ("n", "e", "d")
    assert layout.size == NAVIGATION.size + 3


def test_another_rate_and_its_parameters_by_name():
    errors = errors_of(FIELD, 1e-6)
    np.testing.assert_array_equal(errors.at_rate(50.0).gravity.sd, FIELD.sd)
    lines = ErrorLines(errors)
    assert lines.names[2:] == (
        "gravity deflection sd", "gravity anomaly sd",
        "gravity deflection n distance", "gravity deflection e distance", "gravity anomaly distance",
    )  # fmt: skip
    changed = lines.build(lines.start.at[3].add(np.log(2.0)).at[5].add(np.log(3.0))).gravity
    np.testing.assert_allclose(changed.sd, FIELD.sd * jnp.array([1.0, 1.0, 2.0]), rtol=1e-12)
    np.testing.assert_allclose(changed.distance, [20e3, 90e3, 40e3], rtol=1e-12)
    np.testing.assert_allclose(lines.values(lines.start)[2:], [6 * ARCSEC * G, 30 * MGAL, 20e3, 30e3, 40e3], rtol=1e-12)


def test_accelerometers_feel_less_along_the_body(key):
    """Over no distance the disturbance stays: samples of a body that turns are minus its components in b."""
    rng = np.random.default_rng(1)
    turn = Rotation.random(6, rng)
    path = Path(jnp.zeros(6), jnp.asarray(turn.as_quat(scalar_first=True)))
    ends = jnp.asarray([[[1.0, 0.0]], [[1.0, 1.0]], [[1.0, 1.0]]])
    errors = errors_of(FIELD)

    @eqx.filter_jit
    def written(keys):
        source = emulate(errors, keys, 6, ends, path=path)
        return source.x, write_out(source, ends)

    x, given = jax.tree.map(np.asarray, written(jax.random.split(key, 3)))
    felt = -np.einsum("kji,jr->kir", turn.as_matrix(), x)
    at = [0, 1, 1, 2, 3, 4]
    pieces = given.per_step.reshape(6, 6, 3)
    np.testing.assert_allclose(pieces[:, :3], felt[at], rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(pieces[:, 3:], 0.0)
    np.testing.assert_allclose(given.per_segment.sample[:, :3], felt[[1, 3, 5]], rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(given.per_segment.lasting, 0.0)
    with pytest.raises(ValueError, match="give the path"):
        emulate(errors, jax.random.split(key, 3), 6, ends)


def test_it_fades_with_the_distance_and_not_with_time(key):
    """4000 runs: variances stay, and the correlation over 15 km in three samples is exp(-15/D)."""
    path = Path(jnp.asarray([5e3, 10e3, 0.0, 0.0]), jnp.asarray([[1.0, 0.0, 0.0, 0.0]] * 4))
    ends = jnp.ones((1, 4, 1))

    @jax.jit
    def written(keys):
        return write_out(emulate(errors_of(FIELD), keys, 4, ends, path=path), ends).per_step[0, :, 0, :3]

    num = 4000
    felt = np.asarray(written(jax.random.split(key, num)))
    sd = np.asarray(FIELD.sd)
    for k in range(4):
        assert np.abs(felt[k].std(axis=1) / sd - 1).max() < 4.5 / np.sqrt(2 * num)
    np.testing.assert_array_equal(felt[2], felt[3])
    rho = np.mean(felt[0] * felt[2], axis=1) / sd**2
    assert np.abs(rho - np.exp(-15e3 / np.asarray(FIELD.distance))).max() < 4.5 * np.sqrt(2 / num)


# -- covariance steps -------------------------------------------------------------------------------------------------

EARTH = EarthInLoops(nj.FlatEarth())
ERRORS = nj.ImuErrors(WN(6e-5) + GM(0.1, 1e-6), WN(1.5e-6), 100.0, gravity=FIELD)
BANK = ERRORS.bank()


def step(num, velocity=300.0):
    """Samples of 0.1 s at 300 m/s: so much that what is left of the states shows."""
    rng = np.random.default_rng(2)
    imu = jnp.asarray(rng.normal(size=(num, 6, 1)) * 0.1 + np.array([1.0, 2.0, -9.0, 0.05, 0.02, -0.1])[:, None])
    q = Rotation.from_euler("ZYX", [0.7, 0.2, -0.4]).as_quat(scalar_first=True)
    v = jnp.asarray([[0.6 * velocity], [0.8 * velocity], [5.0]])
    start = NavState(jnp.zeros((3, 1)), v, jnp.asarray(q)[:, None], jnp.zeros((len(BANK.states), 1)))
    dt, ends = jnp.full(num, 0.1), jnp.ones(num)
    return start, imu, dt, ends


def test_the_transition_is_that_of_the_mechanisation():
    """What a disturbance that is believed does to the estimate in a step, by differences of the mechanisation."""
    start, imu, dt, ends = step(3)
    end, motion = mechanise_with_motion(start, imu, dt, ends, BANK, EARTH, None)
    assert motion.distance[0] == pytest.approx(0.3 * 300.0, rel=0.01)
    at = [i for i, s in enumerate(BANK.states) if s.channel >= 6]
    X = jnp.zeros((9 + len(BANK.states), 3, 1)).at[jnp.array(at) + 9, jnp.arange(3), 0].set(1.0)
    found = np.asarray(transition(X, motion, step_noise(alone(BANK), dt, ends)))[..., 0]
    size = 1e-3
    for k, i in enumerate(at):
        other = mechanise(start._replace(x=start.x.at[i].set(size)), imu, dt, ends, BANK, EARTH, None)
        np.testing.assert_allclose(found[:3, k], (other.p - end.p)[:, 0] / size, rtol=2e-3, atol=1e-9)
        np.testing.assert_allclose(found[3:6, k], (other.v - end.v)[:, 0] / size, rtol=3e-3, atol=1e-9)
        np.testing.assert_allclose(found[9:, k], (other.x - end.x)[:, 0] / size, rtol=1e-4, atol=1e-9)
        np.testing.assert_array_equal(found[6:9, k], 0.0)


def test_transition_and_noise_are_those_of_the_exponential():
    """A sample, against the matrix exponential of F (Van Loan 1978) with the process driven all the time.

    States are held over a step of distance s: off by s/2D, here 1.5e-3 at most; noise of the state itself is exact.
    """
    start, imu, dt, ends = step(1)
    _, motion = mechanise_with_motion(start, imu, dt, ends, BANK, EARTH, None)
    speed, T = float(motion.distance[0]) / 0.1, 0.1
    rates = speed / np.asarray(FIELD.distance)
    F, W = np.zeros((9, 9)), np.zeros((9, 9))  # position, velocity, gravity
    F[:3, 3:6], F[3:6, 6:], F[6:, 6:] = np.eye(3), np.eye(3), -np.diag(rates)
    W[6:, 6:] = np.diag(2 * rates * np.asarray(FIELD.sd) ** 2)
    big = expm(np.block([[-F, W], [np.zeros((9, 9)), F.T]]) * T)
    Phi = big[9:, 9:].T
    Q = Phi @ big[:9, 9:]
    size = 9 + len(BANK.states)
    at = [0, 1, 2, 3, 4, 5, *(9 + i for i, s in enumerate(BANK.states) if s.channel >= 6)]
    noise = step_noise(alone(BANK), dt, ends)
    X = jnp.eye(size)[:, :, None]
    found = np.asarray(transition(X, motion, noise))[..., 0]
    np.testing.assert_allclose(found[np.ix_(at, at)], Phi, rtol=2e-3, atol=1e-12)
    P0 = np.zeros((size, size))
    P0[np.ix_(at[6:], at[6:])] = np.diag(np.asarray(FIELD.sd) ** 2)
    driven = np.asarray(full(propagate(blocks(jnp.asarray(P0)[:, :, None]), motion, noise)))[..., 0]
    quiet = np.asarray(full(propagate(blocks(jnp.zeros((size, size, 1))), motion, noise)))[..., 0]
    expected = Phi @ P0[np.ix_(at, at)] @ Phi.T + Q
    np.testing.assert_allclose(driven[np.ix_(at[6:], at[6:])], expected[6:, 6:], rtol=1e-12, atol=1e-20)
    np.testing.assert_allclose(quiet[np.ix_(at[6:], at[6:])], Q[6:, 6:], rtol=1e-9, atol=1e-20)
    without = nj.ImuErrors(WN(6e-5) + GM(0.1, 1e-6), WN(1.5e-6), 100.0)
    bare = len(without.bank().states) + 9
    Z = jnp.zeros((bare, bare, 1))
    others = np.asarray(full(propagate(blocks(Z), motion, step_noise(alone(without.bank()), dt, ends))))[..., 0]
    of_gravity = (driven[:6, :6] - others[:6, :6]).diagonal()
    np.testing.assert_allclose(of_gravity, expected[:6, :6].diagonal(), rtol=3e-3)


def test_results_of_filters_with_and_without_it():
    """Its states are no channel of the IMU, and count for none."""
    reference = nj.motions.straight(2.0, 10.0)
    aiding = [nj.GnssPosition(1.0, horizontal=0.1, vertical=0.1)]
    scenario = nj.Scenario(reference, aiding, nj.InitialUncertainty(0.1, 0.1, 0.01))
    both = {"with": errors_of(FIELD, 1e-6, 10.0), "without": errors_of(None, 1e-6, 10.0)}
    found = nj.analyse(scenario, both["without"], both)
    assert found["with"].dof("sensors") == found["without"].dof("sensors") == 0
    assert any("gravity n, gravity e, gravity d" in note for note in found["with"].notes)
    assert "position" in repr(found["with"])
    runs = nj.compare(scenario, both["without"], both, num_runs=2, key=jax.random.key(0))
    assert not any("sensors" in runs[name].nees for name in both)


def test_it_is_saved_with_the_errors(tmp_path):
    from gmwm_jax._internal.states import from_state, to_state

    back = from_state(to_state(ERRORS))
    np.testing.assert_allclose(back.gravity.sd, FIELD.sd, rtol=1e-15)
    np.testing.assert_array_equal(back.gravity.distance, FIELD.distance)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: GravityDisturbance(anomaly=-1e-4, distance=1e3), "anomaly must be non-negative"),
        (lambda: GravityDisturbance(anomaly=1e-4, distance=0.0), "distance must be positive"),
        (lambda: GravityDisturbance(deflection=[1e-5] * 3, distance=1e3), "deflection is one number or 2"),
        (lambda: errors_of(1e-4), "gravity must be of the class GravityDisturbance"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
