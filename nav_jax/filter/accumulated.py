r"""Transition and noise of a segment, accumulated step by step: between two events nobody looks at the covariance.

Phi_k ... Phi_1 P Phi_1' ... Phi_k' + Q is the same however it is bracketed. The steps between two events multiply the
transition and add up the noise, which have fewer numbers than the covariance and none of its dense products, and the
event forms Phi P Phi' + Q once. This is no approximation: it is `error_model.propagate` at every step up to rounding.

In the symbols of `error_model`, with the errors (p, v, psi) of navigation and sensor states that each go their own way,

    Phi = [A  E],   A = [1  t  -[S_2 x]],   Q = [N   S],   D and q diagonal.
          [0  D]        [0  1  -[S_1 x]]        [S'  q]
                        [0  0      1   ]

A column of E or S is what one sensor state does: that of an accelerometer or of gravity ("force") has no attitude,
that of a gyro ("turn") has all three, and no other state acts on navigation. With the A and D of one step and its map H
of sensor states to navigation, a step makes of them

    E <- A E + H D_before,   U = A S + H q/2,   S <- (U + H q/2) D + G cross,   N <- A N A' + U H' + H U' + C diag(r) C'

of which the last is A N A' + A S H' + H S' A' + H q H' and the white noise, half of it before the step (Strang).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from nav_jax.filter.error_model import Covariance, Motion
from nav_jax.filter.layout import ATTITUDE, NAVIGATION, POSITION, VELOCITY
from nav_jax.imu.bank import IMU, SensorBank, StepNoise, by_channel, multiples, to_states
from nav_jax.imu.channels import GRAVITY, SensorState
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.linalg import matmul3, transpose
from nav_jax.kinematics.rotation import cross

_ACCEL, _GYRO = IMU[:3], IMU[3:]


class Columns(NamedTuple):
    """What F sensor states that push and W that turn do to navigation, a column each."""

    force: Float[Array, "2 3 F R"]
    """Position and velocity."""
    turn: Float[Array, "3 3 W R"]
    """Position, velocity and attitude."""


class Blocks(NamedTuple):
    """The upper half of a symmetric matrix of position (p), velocity (v) and attitude (q) in blocks of 3 x 3."""

    pp: Float[Array, "3 3 R"]
    pv: Float[Array, "3 3 R"]
    pq: Float[Array, "3 3 R"]
    vv: Float[Array, "3 3 R"]
    vq: Float[Array, "3 3 R"]
    qq: Float[Array, "3 3 R"]


class Accumulated(NamedTuple):
    """Transition and noise since the last event, see the head of this file."""

    time: Float[Array, ""]
    S_1: Float[Array, "3 R"]
    S_2: Float[Array, "3 R"]
    E: Columns
    D: Float[Array, "M Q"]
    N: Blocks
    S: Columns
    q: Float[Array, "M Q"]


def accumulates(bank: SensorBank, earth: EarthInLoops) -> bool:
    """Say whether steps can be accumulated: every state goes its own way, and errors feel no Earth within a step."""
    return bank.diagonal and (earth.by_segment or (earth.constant is not None and earth.rate is None))


def nothing_yet(noise: StepNoise, num: int) -> Accumulated:
    """The beginning of a segment of `num` covariances; of the noise of any step only the shapes are looked at."""
    at, M = _Acting.of(noise.states), len(noise.states)
    banks = num if noise.travel is not None else noise.weights.shape[-1]
    zero, block = jnp.zeros((3, num)), jnp.zeros((3, 3, num))
    none = Columns(jnp.zeros((2, 3, len(at.force), num)), jnp.zeros((3, 3, len(at.gyro), num)))
    one, nothing = jnp.ones((M, banks)), jnp.zeros((M, banks))
    return Accumulated(jnp.zeros(()), zero, zero, none, one, Blocks(*6 * [block]), none, nothing)


def accumulate(so_far: Accumulated, motion: Motion, noise: StepNoise) -> Accumulated:
    """Transition and noise after one more covariance step."""
    noise = noise.after(motion.distance)
    C, S_1, S_2, T = motion.C_mean, motion.S_1, motion.S_2, noise.duration
    lever, at = S_1 - S_2 * noise.inverse_duration, _Acting.of(noise.states)
    weights, phi = noise.weights, noise.transition
    if any(s.reads is not None for s in noise.states):
        weights = weights * multiples(noise.states, motion.reading)
    # of every state, what a unit on its channel is in n; gravity has the other sign, see `error_model`
    push, twist = at.in_n(C)

    def A(X: Columns) -> Columns:
        (p, v), (P, V, Q) = X
        P, V = P + T * V - cross(S_2[:, None], Q), V - cross(S_1[:, None], Q)
        return Columns(jnp.stack([p + T * v, v]), jnp.stack([P, V, Q]))

    def plus(X: Columns, of: Array) -> Columns:
        """X, and what so many units of the states do."""
        a, g = push * of[None, at.force], twist * of[None, at.gyro]
        turned = cross(lever[:, None], g)
        force = jnp.stack([X.force[0] - T / 2 * a, X.force[1] - a])
        return Columns(force, jnp.stack([X.turn[0] + T / 3 * turned, X.turn[1] + turned, X.turn[2] - g]))

    half = weights * so_far.q / 2
    E, U = plus(A(so_far.E), weights * so_far.D), plus(A(so_far.S), half)
    new = phi * half + jnp.sum(noise.cross, axis=0) if noise.several else phi * half
    S = plus(Columns(U.force * phi[None, None, at.force], U.turn * phi[None, None, at.gyro]), new)

    # U H': the rows of U by channel, and what these do
    force, turn = (weights[None, None, which] * X for which, X in ((at.force, U.force), (at.gyro, U.turn)))
    a, g = at.forces(force, C), at.turns(turn, C)
    turned = _rows(lever, g)
    to_q, to_v, to_p = -g, turned.at[:2].add(-a), (T / 3 * turned).at[:2].add(-T / 2 * a)

    white_a, white_g = (matmul3(C * r[None], transpose(C)) / 2 for r in (noise.integrated[:3], noise.integrated[3:]))
    pp, pv, pq, vv, vq, qq = so_far.N
    vv, qq = vv + white_a, qq + white_g
    # A N, then (A N) A'
    pp, pv, pq = (
        pp + T * transpose(pv) - _columns(S_2, transpose(pq)),
        pv + T * vv - _columns(S_2, transpose(vq)),
        pq + T * vq - _columns(S_2, qq),
    )
    vv, vq = vv - _columns(S_1, transpose(vq)), vq - _columns(S_1, qq)
    pp, pv, vv = pp + T * pv - _rows(S_2, pq), pv - _rows(S_1, pq), vv - _rows(S_1, vq)
    if noise.several:
        pp = pp + 2 * noise.second_integral * white_a
    N = Blocks(
        pp + to_p[0] + transpose(to_p[0]),
        pv + to_v[0] + transpose(to_p[1]),
        pq + to_q[0] + transpose(to_p[2]),
        vv + white_a + to_v[1] + transpose(to_v[1]),
        vq + to_q[1] + transpose(to_v[2]),
        qq + white_g + to_q[2] + transpose(to_q[2]),
    )
    driving = jnp.moveaxis(jnp.diagonal(noise.driving), -1, 0)
    moved = so_far.S_2 + T * so_far.S_1 + S_2
    return Accumulated(
        so_far.time + T, so_far.S_1 + S_1, moved, E, phi * so_far.D, N, S, phi * so_far.q * phi + driving
    )


def covariance_over(P: Covariance, done: Accumulated, states: tuple[SensorState, ...]) -> Covariance:
    """Phi P Phi' + Q over a whole segment."""
    D = done.D
    W = _navigation(done, P.navigation, transpose(P.mixed), states)
    U = _navigation(done, P.mixed, P.sensors, states)
    N = transpose(_navigation(done, transpose(W), transpose(U), states))
    pp, pv, pq, vv, vq, qq = done.N
    rows = [pp, pv, pq], [transpose(pv), vv, vq], [transpose(pq), transpose(vq), qq]
    noise = jnp.concatenate([jnp.concatenate(row, axis=1) for row in rows])
    B = P.sensors * (D[:, None] * D[None]) + jnp.eye(len(states))[:, :, None] * done.q[None]
    return Covariance(N + noise, U * D[None] + _in_order(done.S, states), B)


