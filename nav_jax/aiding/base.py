"""What an aiding sensor is. One more is one file with a class derived from `AbstractAiding`, and a row in the tests.

A measurement is h(p, v) plus noise; a filter takes the noise as white with the believed standard deviation. The errors
that are emulated may be any model of gmwm_jax at the sensor's own rate.
"""

import abc
from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Key

from gmwm_jax._internal.checks import as_float, number, positive, sampling_rate
from gmwm_jax._internal.typing import Real
from nav_jax.imu.noise_models import NoiseModel, axis_noise, draw, white_sd

_TOLERANCE = 1e-6
"""s, by which the ends of an outage belong to it."""


class AbstractAiding(eqx.Module):
    """An aiding sensor with K components: rate, outages, emulated noise and believed standard deviations."""

    axes: ClassVar[tuple[str, ...]]
    """Names of the components."""
    unit: ClassVar[str]

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

    @abc.abstractmethod
    def predict(self, p: Float[Array, "3 R"], v: Float[Array, "3 R"]) -> Float[Array, "K R"]:
        """h: the measurement without noise, from position and velocity in n."""

    @abc.abstractmethod
    def jacobian(self) -> Float[Array, "K 9"]:
        """H: derivative of h with respect to the errors of position, velocity and attitude."""

    def fixes(self, start: float, end: float) -> Float[np.ndarray, " F"]:
        """Times of all fixes of a run, those in outages included.

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
        """Which of the fixes lie outside the outages; the ends of an outage belong to it."""
        inside = [(times > a - _TOLERANCE) & (times < b + _TOLERANCE) for a, b in self.outages]
        return ~np.any(inside, axis=0) if inside else np.ones(len(times), dtype=bool)

    def draw(self, num: int, keys: Key[Array, " R"]) -> Float[Array, "F K R"]:
        """Noise of the first `num` fixes of each run."""
        streams = [jax.vmap(lambda k, i=i: jax.random.fold_in(k, i))(keys) for i in range(len(self.noise))]
        return jnp.stack([draw(m, num, k) for m, k in zip(self.noise, streams, strict=True)], axis=1)


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


def noises(name: str, given: Sequence[Any], believed: Sequence[Any] | None) -> tuple[tuple[NoiseModel, ...], Any]:
    """The emulated noise of each component, and the standard deviations the filter believes: those, if not given."""
    models = tuple(axis_noise(g, name) for g in given)
    sd = [white_sd(m) for m in models] if believed is None else [as_float(b) for b in believed]
    for value in sd:
        positive(f"{name}: a standard deviation that the filter believes", value)
    return models, jnp.stack(sd)
