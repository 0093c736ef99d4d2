"""The attitude of a vehicle that stands: level from gravity, heading from the turning Earth, biases from the rest."""

import warnings
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number, real_array
from gmwm_jax._internal.typing import Real
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.recorded.alignment import Start
from nav_jax.recorded.plausibility import ImplausibleRecordWarning
from nav_jax.recorded.start_summary import start_dict, start_table

_OFF = 0.05
"""Share of gravity by which the mean specific force may differ from it: biases of 50 mg are those of no IMU at rest."""
_TURNING = np.deg2rad(100.0)
"""rad/s of mean rate, beyond the turn-on bias of any gyro."""
_SUSPECT = np.deg2rad(10.0)
"""rad/s, beyond that of most."""
_SURE = np.deg2rad(10.0)
"""rad of heading, beyond which filters that linearise do not work."""


@dataclass(frozen=True, eq=False)
class StartAtRest(Start):
    """Where a record starts at rest, with what that leaves unknown.

    Attributes
    ----------
    gyro_bias
        Mean of the gyros less the rate of the Earth, rad/s.
    initial
        Of the start: tilts and heading, which depends on a tilt where the gyros tell it; the position as stated.
    """

    gyro_bias: Float64[np.ndarray, "3"]
    initial: InitialUncertainty

    def __repr__(self) -> str:
        return start_table(self)

    def to_dict(self) -> dict[str, Any]:
        """As numbers of JSON, with angles in deg too."""
        return start_dict(self)


def align_at_rest(
    imu: Imu,
    *,
    position: Any = (0.0, 0.0, 0.0),
    position_sd: Any = 0.0,
    yaw: Real | None = None,
    yaw_sd: Real | None = None,
    accel_bias_sd: Real = 0.0,
    gyro_bias_sd: Real = 0.0,
    earth: AbstractEarth | None = None,
) -> StartAtRest:
    """Level the body by gravity, and find its heading by the rate of the Earth where the gyros are good enough.

    With the mean specific force f and body rate w (Groves 2013, sec. 5.6): roll = atan2(-f_y, -f_z),
    pitch = atan2(f_x, |f_y, f_z|), and the yaw that turns the level part of w to the north. Biases b of the
    accelerometers tilt it by b / g; such a tilt about north turns it by tan L as much, and a bias of the gyros along
    east by b / (W cos L), and so does their noise. Of a MEMS gyro that is no heading, so that the yaw is given.

    Parameters
    ----------
    imu
        At rest all the time, along the axes of the body; the result is of its end.
    position, position_sd
        North, east, down in m, and standard deviations.
    yaw, yaw_sd
        rad, of a heading that is known, such as that of a parking space; found from the gyros unless given.
    accel_bias_sd, gyro_bias_sd
        Standard deviations of what the biases may be, m/s^2 and rad/s.
    earth
        Its gravity and its rate; a `FlatEarth` unless given, which does not turn.

    Raises
    ------
    ValueError
        Gravity points up in the body, or is not that of the Earth; the gyros turn by more than 100 deg/s, or by another
        rate than that of the Earth where they tell the heading; they cannot tell it, and none is given; a yaw without
        its standard deviation, or in deg.

    Warns
    -----
    ImplausibleRecordWarning
        The gyros turn by more than 10 deg/s in the mean.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.static(duration=4.0, rate=20.0, euler=(0.0, 0.0, 0.5)))
    >>> start = nj.recorded.align_at_rest(samples, yaw=0.5, yaw_sd=0.05, accel_bias_sd=0.05)
    >>> start.quaternion.round(6)[[0, 3]].tolist()
    [0.968912, 0.247404]
    """
    earth = FlatEarth() if earth is None else earth
    p = real_array("position", position, (3,))
    g_n = np.asarray(earth.gravity_n(jnp.asarray(p)))
    w_n = np.asarray(earth.rate_n(jnp.asarray(p)))
    g, f, w = float(np.linalg.norm(g_n)), imu.accel.mean(axis=0), imu.gyro.mean(axis=0)
    size = float(np.linalg.norm(f))
    if abs(size / g - 1) > _OFF:
        raise ValueError(
            f"The mean specific force is {size:.4g} m/s^2 and gravity {g:.4g}: the record is not at rest, its unit is "
            f"another ({size * g:.4g} m/s^2 if it is in g), or a sensor is wrong."
        )
    if f[2] > 0:
        raise ValueError(
            f"Gravity points up in this body (specific force {f.round(2).tolist()} m/s^2; level and at rest it has "
            f"-{g:.2f} down): turn the samples by nav_jax.recorded.mounted, (pi, 0, 0) for an IMU upside down."
        )
    _check_rate(float(np.linalg.norm(w)), w_n, yaw is None)
    roll, pitch = float(np.arctan2(-f[1], -f[2])), float(np.arctan2(f[0], np.hypot(f[1], f[2])))
    tilt = number("accel_bias_sd", accel_bias_sd, zero_ok=True) / g
    follows = 0.0
    if yaw is None:
        yaw, turned = _gyrocompass(imu, w, w_n, roll, pitch, number("gyro_bias_sd", gyro_bias_sd, zero_ok=True))
        # tilted about north, the axis of the Earth leans to the east, which looks like a turn: psi_D = -tan L psi_N
        follows = float(w_n[2] / np.hypot(w_n[0], w_n[1]))
    elif yaw_sd is None:
        raise ValueError("Give the standard deviation of the yaw, yaw_sd in rad, beside the yaw.")
    else:
        yaw, turned = number("yaw", yaw, negative_ok=True), number("yaw_sd", yaw_sd, zero_ok=True)
        if abs(yaw) > 2 * np.pi or turned > np.pi:
            raise ValueError(f"yaw and yaw_sd are in rad, and are {yaw:g} and {turned:g}: np.deg2rad converts deg.")
    q = np.asarray(rotation.quat_from_euler(jnp.array([roll, pitch, yaw])))
    bias = w - np.asarray(rotation.rotate_back(jnp.asarray(q), jnp.asarray(w_n)))
    factor = np.array([[tilt, 0.0, 0.0], [0.0, tilt, 0.0], [follows * tilt, 0.0, turned]])
    C = np.array(InitialUncertainty(position_sd).covariance)
    C[6:, 6:] = factor @ factor.T
    initial = InitialUncertainty(covariance=C)
    return StartAtRest(float(imu.epochs[-1]), p, np.zeros(3), q, bias, initial)


