"""Where a recorded drive starts: position, velocity and attitude from the fixes."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.recorded.gnss.record import GnssRecord

_WINDOW = 0.5
"""s, before and after the start, over which specific forces are averaged."""

_COURSE_SPEED = 2.0
"""m/s, from which a velocity tells where a vehicle heads."""


def between(imu: Imu, start: float | None = None, end: float | None = None) -> Imu:
    """The samples that begin at or after a time and end at or before another.

    Raises
    ------
    ValueError
        There are fewer than two.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.static(duration=2.0, rate=20.0))
    >>> nj.recorded.between(samples, 0.5, 1.0).time[[0, -1]].round(2).tolist()
    [0.5, 0.95]
    """
    slack = 1e-6 / imu.rate
    first = 0 if start is None else int(np.searchsorted(imu.time, start - slack))
    last = len(imu) if end is None else int(np.searchsorted(imu.epochs, end + slack, side="right")) - 1
    if last - first < 2:
        raise ValueError(
            f"The record is of {imu.time[0]:g} to {imu.epochs[-1]:g} s, and no two samples lie in what is asked for: "
            f"{imu.time[0] if start is None else start:g} to {imu.epochs[-1] if end is None else end:g} s."
        )
    return imu.part(first, last)


@dataclass(frozen=True, eq=False)
class Start:
    """Where a record starts.

    Attributes
    ----------
    time
        s, that of an IMU sample.
    position, velocity
        Of the antenna, NED in m and m/s.
    quaternion
        q_nb, scalar first.
    """

    time: float
    position: Float64[np.ndarray, "3"]
    velocity: Float64[np.ndarray, "3"]
    quaternion: Float64[np.ndarray, "4"]


def align_by_course(
    imu: Imu,
    fixes: GnssRecord,
    *,
    speed: Real = _COURSE_SPEED,
    gravity: Real = STANDARD_GRAVITY,
) -> Start:
    """The first moment at which a vehicle is fast enough, and its attitude there: it heads where it goes.

    Yaw is the course of the velocity. Roll and pitch are those that turn the mean specific force, over a second, into
    the acceleration of the fixes less gravity. Good to some degrees: as much as the mounting and the slip of the
    vehicle in yaw, and the bias of an accelerometer over gravity in roll and pitch.

    Parameters
    ----------
    imu
        Along the axes of the body, on the clock of the fixes.
    fixes
        With velocities, or with positions from which they are derived.
    speed
        m/s.
    gravity
        m/s^2.

    Raises
    ------
    ValueError
        The vehicle is never that fast while both are there; gravity does not point down in the body.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.straight(duration=10.0, rate=20.0, speed=5.0, heading=1.0))
    >>> fixes = nj.recorded.GnssRecord(exact.time[::20], exact.position[::20])
    >>> nj.recorded.align_by_course(samples, fixes).quaternion.round(6).tolist()  # yaw of 1 rad
    [0.877583, 0.0, 0.0, 0.479426]
    """
    limit = number("speed", speed)
    time, velocity = velocities(fixes)
    first, last = imu.time[0] + _WINDOW, imu.epochs[-1] - _WINDOW
    fast = np.flatnonzero((np.hypot(*velocity.T[:2]) >= limit) & (time >= first) & (time <= last))
    if not len(fast):
        inside = (time >= first) & (time <= last)
        most = np.hypot(*velocity[inside].T[:2]).max(initial=0.0)
        raise ValueError(
            f"No fix between {first:g} and {last:g} s has a speed of {limit:g} m/s, by which the attitude could be "
            f"told (the fastest of {inside.sum()} has {most:.3g} m/s): state the attitude, or look at the clocks of "
            f"the IMU ({imu.time[0]:g} to {imu.epochs[-1]:g} s) and of the fixes ({time[0]:g} to {time[-1]:g} s)."
        )
    at = float(imu.time[np.searchsorted(imu.time, time[fast[0]] - 1e-9)])
    v = _interpolated(time, velocity, at)
    ahead, behind = (_interpolated(time, velocity, at + s * _WINDOW) for s in (1, -1))
    pull = (ahead - behind) / (2 * _WINDOW) - np.array([0.0, 0.0, float(gravity)])
    near = np.abs(imu.time + 0.5 / imu.rate - at) <= _WINDOW
    yaw, force = float(np.arctan2(v[1], v[0])), imu.accel[near].mean(axis=0)
    if force[2] > -0.5 * float(gravity):
        points = "points up" if force[2] > 0.5 * float(gravity) else "does not point down"
        raise ValueError(
            f"Gravity {points} in this body at {at:g} s (specific force {force.round(2).tolist()} m/s^2; level it has "
            f"-{gravity:.2f} down): turn the samples by nav_jax.recorded.mounted, (pi, 0, 0) for an IMU upside down, "
            "or as nav_jax.recorded.find_mounting says."
        )
    roll, pitch = _levelled(force, pull, yaw)
    q = np.asarray(rotation.quat_from_euler(jnp.array([roll, pitch, yaw])))
    return Start(at, _interpolated(fixes.time, fixes.position, at), v, q)


def velocities(fixes: GnssRecord) -> tuple[np.ndarray, np.ndarray]:
    """Times and velocities: those of the file, whose missing components down are zero, or derivatives of positions."""
    if fixes.velocity is not None:
        there = np.isfinite(fixes.velocity[:, :2]).all(axis=1)
        return fixes.time[there], np.nan_to_num(fixes.velocity[there])
    if len(fixes) < 3:
        raise ValueError(f"There are {len(fixes)} fixes: velocities are derived from three positions or more.")
    return fixes.time, np.gradient(fixes.position, fixes.time, axis=0)


def _interpolated(time: np.ndarray, values: np.ndarray, at: float) -> np.ndarray:
    return np.array([np.interp(at, time, x) for x in values.T])


def _levelled(force: np.ndarray, pull: np.ndarray, yaw: float) -> tuple[float, float]:
    """Roll and pitch, near level, that turn a force in b into one in n, where yaw is known.

    With v the latter turned back by yaw: v_y = f_y cos r - f_z sin r, and pitch takes the rest to v_x, v_z.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = c * pull[0] + s * pull[1], c * pull[1] - s * pull[0], pull[2]
    size = np.hypot(force[1], force[2])
    roll = -np.arctan2(force[2], force[1]) - np.arccos(np.clip(y / size, -1.0, 1.0))
    below = force[1] * np.sin(roll) + force[2] * np.cos(roll)
    pitch = np.arctan2(x, z) - np.arctan2(force[0], below)
    return float(_wrapped(roll)), float(_wrapped(pitch))


def _wrapped(angle: float) -> float:
    return (angle + np.pi) % (2 * np.pi) - np.pi
