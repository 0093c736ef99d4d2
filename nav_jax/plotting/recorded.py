"""The figure of a tuning by a record."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Bars, Frame, Item, Mark, Points
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax._internal.palette import COLOURS
from nav_jax.plotting._style import INK, draw, grid, logarithmic, positive
from nav_jax.recorded.tuning import Tuning

_STYLES = {
    "start": {"color": INK, "lw": 1.0, "ls": ":"},
    "from the prior": {"color": COLOURS[3]},
    "not observable": {"color": COLOURS[1], "marker": "x", "ms": 8},
    "held": {"color": INK, "marker": "s", "ms": 8},
    "lost in the search": {"color": COLOURS[1], "marker": "D", "ms": 7},
}


def tuning_data(t: Tuning) -> tuple[Frame]:
    """Return what `plot_tuning` shows: the parameters in rows from the top, as factors on their starts.

    Parameters
    ----------
    t
        The tuning.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> frames = nj.plotting.tuning_data(nj.tune(imu, [fixes], filter, **start, max_steps=3))
    """
    rows = np.arange(len(t.names))
    # a partial autocorrelation may be negative, and its interval may contain zero
    factor = positive(t.value / t.start)
    low, high = np.sort([t.ci_low / t.start, t.ci_high / t.start], axis=0)
    held = np.isin(t.names, t.held)
    items: list[Item] = [Mark("start", 1.0)]
    for label, who in (
        (f"tuned, {100 * t.level:g} % interval", t.observable),
        ("from the prior", t.sought & ~t.observable),
    ):
        # what goes through zero goes on to the edge of the logarithmic axis
        items.append(Bars(label, factor[who], rows[who], np.maximum(low, 0.0)[who], high[who], lying=True))
    for label, who in (("not observable", ~t.sought & ~t.lost & ~held), ("held", held)):
        items.append(Points(label, np.ones(who.sum()), rows[who]))
    edge = _widest(t) / 1.1  # far off, as a variance on its way to zero
    items.append(Points("lost in the search", np.clip(np.nan_to_num(factor[t.lost]), 1 / edge, edge), rows[t.lost]))
    there = (item for item in items if isinstance(item, Mark) or np.size(item[1]))
    gain = f"log likelihood {t.loss_start - t.loss:+.4g}" + ("" if t.converged else ", NOT converged")
    title = f"{t.num_innovations} innovations: {gain}"
    return (Frame(title, Axis("factor on the start", "1", "log"), Axis("", "", names=t.names), tuple(there)),)


@draw.register(Tuning)
def plot_tuning(t: Tuning, *, axes: GivenAxes | None = None) -> Figure:
    """Plot each parameter relative to its start, with its interval; those that the record does not show are marked.

    Parameters
    ----------
    t
        The tuning.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> figure = nj.plotting.plot_tuning(nj.tune(imu, [fixes], filter, **start, max_steps=3))
    >>> figure.savefig("tuning.png")
    """
    (frame,) = tuning_data(t)
    figure, (ax,) = frames(axes, 1, 1, (9.0, 1.6 + 0.42 * len(t.names)))
    for item in frame.items:
        style = _STYLES.get(item.label, {"color": COLOURS[0]})
        if isinstance(item, Bars):
            style = {**style, "fmt": "o", "capsize": 4, "lw": 1.6}
        elif isinstance(item, Points):
            style = {**style, "ls": "", "mfc": "none", "mew": 1.8}
        put(ax, item, **style)
    describe(ax, frame, fontsize=11)
    ax.set(yticks=range(len(t.names)), yticklabels=t.names, ylim=(len(t.names) - 0.5, -0.5))
    ax.set_xlim(1 / _widest(t), _widest(t))
    logarithmic(ax, "x")
    grid(ax)
    legend_below(figure, [ax], alone=axes is None)
    return figure


def _widest(t: Tuning) -> float:
    """The end of the axis."""
    low, high = np.sort([t.ci_low / t.start, t.ci_high / t.start], axis=0)
    return float(1.3 * np.nanmax([2.0, *high, *(1 / positive(low))]))
