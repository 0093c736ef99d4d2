"""What is taken away: the Python file and the commands of the present inputs, and all results in one archive."""

import tempfile
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import report, saved, script
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import status, text
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import PASTED, Part, Store, reading_options
from gmwm_jax.variance.wavelet import AbstractWaveletVariance

VARIANCE = "variance.json"
"""What the Python file reads where there are no samples."""


def analysis_of(state: State, channels: Sequence[str], file: str = "") -> script.Analysis:
    """Tell what is done to all channels of a recording.

    Parameters
    ----------
    state
        Inputs of the page.
    channels
        Of the recording.
    file
        Name of the file that was sent, if that is the source.

    Raises
    ------
    ValueError
        No process is ticked.

    Examples
    --------
    >>> from gmwm_jax.app.web.rooms.takeaway import analysis_of
    >>> from gmwm_jax.app.web.state import State
    >>> analysis = analysis_of(State(boxes="WN,RW", seed=3), ["gyro_x"])
    >>> analysis.model, analysis.source.seed
    ('WN + RW', 3)
    """
    match state.source:
        case "published":
            source: Any = script.Published(state.published)
        case "simulated" if state.own.strip():
            source = script.Drawn(state.own.strip(), state.samples, state.seed, state.own_rate, state.own_unit)
        case "simulated":
            source = script.Simulated(state.sensor, state.samples, state.seed)
        case "saved":
            source = script.Stored(VARIANCE)
        case "public":
            source = script.Public(state.dataset)
        case "file":
            fields = (state.rate, state.units, state.time, state.columns, state.delimiter, state.header, state.gaps)
            source = script.OwnFile(file, reading_options(*fields))
    return script.Analysis(
        source,
        tuple(channels),
        model_of(state),
        masked=state.outliers == "mask" and state.source not in ("published", "saved"),
        efficiency=state.efficiency if state.estimator == "robust" else None,
        weights=None if state.weights == "default" else state.weights,
        level=state.level,
    )


def beside(analysis: script.Analysis, wv: AbstractWaveletVariance, file: Path | None) -> dict[str, bytes]:
    """Return what the Python file reads and nobody else has: a wavelet variance without samples, pasted values.

    Parameters
    ----------
    analysis
        What was done.
    wv
        To which.
    file
        What was sent or pasted, if anything was.
    """
    match analysis.source:
        case script.Stored(name):
            with tempfile.TemporaryDirectory() as folder:
                return {name: wv.save(Path(folder) / name).read_bytes()}
        case script.OwnFile(name) if name == PASTED and file is not None:
            return {name: file.read_bytes()}
    return {}


def _ui(state: State, limits: Limits) -> Tag:
    return ui.div(
        ui.h2("All results as files"),
        ui.p(
            "Tables (CSV), figures (SVG, PDF, PNG), fits (JSON), texts for other filters, the Python file below and a "
            "report that is one HTML file, of all channels, in one archive."
        ),
        ui.output_ui("takeaway"),
        ui.h2("The page itself as a file"),
        ui.p(
            "All inputs, the fits, and the wavelet variance where its samples are in no other place: who loads it in "
            "the room Data (Saved page) sees the same, without the samples."
        ),
        ui.download_button("save", "Save the page", class_="btn-outline-primary"),
        ui.h2("The same in Python"),
        ui.output_ui("program"),
        ui.h2("The same in a shell"),
        ui.output_ui("commands"),
    )


def _server(input: Inputs, store: Store) -> None:
    @reactive.calc
    def present() -> Outcome[script.Analysis]:
        """What all files are of, once there is a fit."""
        for outcome in (store.of_recording(), store.fit()):
            if outcome.value is None:
                return Outcome(error=outcome.error, busy=outcome.busy)
        file, shown = store.sent(), store.recording().value
        assert shown is not None  # there is a fit of it
        return Outcome(analysis_of(store.state(), shown.channels, "" if file is None else file.name))

    @reactive.calc
    def present_parts() -> dict[str, Part]:
        """What other rooms add."""
        made = {room: make() for room, make in store.parts.items()}
        return {room: part for room, part in made.items() if part is not None}

    @render.ui
    def takeaway() -> Tag | None:
        outcome = present()
        if outcome.value is None:
            return status(outcome)
        return ui.download_button("archive", "Download the archive", class_="btn-outline-primary")

    @render.download_button(filename="gmwm_jax.zip", media_type="application/zip")
    async def archive() -> AsyncIterator[bytes]:
        with reactive.isolate():
            analysis, wv, parts, file = present().value, store.variance().value, present_parts(), store.sent()
        path = None if file is None else Path(file.path)
        if analysis is None or wv is None:
            return  # inputs have changed since; there is no button any more

        def files() -> bytes:
            found = gj.fit(wv, analysis.model, weights=analysis.weights, level=analysis.level, throw=False)
            fits = [found] if isinstance(found, gj.Fit) else list(found.values())
            files = report.downloads(fits, analysis=analysis) | beside(analysis, wv, path)
            for room, part in parts.items():
                files |= {f"{room}/{name}": content for name, content in part.files().items()}
            return report.archive(files)

        yield await store.in_thread(files)

    @render.download_button(filename="page.json", media_type="application/json")
    async def save() -> AsyncIterator[bytes]:
        with reactive.isolate():
            state, fits, outcome = store.state(), store.fits(), store.of_recording()
        needed = state.source in ("file", "public", "saved")
        yield await store.in_thread(lambda: saved.write(state, outcome.value if needed else None, fits, store.limits))

    @render.ui
    def program() -> Tag | None:
        analysis = present().value
        if analysis is None:
            return None
        more = [part.program for part in present_parts().values() if part.program]
        return ui.div(*map(text, [script.python(analysis), *more]))

    @render.ui
    def commands() -> Tag | None:
        analysis = present().value
        if analysis is None:
            return None
        more = [part.commands for part in present_parts().values() if part.commands]
        try:
            first = text(script.command(analysis))
        except ValueError as error:  # what the command line does not know
            first = ui.p(str(error))
        return ui.div(first, *map(text, more))


ROOM = Room("takeaway", "Take away", _ui, _server)
