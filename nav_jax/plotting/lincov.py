"""Figures of covariance analyses and of what is derived from them."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Histogram, Item, Line, Mark, Points
from gmwm_jax._internal.figures import describe, entries_of, frames, legend_below, put, shared_legend
from gmwm_jax._internal.palette import COLOURS, nested
from nav_jax.filter.layout import QUANTITIES
from nav_jax.lincov.analysis import Analysis, Covariances
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.calibration import CalibrationEffect
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Candidate, Design, judged
from nav_jax.plotting._style import (
    DEGREES,
    INK,
    TIME,
    along_time,
    draw,
    grid,
    logarithmic,
    outage_items,
    positive,
    signed_logarithm,
    time_below,
    without_outages,
)

_OTHERS = "0.8"
_FAR = 10.0
"""Derivatives that grow by more than that need a logarithmic axis."""
_TRUE = 0.75
"""So much of what is below a true error shows through it."""

_STYLES = {"truth": ("-", "-."), "filter": ("--", ":")}
"""Dashes of a parameter; the second where all colours have been used once."""


def analysis_data(filters: Mapping[str, Covariances], *, group: str = "pose", level: float = 0.95) -> tuple[Frame, ...]:
    """Return what `plot_analysis` shows: errors of position and orientation, each true and claimed, NEES and coverage.

    Parameters
    ----------
    filters
        Name -> covariances.
    group
        Of states whose NEES and coverage are drawn, see `nav_jax.filter.layout.GROUPS`.
    level
        Of the region whose coverage is drawn.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> frames = nj.plotting.analysis_data(nj.analyse(scenario, truth))
    """
    outages = outage_items(next(iter(filters.values())).outage_intervals)
    shown = []
    for what, block, unit, factor in (("position", "position", "m", 1.0), ("orientation", "attitude", "deg", DEGREES)):
        items: list[Item] = []
        for name, c in filters.items():
            # a start that is known exactly has no place on a logarithmic axis
            items.append(Line(name, c.time, positive(factor * c.rms(block))))
            items.append(Line("", c.time, positive(factor * c.rms_claimed(block))))
        axis = Axis(f"RMS {what} error", unit, "log")
        shown.append(Frame(f"{what}: true and claimed", TIME, axis, (*items, *outages)))
    nees = [Line(name, c.time, c.nees(group) / max(c.dof(group), 1)) for name, c in filters.items()]
    covered = [Line(name, c.time, c.coverage(group, level)) for name, c in filters.items()]
    axis = Axis("expected NEES / dof", "1", "log")
    ratio = Frame(f"consistency of the {group}", TIME, axis, (*nees, Mark("consistent", 1.0, "y"), *outages))
    axis = Axis(f"coverage of the {100 * level:g} % region", "1")
    return (*shown, ratio, Frame(f"coverage of the {group}", TIME, axis, (*covered, Mark("", level, "y"), *outages)))


@draw.register(Covariances)
def _plot_one_filter(
    c: Covariances, *, group: str = "pose", level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    return plot_analysis({c.name: c}, group=group, level=level, axes=axes)


@draw.register(Analysis)
def plot_analysis(
    filters: Mapping[str, Covariances], *, group: str = "pose", level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """Plot true against claimed errors of filters, and how consistent that makes them.

    Parameters
    ----------
    filters
        Name -> covariances.
    group
        Of states whose NEES and coverage are drawn, see `nav_jax.filter.layout.GROUPS`.
    level
        Of the region whose coverage is drawn.
    axes
        Four Axes to draw into, as in two rows of two; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> figure = nj.plotting.plot_analysis(nj.analyse(scenario, truth))
    >>> figure.savefig("analysis.png")
    """
    shown = analysis_data(filters, group=group, level=level)
    figure, drawn = frames(axes, 2, 2, (11.5, 7.4), sharex=True)
    for ax, frame in zip(drawn[:2], shown[:2], strict=True):
        items = without_outages(frame)
        for i, (true, claimed) in enumerate(zip(items[::2], items[1::2], strict=True)):
            put(ax, true, **nested(i, len(filters)), alpha=_TRUE)
            dashes = (8 * i / len(filters), (4, 4))  # where claims coincide each has its part of the way
            put(ax, claimed, color=COLOURS[i % len(COLOURS)], lw=1.3, ls=dashes)
    for ax, frame in zip(drawn[2:], shown[2:], strict=True):
        *curves, right = without_outages(frame)
        for i, item in enumerate(curves):
            put(ax, item, **nested(i, len(curves)), alpha=_TRUE, clip_on=frame.y.scale == "log")
        put(ax, right, color=INK, lw=0.9, ls=":")
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame)
        if frame.y.scale == "log":
            logarithmic(ax)
        along_time(ax, frame)
    drawn[3].set_ylim(0, 1)
    styles = {label: Line2D([], [], color=INK, ls=ls) for ls, label in (("-", "true"), ("--", "claimed"))}
    entries = entries_of(drawn[2]) | styles
    legend_below(figure, drawn, alone=axes is None, entries=entries)
    return figure


def sensitivities_data(
    s: Sensitivities, *, quantities: Sequence[str] = ("position", "tilt", "heading"), num: int = 8
) -> tuple[Frame, ...]:
    """Return what `plot_sensitivities` shows: a frame for each quantity, a line for each parameter.

    Parameters
    ----------
    s
        The derivatives.
    quantities
        Of `nav_jax.filter.layout.QUANTITIES`.
    num
        So many parameters: those with the largest relative effect on one of the quantities at the judged epoch.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> frames = nj.plotting.sensitivities_data(nj.sensitivities(scenario, truth))
    """
    chosen, shown = _most_effective(s, quantities, num), []
    for q in quantities:
        _, unit, factor = QUANTITIES[q]
        lines = [Line(f"{s.names[p]} ({s.sides[p]})", s.time, factor * s.derivative[q][:, p]) for p in chosen]
        items = (*lines, Mark("", 0.0, "y"), *outage_items(s.outage_intervals))
        most = np.max(np.abs([line.y for line in lines]), axis=0, initial=0.0)
        # else what is before an outage would be flat
        scale = "symlog" if most.max() > _FAR * _usual(most) > 0 else "linear"
        shown.append(Frame(q, TIME, Axis("d RMS / d log", unit, scale), items))
    return tuple(shown)


@draw.register(Sensitivities)
def plot_sensitivities(
    s: Sensitivities,
    *,
    quantities: Sequence[str] = ("position", "tilt", "heading"),
    num: int = 8,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot derivatives of RMS errors by the logarithms of the parameters that matter most, over time.

    Parameters
    ----------
    s
        The derivatives.
    quantities
        A row each, of `nav_jax.filter.layout.QUANTITIES`.
    num
        So many parameters: those with the largest relative effect on one of the quantities at the judged epoch.
    axes
        An Axes for each quantity to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> figure = nj.plotting.plot_sensitivities(nj.sensitivities(scenario, truth))
    >>> figure.savefig("sensitivities.png")
    """
    chosen = _most_effective(s, quantities, num)
    order = list(dict.fromkeys(s.names[p] for p in chosen))
    shown = sensitivities_data(s, quantities=quantities, num=num)
    figure, drawn = frames(axes, len(shown), 1, (10.5, 1.2 + 2.5 * len(shown)), sharex=True)
    for ax, frame in zip(drawn, shown, strict=True):
        *lines, zero = without_outages(frame)
        for item, p in zip(lines, chosen, strict=True):
            again, colour = divmod(order.index(s.names[p]), len(COLOURS))
            put(ax, item, color=COLOURS[colour], ls=_STYLES[s.sides[p]][again % 2], lw=1.4)
        put(ax, zero, color=INK, lw=0.7)
        describe(ax, frame)
        if frame.y.scale == "symlog":
            signed_logarithm(ax, _usual(np.max(np.abs([line.y for line in lines if isinstance(line, Line)]), axis=0)))
        along_time(ax, frame)
    beside: dict[str, Any] = {"loc": "outside right center", "title": "parameter of", "title_fontsize": 8}
    shared_legend(figure, drawn, entries_of(drawn[0]), alone=axes is None, fontsize=8, **beside)
    if axes is None:
        figure.suptitle("change of the true RMS error by a relative change of a noise parameter", fontsize=11)
        figure.align_ylabels()
    return figure


