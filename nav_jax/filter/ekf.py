"""Propagate, update, inject: the error-state extended Kalman filter as pure functions, runs as the last axis.

The estimate is a position, a velocity, a quaternion and the sensor states; the covariance is that of the error, with
the attitude error as a rotation vector in n (Solà 2017, global error). Updates take one scalar after the other, in
Joseph's form, which keeps a covariance symmetric and positive for whatever gain rounding leaves (Bierman 1977).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from nav_jax.filter.error_model import Motion
from nav_jax.filter.layout import ATTITUDE, NAVIGATION, POSITION, VELOCITY
from nav_jax.imu.bank import SensorBank
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.earth import EarthInLoops, Pull
from nav_jax.kinematics.linalg import root, symmetrise
from nav_jax.kinematics.rotation import dcm_from_quat, quat_from_rotvec, quat_multiply
from nav_jax.kinematics.state import NavState


class Update(NamedTuple):
    """What an update did, for each of K scalars in turn."""

    gain: Float[Array, "K n Q"]
    """0 where there was no measurement."""
    variance: Float[Array, "K Q"]
    """Of the innovation."""


def mechanise(
    state: NavState,
    imu: Float[Array, "n seen R"],
    dt: Float[Array, " n"],
    ends: Float[Array, " n"],
    bank: SensorBank,
    earth: EarthInLoops,
    pull: Pull | None,
) -> NavState:
    """Advance the estimate by the n pieces of one covariance step, without the covariance."""
    for i in range(len(dt)):
        state, _, _ = _piece(state, imu[i], dt[i], ends[i], bank, earth, pull)
    return state


def mechanise_with_motion(
    state: NavState,
    imu: Float[Array, "n seen R"],
    dt: Float[Array, " n"],
    ends: Float[Array, " n"],
    bank: SensorBank,
    earth: EarthInLoops,
    pull: Pull | None,
    *,
    with_all: bool = False,
) -> tuple[NavState, Motion]:
    """Advance the estimate by one covariance step, and sum up the motion over it.

    The pull is that of gravity somewhere near, None where that is the same everywhere; the mean reading and the
    distance are parts of the motion where the bank depends on them, or on demand.
    """
    with_reading, with_distance = with_all or bank.depends, with_all or bank.travel is not None
    T, C = jnp.sum(dt), dcm_from_quat(state.q)
    zero = jnp.zeros_like(state.v)

    def piece(carry, inputs):
        state, C, C_sum, reading, distance, S_1, S_2 = carry
        sample, length, end = inputs
        distance = None if distance is None else distance + travelled(state.v, length)
        state, sensed, (once, twice) = _piece(state, sample, length, end, bank, earth, pull)
        C_next = dcm_from_quat(state.q)
        reading = None if reading is None else reading + length * sensed
        S_1, S_2 = S_1 + once, S_2 + length * S_1 + twice
        return (state, C_next, C_sum + length / 2 * (C + C_next), reading, distance, S_1, S_2), None

    reading = jnp.zeros(imu.shape[1:]) if with_reading else None
    distance = jnp.zeros(state.p.shape[1]) if with_distance else None
    carry = (state, C, jnp.zeros_like(C), reading, distance, zero, zero)
    if len(dt) == 1:
        (state, _, C_sum, reading, distance, S_1, S_2), _ = piece(carry, (imu[0], dt[0], ends[0]))
    else:
        (state, _, C_sum, reading, distance, S_1, S_2), _ = jax.lax.scan(piece, carry, (imu, dt, ends))
    # an empty step has no mean, and needs none: everything it multiplies is zero
    inverse = jnp.where(T > 0, 1 / jnp.where(T > 0, T, 1.0), 0.0)
    mean = C_sum * inverse
    gradient, rate = None if pull is None else pull.gradient, earth.rate
    if earth.by_segment:  # see `error_model.under_earth`
        gradient, rate = None, None
    reading = None if reading is None else reading * inverse
    motion = Motion(mean, S_1, S_2, reading, gradient, rate, distance)
    return jax.lax.optimization_barrier((state, motion))


def _piece(state, sample, dt, ends, bank, earth, pull):
    """The estimate after a piece; what the IMU has sensed during it as far as one knows, and its force's integrals."""
    sensed = bank.compensated(sample, state.x)
    g_n = earth.gravity(state.p, state.v, dt, pull)
    distance = None
    if bank.travel is not None:
        g_n, distance = g_n + bank.gravity(state.x), travelled(state.v, dt)
    start = state.p, state.v, state.q
    after, of_force = strapdown.step_with_force(*start, sensed[3:6], sensed[:3], dt, g_n, earth.rate)
    return NavState(*after, bank.advance(state.x, ends, distance)), sensed, of_force


def travelled(v: Float[Array, "3 *E"], dt: Float[Array, ""]) -> Float[Array, "*E"]:
    """Distance along the horizon that a velocity in n makes in so much time, m."""
    return dt * root(v[0] ** 2 + v[1] ** 2)


def update(
    P: Float[Array, "n n Q"], H: Float[Array, "K m #Q"], variance: Float[Array, " K"], valid: Float[Array, " K"]
) -> tuple[Float[Array, "n n Q"], Update]:
    """Take K scalar measurements into a covariance, in turn.

    Parameters
    ----------
    P
        Covariance of the error state.
    H
        Derivative of each measurement with respect to the first m errors; the others it does not see.
    variance
        Of each measurement.
    valid
        1 where there is a measurement, 0 where there is none.
    """
    seen = H.shape[1]

    def scalar(P, inputs):
        h, r, is_valid = inputs
        u = jnp.sum(h[:, None] * P[:seen], axis=0)  # P H'
        s = jnp.sum(h * u[:seen], axis=0) + r
        K = is_valid * u / s[None]
        # (1 - K H) P (1 - K H)' + K r K'
        left = P - K[:, None] * u[None]
        right = jnp.sum(h[None] * left[:, :seen], axis=1)
        return left - right[:, None] * K[None] + r * K[:, None] * K[None], Update(K, s)

    P, done = jax.lax.scan(scalar, P, (H, variance, valid))
    return symmetrise(P), done


def residual_covariance(
    P: Float[Array, "n n Q"], H: Float[Array, "K m #Q"], variance: Float[Array, " K"]
) -> Float[Array, "K K Q"]:
    """Covariance of what is measured minus what is predicted, H P H' + R; parameters as of `update`."""
    seen = H.shape[1]
    left = jnp.sum(H[:, :, None] * P[None, :seen, :seen], axis=1)
    return jnp.sum(left[:, None] * H[None], axis=2) + jnp.diag(variance)[:, :, None]


def correction(
    gain: Float[Array, "K n Q"], residual: Float[Array, "K R"], H: Float[Array, "K m #R"]
) -> tuple[Float[Array, "n R"], Float[Array, "K R"]]:
    """The correction z - h(x) asks for, scalar after scalar, and the innovations: residuals given those before."""
    seen = H.shape[1]

    def scalar(c, inputs):
        K, nu, h = inputs
        innovation = nu - jnp.sum(h * c[:seen], axis=0)
        return c + K * innovation[None], innovation

    zero = jnp.zeros((gain.shape[1], residual.shape[1]))
    return jax.lax.scan(scalar, zero, (gain, residual, H))


def inject(state: NavState, c: Float[Array, "n R"]) -> NavState:
    """Correct the estimate: c is minus the estimated error."""
    q = quat_multiply(quat_from_rotvec(c[ATTITUDE]), state.q)
    return NavState(state.p + c[POSITION], state.v + c[VELOCITY], q, state.x + c[NAVIGATION.size :])
