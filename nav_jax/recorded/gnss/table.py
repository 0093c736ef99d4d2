"""Fixes from tables with named columns: CSV and everything else that the reader of tables opens.

Positions are latitude, longitude, height; or north, east, down; or east, north, up; or ECEF x, y, z. There may be
standard deviations, a velocity (down or up) with its own, a quality and a number of satellites.
"""

from pathlib import Path

import numpy as np

from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_source
from nav_jax.recorded.gnss.raw import ENU, Asked, RawFixes, diagonal
from nav_jax.recorded.gnss.time_scales import from_calendar
from nav_jax.trajectory.columns import (
    ECEF,
    LOCAL_UP,
    POSITION,
    POSITION_SD,
    VELOCITY,
    VELOCITY_SD,
    VELOCITY_UP,
    Reader,
    present,
)

_FRAMES = {
    "geodetic": (POSITION["geodetic"],),
    "ned": (POSITION["ned"], LOCAL_UP),
    "ecef": (ECEF,),
}
"""Frame -> the columns that may state a position in it."""

_QUANTITIES = tuple(
    dict.fromkeys(
        ("time", *(q for sets in _FRAMES.values() for names in sets for q in names), *POSITION_SD, *VELOCITY,
         *VELOCITY_UP, *VELOCITY_SD, "quality", "satellites")
    )
)  # fmt: skip


def read_table(file: Path, asked: Asked) -> RawFixes:
    """Read a table of fixes by the names of its columns."""
    table = open_source(file, Reading(asked.delimiter, asked.header, asked.variable, max_bytes=asked.max_bytes))
    if table.names is None and not asked.columns:
        raise ValueError(
            f"The {table.count} columns have no names: tell them, as in columns={{'time': 0, 'latitude': 1, ...}}."
        )
    at = present(table, asked.columns or {}, _QUANTITIES)
    frame, names = _position(at, table.names)
    velocity = next((v for v in (VELOCITY, VELOCITY_UP) if set(v) <= set(at)), None)
    read = Reader(table, at, asked.angles, asked.time_unit)
    position = read.three(names)
    down = ENU if names[-1] == "up" else np.eye(3)
    time = read.values["time"]
    is_stamp = time.dtype.kind == "M"
    return RawFixes(
        position @ down.T,
        frame,
        _stamps(time) if is_stamp else None,
        None if is_stamp else read.time(),
        covariance=diagonal(read.three(POSITION_SD)) if set(POSITION_SD) <= set(at) else None,
        velocity=None if velocity is None else read.three(velocity) * [1, 1, -1 if velocity is VELOCITY_UP else 1],
        velocity_covariance=diagonal(read.three(VELOCITY_SD)) if set(VELOCITY_SD) <= set(at) else None,
        quality=_whole(read.values["quality"]) if "quality" in at else None,
        satellites=np.asarray(read.values["satellites"], dtype=float) if "satellites" in at else None,
    )


def _position(at: dict[str, int], written: tuple[str, ...] | None) -> tuple[str, tuple[str, ...]]:
    fits = [(frame, names) for frame, sets in _FRAMES.items() for names in sets if set(names) <= set(at)]
    if len({frame for frame, _ in fits}) == 1:
        return fits[0]
    known = "; ".join(", ".join(names) for sets in _FRAMES.values() for names in sets)
    seen = "without names" if written is None else f"called {', '.join(written)}"
    found = f"those of {len(fits)} kinds of position are" if fits else "no position is"
    raise ValueError(
        f"Among the columns {seen}, {found} found. A position is one of: {known}. Tell them by columns=..."
    )


def _stamps(time: np.ndarray):
    """UTC."""
    moments = time.astype("datetime64[ns]")
    days = moments.astype("datetime64[D]")
    return from_calendar(days, (moments - days) / np.timedelta64(1, "s"), "UTC")


def _whole(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iuf" or (values != np.rint(values)).any():
        raise ValueError("The column of quality holds whole numbers, one a kind of fix.")
    return values.astype(np.int64)
