"""Figures of wavelet variances, classic and robust, and of Allan deviations."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line, Mark, Points, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax.fitting.slopes import SlopeRegression, read_off
from gmwm_jax.plotting._style import (
    DATA,
    DATASHEET,
    FIT,
    band_title,
    by_unit,
    component_style,
    datasheet_items,
    draw,
    draw_datasheet,
    draw_variance,
    draw_variances,
    finish_log_log,
    in_standard_units,
    large_and_small,
    legend,
    lowest,
    members_by_unit,
    scale_axis,
    title_of,
    variance_axis,
    variance_items,
)
from gmwm_jax.processes.datasheet import Datasheet
from gmwm_jax.variance.allan import FLICKER_FLOOR, AllanDeviation
from gmwm_jax.variance.robust_comparison import RobustComparison
from gmwm_jax.variance.stability import StabilityDeviation
from gmwm_jax.variance.wavelet import AbstractWaveletVariance, WaveletVariance

_COMPARED = ((DATA, "o"), (FIT, "x"), (DATASHEET, "^"))
"""Colour and marker of the classic, the robust and the cleaned wavelet variance."""

_READ = {"N": "D", "B": "s", "K": "^"}
"""Markers of what is read off an Allan deviation."""


def wavelet_variance_data(wv: AbstractWaveletVariance, *, datasheet: Datasheet | None = None) -> tuple[Frame, ...]:
    """Return what `plot_wavelet_variance` shows: a frame for each unit.

    Parameters
    ----------
    wv
        Wavelet variance of one or several channels.
    datasheet
        A model of what the datasheet promises; by unit if there are several.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.wavelet_variance_data(gj.wavelet_variance(rec))
    """
    models = by_unit(datasheet, wv.units)
    shown = []
    for unit, members in members_by_unit(wv).items():
        items: list[Item] = []
        for i in members:
            items += variance_items(wv[i], "wavelet variance" if len(members) == 1 else wv.channels[i])
        items += datasheet_items(wv[members[0]], models)
        shown.append(Frame(title_of(wv, members), scale_axis(wv), variance_axis(unit), tuple(items)))
    return tuple(shown)


@draw.register(AbstractWaveletVariance)
def plot_wavelet_variance(
    wv: AbstractWaveletVariance, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Plot the wavelet variance over scale with its confidence band; channels of one unit share a frame.

    Parameters
    ----------
    wv
        Wavelet variance of one or several channels.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        An Axes for each unit to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_wavelet_variance(gj.wavelet_variance(rec))
    >>> figure.savefig("wavelet_variance.png")
    """
    shown = wavelet_variance_data(wv, datasheet=datasheet)
    figure, drawn = frames(axes, 1, len(shown), (0.6 + 6 * len(shown), 4.6))
    for ax, frame in zip(drawn, shown, strict=True):
        draw_datasheet(ax, draw_variances(ax, frame))
        legend(ax, wv.shown)
    return figure


def robust_comparison_data(
    comparison: RobustComparison, *, cleaned: WaveletVariance | None = None
) -> tuple[Frame, Frame]:
    """Return what `plot_robust_comparison` shows: the variances, and their difference in standard errors.

    Parameters
    ----------
    comparison
        Of one channel.
    cleaned
        The wavelet variance of the same channel without its outliers, see `mask_outliers`.

    Examples
    --------
    >>> x = np.array(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> x[700] = 50.0
    >>> frames = gj.plotting.robust_comparison_data(gj.variance.compare_robust(x))
    """
    classic, robust, differs = comparison.classic, comparison.robust, comparison.significant
    items = variance_items(classic, "classic") + variance_items(robust, f"robust, efficiency {robust.efficiency:g}")
    if cleaned is not None:
        items += variance_items(cleaned, f"cleaned: {cleaned.missing or 'none missing'}")
    share = 100 * comparison.num_outliers / (classic.num_samples or 1)
    title = f"{title_of(classic, [0])}: {comparison.num_outliers} outlying samples ({share:.2g} %)"
    z = (
        Span("± 2 standard errors of a clean record", -2.0, 2.0, "y"),
        Mark("", 0.0, "y"),
        Points("", classic.times[~differs], comparison.z[~differs]),
        Points("differs", classic.times[differs], comparison.z[differs]),
    )
    return (
        Frame(title, scale_axis(classic), variance_axis(classic.units[0]), tuple(items)),
        Frame("", scale_axis(classic), Axis("log ratio", "standard errors", "symlog"), z),
    )


