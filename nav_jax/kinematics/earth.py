"""The Earth: what the mechanisation asks of it, and WGS-84 coordinates for the readers.

The frame n is fixed to the Earth: north, east and down at an origin, and straight axes from there, however far. In it
position, velocity and attitude of a body with specific force f and body rate omega in b follow

    p' = v,   v' = C f + g(p) - 2 w x v,   C' = C [omega x] - [w x] C

with gravity g, which contains the centrifugal acceleration and whose magnitude and direction go with the position, and
the rotation vector w of the Earth, which is constant in n (Groves 2013, sec. 5.5). This holds at every distance and on
every latitude; there is no transport rate. On a curved Earth the axes are level at the origin only.

The mechanisation, the perfect IMU, the truth and the error model ask the Earth of a scenario. `FlatEarth` answers with
constants, and says so: what is trivial is then not in the loops at all. One more Earth is one class derived from
`AbstractEarth`.
"""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import FloatLike, Scalar, Vector, Vectors
from gmwm_jax.units import STANDARD_GRAVITY

_A = 6378137.0
_F = 1 / 298.257223563
_B = _A * (1 - _F)
_E2 = _F * (2 - _F)
_EP2 = _E2 / (1 - _E2)

Geodetic = Float64[np.ndarray, "3"]


class AbstractEarth(eqx.Module):
    """What mechanisation, error model and aiding sensors ask of an Earth, at a position in n, (3, ...) m."""

    is_uniform: eqx.AbstractClassVar[bool]
    """Whether gravity is the same everywhere."""
    is_turning: eqx.AbstractClassVar[bool]
    """Whether the rotation vector is not zero."""
    is_flat: eqx.AbstractClassVar[bool]
    """Whether the height is minus the third component of a position."""

    @abc.abstractmethod
    def gravity_n(self, position: Vector) -> Vector:
        """Gravity in n, centrifugal acceleration included, (3, ...) m/s^2."""

    @abc.abstractmethod
    def rate_n(self, position: Vector) -> Vector:
        """The rotation vector of the Earth, and so of n, in n, (3, ...) rad/s: the same at all positions."""

    @abc.abstractmethod
    def height(self, position: Vector) -> Float[Array, "..."]:
        """Height above the surface through the origin of n, (...) m."""


@saved()
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

    is_uniform: ClassVar[bool] = True
    is_turning: ClassVar[bool] = False
    is_flat: ClassVar[bool] = True

    gravity: Scalar

    def __init__(self, gravity: FloatLike = STANDARD_GRAVITY) -> None:
        positive("gravity", gravity, zero_ok=True)
        self.gravity = as_float(gravity)

    def gravity_n(self, position: Vector) -> Vector:  # noqa: D102
        zero = jnp.zeros_like(position[0])
        return jnp.stack([zero, zero, zero + self.gravity])

    def rate_n(self, position: Vector) -> Vector:  # noqa: D102
        return jnp.zeros_like(position)

    def height(self, position: Vector) -> Float[Array, "..."]:  # noqa: D102
        return -position[2]

    def __repr__(self) -> str:
        gravity = concrete(self.gravity)
        return f"FlatEarth(gravity={'traced' if gravity is None else f'{float(gravity):.9g}'})"


class EarthInLoops(eqx.Module):
    """An Earth as loops ask for it: what is constant is computed before them, and what is trivial is None."""

    earth: AbstractEarth
    constant: Float[Array, "3 1"] | None
    """Gravity, m/s^2, in n; None where it depends on the position."""
    rate: Float[Array, "3 1"] | None
    """Rotation vector, rad/s, in n; None where the Earth does not turn."""

    def __init__(self, earth: AbstractEarth) -> None:
        origin = jnp.zeros((3, 1))
        self.earth = earth
        self.constant = earth.gravity_n(origin) if earth.is_uniform else None
        self.rate = earth.rate_n(origin) if earth.is_turning else None

    def gravity(
        self, position: Float[Array, "3 R"], velocity: Float[Array, "3 R"], dt: Float[Array, ""]
    ) -> Float[Array, "3 #R"]:
        """In n, in the middle of a step that begins there; of R runs, or one for all of them."""
        return self.earth.gravity_n(position + dt / 2 * velocity) if self.constant is None else self.constant

    def gradient(self, position: Float[Array, "3 R"]) -> Float[Array, "3 3 R"] | None:
        """Derivative of gravity by the position, component first, in 1/s^2; None where gravity is uniform."""
        if self.constant is not None:
            return None
        along = [jnp.zeros_like(position).at[i].set(1.0) for i in range(3)]
        return jnp.stack([jax.jvp(self.earth.gravity_n, (position,), (e,))[1] for e in along], axis=1)


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
