"""Rotations, the Earth, the mechanisation of inertial sensors, and small matrices with runs as their last axis."""

from nav_jax.kinematics.earth import AbstractEarth as AbstractEarth
from nav_jax.kinematics.earth import FlatEarth as FlatEarth
from nav_jax.kinematics.geodetic import FarOriginWarning as FarOriginWarning
from nav_jax.kinematics.wgs84 import Wgs84 as Wgs84
