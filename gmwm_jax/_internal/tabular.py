"""The one reader of tables: files of every format, arrays, mappings, data frames and xarray Datasets.

A new format is one function here and one row in `_OPENERS`. What the columns mean is the business of the rooms.
"""

import difflib
import os
import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.columns import Columns
from gmwm_jax._internal.formats.registry import FORMATS, TEXT, recognise
from gmwm_jax._internal.formats.ros_bag import BAGS
from gmwm_jax._internal.hdf5 import bytes_of_hdf5
from gmwm_jax._internal.limits import TooLargeError, require_size
from gmwm_jax._internal.numpy_files import load_arrays
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.r_files import load_r
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.text_files import TEXT_SUFFIXES, open_text
from gmwm_jax._internal.text_source import COMPRESSED, inner_name, text_source, unpacked, unpacking

_FOLDERS = ("those of rosbag2 (metadata.yaml)", "oxts of KITTI (data, timestamps.txt)")

SAVED_RECORDING = ("data", "rate", "channels", "units", "name")
"""Variables of the ``.npz`` file of a recording that this package saved."""


def open_source(source: Any, how: Reading | None = None) -> Columns:
    """Open a file, an array, a mapping of arrays, a pandas DataFrame or an xarray Dataset.

    Raises
    ------
    FileNotFoundError, ImportError
        There is no such file, or its format needs the extra ``io``.
    ValueError
        A corrupt file or one of an unknown kind; an array that is no table.
    """
    if isinstance(source, str | os.PathLike):
        return open_file(Path(source), how)
    if hasattr(source, "data_vars"):
        return _of_dataset(source)
    if hasattr(source, "iloc"):
        return _of_frame(source)
    if hasattr(source, "items"):
        return _of_mapping({str(name): np.asarray(values) for name, values in source.items()})
    array = np.asarray(source)
    if array.ndim != 2 or array.dtype.kind not in "iuf":
        raise ValueError(f"A table of numbers has one row an epoch, and this is {array.dtype} of shape {array.shape}.")
    return _of_array(array)


def open_file(file: Path, how: Reading | None = None) -> Columns:
    """Open a file or a folder: as the format that is asked for, else as its suffix or its content tells.

    Raises
    ------
    FileNotFoundError, ImportError, ValueError
        See `open_source`.
    """
    how = how or Reading()
    require_file(file)
    if how.format is not None and how.format not in (*FORMATS, TEXT):
        raise ValueError(f"Unknown format {how.format!r}; known are {', '.join(FORMATS)} and {TEXT}.")
    if file.is_dir() or Path(inner_name(file)).suffix.lower() in BAGS:
        for known in FORMATS.values():
            if known.is_folder(file) and how.format in (None, known.name):
                return _unpacked(known.open_folder, file, how)
        raise ValueError(f"This is no recording; folders that are read: {', '.join(_FOLDERS)}.")
    suffix = Path(inner_name(file)).suffix.lower()
    opener = _OPENERS.get(suffix)
    if how.format is None and opener is not None and opener is not _open_text:
        return _unpacked(opener, file, how)
    if how.format is None and opener is None and not _is_of_logger(file):
        raise ValueError(
            f"Unknown suffix {suffix!r}; read are {' '.join((*_OPENERS, *BAGS, *COMPRESSED))}. If it is text, say "
            f'format="text", or the format of its logger ({", ".join(FORMATS)}).'
        )
    return _open_text(file, how)


def require_file(file: Path, hint: str = "") -> None:
    """Raise a FileNotFoundError that names files of a similar name, unless this one is there."""
    if file.is_file() or (file.is_dir() and any(known.is_folder(file) for known in FORMATS.values())):
        return
    if file.is_dir():
        raise FileNotFoundError(f"{file.absolute()} is a folder, not a file.")
    if file.is_symlink():
        raise FileNotFoundError(f"{file.absolute()} is a link to a file that is not there.")
    near = difflib.get_close_matches(file.name, os.listdir(file.parent)) if file.parent.is_dir() else []
    similar = f" Files of a similar name are there: {', '.join(near)}." if near else ""
    raise FileNotFoundError(f"There is no file {file.absolute()}.{similar}{hint}")


def _is_of_logger(file: Path) -> bool:
    """Does the content tell a logger's format, whatever the suffix?"""
    source = text_source(file)
    with unpacking(), source.open() as stream:
        if b"\0" in stream.read(4096):
            return False
    return recognise(source.head()) is not None


