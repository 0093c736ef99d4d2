"""Figures of the runs of one model: where they went, their errors with the filter's bounds, and its sensor states."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line, Mark
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax._internal.palette import COLOURS
from gmwm_jax._internal.typing import Real
from nav_jax.filter.layout import JUDGED
from nav_jax.plotting._style import (
    DEGREES,
    TIME,
    beside_title,
    draw,
    grid,
    height_frame,
    outage_items,
    plan_and_height,
    plan_frame,
    shade,
    signed_logarithm,
    without_outages,
)
from nav_jax.simulation.runs import Runs
from nav_jax.trajectory.trajectory import Trajectory

_OUT, _OF_FILTER = "in an outage", " of the filter"
_BOUNDS = f" sd{_OF_FILTER}"
_RUN, _BOUND, _TRUTH, _IN_OUTAGE = "#7fa3c7", COLOURS[1], "black", COLOURS[3]
_FAR, _BEYOND = 10.0, 4.0
"""Bounds that grow by more than that need a logarithmic axis; those that are wider than the errors by more than that
have no place beside them."""

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
    period = 1 + len(runs.outage_intervals)  # of the items of one run in the plan, of which the first is all of it
    for ax, frame, repeat in zip(drawn, shown, (period, 1), strict=True):
        *paths, truth = without_outages(frame)
        for i, item in enumerate(paths):
            put(ax, item, color=_IN_OUTAGE if i % repeat else _RUN, lw=1.2, alpha=0.8)
        put(ax, truth, color=_TRUTH, lw=0.9, ls=(0, (5, 4)))
        shade(ax, frame)
    legend_below(figure, drawn, alone=axes is None)
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


def sensor_states_data(
    runs: Runs, *, max_runs: int = 30, sigmas: float = 3.0, average: Real | None = None, share: float = 0.9
) -> tuple[Frame, ...]:
    """Return what `plot_sensor_states` shows: three rows, of which each has a frame for accelerometer and gyroscope.

    Parameters
    ----------
    runs
        Of one model.
    max_runs
        At most so many runs; the band and the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.
    average
        Running means over so many seconds, of which white noise leaves little; 0 for none, a twentieth of the time if
        left out.
    share
        Of the runs, in the band.

    Raises
    ------
    ValueError
        A negative time to average over, a share that is none.

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
    if not 0 < share < 1:
        raise ValueError(f"The band has a share of the runs between 0 and 1, and share is {share}.")
    span = _span(runs, average)
    columns = [_slow_components(runs, block, max_runs, sigmas, span, share) for block in ("accel", "gyro")]
    return tuple(column[row] for row in range(3) for column in columns)


