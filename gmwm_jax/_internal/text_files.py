"""Text files of numbers: their layout is found; every refusal names its line.

Two tokenizers in C read the data: that of pandas, which is two to four times as fast and reads large files in parts,
and that of NumPy, which is always there. What either refuses is read again line by line, to say what is wrong and
where. All three give the same numbers.
"""

import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.columns import Columns
from gmwm_jax._internal.limits import TooLargeError
from gmwm_jax._internal.text_layout import Layout, find_layout, is_comment, is_number, split
from gmwm_jax._internal.text_source import (
    LongLineError,
    TextSource,
    numbered_lines,
    short_lines,
    unpacking,
    with_points,
)

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc", ".imu")
"""Of the files that are read as text."""

_PANDAS_PAYS = 40_000_000
"""Bytes for which NumPy's tokenizer takes longer than pandas with its import, 0.3 s."""

_ROWS = 500_000
"""That are read at once."""

_SHOWN = 20
"""Fields that a message repeats."""

_EXACT = 15
"""Digits of an integer that a float keeps; longer ones (nanoseconds since 1970) are read as integers."""


def open_text(source: TextSource, delimiter: str | None = None, header: int | None = None) -> Columns:
    r"""Open a text file: its head is read here, its columns when they are asked for.

    Parameters
    ----------
    source
        The file.
    delimiter
        Between fields, one character (or ``\t``, a tab as a shell passes it on); None: semicolon, tab, bar, comma or
        blanks, whichever the data hold.
    header
        Number of the line of names, from 1; 0: there is none; None: comments and lines that hold no numbers.

    Raises
    ------
    ValueError
        No data, names that do not match the columns, a delimiter that is no character; on loading, the first line that
        is not as many numbers.
    """
    layout = find_layout(source, delimiter, header)
    if layout.commas:
        source = source.then(with_points)
    table = _Table(source, layout)
    units = {}
    if layout.units is not None:
        units = {n: u for n, u in zip(layout.names or (), layout.units, strict=True) if u}
    text = frozenset(i for i, field in enumerate(layout.first) if not is_number(field))
    notes = ("decimal commas",) if layout.commas else ()
    return Columns(
        layout.names, len(layout.first), table.load, units, text=text, load_text=table.load_text, notes=notes
    )


class _Table:
    """The lines of data of a text file."""

    def __init__(self, source: TextSource, layout: Layout):
        self.source, self.layout = source, layout
        self.numbers = [is_number(field) for field in layout.first]

    def load(self, picked: list[int]) -> Sequence[np.ndarray]:
        """Columns as numbers."""
        with unpacking():
            # of all columns, so that the fields of each line are counted
            numeric = [i in picked or number for i, number in enumerate(self.numbers)]
            # pandas takes a column of true and false for one of numbers, which its first field tells
            with_pandas = all(self.numbers[i] for i in picked) and _pandas_pays(self.source.file)
            by = self._by_pandas if with_pandas else self._by_numpy
            try:
                table, counted = by(numeric, picked)
            except LongLineError:
                deque(self._rows(), maxlen=0)  # raises, and says which line it is
                raise
            except TooLargeError:
                raise
            except (ValueError, OverflowError):  # the latter of integers of 20 digits
                return self._by_lines(len(numeric), picked)
            if not counted:
                self._by_lines(len(numeric), [])
            return [table.pop(i) if picked.count(i) == 1 else table[i] for i in picked]

    def load_text(self, column: int, parse: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """A column of text as what `parse` makes of it, part by part."""
        with unpacking():
            if not _pandas_pays(self.source.file):
                rows = list(self._rows())
                for line, fields in rows:
                    _counted(line, fields, len(self.numbers))
                return parse(np.array([fields[column] for _, fields in rows]))
            import pandas as pd

            with self._data() as stream:
                options = self._options([column]) | {"dtype": str, "usecols": [column], "chunksize": _ROWS}
                with pd.read_csv(stream, **options) as parts:
                    found = [parse(part[column].to_numpy().astype(str)) for part in parts]
            return np.concatenate(found)

    def _by_pandas(self, numeric: list[bool], picked: list[int]) -> tuple[dict[int, np.ndarray], bool]:
        """Read the data, each column as numbers or as text; and whether the fields of each line were counted.

        Raises
        ------
        ValueError
            A line with more fields than the first; anything but numbers in a column of numbers, also where a line is
            short.
        """
        import pandas as pd

        columns = {i: _Growing() for i in picked}
        last = len(numeric) - 1
        counted = all(numeric) or numeric[last]  # pandas fills up a short line by empty fields, which are no numbers
        full = True
        with self._data() as stream:
            options = self._options([i for i, number in enumerate(numeric) if number])
            kinds: Any = {i: (np.int64 if self._exact(i) else np.float64) if number else str
                     for i, number in enumerate(numeric)}  # fmt: skip
            options |= {"dtype": kinds, "chunksize": _ROWS}
            with pd.read_csv(stream, **options) as parts:
                for part in parts:
                    if part.shape[1] != len(numeric):
                        raise ValueError("The first line has another number of fields.")
                    for i, column in columns.items():
                        column.add(part[i].to_numpy())
                    full = full and (counted or bool((part[last] != "").all()))
        return {i: column.values() for i, column in columns.items()}, counted or full

    def _options(self, numbers: list[int]) -> dict[str, Any]:
        import pandas as pd

        separator = self.layout.separator
        options: dict[str, Any] = {"delimiter": separator} if separator else {"sep": r"\s+"}
        if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1):  # later ones know no other precision
            options["float_precision"] = "round_trip"
        return options | {
            "header": None, "comment": self.layout.comment, "low_memory": False, "encoding_errors": "replace",
            "keep_default_na": False, "na_values": {i: ["nan", "NaN", "NAN"] for i in numbers if not self._exact(i)},
        }  # fmt: skip

    def _by_numpy(self, numeric: list[bool], picked: list[int]) -> tuple[dict[int, np.ndarray], bool]:
        """The same by NumPy, which does not count the fields where it leaves out columns."""
        wanted = [i for i, number in enumerate(numeric) if number]
        columns = dict(zip(wanted, self._numpy(None if all(numeric) else wanted, np.float64), strict=True))
        for i in picked:
            if self._exact(i):
                columns[i] = self._numpy([i], np.int64)[0]
        return columns, all(numeric)

    def _numpy(self, columns: list[int] | None, kind: type) -> np.ndarray:
        skipped, options = self.layout.skipped, {"comments": self.layout.comment, "quotechar": '"', "dtype": kind}
        options |= {"delimiter": self.layout.separator, "ndmin": 2, "usecols": columns, "encoding": "latin-1"}
        if self.source.as_it_is:
            with self.source.open() as stream:
                deque(short_lines(stream), maxlen=0)
            return np.loadtxt(self.source.file, skiprows=skipped, **options).T
        with self.source.then(short_lines).lines(newline=None) as stream:
            return np.loadtxt(stream, skiprows=skipped, **options).T

    def _exact(self, column: int) -> bool:
        """Is this a column of integers that floats do not keep?"""
        field = self.layout.first[column]
        return field.isdecimal() and _EXACT < len(field) < 20 and int(field) < 2**63

    def _data(self):
        """The bytes from the first line of data on."""
        stream = self.source.then(short_lines).open()
        left = self.layout.start
        try:
            while left:
                left -= len(stream.read(min(left, 1 << 20)))
        except BaseException:
            stream.close()
            raise
        return stream

    def _by_lines(self, count: int, picked: list[int]) -> list[np.ndarray]:
        with closing(self._rows()) as rows:  # a refusal keeps the frame, and so the file, for as long as it lives
            return _by_lines(rows, count, picked)

    def _rows(self) -> Generator[tuple[int, list[str]], None, None]:
        """Number and fields of each line of data."""
        with self.source.lines(newline=None) as stream:
            for number, line in numbered_lines(stream):
                text = line.partition(self.layout.comment)[0].rstrip("\r\n")
                if number > self.layout.skipped and text.strip() and not is_comment(text):
                    yield number, split(text, self.layout.separator)


