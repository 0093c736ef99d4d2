"""Recorded navigation data and the models to start from, written as a TOML file: what ``nav-jax tune`` reads.

Sections: ``[record]`` (the IMU, and where the record starts), ``[filters.NAME]`` (models, as in a comparison),
``[[aiding]]`` (sensors with the file of their fixes), ``[initial]`` (how well the start is known), ``[run]``,
``[output]``. Files that they name are looked for beside the configuration.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from pydantic import Field, create_model

from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.aiding.fixes import Fixes
from nav_jax.app.comparison_file import aiding_sections, check_sections, checked, filter_sections, from_toml, place
from nav_jax.app.sections import (
    AIDING,
    Acceleration,
    Aiding,
    Angle,
    FolderSection,
    Frequency,
    InitialSection,
    Length,
    Section,
    Speed,
)
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.scenario import EVERY
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import FlatEarth
from nav_jax.recorded.files import read_fixes, read_imu
from nav_jax.recorded.tuning import Tuning, tune

_SECTIONS = ("record", "filters", "aiding", "initial", "run", "output")

Columns = dict[str, int | str]


class RecordSection(Section):
    """``imu = ...``: arguments of `read_imu`; the start, NED; the origin, where positions are geodetic."""

    imu: str
    units: dict[Literal["gyro", "accel"], str] | None = None
    rate: Frequency | None = None
    columns: Columns | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None
    position: Annotated[tuple[Length, Length, Length], Field(strict=False)] = (0.0, 0.0, 0.0)
    velocity: Annotated[tuple[Speed, Speed, Speed], Field(strict=False)]
    attitude: Annotated[tuple[Angle, Angle, Angle], Field(strict=False)]
    origin: Annotated[tuple[Angle, Angle, Length], Field(strict=False)] | None = None

    def build(self, folder: Path) -> Imu:  # noqa: D102
        return read_imu(folder / self.imu, **self.given("imu", "position", "velocity", "attitude", "origin"))


class FixesSection(Aiding):
    """``file = ...``: arguments of `read_fixes`."""

    file: str
    angles: str | None = None
    columns: Columns | None = None
    time_unit: str | None = None
    delimiter: str | None = None
    header: int | None = None
    variable: str | None = None

    def read(self, folder: Path, origin: Sequence[float] | None) -> Fixes:  # noqa: D102
        if self.model_fields_set & {"rate", "first"}:
            raise ValueError("rate and first follow from the times of the file: leave them out.")
        how = ("angles", "columns", "time_unit", "delimiter", "header", "variable")
        sensor = self.sensor(**self.given("type", "file", *how))  # type: ignore[call-arg]
        options = {k: getattr(self, k) for k in how if k in self.model_fields_set}
        return read_fixes(folder / self.file, sensor, origin=origin, **options)


FIXES: dict[str, Any] = {
    kind: create_model(f"fixes_{kind}", __base__=(FixesSection, section)) for kind, section in AIDING.items()
}


class RecordRunSection(Section):
    """Arguments of `nav_jax.tune`."""

    every: Annotated[int, Field(ge=1)] = EVERY
    gravity: Acceleration = STANDARD_GRAVITY


@dataclass(frozen=True)
class RecordConfig:
    """A record, ready to be tuned by.

    Attributes
    ----------
    imu, aiding, position, velocity, quaternion, initial
        Arguments of `nav_jax.tune`.
    filters
        Models to start from.
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
    run: RecordRunSection
    output: FolderSection

    def tune(self, name: str, **options: Any) -> Tuning:
        """Tune a filter of this name; options as of `nav_jax.tune`."""
        return tune(
            self.imu,
            self.aiding,
            self.filters[name],
            position=self.position,
            velocity=self.velocity,
            quaternion=self.quaternion,
            initial=self.initial,
            every=self.run.every,
            earth=FlatEarth(self.run.gravity),
            **options,
        )


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


def _build(tables: Mapping[str, Any], folder: Path) -> RecordConfig:
    check_sections(tables, _SECTIONS, ("record", "filters", "aiding", "initial"))
    # all sections are checked before the first file is read
    run = checked(RecordRunSection, tables.get("run", {}), "[run]")
    output = checked(FolderSection, tables.get("output", {}), "[output]")
    start = checked(InitialSection, tables["initial"], "[initial]")
    record = checked(RecordSection, tables["record"], "[record]")
    believed = filter_sections(tables["filters"])
    listed = aiding_sections(tables["aiding"], FIXES)

    known, fixes = {}, []
    for name, section in believed.items():
        with place(f"[filters.{name}]"):
            if section is None:
                raise ValueError("nobody knows the truth behind a record: state a model.")
            known[name] = section.build(folder)
    with place("[record]"):
        imu = record.build(folder)
    for i, section in enumerate(listed):
        with place(f"[[aiding]] {i + 1}"):
            fixes.append(section.read(folder, record.origin))
    with place("[initial]"):
        initial = InitialUncertainty(**start.given())
    quaternion = np.asarray(rotation.quat_from_euler(jnp.array(record.attitude)))
    return RecordConfig(
        imu, fixes, known, np.array(record.position), np.array(record.velocity), quaternion, initial, run, output
    )
