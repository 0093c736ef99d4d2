"""The ellipsoid: against formulas in angles, against another library, and where angles have no meaning."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pymap3d
import pytest
from nav.planets import Ellipsoid

import nav_jax as nj
from gmwm_jax._internal.states import from_state, to_state
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.geodetic import dcm_ned_from_ecef
from nav_jax.kinematics.wgs84 import normal_gravity

ORIGINS = {
    "mid": [0.81, 0.115, 500.0],
    "south": [-0.59, -1.9, 20.0],
    "equator": [0.0, 3.1415, 0.0],
    "near the pole": [1.5705, 0.3, 2000.0],
}


def places(origin, seed=0):
    """Latitude, longitude, height around an origin, to a degree away and to 20 km of height."""
    rng = np.random.default_rng(seed)
    lat = np.clip(origin[0] + rng.uniform(-0.02, 0.02, 50), -1.5707, 1.5707)
    return np.column_stack([lat, origin[1] + rng.uniform(-0.02, 0.02, 50), rng.uniform(-400, 20e3, 50)])


def in_n(origin, lla):
    deg = np.rad2deg(lla)
    centre = np.rad2deg(origin)
    return np.stack(pymap3d.geodetic2ned(deg[:, 0], deg[:, 1], lla[:, 2], centre[0], centre[1], origin[2]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ORIGINS)
def test_gravity_and_height_are_those_of_angles(name):
    """To 20 km of height and 100 km away: 1e-9 m/s^2 in all three components, and a micrometre of height."""
    origin = np.array(ORIGINS[name])
    lla = places(origin)
    p, earth = jnp.asarray(in_n(origin, lla)), nj.Wgs84(origin)
    square = np.sin(lla[:, 0]) ** 2
    to_n = dcm_ned_from_ecef(*origin[:2]) @ dcm_ned_from_ecef(lla[:, 0], lla[:, 1]).transpose(0, 2, 1)
    expected = normal_gravity(square, lla[:, 2]) * to_n[:, :, 2].T
    np.testing.assert_allclose(earth.gravity_n(p), expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(earth.gravity_n(p), jax.vmap(Ellipsoid(origin).gravity_n, 1, 1)(p), rtol=0, atol=1e-9)
    np.testing.assert_allclose(earth.height(p), lla[:, 2] - origin[2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(earth.local(np.asarray(p).T), to_n.transpose(0, 2, 1), rtol=0, atol=1e-10)


def test_normal_gravity():
    """At the equator, the pole and in between (Moritz 2000), and its decrease with height."""
    assert normal_gravity(0.0, 0.0) == pytest.approx(9.7803253359, rel=1e-10)
    assert normal_gravity(1.0, 0.0) == pytest.approx(9.8321849378, rel=1e-9)
    square = np.sin(0.8) ** 2
    assert normal_gravity(square, 1000.0) - normal_gravity(square, 0.0) == pytest.approx(-3.0855e-3, rel=1e-3)


def test_the_gradient_is_that_of_schuler():
    """-g/R to the sides and 2 g/R upwards, to the percent by which the ellipsoid is no ball."""
    earth = EarthInLoops(nj.Wgs84([0.81, 0.115, 500.0]))
    found = np.asarray(earth.pull(jnp.zeros((3, 1))).gradient)[:, :, 0]
    g, R = 9.807, 6.378e6
    np.testing.assert_allclose(found, np.diag([-g / R, -g / R, 2 * g / R]), rtol=0, atol=0.01 * g / R)


def test_gravity_of_a_segment_is_that_of_every_place_in_it():
    """What is left out is of second order in the way d: 3 g (d/R)^2 upwards, 1.5 g (d/R)^2 along the ground."""
    earth = nj.Wgs84(ORIGINS["mid"])
    start = jnp.asarray([[2000.0], [-3000.0], [-1000.0]])
    pull = EarthInLoops(earth).pull(start)
    for way in (300.0, 3000.0):
        for towards in np.eye(3):
            place = start + way * towards[:, None]
            found = EarthInLoops(earth).gravity(place, jnp.zeros((3, 1)), jnp.zeros(()), pull)
            off = float(jnp.linalg.norm(found - earth.gravity_n(place)))
            order = 9.8 * (way / 6.37e6) ** 2
            assert 1.4 * order < off < 3.1 * order


@pytest.mark.slow
@pytest.mark.parametrize("latitude", [np.pi / 2, -np.pi / 2, 0.0])
def test_derivatives_are_finite_everywhere(latitude):
    """At a pole, on the axis above it, and at the origin; they are those of differences."""
    earth = nj.Wgs84([latitude, 0.0, 0.0])
    p = jnp.asarray([[0.0, 3000.0], [0.0, -2000.0], [0.0, -9000.0]])
    stated = np.asarray(EarthInLoops(earth).pull(p).gradient)
    steps = 10.0 * jnp.eye(3)[:, :, None]
    differences = np.stack([np.asarray(earth.gravity_n(p + e) - earth.gravity_n(p - e)) / 20 for e in steps], axis=1)
    assert np.isfinite(stated).all()
    np.testing.assert_allclose(stated, differences, rtol=0, atol=1e-12)
    derived = super(nj.Wgs84, earth).gradient_n(p)
    np.testing.assert_allclose(stated, derived, rtol=0, atol=1e-14)
    assert np.isfinite(derived).all()


def test_by_the_origin():
    """Gravity at the origin goes with its latitude and height as the formula says, and compiles once for all."""

    @jax.jit
    def magnitude(origin):
        return jnp.linalg.norm(nj.Wgs84(origin).gravity_n(jnp.zeros(3)))

    origin = jnp.asarray([0.8, 0.1, 700.0])
    slope = jax.grad(magnitude)(origin)
    d = 1e-4
    expected = [
        (normal_gravity(np.sin(0.8 + d) ** 2, 700.0) - normal_gravity(np.sin(0.8 - d) ** 2, 700.0)) / (2 * d),
        0.0,
        normal_gravity(np.sin(0.8) ** 2, 700.5) - normal_gravity(np.sin(0.8) ** 2, 699.5),
    ]
    np.testing.assert_allclose(slope, expected, rtol=1e-5, atol=1e-11)
    magnitude(origin + 0.1)
    assert magnitude._cache_size() == 1


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ([46.5, 6.6, 500.0], "deg"),
        ([0.8, 6.6e2, 500.0], "deg"),
        ([0.8, 0.1, 7e7], "height"),
        ([0.8, 0.1, -6.4e6], "height"),
        ([0.8, np.nan, 0.0], "NaN"),
        ([0.8, 0.1], "shape"),
    ],
)
def test_no_place_on_earth(origin, said):
    with pytest.raises(ValueError, match=said):
        nj.Wgs84(origin)


REST = nj.motions.static(10.0, 20.0)


def test_a_trajectory_about_another_point_is_refused():
    origin = np.array(ORIGINS["mid"])
    there = dataclasses.replace(REST, origin=origin + np.array([0.4, 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"Positions are about the origin 69.* m away: give both the same"):
        nj.Scenario(there, earth=nj.Wgs84(origin))
    assert nj.Scenario(dataclasses.replace(REST, origin=origin), earth=nj.Wgs84(origin)).reference.origin is not None


def test_a_trajectory_that_leaves_the_earth_is_refused():
    """As positions that are Earth-centred, or 3,000 km away along straight axes."""
    for position in ([3e6, 0.0, 0.0], [4.2e6, 0.5e6, 4.7e6], [0.0, 0.0, 2e4]):
        away = dataclasses.replace(REST, position=REST.position + np.array(position))
        with pytest.raises(ValueError, match="m above the ellipsoid, and normal gravity is known from"):
            nj.Scenario(away, earth=nj.Wgs84(ORIGINS["mid"]))


def test_it_prints_and_saves_itself(tmp_path):
    earth = nj.Wgs84(np.array(ORIGINS["mid"]))
    assert repr(earth) == "Wgs84(origin=46.40958141 deg, 6.58901464 deg, 500.000 m)"
    reference = dataclasses.replace(REST, origin=np.array(ORIGINS["mid"]))
    scenario = nj.Scenario(reference, (), earth=earth)
    assert "Wgs84(origin=46.4" in repr(scenario)
    assert "origin 46.40958141 deg" in repr(reference)
    tree = to_state(scenario)
    again = from_state(tree)
    np.testing.assert_array_equal(again.earth.origin, earth.origin)
    np.testing.assert_array_equal(again.earth.centre, earth.centre)
    np.testing.assert_array_equal(again.reference.origin, reference.origin)
