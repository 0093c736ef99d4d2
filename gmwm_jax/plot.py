"""Figures: log-log variances with their bands, fits with their components, residuals by scale. A leaf.

Every function draws into a given Axes, or makes a Figure and returns it; none shows or saves anything.
"""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax.allan import AllanDeviation, SlopeRegression
from gmwm_jax.processes._base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recording import Recording
from gmwm_jax.result import Fit, Fits
from gmwm_jax.variance import WaveletVariance

_DATA, _FIT, _DATASHEET = "#1f4e79", "#c23b22", "#5b8c2a"
_COMPONENTS = ("#e08e0b", "#7a4f9a", "#2a8f8f", "#b5628c", "#8c6d31", "#4f7fbf", "#6b6b6b")
_MAX_POINTS = 4000
"""In a time series: more are drawn as the band between minima and maxima."""


def plot_recording(rec: Recording) -> Figure:
    """Each channel against time; a long record as the range of the samples in each of a few thousand bins.

    Parameters
    ----------
    rec
        The recording.
    """
    figure, axes = plt.subplots(
        rec.num_channels, 1, sharex=True, squeeze=False, figsize=(9, 1.2 + 1.6 * rec.num_channels), layout="constrained"
    )
    for ax, (i, name) in zip(axes[:, 0], enumerate(rec.channels), strict=True):
        x = rec.data[:, i]
        if len(x) <= _MAX_POINTS:
            ax.plot(np.arange(len(x)) / rec.rate, x, color=_DATA, lw=0.7)
        else:
            size = len(x) // (_MAX_POINTS // 2)
            bins = x[: len(x) // size * size].reshape(-1, size)
            t = (np.arange(len(bins)) + 0.5) * size / rec.rate
            ax.fill_between(t, bins.min(1), bins.max(1), color=_DATA, alpha=0.45, lw=0, label="min .. max")
            ax.plot(t, bins.mean(1), color=_FIT, lw=0.7, label=f"mean of {size} samples")
        ax.set_ylabel(f"{name}\n[{_pretty(rec.units[i])}]")
        ax.margins(x=0)
    if len(rec) > _MAX_POINTS:
        axes[0, 0].legend(loc="upper right", fontsize=8, ncols=2)
    axes[-1, 0].set_xlabel("time [s]")
    axes[0, 0].set_title(f"{rec.name or 'recording'}: {len(rec)} samples at {rec.rate:g} Hz")
    return figure


def plot_wavelet_variance(wv: WaveletVariance, *, ax: Axes | None = None, datasheet: Any = None) -> Figure:
    """Wavelet variance over scale with its confidence band; several channels in one frame if their units agree.

    Parameters
    ----------
    wv
        Wavelet variance of one or several channels.
    ax
        Where to draw (one unit only); a new figure if left out.
    datasheet
        A model of what the datasheet promises, drawn as a line.
    """
    groups = list(dict.fromkeys(wv.units))
    figure, axes = _frames(ax, len(groups))
    for frame, unit in zip(axes, groups, strict=True):
        members = [i for i, u in enumerate(wv.units) if u == unit]
        colours = [_DATA] if len(members) == 1 else _COMPONENTS
        for colour, i in zip(colours, members, strict=False):
            _draw_variance(frame, wv[i], colour, wv.channels[i] if len(members) > 1 else "wavelet variance")
        if datasheet is not None:
            _draw_datasheet(frame, wv[members[0]], datasheet)
        _finish_variance(frame, wv, unit)
        frame.set_title(wv.name or ", ".join(wv.channels[i] for i in members))
    return figure


def plot_allan_deviation(
    adev: AllanDeviation, *, ax: Axes | None = None, regression: SlopeRegression | None = None
) -> Figure:
    """Allan deviation over averaging time with its confidence band.

    Parameters
    ----------
    adev
        One or several channels; one frame a unit.
    ax
        Where to draw (one unit only).
    regression
        Slopes to draw, and the deviation they imply together.
    """
    wv = adev.wv
    groups = list(dict.fromkeys(wv.units))
    figure, axes = _frames(ax, len(groups))
    for frame, unit in zip(axes, groups, strict=True):
        members = [i for i, u in enumerate(wv.units) if u == unit]
        colours = [_DATA] if len(members) == 1 else _COMPONENTS
        for colour, i in zip(colours, members, strict=False):
            one = adev[i]
            label = wv.channels[i] if len(members) > 1 else "overlapping Allan deviation"
            frame.fill_between(one.times, one.ci_low, one.ci_high, color=colour, alpha=0.18, lw=0)
            frame.loglog(one.times, one.deviation, "o-", color=colour, ms=3.5, lw=1, label=label)
        if regression is not None:
            tau = regression.adev.wv.scales
            for colour, label, p in zip(_COMPONENTS, regression.model.labels, regression.model.processes, strict=False):
                line = np.sqrt(2 * np.asarray(p.wavelet_variance(tau)))
                frame.loglog(regression.adev.times, line, "--", color=colour, lw=1, label=label)
            frame.loglog(regression.adev.times, regression.implied_deviation, color=_FIT, lw=1.4, label="sum")
            low, high = np.min(adev.ci_low), np.max(adev.ci_high)
            frame.set_ylim(low / 3, high * 3)
        frame.set_xlabel("averaging time T [s]")
        frame.set_ylabel(f"Allan deviation [{_pretty(unit)}]")
        frame.set_title(wv.name or ", ".join(wv.channels[i] for i in members))
        _legend(frame, wv.level)
    return figure


def plot_fit(fit: Fit, *, datasheet: Any = None, axes: Sequence[Axes] | None = None) -> Figure:
    """Wavelet variance, fit and components over scale; below, the residuals in half widths of the confidence interval.

    Parameters
    ----------
    fit
        The fit of one channel.
    datasheet
        A model of what the datasheet promises, drawn as a line.
    axes
        Two Axes to draw into; a new figure if left out.
    """
    if axes is None:
        figure, (top, bottom) = plt.subplots(
            2, 1, sharex=True, figsize=(7, 6.6), height_ratios=(3, 1), layout="constrained"
        )
    else:
        top, bottom = axes
        figure = _figure_of(top)
    wv = fit.wv
    _draw_variance(top, wv, _DATA, "wavelet variance")
    # theory is drawn between the scales too, at even spans
    dense = np.unique(2 * np.round(np.geomspace(wv.scales[0], wv.scales[-1], 200) / 2))
    t = dense / (wv.rate or 1.0)
    top.loglog(t, np.asarray(fit.model.wavelet_variance(dense)), color=_FIT, lw=1.6, label="fit", zorder=3)
    for colour, label, p in zip(_COMPONENTS, fit.model.labels, fit.model.processes, strict=False):
        if float(p.amplitude) > 0:
            top.loglog(t, np.asarray(p.wavelet_variance(dense)), "--", color=colour, lw=1, label=label)
        else:
            top.plot([], [], "--", color=colour, lw=1, label=f"{label}: zero")
    if datasheet is not None:
        _draw_datasheet(top, wv, datasheet)
    _finish_variance(top, wv, wv.units[0])
    top.set_xlabel("")
    top.set_ylim(np.min(wv.ci_low) / 4, np.max(wv.ci_high) * 3)
    top.set_title(f"{wv.channels[0]}: {' + '.join(fit.model.labels)}, objective {fit.objective:.5g}")
    half = np.where(fit.residuals > 0, wv.variance - wv.ci_low, wv.ci_high - wv.variance)
    bottom.axhspan(-1, 1, color=_DATA, alpha=0.12, lw=0, label=f"{100 * wv.level:g} % interval of one scale")
    bottom.axhline(0, color="0.4", lw=0.8)
    bottom.plot(wv.times, fit.residuals / half, "o", color=_FIT, ms=4)
    bottom.set_ylabel("residual\n[half CI]")
    bottom.set_xlabel(_time_label(wv))
    bottom.legend(fontsize=8, loc="best")
    limit = max(1.3, 1.15 * float(np.max(np.abs(fit.residuals / half))))
    bottom.set_ylim(-limit, limit)
    return figure


def plot_fits(fits: Fits, *, datasheet: Any = None) -> Figure:
    """One panel a channel, see `plot_fit`."""
    num = len(fits)
    columns = min(num, 3)
    rows = -(-num // columns)
    figure = plt.figure(figsize=(4.6 * columns, 4.9 * rows), layout="constrained")
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3, 1] * rows)
    for i, fit in enumerate(fits.values()):
        row, column = divmod(i, columns)
        top = figure.add_subplot(grid[2 * row, column])
        bottom = figure.add_subplot(grid[2 * row + 1, column], sharex=top)
        plot_fit(fit, datasheet=datasheet, axes=(top, bottom))
        top.set_title(f"{fit.wv.channels[0]}, objective {fit.objective:.5g}", fontsize=10)
        top.tick_params(labelbottom=False)
        for legend in (top.get_legend(), bottom.get_legend()):
            if i and legend is not None:
                legend.remove()
    return figure