def _unpacked(opener: Callable[[Path, Reading], Columns], file: Path, how: Reading) -> Columns:
    """Open a file of a binary format, which is unpacked into a temporary one if it is packed."""
    if file.is_dir() or file.suffix.lower() not in COMPRESSED:
        return opener(file, how)
    folder = tempfile.mkdtemp()
    copy = Path(folder) / Path(inner_name(file)).name
    try:
        with unpacking(), unpacked(file, how.told, how.max_bytes) as stream, copy.open("wb") as target:
            shutil.copyfileobj(stream, target)
        table = opener(copy, how)
    except BaseException:
        shutil.rmtree(folder)
        raise

    def load(picked: list[int]) -> Sequence[np.ndarray]:
        return table.load(picked)

    weakref.finalize(load, shutil.rmtree, folder)  # it lives as long as what may read it
    return table._replace(load=load)


@contextmanager
def _parsing(kind: str) -> Iterator[None]:
    """Say that the file is bad, whichever of a dozen errors its library or decompressor raises."""
    try:
        yield
    except (PermissionError, MemoryError, TooLargeError):
        raise
    except Exception as error:
        raise ValueError(
            f"This is no {kind} file, or it is truncated or corrupt: fetch or save it again. "
            f"({type(error).__name__}: {error})"
        ) from error


def _only(names: Sequence[str], variable: str | None) -> str:
    """Return the variable that is asked for, or the only one."""
    if variable in names or (variable is None and len(names) == 1):
        return variable or names[0]
    if not names:
        raise ValueError("The file holds no variables.")
    asked = "variable=... is needed to choose one" if variable is None else f"there is no variable {variable!r}"
    raise ValueError(f"The file holds {len(names)} variables ({', '.join(names)}); {asked}.")


def _of_array(values: np.ndarray, names: Iterable[Any] | None = None, rate: float | None = None) -> Columns:
    """Make a table of a vector or matrix."""
    if values.ndim not in (1, 2):
        raise ValueError(f"A table has the shape (N,) or (N, C), time on axis 0, and this one {values.shape}.")
    columns = values[:, None] if values.ndim == 1 else values
    written = None if names is None else tuple(map(str, names))
    if written is not None and len(written) != columns.shape[1]:
        raise ValueError(f"{len(written)} names of columns were found for {columns.shape[1]} columns.")
    return Columns(written, columns.shape[1], lambda picked: [columns[:, i] for i in picked], rate=rate)


def _of_mapping(variables: Mapping[str, np.ndarray], units: Mapping[str, str] | None = None) -> Columns:
    """Make a table of those variables that are vectors."""
    series = {name: values for name, values in variables.items() if values.ndim == 1}
    if not series:
        raise ValueError(f"There is no column among {', '.join(variables) or 'no variables at all'}.")
    if len({len(values) for values in series.values()}) > 1:
        listed = ", ".join(f"{name} {len(values)}" for name, values in series.items())
        raise ValueError(f"The columns of a table have one length, and these differ: {listed}.")
    columns = tuple(series.values())
    skipped = tuple(name for name in variables if name not in series)
    stated = {} if units is None else units
    text = frozenset(i for i, values in enumerate(columns) if values.dtype.kind in "USOb")
    return Columns(
        tuple(series), len(series), lambda picked: [columns[i] for i in picked], stated, skipped=skipped, text=text,
        load_text=lambda i, parse: parse(columns[i].astype(str)),
    )  # fmt: skip


def _of_frame(frame: Any) -> Columns:
    names = tuple(map(str, frame.columns))
    return Columns(names, len(names), lambda picked: [np.asarray(frame.iloc[:, i]) for i in picked])


def _of_dataset(dataset: Any) -> Columns:
    variables = {str(name): values for name, values in {**dataset.coords, **dataset.data_vars}.items()}
    units = {name: str(v.attrs["units"]) for name, v in variables.items() if "units" in v.attrs}
    return _of_mapping({name: np.asarray(v.values) for name, v in variables.items()}, units)


def _open_numpy(file: Path, how: Reading) -> Columns:
    """Open an array, a saved recording, a table with its names, or one of vectors that are its columns."""
    with _parsing("NumPy"):
        arrays = load_arrays(file, how.max_bytes)
    if set(arrays) == set(SAVED_RECORDING):
        data, rate, channels, units, name = (arrays[key] for key in SAVED_RECORDING)
        stated = dict(zip(channels.tolist(), units.tolist(), strict=True))
        return _of_array(data, channels.tolist(), rate.item())._replace(units=stated, title=name.item())
    if set(arrays) == {"data", "columns"}:
        return _of_array(arrays["data"], arrays["columns"])
    if len(arrays) > 1 and how.variable is None and any(values.ndim == 1 for values in arrays.values()):
        return _of_mapping(arrays)
    return _of_array(arrays[_only(list(arrays), how.variable)])


