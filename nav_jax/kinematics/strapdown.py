"""The strapdown mechanisation: one step with its inverse, and its scan over a record.

Over a step of dt with th = omega dt, body rate omega and specific force f constant in the body frame:

    q' = q exp(th)
    v' = v + (C Gamma1 f + g) dt           Gamma1 = 1 + a [th x] + b [th x]^2
    p' = p + v dt + (C Gamma2 f + g/2) dt^2    Gamma2 = 1/2 + b [th x] + c [th x]^2

with a = (1 - cos|th|)/|th|^2, b = (|th| - sin|th|)/|th|^3, c = (1/2 - a)/|th|^2, as series in |th|^2: no branch, no
trigonometric function, exact to 1e-14 up to 1.5 rad a step. Solà (2017), appendix B; Forster et al. (2017), eq. 31.

Where the Earth turns, so does n, by r = w dt in a step. In its middle the attitude that leads the specific force to n
has turned by half of that, and the Coriolis acceleration is that of the velocity there: with the mean specific force
a = (1 - [r x]/2) C Gamma1 f along n and the acceleration e = a + g - 2 w x v at the beginning,

    q' = exp(-r) q exp(th),   v' = v + (e - r x e) dt,   p' = p + v dt + (C Gamma2 f + g/2 - w x v) dt^2

This is of second order in dt, as gravity is that is asked in the middle of a step. `rotation_between` and
`force_between` undo it exactly.
"""

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import Quaternion, Vector
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.kinematics.rotation import (
    alternating,
    cross,
    dcm_from_quat,
    dot,
    horner,
    matvec,
    quat_conjugate,
    quat_from_small_rotvec,
    quat_multiply,
    quat_to_rotvec,
    rotate_back,
)

_A, _B, _C = alternating(2, 9), alternating(3, 8), alternating(4, 8)


def gamma1(rotvec: Vector, x: Vector) -> Vector:
    """Gamma1 x: the mean over a step of a vector that turns by `rotvec` while it lasts; at most 1.5 rad."""
    t = dot(rotvec, rotvec)
    once = cross(rotvec, x)
    return x + horner(_A, t)[None] * once + horner(_B, t)[None] * cross(rotvec, once)


def gamma1_inverse(rotvec: Vector, x: Vector) -> Vector:
    """The vector whose `gamma1` is x.

    Along the rotation Gamma1 is 1. Across it Gamma1 is s + a [th x] with s = 1 - b |th|^2, and its inverse
    (s - a [th x]) / (s^2 + a^2 |th|^2), where the denominator is 2 a.
    """
    t = dot(rotvec, rotvec)
    a, b, c = horner(_A, t), horner(_B, t), horner(_C, t)
    once = cross(rotvec, x)
    # (1 - s/(2a))/|th|^2 = (b - 2c)/(2a), since a = 1/2 - c |th|^2
    return x - 0.5 * once + ((b - 2.0 * c) / (2.0 * a))[None] * cross(rotvec, once)


def gamma2(rotvec: Vector, x: Vector) -> Vector:
    """Gamma2 x: the double integral over a step of unit length of a vector that turns by `rotvec`; at most 1.5 rad."""
    t = dot(rotvec, rotvec)
    once = cross(rotvec, x)
    return 0.5 * x + horner(_B, t)[None] * once + horner(_C, t)[None] * cross(rotvec, once)


def step(
    p: Vector,
    v: Vector,
    q: Quaternion,
    omega: Vector,
    f: Vector,
    dt: Float[Array, "..."] | float,
    g_n: Vector,
    rate_n: Vector | None = None,
) -> tuple[Vector, Vector, Quaternion]:
    """Advance position, velocity and attitude by one IMU sample.

    Parameters
    ----------
    p, v
        Position (m) and velocity (m/s) in n, (3, ...).
    q
        Unit quaternion q_nb, (4, ...).
    omega, f
        Body rate (rad/s) and specific force (m/s^2) in b, constant over the step, (3, ...).
    dt
        Step in s, a scalar or (1, ...); ``|omega| dt`` at most 1.5 rad.
    g_n
        Gravity in n in the middle of the step (m/s^2), (3, ...) or one for all (3,).
    rate_n
        Rotation vector of the Earth in n (rad/s), (3, ...); None where it does not turn.

    Returns
    -------
    Position, velocity and attitude at the end of the step. The quaternion keeps unit length for ever.
    """
    return step_with_force(p, v, q, omega, f, dt, g_n, rate_n)[0]


