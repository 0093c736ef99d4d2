"""Arrays of NumPy's files, after their headers were compared with the bytes that are there."""

import math
import zipfile
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from gmwm_jax._internal.limits import as_bytes, require_size

_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def load_arrays(file: Path, max_bytes: int | None) -> dict[str, np.ndarray]:
    """Return the arrays of an ``.npz`` file by their names, that of an ``.npy`` file by the name ``""``.

    Raises
    ------
    TooLargeError
        They are larger than allowed.
    ValueError
        This is neither, it is corrupt, it promises more than it has, or it holds objects.
    """
    size = file.stat().st_size
    if zipfile.is_zipfile(file):
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            require_size("The arrays of the file", sum(m.file_size for m in members), size, max_bytes)
            for member in members:
                with archive.open(member) as stream:
                    _require_whole(member.filename, stream, member.file_size)
    with file.open("rb") as stream:
        if not zipfile.is_zipfile(file):
            if stream.read(2) != b"\x93N":
                raise ValueError("it starts neither as .npy nor as .npz does")
            stream.seek(0)
            _require_whole("the array", stream, size)
        stream.seek(0)
        loaded = np.load(stream, allow_pickle=False)
        return {"": loaded} if isinstance(loaded, np.ndarray) else {name: loaded[name] for name in loaded}


def _require_whole(name: str, stream: Any, size: int) -> None:
    """Raise unless the values that a header promises follow it: NumPy asks for their memory before it reads them."""
    version = np.lib.format.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"{name} is a table of NumPy's own kind, version {version}: keep its columns as plain arrays.")
    try:
        shape, _, dtype = _HEADERS[version](stream)
    except (SyntaxError, ValueError, TokenError) as error:  # it is parsed as Python's literals
        raise ValueError(f"the header of {name} cannot be read") from error
    if dtype.hasobject:
        raise ValueError(f"{name} holds objects of Python, which are never loaded: save numbers")
    promised, there = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if promised > there:
        raise ValueError(
            f"the header of {name} promises {dtype} of shape {shape}, {as_bytes(promised)}, and {as_bytes(there)} "
            "follow"
        )
