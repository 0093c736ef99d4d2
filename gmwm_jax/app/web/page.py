"""The page: rooms in a row, what is looked at beside them, the link that holds the inputs."""

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import plotly
from htmltools import HTMLDependency, Tag
from shiny import App, Inputs, Outputs, Session, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web.choices import offer
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import status
from gmwm_jax.app.web.rooms import data, inference, model, takeaway, tutorial, units, variance
from gmwm_jax.app.web.rooms.joined import Joined, joined
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State, joined_state
from gmwm_jax.app.web.store import Store
from gmwm_jax.app.web.turns import Turns

ROOMS: tuple[Room, ...] = tuple(room.ROOM for room in (data, variance, model, inference, units))
"""In the order of work; after them those of other packages, and what is of all: Take away and Tutorial."""
_WWW = Path(__file__).parent / "www"


def application(turns: Turns, queue: Executor, limits: Limits) -> App:
    """Make the application of the page.

    Parameters
    ----------
    turns
        Who computes when.
    queue
        Those that do long work.
    limits
        Of the server.
    """
    others = joined({*(room.id for room in ROOMS), takeaway.ROOM.id, tutorial.ID})
    rooms = rooms_with(others)
    states = joined_state(room.state for room in rooms)

    def page(request: Any) -> Tag:
        return _page(rooms, others.failures, states.from_query(request.query_params), limits)

    def serve(input: Inputs, output: Outputs, session: Session) -> None:
        _serve(rooms, input, session, Store(input, session, turns, queue, limits, states))

    app = App(page, serve)
    app.sanitize_errors = True
    return app


def rooms_with(others: Joined) -> tuple[Room, ...]:
    """List the rooms of the page, those of other packages among them."""
    return (*ROOMS, *others.rooms, takeaway.ROOM, tutorial.room([s for room in others.rooms for s in room.steps]))


def _page(rooms: Sequence[Room], failures: Sequence[str], state: State, limits: Limits) -> Tag:
    package = Path(plotly.__file__).parent / "package_data"
    sidebar = ui.sidebar(
        ui.output_ui("about"),
        ui.input_select("channel", "Channel", {state.channel: state.channel or "first"}, selected=state.channel),
        ui.input_text(
            "datasheet", "Datasheet", state.datasheet, placeholder="N=0.15 deg/sqrt(h), B=10 deg/h", update_on="blur"
        ),
        ui.tags.details(
            ui.tags.summary("How it is written"),
            ui.p(
                "N, B (with f0), K, Q, LSB, R, and GM=20 deg/h @ 100 s, with commas; the entries of another sensor "
                "after a |. It is drawn, compared with fits, and taken as a model."
            ),
        ),
        ui.output_ui("working"),
        *(ui.p(failure, class_="gmwm-error") for failure in failures),
        title="What is looked at",
        width="15rem",
        open={"desktop": "open", "mobile": "closed"},
    )
    selected = state.room if state.room in {room.id for room in rooms} else rooms[0].id
    return ui.page_navbar(
        *(ui.nav_panel(room.title, room.ui(state, limits), value=room.id) for room in rooms),
        ui.nav_spacer(),
        ui.nav_control(ui.input_dark_mode(id="theme", aria_label="dark or light page")),
        id="room",
        selected=selected,
        sidebar=sidebar,
        title="gmwm_jax",
        window_title="gmwm_jax: noise of inertial sensors",
        lang="en",
        navbar_options=ui.navbar_options(underline=True),
        header=[
            HTMLDependency(
                "plotly", plotly.__version__, source={"subdir": str(package)},
                script={"src": "plotly.min.js", "async": ""},
            ),
            HTMLDependency(
                "gmwm", gj.__version__, source={"subdir": str(_WWW)}, script={"src": "figure.js"},
                stylesheet={"href": "app.css"}, all_files=False,
            ),
            ui.div(
                ui.tags.span(id="job_text", role="status"),
                ui.tags.progress(id="job_bar", aria_label="how far the work has come"),
                ui.input_action_button("cancel", "Cancel", class_="btn-outline-primary"),
                id="job", hidden="",
            ),
        ],
    )  # fmt: skip


def _serve(rooms: Sequence[Room], input: Inputs, session: Session, store: Store) -> None:
    for room in rooms:
        room.server(input, store)

    @reactive.effect
    @reactive.event(input.cancel)
    def _cancel() -> None:
        store.jobs.cancel()

    def channels() -> tuple[str, ...] | None:
        shown = store.recording().value
        return None if shown is None else tuple(shown.channels)

    offer("channel", channels, lambda: store.channel() or "")

    @reactive.effect
    async def _link() -> None:
        try:
            query = store.state().to_query()
        except ValueError:
            return  # an input that is being typed
        await session.send_custom_message("gmwm-link", {"query": query})

    @render.ui
    def about() -> Tag | None:
        shown = store.recording().value
        if shown is None:
            return None
        try:
            model = model_of(store.state())
        except ValueError:  # of an input that is being typed
            model = ""
        return ui.div(ui.p(shown.about), ui.p(f"Model: {model}", id="chip") if model else None)

    @render.ui
    def working() -> Tag | None:
        return status(store.of_recording())
