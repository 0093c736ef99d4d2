"""Recordings from files and back: NumPy, Parquet, R data and text.

Each format is opened as `Columns`, text in `text_files`, the others here. The rest (choice of columns, rate, units)
is the same for all formats.
"""

import difflib
import importlib
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.tabular import Columns, plain_names
from gmwm_jax._internal.text_files import TEXT_SUFFIXES, open_text
from gmwm_jax._internal.typing import FloatLike, Names
from gmwm_jax.recordings._public_files import KNOWN_FILES, recognise
from gmwm_jax.recordings._timebase import rate_of_time
from gmwm_jax.recordings.recording import Recording

_SAVED = ("data", "rate", "channels", "units", "name")
_RATE_TOLERANCE = 0.01
_TIME = re.compile(r"t(_(s|ms|us|ns))?|(.*_)?(time|timestamps?|sec|secs|seconds?)(_.*)?")
"""Names of columns of time: ``t``, ``time_s``, ``timestamp_ns``, ``sys_time`` ..."""


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate: FloatLike | None = None,
    units: str | Sequence[str] | Mapping[str, str] | None = None,
    channels: Names | None = None,
    columns: Sequence[int | str] | None = None,
    time: int | str | None = None,
    time_unit: str = "s",
    delimiter: str | None = None,
    header: int | None = None,
    name: str | None = None,
    variable: str | None = None,
    gaps: bool = False,
) -> Recording:
    """Read a recording from a file; its suffix tells the format.

    Formats: ``.npy``, ``.npz``, ``.parquet``, R data (``.rda``, ``.rdata``) and text (``.csv``, ``.tsv``, ``.txt``,
    ``.dat``, ``.log``, ``.asc``; comments start with ``#`` or ``%``). Names in a file are made plain: ``Gyro. X`` is
    ``gyro_x``. What `save_recording` wrote and the public files of `gmwm_jax.datasets`, recognised by their content,
    need no further argument.

    Parameters
    ----------
    path
        The file.
    rate
        Sampling rate in Hz; needed unless the file states it or has a column of time. It is never guessed.
    units
        Unit of the samples in the file, see `Recording.from_array`.
    channels
        Names of the channels that are read, in place of those in the file.
    columns
        The columns to read, by name or number (from 0); default: all but that of time.
    time
        The column of time, by name or number. It must increase in even steps.
    time_unit
        Unit of that column: ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; timestamps need none.
    delimiter
        Of a text file; default: found among semicolon, tab, comma and blanks.
    header
        Number of lines of a text file to skip; default: comments and at most one line of names.
    name
        Name of the recording; default: the file name.
    variable
        The object to read, where an ``.npz`` or R file holds several.
    gaps
        Does NaN mark missing samples? Else it is an error (but in what `save_recording` wrote).

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        Parquet and R data need the extra ``io``.
    ValueError
        A file that is corrupt or no regular numeric series; a column of time that is neither named nor left out; a rate
        or unit that is missing or contradicts the file.
    """
    file = Path(path)
    _require_file(file)
    try:
        table = _open(file, delimiter, header, variable)
        known = recognise(file) if units is None and table.units is None else None
        if known is not None:
            table = table._replace(rate=table.rate or known.rate, units=known.units)
        elif units is not None and table.units is not None:
            raise ValueError(f"The file states its units ({', '.join(table.units)}): leave out units=...")
        timed = None if time is None else table.position(time)
        wanted = range(table.count) if columns is None else [table.position(column) for column in columns]
        picked = [i for i in wanted if i != timed]
        if not picked:
            raise ValueError("No column is left to read besides that of time.")
        labels = [table.names[i] if table.names else str(i) for i in picked]
        found = [label for label in labels if _TIME.fullmatch(label.lower())]
        if found and time is None and table.units is None:
            raise ValueError(f"Column {found[0]!r} looks like time: name it by time=..., or pick others by columns=...")
        loaded = list(table.load(picked if timed is None else [*picked, timed]))
        timed_rate = None if timed is None else rate_of_time(loaded.pop(), time_unit)
        samples = _stack(loaded, labels)
        saved = table.title is not None
        return Recording.from_array(
            samples,
            rate=_agreed_rate({"rate=": rate, "the file": table.rate, "the column of time": timed_rate}),
            units=[table.units[i] for i in picked] if table.units else units,
            channels=labels if channels is None and table.names else channels,
            name=name or table.title or file.stem,
            gaps=gaps or (saved and bool(np.any(np.isnan(samples)))),
        )
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def save_recording(recording: Recording, path: str | os.PathLike[str]) -> Path:
    """Write a recording to an ``.npz`` file that `read_recording` reads back without further arguments.

    The file appears complete or not at all: an interruption leaves one that was there before untouched. Its folder is
    made if it is not there.

    Parameters
    ----------
    recording
        The recording.
    path
        Ends in ``.npz``.

    Returns
    -------
    `path`.

    Raises
    ------
    ValueError
        The path does not end in ``.npz``.
    """
    file = Path(path)
    if file.suffix.lower() != ".npz":
        raise ValueError(f"Recordings are saved as .npz, and the path is {file}.")
    arrays: dict[str, Any] = {key: np.asarray(getattr(recording, key)) for key in _SAVED}
    return write_atomically(file, lambda stream: np.savez(stream, **arrays))


