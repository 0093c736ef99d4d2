"""Every aiding sensor: one row of CASES, and all tests run on it."""

from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from gmwm_jax import GM, RW, WN
from gmwm_jax._internal.states import from_state, to_state
from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.dual_antenna import DualAntenna
from nav_jax.aiding.gnss import Gnss, GnssPosition, GnssVelocity
from nav_jax.aiding.magnetometer import Magnetometer
from nav_jax.aiding.non_holonomic import NonHolonomic
from nav_jax.aiding.odometer import Odometer
from nav_jax.aiding.registry import AIDING
from nav_jax.aiding.standstill import AbstractStandstill, ZeroRate, ZeroVelocity
from nav_jax.aiding.states import joined, own_states
from nav_jax.filter.ekf import correction, inject, update
from nav_jax.filter.layout import NAVIGATION
from nav_jax.filter.measurement import Measurements, decorrelated, derived, layout_of
from nav_jax.imu.errors import ImuErrors
from nav_jax.kinematics.state import BodyMotion, NavState, body_motion


@dataclass(frozen=True)
class Case:
    """A sensor, how it is built, and what it measures by definition."""

    cls: type[AbstractAiding]
    noise: dict[str, float]
    sd: tuple[float, ...]
    measures: Any
    """(position, velocity, matrix C_nb, own states, body rate) of one run -> the components; where a sensor
    wants means, also these and the acceleration of a falling body."""
    options: dict[str, Any] = field(default_factory=dict)

    def build(self, *args, **options):
        return self.cls(*args, **self.noise | self.options | options)


ARM = np.array([1.5, -0.4, 0.9])
GNSS_P, GNSS_V = {"horizontal": 0.025, "vertical": 0.05}, {"horizontal": 0.01, "vertical": 0.02}
GNSS = GNSS_P | {"horizontal_velocity": 0.01, "vertical_velocity": 0.02}
WHEEL = {"speed": 0.05, "sideways": 0.1}
SIDEWAYS = {"right": 0.03, "down": 0.04}
FIELD = np.array([0.22, 0.01, 0.43])  # any unit serves the mathematics
COMPASS, PAIR = {"field": tuple(FIELD)}, {"baseline": tuple(ARM)}
ON_ARM = {"lever_arm": tuple(ARM)}

SLOW = "GM(beta=0.1, variance=0.01)"
T = 0.25


def turn(vector):
    return Rotation.from_rotvec(vector).as_matrix()


def turned(pitch, yaw):
    """The axes of a vehicle in those of a body."""
    return Rotation.from_euler("ZY", [yaw, pitch]).as_matrix()


def late_and_averaged(p, v, C, x, w, means, fall):
    """A whole receiver: the arm, the clock, the drift of positions and velocities, and the mean over the past T."""
    arm, tau = ARM + x[:3], x[3]
    (even, even_rate), (rising, _), (_, past_rate) = ((m[:3], m[3:]) for m in means)
    a = C @ even + fall
    now = turn(tau * even_rate)
    swept = (arm - turn(-T * past_rate) @ arm) / T
    seen_p = p + tau * v + tau**2 / 2 * a + C @ now @ arm
    seen_v = v + tau * a - T / 2 * (C @ rising + fall) + C @ now @ swept
    return np.concatenate([seen_p + x[4:7], seen_v + x[7:]])


def late(p, v, C, x, w, means, fall):
    """A velocity of a moment on an arm, by a clock."""
    even, rate = means[0][:3], means[0][3:]
    return v + x[0] * (C @ even + fall) + C @ turn(x[0] * rate) @ np.cross(w, ARM)


