"""The sections of a configuration file: their keys, what each measures, and what they become.

A number is SI; a text is a number with its unit, as ``"2 deg/h"``. Keys that nobody knows and units of another quantity
are errors.
"""

import inspect
import re
from collections.abc import Sequence
from functools import partial, reduce
from operator import or_
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, create_model, model_validator

from gmwm_jax.units import STANDARD_GRAVITY, convert, names
from nav_jax.aiding.base import AbstractAiding, Setting
from nav_jax.aiding.registry import AIDING as SENSORS
from nav_jax.filter.scenario import EVERY, OUTPUT_INTERVAL
from nav_jax.imu.datasheets import devices
from nav_jax.imu.deterministic import DETERMINISTIC, AbstractDeterministic
from nav_jax.imu.errors import ImuErrors, fitted_errors, recorded_errors, sensor_errors
from nav_jax.imu.gravity import GravityDisturbance
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.imu.specification import ImuSpecification
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.wgs84 import Wgs84
from nav_jax.simulation.levels import TWO_LEVEL
from nav_jax.simulation.stopping import Precision, Rule
from nav_jax.trajectory.files import read_trajectory
from nav_jax.trajectory.motions import GENERATORS
from nav_jax.trajectory.trajectory import Trajectory

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


# -- values -----------------------------------------------------------------------------------------------------------


def quantity(value: Any, si: str) -> float:
    """Read a number in SI, or a text with a number and its unit.

    Parameters
    ----------
    value
        ``0.025`` or ``"2.5 cm"``.
    si
        The SI unit of the quantity.

    Raises
    ------
    ValueError
        Neither, or a unit that is unknown or measures something else.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    found = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if found is None or not found[2]:
        raise ValueError(f'expected a number in {si}, or a text with its unit such as "1 {si}", and this is {value!r}')
    number, unit = float(found[1]), found[2]
    try:
        return convert(number, unit, si)
    except ValueError as error:
        why = f"lengths are in {', '.join(names('m'))}" if si == "m" else str(error)
        raise ValueError(f"{value!r} has a unit that is no {si}; {why}") from error


def _one_or_three(value: Any, si: str) -> float | list[float]:
    """A quantity, or a list of one for each axis."""
    return [quantity(v, si) for v in value] if isinstance(value, list) else quantity(value, si)


def _noise(value: Any, si: str) -> float | str:
    """A standard deviation, or the text of a model."""
    is_model = isinstance(value, str) and _QUANTITY.fullmatch(value) is None
    return value if is_model else quantity(value, si)


def _in(si: str) -> BeforeValidator:
    return BeforeValidator(partial(quantity, si=si))


def _axes_in(si: str) -> BeforeValidator:
    return BeforeValidator(partial(_one_or_three, si=si))


def _noise_in(si: str) -> BeforeValidator:
    return BeforeValidator(partial(_noise, si=si))


Time = Annotated[float, _in("s")]
Frequency = Annotated[float, _in("1/s")]
Length = Annotated[float, _in("m")]
Speed = Annotated[float, _in("m/s")]
Angle = Annotated[float, _in("rad")]
Acceleration = Annotated[float, _in("m/s^2")]
TurnRate = Annotated[float, _in("rad/s")]
PerAxis = float | list[float]
Model = str | dict[Literal["x", "y", "z"], str]
Texts = dict[str, str]


class Section(BaseModel):
    """A table of the file; names its keys when it meets another."""

    model_config = ConfigDict(extra="forbid", strict=True)

    def given(self, *left_out: str) -> dict[str, Any]:
        """What the file states, in the order of the keys, and nothing of what it leaves to the library's defaults."""
        stated = self.model_fields_set.difference(left_out)
        return {k: getattr(self, k) for k in type(self).model_fields if k in stated}


# -- [trajectory] -----------------------------------------------------------------------------------------------------


class TrajectoryFile(Section):
    """``file = ...``: arguments of `read_trajectory`, and smoothing of a noisy record."""

    file: str
    position: Literal["ned", "geodetic"] | None = None
    angles: str | Texts | None = None
    columns: list[int | str] | dict[str, int | str] | None = None
    time_unit: str | None = None
    origin: Annotated[tuple[Angle, Angle, Length], Field(strict=False)] | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | str | None = None
    smooth: Time | None = None
    smooth_attitude: Time | None = None

    def build(self, folder: Path, rate: float, gravity: float) -> Trajectory:  # noqa: D102
        read = read_trajectory(folder / self.file, **self.given("file", "smooth", "smooth_attitude"))
        if self.smooth is None:
            return read
        return read.smoothed(self.smooth, attitude_knots=self.smooth_attitude)


