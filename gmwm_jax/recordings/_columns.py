"""Which columns of a table are channels, how these are called, and in which units their samples are."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gmwm_jax._internal import stamps
from gmwm_jax._internal.columns import Columns, Stamps, plain_name
from gmwm_jax._internal.imu_names import role_of
from gmwm_jax.units import counts, of_column, signal_unit, time_size

_TIME = re.compile(r"t(_(s|ms|us|ns))?|(.*_)?(time|timestamps?|sec|secs|seconds?)(_.*)?")
"""Names of columns of time: ``t``, ``time_s``, ``timestamp_ns``, ``sys_time`` ..."""


class Names(NamedTuple):
    """Of all columns of a table."""

    labels: tuple[str, ...]
    """Names of channels, if they become any."""
    units: tuple[str | None, ...]
    """As the source states them."""


def names_of(table: Columns) -> Names:
    """Name the columns of a table: by their role where the format says it, else plainly and without their units."""
    if table.names is None:
        return Names(tuple(map(str, range(table.count))), (None,) * table.count)
    if table.title is not None:  # saved by this package
        return Names(table.names, tuple(table.units.get(name) for name in table.names))
    divided = [of_column(name) for name in table.names]
    labels = [base or f"column_{i}" for i, (base, _) in enumerate(divided)]
    units = [table.units.get(name, unit) for name, (_, unit) in zip(table.names, divided, strict=True)]
    twice = {label for label in labels if labels.count(label) > 1}  # only their units tell them apart
    labels = [plain_name(n) or x if x in twice else x for n, x in zip(table.names, labels, strict=True)]
    for role, i in table.roles.items():
        labels[i] = role
    return Names(tuple(labels), tuple(units))


def pick(table: Columns, names: Names, columns: Sequence[int | str] | None, timed: Sequence[int]) -> list[int]:
    """Return the numbers of the columns to read: those asked for, or those that may hold samples.

    Raises
    ------
    ValueError
        There is no such column, or none.
    """
    if columns is not None:
        wanted = [table.number(_as_written(names, column)) for column in columns]
    elif table.roles:
        wanted = sorted(table.roles.values(), key=lambda i: (names.labels[i][:-1] != "gyro_", names.labels[i]))
    else:
        wanted = [i for i in range(table.count) if i not in table.text]
    found = [i for i in wanted if i not in timed]
    if not found:
        raise ValueError("No column is left to read besides that of time.")
    return found


def _as_written(names: Names, column: int | str) -> int | str:
    return names.labels.index(column) if isinstance(column, str) and column in names.labels else column


def labels_of(picked: Sequence[int], table: Columns, names: Names) -> list[str]:
    """Return the names of the channels that columns become; where the file has none, these are numbered."""
    return [names.labels[i] if table.names else f"channel_{k}" for k, i in enumerate(picked)]


def select(picked: list[int], channels: Any, table: Columns, names: Names) -> list[int]:
    """Return the columns of the channels to keep, by name, group or column of the file.

    Raises
    ------
    ValueError
        There is no such channel.
    """
    if channels is None:
        return picked
    found: list[int] = []
    labels = labels_of(picked, table, names)
    for key in (channels,) if isinstance(channels, str) else channels:
        meant = [picked[i] for i in _meant(key, labels, table, names)]
        if not meant:
            raise ValueError(
                f"There is no channel or group {key!r}; the channels are: {', '.join(labels)}. New names are given by "
                "names=..."
            )
        found += [i for i in meant if i not in found]
    return found


def rename(labels: Sequence[str], names: Any) -> list[str]:
    """Return new names of channels: one each, or a mapping from the old ones.

    Raises
    ------
    ValueError
        Not one each; an old name that is none.
    """
    if names is None:
        return list(labels)
    if isinstance(names, Mapping):
        if unknown := [name for name in names if name not in labels]:
            raise ValueError(f"names=... renames {', '.join(unknown)}, and the channels are: {', '.join(labels)}.")
        return [names.get(label, label) for label in labels]
    given = [names] if isinstance(names, str) else list(names)
    if len(given) != len(labels):
        raise ValueError(f"{len(given)} channel names ({', '.join(given)}) were given for {len(labels)} channels.")
    return given


def looks_like_time(label: str) -> bool:
    """Is this a name of a column of time?"""
    return bool(_TIME.fullmatch(label.lower()))


def time_of(
    table: Columns, names: Names, time: int | str | Sequence[int | str] | None, time_unit: str | None
) -> Stamps | None:
    """Return how the time is made: as asked, or as the format says.

    Raises
    ------
    ValueError
        There is no such column; an unknown unit, or one that the name of the column contradicts.
    """
    size = None if time_unit is None else time_size(time_unit)
    if time is None:
        return table.stamps
    asked = [time] if isinstance(time, int | str) else list(time)
    numbers = tuple(table.number(_as_written(names, column)) for column in asked)
    written = [(table.names or names.labels)[i] for i in numbers]
    if len(numbers) == 2:
        plain = [plain_name(name) for name in written]
        return Stamps(numbers, lambda columns: stamps.pair(plain, columns), " and ".join(map(repr, written)))
    if len(numbers) != 1:
        raise ValueError(f"The time is one column, or two that belong together, and these are {len(numbers)}.")
    stated = names.units[numbers[0]]
    unit = time_unit or stated or "s"
    if size is not None and stated is not None and time_size(stated) != size:
        raise ValueError(f"time_unit={time_unit!r} contradicts the file, in which {written[0]!r} is in {stated}.")
    label = repr(written[0]) if numbers[0] in table.text else f"{written[0]!r} [{unit}]"
    return Stamps(numbers, lambda columns: _seconds(columns[0], time_size(unit)), label)


def _seconds(column: np.ndarray, size: float) -> np.ndarray:
    return stamps.since_first(column) if column.dtype.kind in "mM" else stamps.seconds_of(column, size)


class Signal(NamedTuple):
    """What the samples of a channel are."""

    unit: str
    factor: float
    """Of the unit: samples may be counts."""
    written: str
    """For a person."""


def signals_of(
    labels: Sequence[str], stated: Sequence[str | None], units: Any, scale: Any, table: Columns, names: Names
) -> list[Signal | None]:
    """Return the unit of each channel, stated by the source, or given, or both alike; None: neither.

    Raises
    ------
    ValueError
        A unit that is unknown, or stated twice differently.
    """
    scales = _per_channel("scale", scale, labels, table, names)
    given = _per_channel("units", units, labels, table, names)
    found: list[Signal | None] = []
    for label, told, unit, size in zip(labels, stated, given, scales, strict=True):
        told = told if told is not None and is_signal(told) else None
        if unit is not None:
            signal_unit(unit)  # known
        if size is not None:
            if unit is not None or told is not None:
                raise ValueError(f"{label} is in {unit or told}, and scale=... is for counts: leave one of them out.")
            factor, name = counts(size)
            found.append(Signal(name, factor, size))
            continue
        if unit is not None and told is not None and signal_unit(unit) != signal_unit(told):
            raise ValueError(f"units=... says that {label} is in {unit}, and the file says {told}: leave it out.")
        text = unit or told
        found.append(None if text is None else Signal(text, 1.0, text))
    return found


def is_signal(unit: str) -> bool:
    """Is this a unit that samples of a sensor may have?"""
    try:
        signal_unit(unit)
    except ValueError:
        return False
    return True


def with_units(
    picked: list[int], labels: list[str], signals: Sequence[Signal | None], asked: bool, table: Columns, given: Any
) -> tuple[list[int], list[str], list[Signal], tuple[str, ...]]:
    """Return the columns whose unit is known, and what is said of the others.

    Where nobody asked for columns, those are left out that are no axis of a gyro or accelerometer while others are.

    Raises
    ------
    ValueError
        Others have no unit either.
    """
    bare = [label for label, signal in zip(labels, signals, strict=True) if signal is None]
    if bare and (asked or any(role_of(label) for label in bare) or not any(role_of(label) for label in labels)):
        raise ValueError(_missing(bare, labels, table, given))
    left = [k for k, signal in enumerate(signals) if signal is not None]
    note = (f"Left out, of unknown unit: {', '.join(bare)}.",) if bare else ()
    return [picked[k] for k in left], [labels[k] for k in left], [s for s in signals if s is not None], note


def _missing(bare: Sequence[str], labels: Sequence[str], table: Columns, given: Any) -> str:
    if isinstance(given, Mapping):
        return f"No unit is given for: {', '.join(bare)}. The keys of units are: {', '.join(given)}."
    if len(bare) < len(labels):
        return (
            f"The file states units, but not of {', '.join(bare)}: give them by units=..., or leave these out by "
            "columns=..."
        )
    unnamed = table.names is None and table.count == 7
    return table.hint or (
        'The unit of the samples is missing: give units=..., one unit or as in {"gyro": "deg/s", "accel": "g"}. It is '
        "never guessed, and it tells rates (rad/s, deg/s, deg/h, m/s^2, g, mg, ug) from increments per sample (rad, "
        'deg, arcsec, m/s), which are multiplied by the rate. "1" leaves samples of another kind as they are. Of '
        'counts give scale=..., as in {"gyro": "0.1 deg/s", "accel": "1.25 mg"}.'
        + (" Loggers that write 7 columns without names: kf-gins, rtklibexplorer; say format=..." if unnamed else "")
    )


def _per_channel(what: str, given: Any, labels: Sequence[str], table: Columns, names: Names) -> list[Any]:
    """Return what is given for each channel: one for all, one each, or by channel, group or column of the file."""
    if given is None or isinstance(given, str):
        return [given] * len(labels)
    if not isinstance(given, Mapping):
        if len(given) != len(labels):
            raise ValueError(f"{len(given)} {what} ({', '.join(given)}) were given for {len(labels)} channels.")
        return list(given)
    found: list[Any] = [None] * len(labels)
    unused = []
    for key, value in sorted(given.items(), key=lambda item: item[0] in labels):  # channels come after groups
        meant = _meant(key, labels, table, names)
        for i in meant:
            found[i] = value
        if not meant:
            unused.append(key)
    if unused:
        raise ValueError(f"{what} names {', '.join(unused)}, and the channels are: {', '.join(labels)}.")
    return found


def _meant(key: str, labels: Sequence[str], table: Columns, names: Names) -> list[int]:
    if key in labels:
        return [labels.index(key)]
    if group := [i for i, label in enumerate(labels) if label.rpartition("_")[0] == key]:
        return group
    if group := [i for i, label in enumerate(labels) if (role_of(label) or "").rpartition("_")[0] == key]:
        return group  # gx is of the gyros
    try:
        label = names.labels[table.number(key)]
    except ValueError:
        return []
    return [labels.index(label)] if label in labels else []