def import_optional(module: str) -> Any:
    """Import a module of the extra ``io``, or raise an ImportError that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(f'This needs the package {module.split(".")[0]}: pip install "gmwm-jax[io]"') from error


def _require_file(file: Path) -> None:
    if file.is_file():
        return
    if file.is_dir():
        raise FileNotFoundError(f"{file.resolve()} is a folder, not a file.")
    near = difflib.get_close_matches(file.name, os.listdir(file.parent)) if file.parent.is_dir() else []
    public = [known.name for known in KNOWN_FILES if known.file == file.name]
    hint = f" Files of a similar name are there: {', '.join(near)}." if near else ""
    hint += f" gmwm_jax.datasets.load({public[0]!r}) fetches this public data set." if public else ""
    raise FileNotFoundError(f"There is no file {file.resolve()}.{hint}")


def _open(file: Path, delimiter: str | None, header: int | None, variable: str | None) -> Columns:
    match file.suffix.lower():
        case ".npy" | ".npz":
            return _open_numpy(file, variable)
        case ".parquet":
            return _open_parquet(file)
        case ".rda" | ".rdata":
            return _open_r(file, variable)
        case suffix if suffix in TEXT_SUFFIXES:
            return open_text(file, delimiter, header)
    raise ValueError(
        f"Unknown suffix {file.suffix!r}; read are .npy .npz .parquet .rda .rdata {' '.join(TEXT_SUFFIXES)}"
    )


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


def _stack(columns: Sequence[np.ndarray], labels: Sequence[str]) -> np.ndarray:
    """Put columns side by side, or name the one that is not numeric."""
    for column, label in zip(columns, labels, strict=True):
        if column.dtype.kind not in "iuf":
            raise ValueError(f"Column {label!r} holds {column[:1]} ({column.dtype}), not numbers: leave it out.")
    return np.stack(columns).T


def _agreed_rate(sources: dict[str, FloatLike | None]) -> float:
    """Return the rate of the first source that states one; the others must agree with it."""
    rates = {source: sampling_rate(rate) for source, rate in sources.items() if rate is not None}
    if not rates:
        raise ValueError(
            "The sampling rate is missing and the file states none: give rate=... in Hz, or time=... to name the column"
            " of time. It is never guessed."
        )
    (first, rate), *others = rates.items()
    for source, other in others:
        if abs(other / rate - 1) > _RATE_TOLERANCE:
            raise ValueError(f"Wrong rate (or time_unit): {first} says {rate:g} Hz, and {source} {other:g} Hz.")
    return rate


def _matrix(values: np.ndarray, names: Iterable[Any] | None = None, rate: float | None = None) -> Columns:
    """Make a table of a vector or matrix."""
    if values.ndim not in (1, 2):
        raise ValueError(f"A recording has the shape (N,) or (N, C), time on axis 0, and this one {values.shape}.")
    columns = values[:, None] if values.ndim == 1 else values
    plain = None if names is None else plain_names(names)
    return Columns(plain, columns.shape[1], lambda picked: [columns[:, i] for i in picked], rate)


def _open_numpy(file: Path, variable: str | None) -> Columns:
    with file.open("rb") as stream:
        with _parsing("NumPy"):
            loaded = np.load(stream, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return _matrix(loaded)
        saved = set(loaded) == set(_SAVED)
        keys = _SAVED if saved else (_only(list(loaded), variable),)
        with _parsing("NumPy"):
            data, *rest = (loaded[key] for key in keys)
    if not saved:
        return _matrix(data)
    rate, channels, units, name = (value.tolist() for value in rest)
    return _matrix(data, rate=rate)._replace(names=tuple(channels), units=tuple(units), title=name)


def _open_parquet(file: Path) -> Columns:
    parquet = import_optional("pyarrow.parquet")
    with _parsing("Parquet"):
        names = parquet.read_schema(file).names

    def load(picked: list[int]) -> list[np.ndarray]:
        with _parsing("Parquet"):
            table = parquet.read_table(file, columns=[names[i] for i in picked])
        return [table[names[i]].to_numpy() for i in picked]

    return Columns(plain_names(names), len(names), load)


def _open_r(file: Path, variable: str | None) -> Columns:
    """Open an R data file; an object of class ``imu`` (of the R packages gmwm and simts) states its rate."""
    rdata = import_optional("rdata")
    constructors = {
        **rdata.conversion.DEFAULT_CLASS_MAP,
        "imu": lambda value, attributes: (value, attributes),
        "ts": lambda value, attributes: value,  # by default it gets an index of fractions, one a sample
    }
    with _parsing("R data"), warnings.catch_warnings(action="error"):  # an unknown file type is only a warning
        parsed = rdata.parser.parse_file(file)
    with _parsing("R data"), warnings.catch_warnings(action="ignore"):  # other classes: judged by what they hold
        objects = rdata.conversion.convert(parsed, constructor_dict=constructors)
    found = objects[_only(list(objects), variable)]
    value, attributes = found if isinstance(found, tuple) else (found, {})
    rate = float(attributes["freq"][0]) if "freq" in attributes else None
    if hasattr(value, "iloc"):  # a data frame
        names = plain_names(value.columns)
        return Columns(names, len(names), lambda picked: [np.asarray(value.iloc[:, i]) for i in picked])
    if hasattr(value, "coords"):  # an array with names along some of its axes
        names = value.coords.get(value.dims[1]) if value.ndim == 2 else None
        return _matrix(value.values, None if names is None else names.values, rate)
    if isinstance(value, np.ma.MaskedArray):  # NA among integers
        value = np.ma.filled(value.astype(np.float64), np.nan)
    if isinstance(value, np.ndarray):
        return _matrix(value, rate=rate)
    raise ValueError(f"The R object is a {type(value).__name__}, and no numeric vector, matrix or data frame.")
