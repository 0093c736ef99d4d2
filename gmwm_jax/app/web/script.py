"""What was done on the page as a Python file that does it again without the page, and as commands of the shell.

The file needs nothing beside it but the recording, where that is a file of one's own.
"""

import shlex
from collections.abc import Mapping
from typing import Any, NamedTuple

from gmwm_jax.app.web.snippets import snippet


class Published(NamedTuple):
    """The published wavelet variances of a sensor, see `gmwm_jax.app.web.library`."""

    sensor: str


class Simulated(NamedTuple):
    """A recording that is drawn, see `gmwm_jax.datasets.simulated`."""

    sensor: str
    num_samples: int
    seed: int


class Drawn(NamedTuple):
    """A recording of one channel that is drawn from a model of one's own."""

    model: str
    num_samples: int
    seed: int
    rate: float
    unit: str


class Stored(NamedTuple):
    """A wavelet variance in a file that it saved, beside the Python file."""

    name: str


class Public(NamedTuple):
    """A public recording, see `gmwm_jax.datasets.load`."""

    name: str


class OwnFile(NamedTuple):
    """A file of one's own."""

    name: str
    options: Mapping[str, Any]
    """Of `gmwm_jax.read_recording`; those that are None are left out."""


class Analysis(NamedTuple):
    """All that decides the numbers on the page."""

    source: Published | Simulated | Drawn | Public | OwnFile | Stored
    channels: tuple[str, ...]
    model: str
    masked: bool = False
    """Are outlying samples missing ones?"""
    efficiency: float | None = None
    """Of a robust wavelet variance; None for the classic one."""
    weights: str | None = None
    level: float = 0.95
    bootstrap: int = 0
    route: str = "variances"
    seed: int = 0
    """Of the replicates."""
    superset: str = ""
    """Of a selection; "" for none."""
    exports: tuple[str, ...] = ()
    """Formats of other filters."""


def python(analysis: Analysis) -> str:
    """Write a Python file that prints the results and writes them as ``fit.json``.

    Parameters
    ----------
    analysis
        What was done.

    Raises
    ------
    ValueError
        No channel; samples asked of published wavelet variances, of which there are none.

    Examples
    --------
    >>> from gmwm_jax.app.web import script
    >>> text = script.python(script.Analysis(script.Published("mti-g"), ("gyro_x",), "WN + RW"))
    >>> print(text.splitlines()[9])
    wv = library.published('mti-g')
    """
    _check(analysis)
    source = analysis.source
    lines = ["import json", "from pathlib import Path", "", "import jax", "", "import gmwm_jax as gj"]
    if isinstance(source, Published):
        lines.append("from gmwm_jax.app.web import library")
    lines += ["", 'jax.config.update("jax_enable_x64", True)', *_data(analysis)]
    options = {"weights": analysis.weights, "level": analysis.level if analysis.level != 0.95 else None}
    call = _arguments(repr(analysis.model), options)
    lines += [
        f"fits = {{name: gj.fit(wv[name], {call}) for name in {list(analysis.channels)!r}}}",
        "for fit in fits.values():",
        "    print(fit)",
    ]
    if analysis.bootstrap:
        given = f"{analysis.bootstrap}, key=jax.random.key({analysis.seed}), route={analysis.route!r}"
        lines += [f"    boot = gj.bootstrap(fit, {given})", "    print(boot)"]
    if analysis.superset:
        lines += ["for name in fits:", f"    print(gj.select(wv[name], {analysis.superset!r}, level={analysis.level}))"]
    for format in analysis.exports:
        file = snippet([], format).file
        lines.append(f"gj.Fit.export_of(list(fits.values()), {format!r}, path={file!r})")
    lines.append('Path("fit.json").write_text(json.dumps([fit.to_dict() for fit in fits.values()], indent=1))')
    return "\n".join([*lines, ""])


