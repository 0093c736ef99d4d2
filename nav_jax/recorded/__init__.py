"""Recorded drives: read, navigated, and their noise parameters tuned."""

from nav_jax.recorded.files import read_fixes as read_fixes
from nav_jax.recorded.files import read_imu as read_imu
from nav_jax.recorded.likelihood import innovation_loss as innovation_loss
from nav_jax.recorded.navigation import Navigation as Navigation
from nav_jax.recorded.navigation import navigate as navigate
from nav_jax.recorded.tuning import Tuning as Tuning
from nav_jax.recorded.tuning import tune as tune
