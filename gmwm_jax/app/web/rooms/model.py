"""A model for the channel that is looked at, fitted anew at every change."""

import re
from collections.abc import Sequence
from typing import Any

import plotly.graph_objects as go
from htmltools import Tag
from shiny import Inputs, reactive, render, ui

import gmwm_jax as gj
from gmwm_jax.app.web import figures, tables
from gmwm_jax.app.web.computed import Outcome
from gmwm_jax.app.web.datasheet import overlay
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import as_html, output_figure, render_figure, status, text
from gmwm_jax.app.web.rooms.room import Room
from gmwm_jax.app.web.saved import Fitted
from gmwm_jax.app.web.state import State
from gmwm_jax.app.web.store import Same, Store
from gmwm_jax.app.web.theory import theory_of_processes
from gmwm_jax.app.web.truth import beside

BOXES = {
    "QN": "QN quantisation",
    "WN": "WN white noise",
    "RW": "RW random walk",
    "DR": "DR drift",
    "GM": "GM Gauss-Markov",
}
MORE = {
    "AR1": "AR1 first order", "BI": "BI bias instability", "FLK": "FLK flicker", "MAT32": "MAT32 Matérn 3/2",
    "MAT52": "MAT52 Matérn 5/2", "ARMA": "ARMA(1,1)", "FGN": "FGN fractional noise", "SIN": "SIN sinusoid",
}  # fmt: skip
_ORDERS = {"ARMA": "ARMA(1,1)"}
"""Of those that have some; others are written as text."""
USUAL = ("WN", "WN + RW", "WN + RW + GM", "WN + RW + 2*GM", "WN + RW + 3*GM")
"""Models that are compiled before somebody asks."""
_MAX_HISTORY = 30
_VALUE = re.compile(r"(=\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?)(?!\S*\s+fixed)(?=\s*[,)])")


def model_of(state: State) -> str:
    """Write the model that the boxes, or the text in their place, are.

    Raises
    ------
    ValueError
        No box is ticked and there is no text.

    Examples
    --------
    >>> from gmwm_jax.app.web.rooms.model import model_of
    >>> from gmwm_jax.app.web.state import State
    >>> model_of(State(boxes="WN,GM", gm=2))
    'WN + 2*GM'
    >>> model_of(State(model="WN(sigma2=1e-5) + RW", hold=True))
    'WN(sigma2=1e-5 fixed) + RW'
    """
    if state.model.strip():
        return _VALUE.sub(r"\1 fixed", state.model.strip()) if state.hold else state.model.strip()
    ticked = [box for box in state.boxes.split(",") if box in BOXES]
    more = [_ORDERS.get(box, box) for box in state.more.split(",") if box in MORE]
    if not ticked and not more:
        raise ValueError("No process is ticked: a model has one at least.")
    own = [f"{state.gm}*GM" if box == "GM" and state.gm > 1 else box for box in ticked]
    return " + ".join([*own, *more])


def parameter_fields(model: gj.Composite) -> list[Tag]:
    """Make two fields a parameter: what becomes of it, and its value."""
    made = []
    names = [
        (label, q.name, float(v)) for label, p in _parts(model) for q, v in zip(p.parameters, p.values, strict=True)
    ]
    for i, (label, name, value) in enumerate(names):
        made.append(ui.input_select(f"how_{i}", f"{label} {name}", ["free", "start", "fixed"]))
        made.append(ui.input_text(f"at_{i}", "at", f"{value:.6g}"))
    return made


def model_with(model: gj.Composite, wanted: Sequence[tuple[str, Any]]) -> str:
    """Write a model of which each parameter is free, starts somewhere or is fixed.

    Parameters
    ----------
    model
        Of which processes.
    wanted
        Of each parameter ``"free"``, ``"start"`` or ``"fixed"``, and the value as text.

    Raises
    ------
    ValueError
        A value that is no number; another number of parameters.

    Examples
    --------
    >>> from gmwm_jax.app.web.rooms.model import model_with
    >>> fitted = gj.parse_model("WN(sigma2=1) + GM(beta=0.1, variance=2)")
    >>> model_with(fitted, [("free", ""), ("fixed", "0.2"), ("free", "")])
    'WN + GM(beta=0.2 fixed)'
    """
    left = list(wanted)
    if len(left) != model.num_parameters:
        raise ValueError("The fit has changed since: choose again.")
    parts = []
    for _, p in _parts(model):
        given = []
        for q in p.parameters:
            how, text = left.pop(0)
            if how != "free":
                given.append(f"{q.name}={float(text):.12g}{' fixed' if how == 'fixed' else ''}")
        if given and p.kind not in (*BOXES, *MORE):
            raise ValueError(f"The values of {p.kind} are written as text.")
        parts.append(f"{p.kind}({', '.join(given)})" if given else p.kind)
    return " + ".join(parts)


