"""The mechanisation on an Earth that turns and curves: against inertial space, against an oracle, and undone."""

import jax.numpy as jnp
import numpy as np
import pytest
from nav.cases import angle_between
from nav.planets import SmallPlanet
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.geodetic import dcm_ned_from_ecef, ned_from_geodetic

PLANET = SmallPlanet()
START = np.array([30.0, -20.0, -15.0]), np.array([12.0, 9.0, -6.0]), Rotation.from_euler("ZYX", [0.7, 0.2, -0.4])


def in_inertial_space(omega, f, dt):
    """Where Newton's law leads in axes that do not turn, seen from n at the end: p, v, matrix C_nb.

    At the start they are those of n, about the centre of the planet; nothing but its attraction and f acts.
    """
    p, v, C = START
    w, centre = SmallPlanet.rate, np.array([0.0, 0.0, SmallPlanet.radius])
    state, attitude = np.concatenate([p - centre, v + np.cross(w, p - centre)]), C

    def rates(t, state, attitude, omega, f):
        x = state[:3]
        pull = -SmallPlanet.attraction * x / np.linalg.norm(x) ** 3
        return np.concatenate([state[3:], (attitude * Rotation.from_rotvec(omega * t)).apply(f) + pull])

    for sample in zip(omega, f, strict=True):
        given = (attitude, *sample)
        state = solve_ivp(rates, (0, dt), state, method="DOP853", rtol=1e-12, atol=1e-11, args=given).y[:, -1]
        attitude = attitude * Rotation.from_rotvec(sample[0] * dt)
    back = Rotation.from_rotvec(-w * len(omega) * dt)
    x = back.apply(state[:3])
    return x + centre, back.apply(state[3:]) - np.cross(w, x), (back * attitude).as_matrix()


def mechanised(omega, f, dt, parts=1):
    p, v, C = START
    first = (jnp.asarray(a) for a in (p, v, C.as_quat(scalar_first=True)))
    samples = (jnp.asarray(np.repeat(a, parts, axis=0)) for a in (omega, f))
    run = strapdown.integrate(*first, *samples, jnp.full(parts * len(omega), dt / parts), PLANET)
    p, v, q = (np.asarray(a)[-1] for a in run)
    return p, v, Rotation.from_quat(q, scalar_first=True).as_matrix()


@pytest.mark.parametrize("platform", ["falls", "is carried"])
def test_newton_in_inertial_space_agrees(platform):
    """Of second order in the step: a quarter is left of what is off at twice the interval, and 1e-3 m after 8 s."""
    rng = np.random.default_rng(1)
    omega, f = rng.normal(size=(16, 3)) * 0.3, rng.normal([0.0, 0.0, -9.0], 1.0, (16, 3))
    omega, f = (0.0 * omega, 0.0 * f) if platform == "falls" else (omega, f)
    p, v, C = in_inertial_space(omega, f, 0.5)
    off = []
    for parts in (25, 50):
        found = mechanised(omega, f, 0.5, parts)
        off.append([np.abs(a - b).max() for a, b in zip(found, (p, v, C), strict=True)])
    assert off[1][0] < 1e-3
    assert off[1][1] < 5e-4
    assert off[1][2] < 1e-12
    np.testing.assert_allclose(off[0][0] / off[1][0], 4.0, rtol=0.1)
    np.testing.assert_allclose(off[0][1] / off[1][1], 4.0, rtol=0.1)
    # a planet that does not turn leads elsewhere
    assert np.abs(2 * np.cross(SmallPlanet.rate, START[1])).max() * 8.0**2 / 2 > 10


@pytest.mark.slow
@pytest.mark.parametrize("motion", [nj.motions.lemniscate, nj.motions.climb])
def test_perfect_sensors_lead_along_the_reference(motion):
    """30 s at 100 Hz, to 1e-8 m and 1e-11 rad; body rates are those in inertial space, rate of the planet included."""
    reference = motion(30.0, 100.0)
    imu, returned = nj.perfect_imu(reference, earth=PLANET)
    first = (jnp.asarray(x[0]) for x in (returned.position, returned.velocity, returned.quaternion))
    run = strapdown.integrate(*first, jnp.asarray(imu.gyro), jnp.asarray(imu.accel), jnp.full(len(imu), 0.01), PLANET)
    found = nj.Trajectory(reference.time, *(np.asarray(x) for x in run))
    np.testing.assert_allclose(found.position, returned.position, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.position, reference.position, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.velocity, returned.velocity, rtol=0, atol=1e-9)
    assert angle_between(found, reference) < 1e-11


def test_at_rest_sensors_feel_gravity_and_the_rate_of_the_planet():
    """The rate exactly; gravity to the second order in what the planet turns in a sample, 1.5e-3 rad."""
    imu, _ = nj.perfect_imu(nj.motions.static(2.0, 20.0), earth=PLANET)
    np.testing.assert_allclose(imu.gyro, np.broadcast_to(SmallPlanet.rate, imu.gyro.shape), rtol=0, atol=1e-14)
    g = np.asarray(PLANET.gravity_n(jnp.zeros(3)))
    np.testing.assert_allclose(imu.accel, np.broadcast_to(-g, imu.accel.shape), rtol=0, atol=9.8 * 1.5e-3**2 / 8)


@pytest.mark.parametrize("name", ["mid", "polar", "dateline", "fast"])
def test_wgs84_trajectories_of_closed_form(shared, name):
    """One to two minutes on the ellipsoid, near a pole, over the date line and at 600 m/s: 1 mm, 1e-5 m/s, 1e-8 rad.

    The increments go to the mechanisation corrected for coning and sculling.
    """
    with np.load(shared / "reference" / "strapdown_wgs84.npz") as data:
        known = {k.removeprefix(f"{name}_"): data[k] for k in data if k.startswith(f"{name}_")}
    lla, dt = known["lla"], 0.01
    earth = nj.Wgs84(lla[0])
    to_n = dcm_ned_from_ecef(*lla[0, :2]) @ dcm_ned_from_ecef(lla[:, 0], lla[:, 1]).transpose(0, 2, 1)
    p = ned_from_geodetic(lla, lla[0])
    v = np.einsum("kij,kj->ki", to_n, known["velocity"])
    q = Rotation.from_matrix(to_n @ known["dcm_nb"])

    imu = nj.imu.imu_of_samples(np.arange(len(known["dv"])) * dt, known["dtheta"] / dt, known["dv"] / dt, 1 / dt)
    first = (jnp.asarray(a) for a in (p[0], v[0], q[0].as_quat(scalar_first=True)))
    run = strapdown.integrate(*first, jnp.asarray(imu.gyro), jnp.asarray(imu.accel), jnp.full(len(imu), dt), earth)
    found = [np.asarray(a)[::100] for a in run]
    np.testing.assert_allclose(found[0], p, rtol=0, atol=1e-3)
    np.testing.assert_allclose(found[1], v, rtol=0, atol=1e-5)
    assert (Rotation.from_quat(found[2], scalar_first=True) * q.inv()).magnitude().max() < 1e-8
    # heights come out too
    np.testing.assert_allclose(earth.height(jnp.asarray(p.T)), lla[:, 2] - lla[0, 2], rtol=0, atol=1e-6)
