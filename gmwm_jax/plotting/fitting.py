"""Figures of fits: data, model and its components over scale, residuals below."""

from collections import Counter
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Frame, Item, Line, Mark, Points, Span
from gmwm_jax._internal.figures import describe, entries_of, frames, legend_below, put
from gmwm_jax.fitting.influences import Influence
from gmwm_jax.fitting.result import Fit
from gmwm_jax.plotting._style import (
    DATA,
    FIT,
    TIME,
    band_title,
    by_unit,
    component_style,
    datasheet_items,
    dense_scales,
    draw,
    draw_datasheet,
    draw_variances,
    draws_channels_of,
    in_half_widths,
    large_and_small,
    lowest,
    pairs_of_frames,
    scale_axis,
    title_of,
    variance_axis,
    variance_items,
)
from gmwm_jax.processes.datasheet import Datasheet

_ZERO = ": zero"
_NONE = np.array([])


def fit_data(fit: Fit, *, datasheet: Datasheet | None = None) -> tuple[Frame, Frame]:
    """Return what `plot_fit` shows: the variances, and the residuals in half widths of the confidence interval.

    Parameters
    ----------
    fit
        The fit of one channel.
    datasheet
        A model of what the datasheet promises; by unit if there are several.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> frames = gj.plotting.fit_data(fit)
    """
    wv, dense = fit.wv, dense_scales(fit.wv)
    t = dense / (wv.rate or 1.0)
    items = variance_items(wv, "wavelet variance", fit.shown)
    items.append(Line("fit", t, np.asarray(fit.model.wavelet_variance(dense))))
    for label, p in zip(fit.model.labels, fit.model.processes, strict=True):
        if float(p.amplitude) > 0:
            items.append(Line(label, t, np.asarray(p.wavelet_variance(dense))))
        else:
            items.append(Line(f"{label}{_ZERO}", _NONE, _NONE))
    items += datasheet_items(wv, by_unit(datasheet, wv.units))
    kinds = Counter(p.kind for p in fit.model.processes)
    model = " + ".join(kind if count == 1 else f"{count} {kind}" for kind, count in kinds.items())
    title = f"{title_of(wv, [0])}: {model}, objective {fit.objective:.5g}"
    residuals = (
        Span(f"{100 * wv.level:g} % interval of one scale", -1.0, 1.0, "y"),
        Mark("", 0.0, "y"),
        Points("", wv.times, in_half_widths(wv, fit.residuals, fit.shown)),
    )
    return (
        Frame(title, scale_axis(wv), variance_axis(fit.unit), tuple(items)),
        Frame("", scale_axis(wv), Axis("residual", "half CI"), residuals),
    )


