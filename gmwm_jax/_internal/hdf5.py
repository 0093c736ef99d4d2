"""What an HDF5 or netCDF file says of its sizes, without reading any of it."""

import math
from pathlib import Path

from gmwm_jax._internal.optional import import_optional

_FLOAT = 8
"""Bytes of a value that was packed into less."""


def bytes_of_hdf5(file: Path) -> int:
    """Return the bytes that all arrays of a file take in memory.

    Raises
    ------
    ImportError
        It needs the extra ``io``.
    OSError
        It is no such file.
    """
    h5py = import_optional("h5py")
    with h5py.File(file, "r") as content:
        # a link may lead out of the file, or to nothing
        arrays = [content[name] for name in content if isinstance(content.get(name, getlink=True), h5py.HardLink)]
        return sum(
            math.prod(a.shape) * max(a.dtype.itemsize, _FLOAT)
            for a in arrays
            if isinstance(a, h5py.Dataset) and a.shape is not None
        )