def _most_effective(s: Sensitivities, quantities: Sequence[str], num: int) -> list[int]:
    """Numbers of the parameters with the largest relative effect on one of the quantities."""
    k = s.epoch()
    effect = np.max([np.abs(np.nan_to_num(s.elasticity(q)[k])) for q in quantities], axis=0)
    return [int(p) for p in np.argsort(-effect)[:num] if effect[p] > 0]


def _usual(most: np.ndarray) -> float:
    """Of derivatives, what they are outside of outages."""
    return float(np.nanquantile(most, 0.25))


def budget_data(
    b: Budget, *, quantities: Sequence[str] = ("horizontal", "vertical", "tilt", "heading"), num: int = 7
) -> tuple[Frame, ...]:
    """Return what `plot_budget` shows: the shares of the sources in each quantity, then all RMS errors.

    Parameters
    ----------
    b
        The budget.
    quantities
        Of `nav_jax.filter.layout.QUANTITIES`.
    num
        At most so many sources by name, those with the largest mean shares; the others are one.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> frames = nj.plotting.budget_data(nj.error_budget(scenario, truth))
    """
    shares = {q: np.nan_to_num(b.share(q)) for q in quantities}
    weight = np.sum([x.mean(axis=1) for x in shares.values()], axis=0)
    chosen, rest = np.split(np.argsort(-weight), [num])
    labels = [b.sources[i] for i in chosen] + ["others"] * bool(len(rest))
    edges = [Mark("", t) for t in sorted({t for interval in b.outage_intervals for t in interval})]
    above, below = [], []
    for q in quantities:
        _, unit, factor = QUANTITIES[q]
        parts = [*shares[q][chosen], *([shares[q][rest].sum(axis=0)] if len(rest) else [])]
        ends = np.cumsum([np.zeros(len(b.time)), *(100 * part for part in parts)], axis=0)
        bands = [Band(label, b.time, *pair) for label, *pair in zip(labels, ends[:-1], ends[1:], strict=True)]
        above.append(Frame(q, TIME, Axis("share of the mean square", "%"), (*bands, *edges)))
        rms = positive(factor * np.sqrt(b.mean_square(q).sum(axis=0)))
        below.append(Frame("", TIME, Axis("RMS error", unit, "log"), (Line("", b.time, rms),)))
    return (*above, *below)


