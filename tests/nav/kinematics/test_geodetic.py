"""WGS-84 coordinates against pymap3d."""

import numpy as np
import pymap3d
import pytest

from nav_jax.kinematics import geodetic

RNG = np.random.default_rng(3)
POINTS = np.stack([RNG.uniform(-1.57, 1.57, 40), RNG.uniform(-3.14, 3.14, 40), RNG.uniform(-1e3, 2e4, 40)], axis=1)


def test_ecef_and_back():
    expected = np.stack(pymap3d.geodetic2ecef(*POINTS.T, deg=False), axis=1)
    found = geodetic.ecef_from_geodetic(POINTS)
    np.testing.assert_allclose(found, expected, atol=5e-8, rtol=0)
    again = geodetic.geodetic_from_ecef(found)
    np.testing.assert_allclose(again[:, :2], POINTS[:, :2], atol=1e-13, rtol=0)
    np.testing.assert_allclose(again[:, 2], POINTS[:, 2], atol=5e-8, rtol=0)


@pytest.mark.parametrize("latitude", [0.0, np.pi / 2, -np.pi / 2, 1e-9])
@pytest.mark.parametrize("height", [-5e3, 0.0, 1e4, 2e7])
def test_poles_and_equator(latitude, height):
    point = np.array([[latitude, 0.5, height]])
    again = geodetic.geodetic_from_ecef(geodetic.ecef_from_geodetic(point))
    np.testing.assert_allclose(again[:, [0, 2]], point[:, [0, 2]], atol=2e-8)


def test_local_frame():
    origin = np.array([0.81, 0.11, 517.9])
    near = origin + RNG.uniform(-0.01, 0.01, (30, 3)) * [1, 1, 1e4]
    expected = np.stack(pymap3d.geodetic2ned(*near.T, *origin, deg=False), axis=1)
    found = geodetic.ned_from_geodetic(near, origin)
    np.testing.assert_allclose(found, expected, atol=1e-8, rtol=0)
    again = geodetic.geodetic_from_ned(found, origin)
    np.testing.assert_allclose(again[:, :2], near[:, :2], atol=1e-13, rtol=0)
    np.testing.assert_allclose(again[:, 2], near[:, 2], atol=1e-8, rtol=0)


def test_directions_of_the_local_frame():
    dcm = geodetic.dcm_ned_from_ecef(POINTS[:, 0], POINTS[:, 1])
    np.testing.assert_allclose(dcm @ dcm.transpose(0, 2, 1), np.broadcast_to(np.eye(3), dcm.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(dcm), 1.0, atol=1e-13)
    higher = geodetic.ecef_from_geodetic(POINTS + np.array([0, 0, 1.0])) - geodetic.ecef_from_geodetic(POINTS)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", dcm, higher), [[0, 0, -1.0]] * 40, atol=1e-8)
