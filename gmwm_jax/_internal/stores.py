"""Results on disk: an xarray Dataset as a Zarr folder or a netCDF file, there whole or not at all.

What was written is checked by sums when it is read: Zarr takes a chunk that is missing for one full of NaN, and a
result with holes looks like one with failed runs.
"""

import importlib
import json
import math
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gmwm_jax._internal.atomic import make_atomically, settle_abandoned
from gmwm_jax._internal.hdf5 import bytes_of_hdf5
from gmwm_jax._internal.limits import TooLargeError, require_size

if TYPE_CHECKING:
    import xarray

FORMAT = 1
"""Of the file. Raised when a reader of the former one would misunderstand it."""

_HEADERS = 1 << 20
"""Bytes of a netCDF file besides its arrays."""

_TEXT_FILTER = "vlen-utf8"
"""Of arrays of text in a Zarr folder, the only filter that one of ours has."""

_ITEM = 8
"""Bytes of a value."""

SUFFIXES = (".zarr", ".nc")

_ENGINES = {".zarr": ("zarr", ("zarr",)), ".nc": ("h5netcdf", ("h5netcdf", "h5py"))}
"""Ending -> xarray's engine, and the packages that it needs."""


def import_xarray(*also: str) -> Any:
    """Import xarray, or raise an ImportError that says how to install it.

    Parameters
    ----------
    also
        Other modules that will be needed.
    """
    for name in ("xarray", *also):
        try:
            importlib.import_module(name)
        except ImportError as error:
            raise ImportError(f'This needs the package {name}: pip install "gmwm-jax[io]"') from error
    return importlib.import_module("xarray")


def write_dataset(dataset: "xarray.Dataset", path: str | os.PathLike) -> Path:
    """Write a Dataset: a former result is replaced by a whole new one, or stays.

    Parameters
    ----------
    dataset
        With the attribute ``kind``, by which `read_dataset` knows it.
    path
        A folder ``*.zarr`` or a file ``*.nc``; what leads there is made.

    Returns
    -------
    `path`.

    Raises
    ------
    FileExistsError
        There is something at `path` that is no result of this kind of file.
    OSError
        It cannot be written, as where the disk is full.
    """
    path = Path(path)
    engine = _engine(path)
    _replaceable(path, engine)
    sums = {str(name): _checksum(variable.values) for name, variable in dataset.variables.items()}
    marked = dataset.assign_attrs(format=FORMAT, checksums=json.dumps(sums))
    # no value stands for "missing": reading it back as NaN would lose the bits that the sums are about
    encoding = {name: {"_FillValue": None} for name, v in marked.variables.items() if v.dtype.kind == "f"}

    def make(new: Path) -> None:
        if engine == "zarr":
            marked.to_zarr(new, mode="w-", zarr_format=2, consolidated=True, encoding=encoding)
        else:
            _require_room(new, sum(v.nbytes for v in marked.variables.values()))
            marked.to_netcdf(new, engine="h5netcdf", encoding=encoding)

    return make_atomically(path, make)


