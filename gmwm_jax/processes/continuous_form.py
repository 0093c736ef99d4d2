"""What a process is in continuous time: its quantities, as each process states them in its own file.

Symbols as in IEEE Std 952-1997, annex C. A quantity is computed from the per-sample parameters and the sampling rate f.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from gmwm_jax.processes.parameter import Limit


def derived_unit(signal: str, suffix: str) -> str:
    """The unit of a noise quantity: the signal's unit times ``suffix`` (for example ``/sqrt(Hz)`` or ``*s``)."""
    known = {
        ("rad/s", "*s"): "rad", ("rad/s", "/s"): "rad/s^2", ("m/s^2", "*s"): "m/s", ("m/s^2", "/s"): "m/s^3",
    }  # fmt: skip
    if suffix.startswith("^2"):
        return f"({signal}){suffix}"
    return known.get((signal, suffix), f"{signal}{suffix}")


class Quantity(NamedTuple):
    """A quantity of a process in continuous time, computed from its per-sample parameters."""

    symbol: str
    meaning: str
    suffix: str | None
    """What follows the signal's unit; None: the unit stands in `unit`."""
    value: Callable[..., Any]
    """(per-sample parameters..., rate) -> value in SI."""
    unit: str = ""
    gyro: tuple[str, ...] = ()
    """Units a gyro datasheet gives it in."""
    accel: tuple[str, ...] = ()
    reads: tuple[int, ...] = (0,)
    """Positions of the parameters that it depends on."""
    determined_at: Limit = Limit.NONE
    """The limit of the process (see `AbstractProcess.limit_of`) at which data still determine it."""
    in_both: bool = False
    """Does it stand in the table of the filter as well as in that of the datasheet?"""

    def si_unit(self, signal: str) -> str:
        """Its SI unit for a signal unit."""
        return self.unit if self.suffix is None else derived_unit(signal, self.suffix)

    def datasheet_units(self, signal: str) -> tuple[str, ...]:
        """The units a datasheet gives it in; the SI unit for sensors that are neither gyro nor accelerometer."""
        shown = {"rad/s": self.gyro, "m/s^2": self.accel}.get(signal, ())
        return shown or (self.si_unit(signal),)


class AllanLine(NamedTuple):
    """A process whose Allan deviation is a straight line in double logarithm: coefficient * factor * T^slope."""

    slope: float
    factor: float
    """The coefficient is the first quantity of the datasheet (IEEE 952, annex C)."""


class ContinuousForm(NamedTuple):
    """The continuous-time form of a process: what a Kalman filter wants, what a datasheet says, and the way back."""

    filter: tuple[Quantity, ...]
    """Where there is an `inverse`, as many as the process has parameters: a bijection."""
    datasheet: tuple[Quantity, ...]
    inverse: Callable[..., tuple[Any, ...]] | None
    """(filter quantities..., rate) -> per-sample parameters; None for a process that belongs to its sampling rate."""
    allan_line: AllanLine | None = None
    """Where the Allan deviation of the process alone is a straight line."""
    undefined: str = "not defined"
    """What tables say of a quantity that is NaN."""
