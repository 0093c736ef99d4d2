"""Recorded navigation data and models written as a TOML file: what ``nav-jax navigate`` and ``nav-jax tune`` read.

Sections: ``[record]`` (the IMU, its mounting, and where the record starts), ``[filters.NAME]`` (models, as in a
comparison), ``[[aiding]]`` (sensors with the file of their fixes, or what needs none: ``non_holonomic``,
``zero_velocity``, ``zero_rate``, by the samples of the IMU), ``[initial]`` (how well the start is known),
``[align]`` (how it is found, where [initial] has ``align = true``), ``[reference]`` (a trajectory to be compared with),
``[run]``, ``[output]``. Files that they name are looked for beside the configuration.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float64
from pydantic import BeforeValidator, Field, create_model

from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.tabular import open_source
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import AbstractReceiver, Gnss, GnssPosition
from nav_jax.app.comparison_file import aiding_sections, check_sections, checked, filter_sections, from_toml, place
from nav_jax.app.made_fixes import MadeSection, made_section
from nav_jax.app.record_start import Begun, Stated, averaged_by, begun, gravity_at
from nav_jax.app.sections import (
    AIDING,
    Aiding,
    AlignSection,
    Angle,
    FolderSection,
    Frequency,
    Length,
    OfEarth,
    RecordInitialSection,
    Section,
    Speed,
    Time,
    quantity,
)
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.scenario import EVERY, OUTPUT_INTERVAL
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.imu.vibration import VibrationNoise
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.kinematics.geodetic import checked_origin
from nav_jax.recorded.alignment import between
from nav_jax.recorded.files import read_fixes, read_imu, read_samples
from nav_jax.recorded.gnss.reading import read_gnss
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.gnss.registry import FORMATS
from nav_jax.recorded.inspection import Inspection, inspect_record
from nav_jax.recorded.motion_noise import NoiseInMotion, noise_in_motion
from nav_jax.recorded.mounting import find_mounting, mounted, turned
from nav_jax.recorded.navigation import Navigation, navigate
from nav_jax.recorded.outages import Intervals
from nav_jax.recorded.study import OutageStudy, outage_study
from nav_jax.recorded.tuning import Tuning, tune
from nav_jax.trajectory.columns import POSITION, VELOCITY, choose, present
from nav_jax.trajectory.files import read_trajectory
from nav_jax.trajectory.trajectory import Trajectory

SECTIONS = ("record", "filters", "aiding", "initial", "reference", "align", "run", "output")

_IMU_READ = ("units", "scale", "rate", "columns", "time_unit", "gaps", "samples", "stamps", "format",
             "delimiter", "header", "variable", "max_bytes")  # fmt: skip
_FIXES_READ = ("angles", "columns", "time_unit", "delimiter", "header", "variable", "max_bytes")
_GNSS_READ = ("format", "clock", "date", "week")
_GNSS_MAKE = ("sd_factor", "correlated")
"""Keys that are arguments of `read_imu`, `read_fixes`, `read_gnss`, and of the fixes made of a `GnssRecord`."""

_OF_SAMPLES = ("gaps", "samples", "stamps")
"""Keys of these that `read_samples` does not know."""

_POSITIONS = ("time", *POSITION["ned"], *POSITION["geodetic"], *VELOCITY)
"""What a table of a receiver's fixes may have."""

Columns = dict[str, int | str]
Factor = Annotated[float, Field(ge=0)]
Axes = Annotated[list[Factor], Field(min_length=3, max_length=3)]
Probability = Annotated[float, Field(ge=0.5, lt=1)]
Three = Field(strict=False)


def _mounting(value: Any) -> str | tuple[float, ...]:
    """``"find"``, or three angles."""
    if value == "find":
        return value
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f'expected "find", or roll, pitch, yaw as [0, "-6.7 deg", "5 deg"], and this is {value!r}')
    return tuple(quantity(x, "rad") for x in value)