CASES = (
    Case(GnssPosition, GNSS_P, (0.025, 0.025, 0.05), lambda p, v, C, x, w: p),
    Case(GnssVelocity, GNSS_V, (0.01, 0.01, 0.02), lambda p, v, C, x, w: v),
    Case(Barometer, {"height": 0.5}, (0.5,), lambda p, v, C, x, w: -p[2:]),
    Case(GnssPosition, GNSS_P, (0.025, 0.025, 0.05), lambda p, v, C, x, w: p + C @ ARM, ON_ARM),
    Case(GnssVelocity, GNSS_V, (0.01, 0.01, 0.02), lambda p, v, C, x, w: v + C @ np.cross(w, ARM), ON_ARM),
    Case(Odometer, {"speed": 0.05}, (0.05,), lambda p, v, C, x, w: (C.T @ v)[:1]),
    Case(
        Odometer,
        WHEEL,
        (0.05, 0.1, 0.1),
        lambda p, v, C, x, w: (C.T @ v + np.cross(w, ARM)) * [1 + x[0], 1, 1],
        ON_ARM | {"scale_sd": 0.02},
    ),
    Case(Gnss, GNSS, (0.025, 0.025, 0.05, 0.01, 0.01, 0.02), lambda p, v, C, x, w: np.concatenate([p, v])),
    Case(
        GnssPosition,
        GNSS_P,
        (0.025, 0.025, 0.05),
        lambda p, v, C, x, w: p + C @ x[:3] + x[3:],
        {"lever_arm_sd": (0.1, 0.2, 0.0), "drift": (SLOW, "RW(gamma2=1e-4)")},
    ),
    Case(GnssVelocity, GNSS_V, (0.01, 0.01, 0.02), late, ON_ARM | {"time_offset_sd": 0.1}),
    Case(
        Gnss,
        GNSS,
        (0.025, 0.025, 0.05, 0.01, 0.01, 0.02),
        late_and_averaged,
        ON_ARM
        | {"lever_arm_sd": 0.1, "time_offset_sd": 0.1, "averaged": T, "drift": SLOW, "drift_velocity": (SLOW,) * 3},
    ),
    Case(
        Barometer,
        {"height": 0.5},
        (0.5,),
        lambda p, v, C, x, w: -p[2:] * (1 + x[1]) + x[0],
        {"offset_sd": 1.0, "offset_noise": SLOW, "scale_sd": 0.01},
    ),
    Case(NonHolonomic, SIDEWAYS, (0.03, 0.04), lambda p, v, C, x, w: (C.T @ v)[1:]),
    Case(
        NonHolonomic,
        SIDEWAYS,
        (0.03, 0.04),
        lambda p, v, C, x, w, means, fall: (
            turned(x[2], x[3]).T[1:] @ (C.T @ v + np.cross(means[0][3:], ARM + np.array([x[0], 0, x[1]])))
        ),
        ON_ARM | {"lever_arm_sd": (0.1, 0.2), "mount_sd": 0.05, "mount_noise": "RW(gamma2=1e-7)"},
    ),
    Case(Magnetometer, {"sd": 0.01}, (0.01,) * 3, lambda p, v, C, x, w: C.T @ FIELD, COMPASS),
    Case(
        Magnetometer,
        {"sd": 0.01},
        (0.01,) * 3,
        lambda p, v, C, x, w: C.T @ FIELD + x,
        COMPASS | {"hard_iron_sd": 0.1},
    ),
    Case(DualAntenna, GNSS_P, (0.025, 0.025, 0.05), lambda p, v, C, x, w: C @ ARM, PAIR),
    Case(
        DualAntenna,
        GNSS_P,
        (0.025, 0.025, 0.05),
        lambda p, v, C, x, w: C @ (ARM + x),
        PAIR | {"offset_sd": (0.1, 0.2, 0.0)},
    ),
    Case(ZeroVelocity, {"sd": 0.02}, (0.02,) * 3, lambda p, v, C, x, w: v),
    Case(ZeroRate, {"sd": 1e-4}, (1e-4,) * 3, lambda p, v, C, x, w, means, fall: means[0][3:]),
)
IDS = [" with ".join([c.cls.__name__, *c.options]) for c in CASES]
every_sensor = pytest.mark.parametrize("case", CASES, ids=IDS)


def random_motion(sensor, seed, num):
    """Any states, attitudes and body motions."""
    rng = np.random.default_rng(seed)
    p, v, force, rate, fall = rng.normal(size=(5, 3, num))
    q = rng.normal(size=(4, num))
    x = 0.1 * rng.normal(size=(len(sensor.states), num))
    state = NavState(*map(jnp.asarray, (p, v, q / np.linalg.norm(q, axis=0), x)))
    body = BodyMotion(jnp.asarray(force), jnp.asarray(rate))
    if sensor.windows:
        means = rng.normal(size=(len(sensor.windows), 6, num))
        body = body._replace(means=jnp.asarray(means), fall=jnp.asarray(fall))
    return state, body


