"""Earths that only the tests know: the perfect IMU, the filter, its error model and the covariances all ask them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups
from nav.planets import Pillar, SmallPlanet
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.ekf import inject, mechanise_with_motion
from nav_jax.filter.error_model import transition
from nav_jax.imu.bank import alone, step_noise
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.rotation import quat_conjugate, quat_multiply, quat_to_rotvec
from nav_jax.kinematics.state import NavState

pytestmark = pytest.mark.usefixtures("quick_compilation")

RATE = 20.0
WHITE = nj.ImuErrors(gj.WN(1e-4), gj.WN(1e-6), RATE)
NUM_RUNS = 400
CLIMB = nj.motions.climb(20.0, RATE)
START = nj.InitialUncertainty(0.5, 0.05, 1e-3)


def everything():
    """Antennas and a wheel on arms, and a barometer."""
    antenna = nj.GnssVelocity(1.0, horizontal=0.02, vertical=0.02, lever_arm=(3.0, 1.0, -2.0))
    return (*setups.on_arms(), antenna, nj.Barometer(1.0, height=0.1))


AIDED = nj.Scenario(
    nj.motions.lemniscate(20.0, RATE), everything(), START, SmallPlanet(), every=10, output_interval=5.0
)
"""With `NUM_RUNS` runs of `WHITE`, one program draws and one filters them, whatever the numbers of planet and noise."""


def drawn(scenario, errors=WHITE, seed=0):
    """A scenario, prepared, and inputs of its runs."""
    e = nj.filter.prepare(scenario, rate=RATE)
    return e, nj.filter.draw_inputs(e, errors, nj.filter.run_keys(jax.random.key(seed), 0, NUM_RUNS))


def z_scores(samples, expected):
    """Of means over the runs, in standard errors of their scatter."""
    return (samples.mean(axis=0) - expected) / (samples.std(axis=0, ddof=1) / np.sqrt(len(samples)))


def check_runs(scenario, seed):
    """RMS of every component, and the NEES, within 4.5 standard errors of their scatter; squares of the errors."""
    c = nj.analyse(scenario, WHITE)["filter"]
    np.testing.assert_allclose(c.nees("navigation"), 9.0, rtol=1e-6)
    options = {"num_runs": NUM_RUNS, "chunk_size": NUM_RUNS, "workers": 1}
    runs = nj.monte_carlo(scenario, WHITE, key=jax.random.key(seed), **options)
    squares = runs.error[:, :, :9] ** 2
    assert np.abs(z_scores(squares, c.sd[:, :9] ** 2)).max() < 4.5
    assert np.abs(z_scores(runs.nees["navigation"], 9)).max() < 4.5
    return squares


@pytest.mark.parametrize("gains", ["estimate", "reference"])
@pytest.mark.parametrize("every", [1, 5])
def test_without_noise_the_reference_comes_back(gains, every):
    """20 s of climbing: 1e-6 m is asked for; on an Earth with the same gravity everywhere it would be metres off."""
    scenario = nj.Scenario(CLIMB, setups.aiding()[2:], earth=Pillar(), every=every)
    assert np.ptp(CLIMB.position[:, 2]) > 5.0
    e = nj.filter.prepare(scenario, rate=RATE)
    shared = nj.filter.gains_of(e, WHITE) if gains == "reference" else None
    error = nj.filter.run_filter(e, WHITE, setups.quiet_inputs(e), shared).judgement.error
    assert np.abs(np.asarray(error)[:, :3]).max() < 1e-6
    np.testing.assert_allclose(e.timeline.truth.p[:, :, 0], CLIMB.position[20::20], rtol=0, atol=1e-5)


@pytest.mark.parametrize("every", [1, 5])
def test_samples_of_another_earth_are_navigated_on_it(every):
    """The same samples are metres off where gravity is the same everywhere."""
    imu, truth = nj.perfect_imu(CLIMB, RATE, Pillar())
    start = {"position": truth.position[0], "velocity": truth.velocity[0], "quaternion": truth.quaternion[0]}
    free = {"initial": nj.InitialUncertainty(), "every": every, **start}
    there, flat = (
        nj.navigate(imu, (), WHITE, earth=earth, **free).trajectory.position[-1] for earth in (Pillar(), Pillar(0.0))
    )
    assert np.abs(there - truth.position[-1]).max() < 1e-6
    assert np.abs(flat - truth.position[-1]).max() > 1.0


def test_without_noise_the_reference_comes_back_on_a_planet_that_turns():
    """Through 20 s, sensors on arms and a barometer; with the rate of the planet in the arms 0.1 m/s would be off."""
    e, inputs = drawn(AIDED, nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), RATE))
    quiet = setups.quiet_inputs(e, num_runs=NUM_RUNS)
    # asked for as in a Monte Carlo: with the defaults left out it would be another program
    outcome = nj.filter.run_filter(e, WHITE, inputs._replace(start=quiet.start, z=quiet.z), None, smooth=False)
    error = np.asarray(outcome.judgement.error)
    assert np.abs(error[:, :3]).max() < 1e-7
    assert np.abs(error[:, 3:6]).max() < 1e-8
    assert np.abs(error[:, 6:9]).max() < 1e-9
    assert np.abs(outcome.innovation).max() < 1e-6
    np.testing.assert_allclose(e.timeline.truth.p[:, :, 0], AIDED.reference.position[10::10], rtol=0, atol=1e-5)


def test_a_fix_is_of_the_motion_over_the_planet():
    """What an antenna, a wheel and a barometer read at rest: no velocity, and the height above a curved surface."""
    p = np.broadcast_to([600.0, -800.0, -40.0], (401, 3))
    rest = nj.Trajectory.from_quaternion(np.arange(401) / RATE, p, np.broadcast_to([1.0, 0.0, 0.0, 0.0], (401, 4)))
    _, inputs = drawn(dataclasses.replace(AIDED, reference=rest))
    # scalars: position, wheel, velocity, height; the noise of GNSS position is 0.05 and 0.1 m
    z = np.asarray(inputs.z)[-1].mean(axis=-1)
    height = np.linalg.norm(p[0] - [0.0, 0.0, SmallPlanet.radius]) - SmallPlanet.radius
    expected = [*(p[0] + setups.ARM), *np.zeros(6), height]
    sd = np.array([0.05, 0.05, 0.1, 0.03, 0.05, 0.05, 0.02, 0.02, 0.02, 0.1]) / 20
    assert np.abs((z - expected) / sd).max() < 4.5
    assert height > 200  # and -p_D is 40 m


def test_a_flat_earth_in_disguise_is_a_flat_earth():
    """All that is asked of an Earth, against what a flat one leaves out of the loops: to 1e-9 of the errors."""
    found = []
    for earth in (nj.FlatEarth(9.8), SmallPlanet(curvature=0.0, turning=0.0)):
        e, inputs = drawn(dataclasses.replace(AIDED, earth=earth), seed=1)
        judged = nj.filter.run_filter(e, WHITE, inputs, smooth=True).judgement
        found.append([np.asarray(a) for a in (inputs.z, judged.error, judged.sd)])
    for known, asked in zip(*found, strict=True):
        np.testing.assert_allclose(asked, known, rtol=1e-8, atol=1e-9)


def test_what_a_flat_earth_leaves_out():
    """No rate, no gradient, no sums of gravity, and barometers of a constant derivative."""
    flat, turning = EarthInLoops(nj.FlatEarth()), EarthInLoops(SmallPlanet())
    position = jnp.ones((3, 2))
    assert flat.rate is None
    assert flat.pull(position) is None
    assert flat.gravity(position, position, jnp.ones(()), None).shape == (3, 1)
    np.testing.assert_array_equal(nj.FlatEarth().rate_n(position), 0.0)
    np.testing.assert_allclose(turning.rate[:, 0], SmallPlanet.rate)
    barometer = nj.Barometer(height=0.5)
    assert barometer.on(nj.FlatEarth()).linear
    assert not barometer.on(SmallPlanet()).linear
    assert barometer.on(SmallPlanet()).on(nj.FlatEarth()).linear


def test_the_gradient_is_the_derivative_of_gravity():
    p = np.array([[30.0, 300.0], [-500.0, 20.0], [-15.0, 80.0]])
    steps = 1e-3 * np.eye(3)[:, :, None]
    g = SmallPlanet().gravity_n
    expected = np.stack([np.asarray(g(jnp.asarray(p + e)) - g(jnp.asarray(p - e))) / 2e-3 for e in steps], axis=1)
    np.testing.assert_allclose(EarthInLoops(SmallPlanet()).pull(jnp.asarray(p)).gradient, expected, rtol=0, atol=1e-9)


EARTH, BANK = EarthInLoops(SmallPlanet()), WHITE.bank()


@jax.jit
def stated_and_derived(sample, dt):
    """Transition of navigation errors over 8 samples: of the error model, and of the mechanisation by autodiff."""
    q = Rotation.from_euler("ZYX", [0.7, 0.2, -0.4]).as_quat(scalar_first=True)
    given = ([30.0, -20.0, -15.0], [80.0, -30.0, 10.0], q, [])
    start = NavState(*(jnp.asarray(a)[:, None] for a in given))
    imu, steps, ends = jnp.broadcast_to(sample[:, None], (8, 6, 1)), jnp.full(8, dt), jnp.ones(8)
    pull = EARTH.pull(start.p + 4 * dt * start.v)  # half way
    there, along = mechanise_with_motion(start, imu, steps, ends, BANK, EARTH, pull)
    stated = transition(jnp.eye(9)[:, :, None], along, step_noise(alone(BANK), steps, ends))[:, :, 0]

    def after(c):
        found, _ = mechanise_with_motion(inject(start, c[:, None]), imu, steps, ends, BANK, EARTH, None)
        psi = quat_to_rotvec(quat_multiply(found.q, quat_conjugate(there.q)))
        return jnp.concatenate([found.p - there.p, found.v - there.v, psi])[:, 0]

    return stated, jax.jacfwd(after)(jnp.zeros(9))


def test_the_transition_is_of_second_order():
    """Each block of the error model's transition is off by T^3 or less: an eighth at half the step, 15 % allowed."""
    sample = jnp.asarray([3.0, -2.0, -11.0, 0.4, -0.6, 0.8])
    off = []
    for T in (0.4, 0.2):
        stated, derived = (np.asarray(a) for a in stated_and_derived(sample, jnp.asarray(T / 8)))
        off.append(np.abs(stated - derived).reshape(3, 3, 3, 3).max(axis=(1, 3)))
    assert (off[1] <= 1.15 / 8 * off[0] + 1e-12).all()
    # the terms of second order themselves are a hundred times as large: of the Coriolis acceleration and the rate
    assert off[1][1, 1] < 0.01 * 2 * (0.03 * 0.2) ** 2
    assert off[1][2, 2] < 0.01 * (0.03 * 0.2) ** 2 / 2


