"""Lines of Python: pyins's ``InertialSensorModel`` and the preintegration of GTSAM."""

from gmwm_jax.fitting.exports.noise import ImuNoise, comments, reals, three_axes


def pyins(imu: ImuNoise) -> str:
    """Write the arguments of pyins's sensor models, strengths in SI."""
    lines = comments(
        imu,
        "pyins, noise of inertial_sensor.InertialSensorModel",
        "noise: N; bias_walk: K. A bias walks only where bias_sd, the turn-on bias that you know, is positive:",
        "InertialSensorModel(bias_sd=..., **GYRO)",
    )
    for name, channels, signal in (("GYRO", imu.gyro, "rad/s"), ("ACCEL", imu.accel, "m/s^2")):
        if not channels:
            continue
        axes = three_axes(channels)
        lines += [
            f"{name} = {{",
            f'    "noise": {reals([c.filter.N for c in axes])},  # {signal}/sqrt(Hz)',
            f'    "bias_walk": {reals([c.filter.K for c in axes])},  # {signal}/s/sqrt(Hz)',
            "}",
        ]
    return "\n".join([*lines, ""])


def gtsam(imu: ImuNoise) -> str:
    """Write a function that sets the covariances of GTSAM's parameters, densities squared."""
    lines = comments(
        imu,
        "GTSAM, covariances of PreintegrationCombinedParams",
        "Covariances of continuous time, N^2 and K^2. Make params with your gravity and frame, then set_noise(params).",
        "PreintegrationParams, for ImuFactor, have no biases: leave those lines out.",
    )
    lines += ["import numpy as np", "", "", "def set_noise(params):"]
    for name, bias, channels, signal in (
        ("Gyroscope", "BiasOmega", imu.gyro, "(rad/s)^2"),
        ("Accelerometer", "BiasAcc", imu.accel, "(m/s^2)^2"),
    ):
        if not channels:
            continue
        axes = three_axes(channels)
        lines += [
            f"    params.set{name}Covariance(np.diag({reals([c.filter.N**2 for c in axes])}))  # {signal}/Hz",
            f"    params.set{bias}Covariance(np.diag({reals([c.filter.K**2 for c in axes])}))  # {signal}/s",
        ]
    return "\n".join([*lines, ""])
