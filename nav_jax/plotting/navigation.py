"""Figures of a navigation solution on recorded sensors: track, innovations, sensor states, simulated outages."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.special import erfc

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Bars, Frame, Item, Line, Mark, Points
from gmwm_jax._internal.figures import describe, entries_of, frames, legend_below, put
from gmwm_jax._internal.palette import COLOURS
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import Gnss, GnssPosition
from nav_jax.filter.layout import ON_CHANNELS
from nav_jax.imu.channels import CHANNELS
from nav_jax.plotting._style import (
    DEGREES,
    INK,
    TIME,
    along_time,
    beside_title,
    draw,
    grid,
    height_frame,
    outage_items,
    plan_and_height,
    plan_frame,
    shade,
    without_outages,
)
from nav_jax.recorded.navigation import Navigation

_TRACK, _FIX, _KEPT, _BOUND, _UNSURE = COLOURS[0], COLOURS[3], COLOURS[1], COLOURS[1], "#9db8d6"
_WIDTH = 10.5
_ELLIPSES = 12
"""So many ellipses of uncertainty along a track, those at the ends of outages apart."""

_STATES = (("accel", "mm/s^2", 1e3), ("gyro", "deg/h", DEGREES * 3600))


def navigation_data(navigation: Navigation, *, sigmas: float = 3.0) -> tuple[Frame, Frame]:
    """Return what `plot_navigation` shows: plan and height.

    Parameters
    ----------
    navigation
        The solution.
    sigmas
        Size of ellipses and bounds in standard deviations.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> plan, height = nj.plotting.navigation_data(drive)
    """
    p, time = navigation.trajectory.position, navigation.time
    plan: list[Item] = []
    sd = np.maximum(navigation.sd[:, 2], 0.0)
    bound = f"±{sigmas:g} sd of the filter"
    height: list[Item] = [Band(bound, time, -p[:, 2] - sigmas * sd, -p[:, 2] + sigmas * sd)]
    for fixes in _positions(navigation):
        for label, chosen in (("fix", fixes.given), ("fix kept from the filter", ~fixes.given)):
            if chosen.any():
                north, east, down = fixes.value[chosen, :3].T
                plan.append(Points(label, east, north))
                height.append(Points(label, fixes.time[chosen], -down))
    plan.append(Line("navigation", p[:, 1], p[:, 0]))
    height.append(Line("navigation", time, -p[:, 2]))
    plan += _ellipses(navigation, sigmas)
    return plan_frame(plan), height_frame([*height, *outage_items(_outages(navigation))])


def _positions(navigation: Navigation) -> list[Fixes]:
    return [f for f in navigation.fixes if isinstance(f.sensor, GnssPosition | Gnss)]


def _outages(navigation: Navigation) -> tuple[tuple[float, float], ...]:
    """Of all sensors, each once."""
    return tuple(dict.fromkeys(pair for f in navigation.fixes for pair in f.outages))


def _ellipses(navigation: Navigation, sigmas: float) -> list[Item]:
    """Uncertainty along the axes at some epochs: evenly in time, and at the ends of outages."""
    time, p = navigation.time, navigation.trajectory.position
    at = [*np.linspace(time[0], time[-1], _ELLIPSES), *(end for _, end in _outages(navigation))]
    before = np.append(time, np.inf)  # the last epoch before a fix at the end of an outage is that end itself
    rows = np.unique(np.clip(np.searchsorted(before, np.array(at) + 1e-9) - 1, 0, len(time) - 1))
    angle = np.linspace(0.0, 2 * np.pi, 49)
    return [
        Line(
            "" if i else f"±{sigmas:g} sd of the filter",
            p[k, 1] + sigmas * navigation.sd[k, 1] * np.cos(angle),
            p[k, 0] + sigmas * navigation.sd[k, 0] * np.sin(angle),
        )
        for i, k in enumerate(rows)
    ]


@draw.register(Navigation)
def plot_navigation(navigation: Navigation, *, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
    """Plot the track with the fixes of positions, and what the filter says of its uncertainty: plan and height.

    Parameters
    ----------
    navigation
        The solution.
    sigmas
        Size of ellipses (along north and east, at some epochs and at the ends of outages) and bounds in standard
        deviations.
    axes
        Two Axes to draw into, plan and height; a new figure if left out.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> drive.plot().savefig("track.png")
    """
    shown = navigation_data(navigation, sigmas=sigmas)
    figure, drawn = plan_and_height(axes, shown)
    for ax, frame in zip(drawn, shown, strict=True):
        for item in without_outages(frame):
            if isinstance(item, Band):
                put(ax, item, color=_UNSURE, alpha=0.6)
            elif isinstance(item, Points):
                kept = item.label != "fix"
                put(ax, item, color=_KEPT if kept else _FIX, marker="x" if kept else ".", ms=4, ls="")
            elif item.label == "navigation":
                put(ax, item, color=_TRACK, lw=1.3)
            else:
                put(ax, item, color=_UNSURE, lw=1.0)
        shade(ax, frame)
    drawn[1].margins(x=0)
    legend_below(figure, drawn, alone=axes is None)
    return figure


def innovations_data(navigation: Navigation, *, sigmas: float = 3.0) -> tuple[Frame, ...]:
    """Return what `plot_innovations` shows: innovations of each component over what the filter says of them.

    Parameters
    ----------
    navigation
        The solution.
    sigmas
        Bounds are that many standard deviations of the filter away.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> len(nj.plotting.innovations_data(drive))
    3
    """
    if not navigation.fixes:
        raise ValueError("Without aiding there are no innovations.")
    shown = []
    for fixes in navigation.fixes:
        name = fixes.sensor.name
        time, nu, sd = fixes.time[fixes.given], navigation.innovation[name], navigation.innovation_sd[name]
        for k, (axis, unit) in enumerate(zip(fixes.sensor.axes, fixes.sensor.units, strict=True)):
            ratio = nu[:, k] / sd[:, k]
            rms, share = np.sqrt(np.mean(ratio**2)), 100 * np.mean(np.abs(ratio) > sigmas)
            size = f"sd {np.median(sd[:, k]):.2g} {unit} in the median"
            title = f"{name} {axis}: {size}\nrms {rms:.2f} of 1, outside {share:.1f} % of {_outside(sigmas):.1f} %"
            bounds = (Mark(f"±{sigmas:g} sd", sigmas, "y"), Mark("", -sigmas, "y"))
            items = (Points("innovation", time, ratio), *bounds, *outage_items(fixes.outages))
            shown.append(Frame(title, TIME, Axis("innovation / its sd", ""), items))
    return tuple(shown)


def _outside(sigmas: float) -> float:
    """Per cent of a Gaussian variable outside so many standard deviations."""
    return 100 * float(erfc(sigmas / np.sqrt(2)))


def plot_innovations(navigation: Navigation, *, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
    """Plot the innovations of all sensors over what the filter says of them, and how large they are and should be.

    Parameters
    ----------
    navigation
        The solution.
    sigmas
        Bounds are that many standard deviations of the filter away.
    axes
        An Axes for each component of each sensor, in their order; a new figure if left out.

    Raises
    ------
    ValueError
        There is no aiding.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> nj.plotting.plot_innovations(drive).savefig("innovations.png")
    """
    shown = innovations_data(navigation, sigmas=sigmas)
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    figure, drawn = frames(axes, rows, columns, (4.0 * columns, 1.0 + 2.1 * rows), num=len(shown))
    for ax, frame in zip(drawn, shown, strict=True):
        points, *bounds = without_outages(frame)
        put(ax, points, color=_TRACK, marker=".", ms=3, ls="")
        for bound in bounds:
            put(ax, bound, color=_BOUND, lw=1.1)
        describe(ax, frame, fontsize=9)
        along_time(ax, frame)
    legend_below(figure, drawn, alone=axes is None)
    return figure


def sensor_estimates_data(navigation: Navigation, *, sigmas: float = 3.0) -> tuple[Frame, ...]:
    """Return what `plot_sensor_estimates` shows: three rows, of which each has accelerometer and gyroscope.

    Parameters
    ----------
    navigation
        The solution.
    sigmas
        Bounds are that many standard deviations of the filter away.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04) + RW(gamma2=1e-8)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [], filter, **start, initial=nj.InitialUncertainty())
    >>> len(nj.plotting.sensor_estimates_data(drive))
    6
    """
    time, outages = navigation.time, outage_items(_outages(navigation))
    shown = []
    for i, axis in enumerate("xyz"):
        for block, unit, factor in _STATES:
            c = CHANNELS.index(f"{block} {axis}")
            x, sd = factor * navigation.sensor_errors[:, c], factor * navigation.sd[:, ON_CHANNELS][:, c]
            items: list[Item] = [Line("estimated error", time, x)]
            if sd.any():
                items.insert(0, Band(f"±{sigmas:g} sd of the filter", time, x - sigmas * sd, x + sigmas * sd))
            title = {"accel": "accelerometer", "gyro": "gyroscope"}[block] if i == 0 else ""
            shown.append(Frame(title, TIME, Axis(axis, unit), (*items, *outages)))
    return tuple(shown)


def plot_sensor_estimates(navigation: Navigation, *, sigmas: float = 3.0, axes: GivenAxes | None = None) -> Figure:
    """Plot the estimated errors of the six axes of the IMU with the bounds of the filter.

    Parameters
    ----------
    navigation
        The solution. An axis without a state is zero and has no bounds.
    sigmas
        Bounds are that many standard deviations of the filter away.
    axes
        Six Axes to draw into, of shape (3, 2); a new figure if left out.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04) + RW(gamma2=1e-8)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [], filter, **start, initial=nj.InitialUncertainty())
    >>> nj.plotting.plot_sensor_estimates(drive).savefig("sensors.png")
    """
    shown = sensor_estimates_data(navigation, sigmas=sigmas)
    figure, drawn = frames(axes, 3, 2, (_WIDTH, 6.6), sharex=True)
    for ax, frame in zip(drawn, shown, strict=True):
        *bands, line = without_outages(frame)
        for band in bands:
            put(ax, band, color=_UNSURE, alpha=0.7)
        put(ax, line, color=_TRACK, lw=1.2)
        if not bands:
            beside_title(ax, "no state", _BOUND)
        describe(ax, frame)
        along_time(ax, frame)
    legend_below(figure, drawn, alone=axes is None)
    figure.align_ylabels()
    return figure


def withheld_data(navigation: Navigation) -> tuple[Frame, ...]:
    """Return what `plot_withheld` shows: of each sensor with outages, the errors in them, and those at their ends.

    Parameters
    ----------
    navigation
        The solution.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02, outages=[(4.0, 7.0)])
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> [frame.x.label for frame in nj.plotting.withheld_data(drive)]
    ['time since the outage began', 'horizontal error']
    """
    if not navigation.withheld:
        raise ValueError("No fix was kept from the filter: give outages of a sensor.")
    shown = []
    for name, w in navigation.withheld.items():
        what = "horizontal error" if len(w.judged) < len(w.axes) else "error"
        items: list[Item] = []
        rows = w.rows()
        for i, row in enumerate(rows):
            inside = (w.time >= row["start"] - 1e-6) & (w.time <= row["end"] + 1e-6)
            since = w.time[inside] - row["start"]
            items.append(Line("" if i else "predicted - measured", since, w.size[inside]))
            items.append(Line("" if i else "claimed (rms)", since, w.claimed[inside]))
        size = Axis(what, w.unit.partition(",")[0])
        shown.append(
            Frame(f"{name}: {len(rows)} outages", Axis("time since the outage began", "s"), size, tuple(items))
        )
        number = np.arange(len(rows), dtype=float)
        claimed, error = (np.array([row[k] for row in rows]) for k in ("claimed", "error"))
        labels = tuple(f"{row['start']:g}" for row in rows)
        bars = Bars("claimed (rms)", claimed, number, 0 * claimed, claimed, lying=True)
        rows_down = Axis("outage from, s", "", names=labels)
        shown.append(
            Frame(f"{name}: at the end", size, rows_down, (bars, Points("predicted - measured", error, number)))
        )
    return tuple(shown)


def plot_withheld(navigation: Navigation, *, axes: GivenAxes | None = None) -> Figure:
    """Plot errors in simulated outages, against the fixes that were kept from the filter, beside what it claims.

    Parameters
    ----------
    navigation
        The solution.
    axes
        Two Axes for each sensor with outages; a new figure if left out.

    Raises
    ------
    ValueError
        There is no outage.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02, outages=[(4.0, 7.0)])
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20])
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> drive = nj.navigate(samples, [fixes], filter, **start, initial=nj.InitialUncertainty())
    >>> nj.plotting.plot_withheld(drive).savefig("outages.png")
    """
    shown = withheld_data(navigation)
    figure, drawn = frames(axes, len(shown) // 2, 2, (_WIDTH, 1.3 + 1.7 * len(shown)))
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame)
        for i, item in enumerate(frame.items):
            if isinstance(item, Line):  # of each outage the error and what was claimed
                put(ax, item, color=COLOURS[i // 2 % len(COLOURS)], lw=1.2, ls="--" if i % 2 else "-")
            elif isinstance(item, Bars):
                put(ax, item, color=_UNSURE, fmt="|", elinewidth=7)
            else:
                put(ax, item, color=INK, marker="o", ls="")
        if frame.y.names:
            ax.set_yticks(range(len(frame.y.names)), frame.y.names)
            for i, number in enumerate(ax.get_yticklabels()):
                number.set_color(COLOURS[i % len(COLOURS)])
            ax.set_ylim(len(frame.y.names) - 0.5, -0.5)
            ax.set_xlim(left=0.0)
        else:
            ax.margins(x=0)
            ax.set_ylim(bottom=0.0)
        grid(ax)
    lines: dict[str, Any] = {"predicted - measured": "-", "claimed (rms)": "--"}
    entries = {label: Line2D([], [], color=INK, ls=ls) for label, ls in lines.items()}
    ends = {f"{label}, at the end": handle for label, handle in entries_of(drawn[1]).items()}
    colours = {"title": "colour: the outage", "title_fontsize": 8}
    legend_below(figure, drawn, alone=axes is None, entries=entries | ends, **colours)
    return figure