@pytest.mark.parametrize("every", [1, 10])
def test_runs_have_the_errors_that_the_covariances_say(every):
    """Free inertial navigation: heights fall away from the truth, as the gradient of gravity makes them.

    Without the gradient in the error model the vertical would be tens of standard errors off.
    """
    start = nj.InitialUncertainty(0.5, 0.05, 1e-4)
    scenario = nj.Scenario(CLIMB, (), start, Pillar(), every=every, output_interval=5.0)
    squares = check_runs(scenario, 3)
    flat = nj.analyse(dataclasses.replace(scenario, earth=Pillar(0.0)), WHITE)["filter"]
    assert z_scores(squares, flat.sd[:, :9] ** 2)[-1, 2] > 10


def test_free_runs_on_a_planet_that_turns_have_the_errors_that_the_covariances_say():
    check_runs(dataclasses.replace(AIDED, aiding=(), every=1), 4)


def test_aided_runs_on_a_planet_that_turns_have_the_errors_that_the_covariances_say():
    check_runs(AIDED, 4)


def test_runs_far_from_the_origin_are_judged_along_local_axes():
    """100 km north of the origin, where n is tilted by 0.9 deg: heights are known, and down in n is not."""
    far = dataclasses.replace(CLIMB, position=CLIMB.position + np.array([100e3, 0.0, 785.0]))
    earth = nj.Wgs84([0.81, 0.115, 500.0])
    barometer = nj.Barometer(1.0, height=0.01)
    scenario = nj.Scenario(far, (barometer,), START, earth, every=10, output_interval=5.0)
    check_runs(scenario, 6)
    c = nj.analyse(scenario, WHITE)["filter"]
    tilt = 100e3 / 6.37e6
    assert c.sd[-1, 2] < 0.02
    assert c.sd[-1, 0] * tilt > 0.004  # what of the north would be seen in the down of n
    turned = earth.local(far.position[-1:])[0]
    np.testing.assert_allclose(turned @ [0.0, 0.0, 1.0], [tilt, 0.0, 1.0], atol=1e-3)
