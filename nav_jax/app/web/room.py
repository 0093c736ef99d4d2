"""The room Navigation: a covariance analysis at once, and what takes longer by buttons."""

from collections.abc import AsyncIterator, Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web.choices import offer
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.jobs import BUSY, Tell
from gmwm_jax.app.web.outputs import as_html, render_figure, status, text
from gmwm_jax.app.web.report import archive
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.store import Part, Same, Store
from nav_jax.app.comparison_file import Config
from nav_jax.app.web import controls, figures, files, tables
from nav_jax.app.web.drive import Drive, Filtering, Sent, StudiedDrive, navigate, study_outages
from nav_jax.app.web.followed import follow
from nav_jax.app.web.inputs import make_ui
from nav_jax.app.web.models import errors_of, fits_of
from nav_jax.app.web.state import NavigationState
from nav_jax.app.web.steps import STEPS
from nav_jax.app.web.study import PAGE, Followed, config_of_text, tables_of, toml_of, without_runs
from nav_jax.imu.errors import ImuErrors
from nav_jax.lincov.analysis import Analysis, analyse
from nav_jax.lincov.budget import Budget, error_budget
from nav_jax.lincov.derivatives import Sensitivities, sensitivities
from nav_jax.lincov.filter_design import Design, design
from nav_jax.simulation.comparison import Comparison

NOTHING = "The covariance analysis is not there yet."
_AT_ONCE = 16
"""Runs between two looks at how far they have come."""


class _Models(NamedTuple):
    """What is fitted on the page."""

    errors: dict[str, ImuErrors]
    remarks: tuple[str, ...]


class _Analysed(NamedTuple):
    """What is computed at once."""

    config: Config
    truth: ImuErrors
    analysis: Analysis


