"""Attitudes that follow from a motion."""

from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from gmwm_jax._internal.typing import Quaternions, Real, Times, Vectors
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.kinematics import rotation


def coordinated_attitude(velocity: Any, acceleration: Any, gravity: Real = STANDARD_GRAVITY) -> Quaternions:
    """Quaternions q_nb (N, 4) of a flight without slip: x along the velocity, the specific force in the x-z plane.

    Parameters
    ----------
    velocity, acceleration
        In n, shapes (N, 3).
    gravity
        In m/s^2.

    Raises
    ------
    ValueError
        No velocity, or no specific force across it (free fall), at some epoch.
    """
    v, a = np.asarray(velocity), np.asarray(acceleration)
    forward = _unit(v, "velocity", "nose")
    lift = a - np.array([0.0, 0.0, gravity])
    lift = lift - np.einsum("ij,ij->i", lift, forward)[:, None] * forward
    down = -_unit(lift, "specific force across the velocity", "wings")
    dcm = np.stack([forward, np.cross(down, forward), down], axis=-1)
    return np.asarray(rotation.quat_from_dcm(dcm.transpose(1, 2, 0))).T


def attitude_of_navigation(time: Times, w: Real) -> Vectors:
    """Roll, pitch, yaw in rad of ``lemniscate_traj_ned`` of the R package navigation, as its data show.

    Parameters
    ----------
    time
        In s. Its spline ends at 600 s, and here at the end of a longer motion.
    w
        Angular frequency of the lemniscate in rad/s.
    """
    step = 0.01  # its sampling interval in s

    def curvature(t):
        v = np.cos(w * t), np.cos(2 * w * t)
        a = -np.sin(w * t), -2 * np.sin(2 * w * t)
        return (v[0] * a[1] - v[1] * a[0]) / np.hypot(*v) ** 3

    most = np.abs(curvature(np.arange(60001) * step)).max()
    seconds = np.arange(max(600, int(np.ceil(time[-1]))) + 1.0)
    coarse = np.pi / 9 * np.abs(curvature(seconds)) / most
    # R's spline: the third derivative at each end is that of the cubic through the last four points
    ends = [[(3, float(np.diff(four, 3)[0]))] for four in (coarse[:4], coarse[-4:])]
    pitch = make_interp_spline(seconds, coarse, k=3, bc_type=tuple(ends))(time)
    yaw = np.unwrap(np.arctan2(np.cos(2 * w * time) * np.sin(2 * w * step), 2 * np.cos(w * time) * np.sin(w * step)))
    return np.stack([-np.pi / 4 * curvature(time) / most, pitch, yaw], axis=1)


def _unit(vectors: np.ndarray, what: str, part: str) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    bad = length[:, 0] < 1e-9
    if bad.any():
        raise ValueError(
            f"There is no {what} at epoch {int(bad.argmax())}, and so no attitude of the {part} that follows from the "
            "motion: give attitude=(roll, pitch, yaw) in rad."
        )
    return vectors / length