def read_dataset(path: str | os.PathLike, max_bytes: int | None = None) -> "xarray.Dataset":
    """Read and check what `write_dataset` wrote, or xarray itself from the same Dataset.

    Parameters
    ----------
    path
        A folder ``*.zarr`` or a file ``*.nc``.
    max_bytes
        To which it may unfold.

    Returns
    -------
    A Dataset with the attribute ``kind``.

    Raises
    ------
    FileNotFoundError
        There is nothing.
    ValueError
        It is corrupt, cut off or of another program.
    """
    path = Path(path)
    engine = _engine(path)
    xarray = import_xarray()
    if not path.exists():
        settle_abandoned(path)
    if not path.exists():
        raise FileNotFoundError(f"There is no {path.resolve()}.")
    try:
        if engine == "zarr":
            _require_plain(path)
            parts = [file for file in path.rglob("*") if file.is_file()]
            require_size("The result", _bytes_of_zarr(path), sum(file.stat().st_size for file in parts), max_bytes)
        else:
            require_size("The result", bytes_of_hdf5(path), path.stat().st_size, max_bytes)
        # a folder says all of itself in one more file, or does not: that of a campaign grows
        how = {"consolidated": False} if engine == "zarr" else {}
        found = xarray.load_dataset(path, engine=engine, decode_times=False, **how)
    except TooLargeError as error:
        raise TooLargeError(f"{path}: {error}") from error
    except Exception as error:  # of HDF5, Zarr, its codecs and JSON there are too many kinds to name
        raise ValueError(
            f"{path} cannot be read as {engine}: it is corrupt, cut off or something else ({error})."
        ) from error
    if not isinstance(found.attrs.get("kind"), str):
        seen = ", ".join(map(str, found)) or "no data"
        raise ValueError(f"{path} was not saved by gmwm_jax or nav_jax. It has {seen}.")
    version = found.attrs.get("format", FORMAT)
    if not isinstance(version, int | np.integer) or version > FORMAT:
        raise ValueError(
            f"{path} was written by a newer version (format {version}, known is {FORMAT}): update gmwm-jax."
        )
    try:
        sums = dict(json.loads(found.attrs.pop("checksums", "{}")))
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} is corrupt: its checksums cannot be read.") from error
    if missing := set(sums) - set(map(str, found.variables)):
        raise ValueError(f"{path} is not whole: {', '.join(sorted(missing))} is missing.")
    for name, expected in sums.items():
        if _checksum(found[name].values) != expected:
            raise ValueError(f"{path} is corrupt: {name} is not what was written. A part may be missing or changed.")
    return found


def _require_plain(path: Path) -> None:
    """Raise unless the arrays of a Zarr folder are numbers and text: it may ask its reader to unpickle."""

    def filters(node: Any) -> Iterator[Any]:
        if isinstance(node, dict):
            yield from node.get("filters") or []
        for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else []:
            yield from filters(child)

    for name in (".zarray", ".zmetadata", "zarr.json"):
        for file in path.rglob(name):
            for one in filters(json.loads(file.read_bytes())):
                if not isinstance(one, dict) or one.get("id") != _TEXT_FILTER:
                    raise ValueError(f"{file.relative_to(path)} has the filter {one!r:.80}")


def _bytes_of_zarr(path: Path) -> int:
    """Bytes in memory of all arrays of a folder: a chunk that is not there is filled up."""
    shapes = [
        json.loads(file.read_bytes()).get("shape", ()) for name in (".zarray", "zarr.json") for file in path.rglob(name)
    ]
    return sum(_ITEM * math.prod(shape) for shape in shapes)


def _engine(path: Path) -> str:
    engine, packages = _ENGINES[path.suffix.lower()]
    import_xarray(*packages)
    return engine


def _checksum(values: np.ndarray) -> int:
    if values.dtype.kind in "OUT":
        return zlib.crc32("\0".join(map(str, values.ravel())).encode())
    return zlib.crc32(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)


def _replaceable(path: Path, engine: str) -> None:
    """Raise if `path` is there and is no result: a wrong path must not cost anybody their data."""
    if not path.exists():
        return
    if engine == "zarr":
        is_store = path.is_dir() and any((path / mark).exists() for mark in (".zgroup", "zarr.json"))
        known = is_store or (path.is_dir() and not any(path.iterdir()))
    else:
        known = path.is_file()
    if not known:
        raise FileExistsError(f"{path} is there and is no {path.suffix} result: it stays. Choose another path.")


def _require_room(path: Path, num_bytes: int) -> None:
    """Raise an OSError where the disk has no room for a file: HDF5 would end the process."""
    if hasattr(os, "posix_fallocate"):
        with path.open("xb") as file:
            os.posix_fallocate(file.fileno(), 0, num_bytes + _HEADERS)
        path.unlink()
