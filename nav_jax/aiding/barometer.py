"""Barometric height."""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, noises, timing
from nav_jax.imu.noise_models import NoiseModel


class Barometer(AbstractAiding):
    """Height above the origin, -p_D.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    height
        Noise: a standard deviation in m (white), or a model per sample at `rate`.
    outages
        Intervals (start, end) in s without readings, ends included.
    first
        s after the start of the run, of the first reading; one period unless told otherwise.
    believed
        Standard deviation in m that the filter believes; that of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, an outage that is no interval.
    """

    axes: ClassVar[tuple[str, ...]] = ("height",)
    unit: ClassVar[str] = "m"

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "1"]
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        height: Any,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "barometer",
    ):
        self.name = name
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.noise, self.believed = noises(name, (height,), None if believed is None else (believed,))

    def predict(self, p, v):  # noqa: D102
        return -p[2:3]

    def jacobian(self):  # noqa: D102
        return -jnp.eye(9)[2:3]