def _server(input: Inputs, store: Store) -> None:
    jobs = store.jobs
    visited = reactive.Value(False, name="visited")

    @reactive.effect
    def _look() -> None:  # nothing is computed before somebody looks
        if input.room() == controls.ROOM:
            visited.set(True)

    def models_key() -> Any:
        state: Any = store.state()
        if not visited():
            return None
        wanted = {PAGE: model_of(state)} if state.nav_page or state.nav_truth == "fit" else {}
        known = {_canonical(model) for model in wanted.values()}
        for model in filter(None, map(str.strip, state.nav_structures.split(";"))):
            if _canonical(model) not in known:
                wanted[model] = model
        if not wanted:
            return (None, (), "", "")
        wv = store.variance().value
        if wv is None or store.of_recording().value is None:
            return None
        return Same(wv), tuple(wanted.items()), state.weights, state.nav_sensor

    def fit_models(key: Any) -> _Models:
        of, wanted, weights, sensor = key
        errors: dict[str, ImuErrors] = {}
        remarks: list[str] = []
        for name, model in wanted:
            store.limits.require_model(gj.parse_model(model))
            found = errors_of(fits_of(of.value, model, weights), sensor)
            errors[name] = found.errors
            remarks += found.remarks
        return _Models(errors, tuple(dict.fromkeys(remarks)))

    models = store.computed(models_key, fit_models, "fitting all channels ..", room=controls.ROOM)
    kept = store.new_folder("trajectories-")

    def followed_key() -> Any:
        state: Any = store.state()
        sent = _sent(input.nav_sent())
        if state.nav_motion != controls.FILE or not sent or not visited():
            return None
        return sent[0], tuple((c.key, getattr(state, c.name)) for c in controls.of_reading())

    def read(key: Any) -> Followed:
        file, options = key
        return follow(Path(file.path), file.name, dict(options), store.limits, kept)

    followed = store.computed(followed_key, read, "reading the trajectory ..")

    def compared() -> dict[str, Any] | None:
        """All that is compared, as sections; reactive."""
        found, state, trajectory = models().value, store.state(), followed()
        if found is None or trajectory.busy:
            return None
        if trajectory.error:
            raise ValueError(trajectory.error)
        return tables_of(state, found.errors, followed=trajectory.value)

    def configuration() -> str | None:
        sections = compared()
        return None if sections is None else toml_of(sections)

    def analysis_key() -> str | None:
        sections = compared()
        return None if sections is None else toml_of(without_runs(sections))

    def compute(written: str) -> _Analysed:
        return _said(lambda: _analysed(written, kept))

    sentence = "computing covariances .. (filters of a new structure are compiled once, some seconds)"
    analysed = store.computed(analysis_key, compute, sentence, room=controls.ROOM)

    def present() -> _Analysed | None:
        return analysed().value

    def of_button(name: str) -> str:
        """Of which filter."""
        found = present()
        assert found is not None  # there is a button only then
        return name if name in found.config.filters else next(iter(found.config.filters))

    def budget_key() -> Any:
        written = analysis_key()
        state: Any = store.state()
        return None if written is None or present() is None else (written, of_button(state.nav_of))

    def design_key() -> Any:
        written = analysis_key()
        state: Any = store.state()
        return None if written is None else (written, state.nav_max_accel, state.nav_max_gyro)

    def begin(name: str, key: Callable[[], Any], work: Callable[[_Analysed, Any, Tell], Any]) -> None:
        try:
            found, asked = present(), key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return
        if found is None or asked is None:
            ui.notification_show(NOTHING, type="warning")
        else:
            start(name, asked, lambda tell: _said(lambda: work(found, asked, tell)))

    def start(name: str, asked: Any, work: Callable[[Tell], Any]) -> None:
        if not jobs.start(name, asked, work):
            ui.notification_show(BUSY, type="warning")

    def result(name: str, key: Callable[[], Any]) -> Outcome[Any]:
        """What a button has made for the present inputs; reactive."""
        try:
            asked = key()
        except ValueError:
            return Outcome()  # said above
        return Outcome() if asked is None or present() is None else jobs.result(name, asked)

    @reactive.effect
    @reactive.event(input.nav_run)
    def _run() -> None:
        begin("nav_runs", configuration, partial(_runs, folder=kept))

    @reactive.effect
    @reactive.event(input.nav_budget)
    def _budget() -> None:
        begin("nav_budget", budget_key, _budget_of)

    @reactive.effect
    @reactive.event(input.nav_design)
    def _design() -> None:
        begin("nav_design", design_key, _design_of)

    @reactive.calc
    def runs() -> Outcome[Comparison]:
        return result("nav_runs", configuration)

    @reactive.calc
    def budgeted() -> Outcome[tuple[str, Budget, Sensitivities]]:
        return result("nav_budget", budget_key)

    @reactive.calc
    def designed() -> Outcome[Design]:
        return result("nav_design", design_key)

    def names() -> tuple[str, ...] | None:
        found = present()
        return None if found is None else tuple(found.config.filters)

    offer("nav_of", names, lambda: of_button(input.nav_of()))

    def columns() -> int:
        return 1 if store.narrow() else 2

    @render.ui
    def nav_status() -> Tag | None:
        for outcome in (store.of_recording(), models(), followed()):
            if (outcome.error or outcome.busy) and present() is None:
                return status(outcome)
        return status(analysed())

    @render.ui
    def nav_analysed() -> Tag | None:
        found, of = present(), models().value
        if found is None or of is None:
            return None
        return ui.div(as_html(tables.analysis(found.analysis)), *(ui.p(remark) for remark in of.remarks))

    @render_figure
    def nav_analysis() -> go.Figure | Outcome[Any] | None:
        found = analysed()
        if found.value is None:
            return found
        return store.themed(figures.analysis(found.value.analysis, columns=columns()))

    @render_figure
    def nav_trajectory() -> go.Figure | Outcome[Any] | None:
        found = analysed()
        if found.value is None:
            return found
        return store.themed(figures.trajectory(found.value.config.scenario.reference, columns=columns()))

    @render.ui
    def nav_budget_status() -> Tag | None:
        return status(budgeted())

    @render_figure
    def nav_budget_figure() -> go.Figure | Outcome[Any] | None:
        found = budgeted()
        return found if found.value is None else store.themed(figures.budget(found.value[1], columns=columns()))

    @render.ui
    def nav_budget_table() -> Tag | None:
        found = budgeted().value
        if found is None:
            return None
        name, parts, derivatives = found
        return ui.div(as_html(tables.budget(parts, name)), as_html(tables.sensitivities(derivatives, name)))

    @render.ui
    def nav_design_status() -> Tag | None:
        return status(designed())

    @render_figure
    def nav_design_figure() -> go.Figure | Outcome[Any] | None:
        found = designed()
        return found if found.value is None else store.themed(figures.design(found.value, columns=columns()))

    @render.ui
    def nav_design_table() -> Tag | None:
        found = designed().value
        return None if found is None else as_html(tables.design(found))

    @render.ui
    def nav_runs_status() -> Tag | None:
        found = runs()
        if found.value is not None and found.value.num_common < 2:
            return ui.div("Fewer than two runs are done in which no filter failed: nothing is ranked.")
        return status(found)

    def ranked() -> Outcome[Any]:
        found = runs()
        return Outcome() if found.value is not None and found.value.num_common < 2 else found

    @render.ui
    def nav_runs_table() -> Tag | None:
        found = ranked().value
        return None if found is None else as_html(tables.comparison(found))

    @render_figure
    def nav_runs_figure() -> go.Figure | Outcome[Any] | None:
        found = ranked()
        return found if found.value is None else store.themed(figures.comparison(found.value, columns=columns()))

    @render_figure
    def nav_errors_figure() -> go.Figure | Outcome[Any] | None:
        found = ranked()
        if found.value is None:
            return found
        of = found.value[of_button(input.nav_of())]
        return store.themed(figures.errors(of, columns=columns()))

    @render_figure
    def nav_sensors_figure() -> go.Figure | Outcome[Any] | None:
        found = ranked()
        if found.value is None:
            return found
        of = found.value[of_button(input.nav_of())]
        return store.themed(figures.sensor_states(of, columns=columns()))

    def drive_key() -> tuple[tuple[Sent, ...], Filtering]:
        state: Any = store.state()
        name = state.nav_drive_filter.strip() or None
        return _sent(input.nav_drive()), Filtering(name, state.nav_drive_gate, state.nav_drive_vibration)

    def outages_key() -> tuple[tuple[Sent, ...], Filtering, float, float, int]:
        state: Any = store.state()
        return *drive_key(), state.nav_outage_last, state.nav_outage_every, state.nav_outage_runs

    def begin_of_drive(name: str, sent: tuple[Sent, ...], asked: Any, work: Callable[[Tell], Any]) -> None:
        if sent:
            start(name, asked, work)
        else:
            ui.notification_show("Send the files of a drive first.", type="warning")

    @reactive.effect
    @reactive.event(input.nav_navigate)
    def _navigate() -> None:
        try:
            asked = drive_key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return
        sent, filtering = asked
        begin_of_drive("nav_drive", sent, asked, partial(navigate, sent, store.limits, filtering=filtering))

    @reactive.effect
    @reactive.event(input.nav_outages)
    def _outages() -> None:
        try:
            asked = outages_key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return
        sent, filtering, last, every, runs = asked
        how = {"last": last, "every": every, "runs": runs, "filtering": filtering}
        work = partial(study_outages, sent, store.limits, **how)
        begin_of_drive("nav_outages", sent, asked, work)

    @reactive.calc
    def driven() -> Outcome[Drive]:
        try:
            return jobs.result("nav_drive", drive_key())
        except ValueError:
            return Outcome()  # said above

    @reactive.calc
    def studied() -> Outcome[StudiedDrive]:
        try:
            return jobs.result("nav_outages", outages_key())
        except ValueError:
            return Outcome()  # said above

    @render.ui
    def nav_drive_status() -> Tag | None:
        return status(driven())

    @render_figure
    def nav_drive_figure() -> go.Figure | Outcome[Any] | None:
        found = driven()
        return found if found.value is None else store.themed(figures.drive(found.value.solution, columns=columns()))

    @render.ui
    def nav_drive_text() -> Tag | None:
        found = driven().value
        return None if found is None else text(found.text)

    @render.ui
    def nav_outages_status() -> Tag | None:
        return status(studied())

    @render_figure
    def nav_outages_figure() -> go.Figure | Outcome[Any] | None:
        found = studied()
        return found if found.value is None else store.themed(figures.outages(found.value.study))

    @render.ui
    def nav_outages_text() -> Tag | None:
        found = studied().value
        return None if found is None else text(found.text)

    @reactive.calc
    def parts() -> files.Parts | None:
        found, written = present(), configuration() if present() is not None else None
        if found is None or written is None:
            return None
        made = files.Parts(written, found.analysis, runs().value, budgeted().value, designed().value)
        trajectory = followed().value
        return made if trajectory is None else made._replace(trajectory=trajectory.folder / trajectory.name)

    def part() -> Part | None:
        found = parts()
        if found is None:
            return None
        program = files.python(found.text, runs=found.runs is not None)
        return Part(lambda: files.downloads(found), program, files.commands(several=len(found.analysis) > 1))

    store.parts[controls.ROOM] = part

    @render.ui
    def nav_takeaway() -> Tag | None:
        if parts() is None:
            return ui.p("There is nothing to take away yet.")
        return ui.download_button("nav_archive", "Download configuration and results", class_="btn-outline-primary")

    @render.download_button(filename="navigation.zip", media_type="application/zip")
    async def nav_archive() -> AsyncIterator[bytes]:
        with reactive.isolate():
            found = parts()
        if found is None:
            return  # inputs have changed since; there is no button any more
        yield await store.in_thread(lambda: archive(files.downloads(found)))


