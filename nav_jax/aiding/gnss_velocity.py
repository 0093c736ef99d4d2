"""GNSS velocity."""

from typing import ClassVar

import jax.numpy as jnp

from nav_jax.aiding._ned import AbstractNed


class GnssVelocity(AbstractNed):
    """Velocity fixes in m/s, north, east, down; the parameters are those of `AbstractNed`."""

    unit: ClassVar[str] = "m/s"
    default_name: ClassVar[str] = "gnss_velocity"

    def predict(self, p, v):  # noqa: D102
        return v

    def jacobian(self):  # noqa: D102
        return jnp.eye(9)[3:6]
