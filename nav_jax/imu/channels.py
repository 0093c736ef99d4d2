"""What a filter's error state holds besides the nine of navigation: the states of the sensor errors."""

from typing import NamedTuple

CHANNELS = ("accel x", "accel y", "accel z", "gyro x", "gyro y", "gyro z")
"""The six sensitive axes of an IMU, in the order of every array of sensor errors."""


class SensorState(NamedTuple):
    """One state of a sensor error model."""

    channel: int
    """Position in `CHANNELS`."""
    label: str
    """The process, as `GM_1`."""

    def __str__(self) -> str:
        return f"{CHANNELS[self.channel]} {self.label}"
