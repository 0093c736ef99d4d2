"""What an alignment found, as a table and as numbers for a file."""

from typing import Any, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.text_table import format_table
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.kinematics import rotation

_ANGLES = ("roll", "pitch", "yaw")


@runtime_checkable
class Aligned(Protocol):
    """A start whose covariance and biases of gyros are known too."""

    @property
    def time(self) -> float: ...  # noqa: D102
    @property
    def position(self) -> Float64[np.ndarray, "3"]: ...  # noqa: D102
    @property
    def velocity(self) -> Float64[np.ndarray, "3"]: ...  # noqa: D102
    @property
    def quaternion(self) -> Float64[np.ndarray, "4"]: ...  # noqa: D102
    @property
    def gyro_bias(self) -> Float64[np.ndarray, "3"]: ...  # noqa: D102
    @property
    def initial(self) -> InitialUncertainty: ...  # noqa: D102


def euler_deg(start: Aligned) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Roll, pitch, yaw and their standard deviations, deg.

    An error vector in n turns the body by the rates of the angles about the axes that they turn about.
    """
    angles = np.rad2deg(rotation.euler_from_quat(jnp.asarray(start.quaternion)))
    pitch, yaw = np.deg2rad(angles[1:])
    axes = np.array([[np.cos(yaw) * np.cos(pitch), -np.sin(yaw), 0.0], [np.sin(yaw) * np.cos(pitch), np.cos(yaw), 0.0],
                     [-np.sin(pitch), 0.0, 1.0]])  # fmt: skip
    by = np.linalg.inv(axes)
    return angles, np.rad2deg(np.sqrt(np.diag(by @ np.asarray(start.initial.covariance)[6:, 6:] @ by.T)))


def start_table(start: Aligned) -> str:
    """Angles, position and velocity with their standard deviations, a line each."""
    P = np.asarray(start.initial.covariance)
    values = np.concatenate([start.position, start.velocity])
    axes = [(f"{name} {axis}", unit) for name, unit in (("position", "m"), ("velocity", "m/s")) for axis in "NED"]
    rows = [[name, "deg", f"{x:.4f}", f"{sd:.2g}"] for name, x, sd in zip(_ANGLES, *euler_deg(start), strict=True)]
    rows += [
        [name, unit, f"{x:.4f}", f"{np.sqrt(v):.2g}"]
        for (name, unit), x, v in zip(axes, values, np.diag(P)[:6], strict=True)
    ]
    return f"Start at {start.time:.10g} s\n" + format_table(["", "unit", "value", "sd"], rows, left=2)


def start_dict(start: Aligned) -> dict[str, Any]:
    """The same and what it is made of, as numbers of JSON."""
    angles, sd = euler_deg(start)
    return {
        "time": start.time,
        "euler_deg": dict(zip(_ANGLES, angles.tolist(), strict=True)),
        "euler_sd_deg": dict(zip(_ANGLES, sd.tolist(), strict=True)),
        "position": start.position.tolist(),
        "velocity": start.velocity.tolist(),
        "quaternion": start.quaternion.tolist(),
        "covariance": np.asarray(start.initial.covariance).tolist(),
        "gyro_bias": start.gyro_bias.tolist(),
    }
