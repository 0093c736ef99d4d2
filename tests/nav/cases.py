"""Motions and comparisons that several test files share."""

import jax.numpy as jnp
from scipy.spatial.transform import Rotation

from nav_jax.trajectory import motions

POINTS = [[0, 0, 0], [200, 0, -10], [350, 150, -20], [250, 350, -20], [0, 300, 0], [-150, 150, 0], [0, 0, -5]]
TIMES = [0.0, 8.0, 18.0, 30.0, 42.0, 51.0, 60.0]

MOTIONS = {
    "lemniscate": lambda **k: motions.lemniscate(60.0, **k),
    "navigation": lambda **k: motions.lemniscate(60.0, attitude="navigation", **k),
    "static": lambda **k: motions.static(60.0, euler=(0.1, -0.2, 3.0), position=(1, 2, 3), **k),
    "straight": lambda **k: motions.straight(60.0, heading=0.7, angle=0.1, acceleration=0.2, **k),
    "circle": lambda **k: motions.circle(60.0, **k),
    "racetrack": lambda **k: motions.racetrack(60.0, **k),
    "climb": lambda **k: motions.climb(60.0, **k),
    "helix": lambda **k: motions.helix(60.0, **k),
    "waypoints": lambda **k: motions.waypoints(POINTS, times=TIMES, **k),
}
"""All of one length: programs are compiled for a number of samples."""


def vertical_loop(t, radius, rate):
    return jnp.stack([radius * jnp.sin(rate * t), 0.0 * t, -radius * (1.0 - jnp.cos(rate * t))])


def angle_between(a, b):
    """Largest rotation in rad between two trajectories."""
    one, two = (Rotation.from_quat(x.quaternion, scalar_first=True) for x in (a, b))
    return (one * two.inv()).magnitude().max()
