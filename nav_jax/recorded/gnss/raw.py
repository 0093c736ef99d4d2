"""What the reader of a format hands on, before it is put on a clock and into a local frame; and what it is told."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from nav_jax.recorded.gnss.time_scales import Epochs

Matrices = Float64[np.ndarray, "F 3 3"]


class IncompleteLogWarning(UserWarning):
    """A warning that lines that are corrupt, and fixes that are not whole, were left out."""


class Asked(NamedTuple):
    """What a reader may need beside the file."""

    date: np.datetime64 | None = None
    """Of the first fix, UTC, where the file has times of the day only."""
    week: int | None = None
    """GPS week of the first fix, where the file has seconds of the week only."""
    columns: Mapping[str, int | str] | None = None
    """Of a table."""
    angles: str | None = None
    """Of a table."""
    time_unit: str | None = None
    """Of a table."""
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | None = None
    """To which the file may unfold."""


@dataclass(frozen=True)
class RawFixes:
    """F fixes as a file has them: on the ellipsoid or in a local frame, covariances along `frame`."""

    position: Float64[np.ndarray, "F 3"]
    """Latitude, longitude (rad), height (m); or x, y, z of ECEF in m; or north, east, down in m."""
    frame: str
    """``geodetic`` (covariance and velocity are north, east, down at the fix), ``ecef`` or ``ned``."""
    epochs: Epochs | None = None
    """Instants, where the file knows them."""
    seconds: Float64[np.ndarray, " F"] | None = None
    """Else the seconds that it says, of whatever."""
    covariance: Matrices | None = None
    velocity: Float64[np.ndarray, "F 3"] | None = None
    """NaN in a component that is not there."""
    velocity_covariance: Matrices | None = None
    quality: Int64[np.ndarray, " F"] | None = None
    kinds: Mapping[int, str] = field(default_factory=dict)
    """Quality -> what it means."""
    satellites: Float64[np.ndarray, " F"] | None = None
    age: Float64[np.ndarray, " F"] | None = None
    """Of the corrections, s; NaN where there are none."""
    origin: Float64[np.ndarray, "3"] | None = None
    """Latitude, longitude (rad), height (m) about which a local frame lies, where the file says it."""
    height: str = "ellipsoid"
    """Above which heights are: ``ellipsoid`` or ``geoid``."""


def signed_covariance(sd: Float64[np.ndarray, "F 6"]) -> Matrices:
    """Covariances from three standard deviations and the signed roots of the covariances ab, bc, ca."""
    C = np.empty((len(sd), 3, 3))
    for i in range(3):
        C[:, i, i] = sd[:, i] ** 2
    for (i, j), root in zip(((0, 1), (1, 2), (2, 0)), sd[:, 3:].T, strict=True):
        C[:, i, j] = C[:, j, i] = np.sign(root) * root**2
    return C


def diagonal(sd: Float64[np.ndarray, "F 3"]) -> Matrices:
    """Covariances of components that are independent."""
    return sd[:, :, None] ** 2 * np.eye(3)


def turned(matrix: np.ndarray, C: Matrices) -> Matrices:
    """Covariances along other axes."""
    return matrix @ C @ np.swapaxes(matrix, -1, -2)


ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Takes east, north, up to north, east, down; and north, east, down to east, north, up."""

NEU = np.diag([1.0, 1.0, -1.0])
"""Takes north, east, up to north, east, down."""
