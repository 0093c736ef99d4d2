"""Names of what is kept of a run: the columns of its errors with their units, and groups of states with a NEES."""

BLOCKS = {
    "position": slice(0, 3),
    "velocity": slice(3, 6),
    "attitude": slice(6, 9),
    "accel": slice(9, 12),
    "gyro": slice(12, 15),
}
"""Columns of errors and standard deviations."""

UNITS = {"position": "m", "velocity": "m/s", "attitude": "rad", "accel": "m/s^2", "gyro": "rad/s"}

AXES = {"position": "ned", "velocity": "ned", "attitude": "ned", "accel": "xyz", "gyro": "xyz"}

COMPONENTS = tuple(f"{block}_{axis}" for block in BLOCKS for axis in AXES[block])
"""Names of the 15 columns."""

GROUPS = ("position", "velocity", "attitude", "pose", "navigation", "sensors")
"""Of states; pose: position and attitude, navigation: all nine of the trajectory."""


def block_columns(name: str) -> slice:
    """Columns of a block, or a ValueError that lists them."""
    if name not in BLOCKS:
        raise ValueError(f"{name!r} is none of the blocks {', '.join(BLOCKS)}.")
    return BLOCKS[name]
