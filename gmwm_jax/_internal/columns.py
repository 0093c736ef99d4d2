"""What an opened table offers, whatever its format: numbered columns, perhaps with names, units, rate and time."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


def _zero(columns: Sequence[np.ndarray]) -> float:
    return 0.0


class Stamps(NamedTuple):
    """How columns of a source make its time."""

    columns: tuple[int, ...]
    seconds: Callable[[Sequence[np.ndarray]], np.ndarray]
    """Those columns -> seconds, (N,), from any zero."""
    label: str
    """As a person calls it."""
    first: Callable[[Sequence[np.ndarray]], float] = _zero
    """Those columns -> the first time in s, on a clock that other files share."""


def _no_text(column: int, parse: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    raise ValueError(f"Column {column} holds no text.")


class Columns(NamedTuple):
    """Columns of equal length, loaded when they are asked for."""

    names: tuple[str, ...] | None
    """As the source writes them."""
    count: int
    load: Callable[[list[int]], Sequence[np.ndarray]]
    """Column numbers -> those columns, each (N,)."""
    units: Mapping[str, str] = {}
    """Column -> its unit, where the source states it apart from the name."""
    rate: float | None = None
    """Hz."""
    title: str | None = None
    """Of a recording that this package saved."""
    skipped: tuple[str, ...] = ()
    """Variables of the source that are no columns."""
    position: str | None = None
    """Of a trajectory: ``ned`` or ``geodetic``."""
    angles: str | None = None
    """Of a trajectory: ``rad`` or ``deg``."""
    format: str = ""
    """Name of the logger's format, where it is one."""
    roles: Mapping[str, int] = {}
    """``gyro_x`` ... ``accel_z`` -> number of the column, where the format says it."""
    stamps: Stamps | None = None
    """The time, where the format says it."""
    text: frozenset[int] = frozenset()
    """Columns that hold no numbers."""
    load_text: Callable[[int, Callable[[np.ndarray], np.ndarray]], np.ndarray] = _no_text
    """A column of text, and what makes numbers of an array of texts -> those numbers, (N,)."""
    notes: tuple[str, ...] = ()
    """What else was understood, or left out, in sentences."""
    hint: str = ""
    """What to say where units are missing."""

    def number(self, column: int | str) -> int:
        """Return the number of a column given by name, as it is written or plain, or by number.

        Raises
        ------
        ValueError
            There is no such column; the message lists those that there are.
        """
        names = self.names or ()
        if isinstance(column, str):
            if column in names:
                return names.index(column)
            plain = [plain_name(name) for name in names]
            if plain_name(column) in plain:
                return plain.index(plain_name(column))
            if column in self.roles:
                return self.roles[column]
        elif 0 <= column < self.count:
            return int(column)
        seen = f": {', '.join(names)}" if names else " without names"
        raise ValueError(f"There is no column {column!r}; the file has {self.count}, numbered from 0{seen}.")


_PLAIN = str.maketrans({"²": "2", "³": "3", "µ": "u", "μ": "u", "°": "deg"})


def plain_name(name: Any) -> str:
    """Make a name plain: ``Yaw [deg]`` becomes ``yaw_deg``, ``ω_x [°/s]`` ``ω_x_deg_s``."""
    return re.sub(r"[\W_]+", "_", str(name).translate(_PLAIN).lower()).strip("_")


def plain_names(names: Iterable[Any]) -> tuple[str, ...]:
    """Make names plain: ``Gyro. X`` becomes ``gyro_x``, an empty one ``column_3``."""
    return tuple(plain_name(name) or f"column_{i}" for i, name in enumerate(names))
