"""Figures of covariance analyses and of what is derived from them."""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from gmwm_jax._internal.figures import GivenAxes, entries_of, frames, shared_legend
from nav_jax.filter.layout import QUANTITIES
from nav_jax.lincov.analysis import Analysis, Covariances
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.calibration import CalibrationEffect
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Candidate, Design, judged
from nav_jax.plotting._style import COLOURS, DEGREES, INK, along_time, draw, grid, logarithmic, positive, time_below

_OTHERS = "0.8"
_STYLES = {"truth": "-", "filter": "--"}


@draw.register(Covariances)
def _plot_one_filter(c: Covariances, **options: Any) -> Figure:
    return plot_analysis({c.name: c}, **options)


@draw.register(Analysis)
def plot_analysis(
    filters: Mapping[str, Covariances], *, group: str = "pose", level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """True against claimed errors of filters, and how consistent that makes them.

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
    """
    figure, drawn = frames(axes, 2, 2, (11.5, 7.4), sharex=True)
    position, attitude, nees, coverage = drawn
    for colour, (name, c) in zip(cycle(COLOURS), filters.items(), strict=False):
        for ax, block, factor in ((position, "position", 1.0), (attitude, "attitude", DEGREES)):
            # a start that is known exactly has no place on a logarithmic axis
            ax.plot(c.time, positive(factor * c.rms(block)), color=colour, lw=1.4, label=name)
            ax.plot(c.time, positive(factor * c.rms_claimed(block)), color=colour, lw=1.2, ls="--")
        nees.plot(c.time, c.nees(group) / max(c.dof(group), 1), color=colour, lw=1.4, label=name)
        coverage.plot(c.time, c.coverage(group, level), color=colour, lw=1.4, label=name)
    nees.axhline(1.0, color=INK, lw=0.9, ls=":", label="consistent")
    coverage.axhline(level, color=INK, lw=0.9, ls=":")
    position.set(ylabel="RMS position error [m]", title="position: true and claimed")
    attitude.set(ylabel="RMS orientation error [deg]", title="orientation: true and claimed")
    nees.set(ylabel="expected NEES / dof [1]", title=f"consistency of the {group}")
    coverage.set(ylabel=f"coverage of the {100 * level:g} % region [1]", title=f"coverage of the {group}")
    for ax in (position, attitude, nees):
        logarithmic(ax)
    coverage.set_ylim(-0.02, 1.02)
    for ax in (position, attitude, nees, coverage):
        along_time(ax, next(iter(filters.values())).outage_intervals)
    styles = {label: Line2D([], [], color=INK, ls=ls) for ls, label in (("-", "true"), ("--", "claimed"))}
    entries = entries_of(nees) | styles
    shared_legend(figure, drawn, entries, alone=axes is None, loc="outside lower center", ncols=min(len(entries), 4))
    return figure


@draw.register(Sensitivities)
def plot_sensitivities(
    s: Sensitivities,
    *,
    quantities: Sequence[str] = ("position", "tilt", "heading"),
    num: int = 8,
    axes: GivenAxes | None = None,
) -> Figure:
    """Derivatives of RMS errors by the logarithms of the parameters that matter most, over time.

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
    """
    k = s.epoch()
    effect = np.max([np.abs(np.nan_to_num(s.elasticity(q)[k])) for q in quantities], axis=0)
    chosen = [p for p in np.argsort(-effect)[:num] if effect[p] > 0]
    colours = dict(zip(dict.fromkeys(s.names[p] for p in chosen), cycle(COLOURS), strict=False))
    figure, drawn = frames(axes, len(quantities), 1, (10.5, 1.2 + 2.5 * len(quantities)), sharex=True)
    for ax, q in zip(drawn, quantities, strict=True):
        _, unit, factor = QUANTITIES[q]
        for p in chosen:
            name, side = s.names[p], s.sides[p]
            label = f"{name} ({side})"
            values = factor * s.derivative[q][:, p]
            ax.plot(s.time, values, color=colours[name], ls=_STYLES[side], lw=1.4, label=label)
        ax.axhline(0.0, color=INK, lw=0.7)
        ax.set(ylabel=f"d RMS / d log [{unit}]", title=q)
        along_time(ax, s.outage_intervals)
    beside: dict[str, Any] = {"loc": "outside right center", "title": "parameter of", "title_fontsize": 8}
    shared_legend(figure, drawn, entries_of(drawn[0]), alone=axes is None, fontsize=8, **beside)
    if axes is None:
        figure.suptitle("change of the true RMS error by a relative change of a noise parameter", fontsize=11)
        figure.align_ylabels()
    return figure


@draw.register(Budget)
def plot_budget(
    b: Budget,
    *,
    quantities: Sequence[str] = ("horizontal", "vertical", "tilt", "heading"),
    num: int = 7,
    axes: GivenAxes | None = None,
) -> Figure:
    """Shares of the sources in the mean square errors over time, and the RMS errors themselves.

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
    """
    shares = {q: np.nan_to_num(b.share(q)) for q in quantities}
    weight = np.sum([x.mean(axis=1) for x in shares.values()], axis=0)
    order = np.argsort(-weight)
    chosen, rest = order[:num], order[num:]
    labels = [b.sources[i] for i in chosen] + ["others"] * bool(len(rest))
    colours = [*COLOURS[: len(chosen)], _OTHERS]
    rows = -(-len(quantities) // 2)
    columns, size = min(2, len(quantities)), (12.0, 1.0 + 3.2 * rows)
    figure, drawn = frames(axes, rows, columns, size, num=len(quantities), sharex=True)
    for ax, q in zip(drawn, quantities, strict=True):
        _, unit, factor = QUANTITIES[q]
        parts = [*shares[q][chosen], *([shares[q][rest].sum(axis=0)] if len(rest) else [])]
        ax.stackplot(b.time, 100 * np.array(parts), labels=labels, colors=colours, lw=0, alpha=0.85)
        ax.set(ylim=(0, 100), ylabel="share of the mean square [%]", title=q)
        for edge in sorted({t for interval in b.outage_intervals for t in interval}):
            ax.axvline(edge, color="black", lw=0.9, ls=":")
        twin = ax.twinx()
        rms = factor * np.sqrt(b.mean_square(q).sum(axis=0))
        twin.plot(b.time, positive(rms), color="black", lw=1.8)
        twin.set_ylabel(f"RMS error [{unit}]")
        twin.margins(x=0)
        logarithmic(twin)
        time_below(ax)
    entries = entries_of(drawn[0]) | {"RMS error (right axis)": Line2D([], [], color="black", lw=1.8)}
    if b.outage_intervals:
        entries["ends of outages"] = Line2D([], [], color="black", lw=0.9, ls=":")
    shared_legend(figure, drawn, entries, alone=axes is None, loc="outside right center", fontsize=8)
    return figure


@draw.register(CalibrationEffect)
def plot_calibration(
    c: CalibrationEffect,
    *,
    quantities: Sequence[str] = ("position", "heading"),
    level: float = 0.95,
    axes: GivenAxes | None = None,
) -> Figure:
    """What a calibration leaves open of the RMS errors, and what it costs to have filtered with its estimate.

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
    """
    figure, drawn = frames(axes, 3, len(quantities), (1.5 + 5 * len(quantities), 9.0))
    k = c.epoch()
    for i, (colour, q) in enumerate(zip(COLOURS, quantities, strict=False)):
        over_time, loss, draws = drawn[i :: len(quantities)]
        _, unit, factor = QUANTITIES[q]
        low, high = (positive(factor * x) for x in c.interval(q, level))
        band = f"{100 * level:g} % of the draws"
        over_time.fill_between(c.time, low, high, color=colour, alpha=0.25, lw=0, label=band)
        over_time.plot(c.time, positive(factor * c.rms[q]), color=colour, lw=1.5, label="estimate")
        over_time.set(ylabel=f"RMS error [{unit}]", title=f"{q}: RMS error of the filter")
        logarithmic(over_time)
        loss.plot(c.time, 100 * c.loss(q), color=colour, lw=1.5, label="mean over the draws")
        loss.set(ylabel="loss [%]", title=f"{q}: loss against a filter that knows the truth")
        loss.set_ylim(bottom=0)
        for ax in (over_time, loss):
            along_time(ax, c.outage_intervals)
            ax.legend(fontsize=8)
        draws.hist(factor * c.used[q][:, k], bins="auto", color=colour, alpha=0.5, label="draws")
        draws.axvline(factor * c.rms[q][k], color=colour, lw=1.8, label="estimate")
        draws.set(xlabel=f"RMS error at {c.time[k]:g} s [{unit}]", ylabel="number of draws [1]", title=q)
        for ends, x in (("interval", low[k]), (None, high[k])):
            draws.axvline(x, color=INK, lw=1.0, ls="--", label=ends and f"{100 * level:g} % {ends}")
        draws.yaxis.set_major_locator(MaxNLocator(integer=True))
        draws.legend(fontsize=8)
        grid(draws)
    return figure


@draw.register(Design)
def plot_design(d: Design, *, axes: GivenAxes | None = None) -> Figure:
    """States of the filters against what they reach: position error, consistency, and the loss with its Pareto front.

    Parameters
    ----------
    d
        The design; the numbers at a filter are its Gauss-Markov processes on an axis, accelerometer + gyro, and a
        question mark that its search did not converge.
    axes
        Three Axes to draw into; a new figure if left out.
    """
    figure, (position, nees, loss) = frames(axes, 1, 3, (14.0, 5.0))
    designed = np.array([(*judged(c.covariances), c.loss) for c in d.candidates])
    naive = np.array([(*judged(c.covariances_naive), c.loss_naive) for c in d.candidates])
    right, true_states, at = judged(d.right), len(d.truth.bank().states), _side_by_side(d.candidates)
    for ax, column in ((position, 0), (nees, 2), (loss, 3)):
        ax.vlines(at, designed[:, column], naive[:, column], color="0.75", lw=1.0, zorder=1)
        ax.plot(at, naive[:, column], "v", color=COLOURS[1], mfc="none", label="truncated: a part of the truth")
        ax.plot(at, designed[:, column], "o", color=COLOURS[0], label="designed")
        for c, x, value in zip(d.candidates, at, designed[:, column], strict=True):
            text = f"{c.num_accel}+{c.num_gyro}{'' if c.converged else '?'}"
            place: Any = {"textcoords": "offset points", "ha": "center", "va": "top", "rotation": 90}
            ax.annotate(text, (x, value), (0, -7), fontsize=8, **place)
    for ax, column in ((position, 0), (nees, 2)):
        ax.plot(true_states, right[column], "*", color=COLOURS[2], ms=13, label="right: believes the truth")
        ax.axhline(right[column], color=COLOURS[2], lw=0.9, ls=":")
        ax.margins(x=0.1, y=0.18)
        logarithmic(ax)
    front = {id(c) for c in d.pareto}
    on_front = [i for i, c in enumerate(d.candidates) if id(c) in front]
    loss.step(at[on_front], designed[on_front, 3], where="post", color=COLOURS[0], lw=1.2, label="Pareto front")
    # filters that are far off would press all others flat
    low, spread = designed[:, 3].min(), max(np.ptp(designed[:, 3]), 1e-3)
    loss.set(xmargin=0.1, ylim=(low - 0.25 * spread, low + 1.7 * spread))
    position.set(ylabel="true RMS position error [m]", title="position error at the judged epoch")
    nees.set(ylabel="expected NEES / 9 [1]", title="consistency of position, velocity, attitude")
    loss.set(ylabel=f"loss: {d.objective} [1]", title="what was minimised (lower is better)")
    for ax in (position, nees, loss):
        ax.set_xlabel("sensor states of the filter [1]")
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        grid(ax)
        ax.legend(fontsize=8, loc="upper right")
    return figure


def _side_by_side(candidates: Sequence[Candidate]) -> np.ndarray:
    """Numbers of states, of which equal ones are moved apart a little."""
    states = np.array([c.num_states for c in candidates])
    apart = 0.06 * max(np.ptp(states), 1)
    at = states.astype(float)
    for n in set(states):
        same = np.flatnonzero(states == n)
        at[same] += apart * (np.arange(len(same)) - (len(same) - 1) / 2)
    return at
