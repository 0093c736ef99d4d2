"""Inertial sensors: perfect ones, the models of their errors (the door to gmwm_jax), and how both are emulated."""

from nav_jax.imu.deterministic import DETERMINISTIC as DETERMINISTIC
from nav_jax.imu.deterministic import Misalignment as Misalignment
from nav_jax.imu.deterministic import ScaleFactor as ScaleFactor
from nav_jax.imu.errors import ImuErrors as ImuErrors
from nav_jax.imu.imu import Imu as Imu
from nav_jax.imu.imu import NoisyReferenceWarning as NoisyReferenceWarning
from nav_jax.imu.imu import perfect_imu as perfect_imu
from nav_jax.imu.recorded import RecordedErrors as RecordedErrors
