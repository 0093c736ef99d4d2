"""Recorded navigation data from files, tables and arrays: the samples of an IMU, and the fixes of aiding sensors."""

import os
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gmwm_jax._internal.checks import require_x64, sampling_rate
from gmwm_jax._internal.gravity import ImplausibleUnitsWarning, warn_of_units
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_source
from gmwm_jax._internal.timing import longest_rise, timing
from gmwm_jax._internal.typing import Real
from gmwm_jax.units import counts, time_size
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.registry import AIDING
from nav_jax.imu.imu import Imu
from nav_jax.imu.samples import imu_of_samples
from nav_jax.kinematics.geodetic import check_geodetic, checked_origin, warn_of_far_origin
from nav_jax.recorded.missing import rows_of_fixes
from nav_jax.trajectory.columns import ACCEL, GYRO, POSITION, Reader, pick


def read_imu(
    source: Any,
    *,
    units: Mapping[str, str] | None = None,
    scale: str | Mapping[str, str] | None = None,
    rate: Real | None = None,
    columns: Mapping[str, int | str] | None = None,
    time_unit: str | None = None,
    gaps: str = "refuse",
    samples: str = "held",
    stamps: str = "begin",
    format: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
    max_bytes: int | str | None = None,
) -> Imu:
    """Read the samples of an IMU from a file, an array, a mapping, a DataFrame or an xarray Dataset.

    Files are those of `gmwm_jax.read_recording`, formats of loggers included. The columns are time, gyro x, y, z and
    accelerometer x, y, z (specific force). They are found by their names (``time``, ``gyro_x``, ``accel_z`` ..., also
    with a unit behind: ``gyro_x_deg_s``), by the format, or, without names, by the order just said. Axes are taken for
    body front, right, down, as they stand in the file.

    Stamps are regressed, not trusted: where they are rounded or jitter, samples get the times of the grid of their
    rate. Of formats, times are seconds of the GPS week (``kf-gins``, ``novatel``) or since 1970 (``ros``, ``euroc``,
    ``kitti``), and so are those of timestamps (``2026-01-31T13:02:25.964``, UTC unless they have an offset from it):
    ``clock="unix"`` of `nav_jax.read_gnss`. Seconds of the GPS week go on over its end.

    Parameters
    ----------
    source
        Path or table.
    units
        ``{"gyro": "rad/s", "accel": "m/s^2"}``; of gyros also ``deg/s`` and ``deg/h``, of accelerometers ``g`` and
        ``mg``, and increments per sample (``rad``, ``m/s``). Needed unless the names or the format say it.
    scale
        Of counts, in place of `units`: ``{"gyro": "0.1 deg/s", "accel": "1.25 mg"}``, or the type of IMU of a NovAtel
        log.
    rate
        Hz; from the times unless given.
    columns
        Columns that are not found by their names, as in ``{"gyro_x": "wx"}``, by name or number. The temperature is
        read where its column is named here, ``{"temperature": "T"}``, in K or deg C.
    time_unit
        ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; seconds unless the name says another.
    gaps
        Where samples are missing: ``refuse``, an error, or ``longest``, the longest run is taken.
    samples
        What the numbers are: ``averages`` over the sample, as increments are, and ``instants`` at the stamps are
        corrected for coning and sculling; ``held`` are taken as they are, see `nav_jax.imu.imu_of_samples`.
    stamps
        What of its sample a stamp marks: ``begin``, ``middle`` or ``end``.
    format
        Of the logger, see `gmwm_jax.read_recording`; found by the content where that is certain.
    delimiter
        Of a text file; found unless given.
    header
        Number of the line of names of a text file, from 1; 0: no line has them. Found unless given.
    variable
        The object to read, where an ``.npz`` or R file, or the topic, where a bag holds several.
    max_bytes
        Bytes to which the file may unfold, see `gmwm_jax.read_recording`.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        The format needs the extra ``io`` or ``ros``.
    ValueError
        A corrupt file; a column that is missing or no number; a unit that is not stated, or stated twice differently;
        times that tell no rate; missing samples that are refused.

    Examples
    --------
    >>> names = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    >>> rows = np.column_stack([np.arange(4) / 20.0, np.zeros((4, 5)), np.full(4, -1.0)])
    >>> np.savetxt("imu.csv", rows, delimiter=",", header=",".join(names), comments="")
    >>> nj.read_imu("imu.csv", units={"gyro": "deg/s", "accel": "g"}).accel[0].round(5).tolist()
    [0.0, 0.0, -9.80665]
    """
    if gaps not in ("refuse", "longest"):
        raise ValueError(f"gaps is refuse or longest, and is {gaps!r}: a navigation needs all samples.")
    kind = scale if isinstance(scale, str) else None
    how = Reading(delimiter, header, variable, format, kind, max_bytes=size_in_bytes(max_bytes))
    opened = _open(source, how, units, scale, columns, time_unit)
    try:
        found = _timing(opened.seconds, opened.read, gaps)
        f = found.rate if rate is None else float(sampling_rate(rate))
        _warn_of_slowness(f)
        gyro, accel = (opened.sensor(*of, f)[found.rows] for of in _SENSORS)
        warn_of_units(gyro, accel)
        warm = opened.read.values["temperature"][found.rows] if "temperature" in opened.read.values else None
        time = opened.first + found.time
        return imu_of_samples(time, gyro, accel, f, samples=samples, stamps=stamps, temperature=warm)
    except ValueError as error:
        raise _of_file(error, source) from error


