"""Fixes: what an aiding sensor measured on a recorded run, and when."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import increasing, real_array
from nav_jax.aiding.base import AbstractAiding


@dataclass(frozen=True, eq=False)
class Fixes:
    """The recorded measurements of an aiding sensor.

    Attributes
    ----------
    sensor
        Which kind, and with ``believed`` how good; its rate and outages are not used.
    time
        s, on the clock of the IMU, on or off its grid, shape (F,).
    value
        Shape (F, K), one column an axis of the sensor.

    Raises
    ------
    ValueError
        No fix, NaN, times that do not increase, another number of columns than the sensor has axes.

    Examples
    --------
    >>> fixes = nj.Fixes(nj.Barometer(height=0.5), np.array([1.0, 2.0]), np.array([[100.0], [100.5]]))
    >>> fixes.value.shape
    (2, 1)
    """

    sensor: AbstractAiding
    time: Float64[np.ndarray, " F"]
    value: Float64[np.ndarray, "F K"]

    def __post_init__(self) -> None:
        name = self.sensor.name
        time = real_array(f"The time of {name}", self.time, (None,))
        if not len(time):
            raise ValueError(f"{name} has no fix: leave it out.")
        if len(time) > 1:
            increasing(f"The time of {name}", time)
        value = real_array(f"{name} ({', '.join(self.sensor.axes)})", self.value, (len(time), len(self.sensor.axes)))
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "value", value)
