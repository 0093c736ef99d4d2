"""Figures of several models beside each other: mean errors, consistency, innovations, overview.

Bands of confidence move with the data; grey bands are where a consistent filter lies.
"""

import textwrap
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Bars, Frame, Item, Line, Mark, Points, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put, put_in_turns
from gmwm_jax._internal.palette import COLOURS, marked
from nav_jax.plotting._style import (
    DEGREES,
    TIME,
    bands_and_lines,
    draw,
    grid,
    logarithmic,
    outage_items,
    shade,
    without_outages,
)
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.ranking import Ranking, common_runs
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.energy import energy_score
from nav_jax.statistics.summaries import Curve, coverage, mean_curve, mean_nees, mean_norm

Models = Comparison | Runs | Mapping[str, Runs]
"""One model or several on common random numbers."""

_CONSISTENT = "0.82"
_BREAK = "\n"


def mean_errors_data(models: Models, *, log: bool = True, level: float = 0.95) -> tuple[Frame, Frame]:
    """Return what `plot_mean_errors` shows: position and orientation, a band and a line for each model.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    log
        Logarithmic errors; else linear ones.
    level
        Of the bands, pointwise.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.mean_errors_data(comparison)
    """
    by_name, chosen = _common(models)
    scale = "log" if log else "linear"
    position = {name: mean_norm(r.errors("position", chosen), level) for name, r in by_name.items()}
    attitude = {name: mean_norm(r.errors("attitude", chosen), level) for name, r in by_name.items()}
    return (
        _mean_frame("position error", Axis("mean position error", "m", scale), by_name, position),
        _mean_frame("orientation error", Axis("mean orientation error", "deg", scale), by_name, attitude, DEGREES),
    )


