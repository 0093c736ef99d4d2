"""Results as arrays with named axes and units, which xarray and pandas take."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.stores import import_xarray

if TYPE_CHECKING:
    import pandas
    import xarray

UNIT_OF_CHANNEL = "of the channel: see the coordinate unit"
UNIT_OF_PARAMETER = "of the parameter: see the coordinate parameter_unit"


def import_pandas() -> Any:
    """Import pandas, or raise an ImportError that says how to install it."""
    return import_optional("pandas")


class Values(NamedTuple):
    """One array, its axes by name and its unit; "" where it has none."""

    dims: tuple[str, ...] | str
    values: Any
    unit: str = ""


class Arrays(NamedTuple):
    """All that a Dataset holds."""

    variables: Mapping[str, Values]
    coordinates: Mapping[str, Values]
    attributes: Mapping[str, Any]
    rows: tuple[str, ...]
    """Axes of the variables that make up the table."""


class Labelled:
    """A result that says which arrays it is made of."""

    __slots__ = ()

    def _arrays(self) -> Arrays:
        raise NotImplementedError

    def to_xarray(self) -> "xarray.Dataset":
        """The numbers of it as a Dataset with coordinates, and units as attributes; needs the extra ``io``."""
        xarray = import_xarray()
        variables, coordinates, attributes, _ = self._arrays()
        data, along = ({name: _variable(*a) for name, a in part.items()} for part in (variables, coordinates))
        return xarray.Dataset(data, along, attributes)

    def to_pandas(self) -> "pandas.DataFrame":
        """Its table as a DataFrame, in the units of `to_xarray`; needs the extra ``io``."""
        import_pandas()
        dataset, rows = self.to_xarray(), self._arrays().rows
        return dataset[[name for name, v in dataset.data_vars.items() if v.dims == rows]].to_dataframe()


def _variable(dims: Any, values: Any, unit: str) -> tuple[Any, np.ndarray, dict[str, str]]:
    array = np.asarray(values)
    return dims, array.astype(object) if array.dtype.kind == "U" else array, {"units": unit} if unit else {}
