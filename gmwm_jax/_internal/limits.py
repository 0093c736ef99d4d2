"""How large what is read may become: the sizes beyond which a file is refused, before it is unfolded.

Files come from anywhere, and one of a megabyte may ask for a terabyte. What a file holds may always take as many bytes
as the file itself; beyond that it is the caller who knows, and says so by `max_bytes`.
"""

import re
from typing import Any

MAX_BYTES = 4 << 30
"""Bytes to which a file unfolds: six channels of an IMU at 1 kHz for a day are 4.1 GB as float64."""

MAX_RATIO = 200
"""Bytes to which each byte of a file unfolds. Recordings pack 2 to 20 times; deflate packs one byte repeated for ever
1,030 times, bzip2 and xz far more."""

FREE = 32 << 20
"""Bytes that no ratio matters for: they are read in seconds, whatever they are."""

LONGEST_LINE = 1 << 16
"""Characters of a line of text; a table of 1,000 columns has fewer."""

MAX_COLUMNS = 1000
"""Of a table of text: each is looked at by itself. Loggers have some dozens, and a record turned by 90 degrees more."""

MAX_R_NUMBERS = 500_000
"""Headers and lengths in R data: an object or text has two, becomes an object of Python and takes 20 us. Vectors of
numbers are objects, their numbers are none."""

MAX_HEADER = 1 << 26
"""Bytes of the header of a saved result: that of a selection among hundreds of models has a hundredth of it."""

MAX_JSON = 1 << 30
"""Bytes of a saved result in JSON, of which a number takes 20."""

_UNITS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


class TooLargeError(ValueError):
    """A file unfolds to more bytes than it may."""


def allowed(of: int, max_bytes: int | None) -> int:
    """Return the bytes to which a file of `of` bytes may unfold; `max_bytes` is what the caller says, if anything."""
    most = min(MAX_BYTES, max(FREE, MAX_RATIO * of)) if max_bytes is None else max_bytes
    return max(of, most)


def require_size(what: str, num_bytes: int, of: int, max_bytes: int | None) -> None:
    """Raise unless something that takes `num_bytes`, in a file of `of` bytes, may be unfolded.

    Raises
    ------
    TooLargeError
        What it is, how much it takes, the limit, and the option that raises it.
    """
    most = allowed(of, max_bytes)
    if num_bytes > most:
        raise TooLargeError(
            f"{what} would take {as_bytes(num_bytes)} of memory, and the file has {as_bytes(of)}: at most "
            f'{as_bytes(most)} are read. If you trust the file, max_bytes="{_rounded_up(num_bytes)}" reads it.'
        )


def require_stream(num_bytes: int, of: int, max_bytes: int | None) -> None:
    """Raise if more bytes than allowed have come out of a packed file of `of` bytes, whose end nobody knows.

    Raises
    ------
    TooLargeError
        As of `require_size`.
    """
    most = allowed(of, max_bytes)
    if num_bytes > most:
        raise TooLargeError(
            f"The file of {as_bytes(of)} unpacks to more than {as_bytes(most)}, which is the most that is read. If you "
            f'trust it, max_bytes=... reads more, as in max_bytes="{_rounded_up(4 * most)}".'
        )


def require_columns(count: int) -> None:
    """Raise if a table of text has too many columns.

    Raises
    ------
    TooLargeError
        It has more than `MAX_COLUMNS`.
    """
    if count > MAX_COLUMNS:
        raise TooLargeError(
            f"The first line of data has {count} columns, and at most {MAX_COLUMNS} are read of a text file: one line "
            "is one epoch. Transpose the table, or keep it as .npy or .parquet."
        )


def size_in_bytes(value: Any) -> int | None:
    """Return the bytes of a number or of a text such as ``8GB``, where k, M, G and T are powers of 1000.

    Raises
    ------
    ValueError
        It is neither.
    """
    if value is None:
        return None
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?(?:e\d+)?)\s*([kmgt]?)(i?)b?\s*", str(value).lower())
    size = 0 if found is None else int(float(found[1]) * _power(found[2], bool(found[3])))
    if size < 1 or isinstance(value, bool):
        raise ValueError(f'max_bytes is a number of bytes, or a text such as "8GB", and is {value!r}.')
    return size


def _power(unit: str, binary: bool) -> int:
    return 1024 ** list(_UNITS).index(unit) if binary else _UNITS[unit]


def as_bytes(size: int) -> str:
    """A number of bytes for a sentence: ``4.3 GB``."""
    for unit, name in (("t", "TB"), ("g", "GB"), ("m", "MB"), ("k", "kB")):
        if size >= _UNITS[unit]:
            return f"{size / _UNITS[unit]:.3g} {name}"
    return f"{size} bytes"


def _rounded_up(size: int) -> str:
    """A number of bytes as an option has it, that is enough."""
    unit = next(u for u in ("t", "g", "m", "k", "") if size >= _UNITS[u] or not u)
    return f"{-(-size // _UNITS[unit])}{unit.upper() if unit != 'k' else unit}B"