def test_every_sensor_of_the_registry_has_a_row():
    assert {c.cls for c in CASES} == set(AIDING.values())


@every_sensor
def test_it_measures_what_it_says(case):
    sensor = case.build()
    state, body = random_motion(sensor, 1, 5)
    seen = sensor.predict(state, body)
    for run in range(5):
        p, v, q, x, rate = (np.asarray(a)[:, run] for a in (*state, body.rate))
        C = Rotation.from_quat(q, scalar_first=True).as_matrix()
        means = (np.asarray(body.means)[..., run], np.asarray(body.fall)[:, run]) if sensor.windows else ()
        np.testing.assert_allclose(seen[:, run], case.measures(p, v, C, x, rate, *means), rtol=1e-12, atol=1e-13)


@eqx.filter_jit
def after_error(sensor, state, body, c):
    """What is measured after an error c of the state, the body's motion included."""
    layout = layout_of(sensor)
    moved = body.moved(c[layout["force"]], c[layout["rate"]])
    return sensor.predict(inject(state, c[: layout["own"].stop]), moved)


@every_sensor
def test_the_jacobian_is_the_derivative_along_an_injected_error(case):
    """What the sensor states of it, and what autodiff finds, against central differences of h: 1e-8 of 1."""
    sensor = case.build()
    layout, (state, body) = layout_of(sensor), random_motion(sensor, 2, 3)
    expected = np.zeros((len(sensor.axes), layout.size, 3))
    for i in range(layout.size):
        c = np.zeros((layout.size, 3))
        c[i] = 1e-5
        one, other = (np.asarray(after_error(sensor, state, body, jnp.asarray(sign * c))) for sign in (1.0, -1.0))
        expected[:, i] = (one - other) / 2e-5
    np.testing.assert_allclose(eqx.filter_jit(derived)(sensor, state, body), expected, atol=1e-8)
    stated = sensor.jacobian(state, body, layout)
    if stated is not None:
        np.testing.assert_allclose(np.broadcast_to(stated, expected.shape), expected, atol=1e-8)
    if sensor.linear:
        np.testing.assert_array_equal(sensor.jacobian(None, None, layout), stated)


def test_every_component_has_a_unit():
    receiver = Gnss(1.0, horizontal=1.0, vertical=2.0, horizontal_velocity=0.1, vertical_velocity=0.2)
    assert receiver.units == ("m", "m", "m", "m/s", "m/s", "m/s")
    assert GnssPosition(1.0, horizontal=1.0, vertical=2.0).units == ("m",) * 3
    for case in CASES:
        assert len(case.build().units) == len(case.build().axes)


def test_linear_sensors_have_one_derivative():
    identity = np.eye(9)
    for sensor, H in (
        (GnssPosition(**GNSS_P), identity[:3]), (GnssVelocity(**GNSS_V), identity[3:6]),
        (Barometer(height=0.5), -identity[2:3]),
    ):  # fmt: skip
        assert sensor.linear
        np.testing.assert_array_equal(sensor.jacobian(None, None, NAVIGATION)[:, :, 0], H)


@every_sensor
def test_standard_deviations_are_those_of_the_noise_unless_told_otherwise(case):
    np.testing.assert_allclose(case.build().believed, case.sd, rtol=1e-12)
    doubled = {1: 1.0, 2: (1.0, 2.0), 3: (1.0, 2.0), 6: (1.0, 2.0, 3.0, 4.0)}[len(case.sd)]
    doubled = 1.0 if issubclass(case.cls, AbstractStandstill | Magnetometer) else doubled  # all components are alike
    assert case.build(believed=doubled).believed[0] == 1.0


@every_sensor
def test_beliefs_are_one_a_component_or_one_a_group_and_nothing_else(case):
    each = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6][: len(case.sd)]
    np.testing.assert_array_equal(case.build(believed=each).believed, each)
    np.testing.assert_array_equal(case.build(believed=jnp.array(each)).believed, each)
    for wrong in ([0.1] * 5, [], [each]):
        with pytest.raises(ValueError, match="standard deviations, and this is"):
            case.build(believed=wrong)


