"""Figures of wavelet variances, classic and robust, and of Allan deviations."""

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line, Mark, Points, Span
from gmwm_jax._internal.figures import GivenAxes, describe, frames, put
from gmwm_jax.fitting.slopes import SlopeRegression
from gmwm_jax.plotting._style import (
    COMPONENTS,
    DATA,
    DATASHEET,
    FIT,
    Datasheet,
    by_unit,
    datasheet_items,
    draw,
    draw_datasheet,
    draw_variance,
    draw_variances,
    finish_log_log,
    large_and_small,
    legend,
    lowest,
    members_by_unit,
    scale_axis,
    title_of,
    variance_axis,
    variance_items,
)
from gmwm_jax.variance.allan import AllanDeviation
from gmwm_jax.variance.robust_comparison import RobustComparison
from gmwm_jax.variance.wavelet import AbstractWaveletVariance, WaveletVariance


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
        legend(ax, wv.level)
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
        Frame("", scale_axis(classic), Axis("log(classic/robust)", "standard errors", "symlog"), z),
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
    for i, colour in zip(range(0, len(above.items), 2), (DATA, FIT, DATASHEET), strict=False):
        draw_variance(top, above.items[i : i + 2], colour)
    top.set_title(above.title, fontsize=10)
    top.set_xlabel("")
    legend(top, comparison.classic.level)
    describe(bottom, below, apart="\n")
    clean, zero, same, differs = below.items
    put(bottom, clean, color="0.5", alpha=0.15)
    put(bottom, zero, color="0.4", lw=0.8)
    put(bottom, same, marker="o", ls="", color="0.4", ms=4)
    put(bottom, differs, marker="o", ls="", color=FIT, ms=4)
    bottom.set_xscale(below.x.scale)
    bottom.set_yscale(below.y.scale, linthresh=4)
    bottom.legend(fontsize=8, loc="best")
    return figure


def allan_deviation_data(adev: AllanDeviation, *, regression: SlopeRegression | None = None) -> tuple[Frame, ...]:
    """Return what `plot_allan_deviation` shows: a frame for each unit.

    Parameters
    ----------
    adev
        One or several channels.
    regression
        Slopes, and the deviation they imply together; of one channel.

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
            items += [Band("", one.times, one.ci_low, one.ci_high), Line(label, one.times, one.deviation)]
        if regression is not None:
            times, tau = regression.adev.times, regression.adev.wv.scales
            for label, p in zip(regression.model.labels, regression.model.processes, strict=True):
                items.append(Line(label, times, np.sqrt(2 * np.asarray(p.wavelet_variance(tau)))))
            items.append(Line("sum", times, np.asarray(regression.implied_deviation)))
        time, deviation = Axis("averaging time T", "s", "log"), Axis("Allan deviation", unit, "log")
        shown.append(Frame(title_of(wv, members), time, deviation, tuple(items)))
    return tuple(shown)


@draw.register(AllanDeviation)
def plot_allan_deviation(
    adev: AllanDeviation, *, regression: SlopeRegression | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Plot the Allan deviation over averaging time with its confidence band.

    Parameters
    ----------
    adev
        One or several channels; channels of one unit share a frame.
    regression
        Slopes to draw, and the deviation they imply together; of one channel.
    axes
        An Axes for each unit to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_allan_deviation(gj.allan_deviation(rec))
    >>> figure.savefig("allan_deviation.png")
    """
    shown = allan_deviation_data(adev, regression=regression)
    figure, drawn = frames(axes, 1, len(shown), (0.6 + 6 * len(shown), 4.6))
    for ax, frame in zip(drawn, shown, strict=True):
        if slopes := draw_variances(ax, frame):
            for item, colour in zip(slopes[:-1], cycle(COMPONENTS), strict=False):
                put(ax, item, color=colour, lw=1, ls="--")
            put(ax, slopes[-1], color=FIT, lw=1.4)
            ax.set_ylim(lowest(adev.ci_low, adev.deviation) / 3, np.max(adev.ci_high) * 3)
        legend(ax, adev.wv.level)
    return figure
