"""What is compared, as the sections of a configuration file: of the inputs, and of the models of the page."""

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tomli_w

from nav_jax.app.comparison_file import TRUTH, Config, config_of
from nav_jax.app.reports import keys_of
from nav_jax.app.sections import quantity
from nav_jax.app.web import controls
from nav_jax.app.web.controls import Choice, Control
from nav_jax.imu.errors import ImuErrors, sensor_errors

RIGHT, UNCALIBRATED, OWN, PAGE = "right", "uncalibrated", "own", "fitted"
"""Names of filters: what believes the truth, what believes all of it but what a calibration leaves and a disturbance of
gravity, the text of one's own, and the model of the page."""


class Followed(NamedTuple):
    """A trajectory that was sent, as a table that is read without options."""

    folder: Path
    name: str
    """Of the file there, which another trajectory has another of."""
    duration: float
    origin: np.ndarray | None
    """Latitude, longitude (rad), height (m), if positions are about one."""


class Caps(NamedTuple):
    """The most that this server computes."""

    runs: int = 2000
    seconds: float = 7200.0
    samples: int = 2_000_000
    filters: int = 6


def value_of(text: str) -> Any:
    """Read a field as a value of a configuration file: a number, a list, or a text such as ``2.5 cm``.

    Examples
    --------
    >>> from nav_jax.app.web.study import value_of
    >>> value_of("0.5"), value_of("[[260, 300]]"), value_of("2.5 cm")
    (0.5, [[260, 300]], '2.5 cm')
    """
    if "\n" in text or "\r" in text:
        return text
    try:
        found = tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError):
        return text.strip()
    return found if isinstance(found, bool | int | float | str | list) else text.strip()


def tables_of(
    state: Any, models: Mapping[str, ImuErrors], caps: Caps | None = None, followed: Followed | None = None
) -> dict[str, Any]:
    """Write the sections of a comparison.

    Parameters
    ----------
    state
        Inputs of the page, a `nav_jax.app.web.state.NavigationState`.
    models
        Name -> what is fitted on the page; `PAGE` is its model.
    caps
        Of the server.
    followed
        The trajectory that was sent, if one is to be followed.

    Raises
    ------
    ValueError
        A choice that there is not, no filter, no file of a trajectory, or more than the server computes.

    Examples
    --------
    >>> from nav_jax.app.web.state import NavigationState
    >>> from nav_jax.app.web.study import tables_of
    >>> tables_of(NavigationState(nav_aiding="barometer"), {})["aiding"]
    [{'type': 'barometer', 'rate': 1, 'height': 0.5}]
    """
    caps = caps or Caps()
    motion = _chosen(controls.motions(), state.nav_motion, "Trajectory")
    sensors = [_chosen(controls.aiding(), name, "Aiding") for name in state.nav_aiding.split(",") if name]
    tables = {
        "trajectory": _trajectory(state, motion, followed),
        "truth": _truth(state, models) | _biases(state) | _of_unit(state),
        "filters": _filters(state, models, caps),
        "aiding": [{"type": s.name, **_given(state, s.controls)} for s in sensors],
        "initial": _given(state, controls.start()),
        "run": _given(state, (*controls.computed(), *controls.runs())),
    }
    if motion.name == controls.FILE and followed is not None and tables["run"].get("earth") == "wgs84":
        tables["run"] = ({} if followed.origin is None else {"origin": followed.origin.tolist()}) | tables["run"]
    _require(tables, caps, followed)
    return {name: table for name, table in tables.items() if table}


def toml_of(tables: Mapping[str, Any]) -> str:
    """Write the sections as the text of a file that ``nav-jax compare`` reads."""
    return tomli_w.dumps(tables)