class _Growing:
    """A column that grows by parts; twice the room is asked for, which takes no memory before it is used."""

    def __init__(self):
        self._whole, self._count = None, 0

    def add(self, part: np.ndarray) -> None:
        """Append."""
        need = self._count + len(part)
        if self._whole is None:
            self._whole = part if len(part) < _ROWS else np.empty(0, part.dtype)
        if self._whole is part:
            self._count = need
            return
        if need > len(self._whole):
            larger = np.empty(max(2 * need, 16 * _ROWS), part.dtype)
            larger[: self._count] = self._whole[: self._count]
            self._whole = larger
        self._whole[self._count : need] = part
        self._count = need

    def values(self) -> np.ndarray:
        """Everything."""
        return np.empty(0) if self._whole is None else self._whole[: self._count]


def _pandas_pays(file: Path) -> bool:
    return "pandas" in sys.modules or (file.stat().st_size > _PANDAS_PAYS and find_spec("pandas") is not None)


def _counted(line: int, fields: list[str], count: int) -> None:
    if len(fields) != count:
        seen = f"{fields[:_SHOWN]}" + " ..." * (len(fields) > _SHOWN)
        raise ValueError(f"Line {line} has {len(fields)} fields, and the first line of data {count}: {seen}")


def _by_lines(rows: Iterator[tuple[int, list[str]]], count: int, picked: list[int]) -> list[np.ndarray]:
    """Read line by line; raise at the first that has another number of fields, or no number where one is needed."""
    parts: list[np.ndarray] = []
    table: list[list[float]] = []
    for line, fields in rows:
        _counted(line, fields, count)
        for i in picked:
            if not fields[i]:
                raise ValueError(
                    f"Line {line}, column {i} is empty: write nan where there is no value, or leave the column out."
                )
            if not is_number(fields[i]):
                hint = " Write decimal commas as points." if is_number(fields[i].replace(",", ".")) else ""
                raise ValueError(f"Line {line}, column {i} holds the text {fields[i]!r}, not a number.{hint}")
        if picked:
            table.append([float(fields[i]) for i in picked])
        if len(table) == _ROWS:
            parts.append(np.array(table))
            table = []
    parts.append(np.array(table).reshape(len(table), len(picked)))
    return list(np.concatenate(parts).T)
