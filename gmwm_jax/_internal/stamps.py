"""Seconds from columns of time: numbers, timestamps, texts of date and time, and two columns that belong together."""

import re
from collections.abc import Sequence

import numpy as np

_WEEK = 604_800
_DAY = 86_400.0

_ISO = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d*)?)?)?")
_CLOCK = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d(?:\.\d*)?))?")
_DATE = re.compile(r"(\d{4})[/.](\d\d)[/.](\d\d)|(\d\d)\.(\d\d)\.(\d{4})")
_ZONE = re.compile(r"(?<=\d)\s*(Z|UTC|[+-]\d\d:?\d\d)$")


def seconds_of(values: np.ndarray, size: float = 1.0) -> np.ndarray:
    """Return a column of time in seconds from its first value.

    Parameters
    ----------
    values
        Shape (N,): numbers, or NumPy timestamps or durations.
    size
        Seconds in the unit of the numbers.

    Raises
    ------
    ValueError
        Neither.
    """
    if values.dtype.kind in "mM":
        return (values - values[:1]) / np.timedelta64(1, "s")
    if values.dtype.kind not in "iuf":
        raise ValueError(f"The column of time holds {values.dtype} ({values[:1].tolist()} ...), and no numbers.")
    # the first is subtracted while integers are exact, and in 64 bits, where a counter that fell back shows
    ticks = values.astype(np.float64 if values.dtype.kind == "f" else np.int64)
    return (ticks - ticks[:1]) * size


def week_and_seconds(week: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Return seconds from the first of week numbers and seconds of the week."""
    return (week - week[:1]) * float(_WEEK) + (seconds - seconds[:1])


def seconds_and_nanoseconds(seconds: np.ndarray, nanoseconds: np.ndarray) -> np.ndarray:
    """Return seconds from the first of whole seconds and the nanoseconds to add."""
    return (seconds - seconds[:1]) + (nanoseconds - nanoseconds[:1]) * 1e-9


def unwrapped(counter: np.ndarray, size: int) -> np.ndarray:
    """Return a counter that falls back to zero at `size` as one that goes on."""
    steps = np.diff(counter)
    return counter + np.concatenate([[0], np.cumsum(np.where(steps < -size / 2, size, 0))])


def over_weeks(seconds: np.ndarray) -> np.ndarray:
    """Return seconds of the GPS week that go on where one ends.

    A fall from the last day of a week to the first of the next is the end of a week, and no clock that was reset.
    """
    ends = (seconds[:-1] > _WEEK - _DAY) & (seconds[:-1] <= _WEEK) & (seconds[1:] >= 0) & (seconds[1:] < _DAY)
    return seconds + np.concatenate([np.zeros(min(1, len(seconds))), np.cumsum(ends * float(_WEEK))])


def from_text(texts: np.ndarray) -> np.ndarray:
    """Return timestamps (``datetime64[ns]``), or times of day (``timedelta64[ns]``), from texts.

    Read are ``2026-01-31T13:02:25.964`` (also with a blank, ``Z`` or one offset from UTC, which is taken off),
    ``31.01.2026 13:02:25``, ``2026/01/31 13:02:25`` and ``13:02:25.964``.

    Raises
    ------
    ValueError
        Another text; ``01/31/2026`` too, whose day and month are not told apart.
    """
    rows = [str(text).strip().strip('"').replace(",", ".") for text in texts.tolist()]
    if not rows:
        return np.empty(0, "datetime64[ns]")
    zones = {found[1] if (found := _ZONE.search(row)) and ":" in row else "" for row in rows}
    if len(zones) > 1:
        raise ValueError(f"The column of time holds stamps of several zones: {', '.join(sorted(zones))}.")
    if zones != {""}:
        rows = [_ZONE.sub("", row) for row in rows]
    if _CLOCK.fullmatch(rows[0]):
        return np.array([_of_day(row) for row in rows], "timedelta64[ns]")
    if _DATE.match(rows[0]):
        rows = [_iso(row) for row in rows]
    wrong = next((row for row in rows if not _ISO.fullmatch(row)), None)
    if wrong is not None:
        raise ValueError(
            f"The column of time holds {wrong!r}, and no number or stamp such as 2026-01-31T13:02:25.964, 31.01.2026 "
            "13:02:25 or 13:02:25.964."
        )
    return np.array(rows, "datetime64[ns]") - _offset(*zones)


def since_first(times: np.ndarray) -> np.ndarray:
    """Return seconds from the first of timestamps, or of times of day, which go on after midnight."""
    if times.dtype.kind == "M":
        return seconds_of(times)
    return seconds_of(unwrapped(times / np.timedelta64(1, "s"), int(_DAY)))


def date_and_time(date: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return seconds from the first of dates and times of day."""
    if date.dtype.kind != "M" or time.dtype.kind != "m":
        raise ValueError("Two columns of text that make the time are a date and a time of day, in this order.")
    return seconds_of(date + time)


def pair(names: Sequence[str], columns: Sequence[np.ndarray]) -> np.ndarray:
    """Return seconds from the first of two columns, whose names tell what they are.

    Raises
    ------
    ValueError
        They are neither date and time, nor week and seconds, nor seconds and nanoseconds.
    """
    first, second = columns
    if first.dtype.kind in "mM" or second.dtype.kind in "mM":
        return date_and_time(first, second)
    plain = [name.lower() for name in names]
    if "week" in plain[0] or "wk" in plain[0] or plain[0] == "wn":
        return week_and_seconds(first, second)
    if "ns" in plain[1] or "nano" in plain[1]:
        return seconds_and_nanoseconds(first, second)
    raise ValueError(
        f"Two columns of time are date and time, week and seconds, or seconds and nanoseconds, and the names "
        f"{', '.join(names)} say none of it."
    )


def _of_day(text: str) -> int:
    found = _CLOCK.fullmatch(text)
    if found is None:
        raise ValueError(f"The column of time holds {text!r} among times of day.")
    whole, _, part = (found[3] or "0").partition(".")
    seconds = (int(found[1]) * 60 + int(found[2])) * 60 + int(whole)
    return seconds * 1_000_000_000 + int(part[:9].ljust(9, "0") or "0")


def _offset(zone: str) -> np.timedelta64:
    """By which a zone is ahead of UTC."""
    if zone in ("", "Z", "UTC"):
        return np.timedelta64(0, "m")
    minutes = 60 * int(zone[1:3]) + int(zone[-2:])
    return np.timedelta64(-minutes if zone[0] == "-" else minutes, "m")


def _iso(text: str) -> str:
    found = _DATE.match(text)
    if found is None:
        return text
    year, month, day = (found[1], found[2], found[3]) if found[1] else (found[6], found[5], found[4])
    return f"{year}-{month}-{day}{text[found.end() :]}"
