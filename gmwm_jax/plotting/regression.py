"""The figure of a regression: what the regressors explain, and the noise that is left."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames
from gmwm_jax.plotting._style import DATA, FIT, MAX_POINTS, draw, pretty
from gmwm_jax.plotting.fitting import plot_fit
from gmwm_jax.regression.regression import Regression


@draw.register(Regression)
def plot_regression(regression: Regression, *, axes: GivenAxes | None = None) -> Figure:
    """Data with what the regressors explain, residuals; beside them the wavelet variance of the noise with its fit.

    Parameters
    ----------
    regression
        The regression of one record.
    axes
        Four Axes to draw into, of shape (2, 2), the small ones below; a new figure if left out.
    """
    figure, (top, variance, bottom, pulls) = frames(axes, 2, 2, (13, 6.6), sharex="col", height_ratios=(3, 1))
    t, unit = regression.time, pretty(regression.noise.unit)
    _draw_samples(top, t, regression.data, "data")
    top.plot(t, regression.fitted, color=FIT, lw=1.4, label="fit")
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
    if len(x) <= MAX_POINTS:
        ax.plot(t, x, ".", color=DATA, ms=2, label=label)
        return
    first = np.arange(0, len(x), -(-len(x) // (MAX_POINTS // 2)))
    ax.fill_between(
        t[first], np.fmin.reduceat(x, first), np.fmax.reduceat(x, first), color=DATA, alpha=0.45, lw=0, label=label
    )
