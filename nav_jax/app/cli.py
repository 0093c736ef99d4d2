"""The command line ``nav-jax``: simulations, recorded drives, and the page.

``run | compare | campaign | budget | design | demo`` simulate, ``inspect | align | navigate | outages | tune |
vibration`` are of recorded drives, and ``app`` is the page. A leaf: a configuration in, tables and files out.
"""

import contextlib
import functools
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

import nav_jax as nj
from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.entry import as_command, command_line, tell_version
from gmwm_jax._internal.interrupts import INTERRUPTED
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.outputs import check_outputs, make_folder, refuse_overwriting, require_place

if TYPE_CHECKING:
    from nav_jax.app.comparison_file import Config
    from nav_jax.app.reports import Report
    from nav_jax.app.sections import FolderSection
    from nav_jax.simulation.comparison import Comparison
    from nav_jax.simulation.levels import TwoLevel

TRACKS, MAPS = (".csv", ".npz"), (".kml", ".gpx")
"""Suffixes of files of a track, and of those that need to know where on Earth."""

SAVED = (".npz", ".json", ".nc", ".zarr")
"""Of files that `nav_jax.load` reads."""

app = typer.Typer(
    help="What the noise model of an inertial sensor does to navigation (INS/GNSS filters, simulated and analysed).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
tell_version(app, "nav-jax", nj.__version__)


def _command(function: Callable[..., None]) -> Callable[..., None]:
    """Make a function a command: outputs that cannot be written are refused first, errors become one message."""

    @functools.wraps(function)
    def run(context: Any, **options: Any) -> None:
        with command_line(_as_keys, context.obj):
            _check_outputs(function.__name__, options)
            function(**options)

    return app.command()(as_command(run, signature(function).parameters.values()))


_STEMS = {
    "run": "comparison",
    "compare": "comparison",
    "campaign": "comparison",
    "budget": "budget",
    "design": "design",
    "tune": "tuning",
    "vibration": "vibration",
    "navigate": "navigation",
    "outages": "outages",
    "inspect": "inspection",
    "align": "alignment",
}
"""Command -> stem of the files of its report."""


_FILES = ("save", "export")
"""Options, and keys of [output], that name a file."""


def _check_outputs(command: str, options: Mapping[str, Any]) -> None:
    """Refuse a command that would write over its configuration or a file that this names, or where nobody can."""
    given = (options.get(name) for name in ("json_file", *_FILES))
    files = [path for path in given if path and str(path) != "-"]
    folders = [options["out"]] if options.get("out") else []
    config, inputs = options.get("config"), []
    if config is not None:
        from nav_jax.app.comparison_file import named_files

        inputs, asked = named_files(config)
        inputs.append(config)
        folder = options["out"] or (config.parent / asked["folder"] if asked.get("folder") else None)
        written = [folder / f"{_STEMS[command]}.{suffix}" for suffix in ("txt", "json", "toml")] if folder else []
        for name in _FILES:
            if options.get(name) is None and name in options and asked.get(name):
                written.append(config.parent / asked[name])
        refuse_overwriting([*files, *written], inputs)
    check_outputs(files, inputs, folders)


def _as_keys(text: str) -> str:
    """Python that a message advises, as the configuration has it."""
    text = re.sub(r"use at_rate\(([^)]*)\)", r"write rate = \1 in that section", text)
    return re.sub(r"as in trajectory\.smoothed\(([^)]*)\)", r"by smooth = \1 in [trajectory]", text)


def _store_folder(path: Path) -> Path:
    if path.suffix.lower() != ".zarr":
        raise typer.BadParameter(f"a campaign is kept in a folder *.zarr, not {str(path)!r}")
    return path


def _result_file(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in (".zarr", ".nc"):
        raise typer.BadParameter(f"results are saved as .zarr or .nc, not {str(path)!r}")
    return path


File = Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="Trajectory, truth, filters, aiding, run.")]
Filter = Annotated[str | None, typer.Option("--filter", help="Which filter, if there are several.")]
NumRuns = Annotated[int | None, typer.Option(min=1, help="Number of runs of each filter, in place of the file's.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Of the random numbers, in place of the file's.")]
Stop = Annotated[str | None, typer.Option(help="Stop early: significant or anytime, in place of the file's.")]
Out = Annotated[Path | None, typer.Option(help="Folder for tables and figures, in place of the file's.")]
Json = Annotated[Path | None, typer.Option("--json", help="Write the table as JSON; '-' for the screen.")]
Plot = Annotated[bool | None, typer.Option("--plot/--no-plot", help="Draw figures into the folder.")]
Save = Annotated[Path | None, typer.Option(help="Save all runs: .zarr or .nc.", callback=_result_file)]


