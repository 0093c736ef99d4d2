"""Several records of one sensor under one model: the joint fit, and whether their parameters are the same."""

from typing import Any, NamedTuple

import jax
import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.jobs import BUSY, Tell
from gmwm_jax.app.web.outputs import output_figure, render_figure, status, text
from gmwm_jax.app.web.rooms.model import model_of
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store


class _Joint(NamedTuple):
    """What is shown of a joint fit."""

    fit: gj.multisignal.JointFit
    figure: go.Figure
    text: str


def controls(state: State) -> Tag:
    """Make the part of the page."""
    return ui.div(
        ui.h2("Several records of this sensor"),
        ui.p(
            "Keep what is looked at, go to another record (another file, another seed), and keep that: the model of "
            "room Model & fit is fitted to all of them together."
        ),
        ui.div(
            ui.input_action_button("keep", "Keep this record", class_="btn-outline-primary"),
            ui.input_action_button("forget", "Forget all records", class_="btn-outline-primary"),
            ui.input_numeric("tests", "Draws of the test", state.tests, min=20, max=2000, update_on="blur"),
            ui.input_action_button("same", "Are the parameters the same?", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("kept"),
        ui.output_ui("joint_status"),
        output_figure("joint_variances"),
        ui.output_ui("joint_text"),
        ui.output_ui("stationarity"),
    )


def serve(input: Inputs, store: Store) -> None:
    """Make what it shows."""
    jobs = store.jobs

    @reactive.effect
    @reactive.event(input.keep)
    def _keep() -> None:
        wv, records = store.variance().value, store.records()
        if wv is None:
            ui.notification_show("There is no wavelet variance yet.", type="warning")
        elif any(known is wv for known in records):
            ui.notification_show("This record is kept already.", type="warning")
        elif len(records) >= store.limits.records:
            ui.notification_show(f"This server keeps at most {store.limits.records} records.", type="warning")
        else:
            store.records.set((*records, wv))

    @reactive.effect
    @reactive.event(input.forget)
    def _forget() -> None:
        store.records.set(())

    def key() -> Any:
        records, channel, state = store.records(), store.channel(), store.state()
        if len(records) < 2 or channel is None:
            return None
        return tuple(map(Same, records)), channel, model_of(state), state.weights, state.level

    def work(key: Any) -> _Joint:
        records, channel, model, weights, level = key
        parsed = gj.parse_model(model)
        store.limits.require_model(parsed)
        for number, record in enumerate(records, start=1):
            if channel not in record.value.channels:
                raise ValueError(f"Record {number} has no channel {channel}: forget the records, and keep others.")
        found = gj.fit_records([r.value[channel] for r in records], parsed, weights=weights, level=level, throw=False)
        assert isinstance(found, gj.multisignal.JointFit)  # of one channel
        compared = str(gj.multisignal.compare_records(found)) if found.fit.covariance is not None else ""
        return _Joint(found, figures.joint(found), "\n\n".join(filter(None, (repr(found), compared))))

    joint = store.computed(key, work, "fitting all records together ..")

    def same_key() -> Any:
        found, state = joint().value, store.state()
        return None if found is None else (Same(found), state.tests, state.draw_seed)

    @reactive.effect
    @reactive.event(input.same)
    def _same() -> None:
        try:
            wanted = same_key()
        except ValueError as error:
            ui.notification_show(str(error), type="warning")
            return

        def test(tell: Tell) -> gj.multisignal.NearStationarity:
            of, num, seed = wanted
            return gj.multisignal.near_stationarity(of.value.fit, num, key=jax.random.key(seed), progress=tell)

        if wanted is None:
            ui.notification_show("Keep two records or more first.", type="warning")
        elif not jobs.start("stationarity", wanted, test):
            ui.notification_show(BUSY, type="warning")

    @render.ui
    def kept() -> Tag | None:
        records = store.records()
        if not records:
            return None
        names = [ui.tags.li(f"{r.name or 'wavelet variance'}: {r.num_samples} samples") for r in records]
        return ui.div(ui.p(f"{len(records)} kept:"), ui.tags.ol(*names))

    @render.ui
    def joint_status() -> Tag | None:
        return status(joint())

    @render_figure
    def joint_variances() -> go.Figure | Outcome[Any] | None:
        found = joint()
        return found if found.value is None else store.themed(found.value.figure)

    @render.ui
    def joint_text() -> Tag | None:
        found = joint().value
        return None if found is None else text(found.text)

    @render.ui
    def stationarity() -> Tag | None:
        if joint().value is None:
            return None
        found = jobs.result("stationarity", same_key())
        return text(found.value) if found.value is not None else status(found)
