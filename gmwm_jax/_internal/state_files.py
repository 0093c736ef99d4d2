"""States in files that hold nothing but numbers and text: JSON, NumPy's npz with a header of JSON, or netCDF and Zarr.

Every file says what it is (`FORMAT`, kind, version of the package) and has a sum over all of it. Files may come from
anywhere: a reader believes no size before it has seen so many bytes, and nothing is ever unpickled.
"""

import hashlib
import importlib
import io
import json
import math
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.limits import MAX_HEADER, MAX_JSON
from gmwm_jax._internal.states import State
from gmwm_jax._internal.stores import SUFFIXES as DATASETS
from gmwm_jax._internal.stores import import_xarray, write_dataset

FORMAT = 1
"""Of all files. Raised when a reader of the former one would misunderstand it."""

_HEADER = "header.json"
_DTYPES = {"bool": "|b1", "int32": "<i4", "int64": "<i8", "float64": "<f8"}
"""Name -> what it is in an npz."""

_STATE = "state"
"""Variable of a dataset that holds the header."""


class NewerVersionError(ValueError):
    """It is of a format that was not known when this version was written."""


class Content(NamedTuple):
    """What a file says that it holds."""

    kind: str
    state: State


def write_state(path: Path, content: Content) -> Path:
    """Write a state in the format that the ending of the path asks for.

    Raises
    ------
    ValueError
        Another ending.
    ImportError
        The format needs a package that is not installed.
    OSError
        It cannot be written.
    """
    suffix = require_suffix(path)
    if suffix in DATASETS:
        return write_dataset(_to_dataset(content), path)
    if suffix == ".json":
        text = _to_json(content)
        return write_atomically(path, lambda file: file.write(text.encode()))
    return write_atomically(path, lambda file: _write_npz(file, content))


def read_state(path: Path) -> Content:
    """Read and check what `write_state` wrote as JSON or npz.

    Raises
    ------
    ValueError
        It is corrupt, cut off, hostile, of a newer version or of another program.
    """
    reader = _read_json if require_suffix(path) == ".json" else _read_npz
    return _checked(path, *_without_surprises(path, reader))


def state_of_dataset(path: Path, dataset: Any) -> Content:
    """The state in a dataset that `write_state` wrote; raises as `read_state`."""

    def read(_: Path) -> tuple[Any, dict[str, np.ndarray]]:
        header = json.loads(dataset[_STATE].item())
        return header, {str(name): _plain(dataset[name].values) for name in dataset.variables if name != _STATE}

    return _checked(path, *_without_surprises(path, read))


def _plain(values: np.ndarray) -> np.ndarray:
    """An array with the dtype of this machine: those of Zarr are equal to it, and not the same."""
    array = np.empty(values.shape, values.dtype.name)
    array[...] = values
    return array


def require_suffix(path: Path) -> str:
    """Return the ending of a path; raise a ValueError if results are in no files with it."""
    suffix = path.suffix.lower()
    if suffix not in (".npz", ".json", *DATASETS):
        raise ValueError(f"Results are .npz, .json or .nc files or .zarr folders, and the path is {path}.")
    return suffix


# -- what all formats have in common ----------------------------------------------------------------------------------


def _header(content: Content) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "kind": content.kind,
        "version": importlib.import_module("gmwm_jax").__version__,
        "checksum": _checksum(content),
        "state": content.state.tree,
    }


def _checksum(content: Content) -> str:
    """A sum over the kind, the tree and all arrays; of all NaN it sees one."""
    arrays = content.state.arrays
    described = [[name, a.dtype.name, list(a.shape)] for name, a in sorted(arrays.items())]
    total = hashlib.sha256(json.dumps([content.kind, content.state.tree, described]).encode())
    for _, array in sorted(arrays.items()):
        plain = np.where(np.isnan(array), np.nan, array) if array.dtype.kind == "f" else array
        total.update(np.ascontiguousarray(plain).reshape(-1).view(np.uint8).data)
    return total.hexdigest()


def _without_surprises(path: Path, read: Callable[[Path], Any]) -> Any:
    try:
        return read(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"There is no {path.resolve()}.") from None
    except OSError as error:
        raise OSError(f"{path} cannot be read: {error.strerror or error}.") from error
    # of zip, JSON and text there are too many kinds to name, and a hostile file may bring any of them about
    except Exception as error:
        raise ValueError(f"{path} cannot be read: it is corrupt, cut off or something else ({error}).") from error


def _checked(path: Path, header: Any, arrays: Mapping[str, np.ndarray]) -> Content:
    if not isinstance(header, dict) or not {"format", "kind", "checksum", "state"} <= set(header):
        raise ValueError(f"{path} was not written by save(): it does not say what it holds.")
    if not isinstance(header["format"], int) or header["format"] > FORMAT:
        raise NewerVersionError(
            f"{path} was written by a newer version (format {header['format']!r:.50}, known is {FORMAT}): update "
            "gmwm-jax."
        )
    content = Content(str(header["kind"]), State(header["state"], arrays))
    if _checksum(content) != header["checksum"]:
        raise ValueError(f"{path} is not what was written: it was changed or damaged, and a copy of it is needed.")
    return content


