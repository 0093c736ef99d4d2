"""GNSS: fixes of position and of velocity, three components, two of them horizontal."""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, noises, timing
from nav_jax.imu.noise_models import NoiseModel


class AbstractNed(AbstractAiding):
    """Fixes in north, east, down.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    horizontal, vertical
        Noise of north and east, and of down: a standard deviation in SI (white), or a model per sample at `rate`.
    outages
        Intervals (start, end) in s without fixes, ends included.
    first
        s after the start of the run, of the first fix; one period unless told otherwise.
    believed
        Standard deviations (horizontal, vertical) that the filter believes; those of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, an outage that is no interval.
    """

    axes: ClassVar[tuple[str, ...]] = ("n", "e", "d")
    default_name: ClassVar[str]

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        horizontal: Any,
        vertical: Any,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: tuple[Any, Any] | None = None,
        name: str | None = None,
    ):
        self.name = self.default_name if name is None else name
        self.rate, self.first, self.outages = timing(self.name, rate, first, outages)
        sd = None if believed is None else (believed[0], believed[0], believed[1])
        self.noise, self.believed = noises(self.name, (horizontal, horizontal, vertical), sd)


class GnssPosition(AbstractNed):
    """Position fixes in m, north, east, down; the parameters are those of `AbstractNed`."""

    unit: ClassVar[str] = "m"
    default_name: ClassVar[str] = "gnss_position"

    def predict(self, p, v):  # noqa: D102
        return p

    def jacobian(self):  # noqa: D102
        return jnp.eye(9)[0:3]


class GnssVelocity(AbstractNed):
    """Velocity fixes in m/s, north, east, down; the parameters are those of `AbstractNed`."""

    unit: ClassVar[str] = "m/s"
    default_name: ClassVar[str] = "gnss_velocity"

    def predict(self, p, v):  # noqa: D102
        return v

    def jacobian(self):  # noqa: D102
        return jnp.eye(9)[3:6]
