"""A sensor as its datasheet has it: what is emulated of it, what a filter that knows no more believes, what is open.

| entry | in the truth | in the filter |
|---|---|---|
| N | white noise | the same |
| B with f0, or the lowest Allan deviation 0.664 B | Gauss-Markov ladder, two a decade | one a decade, or one process |
| K | random walk | the same |
| Q | quantisation noise | left out, and said |
| turn-on bias; bias by temperature times a difference that stays | constant, drawn for every run | a state |
| bias by temperature, where a thermometer says how that goes | constant, drawn for every run | a state |
| scale factor (by temperature too), misalignment, g-sensitivity | constants, likewise | states |
| range, LSB, bandwidth | where asked, see `nav_jax.imu.output` | the rounding as white noise, where asked |
| nonlinearity | none: no datasheet states its form | none |

The ladder has B's spectrum from the longest period that is asked for up to f0, to a tenth of the rate, or to where the
white noise is ten times as strong, whichever is lowest; above, it falls as 1/f^2. The Allan variance of all noise is
then that of the datasheet to 1 % in the truth and 3 % in the filter, up to a quarter of the longest period.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64

from gmwm_jax import GM, Composite, from_datasheet
from gmwm_jax._internal.checks import positive, sampling_rate
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import register
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes import flicker_ladder
from nav_jax.imu.deterministic import GSensitivity, Misalignment, ScaleFactor, TemperatureBias
from nav_jax.imu.entries import ENTRIES, SIGMAS, Quantity, deviation, quantity_of, read_entry
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.output import Output

SENSORS = ("gyro", "accel")
READS = {"rates": ("rad/s", "m/s^2"), "increments": ("rad", "m/s")}
"""What an IMU reads out -> units of its least significant bit."""
EFFECTS = {"range": "range", "LSB": "step", "bandwidth": "bandwidth"}
"""Entry -> argument of `Output`."""
FLOOR = math.sqrt(2 * math.log(2) / math.pi)
"""The lowest Allan deviation of flicker noise, of B: 0.664 (IEEE Std 952-1997, annex C)."""
LONGEST = 3600.0
"""Longest period of flicker noise, s, unless told otherwise."""
_BURIED = 10.0
"""Flicker noise is not modelled above so many times the frequency at which white noise is as strong."""
_HIGHEST = 0.1
"""Cycles per sample up to which a ladder holds."""


@dataclass(frozen=True, repr=False)
class ImuSpecification(Saved):
    """What a datasheet states of an IMU, in its own words and units.

    Parameters
    ----------
    gyro, accel
        Name of an entry -> its text, or three of them (x, y, z). A text is a number with its unit, and behind a comma
        what the number is: ``typ``, ``rms``, ``1 sigma``, ``3 sigma``, ``max``, ``min-max``; of N ``one-sided`` where
        it is the root of a density from zero upwards. Entries: N, B with f0 or in_run_bias (the lowest Allan
        deviation), K, Q, turn_on_bias, scale_factor, nonlinearity, misalignment, g_sensitivity, bias_temperature,
        scale_temperature, range, LSB, bandwidth.
    rate
        At which it reads out, as a text with its unit; empty if it is open.
    reads
        ``rates`` or ``increments``.
    name, source
        Of the device, and of the document with the numbers.
    sigmas
        Kind of a number -> standard deviations in it, where it is not the convention: a typical value is one, ``max``
        and ``min-max`` are three, from zero to either side. It holds for what spreads over units and turn-ons (biases,
        scale factors, misalignments, g-sensitivity); noise is emulated as strong as it is stated.

    Raises
    ------
    ValueError
        An entry that there is not, a unit that does not fit, a number that is not positive, by name.

    Examples
    --------
    >>> sheet = nj.ImuSpecification(
    ...     gyro={"N": "0.15 deg/sqrt(h)", "in_run_bias": "0.3 deg/h", "turn_on_bias": "4 deg/h, 1 sigma"},
    ...     accel={"N": "0.07 m/s/sqrt(h)", "scale_factor": "300 ppm, max"},
    ... )
    >>> truth, believed = sheet.truth(100.0), sheet.filter(100.0, correlation_time=300.0)
    >>> [str(s) for s in believed.bank().states][-2:]
    ['gyro z GM', 'gyro z bias']
    >>> sheet.open[0]
    'rate'
    """

    gyro: Mapping[str, Any]
    accel: Mapping[str, Any]
    rate: str = ""
    reads: str = "rates"
    name: str = ""
    source: str = ""
    sigmas: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.reads not in READS:
            raise ValueError(f"reads is one of {', '.join(READS)}, and is {self.reads!r}.")
        for kind, number in self.sigmas.items():
            if kind not in SIGMAS:
                raise ValueError(f"sigmas: a number is {', '.join(k for k in SIGMAS if k)}, and not {kind!r}.")
            positive(f"sigmas: {kind}", number)
        for sensor in SENSORS:
            object.__setattr__(self, sensor, {n: _texts(sensor, n, t) for n, t in getattr(self, sensor).items()})
            self._check(sensor)
        if self.rate and quantity_of("rate", self.rate).si != "1/s":
            raise ValueError(f"rate = {self.rate!r} is no frequency, as 100 Hz is one.")

    def _check(self, sensor: str) -> None:
        of_sensor = {name: self._quantities(sensor, name) for name in getattr(self, sensor)}
        if {"B", "in_run_bias"} <= set(of_sensor):
            raise ValueError(f"{sensor}: B and in_run_bias state the same, in_run_bias = {FLOOR:.3f} B: leave out one.")
        if "f0" in of_sensor and not {"B", "in_run_bias"} & set(of_sensor):
            raise ValueError(f"{sensor} f0 is the corner frequency of a bias instability, and there is none.")
        wanted = READS[self.reads]
        for bit in of_sensor.get("LSB", ()):
            if bit.si not in wanted:
                raise ValueError(
                    f"{sensor} LSB measures {bit.si}, and this IMU reads {self.reads}: state LSB in {wanted[0]} or "
                    f'{wanted[1]}, or reads="{next(r for r in READS if r != self.reads)}".'
                )

    def _quantities(self, sensor: str, name: str) -> list[Quantity]:
        """Of the three axes; none of what is open."""
        return [read_entry(sensor, name, text) for text in getattr(self, sensor).get(name, ())]

    def value(self, sensor: str, entry: str) -> Float64[np.ndarray, "3"] | None:
        """Return an entry as it is stated, x, y, z in SI; None if it is open.

        Examples
        --------
        >>> nj.devices["STIM300"].value("gyro", "range").round(3).tolist()
        [6.981, 6.981, 6.981]
        """
        found = self._quantities(sensor, entry)
        return np.array([q.value for q in found]) if found else None

    def sd(self, sensor: str, entry: str) -> Float64[np.ndarray, "3"]:
        """Return one standard deviation of an entry that spreads, x, y, z in SI; zero if it is open.

        Examples
        --------
        >>> sheet = nj.ImuSpecification({"turn_on_bias": "3 deg/s, max"}, {})
        >>> np.degrees(sheet.sd("gyro", "turn_on_bias")).round(6).tolist()
        [1.0, 1.0, 1.0]
        """
        return np.array([deviation(q, self.sigmas) for q in self._quantities(sensor, entry)] or [0.0] * 3)

    def bias_instability(self, sensor: str) -> Float64[np.ndarray, "3"]:
        """Return the coefficient B, x, y, z in SI; zero if it is open."""
        floor, B = self.value(sensor, "in_run_bias"), self.value(sensor, "B")
        if floor is not None:
            return floor / FLOOR
        return np.zeros(3) if B is None else B

    def with_entries(
        self, *, gyro: Mapping[str, Any] | None = None, accel: Mapping[str, Any] | None = None, **others: Any
    ) -> "ImuSpecification":
        """Return the same with more or other entries, rate, sigmas ...

        Parameters
        ----------
        gyro, accel
            Entries that are added, or stated anew.
        others
            Other parameters of the class.

        Examples
        --------
        >>> sheet = nj.devices["STIM300"].with_entries(gyro={"K": "1 deg/h/sqrt(h)"}, sigmas={"max": 2.0})
        >>> any(text.startswith("gyro K") for text in sheet.open)
        False
        """
        return replace(self, gyro={**self.gyro, **(gyro or {})}, accel={**self.accel, **(accel or {})}, **others)

    @property
    def open(self) -> tuple[str, ...]:
        """What the datasheet leaves open: no such error is emulated, and no filter believes in it."""
        said = ["rate"] if not self.rate else []
        for sensor in SENSORS:
            stated = set(getattr(self, sensor))
            if "in_run_bias" in stated:
                stated.add("B")
            if "B" not in stated:
                stated.add("f0")  # of what there is not
            if "LSB" in stated:
                stated.add("Q")  # the noise of that
            missing = (n for n, e in ENTRIES.items() if e.units(sensor) and n not in stated and n != "in_run_bias")
            said += [f"{sensor} {name}: {ENTRIES[name].meaning}" for name in missing]
        return tuple(said)

    @property
    def unused(self) -> tuple[str, ...]:
        """What is stated and enters neither truth nor filter, or not unless it is asked for, in a sentence each."""
        said = []
        for name, why in _UNUSED.items():
            of = [sensor for sensor in SENSORS if name in getattr(self, sensor)]
            if of:
                said.append(f"{' and '.join(of)} {name}: {why}")
        return tuple(said)

    def truth(
        self,
        rate: Real | None = None,
        *,
        effects: Iterable[str] = (),
        temperature_sd: Real = 0.0,
        thermometer: bool = False,
        longest: Real = LONGEST,
    ) -> ImuErrors:
        """Return what is emulated of such a sensor.

        Parameters
        ----------
        rate
            In Hz; the datasheet's own unless given. Noise keeps its densities.
        effects
            Of ``range``, ``LSB`` and ``bandwidth`` those that are emulated; each must be stated. Increments are rounded
            as such, see `nav_jax.imu.Output`.
        temperature_sd
            Standard deviation in K of the difference from the temperature of the calibration, at the start of a run:
            with the temperature coefficients it adds to turn-on biases and scale factors.
        thermometer
            The scenario states how the temperature goes from there, or a record does: biases by temperature are a
            `nav_jax.imu.TemperatureBias` too.
        longest
            Longest period in s that flicker noise has. Slower parts are as good as a turn-on bias.

        Raises
        ------
        ValueError
            No N, no rate, an effect that is open or has no effect at this rate; a thermometer, and no bias by
            temperature.

        Examples
        --------
        >>> truth = nj.devices["ADIS16405"].truth(100.0, effects=["range", "LSB"])
        >>> bool(np.isclose(truth.output.step[3], np.radians(0.05)))
        True
        """
        return self._errors(
            rate, effects, temperature_sd, longest, thermometer=thermometer, per_decade=2, correlation_time=None
        )

    def filter(
        self,
        rate: Real | None = None,
        *,
        effects: Iterable[str] = (),
        temperature_sd: Real = 0.0,
        thermometer: bool = False,
        longest: Real = LONGEST,
        correlation_time: Real | None = None,
    ) -> ImuErrors:
        """Return what a filter believes that knows the datasheet; parameters as of `truth`.

        Parameters
        ----------
        rate, effects, temperature_sd, thermometer, longest
            As of `truth`; of the effects, a filter knows the rounding.
        correlation_time
            In s: the bias instability is one Gauss-Markov process with the standard deviation B and this correlation
            time, which no datasheet states. A ladder of them unless given, from `longest` up.

        Examples
        --------
        >>> len(nj.devices["STIM300"].filter(100.0, correlation_time=100.0).bank().states) % 6
        0
        """
        how = {"per_decade": 1, "correlation_time": correlation_time}
        return self._errors(rate, effects, temperature_sd, longest, thermometer=thermometer, **how)

    def _errors(
        self,
        rate: Real | None,
        effects: Iterable[str],
        temperature_sd: Real,
        longest: Real,
        *,
        thermometer: bool,
        per_decade: int,
        correlation_time: Real | None,
    ) -> ImuErrors:
        if rate is None:
            if not self.rate:
                raise ValueError(f"{self.name or 'The datasheet'} leaves the rate open: give rate=... in Hz.")
            rate = quantity_of("rate", self.rate).value
        f = sampling_rate(rate)
        positive("temperature_sd", temperature_sd, zero_ok=True)
        positive("longest", longest)
        if correlation_time is not None:
            positive("correlation_time", correlation_time)
        effects = tuple(effects)
        flicker = _Flicker(float(longest), per_decade, None if correlation_time is None else float(correlation_time))
        gyro, accel = ([self._noise(s, axis, f, effects, flicker) for axis in range(3)] for s in SENSORS)

        def spread(sensor: str, entry: str, by_temperature: str) -> Float64[np.ndarray, "3"]:
            return np.hypot(self.sd(sensor, entry), self.sd(sensor, by_temperature) * float(temperature_sd))

        def both(of: Any, *entries: str) -> dict[str, Float64[np.ndarray, "3"]]:
            return {f"{s}_sd": of(s, *entries) for s in SENSORS}

        bias = both(spread, "turn_on_bias", "bias_temperature")
        unit: list[tuple[Any, dict[str, Any]]] = [
            (ScaleFactor, both(spread, "scale_factor", "scale_temperature")),
            (Misalignment, both(self.sd, "misalignment")),
            (GSensitivity, {"gyro_sd": self.sd("gyro", "g_sensitivity")}),
        ]
        if thermometer:
            if not any("bias_temperature" in getattr(self, s) for s in SENSORS):
                raise ValueError(
                    f"thermometer: {self.name or 'the datasheet'} leaves bias_temperature open: leave the thermometer "
                    'out or state it, as with_entries(gyro={"bias_temperature": "..."}).'
                )
            unit.append((TemperatureBias, both(self.sd, "bias_temperature")))
        return ImuErrors(
            accel,
            gyro,
            f,
            accel_bias_sd=bias["accel_sd"],
            gyro_bias_sd=bias["gyro_sd"],
            deterministic=[kind(**sd) for kind, sd in unit if np.any(list(sd.values()))],
            output=self._output(effects, f),
        )

    def _noise(self, sensor: str, axis: int, rate: float, effects: Sequence[str], flicker: "_Flicker") -> Composite:
        """The noise of an axis."""
        N = self.value(sensor, "N")
        if N is None:
            raise ValueError(
                f"{self.name or 'The datasheet'} leaves the {sensor}'s N open, without which there is no noise: state "
                f'it, as with_entries({sensor}={{"N": "..."}}).'
            )
        texts = {"N": _text(N[axis], sensor, "N")}
        # the noise of rounding is emulated by rounding
        for name in ("K",) if "LSB" in effects else ("K", "Q"):
            value = self.value(sensor, name)
            if value is not None:
                texts[name] = _text(value[axis], sensor, name)
        model, _ = from_datasheet(texts, rate)
        B, corner = self.bias_instability(sensor)[axis], self.value(sensor, "f0")
        if B == 0:
            return model
        highest = math.inf if corner is None else float(corner[axis])
        return Composite([*model.processes, *flicker.processes(float(B), float(N[axis]), highest, rate)])

    def _output(self, effects: Sequence[str], rate: float) -> Output | None:
        given: dict[str, Any] = {}
        for effect in effects:
            if effect not in EFFECTS:
                raise ValueError(f"effects: {effect!r} is none of {', '.join(EFFECTS)}.")
            for sensor in SENSORS:
                value = self.value(sensor, effect)
                if value is None:
                    raise ValueError(
                        f"effects: {self.name or 'the datasheet'} leaves the {sensor}'s {effect} open: leave it out or "
                        f'state it, as with_entries({sensor}={{"{effect}": "..."}}).'
                    )
                given[f"{sensor}_{EFFECTS[effect]}"] = value
        bands = [given[f"{s}_bandwidth"] for s in SENSORS if "bandwidth" in effects]
        if bands and min(b.min() for b in bands) >= rate / 2:
            raise ValueError(
                f"effects: a bandwidth of {min(b.min() for b in bands):g} Hz and more has no effect in samples of "
                f"{rate:g} Hz, of which it is half or above: leave it out, or raise the rate."
            )
        return Output(**given, increments=self.reads == "increments") if given else None

    def __repr__(self) -> str:
        read = f"reads {self.reads}{f' at {self.rate}' if self.rate else ''}"
        head = ", ".join(filter(None, [self.name or "ImuSpecification", read]))
        stated = [name for name in ENTRIES if name in self.gyro or name in self.accel]
        rows = [[n, *(_shown(getattr(self, s).get(n)) for s in SENSORS), ENTRIES[n].meaning] for n in stated]
        lines = [head, *([f"  {self.source}"] if self.source else [])]
        lines.append(format_table(["entry", *SENSORS, "meaning"], rows, left=4))
        lines += [f"not used: {said}" for said in self.unused]
        return "\n".join([*lines, f"left open: {'; '.join(self.open)}"])


_UNUSED = {
    "nonlinearity": "its form is not stated.",
    "bias_temperature": "used with a temperature_sd or a thermometer.",
    "scale_temperature": "used with a temperature_sd.",
}


class _Flicker(NamedTuple):
    """How a bias instability is made of Gauss-Markov processes."""

    longest: float
    """Period, s."""
    per_decade: int
    correlation_time: float | None
    """Of one process, s."""

    def processes(self, B: float, N: float, highest: float, rate: float) -> list[GM]:
        """Per sample; `highest` is a frequency in Hz."""
        if self.correlation_time is not None:
            return [GM(beta=1 / (self.correlation_time * rate), variance=B**2)]
        low = 1 / (self.longest * rate)
        # two-sided densities: B^2/(2 pi f) of flicker noise is as much as N^2 of white noise at B^2/(2 pi N^2)
        buried = _BURIED * B**2 / (2 * math.pi * N**2)
        high = min(max(min(buried, highest) / rate, 10 * low), _HIGHEST)
        if low >= high / 2:
            raise ValueError(f"longest = {self.longest:g} s is too short a period of flicker noise at {rate:g} Hz.")
        num = math.ceil(self.per_decade * math.log10(high / low)) + 1
        return [GM(beta, B**2 * variance) for beta, variance in _ladder(low, high, max(num, 2))]


@cache
def _ladder(low: float, high: float, num: int) -> tuple[tuple[float, float], ...]:
    """Of B = 1: beta and variance of each process."""
    parts = flicker_ladder(1.0, low, high, num).processes
    return tuple((float(p.values[0]), float(p.values[1])) for p in parts)


def _texts(sensor: str, name: str, given: Any) -> tuple[str, ...]:
    """One text for each axis; a bare number has no unit, which its reader says."""
    several = tuple(given) if isinstance(given, Sequence) and not isinstance(given, str) else (given,) * 3
    if len(several) != 3:
        raise ValueError(f"{sensor} {name}: one text or three (x, y, z) are wanted, and these are {len(several)}.")
    return tuple(map(str, several))


def _text(value: float, sensor: str, entry: str) -> str:
    """As `gmwm_jax.from_datasheet` reads it."""
    return f"{float(value)!r} {ENTRIES[entry].units(sensor)[0]}"


def _shown(texts: tuple[str, ...] | None) -> str:
    return "" if texts is None else texts[0] if len(set(texts)) == 1 else " | ".join(texts)


class _State(NamedTuple):
    gyro: Mapping[str, tuple[str, ...]]
    accel: Mapping[str, tuple[str, ...]]
    rate: str
    reads: str
    name: str
    source: str
    sigmas: Mapping[str, float]


def _to_state(s: ImuSpecification) -> _State:
    return _State(s.gyro, s.accel, s.rate, s.reads, s.name, s.source, dict(s.sigmas))


register(ImuSpecification, _State, _to_state, lambda state: ImuSpecification(**state._asdict()))
