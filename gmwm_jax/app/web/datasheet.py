"""Datasheet entries as they are typed, the line that a figure shows of them, and the verdict on a fit."""

import re
from typing import Literal, NamedTuple

import numpy as np

from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax.fitting.bias import WhiteAndBias
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.datasheet import from_datasheet
from gmwm_jax.units import convert, unit

_NUMBER = re.compile(r"\s*((?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")

Answer = Literal["within the interval", "better than stated", "worse than stated", "no interval"]


class Verdict(NamedTuple):
    """One entry against what a record shows."""

    entry: str
    stated: float
    measured: float
    """In the unit of the entry, as are both ends of the interval; NaN where there is none."""
    ci_low: float
    ci_high: float
    unit: str
    ratio: float
    """Measured over stated."""
    answer: Answer


def entries(text: str) -> tuple[dict[str, str], tuple[tuple[str, str], ...]]:
    """Read entries as they are typed: ``N=0.15 deg/sqrt(h), B=10 deg/h, f0=0.5 Hz, GM=20 deg/h @ 100 s``.

    Parameters
    ----------
    text
        Entries N, B, f0, K, Q, LSB, R, and any number of GM (standard deviation @ correlation time), with commas or
        semicolons between them.

    Returns
    -------
    The entries, and the pairs of the Gauss-Markov processes, as `gmwm_jax.from_datasheet` takes them.

    Raises
    ------
    ValueError
        An entry without ``=``, one that is given twice, a GM without ``@``.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet
    >>> datasheet.entries("N=0.15 deg/sqrt(h), GM=20 deg/h @ 100 s")
    ({'N': '0.15 deg/sqrt(h)'}, (('20 deg/h', '100 s'),))
    """
    found: dict[str, str] = {}
    markov: list[tuple[str, str]] = []
    for part in filter(None, (p.strip() for p in text.replace(";", ",").split(","))):
        name, equals, value = (p.strip() for p in part.partition("="))
        if not equals or not value:
            raise ValueError(f"A datasheet entry is a name and a value, as in N=0.15 deg/sqrt(h), and not {part!r}.")
        if name == "GM":
            sigma, at, time = (p.strip() for p in value.partition("@"))
            if not at:
                raise ValueError(f"A GM is a deviation @ its correlation time, as in GM=20 deg/h @ 100 s: {part!r}.")
            markov.append((sigma, time))
        elif name in found:
            raise ValueError(f"The datasheet entry {name} is given twice.")
        else:
            found[name] = value
    return found, tuple(markov)


def model(text: str, rate: float) -> tuple[Composite, str]:
    """Return the model that typed entries describe, and the SI unit of its signal; see `gmwm_jax.from_datasheet`.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet
    >>> datasheet.model("N=0.6 deg/sqrt(h), K=2 deg/h/sqrt(h)", 100.0)[1]
    'rad/s'
    """
    found, markov = entries(text)
    return from_datasheet(found, sampling_rate(rate), gauss_markov=markov)


def overlay(text: str, rate: float) -> dict[str, Composite]:
    """Return the promise by the unit of its signal, as figures take it; several sensors are told apart by their units.

    Parameters
    ----------
    text
        Entries, see `entries`; those of another sensor follow a ``|``.
    rate
        Sampling rate in Hz.

    Raises
    ------
    ValueError
        See `entries` and `gmwm_jax.from_datasheet`; two parts for one unit.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet
    >>> list(datasheet.overlay("N=0.6 deg/sqrt(h) | N=50 ug/sqrt(Hz)", 100.0))
    ['rad/s', 'm/s^2']
    """
    found: dict[str, Composite] = {}
    for part in filter(None, (p.strip() for p in text.split("|"))):
        promised, signal = model(part, rate)
        if signal in found:
            raise ValueError(f"Two parts of the datasheet are about {signal}: write their entries together.")
        found[signal] = promised
    return found


def of_unit(text: str, rate: float, unit: str) -> str:
    """Return the entries that are about a unit, see `overlay`; "" where there are none.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet
    >>> datasheet.of_unit("N=0.6 deg/sqrt(h) | N=50 ug/sqrt(Hz)", 100.0, "m/s^2")
    'N=50 ug/sqrt(Hz)'
    """
    parts = [part.strip() for part in text.split("|") if part.strip()]
    return next((part for part in parts if model(part, rate)[1] == unit), "")


def verdicts(fit: Fit, text: str, rate: float | None = None) -> tuple[Verdict, ...]:
    """Compare the white noise, bias instability and random walk of a datasheet with those of a fit.

    N, B and K are those of `gmwm_jax.Fit.white_and_bias`: of all that is white at a sample, of the lowest Allan
    deviation over 0.664, and of the random walk that stands for the bias. Others are not compared.

    Parameters
    ----------
    fit
        Of one channel.
    text
        Entries of one sensor, see `entries`.
    rate
        Sampling rate in Hz, if the data do not know theirs.

    Raises
    ------
    ValueError
        See `entries`; entries of a sensor of another kind.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 4000, channels=["gyro_x"]))
    >>> [v.entry for v in datasheet.verdicts(gj.fit(wv, "WN + RW"), "N=0.05 deg/s/sqrt(Hz), B=20 deg/h")]
    ['N', 'B']
    """
    found, _ = entries(text)
    known = _measured(fit.white_and_bias(rate))
    given = []
    for entry, value in found.items():
        if entry not in known:
            continue
        stated, name = _number(value)
        own = known[entry]
        if unit(name).si != own.unit:
            raise ValueError(f"{entry} = {value} measures {unit(name).si}, and that of this channel is in {own.unit}.")
        measured, low, high = (convert(v, own.unit, name) for v in (own.value, own.ci_low, own.ci_high))
        given.append(Verdict(entry, stated, measured, low, high, name, measured / stated, _answer(stated, low, high)))
    return tuple(given)


def _measured(filter: WhiteAndBias) -> dict[str, Estimate]:
    return {e.symbol: e for e in filter.table(datasheet=False) if e.symbol in ("N", "B", "K")}


def _answer(stated: float, low: float, high: float) -> Answer:
    if not (np.isfinite(low) and np.isfinite(high)):
        return "no interval"
    if low <= stated <= high:
        return "within the interval"
    return "better than stated" if high < stated else "worse than stated"


def _number(text: str) -> tuple[float, str]:
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise ValueError(f"Cannot read {text!r}: expected a number and a unit, as in 0.15 deg/sqrt(h).")
    return float(match[1]), match[2]
