"""Recordings from files and back: NumPy, text, Parquet and R data.

Every format is opened as a `_Table`: names, number of columns, what the file states of itself, and a way to load chosen
columns. The rest (choice of columns, rate, units) is the same for all of them.
"""

import codecs
import csv
import difflib
import importlib
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gmwm_jax._check import sampling_rate
from gmwm_jax._known_files import KNOWN_FILES, recognise
from gmwm_jax._typing import FloatLike, Names
from gmwm_jax.recording import Recording, rate_of_time

_TEXT = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc", "")
_SAVED = ("data", "rate", "channels", "units", "name")
_RATE_TOLERANCE = 0.01
Column = int | str


class _Table(NamedTuple):
    """An opened file."""

    names: tuple[str, ...] | None
    count: int
    load: Callable[[list[int]], Sequence[np.ndarray]]
    """Column numbers -> those columns, each (N,)."""
    rate: float | None = None
    units: tuple[str, ...] | None = None
    title: str | None = None


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate: FloatLike | None = None,
    units: str | Sequence[str] | Mapping[str, str] | None = None,
    channels: Names | None = None,
    columns: Sequence[Column] | None = None,
    time: Column | None = None,
    time_unit: str = "s",
    delimiter: str | None = None,
    header: int | None = None,
    name: str | None = None,
    variable: str | None = None,
) -> Recording:
    """Read a recording from a file; its suffix tells the format.

    Formats: ``.npy``, ``.npz``, ``.parquet``, R data (``.rda``, ``.rdata``) and text (``.csv``, ``.tsv``, ``.txt``,
    ``.dat``, ``.log``, ``.asc``). Names found in a file are made plain: ``Gyro. X`` becomes ``gyro_x``. Public files that
    are recognised by their content (`gmwm_jax.datasets`) need no further argument, nor does what `save_recording` wrote.

    Parameters
    ----------
    path
        The file.
    rate
        Sampling rate in Hz; not needed where the file states it or has a column of time. It is never guessed.
    units
        Unit of the samples in the file, see `Recording.from_array`.
    channels
        Names for the channels that are read, in place of those in the file.
    columns
        The columns to read, by name or number (from 0). Default: all but that of time.
    time
        The column that holds time, by name or number. It must increase in even steps.
    time_unit
        Unit of that column: ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``. Timestamps of Parquet need none.
    delimiter
        Of a text file; found among comma, semicolon, tab and blanks unless given.
    header
        Number of lines before the data of a text file; one line of names is found unless given. Comment lines start
        with ``#`` or ``%``.
    name
        Name of the recording; default: the file name.
    variable
        The object to read from an ``.npz`` or R file that holds several.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        Parquet and R data need the extra ``io``.
    ValueError
        Anything in the file that is no regular numeric series, a rate or unit that is missing or contradicts the file,
        or a corrupt file. The message starts with the path.
    """
    file = Path(path)
    _require_file(file)
    try:
        table = _open(file, delimiter, header, variable)
        timed = None if time is None else _position(time, table)
        wanted = range(table.count) if columns is None else [_position(column, table) for column in columns]
        picked = [i for i in wanted if i != timed]
        if not picked:
            raise ValueError("No column is left to read besides that of time.")
        loaded = list(table.load(picked if timed is None else [*picked, timed]))
        timed_rate = None if timed is None else rate_of_time(loaded.pop(), time_unit)
        known = recognise(file) if units is None and table.units is None else None
        stated = table._replace(rate=table.rate or known.rate, units=known.units) if known else table
        if channels is None and table.names is not None:
            channels = [table.names[i] for i in picked]
        return Recording.from_array(
            _stack(loaded, [_label(i, table) for i in picked]),
            rate=_agreed_rate({"rate=": rate, "the file": stated.rate, "its column of time": timed_rate}),
            units=_agreed_units(units, stated.units, picked),
            channels=channels,
            name=name or table.title or file.stem,
        )
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def save_recording(recording: Recording, path: str | os.PathLike[str]) -> Path:
    """Write a recording to an ``.npz`` file that `read_recording` reads back without further arguments.

    The file appears complete or not at all: an interruption leaves one that was there before untouched.

    Raises
    ------
    ValueError
        The path does not end in ``.npz``.
    """
    file = Path(path)
    if file.suffix.lower() != ".npz":
        raise ValueError(f"Recordings are saved as .npz, and the path is {file}.")
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as stream:
            np.savez(stream, **{key: np.asarray(getattr(recording, key)) for key in _SAVED})
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)
    return file