def plot_mean_errors(models: Models, *, log: bool = True, level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
    """Plot mean position and orientation error of each model with its confidence band.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    log
        Logarithmic errors, by which a filter with and without GNSS fits into one frame; else linear ones.
    level
        Of the bands, pointwise.
    axes
        Two Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_mean_errors(comparison)
    >>> figure.savefig("mean_errors.png")
    """
    shown = mean_errors_data(models, log=log, level=level)
    figure, drawn = frames(axes, 1, 2, (10.5, 4.8), sharex=True)
    for ax, frame in zip(drawn, shown, strict=True):
        draw_means(ax, frame)
    legend_below(figure, drawn, alone=axes is None, **_title(f"{len(_common(models)[1])} runs", level))
    return figure


def consistency_data(
    models: Models, *, groups: Sequence[str] = ("position", "pose", "navigation"), level: float = 0.95
) -> tuple[Frame, ...]:
    """Return what `plot_consistency` shows: NEES of each group of states, then coverage of each group.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    groups
        A model without states in a group is left out there.
    level
        Of the bands, and of the region whose coverage is counted.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.consistency_data(comparison)
    """
    by_name, chosen = _common(models)
    above, below = [], []
    for group in groups:
        shown = _with_states(by_name, group)
        dofs = sorted({r.dof[group] for r in shown.values()})
        nees: list[Item] = []
        covered: list[Item] = []
        inside: dict[str, dict[str, float]] = {"NEES": {}, "coverage": {}}
        for name, r in shown.items():
            known, dof = r.known_epochs(group), r.dof[group]
            squares, t = r.select(r.nees[group], chosen)[:, known], r.time[known]
            mean, share = mean_nees(squares, dof, level), coverage(squares, dof, level, level)
            if not nees:
                nees.append(Span("consistent", mean.low / dof, mean.high / dof, "y"))
                covered.append(Span("consistent", share.low, share.high, "y"))
            nees.append(Line(name, t, mean.value / dof))
            covered.append(Line(name, t, share.value))
            inside["NEES"][name], inside["coverage"][name] = mean.share_inside, share.share_inside
        outages = outage_items(_outages(by_name))
        title = f"{group}: {' or '.join(map(str, dofs)) or 'no'} states{_inside(inside['NEES'])}"
        region = Axis(f"coverage of the {100 * level:g} % region", "1")
        above.append(Frame(title, TIME, Axis("mean NEES / dof", "1"), (*nees, Mark("", 1.0, "y"), *outages)))
        within = _inside(inside["coverage"]).lstrip()
        below.append(Frame(within, TIME, region, (*covered, Mark("", level, "y"), *outages)))
    return (*above, *below)


def plot_consistency(
    models: Models,
    *,
    groups: Sequence[str] = ("position", "pose", "navigation"),
    level: float = 0.95,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot mean NEES over its expectation, and coverage, of groups of states, with the bands of a consistent filter.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    groups
        A column each. A model without states in a group is left out there.
    level
        Of the bands, and of the region whose coverage is counted.
    axes
        Two Axes a group to draw into, of shape (2, groups); a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_consistency(comparison)
    >>> figure.savefig("consistency.png")
    """
    by_name, chosen = _common(models)
    shown, num = consistency_data(models, groups=groups, level=level), len(groups)
    figure, drawn = frames(axes, 2, num, (1.5 + 4 * num, 6.4), sharex=True)
    order = list(by_name)
    for i, (ax, frame) in enumerate(zip(drawn, shown, strict=True)):
        draw_consistent(ax, frame, order, is_share=i >= num)
        if i < num and axes is None:
            ax.set_xlabel("")
    legend_below(
        figure, drawn, alone=axes is None, **_title(f"{len(chosen)} runs", level, "band of a consistent filter")
    )
    return figure


def draw_consistent(ax: Axes, frame: Frame, order: Sequence[str], *, is_share: bool) -> None:
    """Curves of the models in this order, and where those of a consistent filter lie."""
    for item in without_outages(frame):
        match item:
            case Span():
                put(ax, item, color=_CONSISTENT, zorder=1)
            case Mark():
                put(ax, item, color="0.4", lw=0.7)
            case Line():  # a share of 1 lies on the edge
                put_in_turns(ax, item, order.index(item.label), len(order), clip_on=not is_share)
    if is_share:
        ax.set_ylim(0, 1)
    else:
        _far_off(ax)
    _finish(ax, frame)


def nis_data(models: Models, *, sensors: Sequence[str] | None = None, level: float = 0.95) -> tuple[Frame, ...]:
    """Return what `plot_nis` shows: a frame for each aiding sensor.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    sensors
        All by default.
    level
        Of the band.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.nis_data(comparison)
    """
    by_name, chosen = _common(models)
    there = list(dict.fromkeys(s for r in by_name.values() for s in r.nis if len(r.nis_time[s])))
    names = there if sensors is None else list(sensors)
    if unknown := [s for s in names if s not in there]:
        raise ValueError(f"There are no innovations of {', '.join(unknown)}, only of {', '.join(there) or 'nothing'}.")
    if not names:
        raise ValueError("There are no innovations to draw: these runs have no fixes.")
    shown = []
    for sensor in names:
        items: list[Item] = []
        inside: dict[str, float] = {}
        for name, r in by_name.items():
            if sensor in r.nis:
                nis = mean_nees(r.select(r.nis[sensor], chosen), r.nis_dof[sensor], level)
                inside[name] = nis.share_inside
                items.append(Points(name, r.nis_time[sensor], nis.value / nis.dof))
                items.append(Span("", nis.low / nis.dof, nis.high / nis.dof, "y"))
        items += [Mark("", 1.0, "y"), *outage_items(_outages(by_name))]
        shown.append(Frame(f"{sensor}{_inside(inside)}", TIME, Axis("mean NIS / dof", "1"), tuple(items)))
    return tuple(shown)


def plot_nis(
    models: Models, *, sensors: Sequence[str] | None = None, level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """Plot mean NIS of each aiding sensor over its expectation, with the band of a consistent filter.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    sensors
        A row each; all by default.
    level
        Of the band.
    axes
        An Axes for each sensor to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_nis(comparison)
    >>> figure.savefig("nis.png")
    """
    by_name, chosen = _common(models)
    shown = nis_data(models, sensors=sensors, level=level)
    figure, drawn = frames(axes, len(shown), 1, (8.5, 1.0 + 2.6 * len(shown)), sharex=True)
    order = list(by_name)
    for ax, frame in zip(drawn, shown, strict=True):
        for item in without_outages(frame):
            match item:
                case Span():
                    put(ax, item, color=_CONSISTENT, zorder=0.5)
                case Mark():
                    put(ax, item, color="0.4", lw=0.7)
                case _:
                    put(ax, item, **marked(order.index(item.label)), ms=4)
        _far_off(ax)
        _finish(ax, frame)
        if ax is not drawn[-1] and axes is None:
            ax.set_xlabel("")
    legend_below(
        figure, drawn, alone=axes is None, **_title(f"{len(chosen)} runs", level, "band of a consistent filter")
    )
    return figure


def comparison_data(
    comparison: Comparison, *, at: float | None = None, level: float = 0.95, log: bool = True
) -> tuple[Frame, ...]:
    """Return what `plot_comparison` shows: mean errors, energy score, consistency of the pose, and paired differences.

    Parameters
    ----------
    comparison
        The models.
    at
        Time in s at which they are judged, see `Comparison.table`.
    level
        Of all bands and intervals.
    log
        Logarithmic errors; else linear ones.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.comparison_data(comparison)
    """
    table = comparison.table(at, level)
    by_name, chosen = _common(comparison)
    scores = {
        name: mean_curve(energy_score(r.errors("position", chosen), r.select(r.position_covariance, chosen)), level)
        for name, r in by_name.items()
    }
    title = "energy score of the position (lower is better)"
    nees, covered = consistency_data(comparison, groups=("pose",), level=level)
    over_time = (
        *mean_errors_data(comparison, log=log, level=level),
        _mean_frame(title, Axis("mean energy score", "m", "log" if log else "linear"), by_name, scores),
        nees._replace(title=f"NEES of position and attitude\n{nees.title.partition(_BREAK)[2]}"),
        covered._replace(title=f"coverage of position and attitude\n{covered.title}"),
    )
    judged = (frame._replace(items=(*frame.items, Mark("", table.time))) for frame in over_time)
    return (*judged, _pairs(table))


@draw.register(Comparison)
def plot_comparison(
    comparison: Comparison,
    *,
    at: float | None = None,
    level: float = 0.95,
    log: bool = True,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot all models at a glance: mean errors, energy score, consistency of the pose, and which differences are real.

    Parameters
    ----------
    comparison
        The models.
    at
        Time in s at which they are judged, see `Comparison.table`.
    level
        Of all bands and intervals.
    log
        Logarithmic errors, by which a filter with and without GNSS fits into one frame; else linear ones.
    axes
        Six Axes to draw into, as in two rows of three; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_comparison(comparison)
    >>> figure.savefig("comparison.png")
    """
    by_name, chosen = _common(comparison)
    shown = comparison_data(comparison, at=at, level=level, log=log)
    figure, drawn = frames(axes, 2, 3, (15, 8.6))
    position, orientation, score, nees, covered, pairs = drawn
    for ax, frame in zip((position, orientation, score), shown[:3], strict=True):
        draw_means(ax, frame._replace(items=frame.items[:-1]))
    plot_consistency(comparison, groups=("pose",), level=level, axes=(nees, covered))
    nees.get_legend().remove()  # type: ignore[union-attr]
    for ax, frame in zip(drawn[:5], shown[:5], strict=True):
        ax.set_title(frame.title, fontsize=10)
        put(ax, frame.items[-1], color="0.35", lw=0.9, ls=":")
    colours = dict(zip(by_name, cycle(COLOURS), strict=False))
    _draw_pairs(pairs, shown[5], comparison.table(at, level), colours)
    bands = "bands and bars: intervals of the means, grey: of a consistent filter"
    legend_below(figure, drawn[:5], alone=axes is None, **_title(f"{len(chosen)} runs", level, bands))
    if axes is None:
        figure.suptitle(f"{len(chosen)} common runs along {comparison.reference.name or 'a trajectory'}")
    return figure


def _pairs(table: Ranking) -> Frame:
    """Differences to the best model in the same runs, with their intervals and verdicts, in rows from the top."""
    best = table[0].model
    items: list[Item] = [Mark("", 0.0)]
    names = []
    for one in table:
        if one.paired is not None:
            ends = (one.paired.difference, len(names), one.paired.low, one.paired.high)
            items.append(Bars("", *(np.array([value]) for value in ends), lying=True))
            p = "p < 0.0001" if one.p < 1e-4 else f"p = {one.p:.2g}"
            names.append("\n".join([f"{one.model}, {p}", *textwrap.wrap(one.verdict, 24)]))
    x = Axis(f"position error minus that of {best}, {table[0].mean_position:.3g} m", "m")
    return Frame(f"difference in the same runs at {table.time:g} s", x, Axis("", "", names=tuple(names)), tuple(items))


def _draw_pairs(ax: Axes, frame: Frame, table: Ranking, colours: Mapping[str, str]) -> None:
    best, *bars = frame.items
    put(ax, best, color=colours[table[0].model], lw=1.6)
    others = [one.model for one in table if one.paired is not None]
    for item, model in zip(bars, others, strict=True):
        put(ax, item, fmt="o", color=colours[model], capsize=4, lw=1.6)
    ax.set_yticks(range(len(others)), frame.y.names, fontsize=8)
    ax.set_ylim(max(len(others), 1) - 0.5, -0.5)  # one model alone has no other
    describe(ax, frame, fontsize=10)
    ax.margins(x=0.15)
    grid(ax)


def _mean_frame(
    title: str, axis: Axis, by_name: Mapping[str, Runs], curves: Mapping[str, Curve], factor: float = 1.0
) -> Frame:
    """A band and a line for each model."""
    items: list[Item] = []
    for name, c in curves.items():
        t = by_name[name].time
        items += [Band("", t, factor * c.low, factor * c.high), Line(name, t, factor * c.value)]
    return Frame(title, TIME, axis, (*items, *outage_items(_outages(by_name))))


def draw_means(ax: Axes, frame: Frame) -> None:
    """Bands and lines of the models, of which none hides another."""
    items = bands_and_lines(ax, frame)
    if frame.y.scale == "log":
        means = np.concatenate([item.y[item.y > 0] for item in items if isinstance(item, Line)])
        if len(means):  # an interval may go down to zero
            ax.set_ylim(bottom=means.min() / 1.5)
        logarithmic(ax)
    else:
        ax.set_ylim(bottom=0)
    _finish(ax, frame)


def _with_states(by_name: Mapping[str, Runs], group: str) -> dict[str, Runs]:
    """The models that have states in a group."""
    return {name: r for name, r in by_name.items() if group in r.nees and r.known_epochs(group).any()}


def _outages(by_name: Mapping[str, Runs]) -> list[tuple[float, float]]:
    """Of all models, each once."""
    return sorted({i for r in by_name.values() for i in r.outage_intervals})


def _common(models: Models) -> tuple[dict[str, Runs], np.ndarray]:
    """Models with two good runs, and the runs in which none of them failed."""
    if isinstance(models, Runs):
        models = {models.name: models}
    every = models.runs if isinstance(models, Comparison) else models
    chosen = common_runs(every)
    if len(chosen) < 2:
        raise ValueError(f"A mean over runs takes 2 or more in which no model failed, and there are {len(chosen)}.")
    return {name: r for name, r in every.items() if r.num_good >= 2}, chosen


def _finish(ax: Axes, frame: Frame) -> None:
    shade(ax, frame)
    describe(ax, frame, fontsize=9)
    is_one_epoch = all(len(item.x) == 1 for item in frame.items if isinstance(item, Line))
    ax.margins(x=0.05 if is_one_epoch else 0)
    grid(ax)


def _far_off(ax: Axes) -> None:
    """A model that is far off would press the band flat."""
    if ax.get_ylim()[1] > 6:
        logarithmic(ax)


def _title(runs: str, level: float, what: str = "interval of the mean") -> dict[str, Any]:
    """What the bands are, above a legend."""
    return {"title": f"{runs}; {100 * level:g} % {what}", "title_fontsize": 8}


def _inside(shares: Mapping[str, float]) -> str:
    """How much of each curve lies where that of a consistent filter does: lines below a title."""
    text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
    return "".join(f"\n{line}" for line in textwrap.wrap(f"inside: {text}", 52)) if shares else ""
