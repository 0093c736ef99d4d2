"""Figure of a model selection: how far each candidate is from the best, and how sure that is."""

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.inference.selection import Candidate, Selection, Selections

_SHOWN = 20
_RECOMMENDED, _EQUIVALENT, _WORSE = "#c23b22", "#2a7f8e", "0.6"


def plot_selection(selection: Selection) -> Figure:
    """Differences of the criterion to the best candidate, with intervals; the lowest at the top.

    Parameters
    ----------
    selection
        The twenty lowest candidates are drawn.
    """
    shown = _shown(selection)
    figure, ax = plt.subplots(figsize=(7.5, 1.4 + 0.28 * len(shown)), layout="constrained")
    _panel(ax, selection, shown)
    return figure


def plot_selections(selections: Selections) -> Figure:
    """A panel a channel, three in a row, each as of `plot_selection`."""
    shown = [_shown(s) for s in selections.values()]
    columns = min(3, len(shown))
    rows = math.ceil(len(shown) / columns)
    size = (6.2 * columns, rows * (1.4 + 0.28 * max(map(len, shown))))
    figure, axes = plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.ravel()[len(shown) :]:
        ax.remove()
    for ax, selection, own in zip(axes.ravel(), selections.values(), shown, strict=False):
        _panel(ax, selection, own)
    return figure


def _shown(selection: Selection) -> list[Candidate]:
    return [c for c in selection.candidates if c.sound][:_SHOWN]


def _panel(ax: Axes, selection: Selection, shown: list[Candidate]) -> None:
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
