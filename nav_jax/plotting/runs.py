"""Figures of the runs of one model: where they went, their errors with the filter's bounds, and its sensor states.

Every function draws into given Axes, or makes a Figure (of pyplot, which also keeps it) and returns it; none shows,
saves or closes anything.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from nav_jax.filter.layout import JUDGED
from nav_jax.simulation.runs import Runs
from nav_jax.trajectory.trajectory import Trajectory

COLOURS = ("#1f4e79", "#c23b22", "#2a8f8f", "#e08e0b", "#7a4f9a", "#5b8c2a", "#b5628c", "#6b6b6b")
"""Of models, in their order."""

_RUN, _BOUND, _TRUTH, _IN_OUTAGE = "#7fa3c7", "#c23b22", "black", "#e08e0b"
_OUTAGE = "#f3e3c3"
_MANY = 500
"""Of a logarithmic axis that spans more, only powers of ten have room for a number."""

_SHOWN = {  # block -> (title, unit, factor, rows: label, column, sign)
    "position": ("position", "m", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "velocity": ("velocity", "m/s", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "attitude": ("attitude", "deg", 180 / np.pi, (("about north", 0, 1), ("about east", 1, 1), ("about down", 2, 1))),
    "accel": ("accelerometer", "mm/s²", 1e3, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
    "gyro": ("gyroscope", "deg/h", 180 / np.pi * 3600, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
}


def plot_realisations(
    runs: Runs, reference: Trajectory, *, max_runs: int = 20, axes: Sequence[Axes] | None = None
) -> Figure:
    """Where runs say that they went, over the truth: plan and height.

    Parameters
    ----------
    runs
        Its tracks are drawn; without tracks, the truth plus the errors at the epochs.
    reference
        The truth.
    max_runs
        At most so many.
    axes
        Two Axes to draw into, plan and height; a new figure if left out.
    """
    figure, (plan, height) = plan_and_height(axes)
    outages = runs.outage_intervals
    drawn = _paths(runs, reference, max_runs)
    thin: dict[str, Any] = {"lw": 0.8, "alpha": 0.7}
    for i, (time, position) in enumerate(drawn):
        label = f"{len(drawn)} run{'s' * (len(drawn) != 1)} of {runs.name}" if i == 0 else None
        plan.plot(position[:, 1], position[:, 0], color=_RUN, label=label, **thin)
        height.plot(time, -position[:, 2], color=_RUN, label=label, **thin)
        for j, (start, end) in enumerate(outages):
            inside = (time >= start) & (time <= end)
            label = "in an outage" if i == j == 0 else None
            plan.plot(position[inside, 1], position[inside, 0], color=_IN_OUTAGE, label=label, **thin)
    position = reference.position
    plan.plot(position[:, 1], position[:, 0], color=_TRUTH, lw=1.2, ls="--", label="truth")
    height.plot(reference.time, -position[:, 2], color=_TRUTH, lw=1.2, ls="--", label="truth")
    shade(height, outages)
    for ax in (plan, height):
        ax.legend(fontsize=8, loc="best")
    return figure


def plot_errors(
    runs: Runs, *, blocks: Sequence[str] = ("position",), max_runs: int = 50, sigmas: float = 3.0
) -> Figure:
    """Errors of runs with the bounds of the filter: position and velocity east, north, up, attitude about the axes.

    Parameters
    ----------
    runs
        Of one model.
    blocks
        A column each: ``position``, ``velocity``, ``attitude``.
    max_runs
        At most so many runs are drawn; the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.
    """
    return _draw_blocks(runs, blocks, max_runs, sigmas, f"{runs.name}: estimate - truth, {runs.counts()}")


def plot_sensor_states(runs: Runs, *, max_runs: int = 30, sigmas: float = 3.0) -> Figure:
    """Errors of the estimated sensor errors of the six axes with the bounds of the filter.

    Parameters
    ----------
    runs
        Of one model. An axis without state has no estimate: what is drawn there is what the filter does not know of.
    max_runs
        At most so many runs are drawn; the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.
    """
    title = f"{runs.name}: estimated - true sensor error (true one without white noise)"
    return _draw_blocks(runs, ("accel", "gyro"), max_runs, sigmas, title)


# -- shared with plot.py ----------------------------------------------------------------------------------------------


def plan_and_height(axes: Sequence[Axes] | None) -> tuple[Figure, Sequence[Axes]]:
    """Two labelled frames: a plan with one scale for both axes, and height over time."""
    if axes is None:
        figure, new = plt.subplots(1, 2, figsize=(10.5, 4.8), layout="constrained")
        chosen: Sequence[Axes] = tuple(new)
    else:
        figure, chosen = figure_of(axes[0]), axes
    plan, height = chosen
    plan.set(xlabel="east [m]", ylabel="north [m]", title="plan")
    plan.set_aspect("equal", adjustable="datalim")
    height.set(xlabel="time [s]", ylabel="height [m]", title="height")
    for ax in (plan, height):
        grid(ax)
    return figure, chosen


def shade(ax: Axes, outages: Iterable[tuple[float, float]], *, label: bool = True) -> None:
    """The outages as bands behind everything, one entry for all of them in the legend."""
    for i, (start, end) in enumerate(outages):
        ax.axvspan(start, end, color=_OUTAGE, lw=0, zorder=0, label="outage" if label and i == 0 else None)


def grid(ax: Axes) -> None:
    """Thin lines behind the data."""
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)


def logarithmic(ax: Axes, which: Literal["x", "y"] = "y") -> None:
    """With ticks that read as numbers, also where the axis has no power of ten on it."""
    ax.set(**{f"{which}scale": "log"})
    low, high = ax.get_ylim() if which == "y" else ax.get_xlim()
    axis = ax.yaxis if which == "y" else ax.xaxis
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(LogLocator(subs=(2, 5)))
    axis.set_minor_formatter(StrMethodFormatter("{x:g}") if high < _MANY * low else NullFormatter())


def figure_of(ax: Axes) -> Figure:
    """The figure that an Axes is in."""
    figure = ax.get_figure()
    assert isinstance(figure, Figure)
    return figure


# -- in here ----------------------------------------------------------------------------------------------------------


def _paths(runs: Runs, reference: Trajectory, max_runs: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time and position of runs that are ok."""
    if runs.tracks:
        good = [track for i, track in runs.tracks.items() if runs.good[i]]
        return [(track.time, track.position) for track in good[:max_runs]]
    truth = np.stack([np.interp(runs.time, reference.time, reference.position[:, i]) for i in range(3)], axis=-1)
    return [(runs.time, truth + runs.error[i, :, :3]) for i in np.flatnonzero(runs.good)[:max_runs]]


