"""The figure of a regression: what the regressors explain, and the noise that is left."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line, Mark, Points
from gmwm_jax._internal.figures import describe, frames, put
from gmwm_jax.plotting._style import DATA, FIT, MAX_POINTS, TIME, draw, in_bins
from gmwm_jax.plotting.fitting import fit_data, plot_fit
from gmwm_jax.regression.regression import Regression


def regression_data(regression: Regression) -> tuple[Frame, Frame, Frame, Frame]:
    """Return what `plot_regression` shows: data and fit, the noise as of `fit_data`, and below both what is left.

    Parameters
    ----------
    regression
        The regression of one record.

    Examples
    --------
    >>> t = np.arange(2000.0)
    >>> y = 0.5 * t + np.asarray(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> frames = gj.plotting.regression_data(gj.regress(y, gj.regression.trend(t), "WN", rate=1.0))
    """
    t, unit = regression.time, regression.noise.unit
    name = regression.noise.wv.channels[0]
    missing = f", {regression.num_missing} missing" if regression.num_missing else ""
    noise, pulls = fit_data(regression.noise)
    fitted = Line("fit", t, regression.fitted)
    data = Frame(
        f"{name}: {len(t)} samples{missing}", TIME, Axis(name, unit), (_samples("data", t, regression.data), fitted)
    )
    left = (_samples("residuals", t, regression.residuals), Mark("", 0.0, "y"))
    return data, noise, Frame("", TIME, Axis("residual", unit), left), pulls


@draw.register(Regression)
def plot_regression(regression: Regression, *, axes: GivenAxes | None = None) -> Figure:
    """Plot the data with what the regressors explain, the residuals, and the noise with its fit.

    Parameters
    ----------
    regression
        The regression of one record.
    axes
        Four Axes to draw into, of shape (2, 2), the small ones below; a new figure if left out.

    Examples
    --------
    >>> t = np.arange(2000.0)
    >>> y = 0.5 * t + np.asarray(gj.simulate("WN(sigma2=1.0)", 2000, key=jax.random.key(0)))
    >>> figure = gj.plotting.plot_regression(gj.regress(y, gj.regression.trend(t), "WN", rate=1.0))
    >>> figure.savefig("regression.png")
    """
    data, _, left, _ = regression_data(regression)
    figure, (top, variance, bottom, pulls) = frames(axes, 2, 2, (13, 6.6), sharex="col", height_ratios=(3, 1))
    describe(top, data, fontsize=10)
    describe(bottom, left)
    _draw_samples(top, data.items[0])
    put(top, data.items[1], color=FIT, lw=1.4)
    _draw_samples(bottom, left.items[0])
    put(bottom, left.items[1], color="0.4", lw=0.8)
    top.set_xlabel("")
    top.legend(fontsize=8)
    bottom.margins(x=0)
    plot_fit(regression.noise, axes=(variance, pulls))
    return figure


def _samples(label: str, t: np.ndarray, x: np.ndarray) -> Item:
    """A record with missing samples, or if there are many their range in each of a few thousand bins."""
    return Points(label, t, x) if len(x) <= MAX_POINTS else in_bins(t, x)[1]._replace(label=label)


def _draw_samples(ax: Axes, item: Item) -> None:
    style = {"alpha": 0.45} if isinstance(item, Band) else {"marker": ".", "ls": "", "ms": 2}
    put(ax, item, color=DATA, **style)
