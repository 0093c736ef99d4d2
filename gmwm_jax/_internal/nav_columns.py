"""What a source of a trajectory offers, whatever its format: columns of numbers, perhaps with names and units."""

import csv
import importlib
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat")


class Columns(NamedTuple):
    """Columns of equal length."""

    data: tuple[np.ndarray, ...]
    names: tuple[str, ...] | None = None
    units: Mapping[str, str] = {}
    """Column -> its unit, where the source states it apart from the name."""
    position: str | None = None
    """``ned`` or ``geodetic``, where the source states it."""
    angles: str | None = None


def open_source(source: Any, delimiter: str | None = None, variable: str | None = None) -> Columns:
    """Open a file, an array, a mapping of arrays, a pandas DataFrame or an xarray Dataset.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        The format needs the extra ``io``.
    ValueError
        A corrupt file or one of an unknown kind; an array that is no table.
    """
    if isinstance(source, str | os.PathLike):
        return _open_file(Path(source), delimiter, variable)
    if hasattr(source, "data_vars"):
        return _from_dataset(source)
    if hasattr(source, "items"):  # a mapping or a DataFrame
        return _named({str(name): np.asarray(values) for name, values in source.items()})
    return _matrix(np.asarray(source))


def import_optional(module: str) -> Any:
    """Import a module of the extra ``io``, or raise an ImportError that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f'This needs the package {module.split(".")[0]}: pip install "gmwm-jax[io]"') from error


def plain(name: str) -> str:
    """Make a name plain: ``Yaw [deg]`` becomes ``yaw_deg``."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _open_file(file: Path, delimiter: str | None, variable: str | None) -> Columns:
    suffix = file.suffix.lower()
    openers: dict[str, Callable[[], Columns]] = {
        ".npy": lambda: _open_numpy(file, variable),
        ".npz": lambda: _open_numpy(file, variable),
        ".parquet": lambda: _open_parquet(file),
        ".rda": lambda: _open_r(file, variable),
        ".rdata": lambda: _open_r(file, variable),
        ".nc": lambda: _open_netcdf(file),
        **{text: lambda: _open_text(file, delimiter) for text in TEXT_SUFFIXES},
    }
    if suffix not in openers:
        raise ValueError(f"Unknown suffix {file.suffix!r} of {file}; read are {' '.join(openers)}.")
    if not file.is_file():
        raise FileNotFoundError(f"There is no file {file.resolve()}.")
    return openers[suffix]()


@contextmanager
def _parsing(kind: str) -> Iterator[None]:
    """Say that the file is bad, whichever of a dozen errors its library or decompressor raises."""
    try:
        yield
    except (PermissionError, MemoryError):
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
    asked = "variable=... is needed to choose one" if variable is None else f"there is no variable {variable!r}"
    raise ValueError(f"The file holds {len(names)} variables ({', '.join(names)}); {asked}.")


def _matrix(values: np.ndarray, names: Any = None) -> Columns:
    if values.ndim != 2 or values.dtype.kind not in "iuf":
        raise ValueError(
            f"A trajectory is a table of numbers, one row an epoch, and this is {values.dtype} of shape {values.shape}."
        )
    if names is not None and len(names) != values.shape[1]:
        raise ValueError(f"{len(names)} names of columns were found for {values.shape[1]} columns.")
    return Columns(tuple(values.T), None if names is None else tuple(map(str, names)))


def _named(columns: Mapping[str, np.ndarray], units: Mapping[str, str] | None = None) -> Columns:
    series = {name: values for name, values in columns.items() if values.ndim == 1}
    if not series:
        raise ValueError(f"There is no column among {', '.join(columns) or 'no variables at all'}.")
    lengths = {len(values) for values in series.values()}
    if len(lengths) > 1:
        listed = ", ".join(f"{name} {len(values)}" for name, values in series.items())
        raise ValueError(f"The columns of a trajectory have one length, and these differ: {listed}.")
    return Columns(tuple(series.values()), tuple(series), {} if units is None else units)


