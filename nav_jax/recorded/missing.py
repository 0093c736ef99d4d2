"""Rows of a table of fixes that hold none: NaN, and what receivers write before they have a position."""

import warnings
from collections.abc import Mapping, Sequence

import numpy as np

from nav_jax.recorded.gnss.raw import IncompleteLogWarning
from nav_jax.trajectory.columns import POSITION


def rows_of_fixes(values: Mapping[str, np.ndarray], names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the rows that have all values of some names; of the others a warning says how many there are.

    Parameters
    ----------
    values
        Quantity -> column, (N,).
    names
        Quantities of which a fix has all. Latitude and longitude are not both 0.

    Raises
    ------
    ValueError
        No row has them.
    """
    columns = [values[name] for name in names]
    lacking = np.zeros(len(columns[0]), dtype=bool)
    for column in columns:
        if column.dtype.kind == "f":
            lacking |= np.isnan(column)
    if set(POSITION["geodetic"]) <= set(names):
        lacking |= (values["latitude"] == 0) & (values["longitude"] == 0)
    if not lacking.any():
        return dict(values)
    what = "NaN, or latitude and longitude 0" if "latitude" in names else "NaN"
    if lacking.all():
        raise ValueError(f"None of the {len(lacking)} rows is a fix with {', '.join(names)} ({what}).")
    warnings.warn(
        f"{lacking.sum()} of {len(lacking)} rows are no fix with {', '.join(names)} ({what}), the first at index "
        f"{int(lacking.argmax())}, and are left out.",
        IncompleteLogWarning,
        stacklevel=3,
    )
    return {name: column[~lacking] for name, column in values.items()}
