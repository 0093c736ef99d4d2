"""The state of navigation and the motion of the body, runs as the last axis: what the rooms tell each other."""

from typing import NamedTuple

from jaxtyping import Array, Float


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
    """What the inertial sensors say at an epoch, compensated for the errors that are known of them."""

    force: Float[Array, "3 R"]
    """Specific force in b, m/s^2."""
    rate: Float[Array, "3 R"]
    """Body rate in b, rad/s."""
