"""The command line: ``gmwm-jax wv | fit | select | units | data | app | demo``; a leaf: arguments in, results out."""

import importlib.util
from pathlib import Path
from typing import Annotated, Any

import typer

import gmwm_jax as gj
from gmwm_jax._internal.entry import tell_version
from gmwm_jax._internal.limits import size_in_bytes
from gmwm_jax.app.options import (
    Efficiency,
    Export,
    Json,
    Level,
    Plot,
    Rate,
    Robust,
    Seed,
    Source,
    beside,
    command,
    exports,
    key_of,
    pairs,
    say,
    weights_of,
    write_figure,
    write_json,
)

app = typer.Typer(
    help="Noise models of inertial sensors from static recordings (wavelet variance, GMWM).",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
data_app = typer.Typer(help="Named data sets: public recordings, and simulated ones.", no_args_is_help=True)
app.add_typer(data_app, name="data")
tell_version(app, "gmwm-jax", gj.__version__)


@command(app)
def wv(
    source: Source,
    level: Level = 0.95,
    method: Annotated[str, typer.Option(help="modwt or dwt.")] = "modwt",
    levels: Annotated[int | None, typer.Option(help="Number of scales; floor(log2 N) - 1 by default.")] = None,
    allan: Annotated[bool, typer.Option("--allan", help="Allan deviation, with N, B and K read off.")] = False,
    modified: Annotated[bool, typer.Option("--modified-allan", help="Modified Allan deviation.")] = False,
    hadamard: Annotated[bool, typer.Option("--hadamard", help="Hadamard deviation, which a drift is not in.")] = False,
    robust: Robust = False,
    efficiency: Efficiency = 0.6,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Wavelet variance (or Allan, modified Allan, Hadamard deviation) with confidence intervals."""
    asked = [name for name, given in zip(_DEVIATIONS, (allan, modified, hadamard), strict=True) if given]
    if len(asked) > 1:
        raise ValueError(f"{' and '.join(asked)} are two results: ask for one of them at a time.")
    if modified or hadamard:
        others = {"--levels": levels is not None, "--robust": robust, "--method": method != "modwt"}
        _of_phase(source, asked[0], level, others, json_file, plot)
        return
    rec = source.read()
    result = gj.wavelet_variance(
        rec, method=method, num_levels=levels, level=level, efficiency=efficiency if robust else None
    )
    for text in result.warnings:
        typer.echo(f"Warning: {text}", err=True)
    content: dict[str, Any] = {"rate": rec.rate, "num_samples": len(rec), "level": level}
    if result.warnings:
        content["warnings"] = list(result.warnings)
    if allan:
        adev = gj.allan_deviation(result)
        tables = {
            name: [gj.fitting.read_off(adev[i], datasheet=d) for d in (False, True)]
            for i, name in enumerate(result.channels)
        }
        say(json_file, "\n\n".join([repr(adev), *(f"{name}: {shown}" for name, (_, shown) in tables.items())]))
        write_figure(plot, lambda: adev.plot())
        content["times"] = adev.times
        content["channels"] = {
            name: {
                "unit": one.wv.units[0],
                "deviation": one.deviation,
                "ci_low": one.ci_low,
                "ci_high": one.ci_high,
                **_nominal(one.shown),
                "read_off": tables[name][0].to_list(),
                "read_off_datasheet": tables[name][1].to_list(),
            }
            for name, one in ((name, adev[name]) for name in result.channels)
        }
    else:
        say(json_file, repr(result))
        write_figure(plot, lambda: result.plot())
        content["scales"] = result.scales
        content["channels"] = {
            name: {
                "unit": one.units[0],
                "variance": one.variance,
                "ci_low": one.ci_low,
                "ci_high": one.ci_high,
                **_nominal(one.shown),
            }
            for name, one in result.items()
        }
    write_json(json_file, content)


_DEVIATIONS = ("--allan", "--modified-allan", "--hadamard")


def _of_phase(
    source: Source, name: str, level: float, others: dict[str, bool], json_file: Path | None, plot: Path | None
) -> None:
    """The modified Allan or the Hadamard deviation: from the samples, and not from the wavelet variance."""
    given = [option for option, is_given in others.items() if is_given]
    if given:
        raise ValueError(f"{name} is not made of the wavelet variance, and takes no {' or '.join(given)}.")
    rec = source.read()
    of = gj.variance.modified_allan_deviation if name == "--modified-allan" else gj.variance.hadamard_deviation
    result = of(rec, level=level)
    say(json_file, repr(result))
    write_figure(plot, lambda: result.plot())
    channels = {
        one.channels[0]: {"unit": one.units[0], "deviation": one.deviation, **_nominal(one.shown)}
        for one in (result[i] for i in range(len(result.channels)))
    }
    content = {"rate": rec.rate, "num_samples": len(rec), "level": level, "deviation": result.kind}
    write_json(json_file, {**content, "times": result.times, "channels": channels})


def _nominal(shown: Any) -> dict[str, Any]:
    """Intervals at their nominal level for JSON, where they are known."""
    known = {"nominal_low": shown.low, "nominal_high": shown.high, "dof": shown.dof, "dof_of": shown.basis}
    return known if shown.nominal else {}


@command(app)
def fit(
    source: Source,
    model: Annotated[str, typer.Option(help='For example "WN + RW + 2*GM" or "WN + GM(beta=0.01 fixed)".')],
    level: Level = 0.95,
    datasheet: Annotated[
        str | None, typer.Option(help="Datasheet entries to draw: 'N=0.15 deg/sqrt(h), K=2 deg/h/sqrt(h)'.")
    ] = None,
    weights: Annotated[
        str, typer.Option(help="default, two-step (less bias), covariance (smallest errors) or iterated.")
    ] = "default",
    robust: Robust = False,
    efficiency: Efficiency = 0.6,
    bootstrap: Annotated[int, typer.Option(help="Replicates for intervals and a test of fit, 500 say.")] = 0,
    seed: Seed = 0,
    export: Export = None,
    step: Annotated[
        float | None, typer.Option(help="Of the filter that --export is for, s: what is white at it is white noise.")
    ] = None,
    interval: Annotated[
        float | None, typer.Option(help="Averaging time at which --export matches a random walk to the bias, s.")
    ] = None,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Fit a noise model to each channel: parameters with intervals, for a filter and as a datasheet has them."""
    rec = source.read()
    lines = None
    if datasheet is not None:
        promised, signal = gj.from_datasheet(pairs(datasheet), rec.rate)
        lines = {signal: promised}
    wv = gj.wavelet_variance(rec, efficiency=efficiency if robust else None)
    fits = gj.fit(wv, model, weights=weights_of(weights), level=level, throw=False)
    singles = [fits] if isinstance(fits, gj.Fit) else list(fits.values())
    boots = [gj.bootstrap(one, bootstrap, key=key_of(seed), progress=True) for one in singles] if bootstrap else []
    tables = [repr(one) for one in singles] + ([] if isinstance(fits, gj.Fit) else [repr(fits)])
    say(json_file, "\n\n".join(tables + [repr(boot) for boot in boots]))
    for name, file in exports(export):
        to_screen = str(file) == "-"
        text = fits.export(name, path=None if to_screen else file, step=step, interval=interval)
        if to_screen:
            typer.echo(text)
    write_figure(plot, lambda: fits.plot(datasheet=lines))
    for boot in boots:
        write_figure(beside(plot, f"bootstrap_{boot.fit.wv.channels[0]}"), boot.plot)
    content = [one.to_dict() for one in singles]
    for one, boot in zip(content, boots, strict=bool(boots)):
        one["bootstrap"] = boot.to_dict()
    write_json(json_file, content)
    for one in singles:
        if one.status is not gj.fitting.Status.converged:
            typer.echo(f"Warning: {one.wv.channels[0]}: {one.status.value}", err=True)
        for text in one.warnings:
            typer.echo(f"Warning: {one.wv.channels[0]}: {text}", err=True)


@command(app)
def select(
    source: Source,
    model: Annotated[
        list[str],
        typer.Option(
            help='All sub-models of "WN + QN + RW + DR + 3*GM"; given several times, only these are compared.'
        ),
    ],
    level: Level = 0.95,
    weights: Annotated[
        str, typer.Option(help="Of the superset, for all models: covariance, default, two-step or iterated.")
    ] = "covariance",
    robust: Robust = False,
    efficiency: Efficiency = 0.6,
    bootstrap: Annotated[int, typer.Option(help="Replicates for the optimism, in place of theory.")] = 0,
    seed: Seed = 0,
    json_file: Json = None,
    plot: Plot = None,
) -> None:
    """Rank models by what they would say of other data, and recommend the simplest that none is better than."""
    rec = source.read()
    found = gj.select(
        gj.wavelet_variance(rec, efficiency=efficiency if robust else None),
        model[0] if len(model) == 1 else model,
        nested=len(model) == 1,
        weights=weights_of(weights),
        num_replicates=bootstrap,
        key=key_of(seed),
        level=level,
        progress=True,
    )
    singles = [found] if isinstance(found, gj.inference.Selection) else list(found.values())
    say(
        json_file,
        "\n\n".join(
            [repr(one) for one in singles] + ([] if isinstance(found, gj.inference.Selection) else [repr(found)])
        ),
    )
    write_figure(plot, found.plot)
    write_json(json_file, [one.to_dict() for one in singles])


@command(app)
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
        converted = gj.units.convert(value, source, target)
        say(json_file, f"{value:g} {source} = {converted:.10g} {target}")
        write_json(json_file, {"value": converted, "unit": target})
    elif model is not None or datasheet is not None:
        if rate is None:
            raise ValueError("The sampling rate is missing: give --rate in Hz. It is never guessed.")
        if signal not in gj.units.SI_SIGNALS:
            raise ValueError("--signal is rad/s, m/s^2 or 1; parameters are SI")
        if datasheet is not None:
            composite, signal = gj.from_datasheet(pairs(datasheet), rate)
        else:
            composite = gj.parse_model(model or "")
        tables = [gj.fitting.continuous_table(composite, rate, signal, datasheet=d) for d in (False, True)]
        filters = gj.fitting.white_and_bias(composite, rate, signal)
        say(json_file, f"{composite}  (per sample at {rate:g} Hz)\n\n{tables[0]}\n\n{tables[1]}\n\n{filters}")
        lists = {
            "continuous": tables[0].to_list(),
            "datasheet": tables[1].to_list(),
            "white_and_bias": filters.to_dict(),
        }
        write_json(json_file, {"model": repr(composite), "rate": rate, **lists})
    else:
        raise ValueError("Give a number with two units, or --model, or --datasheet. See gmwm-jax units --help.")


@command(data_app, "list")
def data_list(json_file: Json = None) -> None:
    """List the public recordings and the sensors that can be simulated."""
    recordings = [gj.datasets.info(name)._asdict() for name in gj.datasets.names()]
    sensors = {name: {c: repr(m) for c, m in gj.datasets.sensor_models(name).items()} for name in gj.datasets.sensors()}
    lines = [f"{known['name']:20s} {known['description']}" for known in recordings]
    say(json_file, "\n".join([*lines, *(f"{name:20s} simulated: {', '.join(m)}" for name, m in sensors.items())]))
    write_json(json_file, {"recordings": recordings, "simulated": sensors})


@command(data_app, "fetch")
def data_fetch(name: str) -> None:
    """Fetch a public recording (once) and print where it is."""
    typer.echo(gj.datasets.fetch(name))


@command(data_app, "simulate")
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
    rec = gj.datasets.simulated(sensor, samples, key=key_of(seed))
    typer.echo(f"{rec}\n{gj.save_recording(rec, out)}")
    write_figure(plot, rec.plot)


@command(app, "app")
def serve_page(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Of the page; 0: any that is free.")] = 8000,
    host: Annotated[
        str, typer.Option(help="Name or address at which it listens. There is no login: name another with care.")
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Do not open the page.")] = False,
    max_upload: Annotated[str, typer.Option(help="The largest file that is taken.")] = "100MB",
    workers: Annotated[int, typer.Option(min=1, max=64, help="Computations at a time.")] = 2,
    root_path: Annotated[str, typer.Option(help="Path under which a proxy shows the page.")] = "",
    name: Annotated[
        list[str] | None,
        typer.Option(help="Name by which a proxy shows the page, as lab.example.org; may be repeated."),
    ] = None,
    data_dir: Annotated[
        Path | None, typer.Option(help="Folder of recordings that every page may open, by name.")
    ] = None,
    room: Annotated[str, typer.Option(hidden=True, help="In which the page opens; of other packages' commands.")] = "",
    no_cache: Annotated[
        bool, typer.Option("--no-cache", help="Do not keep compiled models in your folder of caches.")
    ] = False,
) -> None:
    """Open recordings, variances and models as a page in the browser, served by this machine."""
    for need in ("shiny", "plotly"):
        if importlib.util.find_spec(need) is None:
            raise ImportError(f'The page needs the package {need}: pip install "gmwm-jax[web]".')
    try:
        upload = size_in_bytes(max_upload)
    except ValueError:
        raise ValueError(
            f'--max-upload is a number of bytes, or a text such as "200MB", and is {max_upload!r}.'
        ) from None
    from gmwm_jax.app.web.limits import Limits
    from gmwm_jax.app.web.server import serve

    if data_dir is not None and not data_dir.is_dir():
        raise ValueError(f"--data-dir is a folder, and there is none at {data_dir}.")
    limits = Limits(folder=data_dir) if upload is None else Limits(upload=upload, folder=data_dir)
    serve(
        host, port, typer.echo, browser=not no_browser, cache=not no_cache, limits=limits, num_threads=workers,
        root_path=root_path, names=name or (), room=room,
    )  # fmt: skip


@command(app)
def demo(
    folder: Annotated[Path, typer.Option("--out", help="Folder for figures and tables.")] = Path("out"),
    samples: Annotated[int, typer.Option(help="Length of the simulated recording.")] = 1_000_000,
) -> None:
    """Simulate a static MTi-G recording, fit it, compare with the truth; figures and tables."""
    from gmwm_jax.app.demo import run_demo

    run_demo(folder, samples, typer.echo)
