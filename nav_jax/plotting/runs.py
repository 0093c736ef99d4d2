"""Figures of the runs of one model: where they went, their errors with the filter's bounds, and its sensor states."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.figure_data import Axis, Frame, Item, Line, Mark
from gmwm_jax._internal.figures import GivenAxes, describe, entries_of, frames, put, shared_legend
from nav_jax.filter.layout import JUDGED
from nav_jax.plotting._style import (
    DEGREES,
    TIME,
    draw,
    grid,
    height_frame,
    outage_items,
    plan_and_height,
    plan_frame,
    shade,
    without_outages,
)
from nav_jax.simulation.runs import Runs
from nav_jax.trajectory.trajectory import Trajectory

_OUT, _BOUNDS = "in an outage", " sd of the filter"
_RUN, _BOUND, _TRUTH, _IN_OUTAGE = "#7fa3c7", "#c23b22", "black", "#e08e0b"

_SHOWN = {  # block -> (title, unit, factor, rows: label, column, sign)
    "position": ("position", "m", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "velocity": ("velocity", "m/s", 1.0, (("east", 1, 1), ("north", 0, 1), ("up", 2, -1))),
    "attitude": ("attitude", "deg", DEGREES, (("about north", 0, 1), ("about east", 1, 1), ("about down", 2, 1))),
    "accel": ("accelerometer", "mm/s²", 1e3, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
    "gyro": ("gyroscope", "deg/h", DEGREES * 3600, (("x", 0, 1), ("y", 1, 1), ("z", 2, 1))),
}


def realisations_data(runs: Runs, reference: Trajectory, *, max_runs: int = 20) -> tuple[Frame, Frame]:
    """Return what `plot_realisations` shows: plan and height.

    Parameters
    ----------
    runs
        Its tracks, or without tracks the truth plus the errors at the epochs.
    reference
        The truth.
    max_runs
        At most so many.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.realisations_data(comparison["right"], reference)
    """
    outages = runs.outage_intervals
    paths = _paths(runs, reference, max_runs)
    plan: list[Item] = []
    height: list[Item] = []
    for i, (time, position) in enumerate(paths):
        label = "" if i else f"{len(paths)} run{'s' * (len(paths) != 1)} of {runs.name}"
        plan.append(Line(label, position[:, 1], position[:, 0]))
        height.append(Line(label, time, -position[:, 2]))
        for j, (start, end) in enumerate(outages):
            inside = (time >= start) & (time <= end)
            plan.append(Line("" if i or j else _OUT, position[inside, 1], position[inside, 0]))
    truth = reference.position
    plan.append(Line("truth", truth[:, 1], truth[:, 0]))
    height.append(Line("truth", reference.time, -truth[:, 2]))
    return plan_frame(plan), height_frame([*height, *outage_items(outages)])


def plot_realisations(
    runs: Runs, reference: Trajectory, *, max_runs: int = 20, axes: GivenAxes | None = None
) -> Figure:
    """Plot where runs say that they went, over the truth: plan and height.

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

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_realisations(comparison["right"], reference)
    >>> figure.savefig("realisations.png")
    """
    shown = realisations_data(runs, reference, max_runs=max_runs)
    figure, drawn = plan_and_height(axes, shown)
    thin: dict[str, Any] = {"lw": 0.8, "alpha": 0.7}
    period = 1 + len(runs.outage_intervals)  # of the items of one run in the plan, of which the first is all of it
    for ax, frame, repeat in zip(drawn, shown, (period, 1), strict=True):
        *paths, truth = without_outages(frame)
        for i, item in enumerate(paths):
            put(ax, item, color=_IN_OUTAGE if i % repeat else _RUN, **thin)
        put(ax, truth, color=_TRUTH, lw=1.2, ls="--")
        shade(ax, frame)
        ax.legend(fontsize=8, loc="best")
    return figure


def errors_data(
    runs: Runs, *, blocks: Sequence[str] = ("position",), max_runs: int = 50, sigmas: float = 3.0
) -> tuple[Frame, ...]:
    """Return what `plot_errors` shows: three rows, of which each has a frame for each block.

    Parameters
    ----------
    runs
        Of one model.
    blocks
        ``position``, ``velocity``, ``attitude``.
    max_runs
        At most so many runs; the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.errors_data(comparison["right"])
    """
    for block in blocks:
        JUDGED[block]  # raises where there is no such block
    chosen = np.flatnonzero(runs.good)[:max_runs]
    columns = [_components(runs, block, chosen, sigmas) for block in blocks]
    return tuple(column[row] for row in range(3) for column in columns)


@draw.register(Runs)
def plot_errors(
    runs: Runs,
    *,
    blocks: Sequence[str] = ("position",),
    max_runs: int = 50,
    sigmas: float = 3.0,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot the errors of runs with the bounds of the filter: position, velocity, attitude about the axes.

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

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_errors(comparison["right"])
    >>> figure.savefig("errors.png")
    """
    shown = errors_data(runs, blocks=blocks, max_runs=max_runs, sigmas=sigmas)
    return _draw_blocks(shown, axes, f"{runs.name}: estimate - truth, {runs.counts()}")


