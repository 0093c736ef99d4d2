"""The aiding sensors by the names that configuration files know them by: one row a sensor."""

from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.gnss import GnssPosition, GnssVelocity
from nav_jax.aiding.odometer import Odometer

AIDING: dict[str, type[AbstractAiding]] = {
    "gnss_position": GnssPosition,
    "gnss_velocity": GnssVelocity,
    "barometer": Barometer,
    "odometer": Odometer,
}
