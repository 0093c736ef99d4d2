"""Figures of several models beside each other: mean errors, consistency, innovations, overview.

Bands of confidence move with the data; grey bands are where a consistent filter lies.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames
from nav_jax.plotting._style import COLOURS, DEGREES, draw, grid, logarithmic, shade
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.ranking import Ranking, common_runs
from nav_jax.simulation.runs import Runs
from nav_jax.statistics.energy import energy_score
from nav_jax.statistics.summaries import Curve, coverage, mean_curve, mean_nees, mean_norm

Models = Comparison | Runs | Mapping[str, Runs]
"""One model or several on common random numbers."""

_CONSISTENT = "0.82"


def plot_mean_errors(
    models: Models, *, log: bool = False, level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """Mean position and orientation error of each model with its confidence band.

    Parameters
    ----------
    models
        One or several; only runs in which none of them failed count.
    log
        Logarithmic errors, by which a filter with and without GNSS fits into one frame.
    level
        Of the bands, pointwise.
    axes
        Two Axes to draw into; a new figure if left out.
    """
    by_name, chosen = _common(models)
    figure, (left, right) = frames(axes, 1, 2, (10.5, 4.4), sharex=True)
    for colour, (name, r) in zip(cycle(COLOURS), by_name.items(), strict=False):
        _draw_curve(left, r.time, mean_norm(r.errors("position", chosen), level), colour, name)
        _draw_curve(right, r.time, mean_norm(r.errors("attitude", chosen), level), colour, name, DEGREES)
    left.set(ylabel="mean position error [m]", title="position error")
    right.set(ylabel="mean orientation error [deg]", title="orientation error")
    for ax in (left, right):
        if log:
            logarithmic(ax)
        else:
            ax.set_ylim(bottom=0)
        _finish(ax, by_name, f"{len(chosen)} runs, band: {100 * level:g} % interval")
    return figure


def plot_consistency(
    models: Models,
    *,
    groups: Sequence[str] = ("position", "pose", "navigation"),
    level: float = 0.95,
    axes: GivenAxes | None = None,
) -> Figure:
    """Mean NEES over its expectation, and coverage, of groups of states, with the bands of a consistent filter.

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
    """
    by_name, chosen = _common(models)
    alone = axes is None
    size = (1.5 + 4 * len(groups), 6.4)
    figure, drawn = frames(axes, 2, len(groups), size, sharex=True)
    for top, bottom, group in zip(drawn[: len(groups)], drawn[len(groups) :], groups, strict=True):
        shown = {
            name: (colour, r)
            for colour, (name, r) in zip(cycle(COLOURS), by_name.items(), strict=False)
            if group in r.nees and r.known_epochs(group).any()
        }
        for position, (name, (colour, r)) in enumerate(shown.items()):
            known = r.known_epochs(group)
            squares, dof, t = r.select(r.nees[group], chosen)[:, known], r.dof[group], r.time[known]
            nees, covered = mean_nees(squares, dof, level), coverage(squares, dof, level, level)
            if position == 0:
                top.axhspan(nees.low / dof, nees.high / dof, color=_CONSISTENT, lw=0, zorder=1, label="consistent")
                bottom.axhspan(covered.low, covered.high, color=_CONSISTENT, lw=0, zorder=1, label="consistent")
            share = f"{name}: {100 * nees.share_inside:.0f} % inside"
            top.plot(t, nees.value / dof, color=colour, lw=1.2, label=share)
            share = f"{name}: {100 * covered.share_inside:.0f} % inside"
            bottom.plot(t, covered.value, color=colour, lw=1.2, label=share)
        top.axhline(1.0, color="0.4", lw=0.7)
        bottom.axhline(level, color="0.4", lw=0.7)
        top.set(ylabel="mean NEES / dof [1]", title=f"{group}: {_dofs(shown, group)}")
        bottom.set(ylabel=f"coverage of the {100 * level:g} % region [1]", ylim=(None, 1.02))
        band = f"{len(chosen)} runs, grey: {100 * level:g} % band"
        _room(top, above=True)
        _room(bottom, above=False)
        _finish(top, by_name, band, "upper left")
        _finish(bottom, by_name, band, "lower left")
        if alone:
            top.set_xlabel("")
    return figure


def plot_nis(
    models: Models, *, sensors: Sequence[str] | None = None, level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """Mean NIS of each aiding sensor over its expectation, with the band of a consistent filter.

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
    """
    by_name, chosen = _common(models)
    there = list(dict.fromkeys(s for r in by_name.values() for s in r.nis if len(r.nis_time[s])))
    names = there if sensors is None else list(sensors)
    if unknown := [s for s in names if s not in there]:
        raise ValueError(f"There are no innovations of {', '.join(unknown)}, only of {', '.join(there) or 'nothing'}.")
    if not names:
        raise ValueError("There are no innovations to draw: these runs have no fixes.")
    figure, drawn = frames(axes, len(names), 1, (8.5, 0.8 + 2.6 * len(names)), sharex=True)
    for ax, sensor in zip(drawn, names, strict=True):
        for colour, (name, r) in zip(cycle(COLOURS), by_name.items(), strict=False):
            if sensor not in r.nis:
                continue
            nis = mean_nees(r.select(r.nis[sensor], chosen), r.nis_dof[sensor], level)
            label = f"{name}: {100 * nis.share_inside:.0f} % inside"
            ax.plot(r.nis_time[sensor], nis.value / nis.dof, ".", color=colour, ms=3.5, label=label)
            ax.axhspan(nis.low / nis.dof, nis.high / nis.dof, color=_CONSISTENT, lw=0, zorder=0.5)
        ax.axhline(1.0, color="0.4", lw=0.7)
        ax.set(ylabel="mean NIS / dof [1]", title=sensor)
        _room(ax, above=True)
        _finish(ax, by_name, f"{len(chosen)} runs, grey: {100 * level:g} % band", "upper left")
    return figure


@draw.register(Comparison)
def plot_comparison(
    comparison: Comparison, *, at: float | None = None, level: float = 0.95, axes: GivenAxes | None = None
) -> Figure:
    """All models at a glance: mean errors, energy score, consistency of the pose, and which differences are real.

    Parameters
    ----------
    comparison
        The models.
    at
        Time in s at which they are judged, see `Comparison.table`.
    level
        Of all bands and intervals.
    axes
        Six Axes to draw into, as in two rows of three; a new figure if left out.
    """
    table = comparison.table(at, level)
    by_name, chosen = _common(comparison)
    figure, (position, orientation, score, nees, covered, pairs) = frames(axes, 2, 3, (15, 8))
    plot_mean_errors(comparison, level=level, axes=(position, orientation))
    for colour, (name, r) in zip(cycle(COLOURS), by_name.items(), strict=False):
        each = energy_score(r.errors("position", chosen), r.select(r.position_covariance, chosen))
        _draw_curve(score, r.time, mean_curve(each, level), colour, name)
    score.set(ylabel="mean energy score [m]", title="energy score of the position (lower is better)")
    score.set_ylim(bottom=0)
    _finish(score, by_name, f"{len(chosen)} runs, band: {100 * level:g} % interval")
    plot_consistency(comparison, groups=("pose",), level=level, axes=(nees, covered))
    nees.set_title("NEES of position and attitude")
    covered.set_title("coverage of position and attitude")
    for ax in (position, orientation, score, nees, covered):
        ax.axvline(table.time, color="0.35", lw=0.9, ls=":")
    _draw_pairs(pairs, table, dict(zip(by_name, cycle(COLOURS), strict=False)))
    truth = f"; truth: {comparison.truth.splitlines()[0]}" if comparison.truth else ""
    if axes is None:
        figure.suptitle(f"{len(chosen)} common runs along {comparison.reference.name or 'a trajectory'}{truth}")
    return figure


def _draw_pairs(ax: Axes, table: Ranking, colours: Mapping[str, str]) -> None:
    """Differences to the best model in the same runs, with their intervals and verdicts."""
    others = [one for one in table if one.paired is not None]
    best = table[0].model
    ax.axvline(0.0, color=colours[best], lw=1.6, label=f"{best}: {table[0].mean_position:.3g} m")
    for row, one in enumerate(others):
        test = one.paired
        assert test is not None
        half = [[test.difference - test.low], [test.high - test.difference]]
        ax.errorbar(test.difference, row, xerr=half, fmt="o", color=colours[one.model], capsize=4, lw=1.6)
        p = "p < 0.0001" if one.p < 1e-4 else f"p = {one.p:.2g}"
        text, where = f"{one.model}, {p}\n{one.verdict}", (0.03, row + 0.1)
        ax.annotate(text, where, xycoords=("axes fraction", "data"), va="top", fontsize=9)
    ax.set(ylim=(len(others) - 0.4, -0.75), yticks=[], xlabel=f"position error minus that of {best} [m]")
    ax.set_title(f"difference in the same runs at {table.time:g} s")
    ax.margins(x=0.15)
    grid(ax)
    ax.legend(fontsize=8, loc="upper right", title=f"bars: {100 * table.level:g} % interval", title_fontsize=8)


def _draw_curve(ax: Axes, t: np.ndarray, curve: Curve, colour: str, label: str, factor: float = 1.0) -> None:
    ax.fill_between(t, factor * curve.low, factor * curve.high, color=colour, alpha=0.2, lw=0)
    ax.plot(t, factor * curve.value, color=colour, lw=1.4, label=label)


def _common(models: Models) -> tuple[dict[str, Runs], np.ndarray]:
    """Models with two good runs, and the runs in which none of them failed."""
    if isinstance(models, Runs):
        models = {models.name: models}
    every = models.runs if isinstance(models, Comparison) else models
    chosen = common_runs(every)
    if len(chosen) < 2:
        raise ValueError(f"A mean over runs takes 2 or more in which no model failed, and there are {len(chosen)}.")
    return {name: r for name, r in every.items() if r.num_good >= 2}, chosen


def _dofs(shown: Mapping[str, Any], group: str) -> str:
    dofs = sorted({r.dof[group] for _, r in shown.values()})
    return f"{' or '.join(map(str, dofs)) or 'no'} states"


def _finish(ax: Axes, by_name: Mapping[str, Runs], title: str, place: Any = "best") -> None:
    shade(ax, sorted({i for r in by_name.values() for i in r.outage_intervals}))
    ax.set_xlabel("time [s]")
    ax.margins(x=0)
    grid(ax)
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(fontsize=8, title=title, title_fontsize=8, loc=place, ncols=1 + (len(handles) > 3))


def _room(ax: Axes, *, above: bool) -> None:
    """Room for a legend that would cover the curves."""
    low, high = ax.get_ylim()
    if above and high > 6:  # a model that is far off would press the band flat
        logarithmic(ax)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** 0.45)
    elif above:
        ax.set_ylim(low, high + 0.45 * (high - low))
    else:
        ax.set_yticks([tick for tick in ax.get_yticks() if low <= tick <= 1])
        ax.set_ylim(low - 0.45 * (high - low), high)