def import_optional(module: str) -> Any:
    """Import a module of the extra ``io``, or raise an ImportError that says how to install it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ImportError(f'This needs the package {package}: pip install "gmwm-jax[io]"') from error


def _require_file(file: Path) -> None:
    if file.is_file():
        return
    public = next((known.name for known in KNOWN_FILES if known.file == file.name), None)
    if public is not None:
        hint = f"It is a public data set: gmwm_jax.datasets.load({public!r}) fetches it."
    elif not file.parent.is_dir():
        hint = f"There is no folder {file.parent.resolve()}."
    else:
        near = difflib.get_close_matches(file.name, os.listdir(file.parent))
        hint = f"Near it: {', '.join(near)}." if near else f"Nothing like it is in {file.parent.resolve()}."
    raise FileNotFoundError(f"No file {file}. {hint}")


def _open(file: Path, delimiter: str | None, header: int | None, variable: str | None) -> _Table:
    match file.suffix.lower():
        case ".npy" | ".npz":
            return _open_numpy(file, variable)
        case ".parquet":
            return _open_parquet(file)
        case ".rda" | ".rdata":
            return _open_r(file, variable)
        case suffix if suffix in _TEXT:
            return _open_text(file, delimiter, header)
    raise ValueError(f"Unknown suffix {file.suffix!r}. Read are .npy, .npz, .parquet, .rda, .rdata, {', '.join(_TEXT)}")


# What all formats share


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


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _plain_names(names: Sequence[Any]) -> tuple[str, ...]:
    return tuple(_plain(str(name)) or f"column_{i}" for i, name in enumerate(names))


def _label(position: int, table: _Table) -> str:
    return f"column {position}" if table.names is None else f"column {position} ({table.names[position]})"


def _position(column: Column, table: _Table) -> int:
    """Return the number of a column given by name or number."""
    if isinstance(column, str):
        names = table.names or ()
        for written in (column, _plain(column)):
            if written in names:
                return names.index(written)
        seen = f"has {', '.join(names)}" if names else f"names none of its {table.count} columns: give a number"
        raise ValueError(f"There is no column {column!r}; the file {seen}.")
    if 0 <= column < table.count:
        return column
    raise ValueError(f"There is no column {column}; the file has {table.count}, numbered from 0.")


def _stack(columns: Sequence[np.ndarray], labels: list[str]) -> np.ndarray:
    """Put columns side by side, or name the one that is not numeric."""
    for column, label in zip(columns, labels, strict=True):
        if column.dtype.kind not in "iuf":
            raise ValueError(
                f"{label} holds {column.dtype} ({column[:1].tolist()} ...), not numbers: leave it out by columns=..."
            )
    return np.stack(columns).T


def _agreed_rate(sources: dict[str, FloatLike | None]) -> float:
    """Return the rate of the first source that has one; the others must agree with it."""
    rates = {source: sampling_rate(rate) for source, rate in sources.items() if rate is not None}
    if not rates:
        raise ValueError(
            "The sampling rate is missing: give rate=... in Hz, or time=... to name the column of time. The file states "
            "none, and it is never guessed."
        )
    (first, rate), *others = rates.items()
    for source, other in others:
        if abs(other / rate - 1) > _RATE_TOLERANCE:
            raise ValueError(
                f"Wrong rate: {first} says {rate:g} Hz and {source} says {other:g} Hz. If time is the one that is wrong, "
                "look at time_unit."
            )
    return rate


def _agreed_units(given: Any, stated: tuple[str, ...] | None, picked: list[int]) -> Any:
    if stated is None:
        return given
    if given is not None:
        raise ValueError(f"The file states its units ({', '.join(stated)}): leave out units=...")
    return [stated[i] for i in picked]


# NumPy


def _matrix(values: Any, names: Sequence[Any] | None = None, **stated: Any) -> _Table:
    """Make a table of a vector or matrix."""
    if isinstance(values, np.ma.MaskedArray):  # R's NA among integers
        values = values.astype(np.float64).filled(np.nan)
    if values.ndim not in (1, 2):
        raise ValueError(f"A recording has the shape (N,) or (N, C), time on axis 0, and this one {values.shape}.")
    columns = values.reshape(len(values), -1) if values.ndim == 1 else values
    plain = None if names is None else _plain_names(names)
    return _Table(plain, columns.shape[1], lambda picked: [columns[:, i] for i in picked], **stated)


def _open_numpy(file: Path, variable: str | None) -> _Table:
    with _parsing("NumPy"):
        loaded = np.load(file, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return _matrix(loaded)
    with loaded:
        saved = set(loaded) == set(_SAVED)
        keys = _SAVED if saved else (_only(list(loaded), variable),)
        with _parsing("NumPy"):
            data, *rest = (loaded[key] for key in keys)
    if not saved:
        return _matrix(data)
    rate, channels, units, name = (value.tolist() for value in rest)
    return _matrix(data, rate=rate, units=tuple(units), title=name)._replace(names=tuple(channels))


def _only(names: Sequence[str], variable: str | None) -> str:
    """Return the variable that is asked for, or the only one."""
    if variable in names or (variable is None and len(names) == 1):
        return variable or names[0]
    seen = f"no variable {variable!r}" if variable else f"{len(names)} variables and needs variable=..."
    raise ValueError(f"The file has {seen}; it holds: {', '.join(names)}.")


# Parquet and R


def _open_parquet(file: Path) -> _Table:
    parquet = import_optional("pyarrow.parquet")
    with _parsing("Parquet"):
        names = parquet.read_schema(file).names

    def load(picked: list[int]) -> list[np.ndarray]:
        with _parsing("Parquet"):
            table = parquet.read_table(file, columns=[names[i] for i in picked])
        return [table[names[i]].to_numpy() for i in picked]

    return _Table(_plain_names(names), len(names), load)


def _open_r(file: Path, variable: str | None) -> _Table:
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
    stated = {"rate": float(attributes["freq"][0])} if "freq" in attributes else {}
    if hasattr(value, "columns"):  # a data frame
        return _Table(
            _plain_names(value.columns),
            len(value.columns),
            lambda picked: [_series_values(value.iloc[:, i]) for i in picked],
        )
    if hasattr(value, "coords"):  # an array with names along some of its axes
        names = value.coords.get(value.dims[1]) if value.ndim == 2 else None
        return _matrix(value.values, None if names is None else names.values, **stated)
    if isinstance(value, np.ndarray):
        return _matrix(value, **stated)
    raise ValueError(f"The R object is a {type(value).__name__}, and no numeric vector, matrix or data frame.")


def _series_values(series: Any) -> np.ndarray:
    numeric = series.dtype.kind in "iuf"
    return series.to_numpy(np.float64, na_value=np.nan) if numeric else np.asarray(series)


# Text


def _open_text(file: Path, delimiter: str | None, header: int | None) -> _Table:
    encoding = _encoding(file)
    with file.open(encoding=encoding) as stream:
        head, line = _head(stream, delimiter, header)
    comment = next((text[0] for text in head if _is_comment(text)), "#")
    first = line.partition(comment)[0]
    separator = delimiter or _sniff(first)
    count = len(_split(first, separator))
    names = _names(head, separator, count)
    titles = [text for text in head if text.strip() and not _is_comment(text)]
    if header is None and titles and names is None:
        raise ValueError(
            f"The line of names {titles[0]!r} does not match the {count} columns of the first line of data. Skip it by "
            f"header={len(head)} and give channels=..."
        )

    def rows() -> Iterator[tuple[int, list[str]]]:
        with file.open(encoding=encoding) as stream:
            for number, line in enumerate(stream, start=1):
                text = line.partition(comment)[0]
                if number > len(head) and text.strip():
                    yield number, _split(text, separator)

    def load(picked: list[int]) -> list[np.ndarray]:
        whole = len(set(picked)) == count
        try:
            values = np.loadtxt(
                file, delimiter=separator, comments=comment, skiprows=len(head), ndmin=2, encoding=encoding,
                quotechar='"', usecols=None if whole else picked,
            )  # fmt: skip
        except ValueError:
            _check_rows(rows(), count, picked)
            raise
        if whole:
            return [values[:, i] for i in picked]
        _check_rows(rows(), count, [])  # loadtxt does not count the fields of a line when it leaves some out
        return list(values.T)

    return _Table(names, count, load)


def _encoding(file: Path) -> str:
    """Tell the encoding by the byte-order mark; else Latin-1, which reads any file, as numbers are ASCII."""
    with file.open("rb") as stream:
        start = stream.read(3)
    marks = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
    return next((encoding for mark, encoding in marks.items() if start.startswith(mark)), "latin-1")


def _head(stream: Iterator[str], delimiter: str | None, header: int | None) -> tuple[list[str], str]:
    """Return the lines before the data, and the first line of data."""
    head: list[str] = []
    named = header is not None
    for line in stream:
        text = line.rstrip("\r\n")
        if len(head) >= (header or 0) and text.strip() and not _is_comment(text):
            fields = _split(text, delimiter or _sniff(text))
            if named or any(map(_is_number, fields)):
                return head, text
            named = True
        head.append(text)
    raise ValueError("The file holds no line of data.")


def _names(head: list[str], separator: str | None, count: int) -> tuple[str, ...] | None:
    """Find the names: a line before the data with a text for each column; commented lines come second."""
    plain = [text for text in head if not _is_comment(text)]
    commented = [text.lstrip("#% \t") for text in reversed(head) if _is_comment(text)]
    candidates = [_split(text, separator) for text in plain + commented]
    fitting = (f for f in candidates if len(f) == count and any(f) and not any(map(_is_number, f)))
    return next((_plain_names(fields) for fields in fitting), None)


def _is_comment(text: str) -> bool:
    return text.lstrip().startswith(("#", "%"))


def _sniff(text: str) -> str | None:
    return next((separator for separator in ";\t," if separator in text), None)


def _split(text: str, separator: str | None) -> list[str]:
    fields = next(csv.reader([text], delimiter=separator), []) if separator and '"' in text else text.split(separator)
    return [field.strip().strip('"') for field in fields]


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _check_rows(rows: Iterator[tuple[int, list[str]]], count: int, picked: list[int]) -> None:
    """Raise at the first line of data that has another number of fields, or no number where one is needed."""
    for number, fields in rows:
        if len(fields) != count:
            raise ValueError(
                f"Line {number} has {len(fields)} fields, and the first line of data has {count}: {fields[:8]}. Mend or cut "
                "the line."
            )
        for i in picked:
            if not fields[i]:
                raise ValueError(f"Line {number}, column {i} is empty: fill or cut it, or leave the column out.")
            if not _is_number(fields[i]):
                hint = " Decimal commas must become points." if _is_number(fields[i].replace(",", ".")) else ""
                raise ValueError(f"Line {number}, column {i} holds the text {fields[i]!r}, and no number.{hint}")
