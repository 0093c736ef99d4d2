"""Fixes from tables with named columns: CSV and everything else that the reader of tables opens.

Positions are latitude, longitude, height; or north, east, down; or east, north, up; or ECEF x, y, z. There may be
standard deviations, a velocity (down or up) with its own, a quality and a number of satellites. Times are seconds, or
texts of UTC. Rows without a position, and those that have latitude and longitude 0, as receivers write before they have
one, are no fixes and are left out with a warning.
"""

from pathlib import Path

import numpy as np

from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import unwrapped
from gmwm_jax._internal.tabular import open_source
from nav_jax.recorded.gnss.raw import ENU, Asked, RawFixes, diagonal
from nav_jax.recorded.gnss.time_scales import DAY, Epochs, from_calendar
from nav_jax.recorded.missing import rows_of_fixes
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
    if "time" not in at:
        seen = "" if table.names is None else f" among {', '.join(table.names)}"
        raise ValueError(f"No column is found for time{seen}: name it as in columns={{'time': ...}}.")
    velocity = next((v for v in (VELOCITY, VELOCITY_UP) if set(v) <= set(at)), None)
    read = Reader(table, at, asked.angles, asked.time_unit)
    read.values = rows_of_fixes(read.values, names)
    position = read.three(names)
    down = ENU if names[-1] == "up" else np.eye(3)
    epochs = _epochs(read.values["time"], asked.date)
    speeds = None if velocity is None else read.three(velocity, missing=True)
    return RawFixes(
        position @ down.T,
        frame,
        epochs,
        read.time() if epochs is None else None,
        covariance=diagonal(read.three(POSITION_SD)) if set(POSITION_SD) <= set(at) else None,
        velocity=None if speeds is None else speeds * [1, 1, -1 if velocity is VELOCITY_UP else 1],
        velocity_covariance=diagonal(read.three(VELOCITY_SD, missing=True)) if set(VELOCITY_SD) <= set(at) else None,
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


def _epochs(time: np.ndarray, date: np.datetime64 | None) -> Epochs | None:
    """Instants of UTC; None of numbers, and of times of a day that nobody tells."""
    if time.dtype.kind == "M":
        moments = time.astype("datetime64[ns]")
        days = moments.astype("datetime64[D]")
        return from_calendar(days, (moments - days) / np.timedelta64(1, "s"), "UTC")
    if time.dtype.kind == "m" and date is not None:
        of_day = unwrapped(time / np.timedelta64(1, "s"), DAY)
        return from_calendar(np.full(len(time), date), of_day, "UTC")
    return None


def _whole(values: np.ndarray) -> np.ndarray:
    if values.dtype.kind not in "iuf" or (values != np.rint(values)).any():
        raise ValueError("The column of quality holds whole numbers, one a kind of fix.")
    return values.astype(np.int64)
