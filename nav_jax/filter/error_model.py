r"""How a navigation error grows over one covariance step, and the covariance with it.

Errors are estimate minus truth, psi the rotation vector of C_est C_true' in n. With the error delta_f, delta_w of the
compensated sensors (Groves 2013, sec. 14.2, in the frame of `nav_jax.kinematics.earth`):

    psi' = -[w x] psi + C delta_w,   v' = -[f_n x] psi - 2 [w x] v + Gamma p + C delta_f,   p' = v

with the rotation vector w of the Earth and the gradient Gamma of gravity, which has the centrifugal part in it. Both
are zero on a flat Earth that does not turn, of which the next paragraph is.

Over a step of length T, S_1 = int f_n and S_2 = int int f_n, the integrals of the specific force along n that the
mechanisation has beside its step, hence int f_n s ds = T S_1 - S_2, and Cm the mean of C. The sums run over every
sample of the step, so a step of many samples forgets none of them. The compensated error is y = -(E x + noise),
integrated over the step, where x is the error of the sensor states, and

    psi += Cm y_g,   v += -[S_1 x] psi + Cm y_a - [L x] Cm y_g,   p += T v - [S_2 x] psi + T/2 Cm y_a - T/3 [L x] Cm y_g

with L = (T S_1 - S_2)/T. This is the transition to second order in the rotation within the step and to the second
integral of the sensor errors; E, the integral of a Markov state over the step, is exact (`sensor_bank`).

Where gravity is not the same everywhere, its gradient adds T Gamma p + T^2/2 Gamma v to v and T^2/2 Gamma p to p. Where
the Earth turns, half of what it does to errors comes before all that and half after: psi is turned by exp(-[w x] T/2)
and v by exp(-[w x] T), twice. This is second order in T (Strang 1968).

Both are slow: the Schuler period is 84 minutes and the day is long. On an Earth that is vast a step leaves them out,
and `under_earth` has them for half a segment of T s at its beginning and again at its end, with T/2 Gamma p for v. That
is Strang's splitting once more, now over a segment. Between its ends a covariance lacks, or has already, what they make
of errors in T/2: w T/2 of them, 4e-5 in a second.

A state of gravity (`nav_jax.imu.gravity`) that is believed to be too large by x is an acceleration along n: x T for v
and x T^2/2 for p, without turning and with the other sign than accelerometers have. It is held over a step, and then
fades with the distance travelled in it.

Covariance blocks: N (navigation), S (navigation with sensor states), B (sensor states); runs are the last axis.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from nav_jax.filter.layout import ATTITUDE, NAVIGATION, POSITION, VELOCITY
from nav_jax.imu.bank import StepNoise
from nav_jax.imu.channels import CHANNELS
from nav_jax.kinematics.linalg import matmul3, transpose
from nav_jax.kinematics.rotation import cross, dcm_from_quat, quat_from_small_rotvec


class Covariance(NamedTuple):
    """The covariance of the error state in blocks; the lower left one is the transpose of S."""

    navigation: Float[Array, "nav nav R"]
    mixed: Float[Array, "nav M R"]
    sensors: Float[Array, "M M R"]


class Motion(NamedTuple):
    """What a covariance step needs to know of the motion: see the head of this file."""

    C_mean: Float[Array, "3 3 R"]
    S_1: Float[Array, "3 R"]
    S_2: Float[Array, "3 R"]
    reading: Float[Array, "seen R"] | None = None
    """Mean of what the IMU senses, where errors depend on it."""
    gradient: Float[Array, "3 3 #R"] | None = None
    """Of gravity; None where it is the same everywhere."""
    rate: Float[Array, "3 1"] | None = None
    """Of the Earth; None where it does not turn."""
    distance: Float[Array, " R"] | None = None
    """Travelled along the horizon, m; where states fade with it."""


def full(P: Covariance) -> Float[Array, "n n R"]:
    """The covariance as one matrix."""
    top = jnp.concatenate([P.navigation, P.mixed], axis=1)
    return jnp.concatenate([top, jnp.concatenate([transpose(P.mixed), P.sensors], axis=1)], axis=0)


def blocks(P: Float[Array, "n n R"]) -> Covariance:
    """Inverse of `full`."""
    k = NAVIGATION.size
    return Covariance(P[:k, :k], P[:k, k:], P[k:, k:])


def under_earth(
    X: Float[Array, "n K R"],
    gradient: Float[Array, "3 3 #R"] | None,
    rate: Float[Array, "3 1"] | None,
    time: Float[Array, ""],
) -> Float[Array, "n K R"]:
    """Errors after half a segment of twice the time, in which the Earth does all that it does; sensor states stay.

    Gradient of gravity and rotation vector are those of `Motion`.
    """
    p, v, psi = X[POSITION], X[VELOCITY], X[ATTITUDE]
    if gradient is not None:
        v = v + time * matmul3(gradient, p)
    if rate is not None:
        v, psi = (
            matmul3(dcm_from_quat(quat_from_small_rotvec(-s * time * rate)), x) for s, x in ((2.0, v), (1.0, psi))
        )
    return jnp.concatenate([p, v, psi, X[NAVIGATION.size :]])


def covariance_under_earth(
    P: Covariance,
    gradient: Float[Array, "3 3 #R"] | None,
    rate: Float[Array, "3 1"] | None,
    time: Float[Array, ""],
) -> Covariance:
    """The covariance of such errors, see `under_earth`."""

    def after(X: Array) -> Array:
        return under_earth(X, gradient, rate, time)

    return Covariance(after(transpose(after(P.navigation))), after(P.mixed), P.sensors)


class _Step:
    """The maps of one covariance step, see the head of this file."""

    def __init__(self, motion: Motion, noise: StepNoise):
        self.C, self.S_1, self.S_2, self.reading, self.gradient, rate, distance = motion
        self.noise, self.T = noise.after(distance), noise.duration
        self.lever = self.S_1 - self.S_2 * noise.inverse_duration
        self.turns = None
        if rate is not None:
            # of the velocity, by the Coriolis acceleration, and of the attitude, in half a step
            self.turns = tuple(dcm_from_quat(quat_from_small_rotvec(-s * self.T * rate)) for s in (1.0, 0.5))

    def turned(self, X: Array) -> Array:
        """Navigation errors after half a step in which nothing happens but that the Earth turns; X (nav, K, R)."""
        if self.turns is None:
            return X
        v, psi = matmul3(self.turns[0], X[VELOCITY]), matmul3(self.turns[1], X[ATTITUDE])
        return jnp.concatenate([X[POSITION], v, psi])

    def A(self, X: Array) -> Array:
        """Navigation errors to navigation errors, on an Earth that does not turn; X (nav, K, R)."""
        p, v, psi = X[POSITION], X[VELOCITY], X[ATTITUDE]
        moved, faster = p + self.T * v - cross(self.S_2[:, None], psi), v - cross(self.S_1[:, None], psi)
        if self.gradient is not None:
            pulled = matmul3(self.gradient, p)
            moved = moved + self.T**2 / 2 * pulled
            faster = faster + self.T * pulled + self.T**2 / 2 * matmul3(self.gradient, v)
        return jnp.concatenate([moved, faster, psi])

    def G(self, y: Array) -> Array:
        """Integrated sensor errors of the six channels, and of gravity if it has any, to navigation errors."""
        a, g = matmul3(self.C, y[:3]), matmul3(self.C, y[3:6])
        if len(y) > len(CHANNELS):
            a = a - y[len(CHANNELS) :]
        turned = cross(self.lever[:, None], g)
        return jnp.concatenate([self.T / 3 * turned - self.T / 2 * a, turned - a, -g])

    def H(self, X: Array) -> Array:
        """Sensor states to navigation errors; X (M, K, R)."""
        return self.G(self.noise.integrate(X, self.reading))

    def navigation(self, X: Array, S: Array) -> Array:
        """Navigation errors X (nav, K, R) and sensor states S (M, K, R) to navigation errors."""
        return self.turned(self.A(self.turned(X)) + self.H(S))


def transition(X: Float[Array, "n K R"], motion: Motion, noise: StepNoise) -> Float[Array, "n K R"]:
    """Phi X: errors of navigation and sensor states after a covariance step."""
    step = _Step(motion, noise)
    navigation, sensors = X[: NAVIGATION.size], X[NAVIGATION.size :]
    return jnp.concatenate([step.navigation(navigation, sensors), transpose(step.noise.carry(transpose(sensors)))])


def propagate(P: Covariance, motion: Motion, noise: StepNoise) -> Covariance:
    """Phi P Phi' + Q over one covariance step."""
    step, C = _Step(motion, noise), motion.C_mean
    noise = step.noise

    # C diag(r) C' of the noise in y; half of it enters before the step, half after (Strang), which is exact in v and
    # psi and to T^2 in what they do to each other and to p
    half_a, half_g = (matmul3(C * r[None], transpose(C)) / 2 for r in (noise.integrated[:3], noise.integrated[3:]))

    def add_half(N: Array) -> Array:
        return N.at[VELOCITY, VELOCITY].add(half_a).at[ATTITUDE, ATTITUDE].add(half_g)

    # [A H] [N S; S' B] = [W U], and from the right with [A H]'
    W, U = step.navigation(add_half(P.navigation), transpose(P.mixed)), step.navigation(P.mixed, P.sensors)
    N = add_half(transpose(step.navigation(transpose(W), transpose(U))))
    S = noise.carry(U)
    if noise.several:
        N = N.at[POSITION, POSITION].add(2 * noise.second_integral * half_a)
        S = S + step.turned(step.G(noise.cross))
    return Covariance(N, S, noise.advance(P.sensors))
