"""The Earth: gravity for the mechanisation, and WGS-84 coordinates for the readers.

The mechanisation asks its Earth for gravity at a position. `FlatEarth` answers with a constant; an ellipsoid can take
its place without a change elsewhere.
"""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.typing import FloatLike, Scalar, Vector, Vectors

STANDARD_GRAVITY = 9.80665
"""Standard gravity in m/s^2 (CGPM 1901)."""

_A = 6378137.0
_F = 1 / 298.257223563
_B = _A * (1 - _F)
_E2 = _F * (2 - _F)
_EP2 = _E2 / (1 - _E2)

Geodetic = Float64[np.ndarray, "3"]


class AbstractEarth(eqx.Module):
    """What a mechanisation and an error model ask of an Earth."""

    @abc.abstractmethod
    def gravity_n(self, position: Vector) -> Vector:
        """Gravity in n at a position, (3, ...) m/s^2."""


class FlatEarth(AbstractEarth):
    """A flat Earth that does not rotate, with the same gravity everywhere.

    Parameters
    ----------
    gravity
        In m/s^2, along down.

    Raises
    ------
    ValueError
        Gravity is negative or not finite.

    Examples
    --------
    >>> float(nj.FlatEarth().gravity)
    9.80665
    """

    gravity: Scalar

    def __init__(self, gravity: FloatLike = STANDARD_GRAVITY) -> None:
        positive("gravity", gravity, zero_ok=True)
        self.gravity = as_float(gravity)

    def gravity_n(self, position: Vector) -> Vector:  # noqa: D102
        zero = jnp.zeros_like(position[0])
        return jnp.stack([zero, zero, zero + self.gravity])

    def __repr__(self) -> str:
        gravity = concrete(self.gravity)
        return f"FlatEarth(gravity={'traced' if gravity is None else f'{float(gravity):.9g}'})"


def ecef_from_geodetic(geodetic: Vectors) -> Vectors:
    """Earth-centred Earth-fixed x, y, z in m of latitude, longitude (rad) and ellipsoidal height (m) on WGS-84."""
    lat, lon, height = geodetic.T
    n = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    r = (n + height) * np.cos(lat)
    return np.stack([r * np.cos(lon), r * np.sin(lon), (n * (1 - _E2) + height) * np.sin(lat)], axis=1)


def geodetic_from_ecef(ecef: Vectors) -> Vectors:
    """Latitude, longitude (rad) and height (m) on WGS-84, by Bowring's (1976) iteration.

    Two rounds are exact to rounding from -10 km to far above every aircraft; the third is for satellites.
    """
    x, y, z = ecef.T
    r = np.hypot(x, y)
    lat = np.arctan2(z, (1 - _E2) * r)
    for _ in range(3):
        reduced = np.arctan2((1 - _F) * np.sin(lat), np.cos(lat))
        lat = np.arctan2(z + _EP2 * _B * np.sin(reduced) ** 3, r - _E2 * _A * np.cos(reduced) ** 3)
    n = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    # along the normal: well conditioned from the equator to the poles
    height = r * np.cos(lat) + z * np.sin(lat) - _A * _A / n
    return np.stack([lat, np.arctan2(y, x), height], axis=1)


def dcm_ned_from_ecef(latitude: Any, longitude: Any) -> np.ndarray:
    """The matrices (..., 3, 3) that take ECEF to the local north, east, down at a latitude and longitude (rad)."""
    sp, cp, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    zero = np.zeros_like(sp * sl)
    rows = [[-sp * cl, -sp * sl, cp + zero], [-sl + zero, cl + zero, zero], [-cp * cl, -cp * sl, -sp + zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def ned_from_geodetic(geodetic: Vectors, origin: Geodetic) -> Vectors:
    """Position in m in the tangent frame north, east, down at an origin.

    Parameters
    ----------
    geodetic
        Shape (N, 3): latitude, longitude (rad), ellipsoidal height (m) on WGS-84.
    origin
        The same three of the origin.
    """
    offset = ecef_from_geodetic(geodetic) - ecef_from_geodetic(origin[None])
    return offset @ dcm_ned_from_ecef(origin[0], origin[1]).T


def geodetic_from_ned(ned: Vectors, origin: Geodetic) -> Vectors:
    """The inverse of `ned_from_geodetic`."""
    return geodetic_from_ecef(ecef_from_geodetic(origin[None]) + ned @ dcm_ned_from_ecef(origin[0], origin[1]))
