"""The perfect IMU of a trajectory: body rates and specific forces from which the mechanisation returns it."""

import warnings
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.checks import as_float, increasing, real_array, require_x64, sampling_rate
from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.programs import bounded
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real, Scalar, Times, Vectors
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.rotation import SMALL_ROTATION
from nav_jax.trajectory.trajectory import Trajectory

_UNEVEN = 0.01
"""A step of time may differ by this fraction from 1 / rate: clocks jitter, and a missing sample shows."""

_PLAUSIBLE = 0.3
"""Specific force noise in m/s^2 (30 mg) that no motion of a vehicle has from sample to sample."""

_ALTERNATES = -0.3
"""Correlation of successive changes below which a series is noise: -0.5 for white noise, positive for motion."""

_ROUNDS = 3
"""Each multiplies the error of the mechanised velocity by the square of frequency times interval, or so."""


class NoisyReferenceWarning(UserWarning):
    """A warning that the positions of a reference are too noisy to be differentiated twice."""


@dataclass(frozen=True, eq=False, repr=False)
class Imu:
    """The samples of an IMU. Sample k holds from ``time[k]`` to the next, so that N samples span N + 1 epochs.

    Attributes
    ----------
    time
        Beginning of each sample in s, in even steps, shape (N,).
    gyro
        Body rate in rad/s, front, right, down, shape (N, 3).
    accel
        Specific force in m/s^2, front, right, down, shape (N, 3); at rest it is minus gravity.
    rate
        In Hz.
    temperature
        Of the IMU in K or deg C, shape (N,), for what depends on how it changes, see `nav_jax.imu.TemperatureBias`;
        None where nobody has measured it.

    Raises
    ------
    ValueError
        Shapes that do not match, NaN or infinite samples, time that does not increase or has a step that is more than
        1 % off 1 / rate.

    Examples
    --------
    >>> time = np.arange(0.0, 10.0, 0.05)
    >>> rest = np.broadcast_to([0.0, 0.0, -9.80665], (200, 3))
    >>> imu = nj.Imu(time, np.zeros((200, 3)), rest, 20.0)
    >>> imu.duration
    10.0
    """

    time: Times
    gyro: Vectors
    accel: Vectors
    rate: float
    temperature: Times | None = None

    def __post_init__(self) -> None:
        time = real_array("The time of an IMU", self.time, (None,))
        increasing("The time of an IMU", time)
        rate = sampling_rate(self.rate)
        _check_even(time, rate)
        arrays: dict[str, Any] = {"time": time, "rate": rate}
        for field in ("gyro", "accel"):
            arrays[field] = real_array(f"The {field} of an IMU", getattr(self, field), (len(time), 3))
        if self.temperature is not None:
            arrays["temperature"] = real_array("The temperature of an IMU", self.temperature, (len(time),))
        for field, value in arrays.items():
            object.__setattr__(self, field, value)

    def part(self, first: int, last: int) -> "Imu":
        """Return the samples from one to before another, by their numbers."""
        warm = None if self.temperature is None else self.temperature[first:last]
        return Imu(self.time[first:last], self.gyro[first:last], self.accel[first:last], self.rate, warm)

    @property
    def duration(self) -> float:
        """Seconds from the beginning of the first sample to the end of the last: N / rate."""
        return len(self) / self.rate

    @property
    def epochs(self) -> Float64[np.ndarray, " epochs"]:
        """Beginning of each sample and end of the last, in s, shape (N+1,)."""
        return np.append(self.time, self.time[-1] + 1 / self.rate)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        rows = [
            [f"{name} {axis}", unit, *(f"{v:.5g}" for v in (x.mean(), x.std(), x.min(), x.max()))]
            for name, unit, data in (("gyro", "rad/s", self.gyro), ("accel", "m/s^2", self.accel))
            for axis, x in zip("xyz", data.T, strict=True)
        ]
        if self.temperature is not None:
            T = self.temperature
            rows.append(["temperature", "K, deg C", *(f"{v:.5g}" for v in (T.mean(), T.std(), T.min(), T.max()))])
        title = f"Imu: {len(self)} samples at {self.rate:g} Hz, {self.duration:g} s from {self.time[0]:g} s"
        return f"{title}\n{format_table(['', 'unit', 'mean', 'std', 'least', 'most'], rows, left=2)}"


def perfect_imu(
    trajectory: Trajectory, rate: Real | None = None, earth: AbstractEarth | None = None
) -> tuple[Imu, Trajectory]:
    """Compute the samples that lead along a trajectory, and the trajectory that the mechanisation returns.

    Body rates turn one attitude into the next exactly. Specific forces lead the *mechanised velocity* from epoch to
    epoch: the velocity for which the steps, with their constant specific force, end at the positions of the reference.
    It differs from the reference's by dt^2/12 times the rate of the specific force in b and higher terms
    (Euler-Maclaurin), about 1e-5 m/s for vehicles at 100 Hz, and is found by correcting it with what the steps miss.

    Parameters
    ----------
    trajectory
        The reference.
    rate
        Of the IMU in Hz; that of the trajectory unless given. The trajectory is resampled if its rate is another or its
        steps are uneven.
    earth
        Gives gravity and its rate; a `FlatEarth` unless given.

    Returns
    -------
    The IMU with N samples, and the trajectory of N + 1 epochs that the mechanisation makes of them without noise: a
    filter without errors returns it to rounding. For smooth motion at 100 Hz it agrees with the reference to 1e-8 m.

    Raises
    ------
    ValueError
        A turn of more than 1.5 rad in a sample; a rate that leaves fewer than two samples.

    Warns
    -----
    NoisyReferenceWarning
        The specific force has noise that no vehicle has: the positions are quantised or noisy.

    Examples
    --------
    >>> imu, exact = nj.perfect_imu(nj.motions.static(duration=10.0, rate=20.0))
    >>> imu.accel[0].round(5).tolist()  # specific force: at rest, minus gravity
    [0.0, 0.0, -9.80665]
    """
    require_x64()
    f = trajectory.rate if rate is None else sampling_rate(rate)
    reference = trajectory if f == trajectory.rate and trajectory.is_even else trajectory.resampled(f)
    if len(reference) < 3:
        raise ValueError(f"At {f:g} Hz an IMU has {len(reference) - 1} sample of this trajectory, and needs two.")
    arrays = (x.T for x in (reference.position, reference.velocity, reference.quaternion))
    solved = _solve(*arrays, as_float(1 / f), FlatEarth() if earth is None else earth)
    gyro, accel, position, velocity = (np.asarray(x).T for x in solved)
    _check_turns(gyro / f, reference.time)
    _warn_of_noise(accel)
    imu = Imu(reference.time[:-1], gyro, accel, f)
    return imu, Trajectory(reference.time, position, velocity, reference.quaternion, trajectory.name, trajectory.origin)