class _Motion(Section):
    """``motion = ...``: a generator of `nav_jax.trajectory.motions` with its parameters."""

    motion: str

    def build(self, folder: Path, rate: float, gravity: float) -> Trajectory:
        generate = GENERATORS[self.motion]
        takes_gravity = "gravity" in inspect.signature(generate).parameters
        return generate(rate=rate, **self.given("motion"), **({"gravity": gravity} if takes_gravity else {}))


def _type_in_a_file(annotation: Any) -> Any:
    """What a key of the file may be: numbers with units where the parameter is annotated with one, lists of them."""
    if get_origin(annotation) is Annotated:
        return Annotated[float, _in(annotation.__metadata__[0])]
    if get_origin(annotation) is Sequence:
        return list[_type_in_a_file(get_args(annotation)[0])]
    if get_origin(annotation) in (Union, UnionType):
        return reduce(or_, (_type_in_a_file(a) for a in get_args(annotation) if a is not np.ndarray))
    return annotation


def _motion_section(generate: Any) -> type[_Motion]:
    """The section of a generator, from its signature; the rate is that of the sensor, gravity that of the run."""
    types = get_type_hints(generate, include_extras=True)
    fields: dict[str, Any] = {
        p.name: (_type_in_a_file(types[p.name]), ... if p.default is p.empty else p.default)
        for p in inspect.signature(generate).parameters.values()
        if p.name not in ("rate", "gravity")
    }
    return create_model(generate.__name__, __base__=_Motion, **fields)


MOTIONS = {name: _motion_section(generate) for name, generate in GENERATORS.items()}


# -- [truth], [filters.NAME] ------------------------------------------------------------------------------------------


class GravitySection(Section):
    """``gravity = {...}``: arguments of `nav_jax.imu.GravityDisturbance`."""

    deflection: Annotated[PerAxis, _axes_in("rad")] = 0.0
    anomaly: Acceleration = 0.0
    distance: Annotated[PerAxis, _axes_in("m")]

    def build(self) -> GravityDisturbance:
        """The disturbance along the track."""
        return GravityDisturbance(**self.given())


def _calibration_section(kind: type[AbstractDeterministic]) -> type[Section]:
    """The standard deviations of errors that a calibration leaves, from what their class says of them."""
    fields: dict[str, Any] = {key: (Annotated[PerAxis, _axes_in(si)], 0.0) for key, si in kind.units.items()}
    return create_model(kind.__name__, __base__=Section, **fields)


CALIBRATION: dict[str, type[Section]] = {name: _calibration_section(kind) for name, kind in DETERMINISTIC.items()}
"""Kind of an error that is no noise -> its section."""

_OPTIONAL: dict[str, Any] = {name: (section | None, None) for name, section in CALIBRATION.items()}


class CalibrationSection(create_model("Calibration", __base__=Section, **_OPTIONAL)):
    """``calibration = {...}``: a table for each kind of `nav_jax.imu.DETERMINISTIC` that there is."""

    def build(self) -> list[AbstractDeterministic]:
        """The errors that are no noise."""
        return [DETERMINISTIC[name](**section.given()) for name, section in self.given().items()]


class _Errors(Section):
    start: Literal["stationary", "zero"] = "stationary"
    accel_bias_sd: Annotated[PerAxis, _axes_in("m/s^2")] = 0.0
    gyro_bias_sd: Annotated[PerAxis, _axes_in("rad/s")] = 0.0
    calibration: CalibrationSection | None = None
    gravity: GravitySection | None = None

    def given(self, *left_out: str) -> dict[str, Any]:
        stated = super().given("calibration", "gravity", *left_out)
        if self.calibration is not None:
            stated["deterministic"] = self.calibration.build()
        return stated if self.gravity is None else stated | {"gravity": self.gravity.build()}


class ModelErrors(_Errors):
    """``accel = ...``, ``gyro = ...``: models as text, parameters per sample at a stated rate."""

    accel: Model
    gyro: Model
    rate: Frequency

    def build(self, folder: Path) -> ImuErrors:  # noqa: D102
        return ImuErrors(**self.given())


class SensorErrors(_Errors):
    """``sensor = ...``: an IMU that the package knows, at its own rate or another."""

    sensor: str
    rate: Frequency | None = None

    def build(self, folder: Path) -> ImuErrors:  # noqa: D102
        errors = sensor_errors(self.sensor, **self.given("sensor", "rate"))
        return errors if self.rate is None else errors.at_rate(self.rate)


class FittedErrors(_Errors):
    """``fit = ...``: a file of ``gmwm-jax fit --json``, at its own rate or another."""

    fit: str
    rate: Frequency | None = None

    def build(self, folder: Path) -> ImuErrors:  # noqa: D102
        errors = fitted_errors(folder / self.fit, **self.given("fit", "rate"))
        return errors if self.rate is None else errors.at_rate(self.rate)


