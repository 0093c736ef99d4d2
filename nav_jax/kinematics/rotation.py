"""Rotations: unit quaternions, rotation vectors, direction cosine matrices and Euler angles.

Conventions: q_nb is scalar-first, Hamilton, and takes b to n: v_n = C(q) v_b. Euler angles are roll, pitch, yaw of the
sequence C = Rz(yaw) Ry(pitch) Rx(roll). The component axis is the first, any axes follow (runs or times), so that one
code serves all. Every function is differentiable, also at the identity.

References
----------
Solà, J. (2017), Quaternion kinematics for the error-state Kalman filter.
Markley, L., Crassidis, J. (2014), Fundamentals of Spacecraft Attitude Determination and Control, section 2.9.
"""

from collections.abc import Sequence
from math import factorial

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import Matrix, Quaternion, Vector

_SMALL = 4e-3
"""Squared angle below which four terms of a series are exact to 1e-17."""

SMALL_ROTATION = 1.5
"""Angle in rad up to which the series of `quat_from_small_rotvec` and of `strapdown` are exact to 1e-14."""


def horner(coefficients: Sequence[float], x: Float[Array, "..."]) -> Float[Array, "..."]:
    """The polynomial sum of c_k x^k, lowest power first."""
    *rest, value = coefficients
    for c in reversed(rest):
        value = c + x * value
    return jnp.asarray(value, dtype=x.dtype)


def alternating(first: int, terms: int) -> tuple[float, ...]:
    """Coefficients (-1)^k / (2 k + first)! of the series of sine, cosine and what follows them."""
    return tuple((-1) ** k / factorial(2 * k + first) for k in range(terms))


def dot(a: Vector, b: Vector) -> Float[Array, "..."]:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    a0, a1, a2 = a[0], a[1], a[2]  # each index is two operations to trace
    b0, b1, b2 = b[0], b[1], b[2]
    return jnp.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def matvec(matrix: Matrix, v: Vector) -> Vector:
    """Matrix times vector."""
    return jnp.stack([dot(row, v) for row in matrix])


def quat_multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: q_nc = q_nb * q_bc."""
    a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
    b0, b1, b2, b3 = b[0], b[1], b[2], b[3]
    return jnp.stack(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ]
    )


def quat_conjugate(q: Quaternion) -> Quaternion:
    """The inverse rotation: q_bn of q_nb."""
    return jnp.stack([q[0], -q[1], -q[2], -q[3]])


def quat_normalize(q: Quaternion) -> Quaternion:
    """Scale to unit length."""
    scale = 1.0 / jnp.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return jnp.stack([c * scale for c in q])


def quat_from_rotvec(rotvec: Vector) -> Quaternion:
    """Exponential map: the rotation by |rotvec| rad about rotvec, of any size."""
    y = 0.25 * dot(rotvec, rotvec)
    small = y < 0.25 * _SMALL
    half = jnp.sqrt(jnp.where(small, 1.0, y))  # kept away from 0, where a square root has no derivative
    scalar = jnp.where(small, horner(alternating(0, 4), y), jnp.cos(half))
    vector = 0.5 * jnp.where(small, horner(alternating(1, 4), y), jnp.sin(half) / half)
    return jnp.stack([scalar, *(vector * c for c in rotvec)])


def quat_from_small_rotvec(rotvec: Vector) -> Quaternion:
    """Exponential map without branch or trigonometric function, for at most `SMALL_ROTATION`: what one step turns."""
    y = 0.25 * dot(rotvec, rotvec)
    vector = 0.5 * horner(alternating(1, 8), y)
    return jnp.stack([horner(alternating(0, 8), y), *(vector * c for c in rotvec)])


def quat_to_rotvec(q: Quaternion) -> Vector:
    """Logarithm: the shortest rotation vector, |rotvec| <= pi. q and -q give the same."""
    n2 = q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    small = n2 < 0.25 * _SMALL * q[0] * q[0]
    n = jnp.sqrt(jnp.where(small, 1.0, n2))
    w = jnp.where(q[0] < 0, -1.0, 1.0) * q[0]
    tangent2 = jnp.where(small, n2, 0.0) / jnp.where(small, w * w, 1.0)
    series = 2.0 * horner([(-1) ** k / (2 * k + 1) for k in range(6)], tangent2) / jnp.where(small, w, 1.0)
    factor = jnp.where(small, series, 2.0 * jnp.arctan2(n, w) / n)
    factor = jnp.where(q[0] < 0, -1.0, 1.0) * factor
    return jnp.stack([factor * q[1], factor * q[2], factor * q[3]])


def dcm_from_quat(q: Quaternion) -> Matrix:
    """Matrix C with v_n = C v_b of a unit quaternion."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    wx, wy, wz = w * x2, w * y2, w * z2
    xx, xy, xz = x * x2, x * y2, x * z2
    yy, yz, zz = y * y2, y * z2, z * z2
    return jnp.stack(
        [
            jnp.stack([1.0 - (yy + zz), xy - wz, xz + wy]),
            jnp.stack([xy + wz, 1.0 - (xx + zz), yz - wx]),
            jnp.stack([xz - wy, yz + wx, 1.0 - (xx + yy)]),
        ]
    )


