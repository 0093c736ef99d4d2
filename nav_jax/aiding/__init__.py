"""Aiding sensors, one a file: what they measure, how well, when, and what they measured."""

from nav_jax.aiding.barometer import Barometer as Barometer
from nav_jax.aiding.base import AbstractAiding as AbstractAiding
from nav_jax.aiding.fixes import Fixes as Fixes
from nav_jax.aiding.gnss import GnssPosition as GnssPosition
from nav_jax.aiding.gnss import GnssVelocity as GnssVelocity
from nav_jax.aiding.odometer import Odometer as Odometer
from nav_jax.aiding.registry import AIDING as AIDING
from nav_jax.aiding.states import OwnState as OwnState
