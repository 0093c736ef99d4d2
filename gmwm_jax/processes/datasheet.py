"""Models from datasheet entries: the line that a figure compares a sensor with, and a start for simulations."""

import math
import re
from collections.abc import Mapping
from typing import Any

from gmwm_jax._internal.checks import positive, sampling_rate
from gmwm_jax.processes.band_flicker import FLK
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.continuous import from_continuous
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.gauss_markov import GM
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.units import convert, unit

Datasheet = str | AbstractProcess | Composite | Mapping[str, str | AbstractProcess | Composite]
"""A model, or where the channels have several units one for each of them: ``{"rad/s": ..., "m/s^2": ...}``."""

_ENTRY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^-+.\d\s].*?)?\s*")
# entry -> (process, what its SI unit adds to the signal's, datasheet value -> filter quantity)
_ENTRIES: dict[str, tuple[type[AbstractProcess], dict[str, str], Any]] = {
    "N": (WN, {"rad/s/sqrt(Hz)": "rad/s", "m/s^2/sqrt(Hz)": "m/s^2"}, lambda v: v * v),
    "Q": (QN, {"rad": "rad/s", "m/s": "m/s^2"}, lambda v: v),
    "LSB": (QN, {"rad": "rad/s", "m/s": "m/s^2"}, lambda v: v / math.sqrt(12)),
    "K": (RW, {"rad/s/sqrt(s)": "rad/s", "m/s^2/sqrt(s)": "m/s^2"}, lambda v: v * v),
    "R": (DR, {"rad/s^2": "rad/s", "m/s^3": "m/s^2"}, lambda v: v),
    "B": (BI, {"rad/s": "rad/s", "m/s^2": "m/s^2"}, lambda v: v),
}


def from_datasheet(
    entries: dict[str, str], rate: float, *, gauss_markov: tuple[tuple[str, str], ...] = ()
) -> tuple[Composite, str]:
    """Build the model that a datasheet describes.

    Parameters
    ----------
    entries
        For example ``{"N": "0.15 deg/sqrt(h)", "K": "2 deg/h/sqrt(h)"}``: N (white), K (random walk), Q or LSB
        (quantisation), R (ramp), B (bias instability), each a number with its unit; f0, the corner frequency of B,
        as in ``{"B": "10 deg/h", "f0": "0.5 Hz"}``. Where a datasheet means the lowest Allan deviation by its bias
        instability, B is that over 0.664.
    rate
        Sampling rate in Hz.
    gauss_markov
        Pairs of standard deviation and correlation time, ``(("10 deg/h", "100 s"),)``. The bias instability B has no
        finite state; for a filter a Gauss-Markov process with a standard deviation of B is usually put in its place, or
        `flicker_ladder`.

    Returns
    -------
    model
        Parameters per sample.
    signal
        SI unit of the signal that the entries describe, ``rad/s`` or ``m/s^2``.

    Raises
    ------
    ValueError
        No entry, an unknown one or its unit, a value that is not positive, a unit that is missing or does not fit,
        entries of a gyro and an accelerometer together, f0 without B.

    Examples
    --------
    >>> model, unit = gj.from_datasheet({"N": "0.6 deg/sqrt(h)", "K": "2 deg/h/sqrt(h)"}, rate=100.0)
    >>> model.labels, unit
    (('WN', 'RW'), 'rad/s')
    """
    f = sampling_rate(rate)
    processes: list[AbstractProcess] = []
    signals: dict[str, str] = {}
    corner = entries.get("f0")
    if corner is not None and "B" not in entries:
        raise ValueError(f"f0 = {corner!r} is the corner frequency of a bias instability B, and there is no B.")
    for name, text in entries.items():
        if name == "f0":
            continue
        if name not in _ENTRIES:
            raise ValueError(f"Unknown datasheet entry {name!r}; known are {', '.join(_ENTRIES)}, f0.")
        cls, units, to_filter = _ENTRIES[name]
        value, si = _quantity(text)
        if si not in units:
            raise ValueError(f"{name} = {text!r} measures {si}; {name} is given in units of {' or '.join(units)}.")
        signals[name] = units[si]
        if name == "B" and corner is not None:
            processes.append(FLK(f0=convert(*_split(corner), "1/s") / f, B=value))
            continue
        build: Any = cls
        processes.append(build(*(float(v) for v in from_continuous(cls.kind, (to_filter(value),), f))))
    for sigma_text, time_text in gauss_markov:
        sigma, si = _quantity(sigma_text)
        if si not in ("rad/s", "m/s^2"):
            raise ValueError(f"The standard deviation {sigma_text!r} measures {si}, not rad/s or m/s^2.")
        number, time_unit = _split(time_text)
        signals[f"GM {sigma_text}"] = si
        processes.append(GM(beta=1 / (convert(number, time_unit, "s") * f), variance=sigma**2))
    if not signals:
        raise ValueError(f"There is no datasheet entry; known are {', '.join(_ENTRIES)}.")
    if len(set(signals.values())) > 1:
        raise ValueError(f"The entries describe different sensors: {signals}.")
    return Composite(processes), next(iter(signals.values()))


def _split(text: str) -> tuple[float, str]:
    match = _ENTRY.fullmatch(text)
    if match is None:
        raise ValueError(f"Cannot read {text!r}: expected a number and a unit, as in '0.15 deg/sqrt(h)'.")
    if match[2] is None:
        raise ValueError(f"{text!r} has no unit: expected one as in '0.15 deg/sqrt(h)'.")
    positive(repr(text), float(match[1]))
    return float(match[1]), match[2]


def _quantity(text: str) -> tuple[float, str]:
    number, name = _split(text)
    return number * unit(name).factor, unit(name).si