@draw.register(Fit)
def plot_fit(fit: Fit, *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
    """Plot wavelet variance, fit and components over scale, and below the residuals in half widths of the interval.

    Parameters
    ----------
    fit
        The fit of one channel.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        Two Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> fit = gj.fit(wv, "WN + RW")
    >>> figure = gj.plotting.plot_fit(fit)
    >>> figure.savefig("fit.png")
    """
    above, below = fit_data(fit, datasheet=datasheet)
    figure, (top, bottom) = large_and_small(axes)
    model, *more = draw_variances(top, above)
    put(top, model, color=FIT, lw=3.2, alpha=0.8, zorder=1.9)  # below the data, and below a part that is nearly all
    num = len(fit.model.labels)
    for i, item in enumerate(more[:num]):
        put(top, item, zorder=3, **component_style(i))
    draw_datasheet(top, more[num:])
    top.set_title(above.title, fontsize=10)
    top.set_xlabel("")
    top.set_ylim(lowest(fit.shown.low, fit.wv.variance) / 4, np.max(fit.shown.high) * 3)
    describe(bottom, below, apart="\n")
    bottom.set_xscale(below.x.scale)
    interval, zero, pulls = below.items
    put(bottom, interval, color=DATA, alpha=0.12)
    put(bottom, zero, color="0.4", lw=0.8)
    put(bottom, pulls, marker="o", ls="", color=FIT, ms=4)
    limit = max(1.3, 1.15 * float(np.max(np.abs(in_half_widths(fit.wv, fit.residuals, fit.shown)))))
    bottom.set_ylim(-limit, limit)
    legend_below(figure, (top, bottom), alone=axes is None, **band_title(fit.shown))
    return figure


def fits_data(fits: Channels[Fit], *, datasheet: Datasheet | None = None) -> tuple[Frame, ...]:
    """Return what `plot_fits` shows: two frames for each channel, see `fit_data`.

    Parameters
    ----------
    fits
        The fits of several channels.
    datasheet
        A model of what the datasheet promises; by unit if there are several.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x", "accel_y"])
    >>> frames = gj.plotting.fits_data(gj.fit(rec, "WN + RW"))
    """
    models = by_unit(datasheet, [fit.unit for fit in fits.values()])
    shown = []
    for fit in fits.values():
        above, below = fit_data(fit, datasheet=models.get(fit.unit))
        gone = [item.label.removesuffix(_ZERO) for item in above.items if item.label.endswith(_ZERO)]
        note = f", {', '.join(gone)} zero" if gone else ""
        shown += [above._replace(title=f"{fit.wv.channels[0]}: objective {fit.objective:.4g}{note}"), below]
    return tuple(shown)


@draws_channels_of(Fit)
def plot_fits(fits: Channels[Fit], *, datasheet: Datasheet | None = None, axes: GivenAxes | None = None) -> Figure:
    """Plot one panel for each channel, see `plot_fit`, with one legend for all.

    Parameters
    ----------
    fits
        The fits of several channels.
    datasheet
        A model of what the datasheet promises, drawn as a line; by unit if there are several.
    axes
        Two Axes a channel to draw into, of shape (2, channels), the small ones below; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x", "accel_y"])
    >>> figure = gj.plotting.plot_fits(gj.fit(rec, "WN + RW"))
    >>> figure.savefig("fits.png")
    """
    models, shown = by_unit(datasheet, [fit.unit for fit in fits.values()]), fits_data(fits, datasheet=datasheet)
    figure, pairs = pairs_of_frames(axes, len(fits), 4.6)
    entries: dict[str, Any] = {}
    for fit, frame, (top, bottom) in zip(fits.values(), shown[::2], pairs, strict=True):
        plot_fit(fit, datasheet=models.get(fit.unit), axes=(top, bottom))
        top.set_title(frame.title, fontsize=10)
        top.tick_params(labelbottom=False)
        for label, handle in entries_of(top, bottom).items():
            entries.setdefault(label.removesuffix(_ZERO), handle)
        top.get_legend().remove()  # type: ignore[union-attr]
    frames = [ax for pair in pairs for ax in pair]
    legend_below(figure, frames, alone=axes is None, entries=entries, **band_title(fits[0].shown))
    return figure


def influence_data(influence: Influence) -> tuple[Frame, ...]:
    """Return what `plot_influence` shows: elasticities over scale, and changes without each block where there are any.

    Parameters
    ----------
    influence
        Of one channel. Estimates that are zero have no elasticity.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> frames = gj.plotting.influence_data(gj.fitting.influence(rec, "WN + RW"))
    """
    wv, values = influence.wv, influence.values
    shown = [i for i, value in enumerate(values) if value != 0]
    title = f"{wv.channels[0]}: {' + '.join(influence.model.labels)}"
    curves = [Line(influence.names[i], wv.times, influence.elasticities[i]) for i in shown]
    scales = Frame(title, scale_axis(wv), Axis("elasticity", "1"), (Mark("", 0.0, "y"), *curves))
    if influence.without_block is None or influence.block is None:
        return (scales,)
    t = influence.block_times + influence.block / 2
    items: list[Item] = [Mark("", 0.0, "y")]
    for i in shown:
        linear, exact = (100 * c[i] / values[i] for c in (influence.without_block_linear, influence.without_block))
        items += [Line("", t, linear), Points(influence.names[i], t, exact)]
    blocks = Frame("", TIME, Axis(f"change without {influence.block:g} s", "%"), tuple(items))
    return scales, blocks


@draw.register(Influence)
def plot_influence(influence: Influence, *, axes: GivenAxes | None = None) -> Figure:
    """Plot elasticities over scale, and below what leaving out each block changes: points refitted, lines linear.

    Parameters
    ----------
    influence
        Of one channel.
    axes
        An Axes to draw into, and one more where there are blocks; a new figure if left out.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figure = gj.plotting.plot_influence(gj.fitting.influence(rec, "WN + RW"))
    >>> figure.savefig("influence.png")
    """
    shown = influence_data(influence)
    figure, drawn = frames(axes, len(shown), 1, (7.5, 0.8 + 2.8 * len(shown)))
    for ax, frame in zip(drawn, shown, strict=True):
        describe(ax, frame, fontsize=10)
        ax.set_xscale(frame.x.scale)
        zero, *items = frame.items
        put(ax, zero, color="0.4", lw=0.8)
        for i, item in enumerate(items):
            own = component_style(i if ax is drawn[0] else i // 2)
            match item:
                case Points():
                    put(ax, item, marker="o", ms=3.5, ls="", color=own["color"])
                case Line(label=""):
                    put(ax, item, lw=1, color=own["color"])
                case _:
                    put(ax, item, marker="o", ms=3.5, **own)
    legend_below(figure, drawn, alone=axes is None, entries=entries_of(drawn[0]))
    return figure
