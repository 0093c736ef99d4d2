"""How an IMU sits in a vehicle: the vehicle's axes turned from those of b by a pitch theta and a yaw psi, as states.

The angles cannot be known for ever: loads and suspension change them, and a filter that takes them for constants
becomes too sure of itself. A roll moves nothing forward and is none of them.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from nav_jax.aiding.states import OwnState, own_state

PITCH_AND_YAW = ("mount pitch", "mount yaw")
"""Names of the states."""


def pair_of_states(
    name: str, argument: str, states: tuple[str, str], unit: str, sd: Any, noise: Any = None
) -> tuple[OwnState, ...]:
    """Two states of a kind of a sensor, or none where both are known to be zero.

    Raises
    ------
    ValueError
        Another number of standard deviations.
    """
    if np.shape(sd) not in ((), (2,)):
        raise ValueError(f"{name}: {argument} is one number or two, and is {sd!r}.")
    made = [own_state(s, unit, x, noise) for s, x in zip(states, [sd, sd] if np.shape(sd) == () else sd, strict=True)]
    if all(s is None for s in made):
        return ()
    return tuple(OwnState(s, unit) if m is None else m for s, m in zip(states, made, strict=True))


def along_vehicle(u: Float[Array, "3 R"], pitch: Float[Array, " R"], yaw: Float[Array, " R"]) -> Float[Array, "3 R"]:
    """A vector in b along the vehicle's axes: front, right, down."""
    ahead = jnp.cos(yaw) * u[0] + jnp.sin(yaw) * u[1]
    right = jnp.cos(yaw) * u[1] - jnp.sin(yaw) * u[0]
    front = jnp.cos(pitch) * ahead - jnp.sin(pitch) * u[2]
    return jnp.stack([front, right, jnp.sin(pitch) * ahead + jnp.cos(pitch) * u[2]])
