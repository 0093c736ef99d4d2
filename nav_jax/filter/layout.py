"""What the error state consists of, and what is kept of it: the one place that knows its order and sizes.

A `Layout` is a row of named blocks. `NAVIGATION` are the errors of position, velocity and attitude with which every
error state begins; `error_state` puts the states of a filter's sensors behind them; `JUDGED` are the columns of
results: navigation, and the errors of the six channels of an IMU in place of the states behind them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import pi

from nav_jax.imu.channels import CHANNELS, GRAVITY, SensorState


@dataclass(frozen=True)
class Block:
    """Components of an error that belong together."""

    name: str
    components: tuple[str, ...]
    unit: str
    """SI."""
    frame: str = ""
    """In which the components are: n, b, or none."""
    start: str = ""
    """What gives its standard deviations at the start: an argument of `InitialUncertainty`, or a prior."""

    @property
    def size(self) -> int:
        """Number of components."""
        return len(self.components)


@dataclass(frozen=True)
class Layout:
    """Blocks one after the other. Static: it may be an argument or a field of compiled programs."""

    blocks: tuple[Block, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the blocks."""
        return tuple(b.name for b in self.blocks)

    @property
    def size(self) -> int:
        """Number of all components."""
        return sum(b.size for b in self.blocks)

    @property
    def components(self) -> tuple[str, ...]:
        """Names of all components: the block and the component."""
        return tuple(f"{b.name}_{c}" for b in self.blocks for c in b.components)

    @property
    def units(self) -> tuple[str, ...]:
        """SI unit of every component."""
        return tuple(b.unit for b in self.blocks for _ in b.components)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def block(self, name: str) -> Block:
        """The block of a name, or a ValueError that lists them."""
        for b in self.blocks:
            if b.name == name:
                return b
        raise ValueError(f"{name!r} is none of the blocks {', '.join(self.names)}.")

    def __getitem__(self, name: str) -> slice:
        """Where a block is."""
        return _slices(self)[self.names.index(self.block(name).name)]

    def columns(self, *names: str) -> tuple[int, ...]:
        """Where the components of several blocks are, in the order of the names."""
        return tuple(i for name in names for i in range(self.size)[self[name]])

    def followed_by(self, *blocks: Block) -> "Layout":
        """The same with blocks behind it."""
        return Layout((*self.blocks, *blocks))


@cache
def _slices(layout: Layout) -> tuple[slice, ...]:
    """Where each block is."""
    ends, at = [], 0
    for b in layout.blocks:
        ends.append(slice(at, at + b.size))
        at += b.size
    return tuple(ends)


_NED = ("n", "e", "d")

NAVIGATION = Layout(
    (
        Block("position", _NED, "m", "n", "position_sd"),
        Block("velocity", _NED, "m/s", "n", "velocity_sd"),
        Block("attitude", _NED, "rad", "n", "attitude_sd"),
    )
)
"""The errors with which every error state begins; that of the attitude is a rotation vector."""

POSITION, VELOCITY, ATTITUDE = (NAVIGATION[name] for name in NAVIGATION.names)


def _channels(sensor: str, unit: str) -> Block:
    return Block(sensor, tuple(c.split()[1] for c in CHANNELS if c.startswith(sensor)), unit, "b")


JUDGED = NAVIGATION.followed_by(_channels("accel", "m/s^2"), _channels("gyro", "rad/s"))
"""The columns of errors and standard deviations in results."""

ON_CHANNELS = slice(NAVIGATION.size, JUDGED.size)
"""Those columns of results that belong to the channels of an IMU."""

GROUPS = {
    "position": ("position",), "velocity": ("velocity",), "attitude": ("attitude",), "pose": ("position", "attitude"),
    "navigation": ("position", "velocity", "attitude"), "sensors": ("accel", "gyro"),
}  # fmt: skip
"""Groups of states with a NEES, and their blocks."""

QUANTITIES = {
    "position": (NAVIGATION.columns("position"), "m", 1.0),
    "horizontal": (NAVIGATION.columns("position")[:2], "m", 1.0),
    "vertical": (NAVIGATION.columns("position")[2:], "m", 1.0),
    "velocity": (NAVIGATION.columns("velocity"), "m/s", 1.0),
    "tilt": (NAVIGATION.columns("attitude")[:2], "deg", 180 / pi),
    "heading": (NAVIGATION.columns("attitude")[2:], "deg", 180 / pi),
}
"""RMS errors of analyses: columns of the covariance of navigation, the unit they are shown in, and that in SI."""


def error_state(states: Sequence[SensorState], own: Sequence[Block] = ()) -> Layout:
    """The error state of a filter.

    Parameters
    ----------
    states
        Of its bank: those of the IMU, behind them those of gravity, and behind them those of the aiding sensors.
    own
        Blocks of the states of the aiding sensors.
    """
    of_imu = tuple(str(s) for s in states if s.is_of_imu)
    of_gravity = tuple(_NED[GRAVITY.index(s.channel)] for s in states if s.channel in GRAVITY)
    gravity = [Block("gravity", of_gravity, "m/s^2", "n", "GravityDisturbance")] if of_gravity else []
    return NAVIGATION.followed_by(Block("imu", of_imu, "SI", "b", "ImuErrors"), *gravity, *own)


def channel_columns(channels: Sequence[int]) -> tuple[int, ...]:
    """Columns of results that belong to some of the channels of an IMU."""
    return tuple(range(JUDGED.size)[ON_CHANNELS][c] for c in channels)