def _parts(model: gj.Composite) -> Sequence[tuple[str, Any]]:
    return tuple(zip(model.labels, model.processes, strict=True))


def compile_usual_models() -> None:
    """Fit and draw the usual models once: what is compiled serves records of any length."""
    wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 20_000, channels=["gyro_x"]))
    for model in USUAL:
        fit = gj.fit(wv, model, throw=False)
        assert isinstance(fit, gj.Fit)  # of one channel
        figures.fit(fit)


def _ui(state: State, limits: Limits) -> Tag:
    weights = {"default": "intervals (as R)", "two-step": "two-step", "covariance": "covariance"}
    return ui.div(
        ui.h2("Model"),
        ui.input_checkbox_group("boxes", "Processes", BOXES, selected=state.boxes.split(","), inline=True),
        ui.tags.details(
            ui.tags.summary("More processes"),
            ui.input_checkbox_group("more", "Beside them", MORE, selected=state.more.split(","), inline=True),
            open="" if state.more else None,
        ),
        ui.div(
            ui.input_numeric("gm", "Number of GM", state.gm, min=1, max=limits.gauss_markov),
            ui.input_text(
                "model", "Model as text, in place of the boxes", state.model, update_on="blur",
                placeholder="WN + GM(beta=0.01 fixed) + ARMA(1,1)",
            ),
            ui.input_select("weights", "Weights", weights, selected=state.weights),
            ui.input_switch("hold", "Hold the values in the text", state.hold),
            ui.input_switch("residuals", "Residuals", state.residuals),
            ui.input_action_button("adopt", "Take the datasheet's model", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("fit_status"),
        output_figure("fitted"),
        ui.output_ui("true_parameters"),
        ui.output_ui("estimates"),
        ui.tags.details(
            ui.tags.summary("Start or hold each parameter"), ui.output_ui("each"),
            ui.input_action_button("use", "Fit with these", class_="btn-outline-primary"),
        ),
        ui.output_ui("history"),
        theory_of_processes(),
    )  # fmt: skip


def _server(input: Inputs, store: Store) -> None:
    fits = store.fits

    def key() -> Any:
        wv, channel, state = store.variance().value, store.channel(), store.state()
        if wv is None or channel is None or store.recording().value is None:
            return None
        return Same(wv), channel, model_of(state), state.weights, state.level

    def work(key: Any) -> Any:
        wv, channel, text_of_model, weights, level = key
        model = gj.parse_model(text_of_model)
        store.limits.require_model(model)
        one = wv.value[channel] if len(wv.value.channels) > 1 else wv.value
        return gj.fit(one, model, weights=weights, level=level, throw=False)

    fit = store.computed(key, work, "fitting .. (a model that is new to the server is compiled once, some seconds)")

    store.fit = fit

    def printed_key() -> Any:
        found, state = fit().value, store.state()  # nobody sees it elsewhere
        return None if found is None or state.room != ROOM.id else (Same(found), model_of(state))

    def print_out(key: Any) -> Any:
        of, asked = key
        found: gj.Fit = of.value
        test = found.chi_square
        return (
            repr(found),
            Fitted(asked, found.wv.channels[0], found.objective, None if test is None else test.p_value),
            found.warnings,
        )

    printed = store.computed(printed_key, print_out, "computing the intervals ..", later=True)

    @reactive.effect
    def _remember() -> None:
        found = printed().value
        if found is None:
            return
        one = found[1]
        with reactive.isolate():
            known = fits()
        fits.set((one, *(f for f in known if (f.model, f.channel) != (one.model, one.channel)))[:_MAX_HISTORY])

    @reactive.effect
    @reactive.event(input.take)
    def _take() -> None:
        ui.update_text("model", value=str(input.take())[:500])

    # tells of another fit only, so that fields that are being filled in stay as they are when any other input changes
    present: reactive.Value[Any] = reactive.Value(None, name="present")

    @reactive.effect
    def _present() -> None:
        present.set(fit().value)

    @render.ui
    def each() -> Tag | None:
        found = present()
        return None if found is None else ui.div(*parameter_fields(found.model), class_="gmwm-controls")

    @reactive.effect
    @reactive.event(input.use)
    def _use() -> None:
        found = fit().value
        if found is None:
            return
        num = found.model.num_parameters
        wanted = [(str(input[f"how_{i}"]()), input[f"at_{i}"]()) for i in range(num) if f"how_{i}" in input]
        try:
            ui.update_text("model", value=model_with(found.model, wanted))
            ui.update_switch("hold", value=False)
        except ValueError as error:
            ui.notification_show(str(error), type="warning")

    @render.ui
    def true_parameters() -> Tag | None:
        there, found, truth = printed().value, fit().value, store.truth()
        if there is None or found is None or truth is None or not any(v > 0 for v in beside(found.model, truth)):
            return None
        return as_html(tables.estimates(found, truth))

    @reactive.effect
    @reactive.event(input.adopt)
    def _adopt() -> None:
        found, state = fit().value, store.state()
        if found is None or not state.datasheet:
            ui.notification_show("The field for the datasheet is at the left: fill it in first.", type="warning")
            return
        try:
            models = overlay(state.datasheet, found.rate)
            model = models.get(found.wv.units[0])
            if model is None:
                raise ValueError(f"The datasheet says nothing of a channel in {found.wv.units[0]}.")
            ui.update_text("model", value=repr(model))
        except ValueError as error:
            ui.notification_show(str(error), type="warning")

    @reactive.calc
    def drawn() -> Any:
        """The figure, what is missing for it, or a sentence."""
        first = store.of_recording()
        outcome = fit() if first.value is not None else first
        found = outcome.value
        if not isinstance(found, gj.Fit):
            return Outcome(error=outcome.error, busy=outcome.busy)
        state = store.state()
        try:
            sheet = overlay(state.datasheet, found.rate) if found.rate else {}
        except ValueError as error:
            return Outcome(error=str(error))
        of_channel = {si: model for si, model in sheet.items() if si in found.wv.units}
        return figures.fit(found, residuals=state.residuals, datasheet=of_channel or None)

    @render.ui
    def fit_status() -> Tag | None:
        found = drawn()
        if isinstance(found, Outcome):
            return status(found)
        fitted = fit().value
        if fitted is None:
            return None
        said = ui.p(f"{fitted.model}: objective {fitted.objective:.7g}, {fitted.status.value}", id="objective")
        there = printed().value
        warnings = there[2] if there is not None else ()  # with the intervals, a moment after the figure
        return ui.div(said, *(ui.p(f"Warning: {text}.", class_="gmwm-error") for text in warnings))

    @render_figure
    def fitted() -> go.Figure | Outcome[Any]:
        found = drawn()
        figure: Any = found
        return store.themed(figure) if isinstance(found, go.Figure) else figure

    @render.ui
    def estimates() -> Tag | None:
        outcome = printed()
        return text(outcome.value[0]) if outcome.value is not None else status(outcome)

    @render.ui
    def history() -> Tag | None:
        known = fits()
        if not known:
            return None
        rows = [
            ui.tags.tr(
                ui.tags.td(one.channel), ui.tags.td(f"{one.objective:.7g}"),
                ui.tags.td("" if one.chance is None else f"{one.chance:.2g}"),
                ui.tags.td(ui.tags.button(one.model, type="button", class_="btn btn-sm btn-link", data_take=one.model)),
            )
            for one in known
        ]  # fmt: skip
        head = ui.tags.thead(ui.tags.tr(*(ui.tags.th(name, scope="col") for name in _COLUMNS)))
        table = ui.tags.table(head, ui.tags.tbody(*rows), class_="table")
        return ui.div(ui.h2("Fits of this page"), ui.div(table, class_="gmwm-table"))


_COLUMNS = ("channel", "objective", "p of fit", "model, to take up again")

ROOM = Room("model", "Model & fit", _ui, _server)
