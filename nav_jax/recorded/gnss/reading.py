"""Reading the fixes of a GNSS receiver: onto a clock and into a local frame."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.checks import require_x64
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.tabular import require_file
from gmwm_jax._internal.typing import Real
from nav_jax.kinematics.geodetic import (
    check_geodetic,
    checked_origin,
    dcm_ned_from_ecef,
    ecef_from_geodetic,
    geodetic_from_ecef,
    geodetic_from_ned,
    ned_from_geodetic,
    warn_of_far_origin,
)
from nav_jax.recorded.gnss.raw import Asked, RawFixes, turned
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.gnss.registry import format_of
from nav_jax.recorded.gnss.time_scales import CLOCKS, on_clock, utc_at_zero


def read_gnss(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    clock: str | None = None,
    origin: Sequence[Real] | np.ndarray | None = None,
    date: str | None = None,
    week: int | None = None,
    columns: Mapping[str, int | str] | None = None,
    angles: str | None = None,
    time_unit: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
    max_bytes: int | str | None = None,
) -> GnssRecord:
    r"""Read the fixes of a GNSS receiver or of a program that computes positions.

    Positions become north, east, down in the tangent frame at `origin`; covariances and velocities, which files state
    along the axes at the fix or of ECEF, are turned into it.

    Parameters
    ----------
    path
        The file.
    format
        ``rtklib`` (.pos), ``nmea``, ``gpx``, ``kf-gins`` or ``table`` (CSV and all else that `read_fixes` opens, by the
        names of its columns); by the suffix unless given, and a table if that says nothing.
    clock
        What the times of the result count: ``week`` (seconds of the GPS week of the first fix, unless told otherwise),
        ``gps`` (since 1980), ``unix`` (UTC since 1970), ``day`` (of the UTC day) or ``first`` (since the first fix).
        Bare seconds of a file stay as they are, whatever they count; only ``first`` can be asked of them. Texts of date
        and time in a table are UTC, unless they have an offset from it.
    origin
        Latitude, longitude (rad) and height (m); the first fix unless given. Positions that are local already stay as
        they are, about this origin.
    date
        ``2024-07-08``: of the first fix, in UTC, for NMEA sentences and texts of a table without a date.
    week
        GPS week of the first fix, for files with seconds of the week that are wanted on another clock.
    columns, angles, time_unit, delimiter, header, variable
        Of a table, see `read_fixes`.
    max_bytes
        Bytes to which the file may unfold, see `gmwm_jax.read_recording`.

    Returns
    -------
    GnssRecord

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        NMEA needs the extra ``io``.
    ValueError
        A file that is none of the format, a clock that it does not know, what is not stated; by its place in the file.

    Examples
    --------
    >>> lines = ["%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m)"]
    >>> lines += ["2024/07/08 19:34:00.000  46.5 6.6 400.0 1 12 0.01 0.01 0.02 0.0 0.0 0.0"]
    >>> lines += ["2024/07/08 19:34:01.000  46.5 6.6 400.5 5 12 1.00 1.00 2.00 0.5 0.0 0.0"]
    >>> with open("drive.pos", "w") as file:
    ...     _ = file.write("\n".join(lines))
    >>> drive = nj.read_gnss("drive.pos").without("single")
    >>> drive.time.tolist(), drive.position_fixes().value.round(6).tolist()
    ([156840.0], [[0.0, 0.0, 0.0]])
    """
    require_x64()
    file = Path(path)
    require_file(file)
    day, most = None if date is None else _date(date), size_in_bytes(max_bytes)
    asked = Asked(day, week, columns, angles, time_unit, delimiter, header, variable, most)
    try:
        raw = format_of(file, format).read(file, asked)
        return _record(raw, clock, origin, file.name)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def _date(text: Any) -> np.datetime64:
    try:
        return np.datetime64(str(text), "D")
    except ValueError as error:
        raise ValueError(f'date is a day such as "2024-07-08", and is {text!r}.') from error


def _record(raw: RawFixes, clock: str | None, origin: Any, name: str) -> GnssRecord:
    time, counted = _time(raw, clock)
    if (falls := np.flatnonzero(np.diff(time) < 0)).size:
        i = int(falls[0]) + 1
        raise ValueError(
            f"Time falls back at index {i}: {time[i - 1]:.10g} s is followed by {time[i]:.10g} s. The fixes are not in "
            "the order of their times, or the clock was reset."
        )
    center = None if origin is None else checked_origin(origin)
    position, turn, center = _local(raw, center)
    if center is not None:
        warn_of_far_origin(position, stacklevel=4)
    velocity = None if raw.velocity is None else _turn(turn, raw.velocity)
    return GnssRecord(
        time,
        position,
        center,
        None if raw.covariance is None else turned(turn, raw.covariance),
        velocity,
        None if raw.velocity_covariance is None else turned(turn, raw.velocity_covariance),
        raw.quality,
        raw.kinds,
        raw.satellites,
        raw.age,
        counted,
        raw.height,
        None if raw.epochs is None else utc_at_zero(raw.epochs, time),
        name,
    )


def _time(raw: RawFixes, clock: str | None) -> tuple[np.ndarray, str]:
    """Seconds, and what they count."""
    if clock is not None and clock not in CLOCKS:
        raise ValueError(f"The clock is one of {', '.join(CLOCKS)}, and is {clock!r}.")
    if raw.epochs is not None:
        return on_clock(raw.epochs, clock or "week"), clock or "week"
    assert raw.seconds is not None
    if clock == "first":
        return raw.seconds - raw.seconds[0], clock
    if clock is not None:
        raise ValueError(
            f"clock={clock!r} is asked for, and the file has bare seconds: leave clock out, or give the GPS week of a "
            "file with seconds of the week as week=..."
        )
    return raw.seconds, "as in the file"


def _turn(matrix: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors along other axes; a component down that is not there stays away, and tilts the others by nothing."""
    gone = np.isnan(v)
    return np.where(gone, np.nan, (matrix @ np.where(gone, 0.0, v)[:, :, None])[:, :, 0])


