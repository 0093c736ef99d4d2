"""Wavelet and Allan variances of all channels, with intervals."""

import re
from typing import Any

import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import output_figure, render_figure, status, text
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Store

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
            ui.input_text(
                "datasheet",
                "Datasheet",
                state.datasheet,
                placeholder="N=0.15 deg/sqrt(h), B=10 deg/h",
                update_on="blur",
            ),
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
        ui.output_ui("scales"),
    )


def promised(text: str, rate: float) -> dict[str, Any] | None:
    """Read a datasheet's entries, and make by SI unit the model that they are.

    Raises
    ------
    ValueError
        As of `gmwm_jax.from_datasheet`.

    Examples
    --------
    >>> from gmwm_jax.app.web.rooms.variance import promised
    >>> promised("N=0.15 deg/sqrt(h)", 100.0)["rad/s"].labels
    ('WN',)
    """
    if not text.strip():
        return None
    entries = {}
    for part in re.split(r"[,;]", text):
        name, equals, value = part.partition("=")
        if not equals:
            raise ValueError(f'Datasheet: "{part.strip()}" is no entry; write N=0.15 deg/sqrt(h), several with commas.')
        entries[name.strip()] = value.strip()
    model, signal = gj.from_datasheet(entries, rate)
    return {signal: model}


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
            datasheet = promised(state.datasheet, wv.rate)
            units = UNITS[state.unit]
            if channel is not None and len(wv.channels) > 1 and (store.narrow() or not state.every):
                wv = wv[channel]
            other = None if robust is None or robust.value is None else robust.value
            if other is not None and other.channels != wv.channels:
                other = other[channel]
            return figures.variance(
                wv, allan=state.allan, samples=state.in_samples, deviation=state.deviation, band=state.band,
                datasheet=datasheet, robust=other, slopes=state.slopes,
                unit={str(si): units.get(si, str(si)) for si in wv.units},
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

    @render.ui
    def scales() -> Tag | None:
        wv = store.variance().value
        return text(wv)


ROOM = Room("variance", "Variance", _ui, _server)