@_command
def run(
    config: File,
    filter_name: Filter = None,
    num_runs: NumRuns = None,
    seed: Seed = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Save = None,
) -> None:
    """Run one filter many times: its errors beside what it says of them."""
    from nav_jax.app.comparison_file import read_config

    known = read_config(config)
    if filter_name is None and len(known.filters) > 1:
        raise ValueError(f"There are several filters ({', '.join(known.filters)}): choose by --filter, or use compare.")
    name = _chosen(known.filters, filter_name)
    targets = _targets(known, config.parent, out, json_file, plot, save)
    if known.run.has_two_levels:
        _finish_levels(known.two_level(num_runs=num_runs, seed=seed, only=[name], progress=True), targets)
        return
    result = known.compare(num_runs=num_runs, seed=seed, only=[name], progress=True)
    _finish(result, repr(result[name]) + (f"\n\n{result.table()}" if result.num_common >= 2 else ""), targets)


@_command
def compare(
    config: File,
    num_runs: NumRuns = None,
    seed: Seed = None,
    stop: Stop = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Save = None,
) -> None:
    """Run several filters on the same noise: a ranked table that says which differences are more than chance."""
    from nav_jax.app.comparison_file import read_config

    known = read_config(config)
    if len(known.filters) < 2:
        raise ValueError(f"A comparison takes two filters or more, and {config} has {len(known.filters)}: use run.")
    targets = _targets(known, config.parent, out, json_file, plot, save)
    if known.run.has_two_levels:
        _finish_levels(known.two_level(num_runs=num_runs, seed=seed, stop=stop, progress=True), targets)
        return
    result = known.compare(num_runs=num_runs, seed=seed, stop=stop, progress=True)
    _finish(result, repr(result), targets)


Store = Annotated[
    Path, typer.Option(help="Folder *.zarr of the campaign, new or to be continued.", callback=_store_folder)
]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes; threads of this one unless stated.")]
Scheduler = Annotated[str | None, typer.Option(help="Of a Dask cluster in place of processes: tcp://...")]


