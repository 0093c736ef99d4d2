"""Tracks in GPX 1.0 and 1.1 (https://www.topografix.com/GPX/1/1/): points with latitude, longitude, elevation and UTC.

Elevations are as the file has them, which most receivers write above the geoid; with ``geoidheight`` they become
heights above the ellipsoid. The format knows no standard deviations.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from nav_jax.recorded.gnss.raw import Asked, RawFixes
from nav_jax.recorded.gnss.time_scales import from_calendar

_KINDS = {0: "none", 2: "2d", 3: "3d", 4: "dgps", 5: "pps"}


def read_gpx(file: Path, asked: Asked) -> RawFixes:
    """Read the points of all tracks of a GPX file, one after the other."""
    try:
        with file.open("rb") as stream:
            points = [p for _, p in ET.iterparse(stream) if _name(p) == "trkpt"]
    except ET.ParseError as error:
        raise ValueError(f"This is no GPX file, or it is cut off: {error}.") from error
    if not points:
        raise ValueError("The file holds no point of a track (trkpt).")
    rows, instants, quality = [], [], []
    for i, point in enumerate(points, start=1):
        inside = {_name(child): (child.text or "").strip() for child in point}
        if missing := [name for name in ("ele", "time") if not inside.get(name)]:
            raise ValueError(f"Point {i} has no {' and no '.join(missing)}: fixes have a time and three coordinates.")
        rows.append([float(point.attrib["lat"]), float(point.attrib["lon"]), float(inside["ele"]),
                     float(inside.get("geoidheight") or "nan")])  # fmt: skip
        instants.append(_instant(inside["time"], i))
        quality.append(next((k for k, name in _KINDS.items() if name == inside.get("fix")), -1))
    lat, lon, elevation, undulation = np.array(rows).T
    above_ellipsoid = bool(np.isfinite(undulation).all())
    moments = np.array(instants)
    days = moments.astype("datetime64[D]")
    return RawFixes(
        np.column_stack([np.deg2rad(lat), np.deg2rad(lon), elevation + (undulation if above_ellipsoid else 0.0)]),
        "geodetic",
        from_calendar(days, (moments - days) / np.timedelta64(1, "s"), "UTC"),
        quality=None if min(quality) < 0 else np.array(quality, dtype=np.int64),
        kinds=_KINDS,
        height="ellipsoid" if above_ellipsoid else "geoid",
    )


def _name(element: ET.Element) -> str:
    """Without the namespace, which differs between versions."""
    return element.tag.rpartition("}")[2]


def _instant(text: str, point: int) -> np.datetime64:
    """UTC, in microseconds."""
    if not text.endswith(("Z", "+00:00")):
        raise ValueError(f"Point {point} has the time {text!r}, and times of GPX are UTC and end in Z.")
    try:
        return np.datetime64(text.removesuffix("Z").removesuffix("+00:00"), "us")
    except ValueError as error:
        raise ValueError(f"Point {point} has the time {text!r}, which is none.") from error
