"""What a filter's error state holds besides the nine of navigation: the states of the sensor errors."""

from typing import NamedTuple

CHANNELS = ("accel x", "accel y", "accel z", "gyro x", "gyro y", "gyro z")
"""The six sensitive axes of an IMU, in the order of every array of sensor errors."""

GRAVITY = (6, 7, 8)
"""Channels of states that are gravity along n: no axis of the IMU reads them, but a mechanisation does."""

TEMPERATURE = len(CHANNELS)
"""Row of what is sensed, behind those of the channels: the temperature less that at the start, where it is known."""

NO_CHANNEL = -1
"""Channel of a state that no axis of the IMU reads, such as one of an aiding sensor."""

NAMES = (*CHANNELS, "gravity n", "gravity e", "gravity d")
"""Of all channels."""


class SensorState(NamedTuple):
    """One state of a sensor error model."""

    channel: int
    """Position in `CHANNELS`, one of `GRAVITY`, or `NO_CHANNEL`."""
    label: str
    """The process, as `GM_1`."""
    in_filter: bool = True
    """Does a filter hold it? The truth has states that no filter has, such as those of quantisation noise."""

    reads: int | None = None
    """The channel of whose reading its effect is a multiple, or `TEMPERATURE`; None where it is always the same."""

    @property
    def is_of_imu(self) -> bool:
        """Does an axis of the IMU read it?"""
        return 0 <= self.channel < len(CHANNELS)

    def __str__(self) -> str:
        return self.label if self.channel == NO_CHANNEL else f"{NAMES[self.channel]} {self.label}"
