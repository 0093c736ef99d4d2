"""Covariances of the messages ``sensor_msgs/Imu``, for filters that take them from there, as robot_localization does.

A filter that takes each message as an independent measurement sees white noise of the variance R per message as a
density R step: R = N^2/step. It is the variance of a sample only where the noise is white from sample to sample.
"""

from gmwm_jax.fitting.exports.noise import ImuNoise, comments, reals, three_axes


def ros(imu: ImuNoise) -> str:
    """Write the covariances, row by row as in the message."""
    bias = (
        "Bias: left out, since a message has white noise only, and robot_localization has no state for it. All "
        "components that are not white are in K, a random walk of their Allan deviation at T: beyond T the filter "
        "believes too much."
    )
    remark = f"Covariances belong to a message every {imu.step:g} s: N^2/step."
    lines = comments(imu, "ROS, covariances of sensor_msgs/Imu", remark, bias=bias)
    for key, channels, unit in (
        ("angular_velocity_covariance", imu.gyro, "(rad/s)^2"),
        ("linear_acceleration_covariance", imu.accel, "(m/s^2)^2"),
    ):
        if channels:
            x, y, z = (c.filter.N**2 / imu.step for c in three_axes(channels))
            lines.append(f"{key}: {reals([x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z])}  # {unit}")
    return "\n".join([*lines, ""])
