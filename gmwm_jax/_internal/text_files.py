"""Text files of numbers: the delimiter, comments, names and encoding are found; every refusal names its line.

Two tokenizers in C read the data: that of pandas, which is two to four times as fast, and that of NumPy, which is
always there. What either refuses is read again line by line, to say what is wrong and where. All three give the same
numbers.
"""

import codecs
import csv
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.columns import Columns

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc")
"""Of the files that are read as text."""

_PANDAS_PAYS = 40_000_000
"""Bytes for which NumPy's tokenizer takes longer than pandas with its import, 0.3 s."""


def open_text(file: Path, delimiter: str | None, header: int | None) -> Columns:
    r"""Open a text file: its head is read here, its columns when they are asked for.

    Parameters
    ----------
    file
        The file, UTF-8 (with or without a byte-order mark) or Latin-1.
    delimiter
        Between fields, one character (or ``\t``, a tab as a shell passes it on); None: semicolon, tab, comma or
        blanks, whichever the first line of data holds.
    header
        Number of lines to skip; None: comments and at most one line of names.

    Raises
    ------
    ValueError
        No data, names that do not match the columns, a delimiter that is no character; on loading, the first line that
        is not as many numbers.
    """
    delimiter = "\t" if delimiter == "\\t" else delimiter
    if delimiter is not None and len(delimiter) != 1:
        raise ValueError(f"A delimiter is one character, and {delimiter!r} is not. Leave it out for blanks.")
    with file.open("rb") as stream:  # Latin-1 reads any file, and numbers are ASCII
        marked = stream.read(3) == codecs.BOM_UTF8
    encoding = "utf-8-sig" if marked else "latin-1"
    with file.open(encoding=encoding, newline="") as stream:
        head, line = _head(stream, delimiter, header)
    start = 3 * marked + sum(len(text.encode("utf-8" if marked else "latin-1")) for text in head)
    comment = next((text.lstrip()[0] for text in head if _is_comment(text)), "#")
    first = line.partition(comment)[0]
    separator = delimiter or _sniff(first)
    fields = _split(first, separator)
    count = len(fields)
    names = _names(head, separator, count)
    if header is None and names is None and any(text.strip() and not _is_comment(text) for text in head):
        raise ValueError(
            f"The line of names does not match the {count} columns of the first line of data. Skip it by "
            f"header={len(head)}, and name the columns."
        )

    def rows() -> Iterator[tuple[int, list[str]]]:
        with file.open(encoding=encoding) as stream:
            for number, line in enumerate(stream, start=1):
                text = line.partition(comment)[0].rstrip("\r\n")
                if number > len(head) and text.strip() and not _is_comment(text):
                    yield number, _split(text, separator)

    def load(picked: list[int]) -> Sequence[np.ndarray]:
        numbers = [_is_number(field) for field in fields]  # of all columns, so that the fields of each line are counted
        numeric = [i in picked or number for i, number in enumerate(numbers)]
        # pandas takes a column of true and false for one of numbers, which its first field tells
        with_pandas = all(numbers[i] for i in picked) and _pandas_pays(file)
        try:
            table = _by_pandas(file, start, separator, comment, numeric) if with_pandas else by_numpy(numeric)
        except ValueError:
            return _by_lines(rows(), count, picked)
        # NumPy does not count the fields where it leaves out columns; pandas fills up a short line by empty ones
        counted = all(numeric) or (with_pandas and (numeric[-1] or all(field != "" for field in table[count - 1])))
        if not counted:
            _by_lines(rows(), count, [])
        return [table[i] for i in picked]

    def by_numpy(numeric: list[bool]) -> dict[int, np.ndarray]:
        wanted = [i for i, number in enumerate(numeric) if number]
        layout: Any = {"delimiter": separator, "comments": comment, "quotechar": '"', "encoding": encoding}
        values = np.loadtxt(file, skiprows=len(head), ndmin=2, usecols=None if all(numeric) else wanted, **layout)
        return dict(zip(wanted, values.T, strict=True))

    return Columns(names, count, load)


