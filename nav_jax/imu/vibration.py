"""White noise that grows with vibration: what a static recording does not show of an IMU.

Vibration rectifies, aliases and excites errors of scale, so that an IMU on a car has ten times the white noise that it
has on a table. Nearly proportional to the variance of its samples, it is

    q = q_0 + kappa var / f,    var: variance of the samples of an axis over a window, f: rate

with the density q_0 of the model and a factor kappa without a unit, of 0.01 to 1: all of the samples' variance as white
noise would be kappa = 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import Real
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.imu import Imu


@saved()
@dataclass(frozen=True)
class VibrationNoise:
    """How much of the variance of its samples is white noise of an IMU.

    Attributes
    ----------
    accel, gyro
        kappa of each sensor, or of its axes x, y, z; 0 for none.
    window
        s, over which variances are taken, about each sample.

    Raises
    ------
    ValueError
        A negative factor, or a window that is not positive.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.static(duration=2.0, rate=20.0))
    >>> nj.imu.VibrationNoise(accel=0.1, gyro=0.1).densities(samples).shape  # of six channels; zero: nothing vibrates
    (40, 6)
    """

    accel: Real | Sequence[Real] = 0.1
    gyro: Real | Sequence[Real] = 0.1
    window: Real = 0.25

    def __post_init__(self) -> None:
        for name in ("accel", "gyro"):
            given, label = getattr(self, name), f"VibrationNoise: {name}"
            axes = np.ravel(given)
            if np.ndim(given) and np.shape(given) != (3,):
                raise ValueError(
                    f"{label} is one factor or three, of the axes x, y, z; this has shape {np.shape(given)}."
                )
            factors = tuple(number(label, x, zero_ok=True) for x in axes)
            object.__setattr__(self, name, factors if np.ndim(given) else factors[0])
        object.__setattr__(self, "window", number("VibrationNoise: window", self.window))

    def densities(self, imu: Imu) -> Float64[np.ndarray, "N ch"]:
        """Return the density of this noise at each sample, (m/s^2)^2/Hz and (rad/s)^2/Hz, channels x, y, z each."""
        factor = np.concatenate([np.broadcast_to(of, len(CHANNELS) // 2) for of in (self.accel, self.gyro)])
        samples = np.concatenate([imu.accel, imu.gyro], axis=1)
        return factor * running_variance(samples, round(self.window * imu.rate)) / imu.rate


def running_variance(x: Float64[np.ndarray, "N ch"], width: int) -> Float64[np.ndarray, "N ch"]:
    """Variance over so many samples about each, of fewer at the ends; zero for a single sample."""
    num = len(x)
    first = np.clip(np.arange(num) - width // 2, 0, None)
    last = np.clip(np.arange(num) - width // 2 + max(width, 1), None, num)
    count = (last - first)[:, None]
    # about the mean of all, which leaves more digits to the differences of sums
    x = x - x.mean(axis=0)
    total, squares = (np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(y, axis=0)]) for y in (x, x * x))
    mean = (total[last] - total[first]) / count
    return np.maximum((squares[last] - squares[first]) / count - mean**2, 0.0)
