"""How a file is to be read: what its caller says of it."""

from collections.abc import Callable
from typing import NamedTuple


class Reading(NamedTuple):
    """How a file is opened, where that cannot be found out."""

    delimiter: str | None = None
    """Of a text file."""
    header: int | None = None
    """Line of names of a text file, from 1; 0: there is none."""
    variable: str | None = None
    """The object to read, where an ``.npz`` or R file, or the topic, where a bag holds several."""
    format: str | None = None
    """The logger's format; None: found by the content where that is certain, else by the suffix."""
    scale: str | None = None
    """The type of IMU whose counts these are."""
    told: Callable[[int], object] | None = None
    """Hears of the bytes read."""
    max_bytes: int | None = None
    """To which the file may unfold; None: see `gmwm_jax._internal.limits`."""
