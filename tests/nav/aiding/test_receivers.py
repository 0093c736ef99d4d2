"""What receivers and barometers need besides a measurement: means about events, a reference in between, settings."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.aiding.base import Window
from nav_jax.aiding.gnss import Gnss
from nav_jax.aiding.states import own_states
from nav_jax.app.sections import AIDING as SECTIONS
from nav_jax.filter.windows import window_means
from nav_jax.kinematics.reference import ReferenceMotion

BOTH = {"horizontal": 0.02, "vertical": 0.03, "horizontal_velocity": 0.04, "vertical_velocity": 0.05}
SLOW = "GM(beta=0.1, variance=0.01)"


def test_means_of_a_turning_body_are_along_its_axes_at_the_event():
    """A constant force in n along a body that turns evenly about any axis: to rounding, wherever the window lies."""
    rate, omega, force_n = 50.0, np.array([0.3, -0.2, 0.9]), np.array([1.0, 2.0, -9.8])
    middles = (np.arange(200) + 0.5) / rate
    accel = Rotation.from_rotvec(middles[:, None] * omega).inv().apply(force_n)
    imu = nj.Imu(np.arange(200) / rate, np.tile(omega, (200, 1)), accel, rate)
    times = np.array([1.0, 1.013, 2.5])
    expected = Rotation.from_rotvec(times[:, None] * omega).inv().apply(force_n)
    # of a sample, the middle of what lies in the window counts: half a sample off at the ends of the second event
    for window in (Window(-0.1, 0.1), Window(-0.26, 0.0), Window(-0.26, 0.0, rises=True)):
        means = np.asarray(window_means(imu, times, [window]))[:, 0]
        np.testing.assert_allclose(means[:, :3], expected, atol=6e-3)
        np.testing.assert_allclose(means[:, 3:], np.tile(omega, (3, 1)), rtol=1e-12)
    even = np.asarray(window_means(imu, times[:1], [Window(-0.1, 0.1)]))[:, 0]
    np.testing.assert_allclose(even[:, :3], expected[:1], rtol=1e-12)


def test_means_are_the_integrals_of_what_is_held():
    """Against sums over 20,000 instants, of a body that does not turn: 2e-4; past the ends of the record too."""
    rng = np.random.default_rng(3)
    rate, num = 10.0, 40
    imu = nj.Imu(np.arange(num) / rate, np.zeros((num, 3)), rng.normal(size=(num, 3)), rate)
    times = np.array([0.05, 1.0, 2.37, 4.0])
    for window in (Window(-0.5, 0.5), Window(-0.25, 0.0), Window(-0.25, 0.0, rises=True)):
        found = np.asarray(window_means(imu, times, [window]))[:, 0, :3]
        u = (np.arange(20_000) + 0.5) / 20_000
        at = times[:, None] + window.begin + u * (window.end - window.begin)
        held = imu.accel[np.clip(np.floor(at * rate).astype(int), 0, num - 1)]
        weight = 2 * u if window.rises else np.ones_like(u)
        np.testing.assert_allclose(found, (held * weight[:, None]).mean(axis=1), atol=2e-4)


@pytest.mark.parametrize("averaged", [0.0, 0.25])
@pytest.mark.parametrize("offset", [0.0, 0.02])
def test_runs_with_arms_of_their_own_are_emulated_as_each_by_itself(averaged, offset):
    """A mean velocity is that of an antenna whose arm every run draws, with a time offset or without one."""
    sensor = Gnss(1.0, **BOTH, lever_arm_sd=0.1, time_offset_sd=offset, averaged=averaged)
    experiment = nj.filter.prepare(nj.Scenario(nj.motions.lemniscate(duration=4.0, rate=20.0), [sensor]), rate=20.0)
    time = jnp.array([1.0, 2.0, 3.0])
    x = jnp.asarray(np.random.default_rng(1).normal(size=(3, len(sensor.states), 5))) * 0.1
    found = sensor.emulate(experiment.track, time, x)
    assert (found is None) == (not averaged and not offset)
    if found is not None:
        assert found.shape == (6, 3, 5)
        alone = [sensor.emulate(experiment.track, time, x[:, :, r : r + 1]) for r in range(5)]
        np.testing.assert_allclose(found, jnp.concatenate(alone, axis=2), rtol=1e-12, atol=1e-12)


def test_no_window_no_means():
    imu = nj.perfect_imu(nj.motions.static(duration=2.0, rate=10.0))[0]
    assert window_means(imu, np.array([1.0]), []) is None


def test_a_track_is_exact_for_cubics_and_even_turns():
    t, c = np.arange(11) * 0.1, np.array([[1.0, 2.0, -3.0, 4.0], [0.0, -1.0, 2.0, 5.0], [3.0, 0.5, 0.25, -2.0]])
    p = c @ np.stack([t**0, t, t**2, t**3])
    v = c @ np.stack([0 * t, t**0, 2 * t, 3 * t**2])
    omega = np.array([0.4, -1.0, 0.7])
    q = Rotation.from_rotvec(t[:, None] * omega).as_quat(scalar_first=True).T
    track = ReferenceMotion(*map(jnp.asarray, (0.0, 0.1, p, v, q)))
    at = np.array([[0.0, 0.033], [0.55, 1.0]])
    found = track.at(jnp.asarray(at))
    np.testing.assert_allclose(found.p, np.einsum("ij,jkl->ikl", c, np.stack([at**0, at, at**2, at**3])), atol=1e-12)
    np.testing.assert_allclose(
        found.v, np.einsum("ij,jkl->ikl", c, np.stack([0 * at, at**0, 2 * at, 3 * at**2])), atol=1e-11
    )
    turned = Rotation.from_quat(np.moveaxis(np.asarray(found.q), 0, -1).reshape(-1, 4), scalar_first=True)
    assert (turned.inv() * Rotation.from_rotvec(at.reshape(-1, 1) * omega)).magnitude().max() < 1e-12
    np.testing.assert_allclose(found.rate, np.broadcast_to(omega[:, None, None], (3, 2, 2)), atol=1e-10)
    # past the end it goes straight on
    beyond = track.at(jnp.array([[1.2]]))
    np.testing.assert_allclose(beyond.p[:, 0, 0], p[:, -1] + 0.2 * v[:, -1], rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, averaged=0.2), "leave it out"),
        (lambda: nj.GnssVelocity(horizontal=1.0, vertical=1.0, averaged=-0.2), "averaged"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, lever_arm_sd=(1.0, 2.0)), "one number or 3"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, lever_arm_sd=-1.0), "lever_arm_sd must be non-neg"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, lever_arm_sd=float("nan")), "lever_arm_sd must be"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, time_offset_sd=-1.0), "deviation of time_offset"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, drift=0.3), "drift is a model"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, drift=(SLOW,) * 4), "one for all axes"),
        (lambda: nj.GnssPosition(horizontal=1.0, vertical=1.0, drift="WN(sigma2=1.0)"), "no Markov process"),
        (lambda: Gnss(horizontal=1.0, vertical=1.0, horizontal_velocity=1.0), "vertical_velocity is missing"),
        (lambda: Gnss(covariance=np.eye(3)), r"is \(6, 6\), and this one \(3, 3\)"),
        (lambda: nj.Barometer(height=1.0, offset_noise="WN(sigma2=1.0)"), "offset cannot be WN"),
        (lambda: nj.Barometer(height=1.0, offset_sd=-1.0), "standard deviation of offset"),
        (lambda: nj.Barometer(height=1.0, scale_sd=float("inf")), "standard deviation of scale"),
    ],
)
def test_bad_settings_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_what_is_known_is_no_state():
    assert nj.GnssPosition(horizontal=1.0, vertical=1.0, lever_arm_sd=0.0, time_offset_sd=0.0).linear
    assert nj.Barometer(height=1.0).states == ()
    assert nj.GnssVelocity(horizontal=1.0, vertical=1.0, averaged=0.1).states == ()


def test_a_whole_receiver_in_a_configuration():
    section = SECTIONS["gnss"](
        type="gnss", rate="4 Hz", horizontal="2 cm", vertical=0.03,
        horizontal_velocity="40 mm/s", vertical_velocity=0.05,
        lever_arm=["1 m", 0.0, "-50 cm"], lever_arm_sd="5 cm", time_offset_sd="20 ms", averaged="250 ms",
        drift=[SLOW, SLOW], drift_velocity=SLOW,
    )  # fmt: skip
    expected = Gnss(
        4.0, **BOTH, lever_arm=(1.0, 0.0, -0.5), lever_arm_sd=0.05, time_offset_sd=0.02, averaged=0.25, drift=SLOW,
        drift_velocity=SLOW,
    )  # fmt: skip
    assert eqx.tree_equal(section.build(), expected, rtol=1e-14)
    baro = SECTIONS["barometer"](type="barometer", height=0.5, offset_sd="3 m", offset_noise=SLOW, scale_sd=0.01)
    assert eqx.tree_equal(baro.build(), nj.Barometer(height=0.5, offset_sd=3.0, offset_noise=SLOW, scale_sd=0.01))


def test_states_of_the_truth_and_of_the_filter_are_told_apart():
    """Names of errors, and what is left of the states without one: it is zero."""
    gnss, baro = (
        nj.GnssPosition(horizontal=1.0, vertical=1.0, lever_arm_sd=0.1),
        nj.Barometer(height=1.0, offset_sd=2.0),
    )
    scenario = nj.Scenario(
        nj.motions.static(duration=3.0, rate=10.0), (gnss, baro), neglected=["gnss_position lever_arm"]
    )
    timeline = nj.filter.prepare(scenario, rate=10.0).timeline
    assert timeline.drawn.names == ("gnss_position lever_arm", "barometer offset")
    assert timeline.own.names == ("barometer offset",)
    x = jnp.arange(1.0, 3.0)[:, None] * jnp.ones((1, 2))  # one state of an IMU, and that of the barometer
    np.testing.assert_array_equal(timeline.own.values(x, 0), np.zeros((3, 2)))
    np.testing.assert_array_equal(timeline.own.values(x, 1), [[2.0, 2.0]])
    other = dataclasses.replace(scenario, neglected=(), suspected=("barometer offset",))
    assert nj.filter.prepare(other, rate=10.0).timeline.drawn.names == ("gnss_position lever_arm",)
    for names in ({"neglected": ("gnss_position clock",)}, {"suspected": ("odometer scale",)}):
        with pytest.raises(
            ValueError, match="is no error of a sensor here; there are 'gnss_position lever_arm', 'baro"
        ):
            dataclasses.replace(other, **names)


def test_standard_deviations_of_groups_are_scaled():
    own = own_states((nj.Barometer(height=1.0, offset_sd=2.0, offset_noise=SLOW, scale_sd=0.1),), 10.0)
    scaled = own.scaled(jnp.array([3.0, 2.0]))
    np.testing.assert_allclose(np.diag(scaled.initial) / np.diag(own.initial), [9.0, 9.0, 4.0], rtol=1e-14)
    np.testing.assert_allclose(np.diag(scaled.driving)[1] / np.diag(own.driving)[1], 9.0, rtol=1e-14)
