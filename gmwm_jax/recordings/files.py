"""Recordings from files and back: which of the columns of a file are channels, at which rate and in which units."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.columns import plain_name, plain_names
from gmwm_jax._internal.tabular import SAVED_RECORDING, Reading, open_file, require_file
from gmwm_jax._internal.typing import FloatLike, Names
from gmwm_jax.recordings._public_files import KNOWN_FILES, recognise
from gmwm_jax.recordings._timebase import rate_of_time
from gmwm_jax.recordings.recording import Recording

_RATE_TOLERANCE = 0.01
_TIME = re.compile(r"t(_(s|ms|us|ns))?|(.*_)?(time|timestamps?|sec|secs|seconds?)(_.*)?")
"""Names of columns of time: ``t``, ``time_s``, ``timestamp_ns``, ``sys_time`` ..."""


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate: FloatLike | None = None,
    units: str | Sequence[str] | Mapping[str, str] | None = None,
    channels: Names | None = None,
    columns: Sequence[int | str] | None = None,
    time: int | str | None = None,
    time_unit: str = "s",
    delimiter: str | None = None,
    header: int | None = None,
    name: str | None = None,
    variable: str | None = None,
    gaps: bool = False,
) -> Recording:
    """Read a recording from a file; its suffix tells the format.

    Formats: ``.npy``, ``.npz``, ``.parquet``, netCDF (``.nc``), R data (``.rda``, ``.rdata``) and text (``.csv``,
    ``.tsv``, ``.txt``, ``.dat``, ``.log``, ``.asc``; comments start with ``#`` or ``%``). Names in a file are made
    plain: ``Gyro. X`` is ``gyro_x``. What `save_recording` wrote and the public files of `gmwm_jax.datasets`,
    recognised by their content, need no further argument.

    Parameters
    ----------
    path
        The file.
    rate
        Sampling rate in Hz; needed unless the file states it or has a column of time. It is never guessed.
    units
        Unit of the samples in the file, see `Recording.from_array`.
    channels
        Names of the channels that are read, in place of those in the file.
    columns
        The columns to read, by name or number (from 0); default: all but that of time.
    time
        The column of time, by name or number. It must increase in even steps.
    time_unit
        Unit of that column: ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; timestamps need none.
    delimiter
        Of a text file; default: found among semicolon, tab, comma and blanks.
    header
        Number of lines of a text file to skip; default: comments and at most one line of names.
    name
        Name of the recording; default: the file name.
    variable
        The object to read, where an ``.npz`` or R file holds several.
    gaps
        Does NaN mark missing samples? Else it is an error (but in what `save_recording` wrote).

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        Parquet, netCDF and R data need the extra ``io``.
    ValueError
        A file that is corrupt or no regular numeric series; a column of time that is neither named nor left out; a rate
        or unit that is missing or contradicts the file.

    Examples
    --------
    >>> np.savetxt("static.csv", np.arange(4.0), header="gyro_x", comments="")
    >>> rec = gj.read_recording("static.csv", rate=100.0, units="rad/s")
    >>> rec.channels, rec.data.shape
    (('gyro_x',), (4, 1))
    """
    file = Path(path)
    require_file(file, _public(file))
    try:
        table = open_file(file, Reading(delimiter, header, variable))
        if table.skipped and columns is None:  # nothing is left out silently
            raise ValueError(
                f"Beside the columns {', '.join(table.names or ())} there are {', '.join(table.skipped)}, which are "
                "none: columns=... or variable=... is needed to choose."
            )
        saved = table.title is not None
        if table.names and not saved:
            stated = {plain_name(column): unit for column, unit in table.units.items()}
            table = table._replace(names=plain_names(table.names), units=stated)
        known = recognise(file) if units is None and not table.units else None
        if known is not None:
            table = table._replace(rate=table.rate or known.rate)
        timed = None if time is None else table.number(time)
        wanted = range(table.count) if columns is None else [table.number(column) for column in columns]
        picked = [i for i in wanted if i != timed]
        if not picked:
            raise ValueError("No column is left to read besides that of time.")
        labels = [table.names[i] if table.names else str(i) for i in picked]
        found = [label for label in labels if _TIME.fullmatch(label.lower())]
        if found and time is None and known is None and not saved:
            raise ValueError(f"Column {found[0]!r} looks like time: name it by time=..., or pick others by columns=...")
        stated = [known.units[i] for i in picked] if known else _stated_units(labels, table.units, units)
        loaded = list(table.load(picked if timed is None else [*picked, timed]))
        timed_rate = None if timed is None else rate_of_time(loaded.pop(), time_unit)
        samples = _stack(loaded, labels)
        return Recording.from_array(
            samples,
            rate=_agreed_rate({"rate=": rate, "the file": table.rate, "the column of time": timed_rate}),
            units=units if stated is None else stated,
            channels=labels if channels is None and table.names else channels,
            name=name or table.title or file.stem,
            gaps=gaps or (saved and bool(np.any(np.isnan(samples)))),
        )
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error


def save_recording(recording: Recording, path: str | os.PathLike[str]) -> Path:
    """Write a recording to an ``.npz`` file that `read_recording` reads back without further arguments.

    The file appears complete or not at all: an interruption leaves one that was there before untouched. Its folder is
    made if it is not there.

    Parameters
    ----------
    recording
        The recording.
    path
        Ends in ``.npz``.

    Returns
    -------
    The path of the file.

    Raises
    ------
    ValueError
        `path` ends in another suffix.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"])
    >>> path = gj.save_recording(rec, "static.npz")
    >>> gj.read_recording(path).rate
    100.0
    """
    file = Path(path)
    if file.suffix.lower() != ".npz":
        raise ValueError(f"Recordings are saved as .npz, and the path is {file}.")
    arrays: dict[str, Any] = {key: np.asarray(getattr(recording, key)) for key in SAVED_RECORDING}
    return write_atomically(file, lambda stream: np.savez(stream, **arrays))


def _public(file: Path) -> str:
    """Say how a public data set of this name is fetched, if there is one."""
    names = [known.name for known in KNOWN_FILES if known.file == file.name]
    return f" gmwm_jax.datasets.load({names[0]!r}) fetches this public data set." if names else ""


def _stated_units(labels: Sequence[str], stated: Mapping[str, str], given: Any) -> list[str] | None:
    """Return the units that the file states for these columns; None: for none of them."""
    if not any(label in stated for label in labels):
        return None
    if missing := [label for label in labels if label not in stated]:
        raise ValueError(
            f"The file states units, but not of {', '.join(missing)}: leave them out by columns=..., or state all."
        )
    units = [stated[label] for label in labels]
    if given is not None:
        raise ValueError(f"The file states its units ({', '.join(units)}): leave out units=...")
    return units


def _stack(columns: Sequence[np.ndarray], labels: Sequence[str]) -> np.ndarray:
    """Put columns side by side, or name the one that is not numeric."""
    for column, label in zip(columns, labels, strict=True):
        if column.dtype.kind not in "iuf":
            raise ValueError(f"Column {label!r} holds {column[:1]} ({column.dtype}), not numbers: leave it out.")
    return np.stack(columns).T


def _agreed_rate(sources: dict[str, FloatLike | None]) -> float:
    """Return the rate of the first source that states one; the others must agree with it."""
    rates = {source: sampling_rate(rate) for source, rate in sources.items() if rate is not None}
    if not rates:
        raise ValueError(
            "The sampling rate is missing and the file states none: give rate=... in Hz, or time=... to name the column"
            " of time. It is never guessed."
        )
    (first, rate), *others = rates.items()
    for source, other in others:
        if abs(other / rate - 1) > _RATE_TOLERANCE:
            raise ValueError(f"Wrong rate (or time_unit): {first} says {rate:g} Hz, and {source} {other:g} Hz.")
    return rate
