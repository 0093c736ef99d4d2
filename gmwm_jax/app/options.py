"""What the commands share: options, the way in, tables and files out, one message for a bad input."""

import dataclasses
import functools
import inspect
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import gmwm_jax as gj
from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.entry import as_command, command_line
from gmwm_jax._internal.outputs import check_outputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def command(group: typer.Typer, name: str | None = None) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function a command.

    A parameter that is a dataclass stands for its fields, each an option of its own. Errors of input become one
    message; an output that cannot be written is one, before anything is read.
    """

    def register(function: Callable[..., None]) -> Callable[..., None]:
        groups, parameters = {}, []
        for parameter in inspect.signature(function).parameters.values():
            kind: Any = parameter.annotation
            if isinstance(kind, type) and dataclasses.is_dataclass(kind):
                groups[parameter.name] = kind
                parameters += inspect.signature(kind).parameters.values()
            else:
                parameters.append(parameter)

        @functools.wraps(function)
        def run(context: Any, **options: Any) -> None:
            with command_line(_as_options, context.obj):
                files = [options.get(key) for key in _OUTPUTS]
                files += [path for _, path in exports(options.get("export"))]
                check_outputs(
                    [path for path in files if path is not None and str(path) != "-"],
                    [path for path in (options.get("file"),) if path is not None],
                    [path for path in (options.get("folder"),) if path is not None],
                )
                for key, kind in groups.items():
                    options[key] = kind(**{field.name: options.pop(field.name) for field in dataclasses.fields(kind)})
                function(**options)

        return group.command(name)(as_command(run, parameters))

    return register


_OUTPUTS = ("json_file", "plot", "out")
"""Parameters of commands that name a file to be written; that of a folder is called so."""

_RENAMED = {
    "num_levels": "levels", "time_unit": "time-unit", "max_bytes": "max-bytes", "num_replicates": "bootstrap",
    "num_samples": "samples",
}  # fmt: skip
_OPTIONS = _RENAMED | {
    n: n
    for n in (
        "rate", "units", "scale", "columns", "channels", "names", "time", "clock", "gaps", "format", "delimiter",
        "header", "variable", "step", "interval",
    )
}  # fmt: skip
_ARGUMENT = re.compile(r"""\b(\w+)=(\.\.\.|"[^"]*"|'[^']*'|\d+)""")
_WORDS = "|".join(name for name in _OPTIONS if name not in _RENAMED)
_SUBJECT = re.compile(rf"(^|: )({_WORDS})=?(?= (?:is|names|renames|must|says)\b)")
_RENAMED_WORD = re.compile(rf"\b({'|'.join(_RENAMED)})\b")
_MAPPING = re.compile(r"""\{("[^"]+": "[^"]+"(?:, "[^"]+": "[^"]+")*)\}""")


def _as_options(text: str) -> str:
    """Arguments that a message speaks of, as the command line calls them.

    ``rate=...`` is ``--rate``, ``gaps="nan"`` is ``--gaps nan``, ``{"gyro": "deg/s"}`` is ``"gyro=deg/s"``.
    """

    def option(found: re.Match[str]) -> str:
        if found[1] not in _OPTIONS:
            return found[0]
        value = found[2].strip("\"'")
        return f"--{_OPTIONS[found[1]]}" + ("" if value == "..." else f" {value}")

    def listed(found: re.Match[str]) -> str:
        return '"' + found[1].replace('"', "").replace(": ", "=").replace(", ", ",") + '"'

    text = _MAPPING.sub(listed, _ARGUMENT.sub(option, text))
    text = _SUBJECT.sub(lambda found: f"{found[1]}--{found[2]}", text)
    return _RENAMED_WORD.sub(lambda found: f"--{_RENAMED[found[1]]}", text)


