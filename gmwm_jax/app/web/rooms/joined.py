"""Rooms of other packages, found by their entry points: nobody here knows their names."""

import logging
from collections.abc import Collection
from importlib.metadata import EntryPoint, entry_points
from typing import Any, NamedTuple

from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State

GROUP = "gmwm_jax.rooms"
"""Of the entry points; each names an object of the class `Room`."""

_LOG = logging.getLogger("gmwm_jax.app")


class Joined(NamedTuple):
    """The rooms that were found, and a sentence of each that is not there."""

    rooms: tuple[Room, ...]
    failures: tuple[str, ...]


def joined(taken: Collection[str], found: Collection[EntryPoint] | None = None) -> Joined:
    """Load the rooms of other packages; one that fails does not keep the others away.

    Parameters
    ----------
    taken
        The ids of the page's own rooms.
    found
        Entry points; those of all installed packages if left out.

    Examples
    --------
    >>> from importlib.metadata import EntryPoint
    >>> from gmwm_jax.app.web.rooms.joined import GROUP, joined
    >>> joined((), [EntryPoint("tides", "nobody.rooms:ROOM", GROUP)]).failures
    ("The room 'tides' of nobody is not here: No module named 'nobody'.",)
    """
    rooms: list[Room] = []
    failures = []
    for point in sorted(entry_points(group=GROUP) if found is None else found, key=lambda p: p.name):
        try:
            room = point.load()
            _check(room, {*taken, *(r.id for r in rooms)})
            rooms.append(room)
        except Exception as error:  # whatever it is, it is the other package's
            package = point.module.partition(".")[0]
            reason = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
            failures.append(f"The room {point.name!r} of {package} is not here: {reason}.")
            _LOG.warning(failures[-1], exc_info=error)
    return Joined(tuple(rooms), tuple(failures))


def _check(room: Any, taken: Collection[str]) -> None:
    if not isinstance(room, Room):
        raise ValueError(f"{room!r:.60} is no Room")
    if room.id in taken:
        raise ValueError(f"there is a room {room.id!r} already")
    if wrong := [name for name in set(room.state.model_fields) - set(State.model_fields) if not _of(room, name)]:
        raise ValueError(f"the names of its inputs begin with {room.id!r}, and {min(wrong)!r} does not")


def _of(room: Room, name: str) -> bool:
    return name.startswith(f"{room.id}_")
