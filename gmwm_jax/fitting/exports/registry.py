"""The table of formats."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from gmwm_jax.fitting.exports.kalibr import kalibr, openvins
from gmwm_jax.fitting.exports.kf_gins import kf_gins
from gmwm_jax.fitting.exports.nav import nav_jax
from gmwm_jax.fitting.exports.noise import ChannelNoise, ImuNoise
from gmwm_jax.fitting.exports.px4 import STEP as PX4_STEP
from gmwm_jax.fitting.exports.px4 import px4
from gmwm_jax.fitting.exports.python import gtsam, pyins
from gmwm_jax.fitting.exports.ros import ros
from gmwm_jax.fitting.exports.vins import vins


class Format(NamedTuple):
    """One format."""

    title: str
    write: Callable[[ImuNoise], str]
    both: bool = False
    """Is it of no use without gyros and without accelerometers?"""
    positive: str = "N"
    """Which of N and K may not be zero: a covariance would have no inverse, or zero means something else."""
    axes: bool = False
    """Has each axis numbers of its own?"""
    step: float | None = None
    """Of the filter as it comes, s; None: as the samples."""

    def step_at(self, rate: float) -> float:
        """The step of the filter as it comes, and never less than a sampling interval."""
        return max(self.step or 0.0, 1 / rate)

    def text(self, channels: Sequence[ChannelNoise]) -> str:
        """The text of a file."""
        imu = ImuNoise.of(channels)
        if self.both:
            imu.require_both(self.title)
        for symbol in self.positive:
            imu.require_noise(self.title, symbol, every=self.axes)
        return self.write(imu)


FORMATS = {
    "kalibr": Format("Kalibr", kalibr, both=True, positive="NK"),
    "openvins": Format("OpenVINS", openvins, both=True),
    "vins": Format("VINS", vins, both=True, positive="NK"),
    "kf-gins": Format("KF-GINS", kf_gins, both=True, axes=True),
    "pyins": Format("pyins", pyins, axes=True, step=0.1),
    "gtsam": Format("GTSAM", gtsam, positive="NK", axes=True),
    "px4": Format("PX4", px4, step=PX4_STEP),
    "ros": Format("ROS", ros, axes=True),
    "nav-jax": Format("nav-jax", nav_jax, both=True, positive="", axes=True),
}


def format_of(name: str) -> Format:
    """Look up a format by its name.

    Raises
    ------
    ValueError
        There is none of this name.
    """
    if name not in FORMATS:
        raise ValueError(f"There is no format {name!r} to export to; there are {', '.join(FORMATS)}.")
    return FORMATS[name]