@_command
def campaign(
    config: File,
    store: Store,
    workers: Workers = None,
    scheduler: Scheduler = None,
    keep: Annotated[str, typer.Option(help="Of the runs: judged, statistics or runs.")] = "statistics",
    cost: Annotated[bool, typer.Option("--cost", help="Say what it will take, and leave it at that.")] = False,
    num_runs: NumRuns = None,
    seed: Seed = None,
    stop: Stop = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Run the filters into a store that survives a crash: the same command again computes what is missing."""
    from nav_jax.app.comparison_file import read_config
    from nav_jax.app.reports import comparison_report

    if workers is not None and scheduler is not None:
        raise ValueError("Either --workers or --scheduler: the scheduler has its own workers.")
    known = read_config(config)
    folder, plot = _folder(known.output, config.parent, out, plot)
    wanted = known.run.num_runs if num_runs is None else num_runs
    study, rule = known.campaign(num_runs=wanted, seed=seed, keep=keep), known.run.rule if stop is None else stop
    if study.num_runs > wanted:
        typer.echo(f"{study.num_runs} runs in place of {wanted}: whole chunks of {study.chunk_size}.", err=True)
    if cost:
        typer.echo(f"{study!r}\n{study.cost()!r}")
        return
    with _executor(workers, scheduler) as executor:
        status = study.run(store, executor=executor, stop=rule, progress=True)
    if status.complete or status.num_missing < status.num_chunks:
        result = study.comparison(stop=rule)
        statistics = None if keep == "judged" else study.statistics()
        _give(comparison_report(result, statistics), json_file, folder, plot=plot, text=repr(result))
    if not status.complete:
        typer.echo(repr(status), err=True)
        raise typer.Exit(1 if status.failed else INTERRUPTED)


@contextlib.contextmanager
def _executor(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Who computes the chunks of a campaign."""
    if scheduler is None:
        yield None if workers is None else nj.campaign.processes(workers)
        return
    with import_optional("distributed", "cluster").Client(scheduler) as client:
        yield client


@_command
def budget(
    config: File,
    filter_name: Filter = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Without random numbers: true and claimed errors of all filters; of one, what makes them and what matters."""
    from nav_jax.app.comparison_file import read_config
    from nav_jax.app.reports import budget_report

    known = read_config(config)
    name = _chosen(known.filters, filter_name)
    folder, plot = _folder(known.output, config.parent, out, plot)
    truth, scenario = _model(known), known.scenario
    _say(f"Covariances of {', '.join(known.filters)} ...")
    analysis = nj.analyse(scenario, truth, known.filters)
    _say(f"Error budget and derivatives of {name} ...")
    parts = nj.error_budget(scenario, truth, known.filters[name])
    derivatives = nj.sensitivities(scenario, truth, known.filters[name])
    _give(budget_report(analysis, name, parts, derivatives), json_file, folder, plot=plot)


@_command
def design(
    config: File,
    max_accel: Annotated[int, typer.Option(min=0, help="Most Gauss-Markov processes on an accelerometer axis.")] = 2,
    max_gyro: Annotated[int, typer.Option(min=0, help="Most Gauss-Markov processes on a gyro axis.")] = 2,
    max_states: Annotated[int | None, typer.Option(min=0, help="Most sensor states in all.")] = None,
    objective: Annotated[str, typer.Option(help="What is minimised: score or error.")] = "score",
    max_steps: Annotated[int, typer.Option(min=1, help="Of each search.")] = 60,
    confirm: Annotated[int | None, typer.Option(min=2, help="Runs of a Monte Carlo of the best filter.")] = None,
    seed: Seed = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Find the filters with few states that navigate best along the trajectory of the file."""
    from nav_jax.app.comparison_file import read_config
    from nav_jax.app.reports import design_report
    from nav_jax.simulation.campaign import require_runs

    known = read_config(config)
    folder, plot = _folder(known.output, config.parent, out, plot)
    truth = _model(known)
    if confirm is not None:
        require_runs(known.scenario, truth.rate, 3, confirm)
    found = nj.design(
        known.scenario,
        truth,
        max_accel=max_accel,
        max_gyro=max_gyro,
        max_states=max_states,
        objective=objective,
        max_steps=max_steps,
        progress=True,
    )
    best = found.best()
    filters = {"designed": best.errors, "truncated": best.naive, "right": truth}
    filters = {name: f for name, f in filters.items() if f is not None}
    confirmed = None
    if confirm is not None:
        gains = (
            "estimate" if known.run.has_two_levels else known.run.gains
        )  # of runs that are shown beside the analysis
        again = replace(known, filters=filters, run=known.run.model_copy(update={"gains": gains}))
        confirmed = again.compare(num_runs=confirm, seed=seed, progress=True)
    _give(design_report(found, best, confirmed), json_file, folder, plot=plot)
    if confirmed is not None:
        _tell_of_runs(confirmed)
    if not found.complete:
        raise KeyboardInterrupt("Interrupted: the larger structures are missing.")


Record = Annotated[Path, typer.Argument(metavar="RECORD.toml", help="Record, filters, aiding with files, start.")]
Solution = Annotated[Path | None, typer.Option("--save", help="All, for nav_jax.load: .npz, .json, .nc or .zarr.")]
Track = Annotated[Path | None, typer.Option("--export", help="The track for others: .csv, .npz, .kml or .gpx.")]


@_command
def inspect(
    config: Record,
    most_offset: Annotated[float, typer.Option(min=0.1, help="Offsets of clocks beyond this, s, are not tried.")] = 2.0,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Say what is in a record: rates, gaps, rest, gravity, tilt, course, and clocks that are apart."""
    from nav_jax.app.record_file import inspect_file
    from nav_jax.app.reports import inspection_report

    if plot and out is None:
        raise ValueError("Figures need a folder: give --out.")
    report = inspection_report(inspect_file(config, most_offset))
    _give(report, json_file, out, plot=out is not None if plot is None else plot)


@_command
def align(config: Record, out: Out = None, json_file: Json = None) -> None:
    """Find roll, pitch and heading, at rest or on the move as section align says, with standard deviations."""
    from nav_jax.app.alignment_file import align_file
    from nav_jax.app.reports import alignment_report

    _give(alignment_report(*align_file(config)), json_file, out, plot=False)


Gate = Annotated[
    float | None,
    typer.Option(min=0.5, max=0.999999999, help="Probability with which a good fix passes, in place of the file's."),
]
Vibration = Annotated[
    float | None, typer.Option(min=0.0, help="Factor of the noise of vibration, of all axes, in place of the file's.")
]


@_command
def navigate(
    config: Record,
    filter_name: Filter = None,
    gate: Gate = None,
    vibration: Vibration = None,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Solution = None,
    export: Track = None,
) -> None:
    """Navigate by recorded sensors: the track, innovations, errors in simulated outages and against a reference."""
    from nav_jax.app.record_file import read_record
    from nav_jax.app.reports import navigation_report

    known = read_record(config).noticing(gate, vibration)
    name = _chosen(known.filters, filter_name)
    folder, plot = _folder(known.output, config.parent, out, plot)
    save = _save(known.output.save, config.parent, save)
    track = _save(known.output.export, config.parent, export)
    if save is not None:
        _require_loadable(save, "solutions", ": export is for tracks")
    if track is not None and track.suffix.lower() not in TRACKS + MAPS:
        raise typer.BadParameter(f"tracks are exported as {', '.join(TRACKS + MAPS)}, not {str(track)!r}")
    is_map = track is not None and track.suffix.lower() in MAPS
    if is_map and known.origin is None:
        raise ValueError(f"Nobody knows where the record lies: state origin in [record] to export {track}.")
    _say(f"Navigation by {name} ...")
    solution = known.navigate(name)
    to_screen = _give(navigation_report(name, solution, known.notes), json_file, folder, plot=plot)
    if save is not None:
        typer.echo(f"Saved as {solution.save(save)}", err=to_screen)
    if track is not None:
        written = solution.export(track, origin=known.origin, start=known.utc)
        typer.echo(f"Exported as {written}", err=to_screen)


@_command
def outages(
    config: Record,
    filter_name: Filter = None,
    gate: Gate = None,
    vibration: Vibration = None,
    last: Annotated[float, typer.Option(min=0.0, help="s, of each outage.")] = 15.0,
    every: Annotated[float, typer.Option(min=0.0, help="s from the beginning of one to that of the next.")] = 60.0,
    runs: Annotated[int, typer.Option(min=1, help="So many, their outages shifted against each other.")] = 2,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
    save: Solution = None,
) -> None:
    """Simulate outages of the receivers all over a record, and judge the filter at the end of each."""
    from nav_jax.app.record_file import read_record
    from nav_jax.app.reports import outages_report
    from nav_jax.recorded.outages import shifted_schedules

    known = read_record(config).noticing(gate, vibration)
    name = _chosen(known.filters, filter_name)
    folder, plot = _folder(known.output, config.parent, out, plot)
    if save is not None:  # [output] save is of a solution
        _require_loadable(save, "studies")
    schedules = shifted_schedules(known.imu, known.aiding, last=last, every=every, runs=runs)
    _say(f"Outages by {name} ...")
    study = known.outages(name, schedules, progress=True)
    to_screen = _give(outages_report(name, study, known.notes), json_file, folder, plot=plot)
    if save is not None:
        typer.echo(f"Saved as {study.save(save)}", err=to_screen)


@_command
def tune(
    config: Record,
    filter_name: Filter = None,
    tune_aiding: Annotated[bool, typer.Option("--tune-aiding", help="Seek the noise of the aiding too.")] = False,
    hold: Annotated[list[str] | None, typer.Option(help="A parameter that is not sought; may be repeated.")] = None,
    prior: Annotated[float | None, typer.Option(help="Standard deviation of the logarithms about the start.")] = None,
    max_steps: Annotated[int, typer.Option(min=1, help="Of the search.")] = 50,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Find the noise parameters under which the innovations of recorded navigation data are most likely."""
    from nav_jax.app.record_file import read_record
    from nav_jax.app.reports import tuning_report

    known = read_record(config)
    name = _chosen(known.filters, filter_name)
    folder, plot = _folder(known.output, config.parent, out, plot)
    _say(f"Search from {name} ...")
    asked = {"tune_aiding": tune_aiding, "hold": hold or (), "prior": prior, "max_steps": max_steps}
    found = known.tune(name, **asked, progress=True)
    _give(tuning_report(found), json_file, folder, plot=plot)


@_command
def vibration(
    config: Record,
    filter_name: Filter = None,
    window: Annotated[float, typer.Option(min=0.0, help="s, over which variances of the samples are taken.")] = 0.25,
    out: Out = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Test whether the noise at rest holds in motion, axis by axis, and find what vibration adds to it."""
    from nav_jax.app.record_file import read_record
    from nav_jax.app.reports import vibration_report

    known = read_record(config)
    name = _chosen(known.filters, filter_name)
    folder, plot = _folder(known.output, config.parent, out, plot)
    _say(f"Factors of vibration beside {name} ...")
    found = known.noise_in_motion(name, window=window, progress=True)
    _give(vibration_report(name, found), json_file, folder, plot=plot)


@_command
def demo(
    fits: Annotated[Path, typer.Option(help="Folder in which 'gmwm-jax demo' has left its fits.")] = Path("out"),
    out: Annotated[Path, typer.Option(help="Folder for configuration, tables and figures.")] = Path("out"),
    num_runs: Annotated[int, typer.Option(min=2, help="Number of runs of each filter.")] = 200,
) -> None:
    """Compare filters that believe three fits of the simulated MTi-G recording, through a GNSS outage of 40 s."""
    from nav_jax.app.demo import run_demo

    _tell_of_runs(run_demo(fits, out, num_runs, typer.echo, progress=True))


@app.command(
    "app",
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    help="Open the page in the browser at its room Navigation; options are those of gmwm-jax app.",
)
def page(context: typer.Context) -> None:
    """Open the page of gmwm_jax, of which this package has a room."""
    from nav_jax.app.web.command import open_page

    open_page(context.args, context.obj)


class _Targets(NamedTuple):
    """Where results go; None for what is not asked for."""

    folder: Path | None
    plot: bool
    save: Path | None
    json_file: Path | None


def _targets(
    config: "Config", beside: Path, out: Path | None, json_file: Path | None, plot: bool | None, save: Path | None
) -> _Targets:
    """What the configuration asks for, unless the options say something else."""
    asked = config.output
    return _Targets(*_folder(asked, beside, out, plot), _save(asked.save, beside, save), json_file)


def _folder(asked: "FolderSection", beside: Path, out: Path | None, plot: bool | None) -> tuple[Path | None, bool]:
    """The folder, and whether figures go there."""
    folder = out
    if out is None and asked.folder is not None:
        make_folder(folder := beside / asked.folder, beside)
    if plot and folder is None:
        raise ValueError("Figures need a folder: give --out, or folder in [output].")
    return folder, asked.plot if plot is None else plot


def _save(asked: str | None, beside: Path, save: Path | None) -> Path | None:
    """Where results are saved, looked at before there are any."""
    if save is None and asked is not None:
        make_folder((save := beside / asked).parent, beside)
    if save is not None:
        require_place(save)
    return save


def _require_loadable(save: Path, what: str, of_tracks: str = "") -> None:
    """Raise unless `nav_jax.load` reads such a file."""
    if save.suffix.lower() not in SAVED:
        hint = of_tracks if save.suffix.lower() in TRACKS + MAPS else ""
        raise typer.BadParameter(f"{what} are saved as {', '.join(SAVED)}, not {str(save)!r}{hint}")


def _chosen(filters: Mapping[str, Any], name: str | None) -> str:
    """The filter that is asked for, or the first."""
    if name is not None and name not in filters:
        raise ValueError(f"There is no filter {name!r}; there are {', '.join(filters)}.")
    return next(iter(filters)) if name is None else name


def _model(config: Any) -> Any:
    """The truth, where covariances can be made of it."""
    if not isinstance(config.truth, nj.ImuErrors):
        raise ValueError("[truth] is a recording, and covariances follow from a model: state one.")
    return config.truth


def _say(text: str) -> None:
    """What is being done, for somebody who waits."""
    if sys.stderr.isatty():
        typer.echo(text, err=True)


def _give(
    report: "Report", json_file: Path | None, folder: Path | None, *, plot: bool, text: str | None = None
) -> bool:
    """Print and write a report, or print another text than its own; returns whether JSON took the screen."""
    to_screen = str(json_file) == "-"
    typer.echo(report.json if to_screen else text or report.text)
    if json_file is not None and not to_screen:
        write_atomically(json_file, lambda file: file.write(report.json.encode()))
    if folder is not None:
        typer.echo(f"\nIn {folder}/: {', '.join(report.write(folder, plot=plot))}", err=to_screen)
    return to_screen


def _finish(result: "Comparison", text: str, targets: _Targets) -> None:
    """Print and write what is asked for."""
    from nav_jax.app.reports import comparison_report

    _write(result, comparison_report(result), text, targets)
    _tell_of_runs(result)


def _finish_levels(result: "TwoLevel", targets: _Targets) -> None:
    from nav_jax.app.reports import two_level_report

    _write(result, two_level_report(result), repr(result), targets)
    _tell_of_runs(result.shared)
    _tell_of_runs(result.own)


def _write(result: "Comparison | TwoLevel", report: "Report", text: str, targets: _Targets) -> None:
    to_screen = _give(report, targets.json_file, targets.folder, plot=targets.plot, text=text)
    if targets.save is not None:
        typer.echo(f"Saved as {result.save(targets.save)}", err=to_screen)


def _tell_of_runs(result: "Comparison") -> None:
    """Warn of runs that failed; end with a code of its own if there are fewer than asked for."""
    for name, r in result.runs.items():
        if r.num_failed:
            typer.echo(f"Warning: {name}: {r.counts()}", err=True)
    if any(r.interrupted for r in result.runs.values()):
        r = next(iter(result.runs.values()))
        typer.echo(f"Interrupted: {len(r)} of {r.num_requested} runs were done and are in the results.", err=True)
        raise typer.Exit(INTERRUPTED)
