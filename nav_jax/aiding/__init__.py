"""Aiding sensors, one a file: what they measure, how well, when, and what they measured.

A new sensor is one file here, with a class that derives from `AbstractAiding` (barometer.py is the shortest example), one
row in the registry, and one row in the table of the tests. Monte Carlo, analysis, design, tuning and smoother take it from
there.
"""  # noqa: E501

from nav_jax.aiding.barometer import Barometer as Barometer
from nav_jax.aiding.base import AbstractAiding as AbstractAiding
from nav_jax.aiding.fixes import Fixes as Fixes
from nav_jax.aiding.gnss import GnssPosition as GnssPosition
from nav_jax.aiding.gnss import GnssVelocity as GnssVelocity
from nav_jax.aiding.odometer import Odometer as Odometer
from nav_jax.aiding.registry import AIDING as AIDING
from nav_jax.aiding.states import OwnState as OwnState
