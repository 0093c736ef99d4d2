"""A published example step by step: each can be done on the page, beside what is printed."""

from functools import cache
from typing import Any

from htmltools import Tag
from shiny import Inputs, render, ui

from gmwm_jax.app.web import tutorial
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, status
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Store
from gmwm_jax.app.web.tables import Table


def link_of(chapter: tutorial.Chapter) -> str:
    """Write the link under which a step is done.

    Examples
    --------
    >>> from gmwm_jax.app.web import tutorial
    >>> from gmwm_jax.app.web.rooms.tutorial import link_of
    >>> link_of(tutorial.CHAPTERS[1])
    '?room=model&source=published&channel=gyro_x&model=WN'
    """
    inputs: dict[str, Any] = {"published": tutorial.SENSOR, "channel": tutorial.CHANNEL, "model": chapter.model}
    return f"?{State.from_query({'room': chapter.room, 'source': 'published', **inputs}).to_query()}"


def units_of(chapter: tutorial.Chapter) -> Table | None:
    """Tabulate the printed estimates of a step in the units of a filter; None where none are printed.

    Examples
    --------
    >>> from gmwm_jax.app.web import tutorial
    >>> from gmwm_jax.app.web.rooms.tutorial import units_of
    >>> units_of(tutorial.CHAPTERS[1]).rows[0][:2]
    ('WN', 'q')
    """
    rows = [
        (of.component, step.symbol, float(step.value), step.unit, step.text)
        for of in tutorial.conversions(chapter)
        for step in of.steps
    ]
    traps = [
        f"{of.component}: with the stationary variance in the place of the innovation's, q would be {of.trap:.4g} "
        "times too large."
        for of in tutorial.conversions(chapter)
        if of.trap > 1
    ]
    if not rows:
        return None
    columns = ("component", "quantity", "value", "unit", "how")
    return Table(columns, ("",) * len(columns), tuple(rows), "\n".join(["The printed estimates for a filter.", *traps]))


@cache  # the same for every page
def _comparison(number: int) -> tutorial.Comparison:
    return tutorial.compared(tutorial.CHAPTERS[number - 1])


def _ui(state: State, limits: Limits) -> Tag:
    steps = []
    for chapter in tutorial.CHAPTERS:
        steps += [
            ui.h2(f"{chapter.number}. {chapter.title}"),
            ui.p(chapter.text),
            ui.output_ui(f"step_{chapter.number}"),
            ui.p(ui.a("Do this step", href=link_of(chapter))),
        ]
    return ui.div(
        ui.p("A published calibration of the gyroscope X of an MTi-G, its printed numbers beside those found here."),
        *steps,
    )


def _server(input: Inputs, store: Store) -> None:
    def work(number: int) -> tuple[tutorial.Comparison, Table | None]:
        return _comparison(number), units_of(tutorial.CHAPTERS[number - 1])

    def show(chapter: tutorial.Chapter) -> None:
        def key() -> int | None:  # nothing is computed before somebody looks
            return chapter.number if chapter.model and store.state().room == ROOM.id else None

        found = store.computed(key, work, "fitting ..")

        def step() -> Tag | None:
            outcome = found()
            if outcome.value is None:
                return status(outcome)
            comparison, table = outcome.value
            return ui.div(
                ui.p(comparison.sentence), ui.p(f"Estimated: {comparison.fit.model}"),
                as_html(table) if table is not None else None,
            )  # fmt: skip

        step.__name__ = f"step_{chapter.number}"  # by which the framework knows its place
        render.ui(step)

    for chapter in tutorial.CHAPTERS:
        show(chapter)


ROOM = Room("tutorial", "Tutorial", _ui, _server)
