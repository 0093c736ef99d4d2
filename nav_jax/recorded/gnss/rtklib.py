"""Solutions of RTKLIB, ``.pos``: all of its formats of time and position, with covariances, velocity, quality and age.

A line that begins with % and names the columns tells the format. Time is a date and time of the day or a week and
seconds, in GPST, UTC or JST; the position latitude, longitude (in degrees, or in degrees, minutes, seconds) and height,
or ECEF x, y, z, or the baseline east, north, up from a reference that the header may name. Standard deviations are
followed by signed roots of covariances (RTKLIB 2.4.2 manual, appendix B.1).
"""

import re
from pathlib import Path

import numpy as np

from gmwm_jax._internal.text_source import numbered_lines
from nav_jax.recorded.gnss.raw import ENU, NEU, Asked, RawFixes, signed_covariance, turned
from nav_jax.recorded.gnss.time_scales import Epochs, from_calendar, from_weeks

KINDS = {1: "fix", 2: "float", 3: "sbas", 4: "dgps", 5: "single", 6: "ppp"}

_POSITIONS = {
    "latitude": ("geodetic", ("latitude", "longitude", "height")),
    "x-ecef": ("ecef", ("x-ecef", "y-ecef", "z-ecef")),
    "e-baseline": ("ned", ("e-baseline", "n-baseline", "u-baseline")),
}
"""First name of a position -> the frame of it, and all its names."""

_TO_NED = {"geodetic": NEU, "ecef": np.eye(3), "ned": ENU}
"""From the axes of standard deviations and velocities: north, east, up; ECEF; east, north, up."""

_BETWEEN = str.maketrans("/:,;\t", "     ")


def read_rtklib(file: Path, asked: Asked) -> RawFixes:
    """Read a solution of RTKLIB."""
    head, numbers, rows = _lines(file)
    names = _names(head)
    scale, frame, labels = names[0].upper(), *_position(names)
    dms = any(re.search(r"latitude\(d'", line) for line in head)
    # a date with its time has six numbers, a week with its seconds two
    others = len(names) - 1 + (4 if dms else 0)
    width = len(rows[0])
    if width - others not in (2, 6):
        raise ValueError(
            f"Line {numbers[0]} has {width} numbers, and the header names {len(names) - 1} columns behind the time."
        )
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != width:
            raise ValueError(f"Line {number} has {len(row)} numbers, and the first line of data {width}.")
    table = np.array(rows)
    time, rest = table[:, : width - others], table[:, width - others :]
    epochs = from_weeks(time[:, 0], time[:, 1], scale) if time.shape[1] == 2 else _dates(time, scale)
    if dms:
        rest = np.column_stack([_degrees(rest[:, :3]), _degrees(rest[:, 3:6]), rest[:, 6:]])
    at = {name: i for i, name in reversed(list(enumerate(names[1:])))}
    if any(label not in at for label in labels):
        raise ValueError(f"The header names the columns {', '.join(names)}; a position is {', '.join(labels)}.")
    position = rest[:, [at[label] for label in labels]]
    to_ned = _TO_NED[frame]
    if frame == "geodetic":
        position = np.column_stack([np.deg2rad(position[:, :2]), position[:, 2]])
    elif frame == "ned":
        position = position @ to_ned.T
    velocity = next((a for a in ("vn", "vx", "ve") if a in at), None)
    return RawFixes(
        position,
        frame,
        epochs,
        covariance=_covariance(rest, names[1:], "sd" + {"geodetic": "n", "ecef": "x", "ned": "e"}[frame], to_ned),
        velocity=None if velocity is None else rest[:, at[velocity] : at[velocity] + 3] @ to_ned.T,
        velocity_covariance=None if velocity is None else _covariance(rest, names[1:], f"sd{velocity}", to_ned),
        quality=rest[:, at["q"]].astype(np.int64) if "q" in at else None,
        kinds=KINDS,
        satellites=rest[:, at["ns"]] if "ns" in at else None,
        age=rest[:, at["age"]] if "age" in at else None,
        origin=_reference(head) if frame == "ned" else None,
        height="geoid" if any("/geodetic," in line for line in head) else "ellipsoid",
    )


def _lines(file: Path) -> tuple[list[str], list[int], list[list[float]]]:
    """The header, and of each line of data its number and its numbers."""
    head, numbers, rows = [], [], []
    with file.open(encoding="latin-1") as stream:
        for number, line in numbered_lines(stream):
            if line.startswith("%"):
                head.append(line)
            elif fields := line.translate(_BETWEEN).split():
                try:
                    rows.append([float(f) for f in fields])
                except ValueError as error:
                    raise ValueError(f"Line {number} is no line of numbers: {line.strip()!r}.") from error
                numbers.append(number)
    if not rows:
        raise ValueError("The file holds no fix.")
    return head, numbers, rows


def _names(head: list[str]) -> list[str]:
    """Names of the columns without their units, in lower case; the first is the time scale."""
    for line in reversed(head):
        names = re.sub(r"\([^)]*\)", " ", line.lstrip("% ").replace(",", " ").replace(";", " ")).lower().split()
        if names and names[0] in ("gpst", "utc", "jst"):
            return names
    raise ValueError(
        "There is no line of column names such as '%  GPST  latitude(deg) ...', by which a solution of RTKLIB says "
        "what it holds: write it with its header."
    )


def _position(names: list[str]) -> tuple[str, tuple[str, ...]]:
    for first, (frame, labels) in _POSITIONS.items():
        if first in names:
            return frame, labels
    raise ValueError(f"The header names the columns {', '.join(names)}, and none of them is a position.")


def _covariance(rest: np.ndarray, names: list[str], first: str, to_ned: np.ndarray) -> np.ndarray | None:
    """From six columns, of which the first has this name."""
    if first not in names:
        return None
    at = names.index(first)
    sd = rest[:, at : at + 6]
    return turned(to_ned, signed_covariance(sd)) if sd.shape[1] == 6 else None


def _dates(time: np.ndarray, scale: str) -> Epochs:
    """Year, month, day, hour, minute, second."""
    year, month, day = (time[:, i].astype(np.int64) for i in range(3))
    months = (year - 1970) * 12 + month - 1
    dates = months.astype("datetime64[M]").astype("datetime64[D]") + (day - 1)
    return from_calendar(dates, time[:, 3] * 3600 + time[:, 4] * 60 + time[:, 5], scale)


def _degrees(dms: np.ndarray) -> np.ndarray:
    """Of degrees, minutes, seconds; the sign is that of the degrees, also of -0."""
    size = np.abs(dms[:, 0]) + dms[:, 1] / 60 + dms[:, 2] / 3600
    return np.where(np.signbit(dms[:, 0]), -size, size)


def _reference(head: list[str]) -> np.ndarray | None:
    """The reference of a baseline, if the header names one that it knows."""
    for line in head:
        if re.match(r"%\s*ref pos\s*:", line):
            found = [float(f) for f in re.findall(r"[-+]?\d+(?:\.\d*)?", line.partition(":")[2])]
            if len(found) == 7:  # degrees, minutes, seconds
                pair = _degrees(np.array([found[:3], found[3:6]]))
                found = [*pair, found[6]]
            if len(found) == 3 and abs(found[0]) <= 90:
                return np.array([*np.deg2rad(found[:2]), found[2]])
    return None