def step_with_force(
    p: Vector,
    v: Vector,
    q: Quaternion,
    omega: Vector,
    f: Vector,
    dt: Float[Array, "..."] | float,
    g_n: Vector,
    rate_n: Vector | None = None,
) -> tuple[tuple[Vector, Vector, Quaternion], tuple[Vector, Vector]]:
    """Advance as `step`; beside it the first and the second integral of the specific force along n, m/s and m."""
    theta = omega * dt
    g_n = g_n.reshape(g_n.shape + (1,) * (v.ndim - g_n.ndim))
    c = dcm_from_quat(q)
    force, of_force = matvec(c, gamma1(theta, f)), matvec(c, gamma2(theta, f))
    if rate_n is not None:
        force = force - cross(0.5 * dt * rate_n, force)
    mean, twice = force + g_n, of_force + 0.5 * g_n
    if rate_n is not None:
        coriolis = cross(rate_n, v)
        mean, twice = mean - 2.0 * coriolis, twice - coriolis
        mean = mean - cross(dt * rate_n, mean)
    velocity = v + mean * dt
    position = p + v * dt + twice * (dt * dt)
    turned = quat_multiply(q, quat_from_small_rotvec(theta))
    if rate_n is not None:
        turned = quat_multiply(quat_from_small_rotvec(-dt * rate_n), turned)
    # one Newton step towards unit length, which rounding would leave as a random walk
    scale = 1.5 - 0.5 * (turned[0] * turned[0] + dot(turned[1:], turned[1:]))
    return (position, velocity, turned * scale[None]), (force * dt, of_force * (dt * dt))


def rotation_between(
    q: Quaternion, after: Quaternion, dt: Float[Array, "..."] | float, rate_n: Vector | None = None
) -> Vector:
    """The rotation vector of the body in a `step` of dt from one attitude to another: its body rate times dt."""
    if rate_n is not None:
        after = quat_multiply(quat_from_small_rotvec(dt * rate_n), after)
    return quat_to_rotvec(quat_multiply(quat_conjugate(q), after))


def force_between(
    q: Quaternion,
    rotvec: Vector,
    v: Vector,
    after: Vector,
    dt: Float[Array, "..."] | float,
    g_n: Vector,
    rate_n: Vector | None = None,
) -> Vector:
    """The specific force in b that leads from one velocity to another in a `step` of dt that turns the body by rotvec.

    Gravity and rate are those of the step, all of shape (3, ...).
    """
    mean = (after - v) / dt
    if rate_n is None:
        return gamma1_inverse(rotvec, rotate_back(q, mean - g_n))
    force = _turned_back(dt * rate_n, mean) + 2.0 * cross(rate_n, v) - g_n
    return gamma1_inverse(rotvec, rotate_back(q, _turned_back(0.5 * dt * rate_n, force)))


def _turned_back(r: Vector, x: Vector) -> Vector:
    """The vector y with y - r x y = x: (1 - [r x])^-1 is (1 + [r x] + r r') / (1 + r'r)."""
    return (x + cross(r, x) + dot(r, x)[None] * r) / (1.0 + dot(r, r)[None])


@jax.jit
def integrate(
    p: Float[Array, "3"],
    v: Float[Array, "3"],
    q: Float[Array, "4"],
    omega: Float[Array, "samples 3"],
    f: Float[Array, "samples 3"],
    dt: Float[Array, " samples"],
    earth: AbstractEarth,
) -> tuple[Float[Array, "epochs 3"], Float[Array, "epochs 3"], Float[Array, "epochs 4"]]:
    """Run `step` over all samples of one record, without any aiding.

    Parameters
    ----------
    p, v, q
        At the first epoch.
    omega, f
        Body rate and specific force of N samples, time on axis 0.
    dt
        Length of each step in s.
    earth
        Gives gravity and its rate.

    Returns
    -------
    Position, velocity and attitude at the N + 1 epochs, time on axis 0.
    """

    def advance(state, sample):
        rate, force, length = sample
        p, v, q = state
        turning = earth.rate_n(p) if earth.is_turning else None
        state = step(p, v, q, rate, force, length, earth.gravity_n(p + length / 2 * v), turning)
        return state, state

    _, rest = jax.lax.scan(advance, (p, v, q), (omega, f, dt))
    first = (p, v, q)
    return tuple(jnp.concatenate([x[None], xs]) for x, xs in zip(first, rest, strict=True))  # type: ignore[return-value]
