"""The figure of a recording."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames
from gmwm_jax.plotting._style import DATA, FIT, MAX_POINTS, draw, pretty
from gmwm_jax.recordings.recording import Recording


@draw.register(Recording)
def plot_recording(rec: Recording, *, axes: GivenAxes | None = None) -> Figure:
    """Each channel against time; a long record as the range of the samples in each of a few thousand bins.

    Parameters
    ----------
    rec
        The recording.
    axes
        An Axes for each channel to draw into; a new figure if left out.
    """
    figure, drawn = frames(axes, rec.num_channels, 1, (9, 1.2 + 1.6 * rec.num_channels), sharex=True)
    for ax, (i, name) in zip(drawn, enumerate(rec.channels), strict=True):
        x = rec.data[:, i]
        if len(x) <= MAX_POINTS:
            ax.plot(rec.time(), x, color=DATA, lw=0.7)
        else:
            size = -(-len(x) // (MAX_POINTS // 2))
            first = np.arange(0, len(x), size)  # the last bin may be shorter; no sample is left out
            count = np.diff(first, append=len(x))
            t = (first + (count - 1) / 2) / rec.rate
            low, high = np.fmin.reduceat(x, first), np.fmax.reduceat(x, first)
            ax.fill_between(t, low, high, color=DATA, alpha=0.45, lw=0, label="min .. max")
            with np.errstate(invalid="ignore"):  # none there: no mean
                mean = np.add.reduceat(np.nan_to_num(x), first) / np.add.reduceat(~np.isnan(x), first, dtype=float)
            ax.plot(t, mean, color=FIT, lw=0.7, label=f"mean of {size} samples")
        ax.set_ylabel(f"{name}\n[{pretty(rec.units[i])}]")
        ax.margins(x=0)
    if len(rec) > MAX_POINTS:
        drawn[0].legend(loc="upper right", fontsize=8, ncols=2)
    drawn[-1].set_xlabel("time [s]")
    drawn[0].set_title(f"{rec.name or 'recording'}: {len(rec):,} samples at {rec.rate:g} Hz".replace(",", "\u2009"))
    figure.align_ylabels()
    return figure
