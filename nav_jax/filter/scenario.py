"""Where filters are run: a trajectory with its aiding, its start and its Earth, and how finely it is computed."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gmwm_jax._internal.checks import integer, number, of_kind, real_array
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import Real, Times
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.states import group_names
from nav_jax.filter.initial import InitialUncertainty, warn_of_attitude
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.trajectory.trajectory import Trajectory

EVERY = 1
"""Default number of IMU samples in a covariance step, see `Scenario`."""

OUTPUT_INTERVAL = 1.0
"""Default s between the epochs of results."""


@saved(added=("neglected", "suspected", "temperature"))
@dataclass(frozen=True, eq=False, repr=False)
class Scenario:
    """A trajectory with its aiding, its start and its Earth: all of a study but the noise of the IMU and the filters.

    It is the first argument of everything that runs or analyses filters along a known trajectory. ``dataclasses.
    replace(scenario, every=10)`` makes another one.

    Attributes
    ----------
    reference
        The trajectory; resampled to the rate of the IMU's errors.
    aiding
        Sensors such as `GnssPosition`, with their true noise, what filters believe of it, and their outages; kept as a
        tuple, and empty for free inertial navigation.
    initial
        Uncertainty of the start, from which the initial errors of runs are drawn; unless given, the start is known.
    earth
        Its gravity, its rate and its shape; a `FlatEarth` unless given.
    every
        Number of IMU samples in a covariance step; the transition is accumulated over all of them, and the estimate
        itself is always advanced sample by sample. The default is one sample, since that is right at every rate and
        along every motion. Ten samples of an IMU of 100 Hz or more change the standard deviations of a vehicle by less
        than a thousandth and take a third of the time, and less of a design or a tuning: state them where time counts.
    output_interval
        s between the epochs at which results are kept.
    neglected
        Errors of aiding sensors that are there and that no filter has as states, by sensor and error: ``gnss_position
        lever_arm`` where a `GnssPosition` was given ``lever_arm_sd=...``.
    suspected
        Errors of aiding sensors that filters have as states, and that are zero.
    temperature
        Of the IMU at the times of the reference, in K or deg C: for errors that depend on how it changes, see
        `nav_jax.imu.TemperatureBias`. Nobody knows it unless it is given.

    Raises
    ------
    ValueError
        A part of another class, two sensors of one name, a sensor without a fix, an outage outside the run, a number
        out of range, a trajectory that is about another point than the Earth or leaves it, an error that no sensor has.

    Warns
    -----
    LinearisationWarning
        The attitude at the start is less certain than 10 deg.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)], every=10).every
    10
    """

    reference: Trajectory
    aiding: Sequence[AbstractAiding] = ()
    initial: InitialUncertainty = field(default_factory=InitialUncertainty)
    earth: AbstractEarth = field(default_factory=FlatEarth)
    every: int = EVERY
    output_interval: Real = OUTPUT_INTERVAL
    neglected: Sequence[str] = ()
    suspected: Sequence[str] = ()
    temperature: Times | None = None

    def __post_init__(self) -> None:
        of_kind("reference", self.reference, Trajectory)
        of_kind("initial", self.initial, InitialUncertainty)
        warn_of_attitude(self.initial)
        of_kind("earth", self.earth, AbstractEarth)
        object.__setattr__(self, "aiding", tuple(self.aiding))
        object.__setattr__(self, "every", integer("every", self.every, 1))
        for s in self.aiding:
            if not isinstance(s, AbstractAiding):
                raise ValueError(f"Aiding is made of sensors such as GnssPosition, and {s!r} is none.")
        require_names([s.name for s in self.aiding])
        known = group_names(self.aiding)
        for field_name in ("neglected", "suspected"):
            given = tuple(getattr(self, field_name))
            object.__setattr__(self, field_name, given)
            if unknown := [name for name in given if name not in known]:
                listed = ", ".join(map(repr, known)) or "none"
                raise ValueError(f"{field_name}: {unknown[0]!r} is no error of a sensor here; there are {listed}.")
        start, end = float(self.reference.time[0]), float(self.reference.time[-1])
        output_times(start, end, self.output_interval)
        for s in self.aiding:
            s.fixes(start, end)
        self.earth.check(self.reference.position, self.reference.origin)
        if self.temperature is not None:
            given = real_array("The temperature of a scenario", self.temperature, (len(self.reference),))
            object.__setattr__(self, "temperature", given)

    def temperature_at(self, times: Times) -> Times | None:
        """Return the temperature between the times of the reference; None where nobody knows it."""
        return None if self.temperature is None else np.interp(times, self.reference.time, self.temperature)

    def __repr__(self) -> str:
        ref = self.reference
        sd = np.sqrt(np.diagonal(np.asarray(self.initial.covariance)))
        start = "a start that is known" if not sd.any() else "an uncertain start"
        steps = "every sample" if self.every == 1 else f"every {self.every} samples"
        listed = ", ".join(f"{s.name} {s.rate:g} Hz{_outages(s)}" for s in self.aiding)
        warmth = ""
        if self.temperature is not None:
            warmth = f"; an IMU of {self.temperature.min():g} to {self.temperature.max():g} K or deg C"
        return (
            f"Scenario: {ref.name or 'a trajectory'} of {ref.duration:g} s from {start}; covariance {steps}, results "
            f"every {self.output_interval:g} s\naiding: {listed or 'none'}; {self.earth!r}{warmth}"
        )


def _outages(sensor: AbstractAiding) -> str:
    gaps = ", ".join(f"{a:g} .. {b:g} s" for a, b in sensor.outages)
    return f" (outage {gaps})" * bool(gaps)


def require_names(names: Sequence[str]) -> None:
    """Raise unless each aiding sensor has a name of its own."""
    if len(set(names)) < len(names):
        raise ValueError(f"Two aiding sensors have one name ({', '.join(names)}): give each a name=... of its own.")


def output_times(start: float, end: float, interval: Real, what: str = "run") -> np.ndarray:
    """Epochs of results, in even steps after the start; a ValueError if there is none.

    Parameters
    ----------
    start, end
        Of the run, s.
    interval
        Between epochs, s.
    what
        For the message: a run or a record.
    """
    step = number("output_interval", interval)
    count = int(np.floor((end - start) / step + 1e-9))
    if not count:
        raise ValueError(f"The output interval of {step:g} s is longer than the {what} of {end - start:g} s.")
    return start + step * np.arange(1, count + 1)
