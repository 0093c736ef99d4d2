"""A navigation solution as a table, a map or an xarray Dataset."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.typing import Real
from nav_jax.filter.layout import JUDGED, ON_CHANNELS
from nav_jax.imu.channels import CHANNELS
from nav_jax.trajectory.files import save_trajectory, to_geodetic, trajectory_columns
from nav_jax.trajectory.maps import MAPS

if TYPE_CHECKING:
    import xarray

_TABLES = (".csv", ".npz")


# A Navigation is Any here: its own file imports this one.


def export_navigation(
    navigation: Any, path: str | os.PathLike[str], *, origin: Any, start: Any, interval: Real
) -> Path:
    """Write the track; parameters as of `Navigation.export`."""
    file = Path(path)
    origin = navigation.trajectory.origin if origin is None else origin
    suffix = file.suffix.lower()
    if suffix in MAPS:
        return save_trajectory(navigation.trajectory, file, origin=origin, start=start, interval=interval)
    if suffix not in _TABLES:
        raise ValueError(f"A track is exported as {', '.join((*_TABLES, *MAPS))}, and the path is {file}.")
    columns = table_columns(navigation, origin)
    if suffix == ".npz":
        arrays: Any = columns
        return write_atomically(file, lambda stream: np.savez(stream, **arrays))
    table, header = np.column_stack(list(columns.values())), ",".join(columns)
    return write_atomically(file, lambda stream: np.savetxt(stream, table, "%.17g", ",", header=header, comments=""))


def table_columns(navigation: Any, origin: Any = None) -> dict[str, np.ndarray]:
    """Name with its unit -> column: the trajectory, on an ellipsoid too, deviations, and errors of the sensors."""
    columns = trajectory_columns(navigation.trajectory)
    if origin is not None:
        geodetic = to_geodetic(navigation.trajectory, origin)
        columns |= dict(zip(("latitude_rad", "longitude_rad", "height_m"), geodetic.T, strict=True))
    names = [f"sd_{c}_{_written(u)}" for c, u in zip(JUDGED.components, JUDGED.units, strict=True)]
    columns |= dict(zip(names, navigation.sd.T, strict=True))
    units = JUDGED.units[ON_CHANNELS]
    errors = [f"{c.replace(' ', '_')}_error_{_written(u)}" for c, u in zip(CHANNELS, units, strict=True)]
    return columns | dict(zip(errors, navigation.sensor_errors.T, strict=True))


def _written(unit: str) -> str:
    return unit.replace("/", "_").replace("^", "")


def navigation_dataset(navigation: Any) -> "xarray.Dataset":
    """All of a solution; innovations of each sensor along a time of their own."""
    xarray = import_optional("xarray")
    t = navigation.trajectory
    arrays: dict[str, Any] = {
        "position": (("time", "ned"), t.position, {"units": "m"}),
        "velocity": (("time", "ned"), t.velocity, {"units": "m/s"}),
        "quaternion": (("time", "wxyz"), t.quaternion, {"units": "1", "long_name": "q_nb, scalar first"}),
        "euler": (("time", "rpy"), t.euler, {"units": "rad"}),
        "sd": (("time", "component"), navigation.sd),
        "sensor_errors": (("time", "channel"), navigation.sensor_errors),
    }
    coordinates: dict[str, Any] = {
        "time": ("time", t.time, {"units": "s"}),
        "ned": list("ned"),
        "wxyz": list("wxyz"),
        "rpy": ["roll", "pitch", "yaw"],
        "component": list(JUDGED.components),
        "component_unit": ("component", list(JUDGED.units)),
        "channel": list(CHANNELS),
        "channel_unit": ("channel", list(JUDGED.units[ON_CHANNELS])),
    }
    for fixes in navigation.fixes:
        name, unit = fixes.sensor.name, {"units": fixes.sensor.unit}
        dims = (f"{name}_time", f"{name}_axis")
        coordinates |= {dims[0]: (dims[0], fixes.time[fixes.given], {"units": "s"}), dims[1]: list(fixes.sensor.axes)}
        arrays[f"{name}_innovation"] = (dims, navigation.innovation[name], unit)
        arrays[f"{name}_innovation_sd"] = (dims, navigation.innovation_sd[name], unit)
        arrays[f"{name}_nis"] = (dims[:1], navigation.nis[name])
    for name, w in navigation.withheld.items():
        dims = (f"{name}_withheld_time", f"{name}_axis")
        coordinates[dims[0]] = (dims[0], w.time, {"units": "s"})
        arrays[f"{name}_withheld_error"] = (dims, w.error, {"units": w.unit})
        arrays[f"{name}_withheld_covariance"] = ((*dims, f"{name}_axis_2"), w.covariance)
    return xarray.Dataset(arrays, coordinates, {"status": navigation.status.name})