class RecordingErrors(Section):
    """``recording = ...``: slices of a static recording; arguments of `gmwm_jax.read_recording`."""

    recording: str
    rate: Frequency | None = None
    units: str | Texts | None = None
    scale: str | Texts | None = None
    columns: list[int | str] | None = None
    names: list[str] | Texts | None = None
    time: str | int | list[str | int] | None = None
    time_unit: str | None = None
    gaps: str | None = None
    format: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | str | None = None

    def build(self, folder: Path) -> RecordedErrors:  # noqa: D102
        return recorded_errors(folder / self.recording, **self.given("recording"))


class DeviceErrors(Section):
    """``device = ...``: an IMU by its datasheet; other keys are arguments of `nav_jax.ImuSpecification.truth`.

    What the datasheet leaves open may be said by ``calibration`` and ``gravity``, as of models.
    """

    device: str
    rate: Frequency | None = None
    effects: list[Literal["range", "LSB", "bandwidth"]] = []
    temperature_sd: float = 0.0
    thermometer: bool = False
    longest: Time | None = None
    calibration: CalibrationSection | None = None
    gravity: GravitySection | None = None

    def build(self, folder: Path) -> ImuErrors:  # noqa: D102
        return self._adding(self._sheet().truth(**self._options()))

    def _options(self) -> dict[str, Any]:
        return self.given("device", "calibration", "gravity")

    def _adding(self, errors: ImuErrors) -> ImuErrors:
        """With what the datasheet leaves open."""
        more = [] if self.calibration is None else self.calibration.build()
        return errors.adding(*more, gravity=None if self.gravity is None else self.gravity.build())

    def _sheet(self) -> ImuSpecification:
        if self.device not in devices:
            raise ValueError(f"device is one of {', '.join(devices)}, and is {self.device!r}.")
        return devices[self.device]


class BelievedDevice(DeviceErrors):
    """The same of a filter, with arguments of `nav_jax.ImuSpecification.filter`."""

    correlation_time: Time | None = None

    def build(self, folder: Path) -> ImuErrors:  # noqa: D102
        return self._adding(self._sheet().filter(**self._options()))


SOURCES: dict[str, type[Any]] = {
    "accel": ModelErrors, "sensor": SensorErrors, "fit": FittedErrors, "recording": RecordingErrors,
    "device": DeviceErrors,
}  # fmt: skip
"""The key that tells what kind of section it is."""

BELIEVED: dict[str, type[Any]] = SOURCES | {"device": BelievedDevice}
"""The same of a filter."""


# -- [[aiding]] -------------------------------------------------------------------------------------------------------


class Aiding(Section):
    """What all aiding sensors have."""

    sensor: ClassVar[type[AbstractAiding]]

    type: str
    rate: Frequency = 1.0
    outages: list[Annotated[tuple[Time, Time], Field(strict=False)]] = []
    first: Time | None = None
    name: str = ""

    def build(self) -> AbstractAiding:  # noqa: D102
        return self.sensor(**self.given("type"))  # type: ignore[call-arg]


def _setting(value: Any, setting: Setting) -> Any:
    """What a sensor takes: one number or model, or a list of as many as it has components."""
    one = _noise if setting.or_model else quantity
    count = len(value) if isinstance(value, list) else 1
    if count not in setting.counts:
        raise ValueError(f"expected {' or '.join(map(str, setting.counts))} in {setting.unit}, and there are {count}")
    return [one(v, setting.unit) for v in value] if isinstance(value, list) else one(value, setting.unit)


def _aiding_section(sensor: type[AbstractAiding]) -> type[Aiding]:
    """The section of a sensor, from what it says of its arguments."""
    fields: dict[str, Any] = {
        name: (Annotated[Any, BeforeValidator(partial(_setting, setting=s))], ... if s.required else None)
        for name, s in sensor.settings.items()
    }
    section = create_model(sensor.__name__, __base__=Aiding, **fields)
    section.sensor = sensor
    return section


AIDING: dict[str, type[Aiding]] = {name: _aiding_section(sensor) for name, sensor in SENSORS.items()}
"""Type of an aiding sensor -> its section."""


# -- [initial], [run], [output] ---------------------------------------------------------------------------------------


class InitialSection(Section):
    """Standard deviations of the start; one number, or three (north, east, down)."""

    position_sd: Annotated[PerAxis, _axes_in("m")] = 0.0
    velocity_sd: Annotated[PerAxis, _axes_in("m/s")] = 0.0
    attitude_sd: Annotated[PerAxis, _axes_in("rad")] = 0.0


class RecordInitialSection(InitialSection):
    """The same, or ``align = true``: the start of a record and how well it is known are those that [align] finds."""

    align: bool = False

    @model_validator(mode="after")
    def _one_source(self) -> "RecordInitialSection":
        if self.align and (stated := sorted(self.model_fields_set - {"align"})):
            raise ValueError(f"align = true says how well the start is known: leave out {', '.join(stated)}.")
        return self