def test_two_beliefs_of_three_components_are_horizontal_and_vertical():
    np.testing.assert_array_equal(GnssPosition(**GNSS_P, believed=(0.1, 0.2)).believed, [0.1, 0.1, 0.2])
    np.testing.assert_array_equal(GnssVelocity(**GNSS_V, believed=(0.1, 0.2)).believed, [0.1, 0.1, 0.2])
    np.testing.assert_array_equal(Odometer(**WHEEL, believed=(0.1, 0.2)).believed, [0.1, 0.2, 0.2])
    with pytest.raises(ValueError, match=r"believed has 3 \(n, e, d\) or 2 \(n\+e, d\) standard deviations"):
        GnssPosition(**GNSS_P, believed=0.1)


@pytest.mark.parametrize("arm", [1.0, (1.0, 2.0), (1.0, 2.0, float("nan"))])
def test_bad_lever_arms_are_refused(arm):
    with pytest.raises(ValueError, match="lever arm"):
        GnssPosition(**GNSS_P, lever_arm=arm)


def test_scale_states_are_markov_processes():
    with pytest.raises(ValueError, match="scale cannot be WN"):
        Odometer(speed=0.1, scale_noise=WN(1e-6))
    with pytest.raises(ValueError, match="standard deviation of scale"):
        Odometer(speed=0.1, scale_sd=-0.1)
    with pytest.raises(ValueError, match="sideways is the noise of right and down"):
        Odometer(speed=0.1, sideways=(0.1, 0.1, 0.1))
    assert Odometer(speed=0.1).states == ()


# correlated components

COVARIANCE = np.array([[0.04, 0.018, 0.0], [0.018, 0.01, 0.002], [0.0, 0.002, 0.09]])


def test_correlated_noise_is_decorrelated():
    sensor = GnssPosition(covariance=COVARIANCE)
    L = np.asarray(sensor.mixing)
    np.testing.assert_allclose(L @ np.diag(np.asarray(sensor.believed) ** 2) @ L.T, COVARIANCE, rtol=1e-12, atol=1e-18)
    x = np.random.default_rng(4).normal(size=(3, 9, 2))
    expected = np.einsum("ij,jkr->ikr", np.linalg.inv(L), x)
    np.testing.assert_allclose(decorrelated(sensor, jnp.asarray(x)), expected, rtol=1e-10)


