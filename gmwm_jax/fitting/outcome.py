"""What became of a component, or of a quantity of it, in an estimate."""

import enum

from gmwm_jax.processes.parameter import Limit


class Outcome(enum.StrEnum):
    """What became of a component or a quantity; the value of each is what tables say."""

    ESTIMATED = ""
    """It was estimated, inside its range; false in a condition."""
    FIXED = "fixed"
    """It was held."""
    ZERO = "at boundary: zero"
    """The data push its amplitude to zero."""
    WHITE_NOISE = "at boundary: white noise"
    """Its correlation time is too short for the record: it is white noise."""
    RANDOM_WALK = "at boundary: random walk"
    """Its correlation time is too long for the record: it is a random walk."""
    DRIFT = "at boundary: drift"
    """Its correlation time is so long that it is a drift."""
    FLICKER_NOISE = "at boundary: flicker noise"
    """Its shape has left the range that the record can show: it is flicker noise."""
    QUANTISATION_NOISE = "at boundary: quantisation noise"
    """Its shape has left the range that the record can show: it is quantisation noise."""
    LOWER_BOUND = "at its lower bound"
    """The data push it below the values that it was said to lie between."""
    UPPER_BOUND = "at its upper bound"
    """The data push it above them."""
    UNIT_ROOT = "at boundary: unit root"
    """A root of its polynomials has come to the unit circle."""
    END_OF_RANGE = "at boundary: end of its range"
    """A shape parameter is where the search for it ends, and nobody has said what the process is there."""
    NOT_IDENTIFIED = "not identified"
    """At a boundary of the component the data do not determine it."""
    NOT_TOLD_APART = "not told apart from others"
    """It has no standard error, though others have: the data see only a combination of it with others."""

    @classmethod
    def at(cls, limit: Limit) -> "Outcome":
        """Of a component that has come to a limit."""
        return cls.ESTIMATED if limit is Limit.NONE else cls[limit.name]

    @property
    def at_boundary(self) -> bool:
        """Is it zero, at a limit or at a bound?"""
        ends = (Outcome.ZERO, Outcome.LOWER_BOUND, Outcome.UPPER_BOUND)
        return self in ends or (self is not Outcome.ESTIMATED and self.name in Limit.__members__)
