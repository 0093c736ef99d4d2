"""Text files of numbers: the delimiter, comments, names and encoding are found; every refusal names its line."""

import codecs
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.tabular import Columns, plain_names

TEXT_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".log", ".asc")
"""Of the files that are read as text."""


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
        encoding = "utf-8-sig" if stream.read(3) == codecs.BOM_UTF8 else "latin-1"
    with file.open(encoding=encoding) as stream:
        head, line = _head(stream, delimiter, header)
    comment = next((text.lstrip()[0] for text in head if _is_comment(text)), "#")
    first = line.partition(comment)[0]
    separator = delimiter or _sniff(first)
    count = len(_split(first, separator))
    names = _names(head, separator, count)

    def rows() -> Iterator[tuple[int, list[str]]]:
        with file.open(encoding=encoding) as stream:
            for number, line in enumerate(stream, start=1):
                text = line.partition(comment)[0].rstrip("\r\n")
                if number > len(head) and text.strip():
                    yield number, _split(text, separator)

    def load(picked: list[int]) -> list[np.ndarray]:
        whole = len(set(picked)) == count
        layout: Any = {"delimiter": separator, "comments": comment, "quotechar": '"', "encoding": encoding}
        try:
            values = np.loadtxt(file, skiprows=len(head), ndmin=2, usecols=None if whole else picked, **layout)
        except ValueError:
            _check_rows(rows(), count, picked)
            raise
        if whole:
            return [values[:, i] for i in picked]
        _check_rows(rows(), count, [])  # loadtxt does not count the fields of a line when it leaves some out
        return list(values.T)

    if header is None and names is None and any(text.strip() and not _is_comment(text) for text in head):
        raise ValueError(
            f"The line of names does not match the {count} columns of the first line of data. Skip it by "
            f"header={len(head)} and give channels=..."
        )
    return Columns(names, count, load)


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
        head.append(text)
    raise ValueError("The file holds no line of data.")


def _names(head: list[str], separator: str | None, count: int) -> tuple[str, ...] | None:
    """Find the names: the line before the data that has a text for each column; comments come second, last first."""
    plain = [text for text in head if not _is_comment(text)]
    comments = [text.lstrip("#% \t") for text in reversed(head) if _is_comment(text)]
    rows = [_split(text, separator) for text in plain + comments]
    return next((plain_names(r) for r in rows if len(r) == count and any(r) and not any(map(_is_number, r))), None)


def _is_comment(text: str) -> bool:
    return text.lstrip().startswith(("#", "%"))


def _sniff(text: str) -> str | None:
    return next((separator for separator in ";\t," if separator in text), None)


def _split(text: str, separator: str | None) -> list[str]:
    fields = next(csv.reader([text], delimiter=separator)) if separator and '"' in text else text.split(separator)
    return [field.strip().strip('"') for field in fields]


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _check_rows(rows: Iterator[tuple[int, list[str]]], count: int, picked: list[int]) -> None:
    """Raise at the first line of data that has another number of fields, or no number where one is needed."""
    for line, fields in rows:
        if len(fields) != count:
            raise ValueError(f"Line {line} has {len(fields)} fields, and the first line of data {count}: {fields}")
        for i in picked:
            if not fields[i]:
                raise ValueError(f"Line {line}, column {i} is empty: repair the line or leave the column out.")
            if not _is_number(fields[i]):
                hint = " Write decimal commas as points." if _is_number(fields[i].replace(",", ".")) else ""
                raise ValueError(f"Line {line}, column {i} holds the text {fields[i]!r}, not a number.{hint}")
