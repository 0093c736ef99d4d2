"""What a filter and a datasheet call the fit that is looked at, and a converter."""

from typing import Any, NamedTuple

from htmltools import Tag
from shiny import Inputs, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import datasheet, formula, tables
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, status, text
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.snippets import Snippet, formats, snippet
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store

_WAYS = {"filter": "per sample to filter", "samples": "filter to per sample"}
_WANTED = {
    "filter": {
        "WN": "WN takes sigma2.", "RW": "RW takes gamma2.", "DR": "DR takes omega.", "QN": "QN takes q2.",
        "GM": "GM takes beta and the stationary variance, with a comma.",
    },
    "samples": {
        "WN": "WN takes q.", "RW": "RW takes q.", "DR": "DR takes R.", "QN": "QN takes Q.",
        "GM": "GM takes beta in 1/s and q, with a comma.",
    },
}  # fmt: skip
"""Direction -> process -> what its numbers are."""


class _Shown(NamedTuple):
    """What is shown of a fit."""

    per_sample: tables.Table
    for_filters: tables.Table
    for_datasheets: tables.Table
    formulas: tables.Table
    verdict: tables.Table | str
    """Or why there is none."""
    promised: tables.Table | None
    """The datasheet itself in the units of a filter."""


def _against(fit: gj.Fit, text: str) -> tuple[tables.Table | str, tables.Table | None]:
    """The verdict on a fit, and the datasheet as a model."""
    if not text:
        return "There is no datasheet: its field is at the left.", None
    if fit.rate is None:
        return "Without a sampling rate nothing is compared.", None
    own = datasheet.of_unit(text, fit.rate, fit.unit)
    if not own:
        return f"The datasheet says nothing of a channel in {fit.unit}.", None
    model = datasheet.model(own, fit.rate)[0]
    made = tables.formulas(model, fit.rate, fit.unit)
    return tables.verdicts(datasheet.verdicts(fit, own)), made._replace(text=f"The datasheet: {model}\n{made.text}")


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
        ui.h2("Parameters per sample and quantities of filters, with the formula"),
        ui.div(
            ui.input_select("process", "Process", list(formula.kinds()), selected=state.process),
            ui.input_select("way", "Direction", _WAYS, selected=state.way),
            ui.input_text("numbers", "Its numbers", state.numbers, update_on="blur"),
            ui.input_numeric("process_rate", "Rate [Hz]", state.process_rate, min=0, update_on="blur"),
            ui.input_select("signal", "Unit of the signal", ["rad/s", "m/s^2"], selected=state.signal),
            class_="gmwm-controls",
        ),
        ui.output_ui("by_formula"),
        ui.h2("The fit of room Model & fit"),
        ui.output_ui("units_status"),
        ui.div(
            ui.output_ui("per_sample"),
            ui.output_ui("for_filters"),
            ui.output_ui("for_datasheets"),
            class_="gmwm-beside",
        ),
        ui.output_ui("formulas"),
        ui.h2("Against the datasheet"),
        ui.output_ui("verdict"),
        ui.h2("Its model, fitted to every channel, for other filters"),
        ui.input_select("target", "Filter", formats(), selected=state.target),
        ui.output_ui("filter_file"),
    )


def _server(input: Inputs, store: Store) -> None:
    def key() -> Any:
        found, state = store.fit().value, store.state()
        if state.room != ROOM.id or found is None or store.of_recording().value is None:
            return None
        truth = store.truth()
        promised = state.datasheet.strip()
        return (Same(found), promised, None if truth is None else Same(truth))

    def work(key: Any) -> _Shown:
        of, promised, truth = key
        fit = of.value
        return _Shown(
            tables.estimates(fit, None if truth is None else truth.value),
            tables.filter(fit),
            tables.datasheet(fit),
            tables.formulas(fit.model, fit.rate, fit.unit),
            *_against(fit, promised),
        )

    shown = store.computed(key, work, "computing the intervals ..")

    def file_key() -> Any:
        wv, state = store.variance().value, store.state()
        if store.fit().value is None or wv is None:
            return None
        return Same(wv), model_of(state), state.weights, state.level, state.target

    def write(key: Any) -> Snippet:
        wv, model, weights, level, target = key
        if target not in formats():
            raise ValueError(f"Filter: there is no {target}.")
        fits = gj.fit(wv.value, model, weights=weights, level=level, throw=False)
        return snippet([fits] if isinstance(fits, gj.Fit) else list(fits.values()), target)

    # of all channels, which takes several times as long as the tables of one
    written = store.computed(file_key, write, "fitting all channels ..", later=True, room=ROOM.id)

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

    def table(name: str) -> Tag | None:
        found = shown().value
        made = None if found is None else getattr(found, name)
        if isinstance(made, str):
            return ui.p(made)
        return None if made is None else as_html(made)

    @render.ui
    def by_formula() -> Tag:
        try:
            state = store.state()
            numbers = [float(part) for part in state.numbers.replace(";", ",").split(",")]
            make = formula.to_filter if state.way == "filter" else formula.to_samples
            steps = make(state.process, numbers, state.process_rate, state.signal)
            return ui.div(*(ui.p(step.text) for step in steps))
        except ValueError as error:
            said = f"{error} {_WANTED[state.way][state.process]}"
            return ui.div(said, class_="gmwm-error", role="alert")

    @render.ui
    def per_sample() -> Tag | None:
        return table("per_sample")

    @render.ui
    def for_filters() -> Tag | None:
        return table("for_filters")

    @render.ui
    def for_datasheets() -> Tag | None:
        return table("for_datasheets")

    @render.ui
    def formulas() -> Tag | None:
        return table("formulas")

    @render.ui
    def verdict() -> Tag | None:
        return ui.div(table("verdict"), table("promised"))

    @render.ui
    def filter_file() -> Tag | None:
        found = written()
        return status(found) if found.value is None else text(found.value.text or found.value.reason)


ROOM = Room("units", "Units & filters", _ui, _server)
