"""Figure of a bootstrap: how each parameter scatters, with its intervals."""

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.intervals import replicates_needed

_DRAWS, _ESTIMATE, _THEORY = "#2a7f8e", "#c23b22", "0.35"


def plot_bootstrap(boot: Bootstrap) -> Figure:
    """A panel a parameter: replicates, the estimate, percentile interval and that of theory.

    Parameters
    ----------
    boot
        The replicates.
    """
    enough = len(boot.good) >= replicates_needed(boot.fit.level)
    theory, shown = boot.fit.parameters(), boot.parameters() if enough else boot.fit.parameters()
    panels = [i for i in range(boot.good.shape[1]) if np.ptp(boot.good[:, i]) > 0]
    columns = min(3, max(1, len(panels)))
    rows = max(1, math.ceil(len(panels) / columns))
    figure, axes = plt.subplots(rows, columns, figsize=(4.4 * columns, 3.2 * rows), layout="constrained", squeeze=False)
    for ax in axes.ravel()[len(panels) :]:
        ax.remove()
    pairs = list(zip(shown, theory, strict=True))
    for ax, i in zip(axes.ravel(), panels, strict=False):
        _panel(ax, boot.good[:, i], *pairs[i], boot.fit.level, enough)
    what = f"{boot.fit.wv.channels[0]}: {len(boot.good)} replicates by {boot.route}"
    figure.suptitle(f"{what}; p = {boot.p_value:.2g} for the model", fontsize=10)
    return figure


def _panel(ax: Axes, draws: np.ndarray, own: Estimate, theory: Estimate, level: float, enough: bool) -> None:
    positive = draws[draws > 0]
    gone = 100 * (1 - len(positive) / len(draws))
    absent = f", {gone:.2g} % at zero" if gone else ""
    wide = positive.max() > 5 * positive.min()
    bins = (np.geomspace if wide else np.linspace)(positive.min(), positive.max(), 31)
    ax.hist(positive, bins=bins, color=_DRAWS, alpha=0.6, label=f"replicates{absent}")
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
