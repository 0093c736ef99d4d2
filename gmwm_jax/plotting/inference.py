"""Figures of a model selection, and of a bootstrap."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.intervals import replicates_needed
from gmwm_jax.inference.selection import Candidate, Selection, Selections
from gmwm_jax.plotting._style import draw

_SHOWN = 20
_RECOMMENDED, _EQUIVALENT, _WORSE = "#c23b22", "#2a7f8e", "0.6"
_REPLICATES, _ESTIMATE, _THEORY = "#2a7f8e", "#c23b22", "0.35"


@draw.register(Selection)
def plot_selection(selection: Selection, *, axes: GivenAxes | None = None) -> Figure:
    """Differences of the criterion to the best candidate, with intervals; the lowest at the top.

    Parameters
    ----------
    selection
        The twenty lowest candidates are drawn.
    axes
        The Axes to draw into; a new figure if left out.
    """
    shown = _shown(selection)
    figure, (ax,) = frames(axes, 1, 1, (7.5, 1.4 + 0.28 * len(shown)))
    _draw_candidates(ax, selection, shown)
    return figure


@draw.register(Selections)
def plot_selections(selections: Selections, *, axes: GivenAxes | None = None) -> Figure:
    """A frame a channel, three in a row, each as of `plot_selection`.

    Parameters
    ----------
    selections
        Of several channels.
    axes
        An Axes for each channel to draw into; a new figure if left out.
    """
    shown = [_shown(s) for s in selections.values()]
    columns = min(3, len(shown))
    rows = math.ceil(len(shown) / columns)
    size = (6.2 * columns, rows * (1.4 + 0.28 * max(map(len, shown))))
    figure, drawn = frames(axes, rows, columns, size, num=len(shown))
    for ax, selection, own in zip(drawn, selections.values(), shown, strict=True):
        _draw_candidates(ax, selection, own)
    return figure


def _shown(selection: Selection, *, axes: GivenAxes | None = None) -> list[Candidate]:
    return [c for c in selection.candidates if c.sound][:_SHOWN]


def _draw_candidates(ax: Axes, selection: Selection, shown: list[Candidate]) -> None:
    equivalent = {c.name for c in selection.equivalent}
    z = normal_quantile(selection.level)
    drawn = set()
    for row, c in enumerate(shown):
        if c is selection.recommended:
            color, label = _RECOMMENDED, "recommended: the simplest of these"
        elif c.name in equivalent:
            color, label = _EQUIVALENT, "none is significantly better"
        else:
            color, label = _WORSE, "worse"
        style = {"fmt": "o", "color": color, "capsize": 3, "label": None if label in drawn else label}
        ax.errorbar(c.difference, row, xerr=z * c.standard_error, **style)
        drawn.add(label)
    ax.axvline(0, color="0.3", lw=0.8)
    ax.set_yticks(range(len(shown)), [f"{c.name}  ({c.num_parameters})" for c in shown])
    ax.invert_yaxis()
    errors = [c.standard_error for c in shown if c.standard_error > 0]
    if errors:
        ax.set_xscale("symlog", linthresh=float(np.median(errors)))
        ax.set_xlim(left=min(c.difference - 1.3 * z * c.standard_error for c in shown))
    ax.set_xlabel(f"WVIC, difference to the lowest, with {100 * selection.level:g} % intervals")
    ax.set_ylabel("model (number of parameters)")
    ax.set_title(f"{selection.superset.wv.channels[0]}: {len(selection)} models", fontsize=10)
    ax.legend(fontsize=8, loc="lower right")


@draw.register(Bootstrap)
def plot_bootstrap(boot: Bootstrap, *, axes: GivenAxes | None = None) -> Figure:
    """A panel a parameter: replicates, the estimate, percentile interval and that of theory.

    Parameters
    ----------
    boot
        The replicates.
    axes
        An Axes for each parameter that varies to draw into; a new figure if left out.
    """
    enough = len(boot.good) >= replicates_needed(boot.fit.level)
    theory, shown = boot.fit.parameters(), boot.parameters() if enough else boot.fit.parameters()
    panels = [i for i in range(boot.good.shape[1]) if np.ptp(boot.good[:, i]) > 0]
    columns = min(3, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    figure, drawn = frames(axes, rows, columns, (4.4 * columns, 3.2 * rows), num=len(panels))
    pairs = list(zip(shown, theory, strict=True))
    for ax, i in zip(drawn, panels, strict=True):
        _draw_parameter(ax, boot.good[:, i], *pairs[i], boot.fit.level, enough)
    what = f"{boot.fit.wv.channels[0]}: {len(boot.good)} replicates by {boot.route}"
    if axes is None:
        figure.suptitle(f"{what}; p = {boot.p_value:.2g} for the model", fontsize=10)
    return figure


def _draw_parameter(ax: Axes, draws: np.ndarray, own: Estimate, theory: Estimate, level: float, enough: bool) -> None:
    positive = draws[draws > 0]
    gone = 100 * (1 - len(positive) / len(draws))
    absent = f", {gone:.2g} % at zero" if gone else ""
    wide = positive.max() > 5 * positive.min()
    bins = (np.geomspace if wide else np.linspace)(positive.min(), positive.max(), 31)
    ax.hist(positive, bins=bins, color=_REPLICATES, alpha=0.6, label=f"replicates{absent}")
    ax.set_xscale("log" if wide else "linear")
    if not wide:
        ax.locator_params(axis="x", nbins=4)
    if own.value > 0:
        ax.axvline(own.value, color=_ESTIMATE, lw=1.5, label="estimate")
    if enough and own.ci_high > 0:
        label = f"{100 * level:g} % percentile"
        ax.axvspan(max(own.ci_low, bins[0]), own.ci_high, color=_ESTIMATE, alpha=0.12, lw=0, label=label)
    if np.isfinite(theory.ci_low):
        for end, label in ((theory.ci_low, f"{100 * level:g} % theory"), (theory.ci_high, None)):
            ax.axvline(end, color=_THEORY, ls="--", lw=1, label=label)
    ax.set_xlabel(f"{own.component} {own.symbol} [{own.unit}]")
    ax.set_ylabel("replicates")
    ax.legend(fontsize=7)