def sensor_states_data(runs: Runs, *, max_runs: int = 30, sigmas: float = 3.0) -> tuple[Frame, ...]:
    """Return what `plot_sensor_states` shows: three rows, of which each has a frame for accelerometer and gyroscope.

    Parameters
    ----------
    runs
        Of one model.
    max_runs
        At most so many runs; the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> frames = nj.plotting.sensor_states_data(comparison["right"])
    """
    return errors_data(runs, blocks=("accel", "gyro"), max_runs=max_runs, sigmas=sigmas)


def plot_sensor_states(runs: Runs, *, max_runs: int = 30, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
    """Plot errors of the estimated sensor errors of the six axes with the bounds of the filter.

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

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> white = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> filters = {"right": truth, "white": white}
    >>> comparison = nj.compare(scenario, truth=truth, filters=filters, num_runs=4, key=jax.random.key(0), keep=[0])
    >>> figure = nj.plotting.plot_sensor_states(comparison["right"])
    >>> figure.savefig("sensor_states.png")
    """
    title = f"{runs.name}: estimated - true sensor error (true one without white noise)"
    return _draw_blocks(sensor_states_data(runs, max_runs=max_runs, sigmas=sigmas), axes, title)


def _paths(runs: Runs, reference: Trajectory, max_runs: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Time and position of runs that are ok."""
    if runs.tracks:
        good = [track for i, track in runs.tracks.items() if runs.good[i]]
        return [(track.time, track.position) for track in good[:max_runs]]
    truth = np.stack([np.interp(runs.time, reference.time, reference.position[:, i]) for i in range(3)], axis=-1)
    return [(runs.time, truth + runs.error[i, :, :3]) for i in np.flatnonzero(runs.good)[:max_runs]]


def _components(runs: Runs, block: str, chosen: np.ndarray, sigmas: float) -> list[Frame]:
    """The three components of a block: errors of the chosen runs, and bounds where the filter has states."""
    name, unit, factor, rows = _SHOWN[block]
    errors, sd = runs.errors(block, chosen), np.sqrt(np.mean(runs.sds(block) ** 2, axis=0))
    shown = []
    for row, (label, k, sign) in enumerate(rows):
        items = outage_items(runs.outage_intervals)
        who = f"{len(chosen)} runs" if len(chosen) < runs.num_good else "runs"
        for i, error in enumerate(errors[:, :, k]):
            items.append(Line("" if i else who, runs.time, sign * factor * error))
        if np.any(sd[:, k] > 0):
            bound = sigmas * (factor * sd[:, k])
            items += [Line(f"±{sigmas:g}{_BOUNDS}", runs.time, bound), Line("", runs.time, -bound)]
        items.append(Mark("", 0.0, "y"))
        shown.append(Frame("" if row else name, TIME, Axis(label, unit), tuple(items)))
    return shown


def _draw_blocks(shown: Sequence[Frame], axes: GivenAxes | None, title: str) -> Figure:
    columns = len(shown) // 3
    figure, drawn = frames(axes, 3, columns, (2.5 + 4.5 * columns, 6.6), sharex=True)
    for i, (ax, frame) in enumerate(zip(drawn, shown, strict=True)):
        _draw_component(ax, frame)
        if i < 2 * columns:
            ax.set_xlabel("")
    entries, alone = entries_of(*drawn), axes is None
    options: dict[str, Any] = {"loc": "outside lower center", "ncols": len(entries), "fontsize": 9}
    shared_legend(figure, drawn, entries, alone=alone, **options)
    if alone:
        figure.suptitle(title, fontsize=11)
    figure.align_ylabels()
    return figure


def _draw_component(ax: Axes, frame: Frame) -> None:
    """One component of the errors of some runs, and its bounds."""
    shade(ax, frame)
    *lines, zero = without_outages(frame)
    bounded = any(item.label.endswith(_BOUNDS) for item in lines)
    for item in lines[: -2 if bounded else None]:
        put(ax, item, color=_RUN, lw=0.6, alpha=0.6)
    if bounded:
        for item in lines[-2:]:
            put(ax, item, color=_BOUND, lw=1.4)
    else:
        ax.text(0.02, 0.93, "no state", transform=ax.transAxes, va="top", color=_BOUND, fontweight="bold")
    put(ax, zero, color="0.4", lw=0.7)
    describe(ax, frame)
    ax.margins(x=0)
    grid(ax)
