"""Trajectories from files, tables and arrays, and back."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.checks import number, require_x64
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_source
from gmwm_jax._internal.typing import Matrix, Quaternion, Real, Vector
from nav_jax.kinematics import rotation
from nav_jax.kinematics.geodetic import (
    check_geodetic,
    checked_origin,
    dcm_ned_from_ecef,
    geodetic_from_ned,
    ned_from_geodetic,
    warn_of_far_origin,
)
from nav_jax.trajectory.columns import ATTITUDE, POSITION, VELOCITY, Reader, choose
from nav_jax.trajectory.maps import MAPS
from nav_jax.trajectory.trajectory import Trajectory

_SAVED = {
    "time": "time_s",
    **{name: f"{name}_m" for name in POSITION["ned"]},
    **{name: f"{name}_rad" for name in ATTITUDE},
    **{name: f"{name}_m_s" for name in VELOCITY},
}


def read_trajectory(
    source: Any,
    *,
    position: str | None = None,
    angles: str | Mapping[str, str] | None = None,
    columns: Sequence[int | str] | Mapping[str, int | str] | None = None,
    time_unit: str | None = None,
    origin: Sequence[Real] | np.ndarray | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
    name: str | None = None,
    max_bytes: int | str | None = None,
) -> Trajectory:
    """Read a trajectory from a file, an array, a mapping, a DataFrame or an xarray Dataset.

    Files are ``.csv .tsv .txt .dat .log .asc .npy .npz .parquet .rda .rdata .nc``. The columns are time, three of
    position, roll, pitch, yaw, and perhaps three of velocity. They are found by their names (``time``, ``north`` or
    ``x_N``, ``lat``, ``yaw``, ``v_n`` ..., also with a unit behind: ``yaw_deg``), or, without names, by the order just
    said. Units come from the names, from the ``units`` of xarray, or from the arguments, and are never guessed. Without
    velocities they are derived from the positions. Yaw may be wrapped or not.

    Geodetic positions become north, east, down in the tangent frame at `origin`; velocity and attitude, which refer to
    the north and the vertical of each point, are turned into the same frame.

    Parameters
    ----------
    source
        Path or table.
    position
        ``"ned"`` (north, east, down in m) or ``"geodetic"`` (latitude, longitude, ellipsoidal height in m, WGS-84);
        needed unless the names say it.
    angles
        ``"rad"`` or ``"deg"`` for all angles, or ``{"position": ..., "attitude": ...}``; needed for those whose names
        do not say it.
    columns
        Which columns to use, by name or number: in the order said above (7 or 10), or as in ``{"yaw": "heading"}`` for
        those that are not found by their names.
    time_unit
        ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; seconds unless the name says another. Timestamps need
        none: they become seconds since the first.
    origin
        Latitude, longitude (rad) and height (m) of the origin; the first point unless given.
    delimiter
        Of a text file; found unless given.
    header
        Number of the line of names of a text file, from 1; 0: no line has them. Found unless given.
    variable
        The object to read, where an ``.npz`` or R file holds several.
    name
        Of the trajectory; the name of the file unless given.
    max_bytes
        Bytes to which the file may unfold, see `gmwm_jax.read_recording`.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        The format needs the extra ``io``.
    ValueError
        A corrupt file; a column that is missing or no number; a unit or frame that is not stated, or stated twice
        differently; values that make no trajectory.

    Examples
    --------
    >>> path = nj.trajectory.save_trajectory(nj.motions.circle(duration=10.0, rate=20.0), "circle.csv")
    >>> nj.read_trajectory(path).duration
    10.0
    """
    require_x64()
    is_file = isinstance(source, str | os.PathLike)
    try:
        table = open_source(source, Reading(delimiter, header, variable, max_bytes=size_in_bytes(max_bytes)))
        system, numbers = choose(table, position, columns)
        read = Reader(table, numbers, angles, time_unit)
        time = read.time()
        p, euler = read.three(POSITION[system]), read.three(ATTITUDE)
        v = read.three(VELOCITY) if VELOCITY[0] in numbers else None
        title = (Path(source).stem if is_file else "") if name is None else name
        return _assemble(time, p, euler, v, system, origin, title)
    except ValueError as error:
        if not is_file:
            raise
        raise ValueError(f"{source}: {error}") from error


def save_trajectory(
    trajectory: Trajectory,
    path: str | os.PathLike[str],
    *,
    origin: Sequence[Real] | np.ndarray | None = None,
    start: np.datetime64 | None = None,
    interval: Real = 1.0,
) -> Path:
    """Write a trajectory to an ``.npz`` or ``.csv`` file that `read_trajectory` reads without further arguments.

    The columns are called ``time_s``, ``north_m``, ``roll_rad``, ``velocity_north_m_s`` and so on, so that others can
    read them too. The file appears whole or not at all. For maps, a ``.kml`` or ``.gpx`` file has the track.

    Parameters
    ----------
    trajectory
        What to write.
    path
        The file.
    origin
        Of maps: latitude, longitude (rad) and height (m) of the origin; that of the trajectory unless given.
    start
        Of maps: UTC at time zero; without it they have no times.
    interval
        Of maps: s between points, at least.

    Returns
    -------
    `path`.

    Raises
    ------
    ValueError
        The path has another suffix; a map without an origin, or a table with one.

    Examples
    --------
    >>> nj.trajectory.save_trajectory(nj.motions.circle(duration=10.0, rate=20.0), "circle.npz").name
    'circle.npz'
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix in MAPS:
        origin = trajectory.origin if origin is None else origin
        if origin is None:
            raise ValueError(f"A map needs to know where the trajectory is: give origin=... to write {file}.")
        rows = _thinned(trajectory.time, number("interval", interval))
        geodetic = to_geodetic(trajectory, origin)[rows]
        degrees = np.column_stack([np.rad2deg(geodetic[:, :2]), geodetic[:, 2]])
        stamps = None if start is None else _stamps(trajectory.time[rows], start)
        content = MAPS[suffix](trajectory.name or file.stem, degrees, stamps)
        return write_atomically(file, lambda stream: stream.write(content))
    if suffix not in (".npz", ".csv"):
        raise ValueError(f"Trajectories are saved as .npz, .csv, {', '.join(MAPS)}, and the path is {file}.")
    if origin is not None or start is not None:
        raise ValueError(f"origin and start belong to maps ({', '.join(MAPS)}), and the path is {file}.")
    columns = trajectory_columns(trajectory)
    if suffix == ".npz":
        arrays: Any = columns
        return write_atomically(file, lambda stream: np.savez(stream, **arrays))
    table, header = np.column_stack(list(columns.values())), ",".join(columns)
    return write_atomically(file, lambda stream: np.savetxt(stream, table, "%.17g", ",", header=header, comments=""))


