"""Sections of sensors that nothing measures: wheels that do not slip, and a vehicle that stands.

They have no file. Their fixes follow from the samples of the IMU, from where the record starts on.
"""

from abc import abstractmethod
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, create_model

from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.non_holonomic import NonHolonomic
from nav_jax.aiding.standstill import AbstractStandstill
from nav_jax.app.sections import AIDING, Acceleration, Aiding, Time, TurnRate
from nav_jax.imu.imu import Imu
from nav_jax.recorded.constraints import constrained
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.standstill import standing, stops


class MadeSection(Aiding):
    """A section without a file; other keys are arguments of the function that makes its fixes."""

    made_by: ClassVar[tuple[str, ...]]
    """Those keys."""

    def gnss(self, folder: Path, origin: Any) -> GnssRecord | None:
        """No receiver."""
        return None

    @abstractmethod
    def fixes(self, imu: Imu, gnss: GnssRecord | None) -> Fixes:
        """Of the record, along the axes of the body, from its start on.

        Parameters
        ----------
        imu
            The record.
        gnss
            Fixes of a receiver on its clock, if there are any.
        """

    def _sensor(self) -> Any:
        return self.sensor(**self.given("type", *self.made_by))  # type: ignore[call-arg]


class WheelsSection(MadeSection):
    """``type = "non_holonomic"``: arguments of `nav_jax.recorded.constrained`."""

    made_by = ("slip", "bumps")

    slip: Time | None = None
    bumps: Annotated[float, Field(ge=0)] | None = None

    def fixes(self, imu: Imu, gnss: GnssRecord | None) -> Fixes:  # noqa: D102
        return constrained(self._sensor(), imu, **{k: v for k, v in self.given().items() if k in self.made_by})


class StandstillSection(MadeSection):
    """``type = "zero_velocity"`` or ``"zero_rate"``: arguments of `nav_jax.recorded.stops`."""

    made_by = ("accel_sd", "gyro_sd", "window", "same_force")

    accel_sd: Acceleration | None = None
    gyro_sd: TurnRate | None = None
    window: Time | None = None
    same_force: Acceleration | None = None

    def fixes(self, imu: Imu, gnss: GnssRecord | None) -> Fixes:  # noqa: D102
        how = {k: v for k, v in self.given().items() if k in self.made_by}
        velocities = gnss if gnss is not None and gnss.velocity is not None else None
        return standing(self._sensor(), stops(imu, velocities, **how))


def made_section(kind: str, sensor: type[AbstractAiding]) -> Any:
    """The section of a sensor that nothing measures; None of one that has a file."""
    for measured_by_nothing, base in ((NonHolonomic, WheelsSection), (AbstractStandstill, StandstillSection)):
        if issubclass(sensor, measured_by_nothing):
            return create_model(f"made_{kind}", __base__=(base, AIDING[kind]))
    return None
