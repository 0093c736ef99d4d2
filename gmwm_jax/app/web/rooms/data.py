"""Where recordings come in: simulated, public or sent, and a look at them."""

from pathlib import Path
from typing import Any

from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures, tables
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.library import PUBLISHED, entries, source
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, output_figure, render_figure, status, text
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import File, Same, Store

_DELIMITERS = {"": "found", ",": "comma", ";": "semicolon", "\t": "tab", " ": "blanks", "|": "bar"}
_GAPS = {"refuse": "an error", "nan": "pairs of the others", "longest": "the longest run"}


def _ui(state: State, limits: Limits) -> Tag:
    tables = {entry.name: entry.title for entry in entries() if entry.kind == PUBLISHED}
    known = ui.input_select("published", "Published wavelet variances", tables, selected=state.published, width="22rem")
    simulated = ui.div(
        ui.input_select("sensor", "Sensor", list(gj.datasets.sensors()), selected=state.sensor),
        ui.input_numeric("samples", "Samples", state.samples, min=1000, max=limits.samples, update_on="blur"),
        ui.input_numeric("seed", "Seed", state.seed, min=0, update_on="blur"),
        ui.input_text(
            "own",
            "Own model, in place of the sensor",
            state.own,
            placeholder="WN(sigma2=1e-5) + RW(gamma2=1e-12)",
            update_on="blur",
        ),
        ui.input_numeric("own_rate", "Its sampling rate [Hz]", state.own_rate, min=0, update_on="blur"),
        ui.input_select("own_unit", "Its unit", ["rad/s", "m/s^2"], selected=state.own_unit),
        class_="gmwm-controls",
    )
    names = {"": "choose .."} | {name: name for name in gj.datasets.names()}
    public = ui.input_select("dataset", "Public recording", names, selected=state.dataset)
    there = {"": "none of them"} | {name: name for name in limits.stored()}
    file = ui.div(
        ui.input_select("stored", "Recording of the server", there, selected=state.stored) if limits.folder else None,
        ui.input_file("upload", "File: npy, npz, text, parquet, netCDF, R data, ROS bag, also packed"),
        ui.div(id="too_large", class_="gmwm-error", role="alert", data_sentence=limits.too_large()),
        ui.tags.details(
            ui.tags.summary("or values from the clipboard"),
            ui.tags.textarea(
                class_="form-control gmwm-pasted", rows=5, wrap="off", spellcheck="false", aria_label="Values"
            ),
            ui.tags.button(
                "Take these values",
                type="button",
                class_="btn btn-outline-primary",
                data_paste="pasted",
                data_most=str(limits.pasted),
            ),
            ui.div(class_="gmwm-error", role="alert", id="too_long"),
        ),
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
    page = ui.input_file("page", "A page that was saved in the room Take away", accept=[".json"])
    return ui.div(
        ui.h2("Recording"),
        ui.navset_pill(
            ui.nav_panel("Published", ui.div(known, ui.p(source(), class_="gmwm-source")), value="published"),
            ui.nav_panel("Simulated sensor", simulated, value="simulated"),
            ui.nav_panel("Public recording", public, value="public"),
            ui.nav_panel("Own file", file, value="file"),
            ui.nav_panel("Saved page", page, ui.output_ui("page_status"), value="saved"),
            id="source",
            selected=state.source,
        ),
        ui.input_select(
            "outliers", "Outliers", {"keep": "are kept", "mask": "become missing samples"}, selected=state.outliers
        ),
        ui.output_ui("data_status"),
        ui.output_ui("facts"),
        ui.output_ui("first_samples"),
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
            ui.update_select("stored", selected="")

    @reactive.effect
    @reactive.event(input.pasted)
    def _paste() -> None:
        try:
            store.take_text(str(input.pasted()))
        except ValueError as error:
            ui.notification_show(str(error), type="error")

    wrong: reactive.Value[str] = reactive.Value("", name="wrong")

    @reactive.effect
    @reactive.event(input.page)
    async def _load() -> None:
        files = input.page()
        if not files:
            return
        name, path = files[0]["name"], Path(files[0]["datapath"])
        try:
            page = await store.in_thread(lambda: store.loaded(path.read_bytes(), name))
        except ValueError as error:
            wrong.set(str(error))
            return
        wrong.set("")
        store.restore(page)

    @render.ui
    def page_status() -> Tag | None:
        return status(Outcome(error=wrong()))

    @render.ui
    def data_status() -> Tag | None:
        outcome = store.recording()
        nothing = outcome.value is None and not outcome.error and not outcome.busy
        if nothing and store.state().source != "saved":
            return ui.p("Choose one: a link holds no data." if store.state().source == "file" else "Choose one.")
        return status(outcome)

    def described() -> Same | None:
        shown = store.recording().value
        return None if shown is None else Same(shown)

    def describe(key: Same) -> tuple[Any, ...]:
        """The lines, and the tables where there are samples."""
        rec, remarks = key.value.recording, key.value.remarks
        tabled = () if rec is None else (tables.recording(rec), tables.preview(rec))
        return "\n".join(remarks), *tabled

    known = store.computed(described, describe, "", room=ROOM.id)

    @render.ui
    def facts() -> Tag | None:
        found = known().value
        return None if found is None else ui.div(text(found[0] or None), *(as_html(table) for table in found[1:2]))

    @render.ui
    def first_samples() -> Tag | None:
        found = known().value
        return None if found is None or len(found) < 3 else as_html(found[2])

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