@pytest.mark.parametrize("turning", [None, (0.5, -0.3, 0.8)])
def test_one_update_with_a_whole_covariance_is_the_joint_one(turning):
    """GNSS with correlated components on an arm, and a wheel with all its states: the textbook's update, 1e-7 of an sd.

    Its H are central differences of h along the whole error state, the states of the IMU included. Where the Earth
    turns, as fast as the body here, its rate in b is no part of the wheel's motion.
    """
    rate_n = None if turning is None else jnp.asarray(turning)[:, None]
    wheel = Odometer(**WHEEL, **ON_ARM, scale_sd=0.02, lever_arm_sd=0.1, mount_sd=0.03)
    sensors = (GnssPosition(covariance=COVARIANCE, **ON_ARM), wheel)
    errors = ImuErrors(WN(1e-4) + GM(0.01, 1e-4), WN(1e-6) + GM(0.02, 1e-6), 100.0)
    aiding = Measurements(sensors, own_states(sensors, 100.0), rate_n)
    bank = joined(errors.bank(), aiding.own)
    n = 9 + len(bank.states)
    rng = np.random.default_rng(5)
    A = rng.normal(size=(n, n))
    P = A @ A.T / n
    state, _ = random_motion(sensors[1], 6, 1)
    sensed = jnp.asarray(rng.normal(size=(6, 1)))
    state = state._replace(x=0.1 * jnp.asarray(rng.normal(size=(n - 9, 1))))

    @jax.jit
    def measured(c):
        moved = inject(state, c[:, None])
        body = body_motion(bank.compensated(sensed, moved.x), moved.q, rate_n)
        return jnp.concatenate([s.predict(aiding.seen_by(i, moved), body)[:, 0] for i, s in enumerate(sensors)])

    def h(c):
        """What is measured after an error, components as they are."""
        return np.asarray(measured(jnp.asarray(c)))

    H = np.stack([(h(1e-5 * e) - h(-1e-5 * e)) / 2e-5 for e in np.eye(n)], axis=1)
    R = block_diag(COVARIANCE, np.diag(np.square([0.05, 0.1, 0.1])))
    nu = rng.normal(size=6)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    left = np.eye(n) - K @ H
    expected = left @ P @ left.T + K @ R @ K.T

    @jax.jit
    def updated(P, z):
        reading = bank.compensated(sensed, state.x)
        ours = aiding.derivative(state, reading, bank)
        after, done = update(P[:, :, None], ours, aiding.variance, jnp.ones(6))
        white = jnp.concatenate([decorrelated(sensors[0], z[:3, None]), z[3:, None]])
        c, innovation = correction(done.gain, white - aiding.predict(state, reading), ours)
        return c[:, 0], after[:, :, 0], innovation[:, 0], done.variance[:, 0]

    z = h(np.zeros(n)) + nu
    c, after, innovation, variance = map(np.asarray, updated(jnp.asarray(P), jnp.asarray(z)))
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(c / sd, K @ nu / sd, atol=1e-7)
    np.testing.assert_allclose(after / np.outer(sd, sd), expected / np.outer(sd, sd), atol=1e-7)
    nis = np.sum(innovation**2 / variance)
    np.testing.assert_allclose(nis, nu @ np.linalg.solve(S, nu), rtol=1e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give its noise as horizontal and vertical"),
        ({"covariance": COVARIANCE, "horizontal": 1.0}, "give nothing else"),
        ({"covariance": COVARIANCE, "believed": (1.0, 2.0)}, "give nothing else"),
        ({"covariance": np.eye(2)}, r"is \(3, 3\), and this one \(2, 2\)"),
        ({"covariance": np.triu(np.ones((3, 3)))}, "finite and symmetric"),
        ({"covariance": np.ones((3, 3)) - 0.1 * np.eye(3)}, "positive definite"),
    ],
)
def test_bad_covariances_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        GnssPosition(**options)


# states of its own


@pytest.mark.slow
def test_own_states_move_as_their_process_says(key):
    """A constant and a random walk, drawn at uneven fixes: variances by hand, 5 sigma of 4000 runs."""
    sensor = Odometer(2.0, speed=0.1, scale_sd=0.03, scale_noise=RW(4e-5))
    own = own_states((sensor,), 100.0)
    # the walk has a density per second, and its first step is there at the start
    each = 4e-5 * 2.0 / 100.0
    steps = np.array([0, 50, 51, 120])
    drawn = np.asarray(own.draw(0, jnp.asarray(steps), 200, jax.random.split(key, 4000)))[:, 0]
    variance = 0.03**2 + each * (1 + np.cumsum(steps))
    np.testing.assert_allclose(drawn.var(axis=1), variance, rtol=5 * np.sqrt(2 / 4000))
    moved = np.diff(drawn, axis=0).var(axis=1)
    np.testing.assert_allclose(moved, each * steps[1:], rtol=5 * np.sqrt(2 / 4000))
    bank = joined(ImuErrors(WN(1e-4), WN(1e-6), 100.0).bank(), own)
    assert [str(s) for s in bank.states] == ["odometer scale", "odometer scale RW"]
    np.testing.assert_allclose(np.diag(bank.initial), [0.03**2, each], rtol=1e-12)
    np.testing.assert_allclose(np.diag(bank.driving), [0.0, each], rtol=1e-12)


@every_sensor
def test_noise_has_its_variance_and_nothing_else(case, key):
    sensor = case.build()
    num, runs = 400, 50
    drawn = np.asarray(sensor.draw(num, jax.random.split(key, runs)))
    assert drawn.shape == (num, len(sensor.axes), runs)
    count = num * runs
    # a variance of n normal numbers has the relative deviation sqrt(2/n); five sigma
    np.testing.assert_allclose(drawn.var(axis=(0, 2)), np.square(case.sd), rtol=5 * np.sqrt(2 / count))
    lagged = (drawn[1:] * drawn[:-1]).mean(axis=(0, 2)) / np.square(case.sd)
    assert (np.abs(lagged) < 5 / np.sqrt(count)).all()
    if len(sensor.axes) > 1:
        assert np.abs((drawn[:, 0] * drawn[:, 1]).mean()) / (case.sd[0] * case.sd[1]) < 5 / np.sqrt(count)