def _from_dataset(dataset: Any) -> Columns:
    variables = {str(name): values for name, values in {**dataset.coords, **dataset.data_vars}.items()}
    units = {name: str(v.attrs["units"]) for name, v in variables.items() if "units" in v.attrs}
    return _named({name: np.asarray(v.values) for name, v in variables.items()}, units)


def _open_numpy(file: Path, variable: str | None) -> Columns:
    with _parsing("NumPy"), file.open("rb") as stream:
        loaded = np.load(stream, allow_pickle=False)
        arrays = {"": loaded} if isinstance(loaded, np.ndarray) else dict(loaded)
    if set(arrays) == {"data", "columns"}:
        return _matrix(arrays["data"], arrays["columns"])
    if len(arrays) > 1 and variable is None:
        return _named(arrays)
    return _matrix(arrays[_only(list(arrays), variable)])


def _open_parquet(file: Path) -> Columns:
    parquet = import_optional("pyarrow.parquet")
    with _parsing("Parquet"):
        table = parquet.read_table(file)
        return _named({name: table[name].to_numpy() for name in table.column_names})


def _open_netcdf(file: Path) -> Columns:
    xarray = import_optional("xarray")
    import_optional("h5netcdf")
    with _parsing("netCDF"), xarray.open_dataset(file, engine="h5netcdf", decode_timedelta=False) as dataset:
        return _from_dataset(dataset)


def _open_r(file: Path, variable: str | None) -> Columns:
    """Open an R matrix or data frame, or an object of class ``trajectory`` of the R package navigation."""
    rdata = import_optional("rdata")
    with _parsing("R data"), warnings.catch_warnings():
        warnings.simplefilter("error")  # an unknown file type is only a warning
        parsed = rdata.parser.parse_file(file)
        warnings.simplefilter("ignore")  # unknown classes: judged by what they hold
        objects = rdata.conversion.convert(parsed)
    found = objects[_only(list(objects), variable)]
    if isinstance(found, dict) and {"trajectory", "system"} <= set(found):
        system = {"ned": "ned", "ellipsoidal": "geodetic"}.get(str(np.ravel(found["system"])[0]))
        return _r_table(found["trajectory"])._replace(position=system, angles="rad")
    return _r_table(found)


def _r_table(value: Any) -> Columns:
    if hasattr(value, "iloc"):  # a data frame
        return _named({str(name): np.asarray(values) for name, values in value.items()})
    if hasattr(value, "coords"):  # a matrix with names
        names = value.coords.get(value.dims[-1])
        return _matrix(np.asarray(value.values), None if names is None else names.values)
    return _matrix(np.asarray(value))


def _open_text(file: Path, delimiter: str | None) -> Columns:
    """Open a text file with at most one line of names; comments begin with # or %."""
    lines = file.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    rows = [(i, line) for i, line in enumerate(lines, start=1) if line.strip() and line.lstrip()[0] not in "#%"]
    if not rows:
        raise ValueError("The file holds no line of data.")
    if delimiter is None:
        delimiter = next((d for d in ";\t," if d in rows[-1][1]), None)

    def fields(line: str) -> list[str]:
        parts = line.split() if delimiter is None else next(csv.reader([line], delimiter=delimiter))
        return [part.strip() for part in parts]

    names = fields(rows[0][1])
    if any(map(_is_number, names)):
        names = None
    else:
        rows = rows[1:]
    table: list[list[float]] = []
    for i, line in rows:
        parts = fields(line)
        width = len(names or (table[0] if table else parts))
        if len(parts) != width:
            raise ValueError(f"Line {i} has {len(parts)} fields, and the first line {width}.")
        wrong = next((part for part in parts if not _is_number(part)), None)
        if wrong is not None:
            hint = " Write decimal commas as points." if _is_number(wrong.replace(",", ".")) else ""
            raise ValueError(f"Line {i} holds {wrong!r}, and no number.{hint}")
        table.append([float(part) for part in parts])
    if not table:
        raise ValueError("The file holds a line of names and no data.")
    return _matrix(np.array(table), names)


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
