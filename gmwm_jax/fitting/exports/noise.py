"""What all formats are written from: the noise of an IMU by sensor and axis, and the comments that they share."""

import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax.fitting.bias import WhiteAndBias

SENSORS = {"rad/s": "gyro", "m/s^2": "accel"}
"""By the unit of their signal."""
_PLURAL = {"gyro": "gyros", "accel": "accelerometers"}


@dataclass(frozen=True)
class ChannelNoise:
    """One axis of a sensor."""

    name: str
    filter: WhiteAndBias
    processes: Sequence[Mapping[str, Any]]
    """Kind and parameters per sample of every component that the data show."""
    bounded: Mapping[str, float]
    """Label of what no filter holds -> bound of the standard deviation of its integral, rad or m/s; NaN if unknown."""
    warnings: Sequence[str] = ()
    """Of the fit: what its data contradict."""


@dataclass(frozen=True)
class ImuNoise:
    """Gyros and accelerometers; either may be missing."""

    gyro: tuple[ChannelNoise, ...]
    accel: tuple[ChannelNoise, ...]
    rate: float
    step: float
    """Of the filter, s."""

    @property
    def channels(self) -> tuple[ChannelNoise, ...]:
        """All that there are."""
        return (*self.gyro, *self.accel)

    @classmethod
    def of(cls, channels: Sequence[ChannelNoise]) -> "ImuNoise":
        """Sort the channels by their unit.

        Raises
        ------
        ValueError
            A unit that is none of a gyro or an accelerometer; several rates.
        """
        by_sensor: dict[str, list[ChannelNoise]] = {"gyro": [], "accel": []}
        for c in channels:
            if c.filter.unit not in SENSORS:
                raise ValueError(
                    f"{c.name} has the unit {c.filter.unit}, and a filter takes gyros in rad/s and accelerometers in "
                    "m/s^2: say what its samples are, units=..., when the recording is read."
                )
            by_sensor[SENSORS[c.filter.unit]].append(c)
        rates = [sampling_rate(c.filter.rate) for c in channels]
        if max(rates) / min(rates) > 1 + 1e-6:
            seen = ", ".join(f"{c.name} {rate:g} Hz" for c, rate in zip(channels, rates, strict=True))
            raise ValueError(f"One file holds one IMU at one rate, and these are {seen}: write two.")
        return cls(tuple(by_sensor["gyro"]), tuple(by_sensor["accel"]), rates[0], channels[0].filter.step)

    def require_both(self, title: str) -> None:
        """Raise unless there are gyros and accelerometers."""
        for sensor, channels in (("gyro", self.gyro), ("accel", self.accel)):
            if not channels:
                names = ", ".join(c.name for c in self.channels)
                raise ValueError(
                    f"{title} wants gyros and accelerometers, and of {_PLURAL[sensor]} there are none: there is "
                    f"{names}. Export the fits of both together, Fit.export_of([gyro, accel], ...)."
                )

    def require_noise(self, title: str, symbol: str, *, every: bool) -> None:
        """Raise where a sensor has no white noise (N) or no bias (K).

        Parameters
        ----------
        title, symbol
            Who refuses zero, and of which number.
        every
            Of each axis, not only of the noisiest.
        """
        what, why = {
            "N": (
                "noise density",
                f"no component is white at a step of {self.step:g} s; at a longer one, step=..., or in a model with WN "
                "there is.",
            ),
            "K": (
                "random walk",
                "its model has white noise only; fit one with a random walk or a Gauss-Markov process.",
            ),
        }[symbol]
        for channels in filter(None, (self.gyro, self.accel)):
            found = (min if every else max)(channels, key=lambda c: getattr(c.filter, symbol))
            if not getattr(found.filter, symbol) > 0:
                raise ValueError(f"{title} refuses a {what} of zero, and {found.name} has none: {why}")


def largest(channels: Sequence[ChannelNoise], value: Callable[[ChannelNoise], float]) -> tuple[float, str]:
    """The largest value of the axes, and where it is from: too little noise is worse for a filter than too much."""
    found = max(channels, key=value)
    return value(found), f"the largest of {len(channels)}, {found.name}" if len(channels) > 1 else found.name


def three_axes(channels: Sequence[ChannelNoise]) -> tuple[ChannelNoise, ChannelNoise, ChannelNoise]:
    """The axes x, y, z; one channel serves all three.

    Raises
    ------
    ValueError
        Other numbers of channels, or names that do not tell the axes.
    """
    if len(channels) == 1:
        return channels[0], channels[0], channels[0]
    by_axis = {found[1].lower(): c for c in channels if (found := re.search(r"(?:^|[^a-zA-Z])([xyzXYZ])$", c.name))}
    if len(channels) != 3 or set(by_axis) != set("xyz"):
        raise ValueError(
            f"This format has three axes: one channel for all of them is wanted, or three whose names end in x, y and "
            f"z. There are {', '.join(c.name for c in channels)}."
        )
    return by_axis["x"], by_axis["y"], by_axis["z"]


def real(x: float) -> str:
    """A number that every reader of YAML takes for one: with a point, and a sign in the exponent."""
    return f"{x:.9e}"


def reals(numbers: Sequence[float]) -> str:
    """Several, as a list of YAML, JSON or Python."""
    return f"[{', '.join(map(real, numbers))}]"


def comments(imu: ImuNoise, title: str, *remarks: str, bias: str | None = None) -> list[str]:
    """What every text says first, a line each, marked by #.

    Parameters
    ----------
    imu, title
        What is written, and as what.
    remarks
        More sentences.
    bias
        What becomes of the bias; by default a random walk.
    """
    walk = (
        "Bias: all other components as one random walk K, which has their Allan deviation at the time T that is given "
        "for each channel. It grows without end where a Gauss-Markov process returns."
    )
    lines = [
        f"{title}: noise of an IMU, estimated by gmwm_jax from static samples.",
        f"Rate of the samples {imu.rate:g} Hz, step of the filter {imu.step:g} s. Two-sided densities.",
        "White noise N: all components with a correlation time of at most a step, PSDs at frequency 0 added.",
        bias or walk,
        *(line for c in imu.channels for line in _of_channel(c)),
        "Not here, since a static recording does not show them: turn-on biases, scale factors, misalignments.",
        *remarks,
    ]
    return [f"# {part}" for line in lines for part in _wrapped(line)]


def _of_channel(c: ChannelNoise) -> list[str]:
    one = c.filter
    rows = {}
    for e, si in zip(one.table(), one.table(datasheet=False), strict=True):
        rows[e.symbol] = f"{e.symbol} = {si.value:.6g} {si.unit} = {e.value:.4g} {e.unit}"
    white = " + ".join(one.white) or "nothing is white at the step"
    bias = f"{' + '.join(one.bias)}, T = {one.interval:.4g} s, {one.chosen}" if one.bias else "nothing else is there"
    bound = " or less" if one.upper_bound else ""
    lines = [f"{c.name}: {rows['N']} ({white})", f"  {rows['K']} ({bias})", f"  {rows['B']}{bound}, bias instability"]
    for label, sd in c.bounded.items():
        angle = "rad" if one.unit == "rad/s" else "m/s"
        how = "" if math.isnan(sd) else f", whose integral is bounded, with a standard deviation of {sd:.3g} {angle}"
        lines.append(f"  left out: {label}{how}")
    return lines + [f"  warning: {text}" for text in c.warnings]


def _wrapped(line: str) -> list[str]:
    """Lines of a comment, with those that go on indented."""
    indent = " " * (len(line) - len(line.lstrip()) + 2)
    return textwrap.wrap(line, 110, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
