"""The controls of the room, set as a state says, and the places of what it shows."""

from collections.abc import Iterable
from typing import Any

from htmltools import Tag
from shiny import ui

from gmwm_jax import datasets
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.outputs import output_figure
from nav_jax.app.web import controls
from nav_jax.app.web.controls import Choice, Control
from nav_jax.imu.deterministic import DETERMINISTIC

_TRUTHS = {"sensor": "a known sensor", "fit": "the fit of the room Model & fit", "text": "the models written here"}
_MODEL = "WN(sigma2=1e-6) + GM(beta=0.01, variance=1e-8)"

_UNIT = (
    "What a calibration leaves of a unit, as standard deviations, one for all axes or [x, y, z]: constants that are "
    "drawn for every run, and states of the filter that believes the truth. Empty ones are not there. A bias by "
    "temperature needs a temperature that changes: the sensor warms up by the temperature rise, under Steps and Earth."
)

_GRAVITY = (
    "Accelerometers take a deflection of the vertical for an acceleration, which a filter cannot tell from a tilt; it "
    "changes with the distance travelled, as the masses under the ground do, and not with time."
)

_STUDY = (
    "Fixes of receivers are withheld from the filter in outages all over the drive, in runs that are shifted against "
    "each other, and the last fix withheld in each outage says how far off the filter is: beside this error "
    "stand what the filter claims of it, and the NEES over the number of its components, whose mean is 1 where claims "
    "are true, with the 95 % band of that mean."
)

_FILTERING = (
    "The first filter of the configuration is taken unless another one is named. A gate refuses fixes whose normalised "
    "innovation squared is beyond what good ones stay below with this probability: with 0.999 it refuses one good fix "
    "in a thousand, and outliers no longer move the filter. The noise of vibration adds that factor times the running "
    "variance of the samples to the white noise of every axis, so that claims grow on rough roads; nav-jax vibration "
    "finds it. What is empty is as the configuration says."
)


