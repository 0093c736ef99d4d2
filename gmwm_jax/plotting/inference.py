"""Figures of a model selection, and of a bootstrap."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Bars, Frame, Histogram, Item, Mark, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.intervals import replicates_needed
from gmwm_jax.inference.selection import Selection
from gmwm_jax.plotting._style import DRAWS, FIT, VERDICTS, draw, draws_channels_of, few_ticks

_SHOWN = 20
_RECOMMENDED, _EQUIVALENT, _WORSE = "recommended: the simplest of these", "none is significantly better", "worse"
_STYLES: dict[str, dict[str, str]] = dict(zip((_RECOMMENDED, _EQUIVALENT, _WORSE), VERDICTS.values(), strict=True))
_THEORY = "0.35"


def selection_data(selection: Selection) -> tuple[Frame]:
    """Return what `plot_selection` shows: the twenty lowest candidates, in rows from the top.

    Parameters
    ----------
    selection
        Of one channel.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.selection_data(gj.select(rec, "WN + RW"))
    """
    shown = [c for c in selection.candidates if c.sound][:_SHOWN]
    equivalent = {c.name for c in selection.equivalent}
    groups: dict[str, list[int]] = {}
    for row, c in enumerate(shown):
        group = _EQUIVALENT if c.name in equivalent else _WORSE
        groups.setdefault(_RECOMMENDED if c is selection.recommended else group, []).append(row)
    at = np.array([c.difference for c in shown])
    half = normal_quantile(selection.level) * np.array([c.standard_error for c in shown])
    bars = (
        Bars(label, at[rows], np.array(rows), (at - half)[rows], (at + half)[rows], lying=True)
        for label, rows in groups.items()
    )
    title = f"{selection.superset.wv.channels[0]}: {len(selection)} models"
    label = f"WVIC, difference to the lowest, with {100 * selection.level:g} % intervals"
    names = tuple(f"{c.name}  ({c.num_parameters})" for c in shown)
    scale = "symlog" if np.any(half > 0) else "linear"
    rows = Axis("model (number of parameters)", "", names=names)
    return (Frame(title, Axis(label, "", scale), rows, (*bars, Mark("", 0.0))),)


@draw.register(Selection)
def plot_selection(selection: Selection, *, axes: GivenAxes | None = None) -> Figure:
    """Plot differences of the criterion to the best candidate, with intervals; the lowest at the top.

    Parameters
    ----------
    selection
        The twenty lowest candidates are drawn.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_selection(gj.select(rec, "WN + RW"))
    >>> figure.savefig("selection.png")
    """
    (frame,) = selection_data(selection)
    figure, (ax,) = frames(axes, 1, 1, (7.5, 1.8 + 0.28 * len(frame.y.names)))
    _draw_candidates(ax, frame, selection.level)
    legend_below(figure, (ax,), alone=axes is None)
    return figure


def selections_data(selections: Channels[Selection]) -> tuple[Frame, ...]:
    """Return what `plot_selections` shows: a frame for each channel, see `selection_data`.

    Parameters
    ----------
    selections
        Of several channels.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x", "accel_y"])
    >>> frames = gj.plotting.selections_data(gj.select(rec, "WN + RW"))
    """
    return tuple(frame for selection in selections.values() for frame in selection_data(selection))


@draws_channels_of(Selection)
def plot_selections(selections: Channels[Selection], *, axes: GivenAxes | None = None) -> Figure:
    """Plot a frame for each channel, three in a row, each as of `plot_selection`.

    Parameters
    ----------
    selections
        Of several channels.
    axes
        An Axes for each channel to draw into; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x", "accel_y"])
    >>> figure = gj.plotting.plot_selections(gj.select(rec, "WN + RW"))
    >>> figure.savefig("selections.png")
    """
    shown = selections_data(selections)
    columns = min(3, len(shown))
    rows = math.ceil(len(shown) / columns)
    size = (6.2 * columns, 0.4 + rows * (1.4 + 0.28 * max(len(frame.y.names) for frame in shown)))
    figure, drawn = frames(axes, rows, columns, size, num=len(shown))
    for ax, frame, selection in zip(drawn, shown, selections.values(), strict=True):
        _draw_candidates(ax, frame, selection.level)
    legend_below(figure, drawn, alone=axes is None)
    return figure


def _draw_candidates(ax: Axes, frame: Frame, level: float) -> None:
    describe(ax, frame, fontsize=10)
    *groups, zero = frame.items
    for group in groups:
        put(ax, group, capsize=3, **_STYLES[group.label])
    put(ax, zero, color="0.3", lw=0.8)
    ax.set_yticks(range(len(frame.y.names)), frame.y.names)
    ax.invert_yaxis()
    if frame.x.scale == "symlog":
        at, high = (np.concatenate(ends) for ends in zip(*((g.x, g.high) for g in groups), strict=True))  # type: ignore
        half = high - at
        around = float(np.median(half[half > 0])) / normal_quantile(level)
        ax.set_xscale("symlog", linthresh=around)
        # around zero, where the axis is linear, powers of ten would be written over each other
        powers = 10.0 ** np.arange(math.ceil(math.log10(around)), 1 + math.log10(max(high.max(), 10 * around)))
        ax.set_xticks([0.0, *powers])
        ax.set_xlim(float(np.min(at - 1.3 * half)) - 0.3 * around, 2.0 * max(float(high.max()), around))


def bootstrap_data(boot: Bootstrap) -> tuple[Frame, ...]:
    """Return what `plot_bootstrap` shows: a frame for each parameter that varies.

    Parameters
    ----------
    boot
        The replicates.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> frames = gj.plotting.bootstrap_data(gj.bootstrap(fit, 20, key=jax.random.key(0)))
    """
    enough = len(boot.good) >= replicates_needed(boot.fit.level)
    theory, shown = boot.fit.parameters(), boot.parameters() if enough else boot.fit.parameters()
    pairs = list(zip(shown, theory, strict=True))
    varies = [i for i in range(boot.good.shape[1]) if np.ptp(boot.good[:, i]) > 0]
    return tuple(_parameter(boot.good[:, i], *pairs[i], boot.fit.level, enough) for i in varies)


def _parameter(draws: np.ndarray, own: Estimate, theory: Estimate, level: float, enough: bool) -> Frame:
    positive = draws[draws > 0]
    gone = 100 * (1 - len(positive) / len(draws))
    absent = f"{gone:.2g} % of the replicates at zero" if gone else ""
    wide = positive.max() > 5 * positive.min()
    edges = (np.geomspace if wide else np.linspace)(positive.min(), positive.max(), 31)
    items: list[Item] = [Histogram("replicates", edges, np.histogram(positive, edges)[0])]
    if own.value > 0:
        items.append(Mark("estimate", own.value))
    if enough and own.ci_high > 0:
        items.append(Span(f"{100 * level:g} % percentile", max(own.ci_low, float(edges[0])), own.ci_high))
    if np.isfinite(theory.ci_low):
        items += [Mark(f"{100 * level:g} % theory", theory.ci_low), Mark("", theory.ci_high)]
    scale = "log" if wide else "linear"
    x = Axis(f"{own.component} {own.symbol}", own.unit, scale)
    return Frame(absent, x, Axis("number of replicates", ""), tuple(items))


@draw.register(Bootstrap)
def plot_bootstrap(boot: Bootstrap, *, axes: GivenAxes | None = None) -> Figure:
    """Plot a panel for each parameter: replicates, the estimate, percentile interval and that of theory.

    Parameters
    ----------
    boot
        The replicates.
    axes
        An Axes for each parameter that varies to draw into; a new figure if left out.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> figure = gj.plotting.plot_bootstrap(gj.bootstrap(fit, 20, key=jax.random.key(0)))
    >>> figure.savefig("bootstrap.png")
    """
    shown = bootstrap_data(boot)
    columns = min(3, max(1, len(shown)))
    rows = max(1, math.ceil(len(shown) / columns))
    figure, drawn = frames(axes, rows, columns, (4.4 * columns, 0.6 + 3.2 * rows), num=len(shown))
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame, fontsize=9)
        for item in frame.items:
            match item:
                case Histogram():
                    put(ax, item, color=DRAWS, alpha=0.6)
                case Span():
                    put(ax, item, color=FIT, alpha=0.12)
                case Mark(label="estimate"):
                    put(ax, item, color=FIT, lw=1.5)
                case _:
                    put(ax, item, color=_THEORY, ls="--", lw=1)
        few_ticks(ax, frame.x.scale)
    legend_below(figure, drawn, alone=axes is None)
    if axes is None:
        what = f"{boot.fit.wv.channels[0]}: {len(boot.good)} replicates by {boot.route}"
        figure.suptitle(f"{what}; p = {boot.p_value:.2g} for the model", fontsize=10)
    return figure
