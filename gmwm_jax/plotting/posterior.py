"""The figure of a posterior: the marginal of each parameter, and of draws beside it."""

import math

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Frame, Histogram, Item, Line, Mark, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax.fitting.bayes import Posterior
from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.plotting._style import DRAWS, FIT, draw, few_ticks

_WIDE = 3.0
"""Ratio of the ends of what is shown from which it is shown over a logarithm."""
_REACH, _NUM = 4.0, 301
"""Standard deviations on either side of the mean, and points of the curve."""
_BINS = 40


def posterior_data(found: Posterior, *, draws: Float[np.ndarray, "S E"] | None = None) -> tuple[Frame, ...]:
    """Return what `plot_posterior` shows: a frame for each parameter that is not fixed.

    Parameters
    ----------
    found
        The posterior.
    draws
        Of `Posterior.sample`.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> frames = gj.plotting.posterior_data(gj.fitting.posterior(wv, "WN + RW"))
    """
    estimates = [e for i in range(len(found.fits)) for e in found.parameters(i)]
    own = [None] * len(found.names) if draws is None else np.asarray(draws).T
    if len(own) != len(found.names):
        raise ValueError(f"The draws are of {len(own)} parameters, and the posterior has {len(found.names)}.")
    shown = []
    for i, (name, estimate) in enumerate(zip(found.names, estimates, strict=True)):
        mean, sd = found.marginal(name)
        if sd > 0:
            shown.append(_marginal(found, i, estimate, mean, sd, own[i]))
    return tuple(shown)


def _marginal(
    found: Posterior, i: int, estimate: Estimate, mean: float, sd: float, own: Float[np.ndarray, " S"] | None
) -> Frame:
    """The density of a parameter: per unit of it, or of its logarithm where that is what is shown."""
    parameter = found.density.template.processes
    q = [q for p in parameter for q in p.parameters][i % found.density.template.num_parameters]
    low, high = float(found.density.low[i]), float(found.density.high[i])
    ends = [mean - _REACH * sd, mean + _REACH * sd]
    if own is not None:
        ends = [min(ends[0], float(own.min())), max(ends[1], float(own.max()))]
    line = np.linspace(max(ends[0], low), min(ends[1], high), _NUM)
    x = np.asarray(q.from_line(line))
    wide = np.isinf(q.upper) and x[-1] > _WIDE * x[0]
    at = np.log(x) if wide else x
    density = np.exp(-(((line - mean) / sd) ** 2) / 2) * np.gradient(line, at)
    curve = density / np.trapezoid(density, at)
    items: list[Item] = []
    if own is not None:
        values = np.asarray(q.from_line(own))
        counts, edges = np.histogram(np.log(values) if wide else values, _BINS, density=True)
        items.append(Histogram("draws", np.exp(edges) if wide else edges, counts))
    items.append(Line("Laplace's approximation", x, curve))
    items.append(Mark("mode", estimate.value))
    if np.isfinite(estimate.ci_low):
        items.append(Span(f"{100 * found.level:g} % interval", estimate.ci_low, estimate.ci_high))
    axis = Axis(found.names[i], estimate.unit, "log" if wide else "linear")
    return Frame(str(estimate.note), axis, Axis("density of the logarithm" if wide else "density", ""), tuple(items))


@draw.register(Posterior)
def plot_posterior(
    found: Posterior, *, draws: Float[np.ndarray, "S E"] | None = None, axes: GivenAxes | None = None
) -> Figure:
    """Plot a panel for each parameter: the marginal of Laplace's approximation, mode, interval, and draws if there are.

    Beside a parameter at a bound the curves of the others are those of the problem in which it is held.

    Parameters
    ----------
    found
        The posterior.
    draws
        Of `Posterior.sample`.
    axes
        An Axes for each parameter that is not fixed; a new figure if left out.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> figure = gj.plotting.plot_posterior(gj.fitting.posterior(wv, "WN + RW"))
    >>> figure.savefig("posterior.png")
    """
    shown = posterior_data(found, draws=draws)
    columns = min(3, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure, drawn = frames(axes, rows, columns, (4.4 * columns, 0.6 + 3.2 * rows), num=len(shown))
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame, fontsize=9)
        for item in frame.items:
            match item:
                case Histogram():
                    put(ax, item, color=DRAWS, alpha=0.6)
                case Span():
                    put(ax, item, color=FIT, alpha=0.12)
                case Mark():
                    put(ax, item, color="0.35", ls="--", lw=1)
                case _:
                    put(ax, item, color=FIT, lw=1.5)
        ax.set_ylim(bottom=0)
        few_ticks(ax, frame.x.scale)
    legend_below(figure, drawn, alone=axes is None)
    if axes is None:
        figure.suptitle(f"{', '.join(f.wv.channels[0] for f in found.fits)}: posterior of "
                        f"{' + '.join(found.density.template.labels)}", fontsize=10)  # fmt: skip
    return figure
