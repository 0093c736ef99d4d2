"""What a format of a logger is: how it is told, and what it says of its columns."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from gmwm_jax._internal.columns import Columns
from gmwm_jax._internal.imu_names import role_of
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource


def _open_plain(source: TextSource, how: Reading) -> Columns:
    return open_text(source, how.delimiter, how.header)


def _never(file: Path) -> bool:
    return False


def _no_folder(file: Path, how: Reading) -> Columns:
    raise ValueError(f"{file} is no text file.")


class Format(NamedTuple):
    """A format of a logger."""

    name: str
    """By which it is asked for."""
    is_certain: Callable[[Sequence[str]], bool]
    """The first lines of a text file -> is it this format beyond doubt?"""
    open_text: Callable[[TextSource, Reading], Columns] = _open_plain
    is_folder: Callable[[Path], bool] = _never
    """Is this a folder or a binary file of this format?"""
    open_folder: Callable[[Path, Reading], Columns] = _no_folder


def not_told(lines: Sequence[str]) -> bool:
    """The answer of formats that their content does not tell."""
    return False


def without_unit(name: str) -> str:
    """Return the name of a column without what stands in brackets behind it."""
    return re.sub(r"\s*[\[(].*$", "", name).strip()


def described(
    table: Columns, name: str, units: Mapping[str, str], role: Callable[[str], str | None] = role_of
) -> Columns:
    """Say which columns are the axes of an IMU, and their units where the names do not say them.

    Parameters
    ----------
    table
        The columns, with names.
    name
        Of the format.
    units
        ``gyro`` and ``accel`` -> the unit.
    role
        A name without its unit -> ``gyro_x`` ..., or None.

    Raises
    ------
    ValueError
        No column is an axis of an IMU.
    """
    roles: dict[str, int] = {}
    stated = dict(table.units)
    for i, column in enumerate(table.names or ()):
        axis = role(without_unit(column))
        if axis is not None and axis not in roles and i not in table.text:
            roles[axis] = i
            if without_unit(column) == column.strip() and column not in stated:
                stated[column] = units[axis.partition("_")[0]]
    if not roles:
        seen = ", ".join(table.names or ()) or f"{table.count} without names"
        raise ValueError(f"This is no file of the format {name}: no column is an axis of an IMU ({seen}).")
    return table._replace(format=name, roles=roles, units=stated)


def named(table: Columns, name: str, names: Sequence[str], units: Mapping[str, str]) -> Columns:
    """Name the columns of a format whose files have no names; the first of them, where a file has more.

    Raises
    ------
    ValueError
        There are fewer columns.
    """
    if table.count < len(names):
        raise ValueError(
            f"This is no file of the format {name}, whose columns are {', '.join(names)}: it has {table.count}."
        )
    more = [f"column_{i}" for i in range(len(names), table.count)]
    return described(table._replace(names=(*names, *more), units={}), name, units)