@every_sensor
def test_fixes_come_at_their_rate_from_one_period_on(case):
    sensor = case.build(3.0)
    np.testing.assert_allclose(sensor.fixes(10.0, 12.0), 10 + np.arange(1, 7) / 3, rtol=1e-14)
    np.testing.assert_allclose(case.build(3.0, first=0.0).fixes(0.0, 1.0), np.arange(4) / 3)


@every_sensor
def test_the_ends_of_an_outage_belong_to_it(case):
    sensor = case.build(outages=[(7, 8), (2.0, 4.0)])
    times = sensor.fixes(0.0, 10.0)
    np.testing.assert_array_equal(times[sensor.available(times)], [1, 5, 6, 9, 10])
    assert sensor.outages == ((2.0, 4.0), (7.0, 8.0))


@every_sensor
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rate": 0.0}, "positive"),
        ({"rate": -1.0}, "positive"),
        ({"rate": float("nan")}, "positive"),
        ({"outages": [(3.0, 2.0)]}, "ends before it starts"),
        ({"outages": [(3.0,)]}, "a pair"),
        ({"outages": [(0.0, float("nan"))]}, "finite"),
        ({"first": -1.0}, "non-negative"),
    ],
)
def test_bad_options_are_refused(case, options, message):
    with pytest.raises(ValueError, match=message):
        case.build(**options)


@every_sensor
@pytest.mark.parametrize("sd", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_standard_deviations_are_refused(case, sd):
    with pytest.raises(ValueError, match="positive"):
        case.build(**dict.fromkeys(case.noise, sd))


@every_sensor
def test_a_sensor_without_fixes_is_refused(case):
    with pytest.raises(ValueError, match="no fix between 0 and 5 s"):
        case.build(0.1).fixes(0.0, 5.0)
    with pytest.raises(ValueError, match="lies outside the run"):
        case.build(outages=[(4.0, 6.0)]).fixes(0.0, 5.0)
    with pytest.raises(ValueError, match="All fixes"):
        case.build(outages=[(0.0, 5.0)]).fixes(0.0, 5.0)


def test_correlated_noise_is_believed_with_its_whole_variance(key):
    model = WN(0.04) + GM(0.1, 0.09)
    sensor = Barometer(height=model)
    np.testing.assert_allclose(sensor.believed, [np.sqrt(0.13)])
    drawn = np.asarray(sensor.draw(50, jax.random.split(key, 2000)))[:, 0]
    # from the first fix on stationary: each row has 2000 independent runs
    np.testing.assert_allclose(drawn.var(axis=1), 0.13, rtol=5 * np.sqrt(2 / 2000))
    expected = 0.09 * np.exp(-0.1 * 10)
    assert (drawn[10:] * drawn[:-10]).mean() == pytest.approx(expected, abs=5 * 0.13 / np.sqrt(2000))


def test_noise_without_a_variance_needs_a_belief():
    with pytest.raises(ValueError, match="RW has no constant variance"):
        Barometer(height=WN(0.04) + RW(1e-4))
    assert Barometer(height=WN(0.04) + RW(1e-4), believed=0.3).believed[0] == 0.3


@every_sensor
def test_it_is_saved(case):
    """With all its settings, to the last bit."""
    sensor = case.build(2.0, outages=[(3.0, 4.0)], name="mine")
    assert eqx.tree_equal(from_state(to_state(sensor)), sensor)


def test_a_field_or_a_baseline_of_nothing_is_refused_and_one_may_be_traced():
    with pytest.raises(ValueError, match="magnetometer: a field of zero shows no direction"):
        Magnetometer(sd=1.0, field=(0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"dual_antenna: a baseline has three components \(front, right, down, in m\)"):
        DualAntenna(**GNSS_P, baseline=(1.0, 0.0))
    with pytest.raises(ValueError, match="dual_antenna: a baseline must be finite"):
        DualAntenna(**GNSS_P, baseline=(1.0, 0.0, float("nan")))
    given = jnp.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(jax.jit(lambda b: DualAntenna(**GNSS_P, baseline=b).baseline)(given), given)
