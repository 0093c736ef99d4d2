r"""From what an IMU senses to what it says: its bandwidth, its range and its least significant bit.

The errors of `ImuErrors` are those of the sensing element. What is behind it makes of its signal x = sensed + errors

    y = x behind a Butterworth low-pass of order two,   c = y clipped to the range,   o = c rounded to the step,

in this order, as an anti-alias filter stands before the converter whose range and step these are. The two limits are no
linear functions: an emulation applies them sample by sample, a covariance has white noise of step^2/12 per sample for
the rounding (Widrow & Kollar 2008, ch. 5; it wants noise of half a step in what is rounded) and nothing for the range.

Compared with others. The model equations of IEEE Std 952-1997 and 1293-2018 have input, environment and drift in one
sum, of which quantisation is a part, and all of it passes the error of the scale factor. Simulators with a flow chart
have misalignment, a limit, bias, noise, scale and last the quantisation. Here bias and noise do not pass scale and
misalignment: a difference of second order, the product of two errors, for which all sources of error remain a sum that
a covariance can take apart. And the limit stands behind bias and noise, which a converter does not know apart from what
is sensed: no reading exceeds the range.
"""

import warnings
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import as_float, concrete
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.imu import Imu


class SaturationWarning(UserWarning):
    """A warning that a motion leaves the range of an IMU, of which a covariance knows nothing."""


class Memory(NamedTuple):
    """What an output keeps from sample to sample; None what it has no use for."""

    first: Float[Array, "ch R"] | None
    second: Float[Array, "ch R"] | None
    """States of the low-pass."""
    left: Float[Array, "ch R"] | None
    """Of increments: what the last rounding has left over."""


