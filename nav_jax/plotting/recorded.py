"""The figure of a tuning by a record."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, entries_of, frames, shared_legend
from nav_jax.plotting._style import COLOURS, INK, draw, grid, logarithmic, positive
from nav_jax.recorded.tuning import Tuning


@draw.register(Tuning)
def plot_tuning(t: Tuning, *, axes: GivenAxes | None = None) -> Figure:
    """Each parameter relative to its start, with its interval; those that the record does not show are marked.

    Parameters
    ----------
    t
        The tuning.
    axes
        The Axes to draw into; a new figure if left out.
    """
    figure, (ax,) = frames(axes, 1, 1, (9.0, 1.6 + 0.42 * len(t.names)))
    rows = np.arange(len(t.names))
    # a partial autocorrelation may be negative, and its interval may contain zero
    factor = positive(t.value / t.start)
    low, high = np.sort([t.ci_low / t.start, t.ci_high / t.start], axis=0)
    ax.axvline(1.0, color=INK, lw=1.0, ls=":", label="start")
    interval = f"tuned, {100 * t.level:g} % interval"
    for chosen, colour, label in (
        (t.observable, COLOURS[0], interval),
        (t.sought & ~t.observable, COLOURS[3], "from the prior"),
    ):
        if chosen.any():
            # what goes through zero goes on to the edge of the logarithmic axis
            bars = [(factor - np.maximum(low, 0.0))[chosen], (high - factor)[chosen]]
            ax.errorbar(factor[chosen], rows[chosen], xerr=bars, fmt="o", color=colour, capsize=4, lw=1.6, label=label)
    held = np.isin(t.names, t.held)
    for chosen, style, label in ((~t.sought & ~t.lost & ~held, "x", "not observable"), (held, "s", "held")):
        if chosen.any():
            at, colour = rows[chosen], COLOURS[1] if style == "x" else INK
            ax.plot(np.ones(len(at)), at, style, color=colour, mfc="none", ms=8, mew=1.8, label=label)
    ax.set(yticks=rows, yticklabels=t.names, xlabel="factor on the start [1]", ylim=(len(rows) - 0.5, -0.5))
    widest = 1.3 * np.nanmax([2.0, *high, *(1 / positive(low))])
    ax.set_xlim(1 / widest, widest)
    if t.lost.any():
        # far off, as a variance on its way to zero
        at = np.clip(np.nan_to_num(factor[t.lost]), 1.1 / widest, widest / 1.1)
        ax.plot(at, rows[t.lost], "D", color=COLOURS[1], mfc="none", ms=7, mew=1.8, label="lost in the search")
    logarithmic(ax, "x")
    grid(ax)
    gain = f"log likelihood {t.loss_start - t.loss:+.4g}" + ("" if t.converged else ", NOT converged")
    ax.set_title(f"{t.num_innovations} innovations: {gain}", fontsize=11)
    shared_legend(figure, [ax], entries_of(ax), alone=axes is None, loc="outside lower center", ncols=4, fontsize=8)
    return figure
