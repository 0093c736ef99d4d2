"""Parameters of PX4's EKF2, in the file that QGroundControl loads.

They are no densities: in a step dt of the prediction the variance of an angle grows by (EKF2_GYR_NOISE dt)^2 and that
of a bias by (EKF2_GYR_B_NOISE dt)^2, so that they are N/sqrt(dt) and K/sqrt(dt).
"""

import math

import numpy as np

from gmwm_jax.fitting.exports.noise import ImuNoise, comments, largest

STEP = 0.01
"""Of EKF2 unless EKF2_PREDICT_US says otherwise, s."""
_FLOAT = 9
"""MAV_PARAM_TYPE_REAL32."""
_PARAMETERS = {
    "gyro": (("EKF2_GYR_NOISE", "rad/s", "N", 1e-4, 0.1), ("EKF2_GYR_B_NOISE", "rad/s^2", "K", 0.0, 0.01)),
    "accel": (("EKF2_ACC_NOISE", "m/s^2", "N", 0.01, 1.0), ("EKF2_ACC_B_NOISE", "m/s^3", "K", 0.0, 0.01)),
}
"""Name, unit, what it is made from, and the ends of the range that PX4 documents."""


def px4(imu: ImuNoise) -> str:
    """Write the parameters of the sensors that there are."""
    remarks = [
        f"These numbers belong to a prediction step of {imu.step:g} s, EKF2_PREDICT_US = {1e6 * imu.step:.0f}: "
        "N/sqrt(step) and K/sqrt(step). In flight, vibration may be larger than the noise of a sensor at rest.",
    ]
    lines = []
    for sensor, parameters in _PARAMETERS.items():
        channels = getattr(imu, sensor)
        for name, unit, symbol, low, high in parameters if channels else ():
            value, of = largest(channels, lambda c, symbol=symbol: getattr(c.filter, symbol))
            value /= math.sqrt(imu.step)
            remarks.append(f"{name} [{unit}]: {of}")
            if not low <= value <= high:
                remarks.append(f"  outside of {low:g} to {high:g}, the range that PX4 documents: written as it is")
            digits = np.format_float_positional(value, precision=9, fractional=False, trim="0")
            lines.append(f"1\t1\t{name}\t{digits}\t{_FLOAT}")
    head = comments(imu, "PX4, parameters of EKF2", *remarks)
    return "\n".join([*head, "# Vehicle-Id Component-Id Name Value Type", *lines, ""])
