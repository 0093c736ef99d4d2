"""The formats of fixes by their names: one row a format."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from nav_jax.recorded.gnss.gpx import read_gpx
from nav_jax.recorded.gnss.kf_gins import read_kf_gins
from nav_jax.recorded.gnss.nmea import read_nmea
from nav_jax.recorded.gnss.raw import Asked, RawFixes
from nav_jax.recorded.gnss.rtklib import read_rtklib
from nav_jax.recorded.gnss.table import read_table


class Format(NamedTuple):
    """A format of files."""

    read: Callable[[Path, Asked], RawFixes]
    suffixes: tuple[str, ...]
    """By which it is known where no format is stated."""


FORMATS: dict[str, Format] = {
    "rtklib": Format(read_rtklib, (".pos",)),
    "nmea": Format(read_nmea, (".nmea", ".nma")),
    "gpx": Format(read_gpx, (".gpx",)),
    "kf-gins": Format(read_kf_gins, ()),
    "table": Format(read_table, ()),
}
"""Name -> format. What no suffix tells is a table."""


def format_of(file: Path, stated: str | None) -> Format:
    """The format that is stated, or the one of the suffix, else a table.

    Raises
    ------
    ValueError
        Another one is stated.
    """
    if stated is not None:
        if stated not in FORMATS:
            raise ValueError(f"The format is one of {', '.join(FORMATS)}, and is {stated!r}.")
        return FORMATS[stated]
    suffix = file.suffix.lower()
    return next((f for f in FORMATS.values() if suffix in f.suffixes), FORMATS["table"])