def trajectory_columns(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Name with its unit -> column, as `save_trajectory` writes them."""
    parts = (trajectory.time[:, None], trajectory.position, trajectory.euler, trajectory.velocity)
    return dict(zip(_SAVED.values(), np.concatenate(parts, axis=1).T, strict=True))


def _thinned(time: np.ndarray, interval: float) -> np.ndarray:
    """The first epoch of each interval, and the last of all."""
    bins = np.floor((time - time[0]) / interval + 1e-9)
    rows = np.flatnonzero(np.diff(bins, prepend=-1) > 0)
    return rows if rows[-1] == len(time) - 1 else np.append(rows, len(time) - 1)


def _stamps(time: np.ndarray, start: np.datetime64) -> list[str]:
    """Instants in UTC, to the millisecond."""
    moments = start.astype("datetime64[us]") + np.rint(1e6 * time).astype("timedelta64[us]")
    return [f"{np.datetime_as_string(m, unit='ms')}Z" for m in moments]


def to_geodetic(trajectory: Trajectory, origin: Sequence[Real] | np.ndarray) -> np.ndarray:
    """Latitude, longitude (rad) and height (m) on WGS-84 of the positions, shape (N+1, 3).

    Parameters
    ----------
    trajectory
        In the tangent frame at `origin`.
    origin
        Latitude, longitude (rad) and height (m).
    """
    return geodetic_from_ned(trajectory.position, checked_origin(origin))


def _assemble(time, p, euler, v, system: str, origin: Sequence[Real] | np.ndarray | None, name: str) -> Trajectory:
    if system == "ned":
        if origin is not None:
            raise ValueError("An origin belongs to geodetic positions, and these are north, east, down.")
        return Trajectory.from_euler(time, p, euler, velocity=v, name=name)
    check_geodetic(p)
    centre = checked_origin(p[0] if origin is None else origin)
    # from the local frame of each point to that of the origin
    turn = dcm_ned_from_ecef(centre[0], centre[1]) @ dcm_ned_from_ecef(p[:, 0], p[:, 1]).transpose(0, 2, 1)
    q = _turned(turn.transpose(1, 2, 0), euler.T)
    velocity = None if v is None else np.einsum("kij,kj->ki", turn, v)
    ned = ned_from_geodetic(p, centre)
    warn_of_far_origin(ned, stacklevel=4)
    found = Trajectory.from_quaternion(time, ned, np.asarray(q).T, velocity=velocity, name=name)
    return replace(found, origin=centre)


@jax.jit
def _turned(dcm: Matrix, euler: Vector) -> Quaternion:
    return rotation.quat_multiply(rotation.quat_from_dcm(dcm), rotation.quat_from_euler(euler))
