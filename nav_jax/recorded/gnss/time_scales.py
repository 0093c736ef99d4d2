"""Time of GNSS: calendar and weeks, GPS time and UTC with its leap seconds, on the clock of a record.

GPS time began with UTC at 1980-01-06 and has no leap seconds, a week has 604,800 s (IS-GPS-200, 3.3.4). Those of UTC
are in the IERS Bulletins C; since 2017-01-01 GPS time is 18 s ahead.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

DAY = 86400
WEEK = 7 * DAY

_ZERO = np.datetime64("1980-01-06", "D")
_UNIX = int((np.datetime64("1970-01-01", "D") - _ZERO).astype(int))
"""Days from the beginning of GPS time."""

_LEAPS = np.array(
    [
        "1981-07-01", "1982-07-01", "1983-07-01", "1985-07-01", "1988-01-01", "1990-01-01", "1991-01-01", "1992-07-01",
        "1993-07-01", "1994-07-01", "1996-01-01", "1997-07-01", "1999-01-01", "2006-01-01", "2009-01-01", "2012-07-01",
        "2015-07-01", "2017-01-01",
    ],
    dtype="datetime64[D]",
)  # fmt: skip
"""Days of UTC from which on GPS time is one second more ahead."""

_AHEAD = {"GPST": 0, "UTC": 0, "JST": 9 * 3600}
"""Scale -> seconds by which it is ahead of GPS time or of UTC, leap seconds apart."""

CLOCKS = {
    "week": "seconds of the GPS week of the first fix",
    "gps": "seconds since 1980-01-06, GPS time",
    "unix": "seconds since 1970-01-01, UTC without its leap seconds, as computers count",
    "day": "seconds of the UTC day of the first fix",
    "first": "seconds since the first fix",
}
"""Clocks on which fixes may be read, and what they count."""


class Epochs(NamedTuple):
    """Instants in GPS time: whole days and seconds apart, so that no digit is lost."""

    days: Int64[np.ndarray, " F"]
    """Since 1980-01-06."""
    seconds: Float64[np.ndarray, " F"]
    """Of that day, also beyond its end."""


def from_calendar(days: Any, seconds: Any, scale: str) -> Epochs:
    """Instants of a calendar: days as datetime64, and seconds of the day, in GPST, UTC or JST (UTC + 9 h).

    Raises
    ------
    ValueError
        Another scale, or a day before GPS time.
    """
    if scale not in _AHEAD:
        raise ValueError(f"The time scale is one of {', '.join(_AHEAD)}, and is {scale!r}.")
    dates = np.asarray(days, dtype="datetime64[D]")
    if len(dates) and dates.min() < _ZERO:
        raise ValueError(f"The day {dates.min()} is before 1980-01-06, with which GPS time begins.")
    whole, of_day = (dates - _ZERO).astype(np.int64), np.asarray(seconds, dtype=float) - _AHEAD[scale]
    if scale != "GPST":
        of_day = of_day + _leap_seconds(whole + np.floor_divide(of_day, DAY).astype(np.int64))
    return Epochs(whole, of_day)


def from_weeks(weeks: Any, seconds: Any, scale: str = "GPST") -> Epochs:
    """Instants of GPS weeks, counted on since 1980, and seconds of the week; in UTC or JST as calendars are."""
    number = np.asarray(weeks, dtype=float)
    if (number != np.rint(number)).any() or (number < 0).any():
        bad = number[(number != np.rint(number)) | (number < 0)][0]
        raise ValueError(f"A GPS week is a whole number, and one is {bad:g}.")
    return from_calendar(_ZERO + 7 * number.astype(np.int64), seconds, scale)


def on_clock(epochs: Epochs, clock: str) -> Float64[np.ndarray, " F"]:
    """Seconds on one of `CLOCKS`; those that begin with the first fix go on beyond the end of their week or day.

    Raises
    ------
    ValueError
        Another clock.
    """
    days, seconds = epochs
    if clock not in CLOCKS:
        listed = "; ".join(f"{name} ({what})" for name, what in CLOCKS.items())
        raise ValueError(f"There is no clock {clock!r}. There are: {listed}.")
    if not len(days) or clock == "gps":
        return days * DAY + seconds
    if clock == "first":
        return (days - days[0]) * DAY + (seconds - seconds[0])
    if clock == "week":
        first = days[0] + int(np.floor_divide(seconds[0], DAY))
        return (days - (first - first % 7)) * DAY + seconds
    utc = seconds - _leap_seconds_of_gps(epochs)
    start = days[0] + int(np.floor_divide(utc[0], DAY)) if clock == "day" else _UNIX
    return (days - start) * DAY + utc


def utc_at_zero(epochs: Epochs, time: Float64[np.ndarray, " F"]) -> np.datetime64:
    """UTC when a clock that reads these times shows zero, to the microsecond; leap seconds as of the first instant."""
    seconds = epochs.seconds[0] - _leap_seconds_of_gps(epochs)[0] - time[0]
    return (_ZERO + epochs.days[0]).astype("datetime64[us]") + np.timedelta64(round(1e6 * float(seconds)), "us")


def _leap_seconds(days: Int64[np.ndarray, " F"]) -> Int64[np.ndarray, " F"]:
    """By which GPS time is ahead, of days of UTC."""
    return np.searchsorted(_LEAPS, _ZERO + days, side="right")


def _leap_seconds_of_gps(epochs: Epochs) -> Int64[np.ndarray, " F"]:
    starts = (_LEAPS - _ZERO).astype(np.int64) * DAY + np.arange(1, len(_LEAPS) + 1)
    return np.searchsorted(starts, epochs.days * DAY + epochs.seconds, side="right")
