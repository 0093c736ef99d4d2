"""Means of an IMU's samples about events, for sensors whose measurement depends on how the body accelerates.

One sample says what the body does and how it vibrates: 3 m/s^2 at 30 Hz are 2 mm, and drown the acceleration of a car.
Means over some tenths of a second do not. They are made on the host, before any loop, from samples on both sides of the
event; specific forces are turned to the axes that the body has at the event, by what the gyros say in between.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from gmwm_jax._internal.checks import as_float
from gmwm_jax._internal.compiling import compiled_quickly
from nav_jax.aiding.base import Window
from nav_jax.imu.imu import Imu
from nav_jax.kinematics.rotation import quat_from_rotvec, rotate_back


def window_means(imu: Imu, times: Float[np.ndarray, " M"], windows: Sequence[Window]) -> Float[Array, "M W ch"] | None:
    """Mean specific force (along b at the event) and mean body rate in windows about M events; None without windows.

    The first sample goes on before the record, the last one after it.
    """
    if not windows:
        return None
    return jnp.stack([_means(*_overlaps(imu, times, w), *_samples(imu)) for w in windows], axis=1)


def _samples(imu: Imu) -> tuple[Array, Array, Array]:
    """Specific forces, body rates, and the angles turned before each epoch."""
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(imu.gyro, axis=0) / imu.rate])
    return as_float(imu.accel), as_float(imu.gyro), as_float(turned)


def _overlaps(imu: Imu, times: Float[np.ndarray, " M"], window: Window) -> tuple[Array, Array, Array, Array]:
    """Of each event the samples in its window, their weights, their middles, and the event, in samples of the IMU."""
    at = (times - imu.time[0]) * imu.rate
    begin, end = (at + x * imu.rate for x in (window.begin, window.end))
    samples = np.floor(begin)[:, None] + np.arange(int(np.ceil((window.end - window.begin) * imu.rate)) + 2)
    low, high = (np.clip(s, begin[:, None], end[:, None]) for s in (samples, samples + 1))
    weight = ((high - begin[:, None]) ** 2 - (low - begin[:, None]) ** 2) if window.rises else high - low
    weight = weight / weight.sum(axis=1, keepdims=True)
    return as_float(samples), as_float(weight), as_float((low + high) / 2), as_float(at)


@compiled_quickly()
def _means(
    samples: Float[Array, "M n"],
    weight: Float[Array, "M n"],
    middle: Float[Array, "M n"],
    at: Float[Array, " M"],
    accel: Float[Array, "N 3"],
    gyro: Float[Array, "N 3"],
    turned: Float[Array, "E 3"],
) -> Float[Array, "M ch"]:
    """Weighted means; positions in time are in samples."""
    k = jnp.clip(samples.astype(int), 0, len(accel) - 1)

    def angle(x: Array) -> Array:
        epoch = jnp.clip(jnp.floor(x), 0.0, len(gyro) - 1.0)
        i = epoch.astype(int)
        return turned[i] + (x - epoch)[..., None] * (turned[i + 1] - turned[i])

    since = angle(at)[:, None] - angle(middle)
    force = rotate_back(quat_from_rotvec(jnp.moveaxis(since, -1, 0)), jnp.moveaxis(accel[k], -1, 0))
    return jnp.concatenate(
        [jnp.sum(weight[None] * force, axis=-1).T, jnp.sum(weight[..., None] * gyro[k], axis=1)], axis=1
    )
