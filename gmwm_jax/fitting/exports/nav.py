"""What ``nav-jax`` reads: every component as it is, as `gmwm-jax fit --json` has it."""

import json

from gmwm_jax.fitting.exports.noise import ImuNoise, three_axes


def nav_jax(imu: ImuNoise) -> str:
    """Write the models of the channels, named by sensor and axis; one channel of a sensor serves its three axes."""
    content = []
    for sensor, channels in (("accel", imu.accel), ("gyro", imu.gyro)):
        for axis, c in zip("xyz", three_axes(channels) if len(channels) > 1 else channels, strict=False):
            content.append(
                {
                    "channel": f"{sensor}_{axis}",
                    "unit": c.filter.unit,
                    "rate": c.filter.rate,
                    "processes": [dict(p) for p in c.processes],
                    "note": f"{c.name}: parameters per sample at this rate, in SI; no component is left out"
                    + "".join(f"; warning: {text}" for text in c.warnings),
                }
            )
    return json.dumps(content, indent=1, allow_nan=False) + "\n"
