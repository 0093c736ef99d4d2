"""What a room of the page is, and what it may bring along beside itself."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from htmltools import Tag
from shiny import Inputs

from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Store
from gmwm_jax.app.web.tables import Table


class Step(NamedTuple):
    """A step of the tutorial that is done in a room."""

    title: str
    text: str
    inputs: Mapping[str, Any]
    """Of the page, under which it is done: what its link holds."""
    compute: Callable[[], Sequence[str | Table]] | None = None
    """Makes what is shown beside it, once for all pages; None: there is nothing to compute."""


class Room(NamedTuple):
    """A room of the page.

    A package joins one of its own by an entry point of the group ``gmwm_jax.rooms``, see `joined`. What such a room
    adds to Take away, it puts into `Store.parts`.
    """

    id: str
    title: str
    ui: Callable[[Any, Limits], Tag]
    """Makes its controls, set as a state says, and the places of what it shows."""
    server: Callable[[Inputs, Store], None]
    """Makes what it shows; called in the session of a page."""
    state: type[State] = State
    """With the inputs of the room: their names begin with its id."""
    steps: tuple[Step, ...] = ()