def without_runs(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what a Monte Carlo alone depends on.

    Examples
    --------
    >>> from nav_jax.app.web.study import without_runs
    >>> without_runs({"run": {"seed": 3, "every": 10}})
    {'run': {'every': 10}}
    """
    own = {c.key for c in controls.runs()}
    return {**tables, "run": {k: v for k, v in tables.get("run", {}).items() if k not in own}}


def config_of_text(text: str, folder: Path | None = None) -> Config:
    """Read such a text; the file of a trajectory lies in the folder, and it names no other.

    Raises
    ------
    ValueError
        A value that is wrong, by its section and key.
    """
    return config_of(tomllib.loads(text), folder or Path())


def _chosen(known: Iterable[Choice], name: str, what: str) -> Choice:
    listed = {choice.name: choice for choice in known}
    if name not in listed:
        raise ValueError(f"{what}: there is no {name!r}; there are {', '.join(listed)}.")
    return listed[name]


def _given(state: Any, of: Iterable[Control]) -> dict[str, Any]:
    texts = {c.key: getattr(state, c.name).strip() for c in of}
    return {key: value_of(text) for key, text in texts.items() if text}


def _trajectory(state: Any, motion: Choice, followed: Followed | None) -> dict[str, Any]:
    if motion.name != controls.FILE:
        return {"motion": motion.name, **_given(state, motion.controls)}
    if followed is None:
        raise ValueError("Trajectory: send its file.")
    read = {c.name for c in controls.of_reading()}
    return {"file": followed.name, **_given(state, (c for c in motion.controls if c.name not in read))}


def _truth(state: Any, models: Mapping[str, ImuErrors]) -> dict[str, Any]:
    match state.nav_truth:
        case "sensor":
            return keys_of(sensor_errors(state.nav_sensor))
        case "fit":
            if PAGE not in models:
                raise ValueError("The truth is the fit of the page, which is not there: see the room Model & fit.")
            return keys_of(models[PAGE])
    if not (state.nav_accel.strip() and state.nav_gyro.strip()):
        raise ValueError("The truth as text takes a model of the accelerometers and one of the gyros.")
    return {"accel": state.nav_accel, "gyro": state.nav_gyro, "rate": value_of(state.nav_rate)}


def _biases(state: Any) -> dict[str, Any]:
    texts = {"accel_bias_sd": state.nav_accel_bias.strip(), "gyro_bias_sd": state.nav_gyro_bias.strip()}
    return {key: value_of(text) for key, text in texts.items() if text}


def _of_unit(state: Any) -> dict[str, Any]:
    """What a calibration leaves, and gravity; of kinds of which nothing is said there is none."""
    kinds = {kind.name: _given(state, kind.controls) for kind in controls.calibration()}
    found = {"calibration": {name: given for name, given in kinds.items() if given}}
    found["gravity"] = _given(state, controls.gravity())
    return {name: given for name, given in found.items() if given}


def _filters(state: Any, models: Mapping[str, ImuErrors], caps: Caps) -> dict[str, Any]:
    made: dict[str, Any] = {RIGHT: TRUTH} if state.nav_right else {}
    if state.nav_uncalibrated and _of_unit(state):
        made[UNCALIBRATED] = _truth(state, models) | _biases(state)
    rate = _rate(state, models)
    for name, errors in models.items():
        if name != PAGE or (state.nav_page and state.nav_truth != "fit"):
            made[name] = keys_of(errors if rate is None else errors.at_rate(rate))
    if state.nav_own_accel.strip() or state.nav_own_gyro.strip():
        if not (state.nav_own_accel.strip() and state.nav_own_gyro.strip()):
            raise ValueError("A filter of your own takes a model of the accelerometers and one of the gyros.")
        made[OWN] = {"accel": state.nav_own_accel, "gyro": state.nav_own_gyro, "rate": _rate_of_truth(state, models)}
    if not made:
        raise ValueError("There is no filter: choose one at least.")
    if len(made) > caps.filters:
        made.pop(UNCALIBRATED, None)  # nobody asked for it
    if len(made) > caps.filters:
        raise ValueError(f"There are {len(made)} filters, and this server compares {caps.filters}.")
    return made


def _rate_of_truth(state: Any, models: Mapping[str, ImuErrors]) -> float:
    match state.nav_truth:
        case "sensor":
            return sensor_errors(state.nav_sensor).rate
        case "fit":
            return models[PAGE].rate
    return quantity(value_of(state.nav_rate), "1/s")


def _rate(state: Any, models: Mapping[str, ImuErrors]) -> float | None:
    """To which models of the page are taken; None where they have it."""
    rate = _rate_of_truth(state, models)
    return None if all(m.rate == rate for m in models.values()) else rate


def _require(tables: Mapping[str, Any], caps: Caps, followed: Followed | None) -> None:
    trajectory = tables["trajectory"]
    if followed is not None and "file" in trajectory:
        duration = followed.duration
    else:
        duration = quantity(trajectory.get("duration", 300.0), "s")
    rate = quantity(tables["truth"]["rate"], "1/s")
    runs = tables["run"].get("num_runs", 100)
    for wrong, sentence in (
        (duration > caps.seconds, f"The trajectory takes {duration:g} s, and this server computes {caps.seconds:g} s."),
        (duration * rate > caps.samples, f"{duration:g} s at {rate:g} Hz are more than {caps.samples} samples."),
        (isinstance(runs, int) and runs > caps.runs, f"Runs: {runs}, and this server computes {caps.runs}."),
    ):
        if wrong:
            raise ValueError(sentence)
