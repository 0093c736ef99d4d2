"""Parameters of processes: their intervals, the map to the real line, and the mark for a held value."""

import enum
from typing import Any, NamedTuple

import equinox as eqx

from gmwm_jax._internal.checks import as_float, concrete
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.typing import Scalar


class Limit(enum.StrEnum):
    """The process that another cannot be told from when its shape leaves the range that a record can show."""

    NONE = ""
    """It is itself; false in a condition."""
    WHITE_NOISE = "white noise"
    RANDOM_WALK = "random walk"
    DRIFT = "drift"
    FLICKER_NOISE = "flicker noise"
    QUANTISATION_NOISE = "quantisation noise"
    UNIT_ROOT = "unit root"
    END_OF_RANGE = "end of its range"
    """Where a search ends, of a process that does not say what it is there."""


class Parameter(NamedTuple):
    """One parameter of a process, per sample."""

    name: str
    unit: str
    """``{u}`` stands for the signal's unit."""
    meaning: str
    lower: float = 0.0
    upper: float = float("inf")
    """Its values lie strictly between; an amplitude may also be exactly 0."""
    determined_at: Limit = Limit.NONE
    """The limit of the process (see `AbstractProcess.limit_of`) at which data still determine it."""

    def check(self, value: Any, owner: str, *, zero_ok: bool) -> Any:
        """Return the value as a float64 scalar, or raise if it lies outside the interval."""
        value = as_float(value)
        seen = concrete(value)
        if seen is not None and not (seen.ndim == 0 and (self.lower < seen < self.upper or (zero_ok and seen == 0))):
            bracket = "[" if zero_ok else "("
            raise ValueError(
                f"{owner}: {self.name} must be one number in {bracket}{self.lower:g}, {self.upper:g}), and is {seen}."
            )
        return value

    def to_line(self, value: Any) -> Any:
        """Map the interval to the real line: log, or logit where it is bounded on both sides."""
        (value,) = known(value)
        xp = namespace(value)
        below = xp.log(value - self.lower)
        return below if self.upper == float("inf") else below - xp.log(self.upper - value)

    def from_line(self, x: Any) -> Any:
        """Inverse of `to_line`."""
        (x,) = known(x)
        xp = namespace(x)
        if self.upper == float("inf"):
            return self.lower + xp.exp(x)
        return self.lower + (self.upper - self.lower) / (1 + xp.exp(-x))


class Fixed(eqx.Module):
    """A value of a parameter that estimation holds, as in ``GM(beta=Fixed(0.01))``.

    Examples
    --------
    >>> gj.WN(sigma2=gj.Fixed(1.0)) + gj.RW()
    WN(sigma2=1 fixed) + RW
    """

    value: Scalar = eqx.field(converter=as_float)
