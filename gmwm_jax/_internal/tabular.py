"""What an opened file offers, whatever its format: numbered columns, perhaps with names, rate and units."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np


class Columns(NamedTuple):
    """The columns of a file, loaded when they are asked for."""

    names: tuple[str, ...] | None
    count: int
    load: Callable[[list[int]], Sequence[np.ndarray]]
    """Column numbers -> those columns, each (N,)."""
    rate: float | None = None
    units: tuple[str, ...] | None = None
    title: str | None = None

    def position(self, column: int | str) -> int:
        """Return the number of a column given by name or number.

        Raises
        ------
        ValueError
            There is no such column; the message lists those that there are.
        """
        names = self.names or ()
        if isinstance(column, str):
            for name in (column, *plain_names([column])):
                if name in names:
                    return names.index(name)
        elif 0 <= column < self.count:
            return column
        seen = f": {', '.join(names)}" if names else " without names"
        raise ValueError(f"There is no column {column!r}; the file has {self.count}, numbered from 0{seen}.")


def plain_names(names: Iterable[Any]) -> tuple[str, ...]:
    """Make names plain: ``Gyro. X`` becomes ``gyro_x``, an empty one ``column_3``."""
    plain = (re.sub(r"[^a-z0-9]+", "_", str(name).lower()).strip("_") for name in names)
    return tuple(name or f"column_{i}" for i, name in enumerate(plain))
