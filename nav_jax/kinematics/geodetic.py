"""Coordinates on WGS-84 for readers and writers: geodetic, Earth-centred, and those of the tangent frame at an origin.

Latitude and longitude are in rad and the height is that above the ellipsoid in m; all by NumPy in float64.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import real_array
from gmwm_jax._internal.typing import Real, Vectors

A = 6378137.0
"""Semi-major axis, m (NGA.STND.0036, as all that follows from it)."""
F = 1 / 298.257223563
B = A * (1 - F)
E2 = F * (2 - F)
"""Square of the eccentricity."""
EP2 = E2 / (1 - E2)
"""Square of the second eccentricity."""

_DEEPEST, _HIGHEST = -15e3, 5e7
"""m: below every ocean, and above every satellite of a navigation system."""

_WHOLE = 1e5
"""deg: 360 deg taken for rad are 2e4."""

_FAR = 500e3
"""m from an origin to the nearest position, of one that is none of the record's."""

Geodetic = Float64[np.ndarray, "3"]


class FarOriginWarning(UserWarning):
    """A warning that all positions are far from the origin of their frame."""


def checked_origin(origin: Sequence[Real] | np.ndarray) -> Geodetic:
    """Latitude, longitude (rad) and height (m) of an origin as an array; a ValueError if they are none on the Earth."""
    point = real_array("The origin (latitude, longitude in rad, height in m)", origin, (3,))
    stated = f"The origin is latitude and longitude in rad and height in m, and is {point.tolist()}"
    if abs(point[0]) > np.pi / 2 or abs(point[1]) > 2 * np.pi:
        raise ValueError(f"{stated}: are the angles in deg? np.deg2rad converts them.")
    if not _DEEPEST <= point[2] <= _HIGHEST:
        raise ValueError(f"{stated}: no place at or near the Earth has that height.")
    return point


def check_geodetic(geodetic: Vectors) -> None:
    """Raise a ValueError where latitudes, longitudes (rad) and heights (m), shape (N, 3), are none near the Earth."""
    latitude, longitude = np.rad2deg(np.abs(geodetic[:, :2]).max(axis=0, initial=0.0))
    for name, reached, most in (("Latitudes", latitude, 90.0), ("Longitudes", longitude, 360.0)):
        if reached > most * (1 + 1e-9):
            mistaken = (
                "are they whole numbers of 1e-7 deg, as receivers write them? Divide them by 1e7."
                if reached > _WHOLE
                else 'are they in deg and taken for rad? Where angles="deg" or "rad" is stated, it is wrong.'
            )
            raise ValueError(
                f"{name} reach {np.deg2rad(reached):.6g} rad, {reached:g} deg, and the most is {most:g} deg: {mistaken}"
            )
    off = np.flatnonzero((geodetic[:, 2] < _DEEPEST) | (geodetic[:, 2] > _HIGHEST))
    if len(off):
        raise ValueError(
            f"At index {off[0]} a height is {geodetic[off[0], 2]:.6g} m above the ellipsoid, and no place at or near "
            "the Earth has that: its unit is another, or the position is none."
        )


def warn_of_far_origin(ned: Vectors, *, stacklevel: int = 3) -> None:
    """Warn where even the nearest of some positions (N, 3) in m is far from the origin of n."""
    nearest = float(np.linalg.norm(ned, axis=1).min(initial=np.inf))
    if _FAR < nearest < np.inf:
        warnings.warn(
            f"The nearest position is {nearest / 1e3:.4g} km from the origin, and the axes of n, which are level at "
            f"the origin, are tilted by {np.rad2deg(nearest / A):.3g} deg there: attitudes and velocities are along "
            "them. Is it the origin of another record? Take one near this one.",
            FarOriginWarning,
            stacklevel=stacklevel,
        )


def ecef_from_geodetic(geodetic: Vectors) -> Vectors:
    """Earth-centred Earth-fixed x, y, z in m of latitude, longitude (rad) and ellipsoidal height (m) on WGS-84."""
    lat, lon, height = geodetic.T
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    r = (n + height) * np.cos(lat)
    return np.stack([r * np.cos(lon), r * np.sin(lon), (n * (1 - E2) + height) * np.sin(lat)], axis=1)


def geodetic_from_ecef(ecef: Vectors) -> Vectors:
    """Latitude, longitude (rad) and height (m) on WGS-84, by Bowring's (1976) iteration.

    Two rounds are exact to rounding from -10 km to far above every aircraft; the third is for satellites.
    """
    x, y, z = ecef.T
    r = np.hypot(x, y)
    lat = np.arctan2(z, (1 - E2) * r)
    for _ in range(3):
        reduced = np.arctan2((1 - F) * np.sin(lat), np.cos(lat))
        lat = np.arctan2(z + EP2 * B * np.sin(reduced) ** 3, r - E2 * A * np.cos(reduced) ** 3)
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    # along the normal: well conditioned from the equator to the poles
    height = r * np.cos(lat) + z * np.sin(lat) - A * A / n
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