@draw.register(Budget)
def plot_budget(
    b: Budget,
    *,
    quantities: Sequence[str] = ("horizontal", "vertical", "tilt", "heading"),
    num: int = 7,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot shares of the sources in the mean square errors over time, and the RMS errors themselves.

    Parameters
    ----------
    b
        The budget.
    quantities
        A frame each, of `nav_jax.filter.layout.QUANTITIES`.
    num
        At most so many sources have a colour of their own, those with the largest mean shares; the others are one.
    axes
        An Axes for each quantity to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> figure = nj.plotting.plot_budget(nj.error_budget(scenario, truth))
    >>> figure.savefig("budget.png")
    """
    shown, count = budget_data(b, quantities=quantities, num=num), len(quantities)
    rows = -(-count // 2)
    figure, drawn = frames(axes, rows, min(2, count), (12.0, 1.0 + 3.2 * rows), num=count, sharex=True)
    for ax, shares, errors in zip(drawn, shown[:count], shown[count:], strict=True):
        describe(ax, shares)
        colours = cycle(COLOURS)
        for item in shares.items:
            if isinstance(item, Band):
                put(ax, item, color=_OTHERS if item.label == "others" else next(colours), alpha=0.85)
                ax.plot(item.x, item.high, color="white", lw=0.8)  # an edge is seen where colours are not
            else:
                put(ax, item, color="black", lw=0.9, ls=":")
        ax.set_ylim(0, 100)
        twin = ax.twinx()
        put(twin, errors.items[0], color="black", lw=1.8)
        twin.set_ylabel(f"{errors.y.label} [{errors.y.unit}]")
        twin.margins(x=0)
        logarithmic(twin)
        time_below(ax)
    entries = entries_of(drawn[0]) | {"RMS error (right axis)": Line2D([], [], color="black", lw=1.8)}
    if b.outage_intervals:
        entries["ends of outages"] = Line2D([], [], color="black", lw=0.9, ls=":")
    shared_legend(figure, drawn, entries, alone=axes is None, loc="outside right center", fontsize=8)
    return figure


def calibration_data(
    c: CalibrationEffect, *, quantities: Sequence[str] = ("position", "heading"), level: float = 0.95
) -> tuple[Frame, ...]:
    """Return what `plot_calibration` shows: a frame for each quantity of errors, then of losses, then of draws.

    Parameters
    ----------
    c
        The effect.
    quantities
        Of `nav_jax.filter.layout.QUANTITIES`.
    level
        Of the bands.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> models = {"m/s^2": "WN(sigma2=1e-4)", "rad/s": "WN(sigma2=1e-8)"}  # of accelerometer and gyro
    >>> draws = {unit: gj.simulate(model, 2000, key=jax.random.key(0)) for unit, model in models.items()}
    >>> records = [gj.Recording.from_array(np.asarray(x), rate=20.0, units=unit) for unit, x in draws.items()]
    >>> accel, gyro = (gj.fit(gj.wavelet_variance(rec), "WN") for rec in records)
    >>> effect = nj.calibration_effect(scenario, accel, gyro, key=jax.random.key(1), num_draws=20)
    >>> frames = nj.plotting.calibration_data(effect)
    """
    k, outages = c.epoch(), outage_items(c.outage_intervals)
    rows: tuple[list[Frame], ...] = ([], [], [])
    for q in quantities:
        _, unit, factor = QUANTITIES[q]
        low, high = (positive(factor * x) for x in c.interval(q, level))
        errors = Band(f"{100 * level:g} % of the draws", c.time, low, high)
        errors = (errors, Line("estimate", c.time, positive(factor * c.rms[q])), *outages)
        rows[0].append(Frame(f"{q}: RMS error of the filter", TIME, Axis("RMS error", unit, "log"), errors))
        loss = (Line("mean over the draws", c.time, 100 * c.loss(q)), *outages)
        rows[1].append(Frame(f"{q}: loss against a filter that knows the truth", TIME, Axis("loss", "%"), loss))
        draws = factor * c.used[q][:, k]
        edges = np.histogram_bin_edges(draws, "auto")
        items = (
            Histogram("draws", edges, np.histogram(draws, edges)[0]),
            Mark("estimate", float(factor * c.rms[q][k])),
            Mark(f"{100 * level:g} % interval", float(low[k])),
            Mark("", float(high[k])),
        )
        error = Axis(f"RMS error at {c.time[k]:g} s", unit)
        rows[2].append(Frame(q, error, Axis("number of draws", "1"), items))
    return tuple(frame for row in rows for frame in row)


@draw.register(CalibrationEffect)
def plot_calibration(
    c: CalibrationEffect,
    *,
    quantities: Sequence[str] = ("position", "heading"),
    level: float = 0.95,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot what a calibration leaves open of the RMS errors, and what it costs to have filtered with its estimate.

    Parameters
    ----------
    c
        The effect.
    quantities
        Two of `nav_jax.filter.layout.QUANTITIES`, a column each.
    level
        Of the bands.
    axes
        Three Axes a quantity to draw into, of shape (3, quantities); a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> models = {"m/s^2": "WN(sigma2=1e-4)", "rad/s": "WN(sigma2=1e-8)"}  # of accelerometer and gyro
    >>> draws = {unit: gj.simulate(model, 2000, key=jax.random.key(0)) for unit, model in models.items()}
    >>> records = [gj.Recording.from_array(np.asarray(x), rate=20.0, units=unit) for unit, x in draws.items()]
    >>> accel, gyro = (gj.fit(gj.wavelet_variance(rec), "WN") for rec in records)
    >>> effect = nj.calibration_effect(scenario, accel, gyro, key=jax.random.key(1), num_draws=20)
    >>> figure = nj.plotting.plot_calibration(effect)
    >>> figure.savefig("calibration.png")
    """
    shown, num = calibration_data(c, quantities=quantities, level=level), len(quantities)
    figure, drawn = frames(axes, 3, num, (1.5 + 5 * num, 9.4))
    colour = COLOURS[0]
    for i in range(num):
        over_time, loss, draws = drawn[i::num]
        for ax, frame in zip((over_time, loss, draws), shown[i::num], strict=True):
            describe(ax, frame)
        band, estimate = without_outages(shown[i])
        put(over_time, band, color=colour, alpha=0.25)
        put(over_time, estimate, color=colour, lw=1.5)
        logarithmic(over_time)
        put(loss, without_outages(shown[num + i])[0], color=colour, lw=1.5, ls="--")
        loss.set_ylim(bottom=0)
        for ax, frame in ((over_time, shown[i]), (loss, shown[num + i])):
            along_time(ax, frame)
        histogram, mark, *ends = shown[2 * num + i].items
        put(draws, histogram, color=colour, alpha=0.5)
        put(draws, mark, color=colour, lw=1.5)
        for end in ends:
            put(draws, end, color=INK, lw=1.0, ls="--")
        draws.yaxis.set_major_locator(MaxNLocator(integer=True))
        grid(draws)
    legend_below(figure, drawn, alone=axes is None)
    return figure


def design_data(d: Design) -> tuple[Frame, Frame, Frame]:
    """Return what `plot_design` shows over the number of states: position error, consistency, loss and its front.

    Parameters
    ----------
    d
        The design; the names of its filters are those in `plot_design`.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.design(scenario, truth, max_accel=1, max_gyro=0, max_steps=2)
    >>> frames = nj.plotting.design_data(found)
    """
    designed = np.array([(*judged(c.covariances), c.loss) for c in d.candidates])
    naive = np.array([(*judged(c.covariances_naive), c.loss_naive) for c in d.candidates])
    right, at = judged(d.right), _side_by_side(d.candidates)
    true_states = np.array([len(d.truth.states)])
    names = tuple(f"{c.num_accel}+{c.num_gyro}{'' if c.converged else '?'}" for c in d.candidates)
    front = {id(c) for c in d.pareto}
    on_front = [i for i, c in enumerate(d.candidates) if id(c) in front]
    shown = []
    for column, title, axis in (
        (0, "position error at the judged epoch", Axis("true RMS position error", "m", "log")),
        (2, "consistency of position, velocity, attitude", Axis("expected NEES / 9", "1", "log")),
        (3, "what was minimised (lower is better)", Axis(f"loss: {d.objective}", "1")),
    ):
        items: list[Item] = [
            Points("truncated: a part of the truth", at, naive[:, column]),
            Points("designed", at, designed[:, column], names),
        ]
        if axis.scale == "log":
            items.append(Points("right: believes the truth", true_states, np.array([right[column]])))
            items.append(Mark("", float(right[column]), "y"))
        else:
            items.append(Line("Pareto front", at[on_front], designed[on_front, column]))
        shown.append(Frame(title, Axis("sensor states of the filter", "1"), axis, tuple(items)))
    return shown[0], shown[1], shown[2]


@draw.register(Design)
def plot_design(d: Design, *, axes: GivenAxes | None = None) -> Figure:
    """Plot the number of states against position error, consistency, and the loss with its Pareto front.

    Parameters
    ----------
    d
        The design; the numbers at a filter are its Gauss-Markov processes on an axis, accelerometer + gyro, and a
        question mark that its search did not converge.
    axes
        Three Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.design(scenario, truth, max_accel=1, max_gyro=0, max_steps=2)
    >>> figure = nj.plotting.plot_design(found)
    >>> figure.savefig("design.png")
    """
    shown = design_data(d)
    figure, drawn = frames(axes, 1, 3, (14.0, 5.3))
    for ax, frame in zip(drawn, shown, strict=True):
        _draw_candidates(ax, frame)
        describe(ax, frame)
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        grid(ax)
    legend_below(figure, drawn, alone=axes is None)
    return figure


def _draw_candidates(ax: Axes, frame: Frame) -> None:
    naive, designed, best, *level = frame.items
    assert isinstance(naive, Points)
    assert isinstance(designed, Points)
    ax.vlines(naive.x, designed.y, naive.y, color="0.75", lw=1.0, zorder=1)
    put(ax, naive, color=COLOURS[1], marker="v", ls="", mfc="none")
    put(ax, designed, color=COLOURS[0], marker="o", ls="")
    place: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "top", "rotation": 90}
    for name, x, y in zip(designed.names, designed.x, designed.y, strict=True):
        ax.annotate(name, (x, y), (0, -7), fontsize=8, **place)
    if level:
        put(ax, best, color=COLOURS[2], marker="*", ls="", ms=13)
        put(ax, level[0], color=COLOURS[2], lw=0.9, ls=":")
        ax.margins(x=0.1, y=0.18)
        logarithmic(ax)
    else:
        put(ax, best, color=COLOURS[0], lw=1.2, drawstyle="steps-post")
        # filters that are far off would press all others flat
        low, spread = designed.y.min(), max(np.ptp(designed.y), 1e-3)
        ax.set(xmargin=0.1, ylim=(low - 0.25 * spread, low + 1.7 * spread))


def _side_by_side(candidates: Sequence[Candidate]) -> np.ndarray:
    """Numbers of states, of which equal ones are moved apart a little."""
    states = np.array([c.num_states for c in candidates])
    apart = 0.06 * max(np.ptp(states), 1)
    at = states.astype(float)
    for n in set(states):
        same = np.flatnonzero(states == n)
        at[same] += apart * (np.arange(len(same)) - (len(same) - 1) / 2)
    return at