class RecordSection(Section):
    """``imu = ...``: arguments of `read_imu`, how the IMU is mounted, and where and when the record starts.

    ``mounting = "find"`` lets the drive tell it, see `find_mounting`; without it the samples are along the body. All
    fixes of the receiver tell it, also those in outages, as somebody would find it who calibrates a car once.
    Without an attitude the record starts when the vehicle is fast enough that its course tells it, with position and
    velocity of the fixes.
    """

    imu: str
    units: dict[Literal["gyro", "accel"], str] | None = None
    scale: str | dict[Literal["gyro", "accel"], str] | None = None
    rate: Frequency | None = None
    columns: Columns | None = None
    time_unit: str | None = None
    gaps: str | None = None
    samples: str | None = None
    stamps: str | None = None
    format: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | str | None = None
    mounting: Annotated[Literal["find"] | tuple[float, float, float], BeforeValidator(_mounting)] | None = None
    start: Time | None = None
    end: Time | None = None
    time_offset: Time = 0.0
    position: Annotated[tuple[Length, Length, Length], Three] | None = None
    velocity: Annotated[tuple[Speed, Speed, Speed], Three] | None = None
    attitude: Annotated[tuple[Angle, Angle, Angle], Three] | None = None
    course_speed: Speed | None = None
    origin: Annotated[tuple[Angle, Angle, Length], Three] | None = None

    @property
    def stated(self) -> Stated:
        """What is said of the start."""
        return Stated(self.position, self.velocity, self.attitude, self.course_speed)

    def build(self, folder: Path) -> Imu:
        """From start to end, along the axes of the body, or those of the IMU if its mounting is to be found."""
        if self.attitude is not None and self.course_speed is not None:
            raise ValueError("course_speed is for a start without an attitude, and there is one.")
        if self.attitude is not None and self.velocity is None:
            raise ValueError("With an attitude there must be a velocity; without both, the fixes tell them.")
        how = {k: getattr(self, k) for k in _IMU_READ if k in self.model_fields_set}
        imu = read_imu(folder / self.imu, **how)
        imu = mounted(imu, self.mounting) if isinstance(self.mounting, tuple) else imu
        return imu if self.start is None and self.end is None else between(imu, self.start, self.end)

    def placed(self, imu: Imu, gnss: GnssRecord | None, averaged: float, earth: AbstractEarth) -> tuple[Imu, list[str]]:
        """The samples along the axes of the body, also where the mounting is to be found, and what was found.

        Raises
        ------
        ValueError
            See `find_mounting`; no fixes to find it by.
        """
        if self.mounting != "find":
            return imu, []
        if gnss is None:
            raise ValueError('mounting = "find" needs the file of a GNSS receiver in [[aiding]], and there is none.')
        found = find_mounting(imu, gnss, averaged=averaged, gravity=gravity_at(earth, gnss))
        said = ", ".join(f"{x:.2f}" for x in np.rad2deg(found.euler))
        sd = ", ".join(f"{x:.2g}" for x in np.rad2deg(found.sd))
        note = f"Mounting found by the drive: roll, pitch, yaw {said} deg; sd about front, right, down {sd} deg."
        return mounted(imu, found.euler), [note]

    def as_recorded(self, folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As they were recorded, along the axes of the body, or those of the IMU if its mounting is to be found."""
        how = {k: getattr(self, k) for k in _IMU_READ if k not in _OF_SAMPLES and k in self.model_fields_set}
        time, gyro, accel = read_samples(folder / self.imu, **how)
        if isinstance(self.mounting, tuple):
            gyro, accel = (turned(x, self.mounting) for x in (gyro, accel))
        inside = np.ones(len(time), dtype=bool)
        inside &= time >= (-np.inf if self.start is None else self.start)
        inside &= time <= (np.inf if self.end is None else self.end)
        return time[inside], gyro[inside], accel[inside]


class FixesSection(Aiding):
    """``file = ...``: arguments of `read_fixes`; of a GNSS receiver's file those of `read_gnss` and `GnssRecord`."""

    file: str
    angles: str | None = None
    columns: Columns | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | str | None = None
    format: str | None = None
    clock: str | None = None
    date: str | None = None
    week: int | None = None
    exclude: list[int | str] = Field(default_factory=list)
    sd_factor: float | None = None
    correlated: bool | None = None
    time_offset: Time = 0.0

    def is_gnss_file(self) -> bool:
        """Is it a file of a receiver, rather than a table of a sensor's values?"""
        if not issubclass(self.sensor, AbstractReceiver):
            return False
        asked = {*_GNSS_READ, *_GNSS_MAKE, "exclude", "angles"} & self.model_fields_set
        known = any(Path(self.file).suffix.lower() in f.suffixes for f in FORMATS.values())
        return bool(asked) or known or not {"horizontal", "vertical"} <= self.model_fields_set

    def read(self, folder: Path, origin: Sequence[float] | None) -> tuple[Fixes, GnssRecord | None]:
        """The fixes, on the clock of the file plus the offset, and the record of a receiver that they are from."""
        if self.model_fields_set & {"rate", "first"}:
            raise ValueError("rate and first follow from the times of the file: leave them out.")
        how = {k: getattr(self, k) for k in _FIXES_READ if k in self.model_fields_set}
        if self.is_gnss_file():
            return self._of_receiver(folder, origin)
        if wrong := sorted(self.model_fields_set & {*_GNSS_READ, *_GNSS_MAKE, "exclude"}):
            raise ValueError(f"{wrong[0]} is for files of GNSS receivers, and this is a {self.type}.")
        options = ("type", "file", "exclude", "time_offset", *_FIXES_READ, *_GNSS_READ, *_GNSS_MAKE)
        sensor = self.sensor(**self.given(*options))  # type: ignore[call-arg]
        try:
            fixes = read_fixes(folder / self.file, sensor, origin=self._about(sensor, folder, origin), **how)
        except ValueError as error:
            if isinstance(sensor, AbstractReceiver) and "latitude" in str(error):
                said = 'if positions are latitude, longitude and height, say so by angles = "deg" or "rad".'
                raise ValueError(f"{error} Or {said}") from error
            raise
        if sensor.states and len(fixes.time) > 1:  # whose models are per fix
            rate = float(1 / np.median(np.diff(fixes.time)))
            fixes = replace(fixes, sensor=self.sensor(rate, **self.given(*options)))  # type: ignore[call-arg]
        return fixes, _record_of(fixes, origin)

    def _about(self, sensor: AbstractAiding, folder: Path, origin: Sequence[float] | None) -> Sequence[float] | None:
        """The origin of the record, unless values of the file are about it already, or have none."""
        try:
            sensor.columns(geodetic=True)
        except ValueError:
            return None
        if not isinstance(sensor, AbstractReceiver) or origin is None:
            return origin
        to_open = Reading(self.delimiter, self.header, self.variable, max_bytes=size_in_bytes(self.max_bytes))
        there = present(open_source(folder / self.file, to_open), self.columns or {}, _POSITIONS)
        return None if set(POSITION["ned"]) <= set(there) else origin

    def gnss(self, folder: Path, origin: Sequence[float] | None) -> GnssRecord | None:
        """Positions and velocities of a receiver, be it by its file or by a table, on its own clock; or None."""
        if self.is_gnss_file():
            return self.receiver(folder, origin)
        return self.read(folder, origin)[1] if issubclass(self.sensor, AbstractReceiver) else None

    def receiver(self, folder: Path, origin: Sequence[float] | None) -> GnssRecord:
        """What a file of a receiver has, but for the qualities that are left out, on its own clock."""
        how = {k: getattr(self, k) for k in (*_FIXES_READ, *_GNSS_READ) if k in self.model_fields_set}
        record = read_gnss(folder / self.file, origin=origin, **how)
        return record.without(*self.exclude) if self.exclude else record

    def _of_receiver(self, folder: Path, origin: Sequence[float] | None) -> tuple[Fixes, GnssRecord]:
        if "believed" in self.model_fields_set:
            raise ValueError("believed: what the filter believes of recorded fixes is horizontal and vertical.")
        record = self.receiver(folder, origin)
        own = (*self.sensor.settings, *_GNSS_MAKE, "outages", "name")
        options = {k: getattr(self, k) for k in own if k in self.model_fields_set}
        if not issubclass(self.sensor, Gnss):
            make = record.position_fixes if issubclass(self.sensor, GnssPosition) else record.velocity_fixes
            return make(**options), record
        of_both = {k: options.pop(k) for k in _GNSS_MAKE if k in options}
        position, velocity = (
            of_both | {k: options.pop(k + end) for k in ("horizontal", "vertical") if k + end in options}
            for end in ("", "_velocity")
        )
        return record.fixes(position, velocity, **options), record


def _record_of(fixes: Fixes, origin: Sequence[float] | None) -> GnssRecord | None:
    """What a table of fixes, about an origin if one is known, says of a receiver; None of one without positions."""
    parts = fixes.sensor.parts if isinstance(fixes.sensor, AbstractReceiver) else ()
    if "position" not in parts:
        return None
    position, *velocity = np.split(fixes.value, len(parts), axis=1)
    about = None if origin is None else np.array(origin)
    return GnssRecord(fixes.time, position, about, velocity=velocity[0] if velocity else None)


def _fixes_section(kind: str, section: type[Aiding]) -> Any:
    """The section of a sensor with the file of its fixes; the noise of a receiver may stand in its file."""
    if (made := made_section(kind, section.sensor)) is not None:
        return made
    stated: dict[str, Any] = {
        name: (Annotated[field.annotation, *field.metadata], None)
        for name, field in section.model_fields.items()
        if field.is_required() and name != "type" and issubclass(section.sensor, AbstractReceiver)
    }
    return create_model(f"fixes_{kind}", __base__=(FixesSection, section), **stated)


FIXES: dict[str, Any] = {kind: _fixes_section(kind, section) for kind, section in AIDING.items()}


class ReferenceSection(Section):
    """``file = ...``: a trajectory to be compared with; arguments of `read_trajectory`."""

    file: str
    position: Literal["ned", "geodetic"] | None = None
    angles: str | dict[str, str] | None = None
    columns: list[int | str] | Columns | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    max_bytes: int | str | None = None
    time_offset: Time = 0.0

    def read(self, folder: Path, origin: np.ndarray | None) -> Trajectory:
        """In the frame and on the clock of the record."""
        how = self.given("file", "time_offset")
        to_open = Reading(self.delimiter, self.header, self.variable, max_bytes=size_in_bytes(self.max_bytes))
        table = open_source(folder / self.file, to_open)
        if choose(table, self.position, self.columns)[0] == "geodetic":
            how["origin"] = origin
        found = read_trajectory(folder / self.file, **how)
        time = found.time + self.time_offset
        return replace(found, time=time)


class RecordRunSection(OfEarth):
    """Arguments of `nav_jax.tune` and `nav_jax.navigate`; the latter alone takes all but `every` and `vibration`.

    ``vibration = 0.1``, or ``{accel = 0.1, gyro = [0.05, 0.05, 0.1]}``: factors of `nav_jax.imu.VibrationNoise`.
    ``gate = 0.999``, or ``{gnss = 0.999}``: the probability with which a good fix passes.
    """

    every: Annotated[int, Field(ge=1)] = EVERY
    output_interval: Time = OUTPUT_INTERVAL
    smooth: bool = False
    vibration: Factor | dict[Literal["gyro", "accel"], Factor | Axes] | None = None
    gate: Probability | dict[str, Probability] | None = None


class RecordOutputSection(FolderSection):
    """The same, a file of the solution and one of its track."""

    save: str | None = None
    export: str | None = None


@dataclass(frozen=True)
class RecordConfig:
    """A record, ready to be tuned by.

    Attributes
    ----------
    imu, aiding, position, velocity, quaternion, initial
        Arguments of `nav_jax.tune` and `nav_jax.navigate`.
    filters
        Models, of which one is used.
    earth
        Argument of both.
    reference
        Argument of `nav_jax.navigate`, if there is one.
    origin
        Latitude, longitude (rad), height (m) of the origin of n, if it is known.
    utc
        UTC at time zero, if it is known.
    notes
        What a reader of the results should know of the record.
    run, output
        Sections of these names.
    """

    imu: Imu
    aiding: Sequence[Fixes]
    filters: Mapping[str, ImuErrors]
    position: Float64[np.ndarray, "3"]
    velocity: Float64[np.ndarray, "3"]
    quaternion: Float64[np.ndarray, "4"]
    initial: InitialUncertainty
    earth: AbstractEarth
    reference: Trajectory | None
    origin: np.ndarray | None
    utc: np.datetime64 | None
    notes: tuple[str, ...]
    run: RecordRunSection
    output: RecordOutputSection

    def tune(self, name: str, **options: Any) -> Tuning:
        """Tune a filter of this name; options as of `nav_jax.tune`."""
        given: dict[str, Any] = {**self._start(), "vibration": self._noticed()["vibration"], **options}
        return tune(self.imu, self.aiding, self.filters[name], **given)

    def navigate(self, name: str) -> Navigation:
        """Navigate by a filter of this name."""
        options = {"output_interval": self.run.output_interval, "smooth": self.run.smooth, "reference": self.reference}
        return navigate(self.imu, self.aiding, self.filters[name], **self._start(), **self._noticed(), **options)

    def noise_in_motion(self, name: str, **options: Any) -> NoiseInMotion:
        """Test the noise model of a filter of this name; options as of `nav_jax.recorded.noise_in_motion`."""
        return noise_in_motion(self.imu, self.aiding, self.filters[name], **self._start(), **options)

    def outages(self, name: str, schedules: Sequence[Intervals], **options: Any) -> OutageStudy:
        """Study outages with a filter of this name; options as of `nav_jax.recorded.outage_study`."""
        given: dict[str, Any] = {**self._start(), **self._noticed(), **options}
        return outage_study(self.imu, self.aiding, self.filters[name], schedules, **given)

    def noticing(self, gate: float | None, vibration: float | None) -> "RecordConfig":
        """The same with this gate of all sensors and this factor of all axes, in place of the file's where given."""
        given = {name: x for name, x in (("gate", gate), ("vibration", vibration)) if x is not None}
        return replace(self, run=self.run.model_copy(update=given))

    def _noticed(self) -> dict[str, Any]:
        """What a filter takes notice of beside its model."""
        given = self.run.vibration
        each = given if isinstance(given, dict) else {"accel": given, "gyro": given}
        noise = None if given is None else VibrationNoise(each.get("accel") or 0.0, each.get("gyro") or 0.0)
        return {"vibration": noise, "gate": self.run.gate}

    def _start(self) -> dict[str, Any]:
        return {
            "position": self.position,
            "velocity": self.velocity,
            "quaternion": self.quaternion,
            "initial": self.initial,
            "every": self.run.every,
            "earth": self.earth,
        }


def read_record(path: str | os.PathLike[str]) -> RecordConfig:
    """Read a configuration and all that it names.

    Raises
    ------
    FileNotFoundError
        No such file, or one that it names.
    ValueError
        No TOML; a section, key, unit or value that is wrong, by its place in the file.
    """
    return from_toml(Path(path), _build)


def inspect_file(path: str | os.PathLike[str], most_offset: float) -> Inspection:
    """Look at the record of a configuration, of which [record] and [[aiding]] are read and nothing else is needed.

    Raises
    ------
    FileNotFoundError, ValueError
        See `read_record`.
    """

    def build(tables: Mapping[str, Any], folder: Path) -> Inspection:
        check_sections(tables, SECTIONS, ("record",))
        record = checked(RecordSection, tables["record"], "[record]")
        listed = aiding_sections(tables.get("aiding", []), FIXES)
        with place("[record]"):
            time, gyro, accel = record.as_recorded(folder)
        gnss = None
        for i, section in enumerate(listed):
            if gnss is None:
                with place(f"[[aiding]] {i + 1}"):
                    gnss = section.gnss(folder, record.origin)
                if gnss is not None:  # what is found is beyond what is stated
                    gnss = gnss.shifted(record.time_offset + section.time_offset)
        with place("[record]"):
            return inspect_record(time, gyro, accel, gnss, most_offset=most_offset)

    return from_toml(Path(path), build)


def _build(tables: Mapping[str, Any], folder: Path) -> RecordConfig:
    check_sections(tables, SECTIONS, ("record", "filters", "initial"))
    # all sections are checked before the first file is read
    run = checked(RecordRunSection, tables.get("run", {}), "[run]")
    output = checked(RecordOutputSection, tables.get("output", {}), "[output]")
    start = checked(RecordInitialSection, tables["initial"], "[initial]")
    asked = checked(AlignSection, tables["align"], "[align]") if "align" in tables else None
    record = checked(RecordSection, tables["record"], "[record]")
    compared = checked(ReferenceSection, tables["reference"], "[reference]") if "reference" in tables else None
    believed = filter_sections(tables["filters"])
    listed = aiding_sections(tables.get("aiding", []), FIXES)

    known = {}
    for name, section in believed.items():
        with place(f"[filters.{name}]"):
            if section is None:
                raise ValueError("nobody knows the truth behind a record: state a model.")
            known[name] = section.build(folder)
    with place("[record]"):
        imu = record.build(folder)
    read = _Fixes(record, listed, folder)
    with place("[run]"):
        earth = run.build_earth(read.origin, "[record]")
    first = next((r for r in read.records if r is not None), None)
    known_age = None if asked is None else asked.averaged
    averaged = averaged_by(read.fixes) if known_age is None else known_age
    with place("[record]"):
        imu, told = record.placed(imu, first, averaged, earth)
    with place("[initial]"):
        sure = _sure(start, asked)
    with place("[align]" if start.align else "[record]"):
        begin = begun(record.stated, sure, imu, read.records, read.fixes, earth)
    fixes, notes = _within(read, begin, first)
    reference = None
    if compared is not None:
        with place("[reference]"):
            reference = compared.read(folder, read.origin)
    utc = next((r.utc for r in read.records if r is not None and r.utc is not None), None)
    return RecordConfig(
        begin.imu, fixes, known, begin.start.position, begin.start.velocity, begin.start.quaternion, begin.initial,
        earth, reference, read.origin, utc, (*told, *begin.notes, *notes), run, output,
    )  # fmt: skip


def _sure(start: RecordInitialSection, asked: AlignSection | None) -> InitialUncertainty | AlignSection:
    """How well the start is known, or how to find it."""
    if not start.align:
        return InitialUncertainty(**start.given("align"))
    if asked is None:
        raise ValueError("align = true, and there is no section [align] that says how.")
    return asked


class _Fixes:
    """What the sections of aiding read, on the clock of the IMU."""

    def __init__(self, record: RecordSection, listed: Sequence[FixesSection | MadeSection], folder: Path):
        self.listed = listed
        with place("[record]"):
            self.origin = None if record.origin is None else checked_origin(record.origin)
        self.fixes: list[Fixes] = []
        self.records: list[GnssRecord | None] = []
        for i, section in enumerate(listed):
            if isinstance(section, MadeSection):
                continue
            with place(f"[[aiding]] {i + 1}"):
                fixes, gnss = section.read(folder, None if self.origin is None else tuple(self.origin))
                if self.origin is None and gnss is not None:
                    self.origin = gnss.origin
                offset = record.time_offset + section.time_offset
                self.fixes.append(replace(fixes, time=fixes.time + offset))
                self.records.append(None if gnss is None else gnss.shifted(offset))


def _within(read: _Fixes, begin: Begun, gnss: GnssRecord | None) -> tuple[list[Fixes], tuple[str, ...]]:
    """The fixes while the IMU is there, with those that are made of its samples, and how many are left out."""
    kept, notes = [], []
    first, last = begin.imu.epochs[0], begin.imu.epochs[-1]
    of_files = iter(read.fixes)
    for i, section in enumerate(read.listed):
        if isinstance(section, MadeSection):
            with place(f"[[aiding]] {i + 1}"):
                kept.append(section.fixes(begin.imu, gnss))
            continue
        fixes = next(of_files)
        inside = (fixes.time >= first) & (fixes.time <= last)
        if begin.used_until is not None and isinstance(fixes.sensor, AbstractReceiver):
            inside &= fixes.time > begin.used_until + 1e-6 / begin.imu.rate
        with place(f"[[aiding]] {i + 1}"):
            if not inside.any():
                raise ValueError(
                    f"none of the {len(inside)} fixes, of {_span(fixes.time)}, lies in the "
                    f"record of {first:.10g} to {last:.10g} s: state clock of the fixes or time_offset of [record]."
                )
            covariance = None if fixes.covariance is None else fixes.covariance[inside]
            kept.append(Fixes(fixes.sensor, fixes.time[inside], fixes.value[inside], covariance))
        if not inside.all():
            notes.append(f"{fixes.sensor.name}: {inside.sum()} of {len(inside)} fixes lie in the record.")
        there = fixes.time[inside]
        empty = [f"{a:g} to {b:g} s" for a, b in fixes.sensor.outages if not ((there >= a) & (there <= b)).any()]
        if empty:
            notes.append(f"{fixes.sensor.name}: no fix lies in the outage {', '.join(empty)}, of {_span(there)}.")
    return kept, tuple(notes)


def _span(time: np.ndarray) -> str:
    return f"{time[0]:.10g} to {time[-1]:.10g} s"
