"""What a filter and a datasheet call the fit that is looked at, and a converter."""

from typing import Any

from htmltools import Tag
from shiny import Inputs, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import formula, tables
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, status, text
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.snippets import formats, snippet
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store


def _ui(state: State, limits: Limits) -> Tag:
    return ui.div(
        ui.h2("Converter"),
        ui.div(
            ui.input_numeric("value", "Value", state.value, update_on="blur"),
            ui.input_text("unit_from", "From", state.unit_from, update_on="blur"),
            ui.input_text("unit_to", "To", state.unit_to, update_on="blur"),
            class_="gmwm-controls",
        ),
        ui.output_ui("converted"),
        ui.h2("The fit of room Model & fit"),
        ui.output_ui("units_status"),
        ui.output_ui("per_sample"),
        ui.output_ui("for_filters"),
        ui.output_ui("for_datasheets"),
        ui.h2("Its model, fitted to every channel, for other filters"),
        ui.input_select("target", "Filter", formats(), selected=state.target),
        ui.output_ui("filter_file"),
    )


def _server(input: Inputs, store: Store) -> None:
    def key() -> Any:
        found, wv, state = store.fit().value, store.variance().value, store.state()
        if state.room != ROOM.id or found is None or wv is None or store.of_recording().value is None:
            return None
        return Same(found), Same(wv), model_of(state), state.weights, state.target

    def work(key: Any) -> Any:
        of, wv, model, weights, target = key
        fit = of.value
        fits = gj.fit(wv.value, model, weights=weights, throw=False)  # the file of a filter is of all channels
        if target not in formats():
            raise ValueError(f"Filter: there is no {target}.")
        return (
            tables.estimates(fit),
            tables.filter(fit),
            tables.datasheet(fit),
            snippet([fits] if isinstance(fits, gj.Fit) else list(fits.values()), target),
        )

    shown = store.computed(key, work, "computing the intervals ..")

    @render.ui
    def converted() -> Tag:
        try:
            state = store.state()
            return ui.p(formula.converted(state.value, state.unit_from, state.unit_to).text)
        except ValueError as error:
            return ui.div(str(error), class_="gmwm-error", role="alert")

    @render.ui
    def units_status() -> Tag | None:
        for outcome in (store.of_recording(), store.fit(), shown()):
            if outcome.value is None:
                return status(outcome)
        return None

    def table(at: int) -> Tag | None:
        found = shown().value
        return None if found is None else as_html(found[at])

    @render.ui
    def per_sample() -> Tag | None:
        return table(0)

    @render.ui
    def for_filters() -> Tag | None:
        return table(1)

    @render.ui
    def for_datasheets() -> Tag | None:
        return table(2)

    @render.ui
    def filter_file() -> Tag | None:
        found = shown().value
        return None if found is None else text(found[3].text or found[3].reason)


ROOM = Room("units", "Units & filters", _ui, _server)
