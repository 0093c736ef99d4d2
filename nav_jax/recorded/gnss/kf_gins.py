"""GNSS files of KF-GINS and of the data sets in its format: numbers in columns, without a header.

Seconds of the GPS week; latitude, longitude in degrees, height above the ellipsoid in m; standard deviations north,
east, down in m; in files of 13 columns then the velocity north, east, down in m/s and its standard deviations.
"""

from pathlib import Path

import numpy as np

from gmwm_jax._internal.stamps import over_weeks
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import text_source
from nav_jax.recorded.gnss.raw import Asked, RawFixes, diagonal
from nav_jax.recorded.gnss.time_scales import WEEK, from_weeks


def read_kf_gins(file: Path, asked: Asked) -> RawFixes:
    """Read a GNSS file of KF-GINS."""
    table = open_text(text_source(file, asked.max_bytes), asked.delimiter, asked.header)
    if table.count not in (7, 13):
        raise ValueError(
            "A GNSS file of KF-GINS has the 7 columns seconds of the week, latitude, longitude, height and three "
            f"standard deviations, or 13 with velocities, and this one has {table.count}."
        )
    values = np.column_stack(table.load(list(range(table.count))))
    seconds = over_weeks(values[:, 0])
    if (seconds < 0).any() or (seconds > 2 * WEEK).any():
        raise ValueError(f"The first column is seconds of the GPS week, and reaches from {seconds.min():g} to "
                         f"{seconds.max():g}.")  # fmt: skip
    has_velocity = table.count == 13
    return RawFixes(
        np.column_stack([np.deg2rad(values[:, 1:3]), values[:, 3]]),
        "geodetic",
        None if asked.week is None else from_weeks(np.full(len(seconds), asked.week), seconds),
        seconds,
        covariance=diagonal(values[:, 4:7]),
        velocity=values[:, 7:10] if has_velocity else None,
        velocity_covariance=diagonal(values[:, 10:13]) if has_velocity else None,
    )
