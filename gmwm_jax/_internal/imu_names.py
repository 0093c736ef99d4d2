"""Which axis of a gyro or accelerometer a column holds, told by its name."""

import re

from gmwm_jax._internal.columns import plain_name

GYRO = ("gyro_x", "gyro_y", "gyro_z")
ACCEL = ("accel_x", "accel_y", "accel_z")

_GYRO = (
    "gyro|gyr|gyros|gyroscope|omega|w|angular_velocity|angular_vel|ang_vel|angular_rate|ang_rate|angularvelocity|"
    "angularrate|angrate|rate|dtheta|dth|delta_theta|deltatheta|delta_angle|deltaangle|w_rs_s|w_ib_b|ω"
)
_ACCEL = (
    "accel|acc|accels|accelerometer|acceleration|linear_acceleration|linear_accel|lin_acc|specific_force|f|a|dv|dvel|"
    "delta_v|deltav|delta_vel|deltavel|delta_velocity|deltavelocity|velinc|vel_inc|a_rs_s|f_ib_b"
)
_PREFIX = r"(?:(?:imu|raw|uncomp|uncal|calib|cal|field|msg)_?)*"
_ROLES = {
    "gyro": re.compile(rf"{_PREFIX}(?:{_GYRO})_?([xyz])(?:_axis)?|g([xyz])"),
    "accel": re.compile(rf"{_PREFIX}(?:{_ACCEL})_?([xyz])(?:_axis)?"),
}


def role_of(name: str) -> str | None:
    """Return ``gyro_x`` ... ``accel_z`` for the name of a column without its unit, or None.

    Increments (``dtheta_x``, ``dvel_z``) are of the same axis as rates; their unit tells them apart.
    """
    plain = plain_name(name)
    for sensor, pattern in _ROLES.items():
        if found := pattern.fullmatch(plain):
            return f"{sensor}_{next(filter(None, found.groups()))}"
    return None
