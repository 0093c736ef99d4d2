"""How sure a fit is, by replicates, and which model the data support."""

import math
from collections import Counter
from typing import Any, NamedTuple

import jax
import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures, tables
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.jobs import BUSY, Tell
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, output_figure, render_figure, status
from gmwm_jax.app.web.rooms import records
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store
from gmwm_jax.app.web.truth import beside

NOTHING = "The fit is not there yet: see the room Model & fit."


class _Described(NamedTuple):
    """What is known of a fit without replicates."""

    fit: gj.Fit
    truth: gj.Composite | None
    """Where the record was simulated, and something of the fit has a true value."""
    true: tables.Table | None
    tested: tables.Table | str
    """Or why there is no test."""


def _num_parts(model: gj.Composite) -> int:
    """How many models of some of its components there are."""
    return math.prod(count + 1 for count in Counter(map(repr, model.processes)).values()) - 1


def _ui(state: State, limits: Limits) -> Tag:
    return ui.div(
        ui.h2("How sure the fit is, by theory and by replicates"),
        ui.output_ui("replicated_fit"),
        ui.div(
            ui.input_numeric(
                "level", "Confidence", state.level, min=0.5, max=0.999, step=0.01, update_on="blur"
            ),
            ui.input_numeric("replicates", "Replicates", state.replicates, min=20, max=5000, update_on="blur"),
            ui.input_select(
                "route", "Drawn are", {"variances": "wavelet variances", "records": "records"}, selected=state.route
            ),
            ui.input_numeric("draw_seed", "Seed of the draws", state.draw_seed, min=0, update_on="blur"),
            ui.input_action_button("replicate", "Replicate", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("replicates_status"),
        output_figure("intervals"),
        ui.output_ui("replicates_table"),
        ui.output_ui("true_values"),
        ui.h2("Does the model describe the data?"),
        ui.output_ui("goodness"),
        ui.h2("Which model the data support"),
        ui.div(
            ui.input_text("superset", "The largest model; or several, with ;", state.superset, update_on="blur"),
            ui.input_switch("nested", "And all its parts", state.nested),
            ui.input_action_button("rank", "Rank the models", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("ranked_status"),
        output_figure("ranked"),
        ui.output_ui("adoption"),
        ui.output_ui("ranked_table"),
        records.controls(state),
    )  # fmt: skip


def _server(input: Inputs, store: Store) -> None:
    jobs = store.jobs

    def replicates_key() -> Any:
        found, state = store.fit().value, store.state()
        return None if found is None else (Same(found), state.replicates, state.route, state.draw_seed)

    def rank_key() -> Any:
        wv, channel, state = store.variance().value, store.channel(), store.state()
        if wv is None or channel is None:
            return None
        return Same(wv), channel, state.superset.strip(), state.nested, state.level

    def begin(name: str, key: Any, work: Any) -> None:
        if key is None:
            ui.notification_show(NOTHING, type="warning")
        elif not jobs.start(name, key, work):
            ui.notification_show(BUSY, type="warning")

    @reactive.effect
    @reactive.event(input.replicate)
    def _replicate() -> None:
        try:
            key = replicates_key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return

        def work(tell: Tell) -> gj.inference.Bootstrap:
            of, num, route, seed = key
            return gj.bootstrap(of.value, num, key=jax.random.key(seed), route=route, progress=tell)

        begin("replicates", key, work)

    @reactive.effect
    @reactive.event(input.rank)
    def _rank() -> None:
        try:
            key = rank_key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return

        def work(tell: Tell) -> Any:
            wv, channel, superset, nested, level = key
            one = wv.value[channel] if len(wv.value.channels) > 1 else wv.value
            models = [gj.parse_model(part) for part in superset.split(";") if part.strip()]
            for model in models:
                store.limits.require_model(model)
            if nested and len(models) > 1:
                raise ValueError("Give one model with all its parts, or several without them.")
            num = _num_parts(models[0]) if nested and models else len(models)
            if num > store.limits.ranked:
                raise ValueError(f"These are {num} models, and this server ranks {store.limits.ranked} at most.")
            asked = models[0] if nested and models else models
            return gj.select(one, asked, nested=nested, level=level, progress=tell)

        begin("ranked", key, work)

    def of_inputs(name: str, key: Any) -> Outcome[Any]:
        """The result for the present inputs, or why there is none."""
        for outcome in (store.of_recording(), *([store.fit()] if name == "replicates" else [])):
            if outcome.value is None:
                return Outcome(error=outcome.error, busy=outcome.busy)
        return jobs.result(name, key())

    @reactive.calc
    def replicated() -> Outcome[Any]:
        return of_inputs("replicates", replicates_key)

    @reactive.calc
    def ranking() -> Outcome[Any]:
        return of_inputs("ranked", rank_key)

    @render.ui
    def replicated_fit() -> Tag | None:
        fit = store.fit().value
        return None if fit is None else ui.p(f"{fit.wv.channels[0]}: {fit.model}")

    @render.ui
    def replicates_status() -> Tag | None:
        return status(replicated())

    def described_key() -> Any:
        found, truth = store.fit().value, store.truth()
        return None if found is None else (Same(found), None if truth is None else Same(truth))

    def describe(key: Any) -> _Described:
        of, truth = key[0].value, None if key[1] is None else key[1].value
        if truth is not None and not any(v > 0 for v in beside(of.model, truth)):
            truth = None  # nothing of the fit has a true value
        of.parameters()  # which the figure asks for, and takes a while
        tested: tables.Table | str
        try:
            tested = tables.goodness(of)
        except ValueError as error:
            tested = str(error)
        return _Described(of, truth, None if truth is None else tables.estimates(of, truth), tested)

    described = store.computed(described_key, describe, "computing the intervals ..", room=ROOM.id)

    @render_figure
    def intervals() -> go.Figure | Outcome[Any] | None:
        for outcome in (store.of_recording(), store.fit(), described()):
            if outcome.value is None:
                return Outcome(error=outcome.error, busy=outcome.busy)
        known, found = described().value, replicated().value
        assert known is not None
        return store.themed(figures.intervals(known.fit, found, truth=known.truth))

    @render.ui
    def true_values() -> Tag | None:
        known = described().value
        return None if known is None or known.true is None else as_html(known.true)

    @render.ui
    def goodness() -> Tag | None:
        known = described().value
        if known is None:
            return None
        return ui.p(known.tested) if isinstance(known.tested, str) else as_html(known.tested)

    @render.ui
    def replicates_table() -> Tag | None:
        found = replicated().value
        return None if found is None else as_html(tables.bootstrap(found))

    @render.ui
    def ranked_status() -> Tag | None:
        return status(ranking())

    @render_figure
    def ranked() -> go.Figure | Outcome[Any] | None:
        found = ranking()
        return found if found.value is None else store.themed(figures.selection(found.value))

    @render.ui
    def adoption() -> Tag | None:
        found = ranking().value
        if found is None:
            return None
        name = found.recommended.name
        button = ui.tags.button(name, type="button", class_="btn btn-outline-primary", data_take=name)
        misfit = found.recommended.fit.misfit  # the best of models that all miss the data is no good model
        return ui.div(
            ui.p(f"Warning: {misfit}.", class_="gmwm-error") if misfit else None,
            ui.p("Take the recommended model into the room Model & fit: ", button),
        )

    @render.ui
    def ranked_table() -> Tag | None:
        found = ranking().value
        return None if found is None else as_html(tables.selection(found))

    records.serve(input, store)


ROOM = Room("inference", "Inference & selection", _ui, _server)
