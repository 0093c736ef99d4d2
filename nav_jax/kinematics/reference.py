"""A reference between its epochs: what is true at any time, for sensors that measure at other times than they say."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from nav_jax.kinematics.rotation import quat_conjugate, quat_from_rotvec, quat_multiply, quat_to_rotvec


class Instant(NamedTuple):
    """The motion of a body at F times of R runs."""

    p: Float[Array, "3 F R"]
    v: Float[Array, "3 F R"]
    q: Float[Array, "4 F R"]
    rate: Float[Array, "3 F R"]
    """Body rate relative to n, in b, rad/s."""


class ReferenceMotion(eqx.Module):
    """E epochs of a reference in even steps."""

    start: Float[Array, ""]
    """s."""
    step: Float[Array, ""]
    """s."""
    p: Float[Array, "3 E"]
    v: Float[Array, "3 E"]
    q: Float[Array, "4 E"]

    def at(self, time: Float[Array, "F R"]) -> Instant:
        """The motion at times in s.

        Positions are those of the cubic through positions and velocities at two epochs, whose error is h^4/384 times
        the fourth derivative; the body turns evenly from one to the next. Before the first epoch and after the last it
        goes on straight ahead.
        """
        inside = jnp.clip((time - self.start) / self.step, 0.0, self.p.shape[1] - 1.0)
        epoch = jnp.clip(jnp.floor(inside), 0.0, self.p.shape[1] - 2.0)
        k, u, h = epoch.astype(int), (inside - epoch)[None], self.step
        p0, p1, v0, v1 = self.p[:, k], self.p[:, k + 1], self.v[:, k], self.v[:, k + 1]
        p = p0 + u**2 * (3 - 2 * u) * (p1 - p0) + h * u * (1 - u) * ((1 - u) * v0 - u * v1)
        v = 6 * u * (1 - u) * (p1 - p0) / h + (1 - u) * (1 - 3 * u) * v0 + u * (3 * u - 2) * v1
        q0 = self.q[:, k]
        turn = quat_to_rotvec(quat_multiply(quat_conjugate(q0), self.q[:, k + 1]))
        beyond = (time - self.start - h * inside)[None]
        return Instant(p + beyond * v, v, quat_multiply(q0, quat_from_rotvec(u * turn)), turn / h)
