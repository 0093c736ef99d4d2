"""Earths that only the tests know."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import nav_jax as nj
from nav_jax.kinematics.geodetic import dcm_ned_from_ecef, ecef_from_geodetic
from nav_jax.kinematics.rotation import cross, dot


def column(vector, like):
    """A vector as one of each run."""
    return jnp.broadcast_to(jnp.reshape(vector, (3,) + (1,) * (like.ndim - 1)), like.shape)


def number(default):
    """A field, so that Earths that differ in it share programs."""
    return eqx.field(converter=jnp.asarray, default=default)


class Pillar(nj.kinematics.AbstractEarth):
    """Gravity falls by a thousandth with each metre of height, or not at all; it neither turns nor bends."""

    is_uniform: ClassVar[bool] = False
    is_turning: ClassVar[bool] = False
    is_flat: ClassVar[bool] = True

    falls: jax.Array = number(1 / 2000.0)
    """Half of the part by which gravity is less a metre higher."""

    def gravity_n(self, position):
        zero = jnp.zeros_like(position[0])
        return jnp.stack([zero, zero, 9.8 / (1.0 - self.falls * position[2]) ** 2])

    def rate_n(self, position):
        return jnp.zeros_like(position)

    def height(self, position):
        return -position[2]


class SmallPlanet(nj.kinematics.AbstractEarth):
    """A ball of 2 km radius that turns in 3.5 minutes: 1.8 m/s^2 of centrifugal acceleration at its equator.

    The origin of n is at a latitude of 0.8 rad. Without curvature and not turning it is a flat Earth in disguise.
    """

    is_uniform: ClassVar[bool] = False
    is_turning: ClassVar[bool] = True
    is_flat: ClassVar[bool] = False

    radius: ClassVar[float] = 2000.0
    attraction: ClassVar[float] = 9.8 * 2000.0**2
    rate: ClassVar[np.ndarray] = 0.03 * np.array([np.cos(0.8), 0.0, -np.sin(0.8)])

    curvature: jax.Array = number(1 / 2000.0)
    turning: jax.Array = number(1.0)
    """How many times the rate."""

    def to_centre(self, position):
        """The vector to the centre, of length 1 at the origin; and the square of its length."""
        r = column(jnp.asarray([0.0, 0.0, 1.0]), position) - self.curvature * position
        return r, dot(r, r)

    def gravity_n(self, position):
        (r, square), w = self.to_centre(position), self.rate_n(position)
        from_axis = cross(w, cross(w, position - column(jnp.asarray([0.0, 0.0, self.radius]), position)))
        return 9.8 * r / square[None] ** 1.5 - from_axis

    def rate_n(self, position):
        return self.turning * column(jnp.asarray(self.rate), position)

    def height(self, position):
        _, square = self.to_centre(position)
        return (self.curvature * dot(position, position) - 2 * position[2]) / (1 + jnp.sqrt(square))


class Ellipsoid(nj.kinematics.AbstractEarth):
    """WGS-84 with normal gravity along the local down (Somigliana, second order in height), about an origin."""

    is_uniform: ClassVar[bool] = False
    is_turning: ClassVar[bool] = True
    is_flat: ClassVar[bool] = False

    origin: jax.Array
    """ECEF."""
    dcm: jax.Array
    """From ECEF to n."""
    level: jax.Array
    """Ellipsoidal height of the origin."""

    def __init__(self, geodetic):
        self.origin = jnp.asarray(ecef_from_geodetic(np.asarray(geodetic)[None])[0])
        self.dcm = jnp.asarray(dcm_ned_from_ecef(geodetic[0], geodetic[1]))
        self.level = jnp.asarray(geodetic[2])

    def geodetic(self, position):
        """Sine and cosine of the latitude, direction of the meridian, and height, by two rounds of Bowring."""
        a, f = 6378137.0, 1 / 298.257223563
        e2, b = f * (2 - f), a * (1 - f)
        x, y, z = jnp.tensordot(self.dcm.T, position, 1) + column(self.origin, position)
        r = jnp.hypot(x, y)
        t = z / (r * (1 - f))  # tangent of the reduced latitude
        for _ in range(2):
            s, c = t / jnp.sqrt(1 + t * t), 1 / jnp.sqrt(1 + t * t)
            tangent = (z + e2 / (1 - e2) * b * s**3) / (r - e2 * a * c**3)
            t = (1 - f) * tangent
        s, c = tangent / jnp.sqrt(1 + tangent**2), 1 / jnp.sqrt(1 + tangent**2)
        return s, c, x / r, y / r, r * c + z * s - a * jnp.sqrt(1 - e2 * s * s)

    def gravity_n(self, position):
        a, f, gm, turn = 6378137.0, 1 / 298.257223563, 3.986004418e14, 7.292115e-5
        equator, pole = 9.7803253359, 9.8321849378
        e2, b = f * (2 - f), a * (1 - f)
        s, c, cl, sl, h = self.geodetic(position)
        k, m = b * pole / (a * equator) - 1, turn**2 * a**2 * b / gm
        surface = equator * (1 + k * s * s) / jnp.sqrt(1 - e2 * s * s)
        g = surface * (1 - 2 / a * (1 + f + m - 2 * f * s * s) * h + 3 * h * h / a**2)
        return jnp.tensordot(self.dcm, -g * jnp.stack([c * cl, c * sl, s]), 1)

    def rate_n(self, position):
        return column(7.292115e-5 * self.dcm[:, 2], position)

    def height(self, position):
        return self.geodetic(position)[4] - self.level