def _check_rate(size: float, w_n: np.ndarray, tells_heading: bool) -> None:
    """Raise where gyros at rest turn as none does, and warn where few do."""
    known = f"The mean of the gyros is {size:.4g} rad/s at rest"
    units = f"in deg/s it would be {np.deg2rad(size):.3g} rad/s, in deg/h {np.deg2rad(size) / 3600:.3g}"
    if size > _TURNING:
        raise ValueError(f"{known}: the body turns, or their unit is another ({units}).")
    if size > _SUSPECT:
        text = f"{known}, {np.rad2deg(size):.3g} deg/s: the body turns, their unit is another ({units}), or a bias is."
        warnings.warn(text, ImplausibleRecordWarning, stacklevel=3)
    of_earth = float(np.linalg.norm(w_n))
    if tells_heading and of_earth and not 0.5 < size / of_earth < 2.0:
        raise ValueError(
            f"{known}, {size / of_earth:.4g} times the rate of the Earth, by which they should tell the heading: their "
            f"unit is another ({units}), or a bias is larger than that. Take it off, or give the yaw."
        )


def _gyrocompass(imu: Imu, w: np.ndarray, w_n: np.ndarray, roll: float, pitch: float, sd: float) -> tuple[float, float]:
    """Yaw, and its standard deviation by bias and noise."""
    north = float(np.hypot(w_n[0], w_n[1]))
    noise = float(imu.gyro.std(axis=0).max()) / np.sqrt(len(imu))
    error = float(np.hypot(sd, noise))
    if error >= _SURE * north:
        known = "on an Earth that does not turn" if not north else f"with {np.rad2deg(error) * 3600:.3g} deg/h of bias"
        raise ValueError(
            f"Gyros {known} do not tell a heading: the horizontal rate of the Earth is "
            f"{np.rad2deg(north) * 3600:.3g} deg/h. Give the yaw, or align on the move with align_by_course."
        )
    level = rotation.quat_from_euler(jnp.array([roll, pitch, 0.0]))
    x, y, _ = np.asarray(rotation.rotate(level, jnp.asarray(w)))
    # the level part of the rate points to the north, and a heading of psi turns it by -psi
    return float(np.arctan2(-y, x) + np.arctan2(w_n[1], w_n[0])), error / north