def _draw_blocks(runs: Runs, blocks: Sequence[str], max_runs: int, sigmas: float, title: str) -> Figure:
    for block in blocks:
        JUDGED[block]  # before there is a figure
    figure, axes = plt.subplots(
        3, len(blocks), sharex=True, squeeze=False, figsize=(2.5 + 4.5 * len(blocks), 6.6), layout="constrained"
    )
    chosen = np.flatnonzero(runs.good)[:max_runs]
    for column, block in enumerate(blocks):
        name, unit, factor, rows = _SHOWN[block]
        drawn = runs.errors(block, chosen)
        sd = np.sqrt(np.mean(runs.sds(block) ** 2, axis=0))
        for ax, (label, k, sign) in zip(axes[:, column], rows, strict=True):
            _draw_component(ax, runs, sign * factor * drawn[:, :, k], factor * sd[:, k], sigmas)
            ax.set_ylabel(f"{label} [{unit}]")
        axes[0, column].set_title(name)
        axes[-1, column].set_xlabel("time [s]")
    handles: dict[str, Any] = {}
    for ax in axes.flat:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=len(handles), fontsize=9)
    figure.suptitle(title, fontsize=11)
    figure.align_ylabels()
    return figure


def _draw_component(ax: Axes, runs: Runs, errors: np.ndarray, sd: np.ndarray, sigmas: float) -> None:
    """One component of the errors of some runs, (runs, epochs), and its bounds."""
    shade(ax, runs.outage_intervals)
    lines = ax.plot(runs.time, errors.T, color=_RUN, lw=0.6, alpha=0.6)
    if lines:
        lines[0].set_label(f"{len(lines)} runs" if len(lines) < runs.num_good else "runs")
    if np.any(sd > 0):
        ax.plot(runs.time, sigmas * sd, color=_BOUND, lw=1.4, label=f"±{sigmas:g} sd of the filter")
        ax.plot(runs.time, -sigmas * sd, color=_BOUND, lw=1.4)
    else:
        ax.text(0.02, 0.93, "no state", transform=ax.transAxes, va="top", color=_BOUND, fontweight="bold")
    ax.axhline(0, color="0.4", lw=0.7)
    ax.margins(x=0)
    grid(ax)
