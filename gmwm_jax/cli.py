"""The command line: ``gmwm-jax wv | fit | units | data | demo``. A leaf: arguments in, tables and files out."""

import functools
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import matplotlib.pyplot as plt
import typer
from matplotlib.figure import Figure

from gmwm_jax import datasets
from gmwm_jax._files import write_atomically
from gmwm_jax.allan import allan_deviation, read_off
from gmwm_jax.datasheet import from_datasheet
from gmwm_jax.demo import run_demo
from gmwm_jax.estimates import continuous_table
from gmwm_jax.fitting import fit as fit_model
from gmwm_jax.io import read_recording, save_recording
from gmwm_jax.processes.registry import parse_model
from gmwm_jax.recording import Recording
from gmwm_jax.result import Fit, Status
from gmwm_jax.units import SI_SIGNALS, convert
from gmwm_jax.variance import wavelet_variance

app = typer.Typer(
    help="Noise models of inertial sensors from static recordings (wavelet variance, GMWM).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
data_app = typer.Typer(help="Named data sets: public recordings, and simulated ones.", no_args_is_help=True)
app.add_typer(data_app, name="data")


def _command(group: typer.Typer, name: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function a command that turns errors of input into one message and exit code 1."""

    def register(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function)
        def run(*args: Any, **options: Any) -> None:
            try:
                function(*args, **options)
            except (ValueError, KeyError, OSError, ImportError) as error:
                text = error.args[0] if isinstance(error, KeyError) else error
                typer.echo(f"Error: {_as_options(str(text))}", err=True)
                raise typer.Exit(1) from error

        return group.command(name)(run)

    return register


_OPTIONS = {"units": "unit", "num_levels": "levels"} | {n: n for n in ("rate", "time", "columns", "delimiter")}


def _as_options(text: str) -> str:
    """Arguments that a message speaks of, as the command line calls them: ``rate=...`` is ``--rate``."""
    return re.sub(r"\b(\w+)=\.\.\.", lambda m: f"--{_OPTIONS[m[1]]}" if m[1] in _OPTIONS else m[0], text)


def _figure_file(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in _FIGURES:
        raise typer.BadParameter(f"figures are {', '.join(_FIGURES)}, not {str(path)!r}")
    return path


_FIGURES = (".png", ".pdf", ".svg")

File = Annotated[
    Path, typer.Argument(help="Recording: .npy, .npz, .csv, .tsv, .txt, .parquet, .rda; or the name of a data set.")
]
Channels = Annotated[str, typer.Option(help="'all', or names separated by commas; a group such as 'gyro' too.")]
Rate = Annotated[float | None, typer.Option(help="Sampling rate in Hz, if the file does not state it.")]
Unit = Annotated[
    str | None, typer.Option(help="Unit of the samples: 'deg/s', or by channel or group: 'gyro=deg/s,accel=g'.")
]
Time = Annotated[str | None, typer.Option(help="Column (name or number) that holds the time in seconds.")]
TimeUnit = Annotated[str, typer.Option(help="Unit of that column: s, ms, us, ns, min or h.")]
Columns = Annotated[str | None, typer.Option(help="Columns to read: names or numbers (from 0), separated by commas.")]
Delimiter = Annotated[str | None, typer.Option(help="Of a text file, if it is not to be found.")]
Level = Annotated[float, typer.Option(help="Confidence of the intervals.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the results as JSON; '-' for the screen.")]
Plot = Annotated[Path | None, typer.Option("--plot", help="Write a figure (.png, .pdf, .svg).", callback=_figure_file)]


@_command(app)
def wv(
    file: File,
    channels: Channels = "all",
    rate: Rate = None,
    unit: Unit = None,
    time: Time = None,
    time_unit: TimeUnit = "s",
    columns: Columns = None,
    delimiter: Delimiter = None,
    level: Level = 0.95,
    method: Annotated[str, typer.Option(help="modwt or dwt.")] = "modwt",
    levels: Annotated[int | None, typer.Option(help="Number of scales; floor(log2 N) - 1 by default.")] = None,
    allan: Annotated[bool, typer.Option("--allan", help="Allan deviation, with N, B and K read off.")] = False,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Wavelet variance (or Allan deviation) with confidence intervals."""
    rec = _read(file, channels, rate, unit, time, time_unit, columns, delimiter)
    result = wavelet_variance(rec, method=method, num_levels=levels, level=level)
    content: dict[str, Any] = {"rate": rec.rate, "num_samples": len(rec), "level": level}
    if allan:
        adev = allan_deviation(result)
        tables = {name: read_off(adev[i]) for i, name in enumerate(result.channels)}
        _say(json_file, "\n\n".join([repr(adev), *(f"{name}: {table}" for name, table in tables.items())]))
        _write_figure(plot, lambda: adev.plot())
        content["times"] = adev.times
        content["channels"] = {
            name: {
                "unit": one.wv.units[0],
                "deviation": one.deviation,
                "ci_low": one.ci_low,
                "ci_high": one.ci_high,
                "read_off": tables[name].to_list(),
            }
            for name, one in ((name, adev[name]) for name in result.channels)
        }
    else:
        _say(json_file, repr(result))
        _write_figure(plot, lambda: result.plot())
        content["scales"] = result.scales
        content["channels"] = {
            name: {"unit": one.units[0], "variance": one.variance, "ci_low": one.ci_low, "ci_high": one.ci_high}
            for name, one in result.items()
        }
    _write_json(json_file, content)


@_command(app)
def fit(
    file: File,
    model: Annotated[str, typer.Option(help='For example "WN + RW + 2*GM" or "WN + GM(beta=0.01 fixed)".')],
    channels: Channels = "all",
    rate: Rate = None,
    unit: Unit = None,
    time: Time = None,
    time_unit: TimeUnit = "s",
    columns: Columns = None,
    delimiter: Delimiter = None,
    level: Level = 0.95,
    datasheet: Annotated[
        str | None, typer.Option(help="Datasheet entries to draw: 'N=0.15 deg/sqrt(h), K=2 deg/h/sqrt(h)'.")
    ] = None,
    two_step: Annotated[
        bool, typer.Option("--two-step", help="Weights from the fitted variance in a second step: less bias.")
    ] = False,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Fit a noise model to each channel: parameters with intervals, for a filter and as a datasheet has them."""
    rec = _read(file, channels, rate, unit, time, time_unit, columns, delimiter)
    lines = None
    if datasheet is not None:
        promised, signal = from_datasheet(_pairs(datasheet), rec.rate)
        lines = {signal: promised}
    fits = fit_model(wavelet_variance(rec), model, omega="two-step" if two_step else None, level=level, throw=False)
    singles = [fits] if isinstance(fits, Fit) else list(fits.values())
    _say(json_file, "\n\n".join([repr(one) for one in singles] + ([] if isinstance(fits, Fit) else [repr(fits)])))
    _write_figure(plot, lambda: fits.plot(datasheet=lines))
    _write_json(json_file, [one.to_dict() for one in singles])
    for one in singles:
        if one.status is not Status.converged:
            typer.echo(f"Warning: {one.wv.channels[0]}: {one.status.value}", err=True)


@_command(app)
def units(
    value: Annotated[float | None, typer.Argument(help="A number to convert,")] = None,
    source: Annotated[str | None, typer.Argument(help="its unit,")] = None,
    target: Annotated[str | None, typer.Argument(help="and the unit wanted.")] = None,
    model: Annotated[str | None, typer.Option(help="Per-sample model to continuous time and datasheet units.")] = None,
    datasheet: Annotated[str | None, typer.Option(help="Datasheet entries 'N=0.15 deg/sqrt(h)' to a model.")] = None,
    rate: Rate = None,
    signal: Annotated[str, typer.Option(help="SI unit of the signal of --model: rad/s, m/s^2 or 1.")] = "rad/s",
    json_file: Json = None,
) -> None:
    """Convert a number between units, or a model between per-sample, continuous-time and datasheet form.

    gmwm-jax units 0.15 "deg/sqrt(h)" "rad/s/sqrt(Hz)"

    gmwm-jax units --model "WN(sigma2=1e-5) + GM(beta=0.01, variance=1e-7)" --rate 100

    gmwm-jax units --datasheet "N=0.15 deg/sqrt(h)" --rate 400
    """
    if value is not None:
        if source is None or target is None:
            raise ValueError('A number is converted from one unit to another: units 0.15 "deg/h" "rad/s".')
        converted = convert(value, source, target)
        _say(json_file, f"{value:g} {source} = {converted:.10g} {target}")
        _write_json(json_file, {"value": converted, "unit": target})
    elif model is not None or datasheet is not None:
        if rate is None:
            raise ValueError("The sampling rate is missing: give --rate in Hz. It is never guessed.")
        if signal not in SI_SIGNALS:
            raise ValueError("--signal is rad/s, m/s^2 or 1; parameters are SI")
        if datasheet is not None:
            composite, signal = from_datasheet(_pairs(datasheet), rate)
        else:
            composite = parse_model(model or "")
        tables = [continuous_table(composite, rate, signal, datasheet=d) for d in (False, True)]
        _say(json_file, f"{composite}  (per sample at {rate:g} Hz)\n\n{tables[0]}\n\n{tables[1]}")
        lists = {"continuous": tables[0].to_list(), "datasheet": tables[1].to_list()}
        _write_json(json_file, {"model": repr(composite), "rate": rate, **lists})
    else:
        raise ValueError("Give a number with two units, or --model, or --datasheet. See gmwm-jax units --help.")


@_command(data_app, "list")
def data_list(json_file: Json = None) -> None:
    """List the public recordings and the sensors that can be simulated."""
    recordings = [datasets.info(name)._asdict() for name in datasets.names()]
    sensors = {name: {c: repr(m) for c, m in datasets.sensor_models(name).items()} for name in datasets.sensors()}
    lines = [f"{known['name']:20s} {known['description']}" for known in recordings]
    _say(json_file, "\n".join([*lines, *(f"{name:20s} simulated: {', '.join(m)}" for name, m in sensors.items())]))
    _write_json(json_file, {"recordings": recordings, "simulated": sensors})


@_command(data_app, "fetch")
def data_fetch(name: str) -> None:
    """Fetch a public recording (once) and print where it is."""
    typer.echo(datasets.fetch(name))


@_command(data_app, "simulate")
def data_simulate(
    sensor: str,
    out: Annotated[Path, typer.Option(help="Target, .npz.")],
    samples: Annotated[int, typer.Option(help="Length of the record.")] = 360_000,
    seed: Annotated[int, typer.Option(help="Of the random numbers.")] = 0,
    plot: Plot = None,
) -> None:
    """Draw a static recording of a sensor.

    The parameter values are estimated with this package from the wavelet variances published with SMAC-Group/imudata.
    """
    import jax

    rec = datasets.simulated(sensor, samples, key=jax.random.key(seed))
    typer.echo(f"{rec}\n{save_recording(rec, out)}")
    _write_figure(plot, rec.plot)


@_command(app)
def demo(
    out: Annotated[Path, typer.Option(help="Folder for figures and tables.")] = Path("out"),
    samples: Annotated[int, typer.Option(help="Length of the simulated recording.")] = 1_000_000,
) -> None:
    """Simulate a static MTi-G recording, fit it, compare with the truth; figures and tables."""
    run_demo(out, samples, typer.echo)


def _read(
    file: Path,
    channels: str,
    rate: float | None,
    unit: str | None,
    time: str | None,
    time_unit: str,
    columns: str | None,
    delimiter: str | None,
) -> Recording:
    units = None if unit is None else _pairs(unit) if "=" in unit else unit
    if str(file) in datasets.names() and not file.exists():
        file = datasets.fetch(str(file))
    rec = read_recording(
        file,
        rate=rate,
        units=units,
        columns=None if columns is None else [_column(part) for part in columns.split(",")],
        time=None if time is None else _column(time),
        time_unit=time_unit,
        delimiter=delimiter,
    )
    if channels == "all":
        return rec
    return rec[[name for part in channels.split(",") for name in rec[part.strip()].channels]]


def _column(text: str) -> int | str:
    return int(text) if text.strip().isdigit() else text.strip()


def _pairs(text: str) -> dict[str, str]:
    pairs = {}
    for part in text.split(","):
        name, equals, value = part.partition("=")
        if not equals:
            raise ValueError(f"Cannot read {part.strip()!r}: expected name=value, several separated by commas.")
        pairs[name.strip()] = value.strip()
    return pairs


def _say(json_file: Path | None, text: str) -> None:
    """Print a table, unless the screen is for JSON."""
    if json_file is None or str(json_file) != "-":
        typer.echo(text)


def _write_json(path: Path | None, content: Any) -> None:
    if path is None:
        return
    text = json.dumps(content, indent=1, default=lambda array: array.tolist(), allow_nan=False)
    if str(path) == "-":
        typer.echo(text)
    else:
        write_atomically(path, lambda file: file.write(text.encode()))


def _write_figure(path: Path | None, draw: Callable[[], Figure]) -> None:
    if path is None:
        return
    plt.switch_backend("Agg")
    figure = draw()
    write_atomically(path, lambda file: figure.savefig(file, format=path.suffix.lower().lstrip("."), dpi=150))
    plt.close(figure)