def _local(raw: RawFixes, center: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Positions about the origin, the matrices (F, 3, 3) that turn what else there is into its axes, and the origin."""
    p = raw.position
    if raw.frame == "ned":
        if center is not None and raw.origin is not None:  # the file's own frame, moved
            return _local(_geodetic(raw, geodetic_from_ned(p, raw.origin), raw.origin), center)
        return p, np.broadcast_to(np.eye(3), (len(p), 3, 3)), center if raw.origin is None else raw.origin
    geodetic = geodetic_from_ecef(p) if raw.frame == "ecef" else p
    check_geodetic(geodetic)
    about = geodetic[0] if center is None else center
    to_local = dcm_ned_from_ecef(about[0], about[1])
    if raw.frame == "ecef":  # not by way of latitude and longitude, which would cost a digit
        local = (p - ecef_from_geodetic(about[None])) @ to_local.T
        return local, np.broadcast_to(to_local, (len(p), 3, 3)), about
    back = dcm_ned_from_ecef(p[:, 0], p[:, 1]).transpose(0, 2, 1)
    return ned_from_geodetic(p, about), to_local @ back, about


def _geodetic(raw: RawFixes, geodetic: np.ndarray, axes: np.ndarray) -> RawFixes:
    """The same fixes on the ellipsoid, what lies along the axes at one point turned to each fix's own."""
    turn = dcm_ned_from_ecef(geodetic[:, 0], geodetic[:, 1]) @ dcm_ned_from_ecef(axes[0], axes[1]).T
    return replace(
        raw,
        position=geodetic,
        frame="geodetic",
        covariance=None if raw.covariance is None else turned(turn, raw.covariance),
        velocity=None if raw.velocity is None else _turn(turn, raw.velocity),
        velocity_covariance=None if raw.velocity_covariance is None else turned(turn, raw.velocity_covariance),
    )