def transition_over(
    X: Float[Array, "n K R"], done: Accumulated, states: tuple[SensorState, ...]
) -> Float[Array, "n K R"]:
    """Phi X over a whole segment."""
    X, S = X[: NAVIGATION.size], X[NAVIGATION.size :]
    return jnp.concatenate([_navigation(done, X, S, states), done.D[:, None] * S])


class _Acting(NamedTuple):
    """Where the states are that act on navigation, and their channels."""

    force: np.ndarray
    """Those of accelerometers, and behind them those of gravity."""
    gyro: np.ndarray
    on_accel: tuple[int, ...]
    on_gravity: tuple[int, ...]
    on_gyro: tuple[int, ...]

    @classmethod
    def of(cls, states: tuple[SensorState, ...]) -> "_Acting":
        """Of the states of a bank."""
        found = [[i for i, s in enumerate(states) if s.channel in group] for group in (_ACCEL, GRAVITY, _GYRO)]
        accel, gravity, gyro = found
        channels = (tuple(states[i].channel for i in which) for which in found)
        return cls(np.array(accel + gravity, dtype=int), np.array(gyro, dtype=int), *channels)

    def in_n(self, C: Float[Array, "3 3 R"]) -> tuple[Float[Array, "3 F R"], Float[Array, "3 W R"]]:
        """What a unit on the channel of each state is in n."""
        axes = transpose(C)
        push, twist = to_states(self.on_accel, axes, of=_ACCEL), to_states(self.on_gyro, axes, of=_GYRO)
        if self.on_gravity:
            down = to_states(self.on_gravity, -jnp.eye(3)[:, :, None], of=GRAVITY)
            push = jnp.concatenate([push, jnp.broadcast_to(down, (*down.shape[:2], push.shape[2]))])
        return transpose(push), transpose(twist)

    def forces(self, X: Float[Array, "K 3 F R"], C: Float[Array, "3 3 #R"]) -> Float[Array, "K 3 3 R"]:
        """Rows over the states that push to rows over accelerations along n."""
        X, of_accel = jnp.moveaxis(X, 2, 0), len(self.on_accel)
        a = _along_n(by_channel(self.on_accel, X[:of_accel], of=_ACCEL), C)
        if not self.on_gravity:
            return a
        return a - jnp.moveaxis(by_channel(self.on_gravity, X[of_accel:], of=GRAVITY), 0, 2)

    def turns(self, X: Float[Array, "K 3 W R"], C: Float[Array, "3 3 #R"]) -> Float[Array, "K 3 3 R"]:
        """The same of the states that turn."""
        return _along_n(by_channel(self.on_gyro, jnp.moveaxis(X, 2, 0), of=_GYRO), C)


