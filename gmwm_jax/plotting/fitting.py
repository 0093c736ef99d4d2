"""Figures of fits: data, model and its components over scale, residuals below."""

from collections import Counter
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, entries_of, shared_legend
from gmwm_jax.fitting.result import Fit, Fits
from gmwm_jax.plotting._style import (
    COMPONENTS,
    DATA,
    FIT,
    Datasheet,
    by_unit,
    draw,
    draw_datasheet,
    draw_variance,
    finish_variance,
    large_and_small,
    lowest,
    pairs_of_frames,
    time_label,
    title_of,
)

_ZERO = ": zero"


@draw.register(Fit)
def plot_fit(fit: Fit, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
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
    figure, (top, bottom) = large_and_small(axes)
    wv = fit.wv
    draw_variance(top, wv, DATA, "wavelet variance")
    # theory is drawn between the scales too, at even spans
    dense = np.unique(2 * np.round(np.geomspace(wv.scales[0], wv.scales[-1], 200) / 2))
    t = dense / (wv.rate or 1.0)
    top.loglog(t, np.asarray(fit.model.wavelet_variance(dense)), color=FIT, lw=1.6, label="fit", zorder=3)
    for colour, label, p in zip(cycle(COMPONENTS), fit.model.labels, fit.model.processes, strict=False):
        if float(p.amplitude) > 0:
            top.loglog(t, np.asarray(p.wavelet_variance(dense)), "--", color=colour, lw=1, label=label)
        else:
            top.plot([], [], "--", color=colour, lw=1, label=f"{label}{_ZERO}")
    models = by_unit(datasheet, wv.units)
    if fit.unit in models:
        draw_datasheet(top, wv, models[fit.unit])
    finish_variance(top, wv, fit.unit)
    top.set_xlabel("")
    top.set_ylim(lowest(wv.ci_low, wv.variance) / 4, np.max(wv.ci_high) * 3)
    kinds = Counter(p.kind for p in fit.model.processes)
    model = " + ".join(kind if count == 1 else f"{count} {kind}" for kind, count in kinds.items())
    top.set_title(f"{title_of(wv, [0])}: {model}, objective {fit.objective:.5g}", fontsize=10)
    half = np.where(fit.residuals > 0, wv.variance - wv.ci_low, wv.ci_high - wv.variance)
    bottom.axhspan(-1, 1, color=DATA, alpha=0.12, lw=0, label=f"{100 * wv.level:g} % interval of one scale")
    bottom.axhline(0, color="0.4", lw=0.8)
    bottom.plot(wv.times, fit.residuals / half, "o", color=FIT, ms=4)
    bottom.set_ylabel("residual\n[half CI]")
    bottom.set_xlabel(time_label(wv))
    bottom.legend(fontsize=8, loc="best")
    limit = max(1.3, 1.15 * float(np.max(np.abs(fit.residuals / half))))
    bottom.set_ylim(-limit, limit)
    return figure


@draw.register(Fits)
def plot_fits(fits: Fits, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
    """One panel a channel, see `plot_fit`, with one legend for all.

    Parameters
    ----------
    fits
        The fits of several channels.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        Two Axes a channel to draw into, of shape (2, channels), the small ones below; a new figure if left out.
    """
    models = by_unit(datasheet, [fit.unit for fit in fits.values()])
    figure, pairs = pairs_of_frames(axes, len(fits), 4.6, 0.5)
    entries: dict[str, Any] = {}
    for fit, (top, bottom) in zip(fits.values(), pairs, strict=True):
        plot_fit(fit, datasheet=models.get(fit.unit), axes=(top, bottom))
        zero = [
            label for label, p in zip(fit.model.labels, fit.model.processes, strict=True) if float(p.amplitude) == 0
        ]
        note = f", {', '.join(zero)} zero" if zero else ""
        top.set_title(f"{fit.wv.channels[0]}: objective {fit.objective:.4g}{note}", fontsize=10)
        top.tick_params(labelbottom=False)
        for label, handle in entries_of(top, bottom).items():
            entries.setdefault(label.removesuffix(_ZERO), handle)
        for ax in (top, bottom):
            ax.get_legend().remove()  # type: ignore[union-attr]
    below: dict[str, Any] = {"loc": "outside lower center", "ncols": min(len(entries), 3 * min(len(fits), 3))}
    shared_legend(figure, [top for top, _ in pairs], entries, alone=axes is None, **below)
    return figure
