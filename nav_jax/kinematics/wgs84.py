r"""The ellipsoid WGS-84 that turns, with normal gravity, in the frame n that is fixed to it at an origin.

Somigliana's closed form on the ellipsoid, and above it an expansion to the second order in the height h (Moritz 2000;
NGA.STND.0036), w^2 = 1 - e^2 sin^2(lat):

    gamma(lat, h) = gamma_e (1 + k sin^2(lat))/w (1 - 2/a (1 + f + m - 2 f sin^2(lat)) h + 3 h^2/a^2)

along the normal of the ellipsoid, centrifugal acceleration included. What is left out: the next term, 1.2e-6 m/s^2 at
20 km, and the north component of normal gravity, 8e-9 h sin(2 lat) m/s^2, 1e-4 m/s^2 at 12 km.

The normal comes without an angle. Let R be the vector from the centre of the Earth, z its component along the axis and
s the one across. Bowring's (1976) step from the reduced latitude beta with tan(beta) = a z/(b s) says of the latitude

    tan(lat) = (z + e'^2 b sin^3(beta))/(s - e^2 a cos^3(beta)) = m z/(k s),
    m = 1 + e'^2 a^3 b z^2/D^3,   k = 1 - e^2 a b^3 s^2/D^3,   D^2 = a^2 z^2 + b^2 s^2

Hence the normal is that of k (R - z axis) + m z axis, which is smooth at the poles, on the axis, at the date line, and
so are its derivatives: no `where`, nothing that a gradient could trip over. It is exact on the ellipsoid, and 2e-12 rad
off at 20 km.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from gmwm_jax._internal.checks import concrete
from gmwm_jax._internal.host import namespace
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Vector
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.kinematics.geodetic import (
    E2,
    EP2,
    A,
    B,
    F,
    checked_origin,
    dcm_ned_from_ecef,
    ecef_from_geodetic,
    geodetic_from_ned,
)
from nav_jax.kinematics.rotation import dot

RATE = 7.292115e-5
"""Of the Earth, rad/s."""

_GM = 3.986004418e14
_EQUATOR, _POLE = 9.7803253359, 9.8321849378
"""Normal gravity on the ellipsoid, m/s^2."""
_LOWEST, _HIGHEST = -15e3, 100e3
"""m, where the expansion is good to 2e-4 m/s^2."""

_ONE_POINT = 1e-3
"""m between two statements of one origin."""

_K = B * _POLE / (A * _EQUATOR) - 1
_M = RATE**2 * A**2 * B / _GM


def normal_gravity(square: Any, height: Any) -> Any:
    """Magnitude of normal gravity in m/s^2 on and above WGS-84.

    Parameters
    ----------
    square
        Of the sine of the latitude; a number or an array of any kind.
    height
        Above the ellipsoid, m.

    Examples
    --------
    >>> round(normal_gravity(0.5, 0.0), 6)  # at 45 deg
    9.806199
    """
    xp = namespace(square, height)
    surface = _EQUATOR * (1 + _K * square) / xp.sqrt(1 - E2 * square)
    return surface * (1 - 2 / A * (1 + F + _M - 2 * F * square) * height + 3 / A**2 * height * height)


class Wgs84(AbstractEarth):
    """The Earth as it is: an ellipsoid that turns, with normal gravity, about an origin.

    Positions are north, east, down of the origin, along axes that stay straight and fixed to the Earth: at a distance d
    they are tilted against the local ones by d/R, 1.6 mrad in 10 km. Errors of runs and covariances are judged along
    the local axes at the reference; `local` has the matrix between them.

    Parameters
    ----------
    origin
        Latitude, longitude (rad) and height above the ellipsoid (m) of the point where positions are zero.

    Raises
    ------
    ValueError
        No place on the Earth: angles in deg, a height that nothing near the Earth has.

    Examples
    --------
    >>> earth = nj.Wgs84(np.deg2rad([46.5, 6.6, 0.0]) + [0.0, 0.0, 500.0])
    >>> round(float(earth.gravity_n(jnp.zeros(3))[2]), 5)  # down
    9.80601
    """

    is_uniform: ClassVar[bool] = False
    is_turning: ClassVar[bool] = True
    is_flat: ClassVar[bool] = False
    # what is left out in d metres is 3 g (d/a)^2 at most: 7e-9 m/s^2 in 100 m, 7e-6 in the 3 km of an aircraft
    is_vast: ClassVar[bool] = True

    origin: Float[Array, "3"]
    axis: Float[Array, "3"]
    """Of the rotation, a unit vector in n."""
    centre: Float[Array, "3"]
    """Vector from the centre of the Earth to the origin, in n, m."""

    def __init__(self, origin: Any) -> None:
        known = concrete(origin) if not isinstance(origin, list | tuple) else origin
        point = jnp.asarray(origin) if known is None else checked_origin(known)
        xp = jnp if known is None else np
        sine, cosine = xp.sin(point[0]), xp.cos(point[0])
        normal = A / (1 - E2 * sine**2) ** 0.5
        across, along = (normal + point[2]) * cosine, (normal * (1 - E2) + point[2]) * sine
        zero = 0.0 * sine
        self.origin = jnp.asarray(point)
        self.axis = jnp.asarray(xp.stack([cosine, zero, -sine]))
        self.centre = jnp.asarray(xp.stack([along * cosine - across * sine, zero, -along * sine - across * cosine]))

    def gravity_n(self, position: Vector) -> Vector:  # noqa: D102
        up, square, height = self._normal(position)
        return -normal_gravity(square, height)[None] * up

    def gradient_n(self, position: Vector) -> Array:
        """In closed form, which costs a tenth of a derivative by the position.

        With the radii M of the meridian and N across, the normal u turns by north north'/(M + h) + east east'/(N + h).
        In a = axis - sin(lat) u, which is cos(lat) towards the north, that is (1 - u u')/(N + h) + c a a' with
        c = (1/(M + h) - 1/(N + h))/cos^2(lat) = N e'^2/(w^2 (M + h) (N + h)), e'^2 = e^2 as N - M = N e^2 cos^2/w^2.
        """
        up, square, height = self._normal(position)
        axis = _column(self.axis, position)
        sine = dot(up, axis)
        a = axis - sine[None] * up
        w2 = 1 - E2 * square
        N = A / jnp.sqrt(w2)
        of_meridian, across = N * (1 - E2) / w2 + height, N + height
        gamma = normal_gravity(square, height)
        surface, one = normal_gravity(square, jnp.zeros_like(height)), 1 + F + _M - 2 * F * square
        by_height = surface * (-2 / A * one + 6 / A**2 * height)
        # along the latitude, without the change of the decrease with height
        along = gamma * (_K / (1 + _K * square) + E2 / (2 * w2)) + surface * (4 * F / A) * height
        by_place = by_height[None] * up + (along * 2 * sine / of_meridian)[None] * a
        turned = gamma * N * E2 / (w2 * of_meridian * across)
        unit = jnp.eye(3).reshape((3, 3) + (1,) * (position.ndim - 1))
        pairs = up[:, None] * up[None]
        level = (gamma / across)[None, None] * (unit - pairs) + turned[None, None] * (a[:, None] * a[None])
        return -level - up[:, None] * by_place[None]

    def rate_n(self, position: Vector) -> Vector:  # noqa: D102
        return jnp.broadcast_to(_column(RATE * self.axis, position), position.shape)

    def height(self, position: Vector) -> Float[Array, "..."]:  # noqa: D102
        return self._normal(position)[2] - self.origin[2]

    def _normal(self, position: Vector) -> tuple[Vector, Float[Array, "..."], Float[Array, "..."]]:
        """The unit normal up at a position, the square of the sine of the latitude, and the ellipsoidal height."""
        axis = _column(self.axis, position)
        R = position + _column(self.centre, position)
        z = dot(axis, R)
        across = R - z[None] * axis
        s2, z2 = dot(across, across), z * z
        inverse = 1 / jnp.sqrt(A**2 * z2 + B**2 * s2)
        cubed = inverse * inverse * inverse
        normal = (1 - E2 * A * B**3 * s2 * cubed)[None] * across
        normal = normal + (z * (1 + EP2 * A**3 * B * z2 * cubed))[None] * axis
        up = normal * (1 / jnp.sqrt(dot(normal, normal)))[None]
        square = dot(up, axis) ** 2
        return up, square, dot(up, R) - A * jnp.sqrt(1 - E2 * square)

    def check(self, position: Float[np.ndarray, "N 3"], origin: Float[np.ndarray, "3"] | None) -> None:  # noqa: D102
        own = concrete(self.origin)
        if own is None:
            return
        if origin is not None:
            apart = float(np.linalg.norm(np.subtract(*ecef_from_geodetic(np.stack([own, origin])))))
            if apart > _ONE_POINT:
                raise ValueError(
                    f"Positions are about the origin {_place(origin)}, and the Earth is about {_place(own)}, "
                    f"{apart:.6g} m away: give both the same, as Wgs84(trajectory.origin) has it."
                )
        height = geodetic_from_ned(position, own)[:, 2]
        off = np.maximum(height - _HIGHEST, _LOWEST - height)
        i = int(np.argmax(off))
        if off[i] > 0:
            raise ValueError(
                f"At index {i} a position is {height[i]:.6g} m above the ellipsoid, and normal gravity is known from "
                f"{_LOWEST:g} to {_HIGHEST:g} m: are they north, east, down in m of the origin {_place(own)}?"
            )

    def local(self, position: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N 3 3"]:
        """The matrices that take vectors in n to the local north, east, down at positions in n (m), by NumPy.

        Examples
        --------
        >>> earth = nj.Wgs84(np.deg2rad([46.5, 6.6, 0.0]))
        >>> tilted = earth.local(np.array([[10e3, 0.0, 0.0]]))[0] @ [0.0, 0.0, 1.0]  # 10 km to the north
        >>> tilted.round(5).tolist()
        [0.00157, 0.0, 1.0]
        """
        origin = np.asarray(self.origin)
        lat, lon, _ = geodetic_from_ned(position, origin).T
        return dcm_ned_from_ecef(lat, lon) @ dcm_ned_from_ecef(origin[0], origin[1]).T

    def __repr__(self) -> str:
        origin = concrete(self.origin)
        return f"Wgs84(origin={'traced' if origin is None else _place(origin)})"


def _place(origin: Float[np.ndarray, "3"]) -> str:
    lat, lon = np.rad2deg(origin[:2])
    return f"{lat:.8f} deg, {lon:.8f} deg, {origin[2]:.3f} m"


def _column(vector: Float[Array, "3"], like: Vector) -> Vector:
    """A vector as one of each run."""
    return vector.reshape((3,) + (1,) * (like.ndim - 1))


class _State(NamedTuple):
    origin: Float[np.ndarray, "3"]


register(Wgs84, _State, lambda earth: _State(np.asarray(earth.origin)), lambda state: Wgs84(state.origin))
