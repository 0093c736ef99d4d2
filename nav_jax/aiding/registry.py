"""The aiding sensors by the names that configuration files know them by: one row a sensor."""

from nav_jax.aiding.barometer import Barometer
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.dual_antenna import DualAntenna
from nav_jax.aiding.gnss import Gnss, GnssPosition, GnssVelocity
from nav_jax.aiding.magnetometer import Magnetometer
from nav_jax.aiding.non_holonomic import NonHolonomic
from nav_jax.aiding.odometer import Odometer
from nav_jax.aiding.standstill import ZeroRate, ZeroVelocity

AIDING: dict[str, type[AbstractAiding]] = {
    "gnss": Gnss,
    "gnss_position": GnssPosition,
    "gnss_velocity": GnssVelocity,
    "barometer": Barometer,
    "odometer": Odometer,
    "non_holonomic": NonHolonomic,
    "zero_velocity": ZeroVelocity,
    "zero_rate": ZeroRate,
    "magnetometer": Magnetometer,
    "dual_antenna": DualAntenna,
}
