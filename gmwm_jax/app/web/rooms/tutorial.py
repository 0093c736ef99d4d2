"""A published example step by step: each can be done on the page, beside what is printed."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any, NamedTuple
from urllib.parse import urlencode

from htmltools import Tag
from shiny import Inputs, render, ui

from gmwm_jax.app.web import recap, tutorial
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, status
from gmwm_jax.app.web.rooms.room import Room, Step
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Store
from gmwm_jax.app.web.tables import Table

ID = "tutorial"

STEPS = (
    Step(
        "A file of your own",
        "Of text, the delimiter, the line of names and the column of time are found, and said; the sampling rate and "
        "the unit are never guessed. The same record gives the same curve from every kind of file that is read.",
        {"room": "data", "source": "file"},
    ),
    Step(
        "Outliers, a datasheet, intervals and the choice of a model",
        "Samples are needed for the robust estimate, so this step takes a simulated record of the same sensor. The "
        "robust variance and what the datasheet promises stand beside the classic one; go on to replicates and ranked "
        "models in the room Inference & selection. No number is printed for it.",
        {
            "room": "variance", "sensor": tutorial.SENSOR, "channel": tutorial.CHANNEL, "compare": True,
            "datasheet": "N=0.05 deg/s/sqrt(Hz)", "boxes": "WN,RW,GM", "superset": "WN + RW + 2*GM",
        },
    ),
    Step(
        "Recapitulation: a model whose truth is known",
        "White noise, a Gauss-Markov process and a drift are simulated, fitted, and compared with the truth. Of how "
        f"many samples the printed intervals are is not said; here there are {recap.NUM_SAMPLES}. The link simulates "
        "the same record and marks the truth beside the intervals.",
        {"room": "inference", "own": recap.TRUTH, "samples": recap.NUM_SAMPLES, "boxes": "WN,GM,DR"},
        lambda: [recap.table()],
    ),
)  # fmt: skip
"""Steps that follow the chapters of the example; those of other rooms come after them."""


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


def _of_chapter(chapter: tutorial.Chapter) -> Sequence[str | Table]:
    comparison, table = _comparison(chapter.number), units_of(chapter)
    said = (comparison.sentence, f"Estimated: {comparison.fit.model}")
    return said if table is None else (*said, table)


class _Shown(NamedTuple):
    """A step as it stands on the page."""

    title: str
    text: str
    link: str
    compute: Callable[[], Sequence[str | Table]] | None


def query_of(inputs: Mapping[str, Any]) -> str:
    """Write the link under which inputs are those of the page.

    Examples
    --------
    >>> from gmwm_jax.app.web.rooms.tutorial import query_of
    >>> query_of({"room": "data", "every": False})
    '?room=data&every=0'
    """
    return f"?{urlencode({k: int(v) if isinstance(v, bool) else v for k, v in inputs.items()})}"


def room(more: Sequence[Step] = ()) -> Room:
    """Make the room, with the steps that other rooms bring.

    Parameters
    ----------
    more
        After the chapters of the example and `STEPS`.
    """
    shown = [
        _Shown(c.title, c.text, link_of(c), partial(_of_chapter, c) if c.model else None) for c in tutorial.CHAPTERS
    ]
    for s in (*STEPS, *more):
        shown.append(_Shown(s.title, s.text, query_of(s.inputs), None if s.compute is None else cache(s.compute)))

    def make_ui(state: State, limits: Limits) -> Tag:
        steps = []
        for number, step in enumerate(shown, 1):
            steps += [
                ui.h2(f"{number}. {step.title}"),
                ui.p(step.text),
                ui.output_ui(f"step_{number}"),
                ui.p(ui.a("Do this step", href=step.link)),
            ]
        return ui.div(
            ui.p(
                "A published calibration of the gyroscope X of an MTi-G, its printed numbers beside those found here."
            ),
            *steps,
        )

    def server(input: Inputs, store: Store) -> None:
        for number, step in enumerate(shown, 1):
            if step.compute is not None:
                _show(store, number, step.compute)

    return Room(ID, "Tutorial", make_ui, server)


def _show(store: Store, number: int, compute: Callable[[], Sequence[str | Table]]) -> None:
    def key() -> int | None:  # nothing is computed before somebody looks
        return number if store.state().room == ID else None

    found = store.computed(key, lambda _: tuple(compute()), "computing ..")

    def step() -> Tag | None:
        outcome = found()
        if outcome.value is None:
            return status(outcome)
        return ui.div(*(ui.p(one) if isinstance(one, str) else as_html(one) for one in outcome.value))

    step.__name__ = f"step_{number}"  # by which the framework knows its place
    render.ui(step)
