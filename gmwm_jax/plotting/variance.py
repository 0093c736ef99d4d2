"""Figures of wavelet variances, classic and robust, and of Allan deviations."""

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes
from gmwm_jax.fitting.slopes import SlopeRegression
from gmwm_jax.plotting._style import (
    COMPONENTS,
    DATA,
    DATASHEET,
    FIT,
    Datasheet,
    by_unit,
    coloured,
    draw,
    draw_datasheet,
    draw_variance,
    finish_variance,
    large_and_small,
    legend,
    lowest,
    pretty,
    time_label,
    title_of,
    unit_frames,
)
from gmwm_jax.variance.allan import AllanDeviation
from gmwm_jax.variance.robust_comparison import RobustComparison
from gmwm_jax.variance.wavelet import WaveletVariance


@draw.register(WaveletVariance)
def plot_wavelet_variance(
    wv: WaveletVariance, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Wavelet variance over scale with its confidence band; channels of one unit share a frame.

    Parameters
    ----------
    wv
        Wavelet variance of one or several channels.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        An Axes for each unit to draw into; a new figure if left out.
    """
    models = by_unit(datasheet, wv.units)
    figure, drawn = unit_frames(wv, axes)
    for frame, unit, members in drawn:
        for colour, i, label in coloured(wv, members, "wavelet variance"):
            draw_variance(frame, wv[i], colour, label)
        if unit in models:
            draw_datasheet(frame, wv[members[0]], models[unit])
        finish_variance(frame, wv, unit)
        frame.set_title(title_of(wv, members))
    return figure


@draw.register(RobustComparison)
def plot_robust_comparison(
    comparison: RobustComparison, *, cleaned: WaveletVariance | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Classic and robust wavelet variance with their bands; below, their difference in standard errors.

    Parameters
    ----------
    comparison
        Of one channel.
    cleaned
        A third curve: the wavelet variance of the same channel without its outliers, see `mask_outliers`.
    axes
        Two Axes to draw into; a new figure if left out.
    """
    figure, (top, bottom) = large_and_small(axes)
    classic, robust = comparison.classic, comparison.robust
    draw_variance(top, classic, DATA, "classic")
    draw_variance(top, robust, FIT, f"robust, efficiency {robust.efficiency:g}")
    if cleaned is not None:
        draw_variance(top, cleaned, DATASHEET, f"cleaned: {cleaned.missing or 'none missing'}")
    finish_variance(top, classic, classic.units[0])
    top.set_xlabel("")
    share = 100 * comparison.num_outliers / (classic.num_samples or 1)
    top.set_title(f"{title_of(classic, [0])}: {comparison.num_outliers} outlying samples ({share:.2g} %)", fontsize=10)
    differs = comparison.significant
    bottom.axhspan(-2, 2, color="0.5", alpha=0.15, lw=0, label="± 2 standard errors of a clean record")
    bottom.axhline(0, color="0.4", lw=0.8)
    bottom.plot(classic.times[~differs], comparison.z[~differs], "o", color="0.4", ms=4)
    bottom.plot(classic.times[differs], comparison.z[differs], "o", color=FIT, ms=4, label="differs")
    bottom.set_yscale("symlog", linthresh=4)
    bottom.set_ylabel("log(classic/robust)\n[standard errors]")
    bottom.set_xlabel(time_label(classic))
    bottom.legend(fontsize=8, loc="best")
    return figure


@draw.register(AllanDeviation)
def plot_allan_deviation(
    adev: AllanDeviation, *, regression: SlopeRegression | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Allan deviation over averaging time with its confidence band.

    Parameters
    ----------
    adev
        One or several channels; channels of one unit share a frame.
    regression
        Slopes to draw, and the deviation they imply together; of one channel.
    axes
        An Axes for each unit to draw into; a new figure if left out.
    """
    wv = adev.wv
    if regression is not None and not wv.is_single:
        raise ValueError(f"Slopes belong to one channel: choose it, as in adev[{wv.channels[0]!r}].plot(...).")
    figure, drawn = unit_frames(wv, axes)
    for frame, unit, members in drawn:
        for colour, i, label in coloured(wv, members, "overlapping Allan deviation"):
            one = adev[i]
            frame.fill_between(one.times, one.ci_low, one.ci_high, color=colour, alpha=0.18, lw=0)
            frame.loglog(one.times, one.deviation, "o-", color=colour, ms=3.5, lw=1, label=label)
        if regression is not None:
            times, tau = regression.adev.times, regression.adev.wv.scales
            for colour, label, p in zip(
                cycle(COMPONENTS), regression.model.labels, regression.model.processes, strict=False
            ):
                line = np.sqrt(2 * np.asarray(p.wavelet_variance(tau)))
                frame.loglog(times, line, "--", color=colour, lw=1, label=label)
            frame.loglog(times, regression.implied_deviation, color=FIT, lw=1.4, label="sum")
            frame.set_ylim(lowest(adev.ci_low, adev.deviation) / 3, np.max(adev.ci_high) * 3)
        frame.set_xlabel("averaging time T [s]")
        frame.set_ylabel(f"Allan deviation [{pretty(unit)}]")
        frame.set_title(title_of(wv, members))
        legend(frame, wv.level)
    return figure
