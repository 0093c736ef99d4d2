"""What an opened table offers, whatever its format: numbered columns, perhaps with names, rate and units."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


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

    def number(self, column: int | str) -> int:
        """Return the number of a column given by name, as it is written or plain, or by number.

        Raises
        ------
        ValueError
            There is no such column; the message lists those that there are.
        """
        names = self.names or ()
        if isinstance(column, str):
            for name in (column, plain_name(column)):
                if name in names:
                    return names.index(name)
        elif 0 <= column < self.count:
            return int(column)
        seen = f": {', '.join(names)}" if names else " without names"
        raise ValueError(f"There is no column {column!r}; the file has {self.count}, numbered from 0{seen}.")


def plain_name(name: Any) -> str:
    """Make a name plain: ``Yaw [deg]`` becomes ``yaw_deg``."""
    return re.sub(r"[^a-z0-9]+", "_", str(name).lower()).strip("_")


def plain_names(names: Iterable[Any]) -> tuple[str, ...]:
    """Make names plain: ``Gyro. X`` becomes ``gyro_x``, an empty one ``column_3``."""
    return tuple(plain_name(name) or f"column_{i}" for i, name in enumerate(names))