def _sent(files: Any) -> tuple[Sent, ...]:
    """What a field of files has, as the framework says it."""
    return tuple(Sent(file["name"], file["datapath"]) for file in files or ())


def _analysed(text: str, folder: Path) -> _Analysed:
    config = config_of_text(text, folder)
    assert isinstance(config.truth, ImuErrors)  # a recording is no choice of the room
    return _Analysed(config, config.truth, analyse(config.scenario, config.truth, config.filters))


def _runs(_: _Analysed, text: str, tell: Tell, *, folder: Path) -> Comparison:
    config = config_of_text(text, folder)
    run = config.run.model_copy(update={"chunk_size": _AT_ONCE, "workers": 1})  # the other core is for clicks
    return replace(config, run=run).compare(progress=tell)


def _budget_of(found: _Analysed, key: Any, tell: Tell) -> tuple[str, Budget, Sensitivities]:
    name, scenario, believed = key[1], found.config.scenario, found.config.filters[key[1]]
    tell(0, None)
    parts = error_budget(scenario, found.truth, believed)
    tell(1, 2)
    return name, parts, sensitivities(scenario, found.truth, believed)


def _design_of(found: _Analysed, key: Any, tell: Tell) -> Design:
    most = {"max_accel": key[1], "max_gyro": key[2]}
    return design(found.config.scenario, found.truth, **most, progress=tell)


def _said(work: Callable[[], Any]) -> Any:
    """What there is no memory for is said as what is wrong."""
    try:
        return work()
    except MemoryError as error:
        raise ValueError(str(error) or "There is not enough memory.") from error


def _canonical(text: str) -> str:
    return str(gj.parse_model(text))


ROOM = Room(controls.ROOM, "Navigation", make_ui, _server, NavigationState, STEPS)