def make_ui(state: Any, limits: Limits) -> Tag:
    """Make the room."""
    return ui.div(
        ui.h2("Truth and filters"),
        ui.div(
            ui.input_select("nav_truth", "The true errors are of", _TRUTHS, selected=state.nav_truth),
            ui.input_select("nav_sensor", "Sensor", list(datasets.sensors()), selected=state.nav_sensor),
            ui.input_switch("nav_right", "A filter that believes the truth", state.nav_right),
            ui.input_switch("nav_page", "One that believes the fit of the page", state.nav_page),
            _text(state, "nav_structures", "Others, fitted to the same variances", "WN; WN + RW"),
            class_="gmwm-controls",
        ),
        _folded(
            "Models written here: the truth, and a filter of your own (per sample, in SI)",
            _text(state, "nav_accel", "Truth, accelerometers", _MODEL),
            _text(state, "nav_gyro", "Truth, gyros", _MODEL),
            _text(state, "nav_rate", "Rate of the truth [Hz]", "100"),
            _text(state, "nav_accel_bias", "Truth, turn-on bias sd, accelerometers [m/s^2]", "0"),
            _text(state, "nav_gyro_bias", "Truth, turn-on bias sd, gyros [rad/s]", "0"),
            _text(state, "nav_own_accel", "Own filter, accelerometers", _MODEL),
            _text(state, "nav_own_gyro", "Own filter, gyros", _MODEL),
        ),
        ui.p(_UNIT),
        *(_folded(f"Truth: {k.title}", *_fields(state, k.controls), says=DETERMINISTIC[k.name].effect)
          for k in controls.calibration()),
        _folded("Truth: gravity other than the Earth's", *_fields(state, controls.gravity()), says=_GRAVITY),
        ui.input_switch("nav_uncalibrated", "A filter that knows of none of these", state.nav_uncalibrated),
        ui.h2("Trajectory"),
        ui.navset_pill(
            *(ui.nav_panel(m.title, *_file(m), _grid(_fields(state, m.controls)), value=m.name)
              for m in controls.motions()),
            id="nav_motion",
            selected=state.nav_motion,
        ),
        ui.h2("Aiding, start and steps"),
        ui.input_checkbox_group(
            "nav_aiding", "Sensors", {s.name: s.title for s in controls.aiding()},
            selected=state.nav_aiding.split(","), inline=True,
        ),
        *(_folded(s.title, *_fields(state, s.controls)) for s in controls.aiding()),
        _folded("Start: standard deviations, one or [north, east, down]", *_fields(state, controls.start())),
        _folded("Steps and Earth", *_fields(state, controls.computed())),
        ui.h2("Covariance analysis: without random numbers"),
        ui.output_ui("nav_status"),
        ui.output_ui("nav_analysed"),
        output_figure("nav_analysis"),
        output_figure("nav_trajectory"),
        ui.h2("What makes the error, and the smallest filter that serves"),
        ui.div(
            ui.input_select("nav_of", "Filter", {state.nav_of: state.nav_of or "first"}, selected=state.nav_of),
            ui.input_action_button("nav_budget", "Error budget", class_="btn-outline-primary"),
            ui.input_numeric("nav_max_accel", "Most GM, accelerometer", state.nav_max_accel, min=0, max=2),
            ui.input_numeric("nav_max_gyro", "Most GM, gyro", state.nav_max_gyro, min=0, max=2),
            ui.input_action_button("nav_design", "Design filters", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("nav_budget_status"),
        output_figure("nav_budget_figure"),
        ui.output_ui("nav_budget_table"),
        ui.output_ui("nav_design_status"),
        output_figure("nav_design_figure"),
        ui.output_ui("nav_design_table"),
        ui.h2("Monte Carlo: the same noise for all filters"),
        ui.div(
            *_fields(state, controls.runs()),
            ui.input_action_button("nav_run", "Run", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("nav_runs_status"),
        ui.output_ui("nav_runs_table"),
        output_figure("nav_runs_figure"),
        output_figure("nav_errors_figure"),
        output_figure("nav_sensors_figure"),
        ui.h2("A recorded drive"),
        ui.p("The configuration that nav-jax navigate reads, and the files that it names, sent together."),
        ui.div(
            ui.input_file("nav_drive", "Files of a drive", multiple=True),
            _text(state, "nav_drive_filter", "Filter", "the first"),
            _number(state, "nav_drive_gate", "Gate [probability]"),
            _number(state, "nav_drive_vibration", "Noise of vibration [factor]"),
            ui.input_action_button("nav_navigate", "Navigate", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.p(_FILTERING),
        ui.output_ui("nav_drive_status"),
        output_figure("nav_drive_figure"),
        ui.output_ui("nav_drive_text"),
        ui.div(
            _number(state, "nav_outage_last", "Length of an outage [s]"),
            _number(state, "nav_outage_every", "An outage every [s]"),
            _number(state, "nav_outage_runs", "Runs"),
            ui.input_action_button("nav_outages", "Study outages", class_="btn-outline-primary"),
            class_="gmwm-controls",
        ),
        ui.output_ui("nav_outages_status"),
        output_figure("nav_outages_figure"),
        ui.output_ui("nav_outages_text"),
        ui.p(_STUDY),
        ui.h2("Take away"),
        ui.output_ui("nav_takeaway"),
    )  # fmt: skip


def _file(motion: Choice) -> list[Tag]:
    """The field of the file, of the trajectory that is sent."""
    return [ui.input_file("nav_sent", "File of a trajectory")] if motion.name == controls.FILE else []


def _fields(state: Any, of: Iterable[Control]) -> list[Tag]:
    return [_choice(state, c) if c.choices else _text(state, c.name, c.label, c.hint) for c in of]


def _choice(state: Any, control: Control) -> Tag:
    choices = {"": control.hint} | {c: c for c in control.choices if c != control.hint}
    return ui.input_select(control.name, control.label, choices, selected=getattr(state, control.name))


def _text(state: Any, name: str, label: str, hint: str) -> Tag:
    return ui.input_text(name, label, getattr(state, name), placeholder=hint, update_on="blur")


def _number(state: Any, name: str, label: str) -> Tag:
    return ui.input_numeric(name, label, getattr(state, name), min=0, update_on="blur")


def _grid(fields: Iterable[Tag]) -> Tag:
    return ui.div(*fields, class_="gmwm-controls")


def _folded(title: str, *fields: Tag, says: str = "") -> Tag:
    above = [ui.p(says)] if says else []
    return ui.tags.details(ui.tags.summary(title), *above, _grid(fields), class_="gmwm-folded")
