"""Entries of a datasheet: what each means, in which units it is, and what the number is a size of.

An entry is a text: a number, its unit, and behind a comma what the number is, as in ``"3 deg/s, 1 sigma"``. One more
kind of entry is a row of `ENTRIES`, one more way to state a spread a row of `SIGMAS`.
"""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from gmwm_jax.units import names, unit


class Entry(NamedTuple):
    """A kind of entry."""

    meaning: str
    gyro: tuple[str, ...]
    """SI units that it may be in; none where a sensor does not have it."""
    accel: tuple[str, ...]
    spreads: bool = False
    """Is it how far units of a series, or turn-ons of one, lie apart? Then its number may be several sigma."""

    def units(self, sensor: str) -> tuple[str, ...]:
        """Those of a sensor."""
        return self.gyro if sensor == "gyro" else self.accel


ENTRIES: dict[str, Entry] = {
    "N": Entry("angle or velocity random walk", ("rad/s/sqrt(Hz)",), ("m/s^2/sqrt(Hz)",)),
    "B": Entry("bias instability, coefficient", ("rad/s",), ("m/s^2",)),
    "in_run_bias": Entry("bias instability, lowest Allan deviation", ("rad/s",), ("m/s^2",)),
    "f0": Entry("corner frequency of the bias instability", ("1/s",), ("1/s",)),
    "K": Entry("rate or acceleration random walk", ("rad/s/sqrt(s)",), ("m/s^2/sqrt(s)",)),
    "Q": Entry("quantisation noise", ("rad",), ("m/s",)),
    "turn_on_bias": Entry("bias from run to run", ("rad/s",), ("m/s^2",), spreads=True),
    "scale_factor": Entry("error of the scale factor", ("1",), ("1",), spreads=True),
    "nonlinearity": Entry("of the scale factor, over the range", ("1",), ("1",)),
    "misalignment": Entry("of the axes, or cross-axis sensitivity", ("rad", "1"), ("rad", "1"), spreads=True),
    "g_sensitivity": Entry("bias by acceleration", ("rad/s/(m/s^2)",), (), spreads=True),
    "bias_temperature": Entry("bias by temperature", ("rad/s/K",), ("m/s^2/K",), spreads=True),
    "scale_temperature": Entry("error of the scale factor by temperature", ("1/K",), ("1/K",), spreads=True),
    "range": Entry("largest reading", ("rad/s",), ("m/s^2",)),
    "LSB": Entry("least significant bit", ("rad/s", "rad"), ("m/s^2", "m/s")),
    "bandwidth": Entry("frequency of half the power", ("1/s",), ("1/s",)),
}

SIGMAS: dict[str, float] = {"": 1.0, "1 sigma": 1.0, "typ": 1.0, "rms": 1.0, "2 sigma": 2.0, "3 sigma": 3.0,
                            "max": 3.0, "min-max": 3.0}  # fmt: skip
"""What a number is -> standard deviations in it, by convention: of most makers, a typical value is met by two thirds of
the units, and a limit by all but 3 in 1000. A limit is the half of what lies between least and most."""

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TEXT = re.compile(
    rf"\s*(?:±|\+/-)?\s*({_NUMBER})(?:\s*/\s*({_NUMBER})(?:\^(\d+))?)?\s*([^,\d\s][^,]*?)?\s*(?:,\s*(.*?)\s*)?"
)


ONE_SIDED = "one-sided"
"""Kind of a density of white noise whose integral from zero upwards is the variance, as spectrum analysers have it, and
who computes RMS noise in a bandwidth; N is the root of the two-sided one, smaller by sqrt(2)."""


class Quantity(NamedTuple):
    """An entry that has been read."""

    value: float
    """In SI."""
    si: str
    kind: str
    """A key of `SIGMAS`, or `ONE_SIDED`."""


def quantity_of(what: str, text: str) -> Quantity:
    """Read ``number unit, kind``; the number may be a ratio, as in ``1/16.4 deg/s``, and follow ±.

    Parameters
    ----------
    what
        For errors: whose entry it is.
    text
        The entry.

    Raises
    ------
    ValueError
        No text, no number, no unit or an unknown one, a number that is not positive, an unknown kind.
    """
    found = _TEXT.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        raise ValueError(
            f"{what} = {text!r} cannot be read: a positive number with its unit is wanted, and behind a comma what it "
            'is, as in "3 deg/s, 1 sigma".'
        )
    number = float(found[1]) / float(found[2] or 1) ** int(found[3] or 1)
    if number <= 0:
        raise ValueError(f"{what} = {text!r} is not positive: leave out what a datasheet does not state.")
    if found[4] is None:
        raise ValueError(f'{what} = {text!r} has no unit: one is wanted as in "3 deg/s".')
    kind = found[5] or ""
    if kind not in (*SIGMAS, ONE_SIDED):
        kinds = ", ".join(k for k in (*SIGMAS, ONE_SIDED) if k)
        raise ValueError(f"{what} = {text!r}: a number is {kinds}, and not {kind!r}.")
    try:
        of = unit(found[4])
    except ValueError as error:
        raise ValueError(f"{what} = {text!r}: {error}") from error
    return Quantity(number * of.factor, of.si, kind)


def read_entry(sensor: str, name: str, text: str) -> Quantity:
    """Read an entry of a sensor.

    Raises
    ------
    ValueError
        As `quantity_of`; an entry that there is not, or a unit that it cannot have.
    """
    wanted = () if name not in ENTRIES else ENTRIES[name].units(sensor)
    if not wanted:
        known = ", ".join(key for key, entry in ENTRIES.items() if entry.units(sensor))
        raise ValueError(f"{sensor} has no entry {name!r}; it has {known}.")
    quantity = quantity_of(f"{sensor} {name}", text)
    if quantity.si not in wanted:
        raise ValueError(
            f"{sensor} {name} = {text!r} measures {quantity.si}, and {ENTRIES[name].meaning} is in "
            f"{', '.join(n for si in wanted for n in names(si)[:8])} ..."
        )
    if quantity.kind != ONE_SIDED:
        return quantity
    if name != "N":
        raise ValueError(f"{sensor} {name} = {text!r}: only a density of white noise, N, is one-sided.")
    return quantity._replace(value=quantity.value / math.sqrt(2))


def deviation(quantity: Quantity, sigmas: Mapping[str, float]) -> float:
    """One standard deviation of a quantity that spreads."""
    return quantity.value / {**SIGMAS, **sigmas}[quantity.kind]
