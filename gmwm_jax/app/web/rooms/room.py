"""What a room of the page is."""

from collections.abc import Callable
from typing import NamedTuple

from htmltools import Tag
from shiny import Inputs

from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Store


class Room(NamedTuple):
    """A room of the page."""

    id: str
    title: str
    ui: Callable[[State, Limits], Tag]
    """Makes its controls, set as a state says, and the places of what it shows."""
    server: Callable[[Inputs, Store], None]
    """Makes what it shows; called in the session of a page."""
