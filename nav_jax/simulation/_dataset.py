"""Runs as an xarray Dataset and back.

One layout serves memory and disk, one model and several: what belongs to a model is a variable without dimension, so
that Datasets of models are put together along a new dimension `model` by xarray itself. Where one model has less than
another (runs, groups, sensors, tracks), the gap is NaN, and status, dof or size of the innovation say so.
"""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from gmwm_jax._internal.stores import import_xarray
from nav_jax.filter.layout import GROUPS, JUDGED

if TYPE_CHECKING:
    import xarray

RUNS_KIND = "nav_jax runs"

NOT_RUN = -1
"""Status of a run that another model has and this one has not."""

TRACK_FIELDS = {
    "position": ("axis", "m"), "velocity": ("axis", "m/s"), "quaternion": ("quaternion", "1"),
    "sensor_errors": ("channel", "m/s^2, rad/s"), "sd": ("component", "of each component: see the coordinate unit"),
}  # fmt: skip
"""What a track consists of besides its time -> name of the last axis, unit."""


def runs_to_dataset(runs: Any) -> "xarray.Dataset":
    """The Dataset of `nav_jax.simulation.runs.Runs`; its big arrays are not copied."""
    xarray = import_xarray()
    groups = [g for g in GROUPS if g in runs.nees]
    nees = [runs.nees[g] for g in groups]
    mixed = {"units": "of each component: see the coordinate unit"}
    data: dict[str, Any] = {
        "error": (("run", "time", "component"), runs.error, {"long_name": "estimate - truth", **mixed}),
        "sd": (("run", "time", "component"), runs.sd, {"long_name": "standard deviation by the filter", **mixed}),
        "position_covariance": (("run", "time", "axis", "axis_2"), runs.position_covariance, {"units": "m^2"}),
        "nees": (
            ("run", "time", "group"),
            np.stack(nees, axis=-1) if nees else np.empty((*runs.error.shape[:2], 0)),
            {"units": "1", "long_name": "normalised estimation error squared"},
        ),
        "dof": (("group",), np.array([runs.dof[g] for g in groups], np.int64)),
        "status": (("run",), runs.status.astype(np.int64), {"long_name": "0 where the run is ok"}),
        "num_requested": ((), runs.num_requested),
        "notes": ((), _json(runs.notes)),
        "sensors": ((), _json(list(runs.nis))),
        "outages": (
            (),
            _json({s: [[float(a), float(b)] for a, b in of] for s, of in runs.outages.items()}),
            {"units": "s"},
        ),
    }
    coordinates: dict[str, Any] = {
        "model": _text(runs.name),
        "run": np.arange(len(runs)),
        "time": ("time", runs.time, {"units": "s"}),
        "component": _text(JUDGED.components),
        "unit": ("component", _text(JUDGED.units)),
        "group": _text(groups),
        "axis": _text(("n", "e", "d")),
        "axis_2": _text(("n", "e", "d")),
    }
    for sensor, nis in runs.nis.items():
        data[f"nis_{sensor}"] = (("run", f"time_{sensor}"), nis, {"units": "1"})
        data[f"nis_dof_{sensor}"] = ((), runs.nis_dof[sensor])
        coordinates[f"time_{sensor}"] = (f"time_{sensor}", runs.nis_time[sensor], {"units": "s"})
        if sensor in runs.innovation:
            dims = ("run", f"time_{sensor}", f"row_{sensor}")
            data[f"innovation_{sensor}"] = (dims, runs.innovation[sensor], {"units": "SI"})
    if runs.tracks:
        tracks = list(runs.tracks.values())
        coordinates["track"] = ("track", np.array(list(runs.tracks), np.int64), {"long_name": "number of the run"})
        for side, parts in (("track", tracks), ("before", [t.before for t in tracks])):
            coordinates[f"{side}_time"] = (f"{side}_time", parts[0].time, {"units": "s"})
            for name, (last, unit) in TRACK_FIELDS.items():
                stacked = np.stack([getattr(t, name) for t in parts])
                data[f"{side}_{name}"] = (("track", f"{side}_time", last), stacked, {"units": unit})
    return xarray.Dataset(data, coordinates, {"kind": RUNS_KIND, "frames": "n: NED; b: forward, right, down; SI"})


