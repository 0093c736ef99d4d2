"""Figures of covariance analyses, of what is derived from them, and of a tuning.

Every function makes a Figure (of pyplot, which also keeps it) and returns it; none shows, saves or closes anything.
"""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from nav_jax.filter.layout import QUANTITIES
from nav_jax.lincov.analysis import Covariances
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.calibration import CalibrationEffect
from nav_jax.lincov.derivatives import Sensitivities
from nav_jax.lincov.filter_design import Candidate, Design, judged
from nav_jax.plotting.runs import COLOURS, grid, logarithmic, shade
from nav_jax.recorded.tuning import Tuning

_DEGREES = 180 / np.pi
_OTHERS = "0.8"
_INK = "0.25"
_STYLES = {"truth": "-", "filter": "--"}


def plot_analysis(filters: Mapping[str, Covariances], *, group: str = "pose", level: float = 0.95) -> Figure:
    """True against claimed errors of filters, and how consistent that makes them.

    Parameters
    ----------
    filters
        Name -> covariances.
    group
        Of states whose NEES and coverage are drawn, see `nav_jax.filter.layout.GROUPS`.
    level
        Of the region whose coverage is drawn.
    """
    figure, ((position, attitude), (nees, coverage)) = _frames(2, 2, (11.5, 7.4))
    for colour, (name, c) in zip(cycle(COLOURS), filters.items(), strict=False):
        for ax, block, factor in ((position, "position", 1.0), (attitude, "attitude", _DEGREES)):
            # a start that is known exactly has no place on a logarithmic axis
            ax.plot(c.time, _positive(factor * c.rms(block)), color=colour, lw=1.4, label=name)
            ax.plot(c.time, _positive(factor * c.rms_claimed(block)), color=colour, lw=1.2, ls="--")
        nees.plot(c.time, c.nees(group) / max(c.dof(group), 1), color=colour, lw=1.4, label=name)
        coverage.plot(c.time, c.coverage(group, level), color=colour, lw=1.4, label=name)
    nees.axhline(1.0, color=_INK, lw=0.9, ls=":", label="consistent")
    coverage.axhline(level, color=_INK, lw=0.9, ls=":")
    position.set(ylabel="RMS position error [m]", title="position: true and claimed")
    attitude.set(ylabel="RMS orientation error [deg]", title="orientation: true and claimed")
    nees.set(ylabel="expected NEES / dof [1]", title=f"consistency of the {group}")
    coverage.set(ylabel=f"coverage of the {100 * level:g} % region [1]", title=f"coverage of the {group}")
    for ax in (position, attitude, nees):
        logarithmic(ax)
    coverage.set_ylim(-0.02, 1.02)
    for ax in (position, attitude, nees, coverage):
        _over_time(ax, next(iter(filters.values())).outage_intervals)
    styles = [Line2D([], [], color=_INK, ls=ls, label=label) for ls, label in (("-", "true"), ("--", "claimed"))]
    _legend_below(figure, nees, styles)
    return figure