def read_samples(
    source: Any,
    *,
    units: Mapping[str, str] | None = None,
    scale: str | Mapping[str, str] | None = None,
    rate: Real | None = None,
    columns: Mapping[str, int | str] | None = None,
    time_unit: str | None = None,
    format: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
    max_bytes: int | str | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read time in s, gyro in rad/s and accelerometer in m/s^2 as they were recorded, with gaps if there are.

    Parameters
    ----------
    source, units, scale, rate, columns, time_unit, format, delimiter, header, variable, max_bytes
        See `read_imu`; the rate matters for increments alone.

    Raises
    ------
    FileNotFoundError, ImportError, ValueError
        See `read_imu`.

    Examples
    --------
    >>> names = ["time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    >>> table = dict(zip(names, np.column_stack([[0.0, 0.1, 0.5], np.zeros((3, 6))]).T))
    >>> nj.recorded.read_samples(table, units={"gyro": "deg/s", "accel": "g"})[0].tolist()  # one is missing
    [0.0, 0.1, 0.5]
    """
    kind = scale if isinstance(scale, str) else None
    how = Reading(delimiter, header, variable, format, kind, max_bytes=size_in_bytes(max_bytes))
    opened = _open(source, how, units, scale, columns, time_unit)
    try:
        if len(opened.seconds) < 2:
            raise ValueError(f"The record has {len(opened.seconds)} samples, and at least two are needed.")
        f = float(1 / np.median(np.diff(opened.seconds))) if rate is None else float(sampling_rate(rate))
        _warn_of_slowness(f)
        gyro, accel = (opened.sensor(*of, f) for of in _SENSORS)
    except ValueError as error:
        raise _of_file(error, source) from error
    return opened.first + opened.seconds, gyro, accel


_SENSORS = (("gyro", GYRO), ("accel", ACCEL))

_SLOWEST = 1.0
"""Hz: 1 kHz by stamps in ms that are taken for seconds, and no IMU that anybody navigates by."""


def _warn_of_slowness(rate: float) -> None:
    if rate <= _SLOWEST:
        others = " or ".join(f'"{unit}" ({rate / time_size(unit):.4g} Hz)' for unit in ("ms", "us", "ns"))
        text = (
            f"The samples come at {rate:.4g} Hz if the column of time is in s. If it is not, state time_unit={others}."
        )
        warnings.warn(text, ImplausibleUnitsWarning, stacklevel=3)


class _Opened(NamedTuple):
    """A table of samples."""

    read: Reader
    seconds: np.ndarray
    """Since the first."""
    first: float
    """s."""
    stated: Mapping[str, str]
    """Sensor -> unit that the caller states."""
    sizes: Mapping[str, str]
    """Sensor -> size of its counts."""

    def sensor(self, name: str, quantities: Sequence[str], rate: float) -> np.ndarray:
        """In SI, (N, 3)."""
        count, unit = counts(self.sizes[name]) if name in self.sizes else (1.0, self.stated.get(name))
        return self.read.sensor(quantities, unit, f'units={{"{name}": ...}}', rate, count)


def _open(source: Any, how: Reading, units: Any, scale: Any, columns: Any, time_unit: str | None) -> _Opened:
    """What `read_imu` reads, before it judges times."""
    require_x64()
    stated = {} if units is None else dict(units)
    sizes = {} if scale is None or isinstance(scale, str) else dict(scale)
    for what, given in (("units", stated), ("scale", sizes)):
        if not set(given) <= {"gyro", "accel"}:
            raise ValueError(f'{what} has the keys "gyro" and "accel", and these are {", ".join(given)}.')
    if twice := set(stated) & set(sizes):
        raise ValueError(f"Both units and scale are given for {', '.join(sorted(twice))}: the scale has its unit.")
    try:
        table = open_source(source, how)
        told = {**table.roles, **({} if columns is None else columns)}
        stamped = table.stamps if "time" not in told else None
        wanted = (*GYRO, *ACCEL) if stamped is not None else ("time", *GYRO, *ACCEL)
        # a thermometer that nobody asks for may have gaps
        wanted = (*wanted, *(q for q in ("temperature",) if q in told))
        read = Reader(table, pick(table, wanted, told or None), None, time_unit)
        if stamped is None:
            time = _seconds(read)
            first = float(time[0]) if len(time) else 0.0
        else:
            parts = table.load(list(stamped.columns))
            time, first = stamped.seconds(parts), stamped.first(parts)
    except ValueError as error:
        raise _of_file(error, source) from error
    return _Opened(read, time - time[:1], first, stated, sizes)


_SMOOTHED = 1e-3
"""Jitter of stamps in samples beyond which they are smoothed."""


class _Times(NamedTuple):
    """Rows that are left, their times from the first row, and the rate."""

    rows: slice | np.ndarray
    time: np.ndarray
    rate: float


def _timing(seconds: np.ndarray, read: Reader, gaps: str) -> _Times:
    """Times on the grid of the rate; even ones as they are."""
    run = slice(0, len(seconds))
    if gaps == "longest" and len(seconds):
        run = longest_rise(seconds)
    values = [read.values[q][run] for q in (*GYRO, *ACCEL)]
    found = timing(seconds[run], lambda rows: np.all([v[rows] == v[rows - 1] for v in values], axis=0))
    ways_out = 'A navigation needs all samples: gaps="longest" takes the longest run, or read the parts by themselves.'
    kept = np.arange(len(seconds))[run][found.kept(gaps, ways_out)]
    if found.jitter * found.rate > _SMOOTHED or found.duplicated:
        time = seconds[run.start] + found.grid[kept - run.start]
        return _Times(kept, time, found.rate)
    time = seconds[kept]
    return _Times(kept, time, float((len(time) - 1) / (time[-1] - time[0])))


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
    max_bytes: int | str | None = None,
) -> Fixes:
    """Read the fixes of an aiding sensor: time, and what the sensor measures.

    Rows without a value (NaN), and those at latitude and longitude 0, are left out with a warning.

    Fixes in the sensor's outages are read too: the filter is not given them, and is compared with them. Files of GNSS
    receivers, with standard deviations of their own, are read by `nav_jax.read_gnss`.

    The columns are found by their names, or, without names, in this order: time; north, east, down (m) of a GNSS
    position; velocity north, east, down (m/s) of a GNSS velocity; height above the origin (m) of a barometer; speed
    (m/s) of an odometer; field x, y, z (T) of a magnetometer; north, east, down (m) from antenna to antenna.

    Parameters
    ----------
    source, columns, time_unit, delimiter, header, variable, max_bytes
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
        origin = checked_origin(origin)
    names = sensor.columns(geodetic=origin is not None)
    try:
        table = open_source(source, Reading(delimiter, header, variable, max_bytes=size_in_bytes(max_bytes)))
        read = Reader(table, pick(table, ("time", *names), columns), angles, time_unit)
        read.values = rows_of_fixes(read.values, names)
        values = read.three(names)
        if names[:3] == POSITION["geodetic"]:
            check_geodetic(values[:, :3])
        found = Fixes(sensor, _seconds(read), sensor.measured(values, origin))
        if names[:3] == POSITION["geodetic"]:
            warn_of_far_origin(found.value[:, :3])
        return found
    except ValueError as error:
        raise _of_file(error, source) from error


def _seconds(read: Reader) -> np.ndarray:
    """Time on a clock that several files share."""
    values = read.values["time"]
    if values.dtype.kind == "M":
        return (values - np.datetime64(0, "s")) / np.timedelta64(1, "s")
    return read.time()


def _of_file(error: ValueError, source: Any) -> ValueError:
    return ValueError(f"{source}: {error}") if isinstance(source, str | os.PathLike) else error