def _figure_file(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in _FIGURES:
        raise typer.BadParameter(f"figures are {', '.join(_FIGURES)}, not {str(path)!r}")
    return path


_FIGURES = (".png", ".pdf", ".svg")

Rate = Annotated[float | None, typer.Option(help="Sampling rate in Hz, if the file does not state it.")]
Level = Annotated[float, typer.Option(help="Confidence of the intervals.")]
Robust = Annotated[bool, typer.Option("--robust", help="Wavelet variance that gives outliers no weight.")]
Efficiency = Annotated[float, typer.Option(help="Of the robust wavelet variance, relative to the classic one.")]
Seed = Annotated[int, typer.Option(help="Of the random numbers.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the results as JSON; '-' for the screen.")]
Export = Annotated[
    list[str] | None,
    typer.Option(
        metavar="FORMAT=FILE",
        help="Write the noise for another filter: kalibr, openvins, vins, kf-gins, pyins, gtsam, px4, ros, nav-jax; "
        "several times if need be; '-' for the screen.",
    ),
]
Plot = Annotated[Path | None, typer.Option("--plot", help="Write a figure (.png, .pdf, .svg).", callback=_figure_file)]


@dataclass(frozen=True)
class Source:
    """The recording that a command reads, and what its file does not state: options of `read_recording`."""

    file: Annotated[
        Path,
        typer.Argument(
            help="Recording: .npy, .npz, text, .parquet, .nc, .rda, a ROS bag, also packed; or the name of a data set."
        ),
    ]
    channels: Annotated[str, typer.Option(help="'all', or names separated by commas; a group such as 'gyro' too.")] = (
        "all"
    )
    rate: Rate = None
    units: Annotated[
        str | None,
        typer.Option(
            "--units", "--unit", help="Of the samples: 'deg/s', or by channel or group: 'gyro=deg/s,accel=g'."
        ),
    ] = None
    scale: Annotated[
        str | None,
        typer.Option(help="Size of a count: 'gyro=0.1 deg/s,accel=1.25 mg'; or the type of IMU of a NovAtel log."),
    ] = None
    time: Annotated[
        str | None, typer.Option(help="Column (name or number) of the time; two of date,time or week,seconds or s,ns.")
    ] = None
    time_unit: Annotated[
        str | None, typer.Option(help="Unit of that column: s, ms, us, ns, min or h, if its name does not say it.")
    ] = None
    clock: Annotated[
        str | None, typer.Option(help="Column of a second clock (GNSS time): the drift of the first is estimated.")
    ] = None
    gaps: Annotated[
        str, typer.Option(help="Where samples are missing: refuse, nan (in their places) or longest (the longest run).")
    ] = "refuse"
    format: Annotated[
        str | None,
        typer.Option(help="Of the logger, if its content does not tell it: kf-gins, rtklibexplorer, xsens ...; text."),
    ] = None
    columns: Annotated[
        str | None, typer.Option(help="Columns to read: names or numbers (from 0), separated by commas.")
    ] = None
    names: Annotated[str | None, typer.Option(help="New names of the channels: 'a,b,c', or 'old=new,old=new'.")] = None
    delimiter: Annotated[str | None, typer.Option(help="Of a text file, if it is not to be found.")] = None
    header: Annotated[
        int | None, typer.Option(min=0, help="Line of the names in a text file, from 1; 0: no line has them.")
    ] = None
    variable: Annotated[
        str | None, typer.Option(help="What to read of an .npz or R file of several objects; the topic of a bag.")
    ] = None
    max_bytes: Annotated[
        str | None, typer.Option(help="To which the file may unfold ('8GB'), if that is more than is usual.")
    ] = None

    def read(self) -> "gj.Recording":
        """Read it, and say on standard error what was understood."""
        file = self.file
        if str(file) in gj.datasets.names() and not file.exists():
            file = gj.datasets.fetch(str(file))
        options = dataclasses.asdict(self)
        del options["file"]
        for name in ("units", "scale", "names"):
            options[name] = _one_or_pairs(options[name])
        for name in ("columns", "time", "clock"):
            options[name] = None if options[name] is None else [_column(part) for part in options[name].split(",")]
        if isinstance(options["names"], str):
            options["names"] = [part.strip() for part in options["names"].split(",")]
        everything = self.channels == "all"
        options["channels"] = None if everything else [part.strip() for part in self.channels.split(",")]
        rec = gj.read_recording(file, **options, progress=_takes_long(file))
        typer.echo(rec.understood, err=True)
        return rec


_LARGE = 100_000_000
"""Bytes of a text file that is read for seconds, while which a bar is shown."""


def _takes_long(file: Path) -> bool:
    from gmwm_jax._internal.text_files import TEXT_SUFFIXES
    from gmwm_jax._internal.text_source import COMPRESSED

    return file.suffix.lower() in (*TEXT_SUFFIXES, *COMPRESSED) and file.is_file() and file.stat().st_size > _LARGE


def _one_or_pairs(text: str | None) -> str | dict[str, str] | None:
    return pairs(text) if text is not None and "=" in text else text


def key_of(seed: int) -> Any:
    """The key of random numbers that a seed stands for."""
    import jax

    return jax.random.key(seed)


def weights_of(name: str) -> str:
    """Weights as `fit` takes them."""
    from gmwm_jax.fitting.weights import NAMED

    if name not in NAMED:
        raise ValueError(f"--weights is {', '.join(NAMED)}, and not {name!r}.")
    return name


def _column(text: str) -> int | str:
    return int(text) if text.strip().isdigit() else text.strip()


def pairs(text: str) -> dict[str, str]:
    """The parts of ``name=value,name=value``."""
    found = {}
    for part in text.split(","):
        name, equals, value = part.partition("=")
        if not equals or not name.strip():
            raise ValueError(f"Cannot read {part.strip()!r}: expected name=value, several separated by commas.")
        found[name.strip()] = value.strip()
    return found


def exports(given: list[str] | None) -> list[tuple[str, Path]]:
    """Formats and files of ``--export format=file``."""
    if not given:
        return []
    from gmwm_jax.fitting.exports.registry import format_of

    found = []
    for text in given:
        name, equals, file = text.partition("=")
        format_of(name)
        if not equals or not file:
            raise ValueError(f"Cannot read --export {text}: expected --export {name}=FILE, or {name}=- for the screen.")
        found.append((name, Path(file)))
    return found


def say(json_file: Path | None, text: str) -> None:
    """Print a table, unless the screen is for JSON."""
    if json_file is None or str(json_file) != "-":
        typer.echo(text)


def write_json(path: Path | None, content: Any) -> None:
    """Write to a file, or to the screen for ``-``."""
    if path is None:
        return
    text = json.dumps(content, indent=1, default=lambda array: array.tolist(), allow_nan=False)
    if str(path) == "-":
        typer.echo(text)
    else:
        write_atomically(path, lambda file: file.write(text.encode()))


def write_figure(path: Path | None, draw: "Callable[[], Figure]") -> None:
    """Draw and write, if a file is named."""
    if path is None:
        return
    figure = draw()
    write_atomically(path, lambda file: figure.savefig(file, format=path.suffix.lower().lstrip("."), dpi=150))


def beside(path: Path | None, what: str) -> Path | None:
    """The name of one more figure: ``fit.png`` -> ``fit_what.png``."""
    return None if path is None else path.with_stem(f"{path.stem}_{what}")