def command(analysis: Analysis) -> str:
    """Write the same as commands of the shell, a line each.

    Raises
    ------
    ValueError
        See `python`; what the command line does not know: published wavelet variances, masked outliers, replicates of
        records.

    Examples
    --------
    >>> from gmwm_jax.app.web import script
    >>> own = script.OwnFile("static.csv", {"rate": 100.0, "units": "deg/s"})
    >>> script.command(script.Analysis(own, ("gyro_x",), "WN + RW"))
    "gmwm-jax fit static.csv --rate 100.0 --units deg/s --channels gyro_x --model 'WN + RW' --json fit.json"
    """
    _check(analysis)
    for wrong, what in (
        (isinstance(analysis.source, Published), "published wavelet variances"),
        (isinstance(analysis.source, Stored), "wavelet variances without samples"),
        (isinstance(analysis.source, Drawn), "recordings of models of your own"),
        (analysis.masked, "masked outliers"),
        (bool(analysis.bootstrap) and analysis.route != "variances", "replicates of records"),
    ):
        if wrong:
            raise ValueError(f"The command line does not know {what}: take the Python file.")
    words: list[list[str]] = []
    given: list[str] = []
    match analysis.source:
        case Simulated(sensor, num, seed):
            file = f"{sensor}.npz"
            words.append(["data", "simulate", sensor, "--samples", str(num), "--seed", str(seed), "--out", file])
        case Public(name):
            file = name
        case OwnFile(name, options):
            file = name
            for key, value in options.items():
                if value is not None:
                    given += [f"--{key.replace('_', '-')}", _option(value)]
        case _:
            raise AssertionError  # the others have been refused
    given += ["--channels", ",".join(analysis.channels)]
    given += ["--level", str(analysis.level)] * (analysis.level != 0.95)
    if analysis.efficiency is not None:
        given += ["--robust", "--efficiency", str(analysis.efficiency)]
    fit = ["fit", _path(file), *given, "--model", analysis.model]
    fit += ["--weights", analysis.weights] if analysis.weights else []
    fit += ["--bootstrap", str(analysis.bootstrap), "--seed", str(analysis.seed)] if analysis.bootstrap else []
    for format in analysis.exports:
        fit += ["--export", f"{format}={snippet([], format).file}"]
    words.append([*fit, "--json", "fit.json"])
    if analysis.superset:
        words.append(["select", _path(file), *given, "--model", analysis.superset])
    return "\n".join(shlex.join(["gmwm-jax", *line]) for line in words)


def _check(analysis: Analysis) -> None:
    if not analysis.channels:
        raise ValueError("There is no channel to fit.")
    if isinstance(analysis.source, Published | Stored) and (analysis.masked or analysis.efficiency is not None):
        raise ValueError(
            "Of published and saved wavelet variances there are no samples: no outliers to mask, no robust estimate."
        )


def _data(analysis: Analysis) -> list[str]:
    """From the source to the wavelet variance."""
    match analysis.source:
        case Published(sensor):
            return [f"wv = library.published({sensor!r})"]
        case Stored(name):
            return [f"wv = gj.load({name!r})"]
        case Drawn(model, num, seed, rate, unit):
            drawn = f"gj.simulate(gj.parse_model({model!r}), {num}, key=jax.random.key({seed}))"
            given = f"rate={rate}, units={unit!r}, channels={list(analysis.channels)!r}"
            read = f"gj.Recording.from_array({drawn}, {given})"
        case Simulated(sensor, num, seed):
            read = f"gj.datasets.simulated({sensor!r}, {num}, key=jax.random.key({seed}))"
        case Public(name):
            read = f"gj.datasets.load({name!r})"
        case OwnFile(name, options):
            read = f"gj.read_recording({_arguments(repr(_path(name)), options)})"
    lines = [f"rec = {read}"]
    if analysis.masked:
        lines.append("rec = gj.recordings.mask_outliers(rec).recording")
    return [*lines, f"wv = gj.wavelet_variance({_arguments('rec', {'efficiency': analysis.efficiency})})"]


def _arguments(first: str, options: Mapping[str, Any]) -> str:
    return ", ".join([first, *(f"{key}={value!r}" for key, value in options.items() if value is not None)])


def _path(name: str) -> str:
    """A file beside the script, whatever its name begins with."""
    return f"./{name}" if name.startswith("-") else name


def _option(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, Mapping):
        return ",".join(f"{key}={v}" for key, v in value.items())
    if isinstance(value, list | tuple):
        return ",".join(str(v) for v in value)
    return str(value)