def _pandas_pays(file: Path) -> bool:
    return "pandas" in sys.modules or (file.stat().st_size > _PANDAS_PAYS and find_spec("pandas") is not None)


def _by_pandas(
    file: Path, start: int, separator: str | None, comment: str, numeric: list[bool]
) -> dict[int, np.ndarray]:
    """Read the table that starts at this byte, each column as numbers or as text.

    Raises
    ------
    ValueError
        A line with more fields than the first; anything but numbers in a column of numbers, also where a line is short.
    """
    import pandas as pd

    options: Any = {"delimiter": separator} if separator else {"sep": r"\s+"}
    if tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1):  # later ones know no other precision
        options["float_precision"] = "round_trip"
    with file.open("rb") as stream:
        stream.seek(start)
        frame = pd.read_csv(
            stream, header=None, comment=comment, low_memory=False, encoding_errors="replace", keep_default_na=False,
            na_values={i: ["nan", "NaN", "NAN"] for i, is_number in enumerate(numeric) if is_number},
            dtype={i: np.float64 if is_number else str for i, is_number in enumerate(numeric)}, **options,
        )  # fmt: skip
    if frame.shape[1] != len(numeric):
        raise ValueError("The first line has another number of fields.")
    return {i: frame[i].to_numpy() for i in range(len(numeric))}


def _by_lines(rows: Iterator[tuple[int, list[str]]], count: int, picked: list[int]) -> list[np.ndarray]:
    """Read line by line; raise at the first that has another number of fields, or no number where one is needed."""
    table: list[list[float]] = []
    for line, fields in rows:
        if len(fields) != count:
            raise ValueError(f"Line {line} has {len(fields)} fields, and the first line of data {count}: {fields}")
        for i in picked:
            if not fields[i]:
                raise ValueError(f"Line {line}, column {i} is empty: repair the line or leave the column out.")
            if not _is_number(fields[i]):
                hint = " Write decimal commas as points." if _is_number(fields[i].replace(",", ".")) else ""
                raise ValueError(f"Line {line}, column {i} holds the text {fields[i]!r}, not a number.{hint}")
        table.append([float(fields[i]) for i in picked])
    return list(np.array(table).reshape(len(table), len(picked)).T)


def _head(stream: Iterator[str], delimiter: str | None, header: int | None) -> tuple[list[str], str]:
    """Return the lines before the data, and the first line of data."""
    head: list[str] = []
    named = header is not None
    for line in stream:
        text = line.rstrip("\r\n")
        if len(head) >= (header or 0) and text.strip() and not _is_comment(text):
            if named or any(map(_is_number, _split(text, delimiter or _sniff(text)))):
                return head, text
            named = True
        head.append(line)
    seen = " (there is a line of names, and no data after it)" if named and header is None else ""
    raise ValueError(f"The file holds no line of data{seen}.")


def _names(head: list[str], separator: str | None, count: int) -> tuple[str, ...] | None:
    """Find the names: the line before the data that has a text for each column; comments come second, last first."""
    lines = [_decoded(text.rstrip("\r\n")) for text in head]
    plain = [text for text in lines if not _is_comment(text)]
    comments = [text.lstrip("#% \t") for text in reversed(lines) if _is_comment(text)]
    rows = [_split(text, separator) for text in plain + comments]
    return next((tuple(r) for r in rows if len(r) == count and any(r) and not any(map(_is_number, r))), None)


def _decoded(text: str) -> str:
    """Text that was read as Latin-1, and may be UTF-8."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


def _is_comment(text: str) -> bool:
    return text.lstrip().startswith(("#", "%"))


def _sniff(text: str) -> str | None:
    return next((separator for separator in ";\t," if separator in text), None)


def _split(text: str, separator: str | None) -> list[str]:
    fields = next(csv.reader([text], delimiter=separator)) if separator and '"' in text else text.split(separator)
    return [field.strip().strip('"') for field in fields]


def _is_number(field: str) -> bool:
    """Is this a number to the tokenizers, too? To Python 1_000 is."""
    try:
        float(field)
    except ValueError:
        return False
    return "_" not in field and field.isascii()
