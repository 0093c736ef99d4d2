"""What an aiding sensor is. One more is one file with a class derived from `AbstractAiding`, and a row in the tests.

A measurement is a function h of position, velocity, attitude, the motion of the body and states of the sensor's own,
plus noise. A filter takes the noise as white with the believed standard deviations, and finds the derivative of h by
itself where the sensor does not state it. The errors that are emulated may be any model of gmwm_jax at the sensor's own
rate.
"""

import abc
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol, runtime_checkable

import equinox as eqx
import jax
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Key

from gmwm_jax._internal.checks import as_float, concrete, number, positive, sampling_rate
from gmwm_jax._internal.chunks import stream_keys
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.states import OwnState
from nav_jax.imu.noise_models import NoiseModel, axis_noise, draw_each, white_sd
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.kinematics.reference import ReferenceMotion
from nav_jax.kinematics.state import BodyMotion, NavState

_TOLERANCE = 1e-6
"""s, by which the ends of an outage belong to it."""


class Setting(NamedTuple):
    """What a number among the arguments of a sensor measures: for readers of configuration files."""

    unit: str
    """SI."""
    counts: tuple[int, ...] = (1,)
    """How many numbers there may be."""
    or_model: bool = False
    """May a model be given instead?"""
    required: bool = False
    """Must it be given?"""


class Window(NamedTuple):
    """A stretch of time about a fix, over which a sensor wants the mean of what the IMU senses."""

    begin: float
    """s after the fix."""
    end: float
    rises: bool = False
    """Whether the weight grows from zero at the beginning; else it is even."""

    def count(self, rate: float) -> float:
        """Samples of an IMU that such a mean is worth: of white noise."""
        return max((self.end - self.begin) * rate * (0.75 if self.rises else 1.0), 1.0)


@runtime_checkable
class Slices(Protocol):
    """Where what is in an error vector: `nav_jax.filter.layout.Layout`."""

    @property
    def size(self) -> int:
        """Length of the vector."""
        ...

    def __getitem__(self, name: str) -> slice:
        """Where a block is."""
        ...