def _draw_variance(ax: Axes, wv: WaveletVariance, colour: str, label: str) -> None:
    ax.fill_between(wv.times, wv.ci_low, wv.ci_high, color=colour, alpha=0.18, lw=0)
    ax.loglog(wv.times, wv.variance, "o-", color=colour, ms=3.5, lw=1, label=label)


def _draw_datasheet(ax: Axes, wv: WaveletVariance, datasheet: str | AbstractProcess | Composite) -> None:
    nu = np.asarray(as_model(datasheet).wavelet_variance(wv.scales))
    ax.loglog(wv.times, nu, "-.", color=_DATASHEET, lw=1.4, label="datasheet")


def _finish_variance(ax: Axes, wv: WaveletVariance, unit: str) -> None:
    ax.set_xlabel(_time_label(wv))
    ax.set_ylabel(f"wavelet variance [({_pretty(unit)})²]")
    _legend(ax, wv.level)


def _legend(ax: Axes, level: float) -> None:
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(fontsize=8, title=f"band: {100 * level:g} % interval", title_fontsize=8, ncols=1 + (len(handles) > 5))


def _time_label(wv: WaveletVariance) -> str:
    return "scale τ [s]" if wv.rate else "scale τ [samples]"


def _pretty(unit: str) -> str:
    return unit.replace("^2", "²").replace("^3", "³")


def _frames(ax: Axes | None, num: int) -> tuple[Figure, list[Axes]]:
    if ax is not None:
        if num > 1:
            raise ValueError(f"The channels have {num} different units and need an Axes each: leave ax out.")
        return _figure_of(ax), [ax]
    figure, axes = plt.subplots(1, num, squeeze=False, figsize=(0.6 + 6 * num, 4.6), layout="constrained")
    return figure, list(axes[0])


def _figure_of(ax: Axes) -> Figure:
    figure = ax.get_figure()
    assert isinstance(figure, Figure)
    return figure