class Output(eqx.Module):
    """Bandwidth, range and step of an IMU.

    Parameters
    ----------
    accel_range, gyro_range
        Largest reading (m/s^2, rad/s) of either sign.
    accel_step, gyro_step
        Least significant bit: of a rate (m/s^2, rad/s), or of an increment (m/s, rad).
    accel_bandwidth, gyro_bandwidth
        Frequency in Hz at which the power is halved. One that is half the sampling rate or above has no effect.
    increments
        Readings are integrals over a sample, and what a rounding leaves over goes into the next: their sum is never off
        by more than half a step, and the error is quantisation noise, `gmwm_jax.QN`. Else each reading is rounded by
        itself.

    Each is one number or three (x, y, z). Ranges and bandwidths are infinite and steps zero where there is none.

    Raises
    ------
    ValueError
        A range or bandwidth that is not positive, a negative step, NaN, another number of them.

    Notes
    -----
    A gradient goes through rounding as if there was none: that of the mean, where noise exceeds half a step.

    Examples
    --------
    >>> output = nj.imu.Output(gyro_range=np.radians(300.0), gyro_step=np.radians(0.05))
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-6)", rate=100.0, output=output)
    >>> bool(errors.bank().white[3] > 1e-6)  # in a covariance, rounding is white noise
    True
    """

    range: Float[Array, " ch"]
    step: Float[Array, " ch"]
    bandwidth: Float[Array, " ch"]
    increments: bool = eqx.field(static=True)
    is_limited: bool = eqx.field(static=True)
    is_rounded: bool = eqx.field(static=True)
    is_filtered: bool = eqx.field(static=True)

    def __init__(
        self,
        *,
        accel_range: Any = np.inf,
        gyro_range: Any = np.inf,
        accel_step: Any = 0.0,
        gyro_step: Any = 0.0,
        accel_bandwidth: Any = np.inf,
        gyro_bandwidth: Any = np.inf,
        increments: bool = False,
    ):
        self.range = _six("range", accel_range, gyro_range, zero_ok=False)
        self.step = _six("step", accel_step, gyro_step, zero_ok=True)
        self.bandwidth = _six("bandwidth", accel_bandwidth, gyro_bandwidth, zero_ok=False)
        if (seen := concrete(self.step)) is not None and not np.isfinite(seen).all():
            raise ValueError(f"Output: a step is finite, and these are {seen}.")
        self.increments = bool(increments)
        # of a traced number nobody knows whether it is one
        self.is_limited = _any(self.range, np.isfinite)
        self.is_rounded = _any(self.step, lambda step: step > 0)
        self.is_filtered = _any(self.bandwidth, np.isfinite)

    def begin(self, first: Float[Array, "ch R"], rate: Real) -> Memory:
        """The memory before a first sample that has lasted for ever; of increments, before any."""
        states: tuple[Any, Any] = (None, None)
        if self.is_filtered:
            b, a = self._filter(rate)
            second = (b[2] - a[2]) * first
            states = (b[1] - a[1]) * first + second, second
        return Memory(*states, jnp.zeros_like(first) if self.is_rounded and self.increments else None)

    def read(self, memory: Memory, x: Float[Array, "ch R"], rate: Real) -> tuple[Memory, Float[Array, "ch R"]]:
        """What is said of a sample, and the memory after it."""
        first, second, left = memory
        if first is not None and second is not None:
            b, a = self._filter(rate)
            y = b[0] * x + first
            first, second, x = b[1] * x - a[1] * y + second, b[2] * x - a[2] * y, y
        if self.is_limited:
            x = jnp.clip(x, -self.range[:, None], self.range[:, None])
        if self.is_rounded:
            step = self.step[:, None] * (rate if self.increments else 1.0)
            whole = x if left is None else x + left
            x = _rounded(whole, step)
            left = None if left is None else jax.lax.stop_gradient(jnp.where(step > 0, whole - x, 0.0))
        return Memory(first, second, left), x

    def rounding(self, rate: Real) -> Float[Array, " ch"] | Float[np.ndarray, " ch"]:
        """Variance of one rounding, as a rate, of each channel."""
        (step,) = known(self.step)
        return (step * (rate if self.increments else 1.0)) ** 2 / 12

    def notes(self) -> tuple[str, ...]:
        """Return what a covariance has in its place, in a sentence each."""
        return (
            *("Rounding is noise of step^2/12 in covariances.",) * self.is_rounded,
            *("The range has no place in covariances.",) * self.is_limited,
            *("The bandwidth has no place in covariances, which are of what is slower.",) * self.is_filtered,
        )

    def _filter(self, rate: Real) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Coefficients of numerator and denominator, (ch, 1) each: bilinear, with the bandwidth where it was."""
        passes = self.bandwidth >= rate / 2
        k = jnp.tan(jnp.pi * jnp.where(passes, rate / 4, self.bandwidth) / rate)
        all_of_it = 1 + jnp.sqrt(2.0) * k + k * k
        b, a1, a2 = k * k / all_of_it, 2 * (k * k - 1) / all_of_it, (1 - jnp.sqrt(2.0) * k + k * k) / all_of_it
        one, none = jnp.ones_like(k), jnp.zeros_like(k)
        b0, b1, b2, a1, a2 = (
            jnp.where(passes, through, c)[:, None]
            for c, through in ((b, one), (2 * b, none), (b, none), (a1, none), (a2, none))
        )
        return (b0, b1, b2), (jnp.ones_like(b0), a1, a2)

    def __repr__(self) -> str:
        names = {"range": self.is_limited, "step": self.is_rounded, "bandwidth": self.is_filtered}
        parts = []
        for name, there in names.items():
            if there and (values := concrete(getattr(self, name))) is not None:
                parts.append(f"{name} accel {values[:3]}, gyro {values[3:]}")
        return f"Output of {'increments' if self.increments else 'rates'}: {'; '.join(parts) or 'as it is sensed'}"


def warn_of_range(output: Output | None, imu: Imu) -> None:
    """Warn if perfect samples leave the range, before a covariance is computed."""
    if output is None or not output.is_limited:
        return
    most = np.abs(np.concatenate([imu.accel, imu.gyro], axis=1)).max(axis=0)
    beyond = [
        f"{channel} {seen:.3g} (range {limit:.3g})"
        for channel, seen, limit in zip(CHANNELS, most, np.asarray(output.range), strict=True)
        if seen >= limit
    ]
    if beyond:
        warnings.warn(
            f"The reference reaches the range of the IMU: {', '.join(beyond)}, in SI. A covariance does not know it: "
            "its numbers are too small. Run a Monte Carlo, take a sensor with more range, or a calmer motion.",
            SaturationWarning,
            stacklevel=3,
        )


def _rounded(x: Float[Array, "ch R"], step: Float[Array, "ch 1"]) -> Float[Array, "ch R"]:
    """The nearest multiples; with the derivative of x by x, and what has been added by the step."""
    there = step > 0
    size = jnp.where(there, step, 1.0)
    steps = x / size
    return x + jnp.where(there, size * jax.lax.stop_gradient(jnp.round(steps) - steps), 0.0)


def _any(values: Any, of: Any) -> bool:
    seen = concrete(values)
    return True if seen is None else bool(np.any(of(seen)))


def _six(name: str, accel: Any, gyro: Any, *, zero_ok: bool) -> Float[Array, " ch"]:
    parts = []
    for sensor, value in (("accel", accel), ("gyro", gyro)):
        seen = concrete(value)
        if seen is not None and not np.all(seen >= 0 if zero_ok else seen > 0):
            kind = "zero or positive" if zero_ok else "positive"
            raise ValueError(f"Output: {sensor}_{name} must be {kind}, and is {seen}.")
        if np.shape(value) not in ((), (3,)):
            raise ValueError(f"Output: {sensor}_{name} is one number or three, and is {value!r}.")
        parts.append(as_float(value))
    parts = known(*parts)
    xp = namespace(*parts)
    return as_float(xp.concatenate([xp.broadcast_to(part, (3,)) for part in parts]))


class _State(NamedTuple):
    range: Float64[np.ndarray, "6"]
    step: Float64[np.ndarray, "6"]
    bandwidth: Float64[np.ndarray, "6"]
    increments: bool


def _to_state(output: Output) -> _State:
    limit, step, band = (np.asarray(a) for a in (output.range, output.step, output.bandwidth))
    return _State(limit, step, band, output.increments)


def _from_state(state: _State) -> Output:
    by_sensor = {
        f"{sensor}_{name}": getattr(state, name)[first : first + 3]
        for sensor, first in (("accel", 0), ("gyro", 3))
        for name in ("range", "step", "bandwidth")
    }
    return Output(**by_sensor, increments=state.increments)


register(Output, _State, _to_state, _from_state, not_finite=("range", "bandwidth"))
