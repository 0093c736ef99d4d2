"""Fixes: what an aiding sensor measured on a recorded run, and when."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from gmwm_jax._internal.checks import increasing, real_array
from gmwm_jax._internal.states import saved
from nav_jax.aiding.base import AbstractAiding, inside


@saved(added=("withheld",))
@dataclass(frozen=True, eq=False)
class Fixes:
    """The recorded measurements of an aiding sensor.

    Attributes
    ----------
    sensor
        Which kind, and with ``believed`` how good. Fixes in its outages are kept from the filter, and compared with
        what it says there; its rate is not used.
    time
        s, on the clock of the IMU, on or off its grid, shape (F,).
    value
        Shape (F, K), one column an axis of the sensor.
    covariance
        Of the noise of each fix, shape (F, K, K), in place of what the sensor believes; None where that holds for all.
    withheld
        Intervals (start, end) in s whose fixes, ends included, are kept from the filter as those in outages are.

    Raises
    ------
    ValueError
        No fix outside the outages, NaN, times that do not increase, another number of columns than the sensor has axes,
        a matrix that is no covariance.

    Examples
    --------
    >>> fixes = nj.Fixes(nj.Barometer(height=0.5), np.array([1.0, 2.0]), np.array([[100.0], [100.5]]))
    >>> fixes.value.shape
    (2, 1)
    """

    sensor: AbstractAiding
    time: Float64[np.ndarray, " F"]
    value: Float64[np.ndarray, "F K"]
    covariance: Float64[np.ndarray, "F K K"] | None = None
    withheld: tuple[tuple[float, float], ...] = ()

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
        if self.covariance is not None:
            C = real_array(f"The covariance of {name}", self.covariance, (len(time), value.shape[1], value.shape[1]))
            _check_covariances(name, time, C)
            object.__setattr__(self, "covariance", C)
        if not self.given.any():
            raise ValueError(f"All {len(time)} fixes of {name} lie in its outages: leave it out.")

    @property
    def given(self) -> Bool[np.ndarray, " F"]:
        """Which of the fixes the filter is given: those outside the outages."""
        return self.sensor.available(self.time) & ~inside(self.time, self.withheld)

    @property
    def outages(self) -> tuple[tuple[float, float], ...]:
        """Those of the sensor, and what is withheld, by their starts."""
        return tuple(sorted({*self.sensor.outages, *self.withheld}))


def _check_covariances(name: str, time: np.ndarray, C: np.ndarray) -> None:
    """Raise at the first that is not symmetric and positive definite."""
    sd = np.sqrt(np.maximum(np.diagonal(C, axis1=1, axis2=2), 0.0))
    scale = sd[:, :, None] * sd[:, None, :]
    bad = (sd == 0).any(axis=1) | (np.abs(C - C.transpose(0, 2, 1)) > 1e-9 * scale).any(axis=(1, 2))
    correlation = np.where(bad[:, None, None], np.eye(C.shape[1]), C / np.where(scale > 0, scale, 1.0))
    bad |= np.linalg.eigvalsh(correlation)[:, 0] <= 1e-9
    if bad.any():
        i = int(bad.argmax())
        raise ValueError(
            f"{bad.sum()} of {len(time)} covariances of {name} are not positive definite, the first at {time[i]:g} s: "
            f"{C[i].tolist()}. Do without the correlations (correlated=False of a GnssRecord), or state standard "
            "deviations."
        )
