"""How a text file of numbers is laid out: the lines before the data, the separator, decimal commas, names, units."""

import csv
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from gmwm_jax._internal.limits import require_columns
from gmwm_jax._internal.text_source import TextSource, decoded, numbered_lines, unpacking

_AHEAD = 50
"""Lines of data that are looked at."""

_LONGEST_HEAD = 1000
"""Lines before the data."""

_UNITS = {
    "s", "ms", "us", "ns", "sec", "min", "h", "hr", "rad", "mrad", "deg", "mdeg", "degrees", "arcsec", "arcmin",
    "g", "mg", "ug", "m", "mm", "cm", "km", "dps", "mgal", "c", "degc", "k", "t", "ut", "mt", "gauss", "pa",
    "hpa", "kpa", "mbar", "bar", "v", "counts", "count", "ticks", "lsb", "none", "hz", "sqrt", "°",
}  # fmt: skip
"""Words of a line of units."""


class Layout(NamedTuple):
    """Of one file."""

    skipped: int
    """Lines before the data."""
    start: int
    """Bytes before the data."""
    separator: str | None
    """Between fields; None: blanks."""
    commas: bool
    """Are decimal points written as commas?"""
    comment: str
    names: tuple[str, ...] | None
    units: tuple[str, ...] | None
    """The line of units below the names."""
    first: tuple[str, ...]
    """Fields of the first line of data, with decimal points."""
    head: tuple[str, ...]
    """The lines before the data."""


def find_layout(source: TextSource, delimiter: str | None, header: int | None) -> Layout:
    """Find the layout of a text file from its first lines.

    Parameters
    ----------
    source
        The file.
    delimiter
        Between fields, one character; None: semicolon, tab, bar, comma or blanks, whichever the data hold.
    header
        Number of the line of names, from 1; 0: there is none; None: comments and lines that hold no numbers.

    Raises
    ------
    ValueError
        No data, a line of names that matches no column, a delimiter that is no character.
    """
    delimiter = "\t" if delimiter == "\\t" else delimiter
    if delimiter is not None and len(delimiter) != 1:
        raise ValueError(f"A delimiter is one character, and {delimiter!r} is not. Leave it out for blanks.")
    with unpacking(), source.lines() as stream:
        head, ahead = _divide((line for _, line in numbered_lines(stream)), delimiter, header)
    start = sum(len(line) for line in head)  # characters of Latin-1 are bytes
    lines = [decoded(line.rstrip("\r\n")) for line in head]
    comment = next((text.lstrip()[0] for text in lines if is_comment(text) and text.lstrip()[0] in "#%"), "#")
    data = [text.partition(comment)[0] for text in ahead]
    separator = delimiter or sniff(data[0])
    commas = _has_commas([split(text, separator) for text in data]) if separator != "," else False
    first = tuple(split(data[0], separator))
    require_columns(len(first))
    names, units = _names(lines, separator, first)
    if header is None and names is None and any(text.strip() and not is_comment(text) for text in lines):
        raise ValueError(
            f"The line of names does not match the {len(first)} columns of the first line of data. Skip it by "
            f"header={len(head)}, and name the columns."
        )
    if commas:
        first = tuple(field.replace(",", ".") for field in first)
    return Layout(len(head), start, separator, commas, comment, names, units, first, tuple(lines))


def is_comment(text: str) -> bool:
    """Is this line a comment?"""
    return text.lstrip().startswith(("#", "%", "//"))


def is_number(field: str) -> bool:
    """Is this a number to the tokenizers, too? To Python 1_000 is."""
    try:
        float(field)
    except ValueError:
        return False
    return "_" not in field and field.isascii()


