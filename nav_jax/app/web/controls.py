"""Inputs of the room, made of what the library takes: a row for each field of a `Scenario`, an input for each key.

What a scenario learns to take is an input as soon as a configuration file has a key for it.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Literal, NamedTuple, get_args, get_origin

from pydantic import BeforeValidator
from pydantic.fields import FieldInfo

from nav_jax.app.sections import (
    AIDING,
    CALIBRATION,
    MOTIONS,
    GravitySection,
    InitialSection,
    RunSection,
    Section,
    TrajectoryFile,
)
from nav_jax.simulation.levels import TWO_LEVEL

ROOM = "nav"
"""With what the names of all inputs of the room begin."""
FILE = "file"
"""The trajectory that is sent."""
_SMOOTHING = ("smooth", "smooth_attitude")


class Control(NamedTuple):
    """An input: one key of a section."""

    name: str
    """Of the input."""
    key: str
    label: str
    """With the SI unit."""
    default: str = ""
    """As it stands in the field; empty: what the library has."""
    hint: str = ""
    """What the library has, or how it is written."""
    choices: tuple[str, ...] = ()
    """All that it may be; empty: any text."""


class Choice(NamedTuple):
    """One of some sections, with its inputs: a motion, an aiding sensor."""

    name: str
    title: str
    controls: tuple[Control, ...]


_DEFAULTS: Mapping[str, Mapping[str, str]] = {
    "lemniscate": {"duration": "300"},
    "gnss_position": {"rate": "1", "horizontal": "2.5 cm", "vertical": "5 cm", "outages": "[[260, 300]]"},
    "gnss_velocity": {"rate": "1", "horizontal": "0.01", "vertical": "0.02", "outages": "[[260, 300]]"},
    "barometer": {"rate": "1", "height": "0.5"},
    "run": {"every": "10"},
}
"""Those of the demonstration: five minutes on a lemniscate, without GNSS in the last 40 s."""

_HINTS = {"origin": '["46.5 deg", "6.6 deg", "500 m"]', "stop": "never"}
_LABELS = {"num_runs": "runs", "stop": "runs end early when", "every": "samples in a covariance step"}
_OF_THE_SERVER = ("chunk_size", "workers")
_OF_RUNS = ("num_runs", "seed", "gains", "stop")


def motions() -> tuple[Choice, ...]:
    """List the trajectories that are made here, with their parameters, and the one that is sent.

    Examples
    --------
    >>> from nav_jax.app.web import controls
    >>> [c.label for c in controls.motions()[0].controls]
    ['duration [s]', 'euler [rad]', 'position [m]']
    """
    made = tuple(Choice(n, n, tuple(_of(section, n, ("motion", "name")))) for n, section in MOTIONS.items())
    return (*made, Choice(FILE, "a file", tuple(_of(TrajectoryFile, FILE, ("file", "max_bytes")))))


def of_reading() -> tuple[Control, ...]:
    """List how the file of a trajectory is read; the others say what is done with it then."""
    return tuple(c for c in motions()[-1].controls if c.key not in _SMOOTHING)


def aiding() -> tuple[Choice, ...]:
    """List the aiding sensors, with what they take."""
    return tuple(Choice(n, n.replace("_", " "), tuple(_of(section, n, ("type",)))) for n, section in AIDING.items())


def calibration() -> tuple[Choice, ...]:
    """List what a calibration leaves of the errors of an IMU, kind by kind."""
    return tuple(Choice(n, n.replace("_", " "), tuple(_of(section, n, ()))) for n, section in CALIBRATION.items())


def gravity() -> tuple[Control, ...]:
    """List what is said of a disturbance of gravity."""
    return tuple(_of(GravitySection, "gravity", ()))


def start() -> tuple[Control, ...]:
    """List what is said of the start."""
    return tuple(_of(InitialSection, "start", ()))


def runs() -> tuple[Control, ...]:
    """List what a Monte Carlo takes."""
    return tuple(_of(RunSection, "run", (*_COMPUTED, *_OF_THE_SERVER)))


def computed() -> tuple[Control, ...]:
    """List how finely it is computed, and the Earth."""
    return tuple(_of(RunSection, "run", (*_OF_RUNS, *_OF_THE_SERVER)))


_COMPUTED = tuple(name for name in RunSection.model_fields if name not in (*_OF_RUNS, *_OF_THE_SERVER))

OF_SCENARIO: Mapping[str, Any] = {
    "reference": motions,
    "aiding": aiding,
    "initial": start,
    "earth": computed,
    "every": computed,
    "output_interval": computed,
    "neglected": computed,
    "suspected": computed,
    "temperature": computed,
}
"""Field of a `Scenario` -> its inputs."""


def every() -> Iterator[Control]:
    """Run over all inputs that are made of sections."""
    for choice in (*motions(), *aiding(), *calibration()):
        yield from choice.controls
    yield from (*gravity(), *start(), *computed(), *runs())


def unit_of(field: FieldInfo) -> str:
    """Tell the SI unit that a key of a section is in; "" for none."""
    parts = [field.annotation, *field.metadata]
    while parts:
        part = parts.pop(0)
        if isinstance(part, BeforeValidator) and isinstance(part.func, partial):
            given = part.func.keywords
            return given["setting"].unit if "setting" in given else given["si"]
        parts += [*get_args(part), *getattr(part, "__metadata__", ())]
    return ""


def _of(section: type[Section], where: str, left_out: tuple[str, ...]) -> Iterator[Control]:
    for key, field in section.model_fields.items():
        if key in left_out:
            continue
        unit = unit_of(field)
        unit = "Hz" if unit == "1/s" else unit
        default = field.get_default(call_default_factory=True)
        default = list(default) if isinstance(default, tuple) else default
        hint = _HINTS.get(key, "" if field.is_required() or default in (None, [], "") else str(default))
        label = _LABELS.get(key, key.replace("_", " ")) + (f" [{unit}]" if unit else "")
        kinds = (field.annotation, *get_args(field.annotation))  # itself, or where it may be left out
        known = next((get_args(kind) for kind in kinds if get_origin(kind) is Literal), ())
        choices = tuple(
            choice for choice in known if choice != TWO_LEVEL
        )  # means without runs: nothing to rank or draw
        yield Control(f"{ROOM}_{where}_{key}", key, label, _DEFAULTS.get(where, {}).get(key, ""), hint, choices)
