"""A window of a moving record as a least-squares problem: what samples and fixes say of its attitude.

In axes that do not turn and were those of n at the beginning of the window, into which R(t) = exp([w x] t) leads n,

    R v + int R (w x v - g) = v_0 + C_0 beta,   beta = int D f,   D' = D [omega x],   D(0) = 1

holds exactly: fixes make the left side, samples make beta and D, and C_0 is the attitude at the beginning (Wu and Pan
2013, whose n turns with the vehicle, where ours is fixed to the Earth). One integral more leads to positions,

    R p + int (int R (w x v - g) - R (w x p)) = p_0 + v_0 t + C_0 gamma,   gamma = int beta.

An antenna at l in the body adds D l to gamma, and its derivative to beta. What is 7e-5 rad/s times an error of the
fixes or times the lever arm is left out.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float64

from gmwm_jax._internal.typing import FloatLike
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.strapdown import integrate

_HALF = 0.05
"""s, to both sides, over which the velocity of an antenna on its arm is a mean: gyros vibrate."""

Array = np.ndarray
FloatArray = Float[jax.Array, "..."]


class Motion(NamedTuple):
    """What samples say, at N + 1 epochs, in axes that do not turn and were those of the body at the first of them."""

    time: Float64[np.ndarray, " N"]
    """From the first epoch, s."""
    turned: Float64[np.ndarray, "N 3 3"]
    """D, from b."""
    beta: Float64[np.ndarray, "N 3"]
    """Integral of the specific force, m/s."""
    gamma: Float64[np.ndarray, "N 3"]
    """And that of it, m."""


class Known(NamedTuple):
    """What the Earth and the fixes say, at the epochs: left sides are R z + added."""

    turned: Float64[np.ndarray, "N 3 3"]
    """R, from n."""
    added: tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]
    """To velocities and to positions."""


class Rows(NamedTuple):
    """K vectors that are linear in what is unknown, three rows each; signs are those of truth - estimate."""

    value: Float64[np.ndarray, "K 3"]
    """C_0 times beta or gamma."""
    slope: Float64[np.ndarray, "K 3 unknown"]
    """By attitude, v_0, p_0, biases of accelerometers and gyros."""
    kicks: Float64[np.ndarray, "K 3 kicks"]
    """By what noise turns and pushes between the fixes, gyros first."""


class Kicks(NamedTuple):
    """The noise of the samples as one turn and one push in the middle of each interval between fixes."""

    time: Float64[np.ndarray, " J"]
    beta: Float64[np.ndarray, "J 3"]
    gamma: Float64[np.ndarray, "J 3"]


def skew(v: Float64[np.ndarray, "... 3"]) -> Float64[np.ndarray, "... 3 3"]:
    """The matrices of vector products with v from the left."""
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def at(time: Array, values: Array, when: Array) -> Array:
    """Between epochs, component by component."""
    flat = values.reshape(len(values), -1)
    return np.column_stack([np.interp(when, time, x) for x in flat.T]).reshape(len(when), *values.shape[1:])


def integral(time: Array, values: Array) -> Array:
    """From the first time on, by trapezia."""
    steps = np.diff(time).reshape(-1, *(1,) * (values.ndim - 1))
    areas = 0.5 * steps * (values[1:] + values[:-1])
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(areas, axis=0)])


def motion(imu: Imu, accel_bias: Array, gyro_bias: Array) -> Motion:
    """Integrate samples less their biases."""
    samples = jnp.asarray(imu.gyro - gyro_bias), jnp.asarray(imu.accel - accel_bias)
    turned, beta, gamma = (np.asarray(x) for x in _integrated(*samples, 1 / imu.rate))
    return Motion(imu.epochs - imu.epochs[0], turned, beta, gamma)


@jax.jit
def _integrated(gyro: FloatArray, accel: FloatArray, dt: FloatLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    zero, straight = jnp.zeros(3), jnp.array([1.0, 0.0, 0.0, 0.0])
    gamma, beta, q = integrate(zero, zero, straight, gyro, accel, jnp.full(len(gyro), dt), FlatEarth(0.0))
    return jnp.moveaxis(rotation.dcm_from_quat(q.T), -1, 0), beta, gamma


@jax.jit
def matrices(rotvec: FloatArray) -> FloatArray:
    """The matrices (..., 3, 3) of rotation vectors (3, ...)."""
    return jnp.moveaxis(rotation.dcm_from_quat(rotation.quat_from_rotvec(rotvec)), (0, 1), (-2, -1))


def known(
    time: Array,
    position: Float64[np.ndarray, "N 3"],
    velocity: Float64[np.ndarray, "N 3"],
    first: Array,
    earth: AbstractEarth,
) -> Known:
    """Integrate what the Earth adds along positions and velocities in n, the former about the first fix."""
    g = np.asarray(earth.gravity_n(jnp.asarray(position.T))).T
    w = np.asarray(earth.rate_n(jnp.asarray(first)))
    turned = np.asarray(matrices(jnp.asarray(w[:, None] * time)))
    to_velocity = integral(time, np.einsum("nij,nj->ni", turned, np.cross(w, velocity) - g))
    sideways = np.einsum("nij,nj->ni", turned, np.cross(w, position - first))
    return Known(turned, (to_velocity, integral(time, to_velocity - sideways)))


def kicks(m: Motion, when: Array) -> Kicks:
    """Those in the middle between epochs that are given."""
    middle = 0.5 * (when[1:] + when[:-1])
    return Kicks(middle, at(m.time, m.beta, middle), at(m.time, m.gamma, middle))


def rows(m: Motion, C: Array, when: Array, arm: Array, noise: Kicks, *, positions: bool, place: bool) -> Rows:
    """Of velocities or positions at some times.

    Parameters
    ----------
    m
        Of the samples.
    C
        Attitude at the beginning, (3, 3).
    when
        s, shape (K,).
    arm
        From the IMU to what moves so, in b, m.
    noise
        Where the kicks are.
    positions
        Or velocities.
    place
        Whether p_0 is among what is unknown.
    """
    over = m.turned @ arm  # D l
    D, G = m.turned, integral(m.time, m.turned)
    middle = 0.5 * (G[1:] + G[:-1])
    K = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(skew(np.diff(m.beta, axis=0)) @ middle, axis=0)])
    if positions:
        value = at(m.time, m.gamma + over, when)
        by_accel = at(m.time, integral(m.time, G), when)
        by_gyro = at(m.time, integral(m.time, K) + skew(over) @ G, when)
        steady = [when, np.ones(len(when))]
    else:
        ends = [np.clip(when + h, m.time[0], m.time[-1]) for h in (_HALF, -_HALF)]
        swing = (at(m.time, over, ends[0]) - at(m.time, over, ends[1])) / (ends[0] - ends[1])[:, None]
        value = at(m.time, m.beta, when) + swing
        by_accel = at(m.time, G, when)
        by_gyro = at(m.time, K + D @ skew(arm), when) + skew(swing) @ by_accel
        steady = [np.ones(len(when)), np.zeros(len(when))]
    eye = np.eye(3)
    columns = [-skew(value @ C.T), *(s[:, None, None] * eye for s in steady[: 1 + place]), -C @ by_accel, C @ by_gyro]
    since = when[:, None] - noise.time
    after = since > 0
    moved = noise.gamma + noise.beta * since[..., None] if positions else noise.beta
    turns = -skew((value[:, None] - moved) @ C.T) * after[..., None, None]
    pushes = (since if positions else 1.0) * after
    parts = [turns, pushes[..., None, None] * eye]
    flat = [np.moveaxis(x, 1, 2).reshape(len(when), 3, -1) for x in parts]
    return Rows(value @ C.T, np.concatenate(columns, axis=-1), np.concatenate(flat, axis=-1))


def attitude_rows(m: Motion, C: Array, num_kicks: int, *, place: bool) -> Rows:
    """Of the attitude at the last epoch, as one vector."""
    zero, eye = np.zeros((3, 3)), np.eye(3)
    G = integral(m.time, m.turned)[-1]
    slope = np.concatenate([eye, *[zero] * (2 + place), -C @ G], axis=1)
    turned = np.concatenate([np.tile(eye, num_kicks), np.zeros((3, 3 * num_kicks))], axis=1)
    return Rows(np.zeros((1, 3)), slope[None], turned[None])