class AbstractAiding(eqx.Module):
    """An aiding sensor with K components: rate, outages, emulated noise and believed standard deviations."""

    unit: ClassVar[str]
    settings: ClassVar[Mapping[str, Setting]]
    """The arguments of its own."""

    name: eqx.AbstractVar[str]
    rate: eqx.AbstractVar[float]
    """Hz."""
    first: eqx.AbstractVar[float]
    """s after the start of the run, of the first fix."""
    outages: eqx.AbstractVar[tuple[tuple[float, float], ...]]
    noise: eqx.AbstractVar[tuple[NoiseModel, ...]]
    """Emulated noise of each component, per sample at `rate`."""
    believed: eqx.AbstractVar[Float[Array, " K"]]
    """Standard deviations in the filter."""

    @property
    @abc.abstractmethod
    def axes(self) -> tuple[str, ...]:
        """Names of the components."""

    @property
    def units(self) -> tuple[str, ...]:
        """Of each component: `unit` names those of as many equal parts of them."""
        parts = self.unit.split(", ")
        return tuple(unit for unit in parts for _ in range(len(self.axes) // len(parts)))

    @property
    def linear(self) -> bool:
        """Is h linear in position and velocity, and nothing else? Its derivative is then taken once and for all."""
        return False

    @property
    def uses_body(self) -> bool:
        """Does h depend on the motion of the body?

        That is what the IMU says at the fix without the errors that the filter estimates, and without the rate of the
        Earth: white noise of it is still in there, and in no variance that a filter or a covariance analysis states. On
        an arm it is sigma_w times the arm, sigma_w being that of a gyro sample: to be seen only where that is not small
        against the sensor's own noise.
        """
        return False

    @property
    def windows(self) -> tuple[Window, ...]:
        """Over which it wants means of specific force and body rate, as `means` of the motion of the body."""
        return ()

    @property
    def states(self) -> tuple[OwnState, ...]:
        """States of its own, which a filter estimates."""
        return ()

    @property
    def mixing(self) -> Float[Array, "K K"] | None:
        """Lower triangular L of correlated components: the noise is L e; `noise` and `believed` are those of e."""
        return None

    def on(self, earth: AbstractEarth) -> "AbstractAiding":
        """The sensor on an Earth; itself, unless what it measures depends on more than the motion in n."""
        return self

    @abc.abstractmethod
    def predict(self, state: NavState, body: BodyMotion | None) -> Float[Array, "K R"]:
        """h: the measurement without noise.

        Parameters
        ----------
        state
            Position, velocity, attitude, and as `x` the states of its own.
        body
            The motion of the body at the fix; None unless `uses_body`.
        """

    def emulate(
        self, track: ReferenceMotion, time: Float[Array, " F"], x: Float[Array, "F a _"]
    ) -> Float[Array, "K F R"] | None:
        """What is measured at F fixes of R runs without noise, where that is no matter of the epoch alone.

        Parameters
        ----------
        track
            The reference at any time.
        time
            Of the fixes, s.
        x
            The states of its own.

        Returns
        -------
        None where it is what `predict` says of the truth.
        """
        return None

    def jacobian(self, state: NavState, body: BodyMotion | None, layout: Slices) -> Float[Array, "K n _"] | None:
        """H: derivative of h along the error of the state and of the motion of the body.

        Parameters
        ----------
        state, body
            As of `predict`, to be used where the derivative depends on them. Not given to a sensor that is `linear`.
        layout
            Blocks ``position``, ``velocity``, ``attitude`` (a rotation vector in n, that turns the estimate), ``own``,
            ``force`` and ``rate``.

        Returns
        -------
        H, for all runs or with a last axis of one; None to let autodiff find it.
        """
        return None

    def columns(self, *, geodetic: bool) -> Sequence[str]:
        """The quantities that files hold of it besides time, see `nav_jax.trajectory.columns`; none unless it says so.

        Parameters
        ----------
        geodetic
            Whether an origin is given, so that positions are latitude, longitude and height.

        Raises
        ------
        ValueError
            No file holds it, or an origin means nothing to it.
        """
        raise ValueError(f"No column of a file is known to be of {self.name}: make nj.Fixes of its arrays.")

    def measured(self, values: Float[np.ndarray, "F C"], origin: Float[np.ndarray, "3"] | None) -> np.ndarray:
        """What it has measured, from those columns in SI."""
        return values

    def fixes(self, start: float, end: float) -> Float[np.ndarray, " F"]:
        """Return the times of all fixes of a run, those in outages included.

        Raises
        ------
        ValueError
            There is none, all of them lie in outages, or an outage lies outside the run.
        """
        last = (end - start - self.first) * self.rate
        if last < -_TOLERANCE:
            raise ValueError(
                f"{self.name} has no fix between {start:g} and {end:g} s: the first would come {self.first:g} s after "
                "the start. Leave the sensor out, or give another rate."
            )
        times = start + self.first + np.arange(int(np.floor(last + _TOLERANCE)) + 1) / self.rate
        for a, b in self.outages:
            if a < start - _TOLERANCE or b > end + _TOLERANCE:
                raise ValueError(
                    f"The outage {a:g} to {b:g} s of {self.name} lies outside the run, {start:g} to {end:g} s."
                )
        if not self.available(times).any():
            raise ValueError(f"All fixes of {self.name} lie in its outages: leave the sensor out.")
        return times

    def available(self, times: Float[np.ndarray, " F"]) -> np.ndarray:
        """Return which of the fixes lie outside the outages; the ends of an outage belong to it."""
        return ~inside(times, self.outages)

    def applies(self, speed: Float[np.ndarray, " F"]) -> Bool[np.ndarray, " F"]:
        """Return which of the fixes there are at these speeds over ground, m/s: all, but of what holds at some only."""
        return np.ones(len(speed), dtype=bool)

    def draw(self, num: int, keys: Key[Array, " R"]) -> Float[Array, "F K R"]:
        """Draw the noise of the first `num` fixes of each run, before it is mixed."""
        streams = jax.vmap(lambda number: stream_keys(keys, number))(np.arange(len(self.noise), dtype=np.uint32))
        return draw_each(self.noise, num, streams)


def inside(times: Float[np.ndarray, " F"], intervals: Sequence[tuple[float, float]]) -> Bool[np.ndarray, " F"]:
    """Which of the times lie in one of the intervals, ends included."""
    found = np.zeros(len(times), dtype=bool)
    for a, b in intervals:
        found |= (times > a - _TOLERANCE) & (times < b + _TOLERANCE)
    return found


def timing(
    name: str, rate: Real, first: Real | None, outages: Sequence[Sequence[Real]]
) -> tuple[float, float, tuple[tuple[float, float], ...]]:
    """Check and return rate, first fix (one period after the start unless told otherwise) and outages."""
    rate = sampling_rate(rate)
    first = 1 / rate if first is None else number(f"{name}: first", first, zero_ok=True)
    checked = []
    for outage in outages:
        if len(tuple(outage)) != 2:
            raise ValueError(f"{name}: an outage is a pair (start, end) in s, and this is {outage!r}.")
        a, b = (number(f"{name}: an outage's time", t, negative_ok=True) for t in outage)
        if a > b:
            raise ValueError(f"{name}: the outage ({a:g}, {b:g}) ends before it starts.")
        checked.append((a, b))
    return rate, first, tuple(sorted(checked))


def noises(
    name: str, given: Sequence[Any], believed: Sequence[Any] | None
) -> tuple[tuple[NoiseModel, ...], Float[Array, " K"]]:
    """The emulated noise of each component, and the standard deviations the filter believes: those, if not given."""
    models = tuple(axis_noise(g, name) for g in given)
    sd = known(*(map(white_sd, models) if believed is None else map(as_float, believed)))
    for value in sd:
        positive(f"{name}: a standard deviation that the filter believes", value)
    return models, as_float(namespace(*sd).stack(sd))


def spread(name: str, believed: Any, groups: Sequence[Sequence[str]]) -> list[Any]:
    """Believed standard deviations of all components.

    Parameters
    ----------
    name
        Of the sensor.
    believed
        One of each component, or one of each group of them that are alike.
    groups
        Names of the components that are alike.

    Raises
    ------
    ValueError
        Another number of them.
    """
    axes = [axis for group in groups for axis in group]
    shape = np.shape(believed)
    given = [believed] if shape == () else list(believed)
    if len(shape) < 2 and len(given) == len(axes):
        return given
    if len(shape) < 2 and len(given) == len(groups):
        return [sd for sd, group in zip(given, groups, strict=True) for _ in group]
    counts = " or ".join(
        f"{len(names)} ({', '.join(names)})"
        for names in dict.fromkeys((tuple(axes), tuple("+".join(g) for g in groups)))
    )
    raise ValueError(f"{name}: believed has {counts} standard deviations, and this is {believed!r}.")


def lever(name: str, given: Any) -> Float[Array, "3"] | None:
    """A lever arm in b, x, y, z in m: from the IMU to the sensor; None where it is not given."""
    return None if given is None else vector(name, "a lever arm", "front, right, down, in m", given)


def vector(name: str, what: str, components: str, given: Any) -> Float[Array, "3"]:
    """Three finite components, which may be traced."""
    if np.shape(given) != (3,):
        raise ValueError(f"{name}: {what} has three components ({components}), and this is {given!r}.")
    found = as_float(given)
    seen = concrete(found)
    if seen is not None and not np.isfinite(seen).all():
        raise ValueError(f"{name}: {what} must be finite, and is {given!r}.")
    return found


def check_size(name: str, values: Float[np.ndarray, "F 3"], size: float, what: str, unit: str) -> None:
    """Refuse the values of a file in another unit than it says: of vectors, their length is known.

    Raises
    ------
    ValueError
        Half of them are more than a factor of ten off.
    """
    typical = float(np.median(np.linalg.norm(values, axis=1))) if len(values) else size
    if not size / 10 < typical < 10 * size:
        raise ValueError(
            f"{name}: the values of the file are about {typical:.3g} {unit} long, and {what} is {size:.3g} {unit}: "
            "state the unit of the columns in their names, or correct it."
        )


def direction(name: str, what: str, components: str, given: Any) -> Float[Array, "3"]:
    """The same, and not zero."""
    found = vector(name, what, components, given)
    seen = concrete(found)
    if seen is not None and not seen.any():
        raise ValueError(f"{name}: {what} of zero shows no direction: give {components}.")
    return found
