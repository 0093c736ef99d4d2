"""Writing files so that they are there whole or not at all."""

import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any


def write_atomically(path: str | os.PathLike, write: Callable[[IO[bytes]], Any]) -> Path:
    """Call ``write`` with a temporary file beside `path`, then rename it to `path`.

    Parameters
    ----------
    path
        Target; its folder is made if it is not there.
    write
        Writes bytes into the open file.

    Returns
    -------
    `path`.

    Raises
    ------
    OSError
        `path` is a folder, or cannot be written.
    """
    path = Path(path)
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, and a file is to be written.")
    # opened by name, not by tempfile, whose files nobody else may read
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = temporary.open("xb")
    except OSError as error:
        raise OSError(f"{path} cannot be written: {error.strerror}.") from error
    try:
        with file:
            write(file)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path