def _along_n(X: Float[Array, "3 K 3 R"], C: Float[Array, "3 3 #R"]) -> Float[Array, "K 3 3 R"]:
    """Rows over the three axes of a sensor to rows along n."""
    return sum((C[None, None, :, i] * X[i][:, :, None] for i in range(1, 3)), C[None, None, :, 0] * X[0][:, :, None])


def _columns(s: Float[Array, "3 #R"], M: Float[Array, "3 3 R"]) -> Float[Array, "3 3 R"]:
    """[s x] M."""
    return cross(s[:, None], M)


def _rows(s: Float[Array, "3 #R"], M: Float[Array, "*K 3 3 R"]) -> Float[Array, "*K 3 3 R"]:
    """M [s x]'."""
    s0, s1, s2 = (a.reshape((1,) * (M.ndim - 2) + a.shape) for a in s)
    m0, m1, m2 = M[..., 0, :], M[..., 1, :], M[..., 2, :]
    return jnp.stack([s1 * m2 - s2 * m1, s2 * m0 - s0 * m2, s0 * m1 - s1 * m0], axis=-2)


def _navigation(
    done: Accumulated, X: Float[Array, "nav K R"], S: Float[Array, "M K R"], states: tuple[SensorState, ...]
) -> Float[Array, "nav K R"]:
    """[A E] of a whole segment times navigation errors X and sensor states S."""
    p, v, psi = X[POSITION], X[VELOCITY], X[ATTITUDE]
    p = p + done.time * v - cross(done.S_2[:, None], psi)
    X = jnp.concatenate([p, v - cross(done.S_1[:, None], psi), psi])
    at = _Acting.of(states)
    return X + _product(_columns_of(done.E), S[np.concatenate([at.force, at.gyro])])


def _columns_of(X: Columns) -> Float[Array, "nav K R"]:
    force = jnp.concatenate([X.force.reshape(6, *X.force.shape[2:]), jnp.zeros_like(X.force[0])])
    return jnp.concatenate([force, X.turn.reshape(9, *X.turn.shape[2:])], axis=1)


def _in_order(X: Columns, states: tuple[SensorState, ...]) -> Float[Array, "nav M R"]:
    """The columns in the order of the states, zeros where one does not act."""
    at = _Acting.of(states)
    acting = np.concatenate([at.force, at.gyro])
    rest = np.setdiff1d(np.arange(len(states)), acting)
    columns = _columns_of(X)
    columns = jnp.concatenate([columns, jnp.zeros((len(columns), len(rest), columns.shape[2]))], axis=1)
    return columns[:, np.argsort(np.concatenate([acting, rest]))]


def _product(X: Float[Array, "I J R"], Y: Float[Array, "J K #R"]) -> Float[Array, "I K R"]:
    """X Y of every run; term by term it is vector code, which a reduction is not."""
    zero = jnp.zeros((X.shape[0], Y.shape[1], X.shape[2]))
    return jax.lax.scan(lambda XY, xy: (XY + xy[0][:, None] * xy[1][None], None), zero, (transpose(X), Y))[0]
