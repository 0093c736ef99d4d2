"""Recorded navigation data from files, tables and arrays: the samples of an IMU, and the fixes of aiding sensors."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gmwm_jax._internal.checks import increasing, real_array, require_x64
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_source
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.registry import AIDING
from nav_jax.imu.imu import Imu
from nav_jax.trajectory.columns import ACCEL, GYRO, Reader, pick

_EVEN = 0.01
"""Fraction by which steps of time may differ: those of an Imu."""


def read_imu(
    source: Any,
    *,
    units: Mapping[str, str] | None = None,
    rate: Real | None = None,
    columns: Mapping[str, int | str] | None = None,
    time_unit: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
) -> Imu:
    """Read the samples of an IMU from a file, an array, a mapping, a DataFrame or an xarray Dataset.

    Files are those of `nav_jax.read_trajectory`. The columns are time, gyro x, y, z and accelerometer x, y, z (body
    front, right, down; specific force). They are found by their names (``time``, ``gyro_x``, ``accel_z`` ..., also with
    a unit behind: ``gyro_x_deg_s``), or, without names, by the order just said.

    Parameters
    ----------
    source
        Path or table.
    units
        ``{"gyro": "rad/s", "accel": "m/s^2"}``; of gyros also ``deg/s`` and ``deg/h``, of accelerometers ``g`` and
        ``mg``. Needed unless the names say it.
    rate
        Hz; from the times unless given. Stamps that are rounded (to milliseconds, say) or late now and then are
        replaced by the line through them, where no sample is missing.
    columns
        Columns that are not found by their names, as in ``{"gyro_x": "wx"}``, by name or number.
    time_unit
        ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; seconds unless the name says another.
    delimiter
        Of a text file; found unless given.
    header
        Number of lines of a text file to skip; comments and at most one line of names unless given.
    variable
        The object to read, where an ``.npz`` or R file holds several.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        The format needs the extra ``io``.
    ValueError
        A corrupt file; a column that is missing or no number; a unit that is not stated, or stated twice differently;
        steps of time that are uneven.

    Examples
    --------
    >>> names = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    >>> rows = np.column_stack([np.arange(4) / 20.0, np.zeros((4, 5)), np.full(4, -1.0)])
    >>> np.savetxt("imu.csv", rows, delimiter=",", header=",".join(names), comments="")
    >>> nj.read_imu("imu.csv", units={"gyro": "deg/s", "accel": "g"}).accel[0].round(5).tolist()
    [0.0, 0.0, -9.80665]
    """
    require_x64()
    stated = {} if units is None else dict(units)
    if not set(stated) <= {"gyro", "accel"}:
        raise ValueError(f'units has the keys "gyro" and "accel", and these are {", ".join(stated)}.')
    try:
        table = open_source(source, Reading(delimiter, header, variable))
        read = Reader(table, pick(table, ("time", *GYRO, *ACCEL), columns), None, time_unit)
        time = _seconds(read)
        increasing("The time of an IMU", time)
        gyro = read.sensor(GYRO, stated.get("gyro"), 'units={"gyro": ...}')
        accel = read.sensor(ACCEL, stated.get("accel"), 'units={"accel": ...}')
        time = _at_even_steps(time)
        return Imu(time, gyro, accel, float((len(time) - 1) / (time[-1] - time[0])) if rate is None else rate)
    except ValueError as error:
        raise _of_file(error, source) from error


def read_fixes(
    source: Any,
    sensor: AbstractAiding,
    *,
    origin: Sequence[Real] | np.ndarray | None = None,
    angles: str | None = None,
    columns: Mapping[str, int | str] | None = None,
    time_unit: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
) -> Fixes:
    """Read the fixes of an aiding sensor: time, and what the sensor measures.

    Fixes in the sensor's outages are read too: the filter is not given them, and is compared with them. Files of GNSS
    receivers, with standard deviations of their own, are read by `nav_jax.read_gnss`.

    The columns are found by their names, or, without names, in this order: time; north, east, down (m) of a GNSS
    position; velocity north, east, down (m/s) of a GNSS velocity; height above the origin (m) of a barometer; speed
    (m/s) of an odometer.

    Parameters
    ----------
    source, columns, time_unit, delimiter, header, variable
        See `read_imu`; the time is on the clock of the IMU.
    sensor
        One of `nav_jax.aiding`, with the standard deviations that the filter believes.
    origin
        Latitude, longitude (rad) and height (m) of the origin of n: positions are then latitude, longitude, height,
        and heights of a barometer not yet above the origin.
    angles
        ``rad`` or ``deg`` for latitude and longitude; needed unless the names say it.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        The format needs the extra ``io``.
    ValueError
        As of `read_imu`; another kind of sensor; an origin for velocities; no fix outside the outages.

    Examples
    --------
    >>> np.savetxt("baro.csv", [[1.0, 100.0], [2.0, 100.5]], delimiter=",", header="time,height", comments="")
    >>> nj.read_fixes("baro.csv", nj.Barometer(height=0.5)).value.ravel().tolist()
    [100.0, 100.5]
    """
    require_x64()
    if type(sensor) not in AIDING.values():
        known = ", ".join(cls.__name__ for cls in AIDING.values())
        raise ValueError(f"Fixes are read for {known}, and this is {type(sensor).__name__}: build Fixes from arrays.")
    if origin is not None:
        origin = real_array("The origin (latitude, longitude, height)", origin, (3,))
    names = sensor.columns(geodetic=origin is not None)
    try:
        table = open_source(source, Reading(delimiter, header, variable))
        read = Reader(table, pick(table, ("time", *names), columns), angles, time_unit)
        return Fixes(sensor, _seconds(read), sensor.measured(read.three(names), origin))
    except ValueError as error:
        raise _of_file(error, source) from error


def _seconds(read: Reader) -> np.ndarray:
    """Time on a clock that several files share."""
    if read.values["time"].dtype.kind in "mM":
        raise ValueError("Timestamps of several files have no common zero: convert them to seconds on one clock.")
    return read.time()


def _at_even_steps(time: np.ndarray) -> np.ndarray:
    """Stamps that are rounded or late now and then, of samples of which none is missing: the line through them.

    Those that are even already stay as they are, and so do those with a gap, which the IMU refuses.
    """
    index = np.arange(len(time), dtype=float)
    steps = np.diff(time)
    usual = np.median(steps) if len(steps) < 3 else (time[-1] - time[0]) / (len(time) - 1)
    if np.abs(steps / usual - 1).max(initial=0.0) < _EVEN or (np.rint(steps / usual) != 1).any():
        return time
    slope, intercept = np.polyfit(index - index.mean(), time - time.mean(), 1)
    line = time.mean() + intercept + slope * (index - index.mean())
    return line if np.abs(time - line).max() < slope else time


def _of_file(error: ValueError, source: Any) -> ValueError:
    return ValueError(f"{source}: {error}") if isinstance(source, str | os.PathLike) else error