# -- JSON -------------------------------------------------------------------------------------------------------------


def _to_json(content: Content) -> str:
    """One line a part and an array; numbers with all their digits."""
    lines = [f"{json.dumps(k)}: {_dumps(v)}" for k, v in _header(content).items()]
    arrays = []
    for name, array in content.state.arrays.items():
        values = array.ravel().tolist()
        if array.dtype.kind == "f":
            values = [v if math.isfinite(v) else str(v) for v in values]
        arrays.append(
            f"{json.dumps(name)}: {_dumps({'dtype': array.dtype.name, 'shape': array.shape, 'values': values})}"
        )
    listed = ",\n  ".join(arrays)
    return "{\n" + ",\n".join([*lines, f'"arrays": {{\n  {listed}\n}}']) + "\n}\n"


def _dumps(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _read_json(path: Path) -> tuple[Any, dict[str, np.ndarray]]:
    if (size := path.stat().st_size) > MAX_JSON:
        raise ValueError(f"it has {size} bytes, and at most {MAX_JSON} are read")
    header = json.loads(path.read_bytes(), parse_constant=_refuse)
    listed = header.pop("arrays", {}) if isinstance(header, dict) else {}
    return header, {name: _array_of_json(**a) for name, a in listed.items()}


def _array_of_json(dtype: str, shape: list[int], values: list[Any]) -> np.ndarray:
    if dtype not in _DTYPES:
        raise ValueError(f"an array of dtype {dtype!r:.50}")
    kinds: dict[str, Any] = {"bool": bool, "int32": int, "int64": int, "float64": (int, float, str)}
    if not all(isinstance(v, kinds[dtype]) for v in values):
        raise ValueError(f"an array of {dtype} with other values")
    # a text is only what stands for NaN or infinity
    if dtype == "float64" and (wrong := {v for v in values if isinstance(v, str)} - {"nan", "inf", "-inf"}):
        raise ValueError(f"a number {wrong.pop()!r:.50}")
    return np.array([float(v) for v in values] if dtype == "float64" else values, dtype=dtype).reshape(shape)


def _refuse(text: str) -> Any:
    raise ValueError(f"{text} is no number of JSON")


# -- npz --------------------------------------------------------------------------------------------------------------


def _write_npz(file: IO[bytes], content: Content) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        # members without a date: equal results make equal files
        archive.writestr(zipfile.ZipInfo(_HEADER), _dumps(_header(content)))
        for name, array in content.state.arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array).reshape(array.shape), allow_pickle=False)


def _read_npz(path: Path) -> tuple[Any, dict[str, np.ndarray]]:
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        names = [m.filename for m in members]
        if len(set(names)) < len(names) or _HEADER not in names:
            raise ValueError(f"it has no {_HEADER}, or a member twice")
        for member in members:
            # what is not compressed is not larger than the file
            if member.compress_type != zipfile.ZIP_STORED or member.file_size > os.path.getsize(path):
                raise ValueError(f"{member.filename!r:.50} is compressed")
            if member.filename != _HEADER and not member.filename.endswith(".npy"):
                raise ValueError(f"{member.filename!r:.50} is no array")
        if (size := archive.getinfo(_HEADER).file_size) > MAX_HEADER:
            raise ValueError(f"its header has {size} bytes, and at most {MAX_HEADER} are read")
        header = json.loads(archive.read(_HEADER), parse_constant=_refuse)
        return header, {n.removesuffix(".npy"): _read_npy(archive.read(n)) for n in names if n != _HEADER}


def _read_npy(content: bytes) -> np.ndarray:
    """An array from all bytes of its file: of one of our dtypes, and of as many values as there are bytes."""
    file = io.BytesIO(content)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise ValueError(f"an array of version {version}")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
    rest = memoryview(content)[file.tell() :]
    if dtype.str not in _DTYPES.values() or fortran or len(rest) != math.prod(shape) * dtype.itemsize:
        raise ValueError(f"an array of dtype {dtype} and shape {shape} in {len(rest)} bytes")
    return np.frombuffer(rest, dtype).reshape(shape).copy()


# -- netCDF and Zarr --------------------------------------------------------------------------------------------------


def _to_dataset(content: Content) -> Any:
    """Each array as a variable, and the header as text."""
    xarray = import_xarray()
    data: dict[str, Any] = {
        name: (tuple(f"{name}_{i}" for i in range(array.ndim)), array) for name, array in content.state.arrays.items()
    }
    data[_STATE] = ((), np.array(_dumps(_header(content)), dtype=object))
    return xarray.Dataset(data, attrs={"kind": content.kind})
