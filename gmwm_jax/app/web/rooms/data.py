"""Where recordings come in: simulated, public or sent, and a look at them."""

from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures
from gmwm_jax.app.web.library import PUBLISHED, entries
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import output_figure, render_figure, status, text
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import File, Store

_DELIMITERS = {"": "found", ",": "comma", ";": "semicolon", "\t": "tab", " ": "blanks", "|": "bar"}
_GAPS = {"refuse": "an error", "nan": "pairs of the others", "longest": "the longest run"}


def _ui(state: State, limits: Limits) -> Tag:
    tables = {entry.name: entry.title for entry in entries() if entry.kind == PUBLISHED}
    known = ui.input_select("published", "Published wavelet variances", tables, selected=state.published, width="22rem")
    simulated = ui.div(
        ui.input_select("sensor", "Sensor", list(gj.datasets.sensors()), selected=state.sensor),
        ui.input_numeric("samples", "Samples", state.samples, min=1000, max=limits.samples, update_on="blur"),
        ui.input_numeric("seed", "Seed", state.seed, min=0, update_on="blur"),
        class_="gmwm-controls",
    )
    names = {"": "choose .."} | {name: name for name in gj.datasets.names()}
    public = ui.input_select("dataset", "Public recording", names, selected=state.dataset)
    file = ui.div(
        ui.input_file("upload", "File: npy, npz, text, parquet, netCDF, R data, ROS bag, also packed"),
        ui.div(id="too_large", class_="gmwm-error", role="alert", data_sentence=limits.too_large()),
        ui.div(
            ui.input_numeric("rate", "Sampling rate [Hz], if the file has none", state.rate, min=0, update_on="blur"),  # type: ignore[arg-type]
            ui.input_text("units", "Unit", state.units, placeholder="deg/s, or gyro=deg/s, accel=g", update_on="blur"),
            ui.input_text("time", "Column of time", state.time, placeholder="name or number", update_on="blur"),
            ui.input_text("columns", "Columns", state.columns, placeholder="all; names or numbers", update_on="blur"),
            ui.input_select("delimiter", "Delimiter", _DELIMITERS, selected=state.delimiter),
            ui.input_numeric("header", "Line of names (0: none), if not found", state.header, min=0, update_on="blur"),  # type: ignore[arg-type]
            ui.input_select("gaps", "Missing samples", _GAPS, selected=state.gaps),
            class_="gmwm-controls",
        ),
        data_max_upload=str(limits.upload),
    )
    return ui.div(
        ui.h2("Recording"),
        ui.navset_pill(
            ui.nav_panel("Published", known, value="published"),
            ui.nav_panel("Simulated sensor", simulated, value="simulated"),
            ui.nav_panel("Public recording", public, value="public"),
            ui.nav_panel("Own file", file, value="file"),
            id="source",
            selected=state.source,
        ),
        ui.input_select(
            "outliers", "Outliers", {"keep": "are kept", "mask": "become missing samples"}, selected=state.outliers
        ),
        ui.output_ui("data_status"),
        ui.output_ui("facts"),
        output_figure("series"),
        output_figure("steps"),
    )


def _server(input: Inputs, store: Store) -> None:
    @reactive.effect
    @reactive.event(input.upload)
    def _take() -> None:
        files = input.upload()
        if files:
            store.file.set(File(files[0]["datapath"], files[0]["name"]))

    @render.ui
    def data_status() -> Tag | None:
        return status(store.recording())

    @render.ui
    def facts() -> Tag | None:
        shown = store.recording().value
        return (
            None
            if shown is None
            else text("\n".join([*([repr(shown.recording)] if shown.recording is not None else []), *shown.remarks]))
        )

    @render_figure
    def series():
        outcome, channel = store.recording(), store.channel()
        if outcome.value is None or channel is None:
            return outcome
        if outcome.value.recording is None:
            return None
        return store.themed(figures.recording(outcome.value.recording, channel))

    @render_figure
    def steps():
        outcome, channel = store.recording(), store.channel()
        if outcome.value is None or channel is None:
            return outcome
        if outcome.value.recording is None:
            return None
        return store.themed(figures.steps(outcome.value.recording, channel))


ROOM = Room("data", "Data", _ui, _server)
