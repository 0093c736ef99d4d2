"""The state of navigation and the motion of the body, runs as the last axis: what the rooms tell each other."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from nav_jax.kinematics.rotation import rotate, rotate_back


class NavState(NamedTuple):
    """Position, velocity and attitude of R runs, and states of sensors."""

    p: Float[Array, "3 R"]
    """Position in n, m."""
    v: Float[Array, "3 R"]
    """Velocity in n, m/s."""
    q: Float[Array, "4 R"]
    """Attitude q_nb."""
    x: Float[Array, "M R"]
    """States of sensors: in a filter all of them; as an aiding sensor sees it, those of its own."""


class BodyMotion(NamedTuple):
    """How the body moves over the Earth at an epoch, as far as one knows."""

    force: Float[Array, "3 R"]
    """Specific force in b, m/s^2."""
    rate: Float[Array, "3 R"]
    """Body rate relative to n, in b, rad/s."""
    means: Float[Array, "W ch R"] | None = None
    """Mean specific forces and body rates in the windows that a sensor asks for, along b at the epoch."""
    fall: Float[Array, "3 _"] | None = None
    """Acceleration in n without a specific force, m/s^2: that of gravity and of Coriolis. Goes with the means."""

    def moved(self, force: Float[Array, "3 R"], rate: Float[Array, "3 R"]) -> "BodyMotion":
        """With so much more of both."""
        means = None if self.means is None else self.means + jnp.concatenate([force, rate])[None]
        return BodyMotion(self.force + force, self.rate + rate, means, self.fall)

    def acceleration(self, q: Float[Array, "4 R"], window: int) -> Float[Array, "3 R"]:
        """Mean acceleration in n in a window, m/s^2, of a body with this attitude at the epoch."""
        if self.means is None or self.fall is None:
            raise ValueError("The motion has no means: a sensor that needs them asks for windows.")
        return rotate(q, self.means[window, :3]) + self.fall


def body_motion(
    reading: Float[Array, "seen R"], q: Float[Array, "4 R"], rate_n: Float[Array, "3 1"] | None
) -> BodyMotion:
    """What an IMU reads, as the motion over an Earth that turns at this rate, or does not turn (None).

    The rate of the Earth is in the readings of gyros, and moves no lever arm.
    """
    rate = reading[3:6] if rate_n is None else reading[3:6] - rotate_back(q, rate_n)
    return BodyMotion(reading[:3], rate)