class AlignSection(Section):
    """``motion = "moving"`` or ``"at rest"``: arguments of `align_on_the_move`, or of `align_at_rest`.

    ``window`` is the length of either, in s from the beginning; at rest the whole record unless it is given.
    """

    motion: Literal["moving", "at rest"]
    window: Time | None = None
    velocity_sd: Annotated[PerAxis, _axes_in("m/s")] | None = None
    position_sd: Annotated[PerAxis, _axes_in("m")] | None = None
    accel_bias_sd: Acceleration | None = None
    gyro_bias_sd: TurnRate | None = None
    accel_noise: Annotated[float, _in("m/s^2/sqrt(Hz)")] | None = None
    gyro_noise: Annotated[float, _in("rad/s/sqrt(Hz)")] | None = None
    averaged: Time | None = None
    lever_arm: Annotated[list[float], _axes_in("m")] | None = None
    yaw: Angle | None = None
    yaw_sd: Angle | None = None

    def arguments(self) -> dict[str, Any]:
        """Those that are given, all of them of the alignment that is asked for."""
        still = ("window", "position_sd", "accel_bias_sd", "gyro_bias_sd", "yaw", "yaw_sd")
        known = (
            still
            if self.motion == "at rest"
            else [k for k in type(self).model_fields if k not in ("motion", "yaw", "yaw_sd")]
        )
        given = self.given("motion")
        if wrong := sorted(set(given) - set(known)):
            raise ValueError(f'{wrong[0]} is no argument of motion = "{self.motion}"; there are {", ".join(known)}.')
        return given


class OfEarth(Section):
    """The Earth of a run: a flat one with its gravity, or WGS-84 about the origin of positions."""

    earth: Literal["flat", "wgs84"] = "flat"
    gravity: Acceleration = STANDARD_GRAVITY

    def build_earth(self, origin: np.ndarray | None, where: str) -> AbstractEarth:
        """About an origin, which a user states `where`."""
        if self.earth == "flat":
            return FlatEarth(self.gravity)
        if "gravity" in self.model_fields_set:
            raise ValueError("gravity is that of a flat Earth; wgs84 has its own.")
        if origin is None:
            raise ValueError(f"wgs84 needs to know where positions are zero: state origin in {where}.")
        return Wgs84(origin)


class PrecisionSection(Section):
    """``stop = {position = ...}``: arguments of `nav_jax.Precision`."""

    position: Length | None = None
    difference: Length | None = None
    least: int | None = None
    every: int | None = None

    @model_validator(mode="after")
    def _makes_a_rule(self) -> "PrecisionSection":
        self.build()
        return self

    def build(self) -> Precision:
        """The rule."""
        return Precision(**self.given())


class RunSection(OfEarth):
    """Arguments of `nav_jax.compare`, and of its scenario."""

    num_runs: Annotated[int, Field(ge=1)] = 100
    seed: Annotated[int, Field(ge=0)] = 0
    gains: Literal["estimate", "reference", "two-level"] = "estimate"
    every: Annotated[int, Field(ge=1)] = EVERY
    output_interval: Time = OUTPUT_INTERVAL
    neglected: list[str] = []
    suspected: list[str] = []
    origin: Annotated[tuple[Angle, Angle, Length], Field(strict=False)] | None = None
    temperature_rise: Annotated[float, _in("K")] | None = None
    temperature_time: Annotated[Time, Field(gt=0)] = 300.0
    chunk_size: Annotated[int, Field(ge=1)] | None = None
    workers: Annotated[int, Field(ge=1)] | None = None
    stop: Literal["significant", "anytime"] | PrecisionSection | None = None

    def temperature(self, time: np.ndarray) -> np.ndarray | None:
        """That of an IMU that is switched on at the start and warms up to its own, of which nobody asks unless told.

        It rises by so many kelvin, exponentially with this time.
        """
        if self.temperature_rise is None:
            if "temperature_time" in self.model_fields_set:
                raise ValueError("[run]: temperature_time is that of a temperature_rise, which is not stated.")
            return None
        return -self.temperature_rise * np.expm1(-(time - time[0]) / self.temperature_time)

    @property
    def has_two_levels(self) -> bool:
        """Whether means are wanted of runs with gains of two kinds, see `nav_jax.simulation.two_level`."""
        return self.gains == TWO_LEVEL

    @property
    def rule(self) -> Rule | str | None:
        """By which runs stop, as `nav_jax.compare` takes it."""
        return self.stop.build() if isinstance(self.stop, PrecisionSection) else self.stop


class FolderSection(Section):
    """Where tables and figures go; nothing is written without a folder."""

    folder: str | None = None
    plot: bool = True


class OutputSection(FolderSection):
    """The same, and a file of all runs."""

    save: str | None = None