def plot_sensor_states(
    runs: Runs,
    *,
    max_runs: int = 30,
    sigmas: float = 3.0,
    average: Real | None = None,
    share: float = 0.9,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot the slow errors of the estimated sensor errors of the six axes with the bounds of the filter.

    What is left of the white noise, and of processes that the filter cannot tell from it, would hide the slow ones: the
    curves are running means. The bounds are those of the estimates themselves; where they are far wider than the means
    they are written beside the frame.

    Parameters
    ----------
    runs
        Of one model. An axis without state has no estimate: what is drawn there is what the filter does not know of.
    max_runs
        At most so many runs are drawn; the band and the bounds are of all.
    sigmas
        Bounds are that many standard deviations (root mean square over the runs) away.
    average
        Running means over so many seconds, of which white noise leaves little; 0 for none, a twentieth of the time if
        left out.
    share
        Of the runs, in the band.
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
    shown = sensor_states_data(runs, max_runs=max_runs, sigmas=sigmas, average=average, share=share)
    span = _span(runs, average)
    means = f", means of {span:.3g} s" if span else ""
    return _draw_blocks(shown, axes, f"{runs.name}: estimated - true sensor error (without white noise){means}")


def _span(runs: Runs, average: Real | None) -> float:
    """What running means are taken over, s."""
    if average is None:
        return float(runs.time[-1] - runs.time[0]) / 20
    if not average >= 0:
        raise ValueError(f"Running means are over a time of 0 s or more, and average is {average}.")
    return float(average)


def _running_mean(time: np.ndarray, x: np.ndarray, span: float) -> np.ndarray:
    """Mean of the columns of x that are at most half of the span away; fewer at the ends."""
    half = span / 2 + 1e-9
    first, last = np.searchsorted(time, time - half), np.searchsorted(time, time + half, "right")
    total = np.cumsum(np.pad(x, ((0, 0), (1, 0))), axis=1)
    return (total[:, last] - total[:, first]) / (last - first)


def _slow_components(runs: Runs, block: str, max_runs: int, sigmas: float, span: float, share: float) -> list[Frame]:
    """The three axes of a sensor: what is slow in the errors of all runs and of some, and bounds of states."""
    name, unit, factor, rows = _SHOWN[block]
    good = np.flatnonzero(runs.good)
    errors, sd = runs.errors(block, good), np.sqrt(np.mean(runs.sds(block) ** 2, axis=0))
    who = f"{max_runs} runs" if max_runs < len(good) else "runs"
    shown = []
    for row, (label, k, sign) in enumerate(rows):
        slow = sign * factor * _running_mean(runs.time, errors[:, :, k], span)
        low, middle, high = np.quantile(slow, [(1 - share) / 2, 0.5, (1 + share) / 2], axis=0)
        items = outage_items(runs.outage_intervals)
        items.append(Band(f"{100 * share:g} % of the runs", runs.time, low, high))
        items += [Line("" if i else who, runs.time, one) for i, one in enumerate(slow[:max_runs])]
        items.append(Line("median", runs.time, middle))
        items += _bounds(runs.time, factor * sd[:, k], sigmas)
        items.append(Mark("", 0.0, "y"))
        shown.append(Frame("" if row else name, TIME, Axis(label, unit), tuple(items)))
    return shown


def _bounds(time: np.ndarray, sd: np.ndarray, sigmas: float) -> list[Item]:
    """None where the filter has no state."""
    if not np.any(sd > 0):
        return []
    return [Line(f"±{sigmas:g}{_BOUNDS}", time, sigmas * sd), Line("", time, -sigmas * sd)]


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
        items += _bounds(runs.time, factor * sd[:, k], sigmas)
        items.append(Mark("", 0.0, "y"))
        # else what is before an outage would be flat
        scale = "symlog" if np.max(sd[:, k]) > _FAR * _usual(sd[:, k]) > 0 else "linear"
        shown.append(Frame("" if row else name, TIME, Axis(label, unit, scale), tuple(items)))
    return shown


def _usual(bound: np.ndarray) -> float:
    """Of a bound, what it is outside of outages."""
    return float(np.quantile(bound, 0.25))


def _draw_blocks(shown: Sequence[Frame], axes: GivenAxes | None, title: str) -> Figure:
    columns = len(shown) // 3
    figure, drawn = frames(axes, 3, columns, (2.5 + 4.5 * columns, 6.6), sharex=True)
    for i, (ax, frame) in enumerate(zip(drawn, shown, strict=True)):
        _draw_component(ax, frame)
        if i < 2 * columns:
            ax.set_xlabel("")
    legend_below(figure, drawn, alone=axes is None)
    if axes is None:
        figure.suptitle(title, fontsize=11)
    figure.align_ylabels()
    return figure


def _draw_component(ax: Axes, frame: Frame) -> None:
    """One component of the errors of some runs, and its bounds."""
    shade(ax, frame)
    *items, zero = without_outages(frame)
    bounded = any(item.label.endswith(_BOUNDS) for item in items)
    rest = items[: -2 if bounded else None]
    bounds = [item for item in items[len(rest) :] if isinstance(item, Line)]
    for item in rest:
        if isinstance(item, Band):
            put(ax, item, color=_RUN, alpha=0.45)
        elif item.label == "median":
            put(ax, item, color=COLOURS[0], lw=1.6, zorder=2.5)
        else:
            put(ax, item, color=_RUN, lw=0.7, alpha=0.6)
    for item in bounds:
        put(ax, item, color=_BOUND, lw=1.4)
    put(ax, zero, color="0.4", lw=0.7)
    describe(ax, frame)
    ax.margins(x=0)
    grid(ax)
    if not bounded:
        beside_title(ax, "no state", _BOUND)
    elif isinstance(rest[0], Band):
        _keep_slow(ax, bounds[0], max(np.abs(item.y).max() for item in rest if isinstance(item, Line)), frame.y.unit)
    elif frame.y.scale == "symlog":
        signed_logarithm(ax, _usual(bounds[0].y))


def _keep_slow(ax: Axes, bound: Line, most: float, unit: str) -> None:
    """Bounds that are far wider than what is slow are written beside the frame."""
    usual = float(np.median(bound.y))
    if usual > _BEYOND * most > 0:
        ax.set_ylim(-1.3 * most, 1.3 * most)
        beside_title(ax, f"{bound.label.removesuffix(_OF_FILTER)} is ±{usual:.2g} {unit}, beyond the frame", _BOUND)
