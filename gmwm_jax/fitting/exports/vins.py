"""The four lines of a VINS-Mono or VINS-Fusion configuration.

They are no densities. In a step dt of the preintegration, which is the interval of the IMU's messages, the variance of
the velocity grows by 2 (acc_n dt/2)^2, since two samples are averaged whose noise is taken as independent in every
step, and that of a bias by (acc_w dt)^2. White noise of density N and a random walk K have N^2 dt and K^2 dt, hence
acc_n = sqrt(2/dt) N and acc_w = K/sqrt(dt); for gyros alike.
"""

import math

from gmwm_jax.fitting.exports.noise import ImuNoise, comments, largest, real


def vins(imu: ImuNoise) -> str:
    """Write the lines."""
    remarks = (
        f"These numbers belong to IMU messages every {imu.step:g} s, the step.",
        "acc_n, gyr_n: sqrt(2/step) N, sqrt(2) times the standard deviation of a sample, since the preintegration "
        "averages two samples as if they were independent in every step.",
        "acc_w, gyr_w: K/sqrt(step), whose square it adds times step^2 in every step.",
    )
    lines = []
    for key, channels, signal in (("acc", imu.accel, "m/s^2"), ("gyr", imu.gyro, "rad/s")):
        N, of_N = largest(channels, lambda c: c.filter.N)
        K, of_K = largest(channels, lambda c: c.filter.K)
        lines += [
            f"{key}_n: {real(math.sqrt(2 / imu.step) * N)}  # {signal}, {of_N}",
            f"{key}_w: {real(K / math.sqrt(imu.step))}  # {signal}/s, {of_K}",
        ]
    return "\n".join([*comments(imu, "VINS, lines of the configuration", *remarks), *lines, ""])
