"""The command line: ``nav-jax run | compare | demo``. A leaf: a configuration in, tables and files out."""

import functools
import re
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from nav_jax._files import write_atomically
from nav_jax.comparison import Comparison
from nav_jax.config import Config, read_config
from nav_jax.demo import run_demo
from nav_jax.report import as_json, write_report

app = typer.Typer(
    help="What the noise model of an inertial sensor does to navigation (Monte Carlo of INS/GNSS filters).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

INTERRUPTED = 130
"""Exit code of a run that was stopped from the keyboard; what was done by then is written."""


def _command(function: Callable[..., None]) -> Callable[..., None]:
    """Make a function a command that turns errors of input into one message and exit code 1, warnings into a line."""

    @functools.wraps(function)
    def run(*args: Any, **options: Any) -> None:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_: typer.echo(f"Warning: {_as_keys(str(message))}", err=True)
            try:
                function(*args, **options)
            except (ValueError, KeyError, OSError, ImportError) as error:
                text = error.args[0] if isinstance(error, KeyError) else error
                typer.echo(f"Error: {_as_keys(str(text))}", err=True)
                raise typer.Exit(1) from error
            except KeyboardInterrupt as interrupt:
                typer.echo(str(interrupt) or "Interrupted: the results are not complete.", err=True)
                raise typer.Exit(INTERRUPTED) from interrupt

    return app.command()(run)


def _as_keys(text: str) -> str:
    """Python that a message advises, as the configuration has it."""
    text = re.sub(r"use at_rate\(([^)]*)\)", r"write rate = \1 in that section", text)
    return re.sub(r"as in trajectory\.smoothed\(([^)]*)\)", r"by smooth = \1 in [trajectory]", text)


def _result_file(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in (".zarr", ".nc"):
        raise typer.BadParameter(f"results are saved as .zarr or .nc, not {str(path)!r}")
    return path


File = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="Trajectory, truth, filters, aiding, run.")]
NumRuns = Annotated[int | None, typer.Option(min=1, help="Number of runs of each filter, in place of the file's.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Of the random numbers, in place of the file's.")]
Out = Annotated[Path | None, typer.Option(help="Folder for tables and figures, in place of the file's.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the table as JSON; '-' for the screen.")]
Plot = Annotated[bool | None, typer.Option("--plot/--no-plot", help="Draw figures into the folder.")]
Save = Annotated[Path | None, typer.Option(help="Save all runs: .zarr or .nc.", callback=_result_file)]


@_command
def run(
    config: File,
    filter_name: Annotated[str | None, typer.Option("--filter", help="Which filter, if there are several.")] = None,
    num_runs: NumRuns = None,
    seed: Seed = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Save = None,
) -> None:
    """Run one filter many times: its errors beside what it says of them."""
    known = read_config(config)
    if filter_name is None and len(known.filters) > 1:
        raise ValueError(f"There are several filters ({', '.join(known.filters)}): choose by --filter, or use compare.")
    name = next(iter(known.filters)) if filter_name is None else filter_name
    if name not in known.filters:
        raise ValueError(f"There is no filter {name!r}; there are {', '.join(known.filters)}.")
    targets = _targets(known, config.parent, out, json_file, plot, save)
    result = known.compare(num_runs=num_runs, seed=seed, only=[name], progress=sys.stderr.isatty())
    _finish(result, repr(result[name]) + (f"\n\n{result.table()}" if result.num_common >= 2 else ""), targets)


@_command
def compare(
    config: File,
    num_runs: NumRuns = None,
    seed: Seed = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Save = None,
) -> None:
    """Run several filters on the same noise: a ranked table that says which differences are more than chance."""
    known = read_config(config)
    if len(known.filters) < 2:
        raise ValueError(f"A comparison takes two filters or more, and {config} has {len(known.filters)}: use run.")
    targets = _targets(known, config.parent, out, json_file, plot, save)
    result = known.compare(num_runs=num_runs, seed=seed, progress=sys.stderr.isatty())
    _finish(result, repr(result), targets)


@_command
def demo(
    fits: Annotated[Path, typer.Option(help="Folder in which 'gmwm-jax demo' has left its fits.")] = Path("out"),
    out: Annotated[Path, typer.Option(help="Folder for configuration, tables and figures.")] = Path("out"),
    num_runs: Annotated[int, typer.Option(min=2, help="Number of runs of each filter.")] = 200,
) -> None:
    """Compare filters that believe three fits of the simulated MTi-G recording, through a GNSS outage of 40 s."""
    _tell_of_runs(run_demo(fits, out, num_runs, typer.echo, progress=sys.stderr.isatty()))


class _Targets(NamedTuple):
    """Where results go; None for what is not asked for."""

    folder: Path | None
    plot: bool
    save: Path | None
    json_file: Path | None


def _targets(
    config: Config, beside: Path, out: Path | None, json_file: Path | None, plot: bool | None, save: Path | None
) -> _Targets:
    """What the configuration asks for, unless the options say something else."""
    asked = config.output
    folder = beside / asked.folder if out is None and asked.folder is not None else out
    target = beside / asked.save if save is None and asked.save is not None else save
    if plot and folder is None:
        raise ValueError("Figures need a folder: give --out, or folder in [output].")
    return _Targets(folder, asked.plot if plot is None else plot, target, json_file)


def _finish(result: Comparison, text: str, targets: _Targets) -> None:
    """Print and write what is asked for."""
    json_file, folder = targets.json_file, targets.folder
    to_screen = str(json_file) == "-"
    typer.echo(as_json(result) if to_screen else text)
    if json_file is not None and not to_screen:
        write_atomically(json_file, lambda file: file.write(as_json(result).encode()))
    if folder is not None:
        written = write_report(result, folder, plot=targets.plot)
        typer.echo(f"\nIn {folder}/: {', '.join(written)}", err=to_screen)
    if targets.save is not None:
        typer.echo(f"Saved as {result.save(targets.save)}", err=to_screen)
    _tell_of_runs(result)


def _tell_of_runs(result: Comparison) -> None:
    """Warn of runs that failed; end with a code of its own if there are fewer than asked for."""
    for name, r in result.runs.items():
        if r.num_failed:
            typer.echo(f"Warning: {name}: {r.counts()}", err=True)
    if any(r.interrupted for r in result.runs.values()):
        r = next(iter(result.runs.values()))
        typer.echo(f"Interrupted: {len(r)} of {r.num_requested} runs were done and are in the results.", err=True)
        raise typer.Exit(INTERRUPTED)
