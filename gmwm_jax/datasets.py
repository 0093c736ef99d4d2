"""Named public recordings, fetched once and checked by their SHA-256.

The files are those of the repository SMAC-Group/imudata; none of them is part of this package. A machine without a
network uses copies: put them into a folder and name it in the environment variable ``GMWM_JAX_DATA``.
"""

import os
from pathlib import Path

from gmwm_jax._known_files import KNOWN_FILES, KnownFile, sha256
from gmwm_jax.io import import_optional, read_recording
from gmwm_jax.recording import Recording

FOLDER_VARIABLE = "GMWM_JAX_DATA"
"""Environment variable that names a folder of files placed by hand."""


def names() -> tuple[str, ...]:
    """Return the names of all data sets."""
    return tuple(known.name for known in KNOWN_FILES)


def info(name: str) -> KnownFile:
    """Return what is documented about a data set: file, rate, channels, units, description, source.

    Raises
    ------
    ValueError
        No data set has this name.
    """
    for known in KNOWN_FILES:
        if known.name == name:
            return known
    raise ValueError(f"There is no data set {name!r}; there are: {', '.join(names())}.")


def load(name: str) -> Recording:
    """Return a data set as a recording in SI, fetching its file on first use.

    Raises
    ------
    ImportError, OSError, ValueError
        See `fetch` and `gmwm_jax.io.read_recording`.
    """
    return read_recording(fetch(name), name=name)


def fetch(name: str) -> Path:
    """Return the path of a data set's file: placed by hand, else in the cache, else downloaded into the cache.

    Raises
    ------
    ImportError
        A download needs the extra ``io``.
    OSError
        The download failed; the message says where to put the file by hand.
    ValueError
        No data set has this name, or the file is not the one that is documented.
    """
    known = info(name)
    return _placed(known) or _downloaded(known)


def _placed(known: KnownFile) -> Path | None:
    """Return the file that was placed by hand, if there is one."""
    folder = os.environ.get(FOLDER_VARIABLE)
    file = Path(folder) / known.file if folder else None
    if file is None or not file.is_file():
        return None
    seen = sha256(file)
    if seen != known.sha256:
        raise ValueError(
            f"{file} is not the public file: its SHA-256 is {seen}, and should be {known.sha256}. It was cut short or "
            f"changed on the way; fetch it again from {known.source}{known.file}, or remove it."
        )
    return file


def _downloaded(known: KnownFile) -> Path:
    pooch = import_optional("pooch")
    cache = pooch.create(
        path=pooch.os_cache("gmwm_jax"), base_url=known.source, registry={known.file: f"sha256:{known.sha256}"}
    )
    try:
        return Path(cache.fetch(known.file))
    except OSError as error:  # requests raises subclasses of it
        raise OSError(
            f"{known.file} could not be fetched from {known.source}{known.file} ({error}). Without a network, put the "
            f"file into a folder by hand and name the folder in the environment variable {FOLDER_VARIABLE}."
        ) from error
