"""Outages that are simulated on a record: which fixes are kept from the filter."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import inside
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import AbstractReceiver
from nav_jax.imu.imu import Imu

Intervals = Sequence[Sequence[Real]]
Outages = Intervals | Mapping[str, Intervals]
"""Of all receivers, or sensor -> its own."""


def without(aiding: Sequence[Fixes], outages: Outages) -> tuple[Fixes, ...]:
    """The fixes, of which those in outages are withheld.

    Raises
    ------
    ValueError
        There is no such sensor or no receiver; an interval that is none, overlaps another one, holds no fix, or has no
        fix before it.
    """
    if not len(outages):
        return tuple(aiding)
    names = [f.sensor.name for f in aiding]
    if isinstance(outages, Mapping):
        if unknown := sorted(set(outages) - set(names)):
            raise ValueError(f"There is no sensor {unknown[0]!r} for outages; there are {', '.join(names) or 'none'}.")
        of = dict(outages)
    else:
        of = {f.sensor.name: outages for f in aiding if isinstance(f.sensor, AbstractReceiver)}
        if not of:
            raise ValueError(
                f"No receiver has fixes to be withheld, of {', '.join(names) or 'no sensor'}: name the sensor, as in "
                'outages={"barometer": [(60.0, 75.0)]}.'
            )
    return tuple(replace(f, withheld=_checked(f, of[n])) if n in of else f for f, n in zip(aiding, names, strict=True))


def _checked(fixes: Fixes, outages: Intervals) -> tuple[tuple[float, float], ...]:
    name, found = fixes.sensor.name, []
    for given in outages:
        if np.shape(given) != (2,):
            raise ValueError(f"An outage is a pair (start, end) in s, and this is {given!r}.")
        a, b = (number("An outage's time", t, negative_ok=True) for t in given)
        if a >= b:
            raise ValueError(f"The outage ({a:g}, {b:g}) ends before it starts.")
        span = f"fixes of {name} are of {fixes.time[0]:g} to {fixes.time[-1]:g} s"
        if not inside(fixes.time, [(a, b)]).any():
            raise ValueError(f"No fix lies in the outage {a:g} to {b:g} s, by which its end could be judged: {span}.")
        if not (fixes.time < a).any():
            raise ValueError(f"No fix comes before the outage {a:g} to {b:g} s: {span}.")
        found.append((a, b))
    found.sort()
    for (a, b), (c, d) in itertools.pairwise(found):
        if c <= b:
            raise ValueError(f"The outages {a:g} to {b:g} s and {c:g} to {d:g} s overlap: put them into two schedules.")
    return tuple(found)


def shifted_schedules(
    imu: Imu, aiding: Sequence[Fixes], *, last: Real, every: Real, runs: int
) -> list[list[tuple[float, float]]]:
    """Schedules of outages that cover a record: of each run one every so many seconds, shifted by a part of that.

    The first begins one period after the fixes of receivers and the record do; the last one ends before they do.

    Raises
    ------
    ValueError
        There is no receiver; an outage is as long as the way to the next; the record is too short for any.
    """
    length, period = number("The length of an outage (last)", last), number("The way to the next one (every)", every)
    if length >= period:
        raise ValueError(f"Outages of {length:g} s every {period:g} s leave no fix between them: let them begin later.")
    times = [f.time for f in aiding if isinstance(f.sensor, AbstractReceiver)]
    if not times:
        raise ValueError("No receiver has fixes to be withheld.")
    begin = max(float(imu.time[0]), *(t[0] for t in times))
    end = min(float(imu.epochs[-1]), *(t[-1] for t in times))
    found = []
    for k in range(runs):
        first = begin + period * (1 + k / runs)
        count = int(np.floor((end - length - first) / period + 1e-9)) + 1
        if count > 0:
            found.append([(float(a), float(a + length)) for a in first + period * np.arange(count)])
    if not found:
        raise ValueError(
            f"Between {begin:g} and {end:g} s there is no place for an outage of {length:g} s that begins {period:g} s "
            "after the start: take shorter ones."
        )
    return found
