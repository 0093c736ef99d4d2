"""Recordings from files and back: which of the columns of a file are channels, at which rate and in which units."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal import stamps
from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.columns import Columns, Stamps, plain_name
from gmwm_jax._internal.formats.base import without_unit
from gmwm_jax._internal.gravity import warn_of_units
from gmwm_jax._internal.imu_names import ACCEL, GYRO, role_of
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import SAVED_RECORDING, open_file, require_file
from gmwm_jax._internal.timing import GAPS, Timing, drift_of, longest_rise, timing
from gmwm_jax._internal.typing import FloatLike, Names
from gmwm_jax.recordings._columns import (
    Signal,
    is_signal,
    labels_of,
    looks_like_time,
    names_of,
    pick,
    rename,
    select,
    signals_of,
    time_of,
    with_units,
)
from gmwm_jax.recordings._public_files import KNOWN_FILES, recognise
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.recordings.understood import Understood
from gmwm_jax.units import signal_unit

_RATE_TOLERANCE = 0.01


def read_recording(
    path: str | os.PathLike[str],
    *,
    rate: FloatLike | None = None,
    units: str | Sequence[str] | Mapping[str, str] | None = None,
    scale: str | Mapping[str, str] | None = None,
    columns: Sequence[int | str] | None = None,
    channels: Names | None = None,
    names: Names | Mapping[str, str] | None = None,
    time: int | str | Sequence[int | str] | None = None,
    time_unit: str | None = None,
    clock: int | str | Sequence[int | str] | None = None,
    gaps: str = "refuse",
    format: str | None = None,
    delimiter: str | None = None,
    header: int | None = None,
    variable: str | None = None,
    name: str | None = None,
    max_bytes: int | str | None = None,
    progress: Progress = False,
) -> Recording:
    """Read a recording from a file; its content and its suffix tell the format.

    Files: ``.npy``, ``.npz``, ``.parquet``, netCDF (``.nc``), R data (``.rda``, ``.rdata``), ROS bags (``.bag``,
    ``.mcap``, ``.db3``, folders) and text (``.csv``, ``.tsv``, ``.txt``, ``.dat``, ``.log``, ``.asc``, ``.imu``; UTF-8,
    UTF-16 or Latin-1; comments start with ``#``, ``%`` or ``//``), all of them also as ``.gz``, ``.bz2``, ``.xz`` or
    ``.zip``. Of text the separator, decimal commas, the line of names and a line of units are found; a unit may stand
    in the name of a column (``gyro_x [deg/s]``, ``gyro_x_deg_s``). Names are made plain: ``Gyro. X`` is ``gyro_x``;
    `columns`, `channels`, `units` and `time` take them as the file writes them, too. Columns of text are left out.

    Formats of loggers (`format`) name the channels ``gyro_x`` ... ``accel_z`` and know units and time; all but those in
    brackets are found by their content: ``xsens``, ``vectornav``, ``ros``, ``novatel``, ``euroc``, ``kitti``
    (``kf-gins``, ``rtklibexplorer``). What was understood is in `Recording.understood`. What `save_recording` wrote and
    the public files of `gmwm_jax.datasets`, recognised by their content, need no further argument.

    Parameters
    ----------
    path
        The file.
    rate
        Sampling rate in Hz; needed unless the file states it or has a column of time. It is never guessed.
    units
        Unit of the samples in the file, see `Recording.from_array`; what the file states as well must agree.
    scale
        Of counts: their size in a unit, as in ``{"gyro": "0.1 deg/s", "accel": "1.25 mg"}``, or the type of IMU, where
        the format knows such (``novatel``).
    columns
        The columns to read, by name or number (from 0); default: all that hold numbers but that of time, or the gyros
        and accelerometers of a logger's format.
    channels
        The channels to keep, by name or group (``gyro``); default: all that were read.
    names
        New names of the channels: one each, or a mapping from the old ones.
    time
        The column of time, by name or number, or two of them: date and time of day, week and seconds, or seconds and
        nanoseconds. Numbers, or texts such as ``2026-01-31T13:02:25.964``.
    time_unit
        Unit of that column: ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``; default: what its name says, else seconds.
    clock
        The column of a second clock (time of GNSS, say), against which the drift of the first is estimated.
    gaps
        What is done where samples are missing, or NaN: ``refuse``, an error; ``nan``, NaN takes their places on the
        grid of the rate; ``longest``, the longest run is taken.
    format
        Of the logger, see above; ``text`` for any other text file, whatever its suffix.
    delimiter
        Of a text file; default: found among semicolon, tab, bar, comma and blanks.
    header
        Number of the line that holds the names in a text file, from 1; 0: no line does. Default: found.
    variable
        The object to read, where an ``.npz`` or R file, or the topic, where a bag holds several.
    name
        Name of the recording; default: the file name.
    max_bytes
        Bytes to which the file may unfold, as a number or as in ``"8GB"``. Unless given: 4.3 GB, and 200 times the
        file, so that a small one cannot ask for all of the memory. A plain file may always be as large as it is.
    progress
        Show a bar while a text file is read.

    Raises
    ------
    FileNotFoundError
        No such file.
    ImportError
        Parquet, netCDF and R data need the extra ``io``, bags the extra ``ros``.
    ValueError
        A file that is corrupt or no regular numeric series; a column of time that is neither named nor left out; a rate
        or unit that is missing or contradicts the file; missing samples that are refused; a file that
        unfolds to more than `max_bytes`, and a text of more than 1,000 columns.

    Examples
    --------
    >>> np.savetxt("static.csv", np.arange(4.0), header="gyro_x [deg/s]", comments="")
    >>> rec = gj.read_recording("static.csv", rate=100.0)
    >>> rec.channels, rec.data.shape
    (('gyro_x',), (4, 1))
    >>> gj.read_recording("static.csv", rate=100.0, units="rad/s")
    Traceback (most recent call last):
    ValueError: static.csv: units=... says that gyro_x is in rad/s, and the file says deg/s: leave it out.
    """
    file = Path(path)
    require_file(file, _public(file))
    if gaps not in GAPS:
        raise ValueError(f"gaps is one of {', '.join(GAPS)}, and is {gaps!r}.")
    most = size_in_bytes(max_bytes)
    bar = progress_bar(_size(file), "B", progress)
    try:
        kind = scale if isinstance(scale, str) and not re.match(r"\s*[-+.\d]", scale) else None
        told = bar.update if progress else None
        table = open_file(file, Reading(delimiter, header, variable, format, kind, told, most))
        if kind is not None and table.format != "novatel":
            raise ValueError(f"scale=... names a type of IMU, {kind!r}, which only logs of novatel are read by.")
        return _recording(
            table, file, rate=rate, units=units, scale=None if kind else scale, columns=columns,
            channels=channels, names=names, time=time, time_unit=time_unit, clock=clock, gaps=gaps, name=name,
        )  # fmt: skip
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    finally:
        bar.close()


def _recording(
    table: Columns, file: Path, *, rate: Any, units: Any, scale: Any, columns: Any, channels: Any, names: Any,
    time: Any, time_unit: Any, clock: Any, gaps: str, name: str | None,
) -> Recording:  # fmt: skip
    """Make a recording of a table; arguments of `read_recording`."""
    if table.skipped and columns is None:  # nothing is left out silently
        raise ValueError(
            f"Beside the columns {', '.join(table.names or ())} there are {', '.join(table.skipped)}, which are "
            "none: columns=... or variable=... is needed to choose."
        )
    known = None
    if units is None and not table.units and file.suffix.lower() in (".rda", ".rdata"):
        known = recognise(file)
    saved = table.title is not None
    called = names_of(table)
    written = table.names or called.labels
    stamped = time_of(table, called, time, time_unit)
    second = None if clock is None else time_of(table, called, clock, None)
    timed = [i for one in (stamped, second) if one is not None for i in one.columns]
    picked = pick(table, called, columns, timed)
    found = [plain_name(written[i]) for i in picked if looks_like_time(called.labels[i])]
    if found and stamped is None and known is None and not saved:
        raise ValueError(f"Column {found[0]!r} looks like time: name it by time=..., or pick others by columns=...")
    if columns is None and not table.roles:
        picked = [i for i in picked if called.units[i] is None or is_signal(str(called.units[i]))] or picked
    picked = select(picked, channels, table, called)
    text = [written[i] for i in sorted(table.text) if i not in timed]
    of_text = (f"Left out, no numbers: {', '.join(text)}.",) if text and columns is None and not table.roles else ()
    labels = labels_of(picked, table, called)
    stated = [known.units[i] for i in picked] if known else [called.units[i] for i in picked]
    found_signals = signals_of(labels, stated, units, scale, table, called)
    asked = columns is not None or channels is not None
    picked, labels, signals, left_out = with_units(picked, labels, found_signals, asked, table, scale or units)
    loaded, times, clocks = _load(table, picked, stamped, second)
    resets: tuple[str, ...] = ()
    if times is not None and gaps == "longest" and len(times) and (run := longest_rise(times)) != slice(0, len(times)):
        resets = (f"The clock falls back; taken were rows {run.start} to {run.stop - 1} of {len(times)}.",)
        loaded, times = [column[run] for column in loaded], times[run]
        clocks = None if clocks is None else clocks[run]
    time_found = None if times is None else timing(times, lambda rows: _repeated(loaded, rows))
    sources = {
        "rate=": rate,
        "the file": table.rate or (known.rate if known else None),
        f"the column of time {stamped.label}" if stamped and time else _by_format(stamped): getattr(
            time_found, "rate", None
        ),
    }
    source, hertz = _agreed_rate(sources)
    titles = rename(labels, names)
    data = _samples(loaded, signals, hertz, [called.labels[i] for i in picked])
    data, dropped = _without_gaps(data, time_found, "nan" if saved and gaps == "refuse" else gaps, titles)
    data.flags.writeable = False
    in_si = [signal_unit(s.unit).si for s in signals]
    doubts = () if saved else _doubts(data, [called.labels[i] for i in picked], table.roles, picked, in_si)
    understood = Understood(
        table.format or ("a file of this package" if saved else "a table"),
        {t: (written[i], s.written) for t, i, s in zip(titles, picked, signals, strict=True)},
        hertz, source if source != "rate=" else "what was given", time_found,
        None if times is None or clocks is None else drift_of(times, clocks),
        (*table.notes, *of_text, *left_out, *resets, *dropped, *doubts),
    )  # fmt: skip
    return Recording(
        data, hertz, tuple(titles), tuple(in_si), name or table.title or file.stem,
        gaps=bool(np.any(np.isnan(data))) if gaps == "nan" or saved else False, understood=understood,
    )  # fmt: skip


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


def _by_format(stamped: Stamps | None) -> str:
    return f"its time ({stamped.label})" if stamped else "its time"


def _size(file: Path) -> int | None:
    return file.stat().st_size if file.is_file() else None


def _load(
    table: Columns, picked: list[int], *stamped: Stamps | None
) -> tuple[list[np.ndarray], np.ndarray | None, np.ndarray | None]:
    """Return the columns that are picked, and the seconds of each clock."""
    numeric = [i for one in stamped if one is not None for i in one.columns if i not in table.text]
    loaded = list(table.load([*picked, *numeric]))
    numbers = dict(zip(numeric, loaded[len(picked) :], strict=True))
    del loaded[len(picked) :]
    seconds = []
    for one in stamped:
        if one is None:
            seconds.append(None)
            continue
        parts = [numbers[i] if i in numbers else table.load_text(i, stamps.from_text) for i in one.columns]
        seconds.append(one.seconds(parts))
    return loaded, seconds[0], seconds[1]


def _doubts(
    data: np.ndarray, labels: Sequence[str], roles: Mapping[str, int], picked: Sequence[int], units: Sequence[str]
) -> tuple[str, ...]:
    """Warn if gravity contradicts the units of three accelerometers, or their place among the columns."""
    at = {role_of(without_unit(label)): k for k, label in enumerate(labels)}
    at |= {role: picked.index(column) for role, column in roles.items() if column in picked}
    if not set(ACCEL) <= set(at) or {units[at[a]] for a in ACCEL} != {"m/s^2"}:  # without unit, nothing is claimed
        return ()
    gyro, accel = (data[:, [at[a] for a in axes]] if set(axes) <= set(at) else None for axes in (GYRO, ACCEL))
    text = None if accel is None else warn_of_units(gyro, accel)
    return () if text is None else (text,)


def _repeated(columns: Sequence[np.ndarray], rows: np.ndarray) -> np.ndarray:
    """Do these rows hold the values of the row before?"""
    return np.all([column[rows] == column[rows - 1] for column in columns], axis=0)


def _samples(columns: list[np.ndarray], signals: Sequence[Signal], rate: float, labels: Sequence[str]) -> np.ndarray:
    """Put columns side by side in SI, channel by channel; each is forgotten when it is copied, so that one is twice."""
    data = np.empty((len(columns[0]), len(columns)), order="F")
    for i, (signal, label) in enumerate(zip(signals, labels, strict=True)):
        column = columns[i]
        if column.dtype.kind not in "iuf":
            raise ValueError(f"Column {label!r} holds {column[:1]} ({column.dtype}), not numbers: leave it out.")
        unit = signal_unit(signal.unit)
        data[:, i] = column
        data[:, i] *= unit.factor * signal.factor * (rate if unit.increments else 1.0)
        columns[i] = column = np.empty(0)
    return data


def _without_gaps(
    data: np.ndarray, time: Timing | None, gaps: str, titles: Sequence[str]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the samples as the policy has them, and what was done."""
    notes: list[str] = []
    if time is not None and (time.missing or time.duplicated):
        rows = np.arange(len(data))[time.kept(gaps)]
        if gaps == "nan":
            places = time.place[rows]
            full = np.full((int(places[-1]) + 1, data.shape[1]), np.nan, order="F")
            full[places] = data[rows]
            data = full
            notes.append(f"{time.missing} missing samples became NaN.")
        else:
            notes.append(f"The longest run without gaps was taken: rows {rows[0]} to {rows[-1]} of {len(data)}.")
            data = np.asfortranarray(data[rows])
    if gaps == "longest":
        missing = np.any(np.isnan(data), axis=1)
        if missing.any():
            edges = np.flatnonzero(np.diff(np.concatenate([[True], missing, [True]]).astype(np.int8)))
            starts, ends = edges[::2], edges[1::2]
            longest = int(np.argmax(ends - starts)) if len(starts) else 0
            if not len(starts):
                raise ValueError("Each row has a sample that is NaN: there is no run without.")
            data = np.asfortranarray(data[starts[longest] : ends[longest]])
            notes.append(f"The longest run without NaN was taken: rows {starts[longest]} to {ends[longest] - 1}.")
    elif gaps == "refuse":
        for i, title in enumerate(titles):
            if np.isnan(np.sum(data[:, i])) and len(bad := np.flatnonzero(np.isnan(data[:, i]))):
                raise ValueError(
                    f"channel {title!r} holds {len(bad)} values that are NaN, the first (nan) at index {bad[0]}. If "
                    'they are missing samples, gaps="nan" takes them for such, and gaps="longest" the longest run '
                    "without; else repair them."
                )
    return data, tuple(notes)


def _agreed_rate(sources: dict[str, FloatLike | None]) -> tuple[str, float]:
    """Return the first source that states a rate, and that rate; the others must agree with it."""
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
    return first, rate