def plot_sensitivities(
    s: Sensitivities, *, quantities: Sequence[str] = ("position", "tilt", "heading"), num: int = 8
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
    """
    k = s.epoch()
    effect = np.max([np.abs(np.nan_to_num(s.elasticity(q)[k])) for q in quantities], axis=0)
    chosen = [p for p in np.argsort(-effect)[:num] if effect[p] > 0]
    colours = dict(zip(dict.fromkeys(s.names[p] for p in chosen), cycle(COLOURS), strict=False))
    figure, axes = _frames(len(quantities), 1, (10.5, 1.2 + 2.5 * len(quantities)))
    for ax, q in zip(axes[:, 0], quantities, strict=True):
        _, unit, factor = QUANTITIES[q]
        for p in chosen:
            name, side = s.names[p], s.sides[p]
            label = f"{name} ({side})"
            values = factor * s.derivative[q][:, p]
            ax.plot(s.time, values, color=colours[name], ls=_STYLES[side], lw=1.4, label=label)
        ax.axhline(0.0, color=_INK, lw=0.7)
        ax.set(ylabel=f"d RMS / d log [{unit}]", title=q)
        _over_time(ax, s.outage_intervals)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8, title="parameter of", title_fontsize=8)
    figure.suptitle("change of the true RMS error by a relative change of a noise parameter", fontsize=11)
    figure.align_ylabels()
    return figure


def plot_budget(
    b: Budget, *, quantities: Sequence[str] = ("horizontal", "vertical", "tilt", "heading"), num: int = 7
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
    """
    shares = {q: np.nan_to_num(b.share(q)) for q in quantities}
    weight = np.sum([x.mean(axis=1) for x in shares.values()], axis=0)
    order = np.argsort(-weight)
    chosen, rest = order[:num], order[num:]
    labels = [b.sources[i] for i in chosen] + ["others"] * bool(len(rest))
    colours = [*COLOURS[: len(chosen)], _OTHERS]
    rows = -(-len(quantities) // 2)
    figure, axes = _frames(rows, min(2, len(quantities)), (12.0, 1.0 + 3.2 * rows))
    for ax in axes.flat[len(quantities) :]:
        ax.remove()
    for ax, q in zip(axes.flat, quantities, strict=False):
        _, unit, factor = QUANTITIES[q]
        parts = [*shares[q][chosen], *([shares[q][rest].sum(axis=0)] if len(rest) else [])]
        ax.stackplot(b.time, 100 * np.array(parts), labels=labels, colors=colours, lw=0, alpha=0.85)
        ax.set(ylim=(0, 100), ylabel="share of the mean square [%]", title=q)
        for edge in sorted({t for interval in b.outage_intervals for t in interval}):
            ax.axvline(edge, color="black", lw=0.9, ls=":")
        twin = ax.twinx()
        rms = factor * np.sqrt(b.mean_square(q).sum(axis=0))
        twin.plot(b.time, _positive(rms), color="black", lw=1.8)
        twin.set_ylabel(f"RMS error [{unit}]")
        twin.margins(x=0)
        logarithmic(twin)
        _time_below(ax)
    handles, _ = axes.flat[0].get_legend_handles_labels()
    line = Line2D([], [], color="black", lw=1.8, label="RMS error (right axis)")
    ends = [Line2D([], [], color="black", lw=0.9, ls=":", label="ends of outages")] * bool(b.outage_intervals)
    figure.legend(handles=[*handles, line, *ends], loc="outside right center", fontsize=8)
    return figure


def plot_calibration(
    c: CalibrationEffect, *, quantities: Sequence[str] = ("position", "heading"), level: float = 0.95
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
    """
    figure, axes = _frames(3, len(quantities), (1.5 + 5 * len(quantities), 9.0), sharex=False)
    k = c.epoch()
    for colour, q, (over_time, loss, draws) in zip(COLOURS, quantities, axes.T, strict=False):
        _, unit, factor = QUANTITIES[q]
        low, high = (_positive(factor * x) for x in c.interval(q, level))
        band = f"{100 * level:g} % of the draws"
        over_time.fill_between(c.time, low, high, color=colour, alpha=0.25, lw=0, label=band)
        over_time.plot(c.time, _positive(factor * c.rms[q]), color=colour, lw=1.5, label="estimate")
        over_time.set(ylabel=f"RMS error [{unit}]", title=f"{q}: RMS error of the filter")
        logarithmic(over_time)
        loss.plot(c.time, 100 * c.loss(q), color=colour, lw=1.5, label="mean over the draws")
        loss.set(ylabel="loss [%]", title=f"{q}: loss against a filter that knows the truth")
        loss.set_ylim(bottom=0)
        for ax in (over_time, loss):
            _over_time(ax, c.outage_intervals)
            ax.legend(fontsize=8)
        draws.hist(factor * c.used[q][:, k], bins="auto", color=colour, alpha=0.5, label="draws")
        draws.axvline(factor * c.rms[q][k], color=colour, lw=1.8, label="estimate")
        draws.set(xlabel=f"RMS error at {c.time[k]:g} s [{unit}]", ylabel="number of draws [1]", title=q)
        for ends, x in (("interval", low[k]), (None, high[k])):
            draws.axvline(x, color=_INK, lw=1.0, ls="--", label=ends and f"{100 * level:g} % {ends}")
        draws.yaxis.set_major_locator(MaxNLocator(integer=True))
        draws.legend(fontsize=8)
        grid(draws)
    return figure


def plot_design(d: Design) -> Figure:
    """States of the filters against what they reach: position error, consistency, and the loss with its Pareto front.

    Parameters
    ----------
    d
        The design; the numbers at a filter are its Gauss-Markov processes on an axis, accelerometer + gyro, and a
        question mark that its search did not converge.
    """
    figure, ((position, nees, loss),) = _frames(1, 3, (14.0, 5.0), sharex=False)
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


def plot_tuning(t: Tuning) -> Figure:
    """Each parameter relative to its start, with its interval; those that the record does not show are marked.

    Parameters
    ----------
    t
        The tuning.
    """
    figure, ((ax,),) = _frames(1, 1, (9.0, 1.6 + 0.42 * len(t.names)))
    rows = np.arange(len(t.names))
    # a partial autocorrelation may be negative, and its interval may contain zero
    factor = _positive(t.value / t.start)
    low, high = np.sort([t.ci_low / t.start, t.ci_high / t.start], axis=0)
    ax.axvline(1.0, color=_INK, lw=1.0, ls=":", label="start")
    interval = f"tuned, {100 * t.level:g} % interval"
    for chosen, colour, label in (
        (t.observable, COLOURS[0], interval),
        (t.sought & ~t.observable, COLOURS[3], "from the prior"),
    ):
        if chosen.any():
            # what goes through zero goes on to the edge of the logarithmic axis
            bars = [(factor - np.maximum(low, 0.0))[chosen], (high - factor)[chosen]]
            ax.errorbar(factor[chosen], rows[chosen], xerr=bars, fmt="o", color=colour, capsize=4, lw=1.6, label=label)
    held = np.isin(t.names, t.held)
    for chosen, style, label in ((~t.sought & ~t.lost & ~held, "x", "not observable"), (held, "s", "held")):
        if chosen.any():
            at, colour = rows[chosen], COLOURS[1] if style == "x" else _INK
            ax.plot(np.ones(len(at)), at, style, color=colour, mfc="none", ms=8, mew=1.8, label=label)
    ax.set(yticks=rows, yticklabels=t.names, xlabel="factor on the start [1]", ylim=(len(rows) - 0.5, -0.5))
    widest = 1.3 * np.nanmax([2.0, *high, *(1 / _positive(low))])
    ax.set_xlim(1 / widest, widest)
    if t.lost.any():
        # far off, as a variance on its way to zero
        at = np.clip(np.nan_to_num(factor[t.lost]), 1.1 / widest, widest / 1.1)
        ax.plot(at, rows[t.lost], "D", color=COLOURS[1], mfc="none", ms=7, mew=1.8, label="lost in the search")
    logarithmic(ax, "x")
    grid(ax)
    gain = f"log likelihood {t.loss_start - t.loss:+.4g}" + ("" if t.converged else ", NOT converged")
    ax.set_title(f"{t.num_innovations} innovations: {gain}", fontsize=11)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8)
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


def _over_time(ax: Axes, outages: Iterable[tuple[float, float]]) -> None:
    shade(ax, outages)
    ax.margins(x=0)
    grid(ax)
    _time_below(ax)


def _time_below(ax: Axes) -> None:
    """Frames that share their time have it under the lowest."""
    spec = ax.get_subplotspec()
    if len(ax.get_shared_x_axes().get_siblings(ax)) == 1 or (spec and spec.is_last_row()):
        ax.set_xlabel("time [s]")


def _legend_below(figure: Figure, ax: Axes, more: Sequence[Any]) -> None:
    """What the frames have in common."""
    handles, _ = ax.get_legend_handles_labels()
    figure.legend(handles=[*handles, *more], loc="outside lower center", ncols=min(len(handles) + len(more), 4))


def _positive(x: np.ndarray) -> np.ndarray:
    """NaN for what has no logarithm."""
    return np.where(x > 0, x, np.nan)


def _frames(rows: int, columns: int, size: tuple[float, float], *, sharex: bool = True) -> tuple[Figure, Any]:
    return plt.subplots(rows, columns, sharex=sharex, squeeze=False, figsize=size, layout="constrained")
