"""GNSS position."""

from typing import ClassVar

import jax.numpy as jnp

from nav_jax.aiding._ned import AbstractNed


class GnssPosition(AbstractNed):
    """Position fixes in m, north, east, down; the parameters are those of `AbstractNed`."""

    unit: ClassVar[str] = "m"
    default_name: ClassVar[str] = "gnss_position"

    def predict(self, p, v):  # noqa: D102
        return p

    def jacobian(self):  # noqa: D102
        return jnp.eye(9)[0:3]
