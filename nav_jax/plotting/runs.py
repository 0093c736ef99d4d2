"""Figures of the runs of one model: where they went, their errors with the filter's bounds, and its sensor states."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, entries_of, frames, shared_legend
from nav_jax.filter.layout import JUDGED
from nav_jax.plotting._style import DEGREES, draw, grid, plan_and_height, shade
from nav_jax.simulation.runs import Runs
from nav_jax.trajectory.trajectory import Trajectory

_RUN, _BOUND, _TRUTH, _IN_OUTAGE = "#7fa3c7", "#c23b22", "black", "#e08e0b"

_SHOWN = {  # block -> (title, unit, factor, rows: label, column, sign)
    "position": ("position", "m", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "velocity": ("velocity", "m/s", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "attitude": ("attitude", "deg", DEGREES, (("about north", 0, 1), ("about east", 1, 1), ("about down", 2, 1))),
    "accel": ("accelerometer", "mm/s²", 1e3, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
    "gyro": ("gyroscope", "deg/h", DEGREES * 3600, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
}


def plot_realisations(
    runs: Runs, reference: Trajectory, *, max_runs: int = 20, axes: GivenAxes | None = None
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


@draw.register(Runs)
def plot_errors(
    runs: Runs,
    *,
    blocks: Sequence[str] = ("position",),
    max_runs: int = 50,
    sigmas: float = 3.0,
    axes: GivenAxes | None = None,
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
    axes
        Three Axes a block to draw into, of shape (3, blocks); a new figure if left out.
    """
    return _draw_blocks(runs, blocks, max_runs, sigmas, axes, f"{runs.name}: estimate - truth, {runs.counts()}")


def plot_sensor_states(runs: Runs, *, max_runs: int = 30, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
    """Errors of the estimated sensor errors of the six axes with the bounds of the filter.

    Parameters
    ----------
    runs
        Of one model. An axis without state has no estimate: what is drawn there is what the filter does not know of.
    max_runs
        At most so many runs are drawn; the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.
    axes
        Six Axes to draw into, of shape (3, 2); a new figure if left out.
    """
    title = f"{runs.name}: estimated - true sensor error (true one without white noise)"
    return _draw_blocks(runs, ("accel", "gyro"), max_runs, sigmas, axes, title)


def _paths(runs: Runs, reference: Trajectory, max_runs: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time and position of runs that are ok."""
    if runs.tracks:
        good = [track for i, track in runs.tracks.items() if runs.good[i]]
        return [(track.time, track.position) for track in good[:max_runs]]
    truth = np.stack([np.interp(runs.time, reference.time, reference.position[:, i]) for i in range(3)], axis=-1)
    return [(runs.time, truth + runs.error[i, :, :3]) for i in np.flatnonzero(runs.good)[:max_runs]]


def _draw_blocks(
    runs: Runs, blocks: Sequence[str], max_runs: int, sigmas: float, axes: GivenAxes | None, title: str
) -> Figure:
    for block in blocks:
        JUDGED[block]  # before there is a figure
    figure, drawn = frames(axes, 3, len(blocks), (2.5 + 4.5 * len(blocks), 6.6), sharex=True)
    chosen = np.flatnonzero(runs.good)[:max_runs]
    for column, block in enumerate(blocks):
        name, unit, factor, rows = _SHOWN[block]
        below = drawn[column :: len(blocks)]
        errors = runs.errors(block, chosen)
        sd = np.sqrt(np.mean(runs.sds(block) ** 2, axis=0))
        for ax, (label, k, sign) in zip(below, rows, strict=True):
            _draw_component(ax, runs, sign * factor * errors[:, :, k], factor * sd[:, k], sigmas)
            ax.set_ylabel(f"{label} [{unit}]")
        below[0].set_title(name)
        below[-1].set_xlabel("time [s]")
    entries, alone = entries_of(*drawn), axes is None
    options: dict[str, Any] = {"loc": "outside lower center", "ncols": len(entries), "fontsize": 9}
    shared_legend(figure, drawn, entries, alone=alone, **options)
    if alone:
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