@bounded
@compiled_quickly()
def _solve(
    p: Float[Array, "3 epochs"],
    v: Float[Array, "3 epochs"],
    q: Float[Array, "4 epochs"],
    dt: Scalar,
    earth: AbstractEarth,
) -> tuple[Array, Array, Array, Array]:
    """Body rates and specific forces (3, N), and the positions and velocities (3, N+1) that they lead to."""
    before = q[:, :-1]
    rate_n = earth.rate_n(p[:, :-1]) if earth.is_turning else None
    theta = strapdown.rotation_between(before, q[:, 1:], dt, rate_n)
    omega = theta / dt

    def forces(p: Array, v: Array) -> tuple[Array, Array]:
        """And the gravity that is met."""
        g_n = earth.gravity_n(p[:, :-1] + dt / 2 * v[:, :-1])
        return strapdown.force_between(before, theta, v[:, :-1], v[:, 1:], dt, g_n, rate_n), g_n

    def moved(v: Array) -> Array:
        """All steps at once: each begins at the attitude of the reference, which the body rates reach exactly."""
        f, g_n = forces(p, v)
        return strapdown.step(jnp.zeros_like(g_n), v[:, :-1], before, omega, f, dt, g_n, rate_n)[0]

    def correct(_: Any, v: Array) -> Array:
        return v + _at_epochs((p[:, 1:] - p[:, :-1] - moved(v)) / dt)

    v = jax.lax.fori_loop(0, _ROUNDS, correct, v)
    position = jnp.cumsum(jnp.concatenate([p[:, :1], moved(v)], axis=1), axis=1)
    # with the gravity that the mechanisation will meet
    return omega, forces(position, v)[0], position, v


def _at_epochs(mean: Float[Array, "3 steps"]) -> Float[Array, "3 epochs"]:
    """Values at the epochs of a smooth series of means over steps, taken as values in their middle.

    Interpolates to fourth order, at the ends to second. Noise that alternates from step to step becomes zero and is not
    amplified.
    """
    inner = 0.5 * (mean[:, 1:] + mean[:, :-1])
    if mean.shape[1] > 3:
        sharper = (mean[:, 1:-2] + mean[:, 2:-1] - mean[:, :-3] - mean[:, 3:]) / 16
        inner = inner.at[:, 1:-1].add(sharper)
    first, last = (1.5 * mean[:, i] - 0.5 * mean[:, j] for i, j in ((0, 1), (-1, -2)))
    return jnp.concatenate([first[:, None], inner, last[:, None]], axis=1)


def _check_turns(theta: np.ndarray, time: np.ndarray) -> None:
    angle = np.linalg.norm(theta, axis=1)
    if angle.max() > SMALL_ROTATION:
        i = int((angle > SMALL_ROTATION).argmax())
        raise ValueError(
            f"Between {time[i]:.6g} s and {time[i + 1]:.6g} s the attitude turns by {np.degrees(angle[i]):.4g} deg, "
            f"and a sample may have {np.degrees(SMALL_ROTATION):.3g} deg: raise the rate, or mend the attitude there "
            "(degrees for radians, an angle of another convention)."
        )


def _check_even(time: np.ndarray, rate: Real) -> None:
    off = np.abs(np.diff(time) * rate - 1)
    if off.max() > _UNEVEN:
        i = int((off > _UNEVEN).argmax())
        raise ValueError(
            f"The step of time from {time[i]:.9g} to {time[i + 1]:.9g} s (index {i}) is no sample of {rate:g} Hz. "
            "Samples are missing there, or the rate is another; an IMU has even steps."
        )


def _warn_of_noise(accel: np.ndarray) -> None:
    changes = np.diff(accel, axis=0)
    if len(changes) < 10:
        return
    spread = np.median(np.abs(np.diff(changes, axis=0)), axis=0) / (0.6745 * np.sqrt(6))
    scatter = changes - changes.mean(axis=0)
    power = (scatter**2).sum(axis=0)
    together = (scatter[1:] * scatter[:-1]).sum(axis=0) / np.where(power > 0, power, 1.0)
    noisy = (spread > _PLAUSIBLE) & (together < _ALTERNATES)
    if noisy.any():
        listed = ", ".join(f"{axis} {s:.2g}" for axis, s in zip("xyz", spread, strict=True))
        warnings.warn(
            f"The specific force along this trajectory has noise of {listed} m/s^2 from sample to sample, and peaks of "
            f"{np.abs(accel).max():.3g} m/s^2: the positions are quantised or noisy, and two derivatives amplify that. "
            "Smooth them first, as in trajectory.smoothed(0.5), or use a lower rate.",
            NoisyReferenceWarning,
            stacklevel=3,
        )
