"""The figure of two levels of runs: mean errors of filters with their own gains, and what the cheap level lacks."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line
from gmwm_jax._internal.figures import describe, frames, legend_below
from nav_jax.plotting._style import TIME, bands_and_lines, draw, grid, logarithmic, outage_items, shade
from nav_jax.simulation.levels import TwoLevel


def two_level_data(found: TwoLevel, *, level: float = 0.95) -> tuple[Frame, Frame]:
    """Return what `plot_two_level` shows: mean position errors, and own gains - the cheap level.

    Parameters
    ----------
    found
        Of `nav_jax.simulation.two_level`.
    level
        Of the bands, pointwise.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.simulation.two_level(scenario, truth, num_runs=8, key=jax.random.key(0))
    >>> frames = nj.plotting.two_level_data(found)
    """
    means: list[Item] = []
    corrections: list[Item] = []
    less = f"own gains - {found.cheap}{'' if found.known else ' gains'}"
    outages = sorted({i for r in found.shared.runs.values() for i in r.outage_intervals})
    for name in found.with_means:
        of, t = found.mean(name), found.shared[name].time
        for items, value, se in ((means, of.value, of.se), (corrections, of.correction, of.correction_se)):
            half = found.half_width(se, level)
            items += [Band("", t, value - half, value + half), Line(name, t, value)]
    return (
        Frame("mean, own gains", TIME, Axis("mean position error", "m", "log"), (*means, *outage_items(outages))),
        Frame(less, TIME, Axis("position error", "m"), (*corrections, *outage_items(outages))),
    )


@draw.register(TwoLevel)
def plot_two_level(found: TwoLevel, *, level: float = 0.95, axes: GivenAxes | None = None) -> Figure:
    """Plot mean position errors with their intervals, and what the cheap level leaves out.

    Parameters
    ----------
    found
        Of `nav_jax.simulation.two_level`.
    level
        Of the bands, pointwise.
    axes
        Two Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> found = nj.simulation.two_level(scenario, truth, num_runs=8, key=jax.random.key(0))
    >>> figure = nj.plotting.plot_two_level(found)
    >>> figure.savefig("two_levels.png")
    """
    figure, drawn = frames(axes, 1, 2, (10.5, 4.8), sharex=True)
    for ax, frame in zip(drawn, two_level_data(found, level=level), strict=True):
        items = bands_and_lines(ax, frame)
        if frame.y.scale == "log":
            ax.set_ylim(bottom=min(float(np.min(x.y[x.y > 0])) for x in items if isinstance(x, Line)) / 1.5)
            logarithmic(ax)
        shade(ax, frame)
        grid(ax)
        describe(ax, frame)
    counts = f"{found.num_own} with gains of their own"
    counts = f"{counts} and linear" if found.known else f"{found.num_runs}, {counts}"
    title = f"runs: {counts}; {100 * level:g} % interval of the mean"
    legend_below(figure, drawn, alone=axes is None, title=title, title_fontsize=8)
    return figure
