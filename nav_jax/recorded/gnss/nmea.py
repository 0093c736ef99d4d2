"""NMEA 0183 sentences: GGA (position, quality), GST (deviations), RMC (date, velocity), ZDA (date).

Sentences of one time of the day are one fix. Heights are altitude plus geoid separation. Dates come from RMC or ZDA,
and count on over midnight. Sentences with a wrong checksum are left out, and so are, where the log has standard
deviations, fixes without them (as the first of a log that begins in the middle); a warning counts both.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.text_source import numbered_lines
from nav_jax.recorded.gnss.raw import Asked, IncompleteLogWarning, RawFixes, diagonal
from nav_jax.recorded.gnss.time_scales import DAY, from_calendar

KINDS = {1: "single", 2: "dgps", 3: "pps", 4: "fix", 5: "float", 6: "estimated", 7: "manual", 8: "simulated"}

_KNOT = 1852 / 3600
_REST = 0.2
"""m/s, below which a speed without a course is none."""

_READ = ("GGA", "GST", "RMC", "ZDA")


def read_nmea(file: Path, asked: Asked) -> RawFixes:
    """Read the fixes of a log of NMEA sentences."""
    day, fixes = asked.date, []
    known: dict[str, Any] = {}
    days_on, last, first_date = 0, None, None
    for kind, sentence in _sentences(file):
        if kind == "ZDA" or (kind == "RMC" and sentence.datestamp):
            date = np.datetime64(sentence.datestamp, "D") if kind == "RMC" else _zda_date(sentence)
            if date is not None and first_date is None:
                first_date = date - days_on
        if not sentence.timestamp:
            continue
        moment = _seconds(sentence.timestamp)
        if last is not None and moment < last - DAY / 2:
            days_on += 1
        last = moment
        if (days_on, moment) != known.get("at"):
            fixes.append(known)
            known = {"at": (days_on, moment)}
        known[kind] = sentence
    found = _with_sd([f for f in [*fixes, known] if "GGA" in f and int(f["GGA"].gps_qual or 0) > 0])
    if not found:
        raise ValueError("There is no GGA sentence with a fix: fixes are read from GGA, with RMC and GST if there are.")
    day = first_date if day is None else day
    if day is None:
        raise ValueError('No sentence has a date (RMC, ZDA): give date="2024-07-08", that of the first fix in UTC.')
    sd = np.array([_sd(f.get("GST")) for f in found])
    velocity = np.array([_velocity(f.get("RMC")) for f in found])
    days, seconds = np.array([f["at"] for f in found]).T
    return RawFixes(
        np.array([_position(f["GGA"]) for f in found]),
        "geodetic",
        from_calendar(day + days.astype(np.int64), seconds, "UTC"),
        covariance=diagonal(sd) if np.isfinite(sd).all() else None,
        velocity=velocity if np.isfinite(velocity[:, :2]).any() else None,
        quality=np.array([int(f["GGA"].gps_qual) for f in found], dtype=np.int64),
        kinds=KINDS,
        satellites=np.array([_number(f["GGA"].num_sats) for f in found]),
        age=np.array([_number(f["GGA"].age_gps_data) for f in found]),
        height="ellipsoid" if all(f["GGA"].geo_sep for f in found) else "geoid",
    )


def _sentences(file: Path) -> Any:
    """Kind and content of each sentence that is read; lines of other loggers between them are passed over."""
    pynmea2 = import_optional("pynmea2")
    corrupt = total = 0
    with file.open(encoding="latin-1") as stream:
        for _, line in numbered_lines(stream):
            text = line[line.find("$") :].strip() if "$" in line else ""
            if text[3:6] not in _READ:
                continue
            total += 1
            try:
                yield text[3:6], pynmea2.parse(text, check="*" in text)
            except (pynmea2.ParseError, ValueError):
                corrupt += 1
    if corrupt:
        warnings.warn(f"{corrupt} of {total} sentences are corrupt and left out.", IncompleteLogWarning, stacklevel=2)


def _with_sd(fixes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All fixes, or where some have standard deviations those that have them."""
    whole = [f for f in fixes if np.isfinite(_sd(f.get("GST"))).all()]
    if not whole or len(whole) == len(fixes):
        return fixes
    warnings.warn(
        f"{len(fixes) - len(whole)} of {len(fixes)} fixes have no GST sentence of their time and are left out.",
        IncompleteLogWarning,
        stacklevel=2,
    )
    return whole


def _zda_date(sentence: Any) -> np.datetime64 | None:
    parts = [str(getattr(sentence, name) or "") for name in ("year", "month", "day")]
    return np.datetime64("-".join([parts[0], *(p.zfill(2) for p in parts[1:])]), "D") if all(parts) else None


def _seconds(moment: Any) -> float:
    """Of the day."""
    return moment.hour * 3600 + moment.minute * 60 + moment.second + moment.microsecond * 1e-6


def _position(gga: Any) -> list[float]:
    height = _number(gga.altitude)
    separation = _number(gga.geo_sep)
    if not np.isfinite(height):
        raise ValueError(f"The GGA sentence of {gga.timestamp} has a fix and no altitude.")
    above = height + (separation if np.isfinite(separation) else 0.0)
    return [np.deg2rad(gga.latitude), np.deg2rad(gga.longitude), above]


def _sd(gst: Any) -> list[float]:
    """North, east, down; NaN where there is none."""
    names = ("std_dev_latitude", "std_dev_longitude", "std_dev_altitude")
    return [_number(getattr(gst, name, None)) for name in names]


def _velocity(rmc: Any) -> list[float]:
    """North, east, and NaN for down; a receiver at rest leaves the course out."""
    v, course = _KNOT * _number(getattr(rmc, "spd_over_grnd", None)), _number(getattr(rmc, "true_course", None))
    if v < _REST and not np.isfinite(course):
        return [0.0, 0.0, np.nan]
    return [v * np.cos(np.deg2rad(course)), v * np.sin(np.deg2rad(course)), np.nan]


def _number(value: Any) -> float:
    return float("nan") if value is None or value == "" else float(value)
