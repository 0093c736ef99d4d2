"""Wavelet and Allan variances of all channels, with intervals."""

from typing import Any

import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

from gmwm_jax.app.web import figures, tables
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.datasheet import overlay
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, output_figure, render_figure, status
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store

UNITS: dict[str, dict[str, str]] = {
    "si": {},
    "deg_s": {"rad/s": "deg/s", "m/s^2": "mg"},
    "deg_h": {"rad/s": "deg/h", "m/s^2": "ug"},
}


def _ui(state: State, limits: Limits) -> Tag:
    units = {"si": "rad/s, m/s^2", "deg_s": "deg/s, mg", "deg_h": "deg/h, ug"}
    return ui.div(
        ui.h2("Variance"),
        ui.div(
            ui.input_select(
                "estimator", "Estimator", {"classic": "classic", "robust": "robust"}, selected=state.estimator
            ),
            ui.input_numeric(
                "efficiency", "Efficiency", state.efficiency, min=0.5, max=0.99, step=0.05, update_on="blur"
            ),
            ui.input_select("unit", "Unit", units, selected=state.unit),
            ui.input_switch("allan", "Allan variance", state.allan),
            ui.input_switch("deviation", "Deviation", state.deviation),
            ui.input_switch("in_samples", "Scales in samples", state.in_samples),
            ui.input_switch("band", "Intervals", state.band),
            ui.input_switch("slopes", "Slopes of processes", state.slopes),
            ui.input_switch("compare", "Robust beside classic", state.compare),
            ui.input_switch("every", "All channels", state.every),
            class_="gmwm-controls",
        ),
        ui.output_ui("variance_status"),
        output_figure("variances"),
        ui.output_ui("read_off"),
        ui.output_ui("scales"),
    )


def _server(input: Inputs, store: Store) -> None:
    @reactive.calc
    def drawn() -> Any:
        """The figure, or a sentence."""
        outcome, state, channel = store.of_recording(), store.state(), store.channel()
        wv = outcome.value
        if wv is None or outcome is store.recording():
            return outcome
        robust = store.robust() if state.compare and state.estimator == "classic" else None
        if robust is not None and robust.value is None:
            return robust
        try:
            datasheet = overlay(state.datasheet, wv.rate) if state.datasheet.strip() else None
            units = UNITS[state.unit]
            if channel is not None and len(wv.channels) > 1 and not state.every:
                wv = wv[channel]
            other = None if robust is None or robust.value is None else robust.value
            if other is not None and other.channels != wv.channels:
                other = other[channel]
            return figures.variance(
                wv, allan=state.allan, samples=state.in_samples, deviation=state.deviation, band=state.band,
                datasheet=datasheet, robust=other, slopes=state.slopes,
                unit={str(si): units.get(si, str(si)) for si in wv.units},
                columns=1 if store.narrow() else 3,
            )  # fmt: skip
        except ValueError as error:
            return str(error)

    @render.ui
    def variance_status() -> Tag | None:
        found = drawn()
        if isinstance(found, str):
            return ui.div(found, class_="gmwm-error", role="alert")
        return status(store.of_recording())

    @render_figure
    def variances() -> go.Figure | Outcome[Any] | None:
        found = drawn()
        if isinstance(found, go.Figure):
            return store.themed(found)
        return found if isinstance(found, Outcome) else None

    def tabled_key() -> Any:
        wv, channel = store.variance().value, store.channel()
        return None if wv is None or channel is None else (Same(wv), channel)

    def tabulate(key: Any) -> tuple[str, tables.Table, tables.Table | None]:
        """Warnings of all channels, the scales of the one that is looked at, and what is read off all of them."""
        wv, channel = key[0].value, key[1]
        readable = wv.rate and wv.num_scales >= 3
        said = "\n".join(f"Warning: {w}." for w in wv.warnings)
        return said, tables.scales(wv[channel]), tables.readings(wv) if readable else None

    tabled = store.computed(tabled_key, tabulate, "", later=True, room=ROOM.id)

    @render.ui
    def scales() -> Tag | None:
        found = tabled().value
        if found is None:
            return None
        return ui.div(ui.p(found[0], class_="gmwm-error") if found[0] else None, as_html(found[1]))

    @render.ui
    def read_off() -> Tag | None:
        found = tabled().value
        return None if found is None or found[2] is None else as_html(found[2])


ROOM = Room("variance", "Variance", _ui, _server)