def _require_one_table(how: Reading) -> None:
    if how.variable is not None:
        raise ValueError(
            f"There is no variable {how.variable!r}, since such a file is one table: variable=... is for .npz, R data "
            "and the topics of a bag."
        )


def _open_parquet(file: Path, how: Reading) -> Columns:
    _require_one_table(how)
    parquet = import_optional("pyarrow.parquet")
    with _parsing("Parquet"):
        footer = parquet.read_metadata(file)
        names = footer.schema.to_arrow_schema().names

    def load(picked: list[int]) -> list[np.ndarray]:
        require_size("The columns", _in_memory(footer, len(picked)), file.stat().st_size, how.max_bytes)
        with _parsing("Parquet"):
            table = parquet.read_table(file, columns=[names[i] for i in picked])
        return [table[names[i]].to_numpy() for i in picked]

    kinds = footer.schema.to_arrow_schema().types
    text = frozenset(i for i, kind in enumerate(kinds) if str(kind) in ("string", "large_string", "bool"))
    return Columns(
        tuple(names), len(names), load, text=text, load_text=lambda i, parse: parse(load([i])[0].astype(str))
    )


def _in_memory(footer: Any, columns: int) -> int:
    """Bytes of some columns of a Parquet file: their numbers, or what its pages unpack to."""
    groups = [footer.row_group(i) for i in range(footer.num_row_groups)]
    return max(8 * footer.num_rows * columns, sum(group.total_byte_size for group in groups))


def _open_netcdf(file: Path, how: Reading) -> Columns:
    _require_one_table(how)
    xarray = import_optional("xarray")
    import_optional("h5netcdf")
    with _parsing("netCDF"):
        require_size("The variables", bytes_of_hdf5(file), file.stat().st_size, how.max_bytes)
    with _parsing("netCDF"), xarray.open_dataset(file, engine="h5netcdf", decode_timedelta=False) as dataset:
        return _of_dataset(dataset)


def _open_r(file: Path, how: Reading) -> Columns:
    """Open a vector, matrix or data frame of R.

    An object of class ``imu`` (of the R packages gmwm and simts) states its rate, one of class ``trajectory`` (of the R
    package navigation) its kind of position.
    """
    import_optional("rdata")
    classes = {
        "imu": lambda value, attributes: (value, attributes),
        "ts": lambda value, attributes: value,  # by default it gets an index of fractions, one a sample
    }
    with _parsing("R data"):
        objects = load_r(file, how.max_bytes, classes)
    found = objects[_only(list(objects), how.variable)]
    if isinstance(found, dict) and {"trajectory", "system"} <= set(found):
        system = {"ned": "ned", "ellipsoidal": "geodetic"}.get(str(np.ravel(found["system"])[0]))
        return _of_r(found["trajectory"])._replace(position=system, angles="rad")
    value, attributes = found if isinstance(found, tuple) else (found, {})
    return _of_r(value, float(attributes["freq"][0]) if "freq" in attributes else None)


def _of_r(value: Any, rate: float | None = None) -> Columns:
    if hasattr(value, "iloc"):
        return _of_frame(value)
    if hasattr(value, "coords"):  # an array with names along some of its axes
        names = value.coords.get(value.dims[1]) if value.ndim == 2 else None
        return _of_array(value.values, None if names is None else names.values, rate)
    if isinstance(value, np.ma.MaskedArray):  # NA among integers
        value = np.ma.filled(value.astype(np.float64), np.nan)
    if isinstance(value, np.ndarray):
        return _of_array(value, rate=rate)
    raise ValueError(f"The R object is a {type(value).__name__}, and no numeric vector, matrix or data frame.")


def _open_text(file: Path, how: Reading) -> Columns:
    _require_one_table(how)
    source = text_source(file, how.max_bytes)
    if how.told is not None:
        source = source.watched(how.told)
    if how.format == TEXT:
        return open_text(source, how.delimiter, how.header)
    if how.format is not None:
        return FORMATS[how.format].open_text(source, how)
    known = recognise(source.head())
    return open_text(source, how.delimiter, how.header) if known is None else known.open_text(source, how)


_OPENERS: dict[str, Callable[[Path, Reading], Columns]] = {
    ".npy": _open_numpy,
    ".npz": _open_numpy,
    ".parquet": _open_parquet,
    ".rda": _open_r,
    ".rdata": _open_r,
    ".nc": _open_netcdf,
    **dict.fromkeys(TEXT_SUFFIXES, _open_text),
}
"""Suffix -> what opens such a file."""
