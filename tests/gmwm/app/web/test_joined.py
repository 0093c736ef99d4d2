"""Rooms of other packages: found by entry points, and named where they fail."""

import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from gmwm_jax.app.web import page
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.rooms import tutorial
from gmwm_jax.app.web.rooms.joined import GROUP, Joined, joined
from gmwm_jax.app.web.rooms.room import Room, Step
from gmwm_jax.app.web.state import State, joined_state


class Tides(State):
    tides_height: float = 2.0


class Stranger(State):
    height: float = 2.0


TIDES = Room("tides", "Tides", lambda state, limits: None, lambda input, store: None, Tides)


@pytest.fixture
def point(monkeypatch):
    """Function that makes the entry point of a room that exists."""

    def make(room):
        module = ModuleType("other_package")
        module.ROOM = room
        monkeypatch.setitem(sys.modules, "other_package", module)
        return [EntryPoint("tides", "other_package:ROOM", GROUP)]

    return make


def test_a_room_of_another_package_comes_before_take_away_with_its_steps(point):
    steps = (Step("High water", "It comes twice a day.", {"room": "tides"}),)
    found = joined((), point(TIDES._replace(steps=steps)))
    assert not found.failures
    rooms = page.rooms_with(found)
    assert [room.id for room in rooms][-3:] == ["tides", "takeaway", "tutorial"]
    shown = str(rooms[-1].ui(State(), Limits()))
    assert f"{len(tutorial.tutorial.CHAPTERS) + len(tutorial.STEPS) + 1}. High water" in shown
    assert "?room=tides" in shown


@pytest.mark.parametrize(
    ("room", "reason"),
    [
        ("no room", "'no room' is no Room"),
        (TIDES._replace(id="data"), "there is a room 'data' already"),
        (TIDES._replace(state=Stranger), "the names of its inputs begin with 'tides', and 'height' does not"),
    ],
)
def test_a_room_that_fails_is_named_and_the_page_is_there(point, room, reason):
    found = joined({"data"}, point(room))
    assert found == Joined((), (f"The room 'tides' of other_package is not here: {reason}.",))
    shown = str(page._page(page.rooms_with(found), found.failures, State(), Limits()))
    assert "of other_package is not here" in shown


def test_inputs_of_all_rooms_are_one_state():
    states = joined_state([State, Tides])
    assert states.from_query({"tides_height": "wide", "seed": "3"}) == states(seed=3)
    with pytest.raises(ValueError, match=r"tides_height.*'wide'"):
        states.checked({"tides_height": "wide"})
