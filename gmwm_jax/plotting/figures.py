"""Figures: log-log variances with their bands, fits with their components, residuals by scale. A leaf.

Every function draws into a given Axes, or makes a Figure (of pyplot, which also keeps it) and returns it; none shows,
saves or closes anything.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax.fitting.result import Fit, Fits
from gmwm_jax.fitting.slopes import SlopeRegression
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.regression.regression import Regression
from gmwm_jax.variance.allan import AllanDeviation
from gmwm_jax.variance.robust_comparison import RobustComparison
from gmwm_jax.variance.wavelet import WaveletVariance

_DATA, _FIT, _DATASHEET = "#1f4e79", "#c23b22", "#5b8c2a"
_COMPONENTS = ("#e08e0b", "#7a4f9a", "#2a8f8f", "#b5628c", "#8c6d31", "#4f7fbf", "#6b6b6b")
_ZERO = ": zero"
_MAX_POINTS = 4000
"""In a time series: more are drawn as the band between minima and maxima."""

Datasheet = str | AbstractProcess | Composite | Mapping[str, str | AbstractProcess | Composite]
"""A model, or where the channels have several units one for each of them: ``{"rad/s": ..., "m/s^2": ...}``."""


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
            ax.plot(rec.time(), x, color=_DATA, lw=0.7)
        else:
            size = -(-len(x) // (_MAX_POINTS // 2))
            first = np.arange(0, len(x), size)  # the last bin may be shorter; no sample is left out
            count = np.diff(first, append=len(x))
            t = (first + (count - 1) / 2) / rec.rate
            low, high = np.fmin.reduceat(x, first), np.fmax.reduceat(x, first)
            ax.fill_between(t, low, high, color=_DATA, alpha=0.45, lw=0, label="min .. max")
            with np.errstate(invalid="ignore"):  # none there: no mean
                mean = np.add.reduceat(np.nan_to_num(x), first) / np.add.reduceat(~np.isnan(x), first, dtype=float)
            ax.plot(t, mean, color=_FIT, lw=0.7, label=f"mean of {size} samples")
        ax.set_ylabel(f"{name}\n[{_pretty(rec.units[i])}]")
        ax.margins(x=0)
    if len(rec) > _MAX_POINTS:
        axes[0, 0].legend(loc="upper right", fontsize=8, ncols=2)
    axes[-1, 0].set_xlabel("time [s]")
    axes[0, 0].set_title(f"{rec.name or 'recording'}: {len(rec):,} samples at {rec.rate:g} Hz".replace(",", "\u2009"))
    figure.align_ylabels()
    return figure


def plot_wavelet_variance(wv: WaveletVariance, *, ax: Axes | None = None, datasheet: Datasheet | None = None) -> Figure:
    """Wavelet variance over scale with its confidence band; channels of one unit share a frame.

    Parameters
    ----------
    wv
        Wavelet variance of one or several channels.
    ax
        Where to draw (one unit only); a new figure if left out.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    """
    models = _by_unit(datasheet, wv.units)
    figure, frames = _frames(wv, ax)
    for frame, unit, members in frames:
        for colour, i, label in _members(wv, members, "wavelet variance"):
            _draw_variance(frame, wv[i], colour, label)
        if unit in models:
            _draw_datasheet(frame, wv[members[0]], models[unit])
        _finish_variance(frame, wv, unit)
        frame.set_title(_title(wv, members))
    return figure


def plot_robust_comparison(
    comparison: RobustComparison, *, cleaned: WaveletVariance | None = None, axes: Sequence[Axes] | None = None
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
    figure, (top, bottom) = _two_axes(axes)
    classic, robust = comparison.classic, comparison.robust
    _draw_variance(top, classic, _DATA, "classic")
    _draw_variance(top, robust, _FIT, f"robust, efficiency {robust.efficiency:g}")
    if cleaned is not None:
        _draw_variance(top, cleaned, _DATASHEET, f"cleaned: {cleaned.missing or 'none missing'}")
    _finish_variance(top, classic, classic.units[0])
    top.set_xlabel("")
    share = 100 * comparison.num_outliers / (classic.num_samples or 1)
    top.set_title(f"{_title(classic, [0])}: {comparison.num_outliers} outlying samples ({share:.2g} %)", fontsize=10)
    differs = comparison.significant
    bottom.axhspan(-2, 2, color="0.5", alpha=0.15, lw=0, label="± 2 standard errors of a clean record")
    bottom.axhline(0, color="0.4", lw=0.8)
    bottom.plot(classic.times[~differs], comparison.z[~differs], "o", color="0.4", ms=4)
    bottom.plot(classic.times[differs], comparison.z[differs], "o", color=_FIT, ms=4, label="differs")
    bottom.set_yscale("symlog", linthresh=4)
    bottom.set_ylabel("log(classic/robust)\n[standard errors]")
    bottom.set_xlabel(_time_label(classic))
    bottom.legend(fontsize=8, loc="best")
    return figure


def plot_allan_deviation(
    adev: AllanDeviation, *, ax: Axes | None = None, regression: SlopeRegression | None = None
) -> Figure:
    """Allan deviation over averaging time with its confidence band.

    Parameters
    ----------
    adev
        One or several channels; channels of one unit share a frame.
    ax
        Where to draw (one unit only).
    regression
        Slopes to draw, and the deviation they imply together; of one channel.
    """
    wv = adev.wv
    if regression is not None and not wv.is_single:
        raise ValueError(f"Slopes belong to one channel: choose it, as in adev[{wv.channels[0]!r}].plot(...).")
    figure, frames = _frames(wv, ax)
    for frame, unit, members in frames:
        for colour, i, label in _members(wv, members, "overlapping Allan deviation"):
            one = adev[i]
            frame.fill_between(one.times, one.ci_low, one.ci_high, color=colour, alpha=0.18, lw=0)
            frame.loglog(one.times, one.deviation, "o-", color=colour, ms=3.5, lw=1, label=label)
        if regression is not None:
            times, tau = regression.adev.times, regression.adev.wv.scales
            for colour, label, p in zip(
                cycle(_COMPONENTS), regression.model.labels, regression.model.processes, strict=False
            ):
                line = np.sqrt(2 * np.asarray(p.wavelet_variance(tau)))
                frame.loglog(times, line, "--", color=colour, lw=1, label=label)
            frame.loglog(times, regression.implied_deviation, color=_FIT, lw=1.4, label="sum")
            frame.set_ylim(_lowest(adev.ci_low, adev.deviation) / 3, np.max(adev.ci_high) * 3)
        frame.set_xlabel("averaging time T [s]")
        frame.set_ylabel(f"Allan deviation [{_pretty(unit)}]")
        frame.set_title(_title(wv, members))
        _legend(frame, wv.level)
    return figure


def plot_fit(fit: Fit, *, datasheet: Datasheet | None = None, axes: Sequence[Axes] | None = None) -> Figure:
    """Wavelet variance, fit and components over scale; below, the residuals in half widths of the confidence interval.

    Parameters
    ----------
    fit
        The fit of one channel.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        Two Axes to draw into; a new figure if left out.
    """
    figure, (top, bottom) = _two_axes(axes)
    wv = fit.wv
    _draw_variance(top, wv, _DATA, "wavelet variance")
    # theory is drawn between the scales too, at even spans
    dense = np.unique(2 * np.round(np.geomspace(wv.scales[0], wv.scales[-1], 200) / 2))
    t = dense / (wv.rate or 1.0)
    top.loglog(t, np.asarray(fit.model.wavelet_variance(dense)), color=_FIT, lw=1.6, label="fit", zorder=3)
    for colour, label, p in zip(cycle(_COMPONENTS), fit.model.labels, fit.model.processes, strict=False):
        if float(p.amplitude) > 0:
            top.loglog(t, np.asarray(p.wavelet_variance(dense)), "--", color=colour, lw=1, label=label)
        else:
            top.plot([], [], "--", color=colour, lw=1, label=f"{label}{_ZERO}")
    models = _by_unit(datasheet, wv.units)
    if fit.unit in models:
        _draw_datasheet(top, wv, models[fit.unit])
    _finish_variance(top, wv, fit.unit)
    top.set_xlabel("")
    top.set_ylim(_lowest(wv.ci_low, wv.variance) / 4, np.max(wv.ci_high) * 3)
    kinds = Counter(p.kind for p in fit.model.processes)
    model = " + ".join(kind if count == 1 else f"{count} {kind}" for kind, count in kinds.items())
    top.set_title(f"{_title(wv, [0])}: {model}, objective {fit.objective:.5g}", fontsize=10)
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


def plot_fits(fits: Fits, *, datasheet: Datasheet | None = None) -> Figure:
    """One panel a channel, see `plot_fit`, with one legend for all.

    Parameters
    ----------
    fits
        The fits of several channels.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    """
    models = _by_unit(datasheet, [fit.unit for fit in fits.values()])
    columns = min(len(fits), 3)
    rows = -(-len(fits) // columns)
    figure = plt.figure(figsize=(4.6 * columns, 0.5 + 4.9 * rows), layout="constrained")
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3, 1] * rows)
    handles: dict[str, Any] = {}
    for i, fit in enumerate(fits.values()):
        row, column = divmod(i, columns)
        top = figure.add_subplot(grid[2 * row, column])
        bottom = figure.add_subplot(grid[2 * row + 1, column], sharex=top)
        plot_fit(fit, datasheet=models.get(fit.unit), axes=(top, bottom))
        zero = [
            label for label, p in zip(fit.model.labels, fit.model.processes, strict=True) if float(p.amplitude) == 0
        ]
        note = f", {', '.join(zero)} zero" if zero else ""
        top.set_title(f"{fit.wv.channels[0]}: objective {fit.objective:.4g}{note}", fontsize=10)
        top.tick_params(labelbottom=False)
        for ax in (top, bottom):
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
                handles.setdefault(label.removesuffix(_ZERO), handle)
            legend = ax.get_legend()
            if legend is not None:
                legend.remove()
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=min(len(handles), 3 * columns))
    return figure


def plot_regression(regression: Regression) -> Figure:
    """Data with what the regressors explain, residuals; beside them the wavelet variance of the noise with its fit.

    Parameters
    ----------
    regression
        The regression of one record.
    """
    figure = plt.figure(figsize=(13, 6.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(3, 1))
    (top, variance), (bottom, pulls) = [[figure.add_subplot(grid[i, j]) for j in range(2)] for i in range(2)]
    bottom.sharex(top)
    pulls.sharex(variance)
    for ax in (top, variance):
        ax.tick_params(labelbottom=False)
    t, unit = regression.time, _pretty(regression.noise.unit)
    _draw_samples(top, t, regression.data, "data")
    top.plot(t, regression.fitted, color=_FIT, lw=1.4, label="fit")
    _draw_samples(bottom, t, regression.residuals, "residuals")
    bottom.axhline(0, color="0.4", lw=0.8)
    name = regression.noise.wv.channels[0]
    missing = f", {regression.num_missing} missing" if regression.num_missing else ""
    top.set_title(f"{name}: {len(t)} samples{missing}", fontsize=10)
    top.set_ylabel(f"{name} [{unit}]")
    bottom.set_ylabel(f"residual [{unit}]")
    bottom.set_xlabel("time [s]")
    top.legend(fontsize=8)
    bottom.margins(x=0)
    plot_fit(regression.noise, axes=(variance, pulls))
    return figure


def _draw_samples(ax: Axes, t: np.ndarray, x: np.ndarray, label: str) -> None:
    """A record with missing samples: points, or if there are many the range in each of a few thousand bins."""
    if len(x) <= _MAX_POINTS:
        ax.plot(t, x, ".", color=_DATA, ms=2, label=label)
        return
    first = np.arange(0, len(x), -(-len(x) // (_MAX_POINTS // 2)))
    ax.fill_between(
        t[first], np.fmin.reduceat(x, first), np.fmax.reduceat(x, first), color=_DATA, alpha=0.45, lw=0, label=label
    )


def _draw_variance(ax: Axes, wv: WaveletVariance, colour: str, label: str) -> None:
    ax.fill_between(wv.times, wv.ci_low, wv.ci_high, color=colour, alpha=0.18, lw=0)
    ax.loglog(wv.times, wv.variance, "o-", color=colour, ms=3.5, lw=1, label=label)


def _draw_datasheet(ax: Axes, wv: WaveletVariance, model: Composite) -> None:
    nu = np.asarray(model.wavelet_variance(wv.scales))
    ax.loglog(wv.times, nu, "-.", color=_DATASHEET, lw=1.4, label="datasheet")


def _finish_variance(ax: Axes, wv: WaveletVariance, unit: str) -> None:
    ax.set_xlabel(_time_label(wv))
    ax.set_ylabel("wavelet variance [1]" if unit == "1" else f"wavelet variance [({_pretty(unit)})²]")
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


def _lowest(ci_low: np.ndarray, estimate: np.ndarray) -> float:
    """The lower end of a logarithmic axis, which has no place for an interval that starts at zero."""
    return float(np.min(np.where(ci_low > 0, ci_low, estimate)))


def _title(wv: WaveletVariance, members: Sequence[int]) -> str:
    names = ", ".join(wv.channels[i] for i in members) if len(members) < 5 else f"{len(members)} channels"
    title = names if wv.name in ("", names) else f"{wv.name}, {names}"
    return f"{title}, robust ({wv.efficiency:g})" if wv.efficiency else title


def _members(wv: WaveletVariance, members: Sequence[int], single: str) -> Iterator[tuple[str, int, str]]:
    """Colour, number and label of the channels in one frame."""
    if len(members) == 1:
        yield _DATA, members[0], single
    else:
        yield from ((colour, i, wv.channels[i]) for colour, i in zip(cycle(_COMPONENTS), members, strict=False))


def _by_unit(datasheet: Datasheet | None, units: Sequence[str]) -> dict[str, Composite]:
    """Unit -> model; a single model is for the only unit there is."""
    if datasheet is None:
        return {}
    if isinstance(datasheet, Mapping):
        if not set(datasheet) & set(units):
            raise ValueError(f"The datasheet is about {', '.join(datasheet)}, and the data are in {', '.join(units)}.")
        return {unit: as_model(model) for unit, model in datasheet.items()}
    if len(set(units)) > 1:
        raise ValueError(
            f"The channels have the units {', '.join(dict.fromkeys(units))}, and a datasheet model belongs to one: "
            'give datasheet={"rad/s": ...}.'
        )
    return {units[0]: as_model(datasheet)}


def _frames(wv: WaveletVariance, ax: Axes | None) -> tuple[Figure, list[tuple[Axes, str, list[int]]]]:
    """A frame for each unit, with the numbers of the channels that it shows."""
    members: dict[str, list[int]] = {}
    for i, unit in enumerate(wv.units):
        members.setdefault(unit, []).append(i)
    if ax is None:
        width = 0.6 + 6 * len(members)
        figure, axes = plt.subplots(1, len(members), squeeze=False, figsize=(width, 4.6), layout="constrained")
        chosen = list(axes[0])
    elif len(members) == 1:
        figure, chosen = _figure_of(ax), [ax]
    else:
        raise ValueError(f"The channels have {len(members)} different units and need an Axes each: leave ax out.")
    return figure, [(frame, unit, who) for frame, (unit, who) in zip(chosen, members.items(), strict=True)]


def _two_axes(axes: Sequence[Axes] | None) -> tuple[Figure, Sequence[Axes]]:
    """A large frame above a small one, in a new figure unless two Axes are given."""
    if axes is not None:
        return _figure_of(axes[0]), axes
    figure, (top, bottom) = plt.subplots(
        2, 1, sharex=True, figsize=(7, 6.6), height_ratios=(3, 1), layout="constrained"
    )
    return figure, (top, bottom)


def _figure_of(ax: Axes) -> Figure:
    figure = ax.get_figure()
    assert isinstance(figure, Figure)
    return figure