@draw.register(RobustComparison)
def plot_robust_comparison(
    comparison: RobustComparison, *, cleaned: WaveletVariance | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Plot the classic and the robust wavelet variance with their bands; below, their difference in standard errors.

    Parameters
    ----------
    comparison
        Of one channel.
    cleaned
        A third curve: the wavelet variance of the same channel without its outliers, see `mask_outliers`.
    axes
        Two Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> x = np.array(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> x[700] = 50.0
    >>> figure = gj.plotting.plot_robust_comparison(gj.variance.compare_robust(x))
    >>> figure.savefig("robust_comparison.png")
    """
    above, below = robust_comparison_data(comparison, cleaned=cleaned)
    figure, (top, bottom) = large_and_small(axes)
    finish_log_log(top, above)
    for i, (colour, marker) in zip(range(0, len(above.items), 2), _COMPARED, strict=False):
        draw_variance(top, above.items[i : i + 2], colour, marker)
    top.set_title(above.title, fontsize=10)
    top.set_xlabel("")
    describe(bottom, below, apart="\n")
    clean, zero, same, differs = below.items
    put(bottom, clean, color="0.5", alpha=0.15)
    put(bottom, zero, color="0.4", lw=0.8)
    put(bottom, same, marker="o", ls="", color="0.4", ms=4)
    put(bottom, differs, marker="o", ls="", color=FIT, ms=4)
    bottom.set_xscale(below.x.scale)
    in_standard_units(bottom)
    legend_below(figure, (top, bottom), alone=axes is None, **band_title(comparison.classic.shown))
    return figure


def allan_deviation_data(
    adev: AllanDeviation, *, regression: SlopeRegression | None = None, readings: bool = True
) -> tuple[Frame, ...]:
    """Return what `plot_allan_deviation` shows: a frame for each unit.

    Parameters
    ----------
    adev
        One or several channels.
    regression
        Slopes, and the deviation they imply together; of one channel.
    readings
        Show what `gmwm_jax.fitting.read_off` reads, where there is no regression: the points of N, B and
        K, and in a frame of one channel their lines of slope -1/2, 0 and +1/2.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.allan_deviation_data(gj.allan_deviation(rec))
    """
    wv = adev.wv
    if regression is not None and not isinstance(wv, WaveletVariance):
        raise ValueError(f"Slopes belong to one channel: choose it, as in adev[{wv.channels[0]!r}].plot(...).")
    shown = []
    for unit, members in members_by_unit(wv).items():
        items: list[Item] = []
        for i in members:
            one, label = adev[i], "overlapping Allan deviation" if len(members) == 1 else wv.channels[i]
            items += [Band("", one.times, one.shown.low, one.shown.high), Line(label, one.times, one.deviation)]
        if regression is not None:
            times, tau = regression.adev.times, regression.adev.wv.scales
            for label, p in zip(regression.model.labels, regression.model.processes, strict=True):
                items.append(Line(label, times, np.sqrt(2 * np.asarray(p.wavelet_variance(tau)))))
            items.append(Line("sum", times, np.asarray(regression.implied_deviation)))
        elif readings:
            items += _read_off([adev[i] for i in members])
        time, deviation = Axis("averaging time T", "s", "log"), Axis("Allan deviation", unit, "log")
        shown.append(Frame(title_of(wv, members), time, deviation, tuple(items)))
    return tuple(shown)


def stability_deviation_data(deviation: StabilityDeviation) -> tuple[Frame, ...]:
    """Return what `plot_stability_deviation` shows: a frame for each unit.

    Parameters
    ----------
    deviation
        One or several channels.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.stability_deviation_data(gj.variance.hadamard_deviation(rec))
    """
    shown = []
    for unit, members in members_by_unit(deviation).items():
        items: list[Item] = []
        for i in members:
            one = deviation[i]
            label = f"overlapping {deviation.kind} deviation" if len(members) == 1 else deviation.channels[i]
            items += [Band("", one.times, one.ci_low, one.ci_high), Line(label, one.times, one.deviation)]
        time, value = Axis("averaging time T", "s", "log"), Axis(f"{deviation.kind} deviation", unit, "log")
        shown.append(Frame(title_of(deviation, members), time, value, tuple(items)))
    return tuple(shown)


@draw.register(StabilityDeviation)
def plot_stability_deviation(deviation: StabilityDeviation, *, axes: GivenAxes | None = None) -> Figure:
    """Plot a modified Allan or Hadamard deviation over averaging time with its confidence band.

    Parameters
    ----------
    deviation
        One or several channels; channels of one unit share a frame.
    axes
        An Axes for each unit to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_stability_deviation(gj.variance.hadamard_deviation(rec))
    >>> figure.savefig("hadamard_deviation.png")
    """
    shown = stability_deviation_data(deviation)
    figure, drawn = frames(axes, 1, len(shown), (0.6 + 6 * len(shown), 4.6))
    for ax, frame in zip(drawn, shown, strict=True):
        draw_variances(ax, frame)
        legend(ax, deviation.shown)
    return figure


def _read_off(adevs: list[AllanDeviation]) -> list[Item]:
    """What is read off some channels, at the times at which it is read; with the lines if there is one channel."""
    lines: list[Item] = []
    points: dict[str, list[tuple[float, float]]] = {}
    for adev in adevs:
        T = adev.times
        if len(T) < 3 or not np.all(adev.deviation > 0):
            continue
        unit_lines = {"N": T**-0.5, "B": np.full_like(T, FLICKER_FLOOR), "K": np.sqrt(T / 3)}
        for si, shown in zip(read_off(adev), read_off(adev, datasheet=True), strict=True):
            if np.isnan(si.value):
                continue
            line = si.value * unit_lines[si.symbol]
            bound = "≤" if str(si.note).startswith("an upper bound") else "="
            lines.append(Line(f"{si.symbol} {bound} {shown.value:.4g} {shown.unit}", T, line))
            at = int(np.argmin(np.abs(np.log(line / adev.deviation))))  # where it was read they are the same
            points.setdefault(si.symbol, []).append((T[at], line[at]))
    read: list[Item] = [Points(f"{symbol} is read here", *np.array(at).T) for symbol, at in points.items()]
    return [*(lines if len(adevs) == 1 else []), *read]


@draw.register(AllanDeviation)
def plot_allan_deviation(
    adev: AllanDeviation,
    *,
    regression: SlopeRegression | None = None,
    readings: bool = True,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot the Allan deviation over averaging time with its confidence band.

    Parameters
    ----------
    adev
        One or several channels; channels of one unit share a frame.
    regression
        Slopes to draw, and the deviation they imply together; of one channel.
    readings
        Draw what `gmwm_jax.fitting.read_off` reads, where there is no regression: the points of N, B and
        K, and in a frame of one channel their lines of slope -1/2, 0 and +1/2.
    axes
        An Axes for each unit to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_allan_deviation(gj.allan_deviation(rec))
    >>> figure.savefig("allan_deviation.png")
    """
    shown = allan_deviation_data(adev, regression=regression, readings=readings)
    figure, drawn = frames(axes, 1, len(shown), (0.6 + 6 * len(shown), 4.6))
    for ax, frame in zip(drawn, shown, strict=True):
        more = draw_variances(ax, frame)
        lines = [i for i in more if isinstance(i, Line)]
        total = lines.pop() if regression is not None else None
        for i, item in enumerate(lines):
            put(ax, item, **component_style(i))
        if total is not None:
            put(ax, total, color=FIT, lw=1.4)
        for item in more:
            if isinstance(item, Points):
                put(ax, item, marker=_READ[item.label[0]], ls="", color="0.15", ms=6, mfc="white", zorder=3)
        if more:
            bands = [i for i in frame.items if isinstance(i, Band)]
            curves = [i for i in frame.items if isinstance(i, Line)][: len(bands)]
            bottom = min(lowest(b.low, c.y) for b, c in zip(bands, curves, strict=True))
            ax.set_ylim(bottom / 3, max(np.max(b.high) for b in bands) * 3)
        legend(ax, adev.shown)
    return figure