@jax.jit
def quat_from_dcm(dcm: Matrix) -> Quaternion:
    """Unit quaternion with a non-negative scalar part of a rotation matrix (Markley and Crassidis 2014, eq. 2.135)."""
    c = dcm
    t = c[0, 0] + c[1, 1] + c[2, 2]
    wx, wy, wz = c[2, 1] - c[1, 2], c[0, 2] - c[2, 0], c[1, 0] - c[0, 1]
    xy, xz, yz = c[0, 1] + c[1, 0], c[0, 2] + c[2, 0], c[1, 2] + c[2, 1]
    # 4 q q^T: every row is a multiple of q, the one with the largest diagonal element is the most exact
    rows = jnp.stack(
        [
            jnp.stack([1.0 + t, wx, wy, wz]),
            jnp.stack([wx, 1.0 + 2.0 * c[0, 0] - t, xy, xz]),
            jnp.stack([wy, xy, 1.0 + 2.0 * c[1, 1] - t, yz]),
            jnp.stack([wz, xz, yz, 1.0 + 2.0 * c[2, 2] - t]),
        ]
    )
    largest = jnp.argmax(jnp.stack([rows[i, i] for i in range(4)]), axis=0)
    q = quat_normalize(jnp.take_along_axis(rows, largest[None, None], axis=0)[0])
    return jnp.where(q[:1] < 0, -1.0, 1.0) * q


@jax.jit
def quat_from_euler(euler: Vector) -> Quaternion:
    """Unit quaternion of roll, pitch, yaw in rad."""
    cr, cp, cy = (jnp.cos(0.5 * a) for a in euler)
    sr, sp, sy = (jnp.sin(0.5 * a) for a in euler)
    return jnp.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


@jax.jit
def euler_from_quat(q: Quaternion) -> Vector:
    """Roll in (-pi, pi], pitch in [-pi/2, pi/2], yaw in (-pi, pi], in rad.

    Yaw is computed from what roll leaves over, so that the three angles are the rotation also where pitch is 90 deg and
    roll and yaw are not unique.
    """
    c = dcm_from_quat(q)
    roll = jnp.arctan2(c[2, 1], c[2, 2])
    sr, cr = jnp.sin(roll), jnp.cos(roll)
    pitch = jnp.arctan2(-c[2, 0], sr * c[2, 1] + cr * c[2, 2])
    yaw = jnp.arctan2(sr * c[0, 2] - cr * c[0, 1], cr * c[1, 1] - sr * c[1, 2])
    return jnp.stack([roll, pitch, yaw])


def rotate(q: Quaternion, v: Vector) -> Vector:
    """v_n = C(q_nb) v_b."""
    return matvec(dcm_from_quat(q), v)


def rotate_back(q: Quaternion, v: Vector) -> Vector:
    """v_b = C(q_nb)^T v_n."""
    c = dcm_from_quat(q)
    return jnp.stack([dot(c[:, i], v) for i in range(3)])