def dataset_to_fields(dataset: "xarray.Dataset") -> dict[str, Any]:
    """The fields of `nav_jax.simulation.runs.Runs`, with each track as a dict.

    Parameters
    ----------
    dataset
        Of one model.

    Raises
    ------
    ValueError
        It lacks something that `runs_to_dataset` writes.
    """
    try:
        return _fields(dataset)
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"This Dataset is not one that to_xarray made: {error}.") from error


def join_models(datasets: Sequence["xarray.Dataset"]) -> "xarray.Dataset":
    """Datasets of several models as one along `model`."""
    xarray = import_xarray()
    fill: dict[str, Any] = {str(name): np.nan for one in datasets for name in one.variables}
    fill |= {name: 0 for name in fill if name == "dof" or name.startswith("nis_dof")} | {"status": NOT_RUN}
    joined = xarray.concat(
        list(datasets),
        "model",
        data_vars="all",
        coords="minimal",
        compat="override",
        join="outer",
        combine_attrs="override",
        fill_value=fill,
    )
    order = [g for g in GROUPS if g in joined["group"].values]
    return joined.sel(group=order) if order != joined["group"].values.tolist() else joined


def _fields(one: "xarray.Dataset") -> dict[str, Any]:
    if tuple(map(str, one["component"].values)) != JUDGED.components:
        raise KeyError(f"the components are {', '.join(map(str, one['component'].values))}")
    there = one["status"].values != NOT_RUN
    if not np.all(there):
        one = one.isel(run=there)
    dof = {str(g): int(n) for g, n in zip(one["group"].values, one["dof"].values, strict=True) if n}
    sensors = json.loads(one["sensors"].item())
    kept = [s for s in sensors if f"innovation_{s}" in one and not np.all(np.isnan(one[f"innovation_{s}"].values))]
    return {
        "name": str(one["model"].item()),
        **{name: one[name].values for name in ("time", "error", "sd", "position_covariance", "status")},
        "nees": {g: one["nees"].sel(group=g).values for g in dof},
        "dof": dof,
        "nis": {s: one[f"nis_{s}"].values for s in sensors},
        "nis_time": {s: one[f"time_{s}"].values for s in sensors},
        "nis_dof": {s: int(one[f"nis_dof_{s}"].item()) for s in sensors},
        "innovation": {s: one[f"innovation_{s}"].values for s in kept},
        "outages": {s: tuple(map(tuple, ends)) for s, ends in json.loads(one["outages"].item()).items()},
        "notes": tuple(json.loads(one["notes"].item())),
        "num_requested": int(one["num_requested"].item()),
        "tracks": _tracks(one),
    }


def _tracks(one: "xarray.Dataset") -> dict[int, tuple[dict[str, np.ndarray], dict[str, np.ndarray]]]:
    """Number of the run -> arrays of its track, and of the side before the updates."""
    if "track" not in one.coords:
        return {}
    found = {}
    for i, number in enumerate(one["track"].values):
        after, before = (
            {"time": one[f"{side}_time"].values} | {n: one[f"{side}_{n}"].values[i] for n in TRACK_FIELDS}
            for side in ("track", "before")
        )
        if not np.all(np.isnan(after["position"])):  # a track of another model
            found[int(number)] = after, before
    return found


def _text(x: str | Sequence[str]) -> np.ndarray:
    """As objects: text of fixed length has no place in Zarr's third format."""
    return np.array(x if isinstance(x, str) else list(x), dtype=object)


def _json(x: Sequence | Mapping) -> np.ndarray:
    return np.array(json.dumps(x, ensure_ascii=False), dtype=object)
