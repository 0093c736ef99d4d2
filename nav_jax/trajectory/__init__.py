"""Reference motions: generated, read from files, resampled, smoothed."""

from nav_jax.trajectory import motions as motions
from nav_jax.trajectory.files import read_trajectory as read_trajectory
from nav_jax.trajectory.files import save_trajectory as save_trajectory
from nav_jax.trajectory.motions import circle as circle
from nav_jax.trajectory.motions import climb as climb
from nav_jax.trajectory.motions import from_path as from_path
from nav_jax.trajectory.motions import helix as helix
from nav_jax.trajectory.motions import lemniscate as lemniscate
from nav_jax.trajectory.motions import racetrack as racetrack
from nav_jax.trajectory.motions import static as static
from nav_jax.trajectory.motions import straight as straight
from nav_jax.trajectory.motions import waypoints as waypoints
from nav_jax.trajectory.trajectory import Trajectory as Trajectory