def sniff(text: str) -> str | None:
    """Return what divides the fields of a line; None for blanks."""
    for separator in ";\t|":
        if separator in text:
            return separator
    if "," not in text:
        return None
    blanks = text.split()
    decimal = len(blanks) > 1 and all(re.fullmatch(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?", field) for field in blanks)
    return None if decimal and any("," in field for field in blanks) else ","


def split(text: str, separator: str | None) -> list[str]:
    """Divide a line into its fields."""
    fields = next(csv.reader([text], delimiter=separator)) if separator and '"' in text else text.split(separator)
    return [field.strip().strip('"') for field in fields]


def _divide(stream: Iterator[str], delimiter: str | None, header: int | None) -> tuple[list[str], list[str]]:
    """Return the lines before the data as they are, and the first lines of data."""
    head: list[str] = []
    waiting: list[str] = []  # a line that may be the first of data, and blank ones or comments behind it
    candidate = ""
    named = False
    for line in islice(stream, _LONGEST_HEAD):
        text = line.rstrip("\r\n")
        if len(head) + len(waiting) < (header or 0) or not text.strip() or is_comment(text):
            (waiting if waiting else head).append(line)
            continue
        if not waiting:
            numbers = _numbers(text, delimiter)
            if header is not None and not numbers and _is_units(split(text, delimiter or sniff(text))):
                head.append(line)
            elif numbers or header is not None:
                waiting, candidate = [line], text
            else:
                named = True
                head.append(line)
            continue
        if header is None and not _numbers(text, delimiter) and not _may_follow(candidate, text, delimiter):
            head += [*waiting, line]  # a line such as "Logger 3" before that of names
            waiting, named = [], True
            continue
        return head, [candidate, text, *(t for t in _ahead(stream) if t.strip() and not is_comment(t))]
    if waiting:
        return head, [candidate]
    seen = " (there is a line of names, and no data after it)" if named and header is None else ""
    raise ValueError(f"The file holds no line of data{seen}.")


def _ahead(stream: Iterator[str]) -> list[str]:
    return [line.rstrip("\r\n") for line in islice(stream, _AHEAD)]


def _numbers(text: str, delimiter: str | None) -> bool:
    """Does a line hold a number, perhaps with a decimal comma?"""
    separator = delimiter or sniff(text)
    fields = split(text, separator)
    if _is_key(fields):
        return False
    if separator != ",":
        fields = [field.replace(",", ".") for field in fields]
    return any(map(is_number, fields)) or any(re.fullmatch(r"\d{4}-\d\d-\d\d[T ].*", field) for field in fields)


def _may_follow(candidate: str, text: str, delimiter: str | None) -> bool:
    """May a line without numbers be one of data, a bad one, after another?"""
    first, second = (split(t, delimiter or sniff(t)) for t in (candidate, text))
    return len(first) == len(second) and not _is_key(second)


def _is_key(fields: Sequence[str]) -> bool:
    """Is this a line of ``key: value`` or ``key=value``?"""
    return fields[0].endswith(":") or "=" in fields[0]


def _has_commas(rows: Sequence[Sequence[str]]) -> bool:
    """Are there numbers with decimal commas, and none with a point?"""
    fields = [field for row in rows for field in row]
    with_comma = any("," in field and is_number(field.replace(",", ".")) for field in fields)
    return with_comma and not any("." in field and is_number(field) for field in fields)


def _names(
    lines: Sequence[str], separator: str | None, first: Sequence[str]
) -> tuple[tuple[str, ...] | None, tuple[str, ...] | None]:
    """Find names and units: the last lines before the data with a text for each column; comments come second."""
    plain = [text for text in reversed(lines) if not is_comment(text)]
    comments = [text.lstrip("#%/ \t") for text in reversed(lines) if is_comment(text)]
    rows = [row for text in (*plain, *comments) if (row := _row(text, separator, first)) is not None]
    if len(rows) > 1 and _is_units(rows[0]):
        return rows[1], rows[0]
    return (rows[0] if rows else None), None


def _row(text: str, separator: str | None, first: Sequence[str]) -> tuple[str, ...] | None:
    """Return the fields of a line that may hold names, as many as there are columns."""
    row, count = split(text, separator), len(first)
    if separator is None and len(row) != count:  # a unit in brackets belongs to its name, blanks may stand in names
        ways = (re.sub(r"\s+(?=[\[(])", "", text).split(), re.split(r"\s{2,}", text.strip()), [text.strip()])
        row = next((way for way in ways if len(way) == count), row)
    if separator is not None and len(row) == count + 1 and not row[-1]:  # ends in a separator
        row = row[:-1]
    elif separator is not None and len(row) == count - 1 and not first[-1]:
        row = [*row, ""]
    return tuple(row) if len(row) == count and any(row) and not any(map(is_number, row)) else None


def _is_units(row: Sequence[str]) -> bool:
    words = [word for field in row for word in re.findall(r"[^\W\d_]+|°", field.replace("µ", "u").replace("μ", "u"))]
    return bool(words) and all(word.lower() in _UNITS for word in words)
