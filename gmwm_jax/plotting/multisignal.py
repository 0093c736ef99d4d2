"""Figures of several records: joint fit, parameters by record, test of near-stationarity, cross-validation."""

import math
from collections.abc import Iterator
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Bars, Frame, Histogram, Item, Line, Mark, Span
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax._internal.palette import COLOURS, MARKERS
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.multisignal.comparison import RecordComparison
from gmwm_jax.multisignal.cross_validation import CrossValidation
from gmwm_jax.multisignal.joint import JointFit
from gmwm_jax.multisignal.stationarity import NearStationarity
from gmwm_jax.plotting._style import (
    DRAWS,
    FIT,
    VERDICTS,
    dense_scales,
    draw,
    draws_channels_of,
    few_ticks,
    finish_log_log,
    in_half_widths,
    in_standard_units,
    large_and_small,
    pairs_of_frames,
    scale_axis,
    variance_axis,
)
from gmwm_jax.processes.parameter import Parameter

_RECORDS = (COLOURS[0], *COLOURS[2:])
"""The joint fit has the colour that is left out."""

_MOST_NAMES = 8
"""Records that a legend names one by one."""


def joint_fit_data(joint: JointFit) -> tuple[Frame, Frame]:
    """Return what `plot_joint_fit` shows: the variances, and the residuals in half widths of the confidence interval.

    Parameters
    ----------
    joint
        The joint fit of one channel.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> frames = gj.plotting.joint_fit_data(joint)
    """
    dense = dense_scales(joint.wv)
    t = dense / (joint.wv.rate or 1.0)
    above: list[Item] = []
    if all(r.wv.num_scales >= joint.model.num_free for r in joint.records):
        alone = np.array([f.model.wavelet_variance(dense) for f in joint.singles])
        above.append(Band("range of single fits", t, alone.min(axis=0), alone.max(axis=0)))
    interval = f"{100 * joint.wv.level:g} % interval of one scale"
    below: list[Item] = [Span(interval, -1.0, 1.0, "y"), Mark("", 0.0, "y")]
    few = len(joint.records) <= _MOST_NAMES
    for i, (name, r) in enumerate(zip(joint.names, joint.records, strict=True)):
        label = (f"record {name}" if name.isdigit() else name) if few else "records" if i == 0 else ""
        above.append(Line(label, r.wv.times, r.wv.variance))
        below.append(Line("", r.wv.times, in_half_widths(r.wv, r.residuals)))
    above.append(Line("joint fit", t, np.asarray(joint.model.wavelet_variance(dense))))
    model = f"{' + '.join(joint.model.labels)}, objective {joint.objective:.5g}"
    title = f"{joint.wv.channels[0]}, {len(joint.records)} records: {model}"
    return (
        Frame(title, scale_axis(joint.wv), variance_axis(joint.fit.unit), tuple(above)),
        Frame("", scale_axis(joint.wv), Axis("residual", "half CI", "symlog"), tuple(below)),
    )


@draw.register(JointFit)
def plot_joint_fit(joint: JointFit, *, axes: GivenAxes | None = None) -> Figure:
    """Plot the wavelet variances of all records with the joint and the single fits, and below the residuals.

    Parameters
    ----------
    joint
        The joint fit of one channel.
    axes
        Two Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> figure = gj.plotting.plot_joint_fit(joint)
    >>> figure.savefig("joint_fit.png")
    """
    above, below = joint_fit_data(joint)
    figure, (top, bottom) = large_and_small(axes)
    finish_log_log(top, above)
    *more, model = above.items
    styles = _record_styles()
    for item in more:
        if isinstance(item, Band):
            put(top, item, color=FIT, alpha=0.18)
        else:
            put(top, item, lw=0.8, **next(styles))
    put(top, model, color=FIT, lw=3.2, alpha=0.8, zorder=1.9)
    top.set_title(above.title, fontsize=10)
    top.set_xlabel("")
    describe(bottom, below, apart="\n")
    interval, zero, *records = below.items
    put(bottom, interval, color="0.5", alpha=0.15)
    put(bottom, zero, color="0.4", lw=0.8)
    for item, style in zip(records, _record_styles(), strict=False):
        put(bottom, item, lw=0.5, **style)
    bottom.set_xscale(below.x.scale)
    in_standard_units(bottom)
    legend_below(figure, (top, bottom), alone=axes is None)
    return figure


def _record_styles() -> Iterator[dict[str, Any]]:
    """Colours and markers that both repeat, after different numbers of records."""
    for colour, marker in zip(cycle(_RECORDS), cycle(MARKERS), strict=False):
        yield {"color": colour, "marker": marker, "ms": 4, "mfc": "none"}


def joint_fits_data(joints: Channels[JointFit]) -> tuple[Frame, ...]:
    """Return what `plot_joint_fits` shows: two frames for each channel, see `joint_fit_data`.

    Parameters
    ----------
    joints
        The joint fits of several channels.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 2)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x", "accel_y"]) for key in keys]
    >>> frames = gj.plotting.joint_fits_data(gj.fit_records([gj.wavelet_variance(rec) for rec in records], "WN + RW"))
    """
    shown = []
    for joint in joints.values():
        above, below = joint_fit_data(joint)
        shown += [above._replace(title=f"{joint.wv.channels[0]}: objective {joint.objective:.4g}"), below]
    return tuple(shown)


@draws_channels_of(JointFit)
def plot_joint_fits(joints: Channels[JointFit], *, axes: GivenAxes | None = None) -> Figure:
    """Plot one panel for each channel, see `plot_joint_fit`.

    Parameters
    ----------
    joints
        The joint fits of several channels.
    axes
        Two Axes a channel to draw into, of shape (2, channels), the small ones below; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 2)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x", "accel_y"]) for key in keys]
    >>> figure = gj.plotting.plot_joint_fits(gj.fit_records([gj.wavelet_variance(rec) for rec in records], "WN + RW"))
    >>> figure.savefig("joint_fits.png")
    """
    figure, pairs = pairs_of_frames(axes, len(joints), 4.8)
    for joint, frame, (top, bottom) in zip(joints.values(), joint_fits_data(joints)[::2], pairs, strict=True):
        plot_joint_fit(joint, axes=(top, bottom))
        top.set_title(frame.title, fontsize=10)
        top.tick_params(labelbottom=False)
        top.get_legend().remove()  # type: ignore[union-attr]
    legend_below(figure, [ax for pair in pairs for ax in pair], alone=axes is None)
    return figure


def record_comparison_data(comparison: RecordComparison) -> tuple[Frame, ...]:
    """Return what `plot_record_comparison` shows: a frame for each parameter.

    Parameters
    ----------
    comparison
        Of one channel.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> frames = gj.plotting.record_comparison_data(gj.multisignal.compare_records(joint))
    """
    joint = comparison.joint
    numbers = np.arange(1, len(joint.records) + 1)
    parameters = {
        (label, q.name): (q, q.unit.format(u=joint.fit.unit), value) for label, q, value in _parameters(joint)
    }
    z = normal_quantile(joint.level)
    shown = []
    for i, spread in enumerate(comparison.spreads):
        q, unit, value = parameters[spread.component, spread.symbol]
        x, half = comparison.estimates[:, i], z * np.sqrt(comparison.covariances[:, i, i])
        seen = np.isfinite(x)
        at, low, high = (np.asarray(q.from_line(e))[seen] for e in (x, x - half, x + half))
        scale = "log" if np.any(seen) and high.max() > 3 * low.min() > 0 else "linear"
        items = (Bars(f"single, {100 * joint.level:g} %", numbers[seen], at, low, high), Mark("joint", value, "y"))
        title = f"p = {spread.p_value:.2g}, between records {100 * spread.between:.2g} %"
        of = Axis(f"{spread.component} {spread.symbol}", unit, scale)
        shown.append(Frame(title, Axis("record", ""), of, items))
    return tuple(shown)


@draw.register(RecordComparison)
def plot_record_comparison(comparison: RecordComparison, *, axes: GivenAxes | None = None) -> Figure:
    """Plot a panel for each parameter: each record's estimate with its interval, and the joint estimate.

    Parameters
    ----------
    comparison
        Of one channel.
    axes
        An Axes for each parameter to draw into; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> figure = gj.plotting.plot_record_comparison(gj.multisignal.compare_records(joint))
    >>> figure.savefig("record_comparison.png")
    """
    shown, num = record_comparison_data(comparison), len(comparison.joint.records)
    columns = min(3, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure, drawn = frames(axes, rows, columns, (4.2 * columns, 0.5 + 3.2 * rows), num=len(shown))
    for ax, frame in zip(drawn, shown, strict=True):
        singles, joint = frame.items
        put(ax, singles, fmt="o", color=DRAWS, ms=4, capsize=3)
        put(ax, joint, color=FIT, lw=1.4)
        describe(ax, frame, fontsize=9)
        ax.set_xticks(range(1, num + 1))
        ax.set_yscale(frame.y.scale)
        ax.set_xlim(0.5, num + 0.5)
    legend_below(figure, drawn, alone=axes is None)
    if axes is None:
        what = f"{comparison.joint.wv.channels[0]}: the same in all {num} records? p = {comparison.p_value:.2g}"
        figure.suptitle(what, fontsize=10)
    return figure


def _parameters(joint: JointFit) -> Iterator[tuple[str, Parameter, float]]:
    """Label, parameter and joint estimate."""
    for label, p in zip(joint.model.labels, joint.model.processes, strict=True):
        for q, value in zip(p.parameters, p.values, strict=True):
            yield label, q, float(value)


def near_stationarity_data(test: NearStationarity) -> tuple[Frame]:
    """Return what `plot_near_stationarity` shows.

    Parameters
    ----------
    test
        Of one channel.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> frames = gj.plotting.near_stationarity_data(gj.multisignal.near_stationarity(joint, 20, key=jax.random.key(0)))
    """
    good = test.objective[test.converged]
    far = test.joint.objective > 3 * good.max() or test.joint.objective < good.min() / 3
    edges = np.geomspace(good.min(), good.max(), 31) if far else np.linspace(good.min(), good.max(), 31)
    items = (
        Histogram("records with the same parameters", edges, np.histogram(good, edges)[0]),
        Mark(f"data, p = {test.p_value:.2g}", test.joint.objective),
    )
    title = f"{test.joint.wv.channels[0]}, {len(test.joint.records)} records: {' + '.join(test.joint.model.labels)}"
    return (Frame(title, Axis("joint objective", "", "log" if far else "linear"), Axis("replicates", ""), items),)


@draw.register(NearStationarity)
def plot_near_stationarity(test: NearStationarity, *, axes: GivenAxes | None = None) -> Figure:
    """Plot joint objectives of records with the same parameters, and that of the data.

    Parameters
    ----------
    test
        Of one channel.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> figure = gj.plotting.plot_near_stationarity(gj.multisignal.near_stationarity(joint, 20, key=jax.random.key(0)))
    >>> figure.savefig("near_stationarity.png")
    """
    (frame,) = near_stationarity_data(test)
    figure, (ax,) = frames(axes, 1, 1, (6, 3.9))
    replicates, data = frame.items
    put(ax, replicates, color=DRAWS, alpha=0.6)
    put(ax, data, color=FIT, lw=1.6)
    describe(ax, frame, fontsize=10)
    few_ticks(ax, frame.x.scale)
    legend_below(figure, (ax,), alone=axes is None)
    return figure


def cross_validation_data(cv: CrossValidation) -> tuple[Frame]:
    """Return what `plot_cross_validation` shows: the models in rows from the top.

    Parameters
    ----------
    cv
        Of one channel.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> frames = gj.plotting.cross_validation_data(gj.multisignal.cross_validate(units, ["WN", "WN + RW"]))
    """
    at, half = (np.array([getattr(p, what) for p in cv.scores]) for what in ("difference", "difference_error"))
    positive = at[at > 0]
    scale = "symlog" if len(positive) and positive.max() > 100 * positive.min() else "linear"
    channel, count = cv.fits[0].wv.channels[0], cv.splits.shape[1]
    names = tuple(f"{p.model} ({p.num_parameters})" for p in cv.scores)
    groups: dict[str, list[int]] = {}
    for row, p in enumerate(cv.scores):
        group = "recommended" if p is cv.recommended else "equivalent" if p.equivalent else "worse"
        groups.setdefault(group, []).append(row)
    bars = (
        Bars(label, at[rows], np.array(rows, float), (at - half)[rows], (at + half)[rows], lying=True)
        for label, rows in groups.items()
    )
    x = Axis("CV-WVIC above the best (± standard error)", "", scale)
    return (Frame(f"{channel}, {count} records", x, Axis("", "", names=names), (*bars, Mark("", 0.0))),)


@draw.register(CrossValidation)
def plot_cross_validation(cv: CrossValidation, *, axes: GivenAxes | None = None) -> Figure:
    """Plot the difference of each model to the best, with its standard error over records.

    Parameters
    ----------
    cv
        Of one channel.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> figure = gj.plotting.plot_cross_validation(gj.multisignal.cross_validate(units, ["WN", "WN + RW"]))
    >>> figure.savefig("cross_validation.png")
    """
    figure, (ax,) = frames(axes, 1, 1, (6.4, 1.2 + 0.42 * len(cv)))
    _draw_scores(ax, cv, *cross_validation_data(cv))
    legend_below(figure, (ax,), alone=axes is None)
    return figure


def cross_validations_data(validations: Channels[CrossValidation]) -> tuple[Frame, ...]:
    """Return what `plot_cross_validations` shows: the frame of each channel, see `cross_validation_data`.

    Parameters
    ----------
    validations
        Of several channels.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x", "accel_y"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> frames = gj.plotting.cross_validations_data(gj.multisignal.cross_validate(units, ["WN", "WN + RW"]))
    >>> len(frames)
    2
    """
    return tuple(frame for cv in validations.values() for frame in cross_validation_data(cv))


@draws_channels_of(CrossValidation)
def plot_cross_validations(validations: Channels[CrossValidation], *, axes: GivenAxes | None = None) -> Figure:
    """Plot one panel for each channel, see `plot_cross_validation`.

    Parameters
    ----------
    validations
        Of several channels.
    axes
        As many Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x", "accel_y"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> figure = gj.plotting.plot_cross_validations(gj.multisignal.cross_validate(units, ["WN", "WN + RW"]))
    >>> figure.savefig("cross_validations.png")
    """
    height = 0.9 + 0.42 * len(validations[0])
    figure, panels = frames(axes, len(validations), 1, (6.4, 0.3 + height * len(validations)))
    for ax, cv, frame in zip(panels, validations.values(), cross_validations_data(validations), strict=True):
        _draw_scores(ax, cv, frame)
    legend_below(figure, panels, alone=axes is None)
    return figure


def _draw_scores(ax: Axes, cv: CrossValidation, frame: Frame) -> None:
    """One channel."""
    *groups, zero = frame.items
    for group in groups:
        put(ax, group, capsize=3, ms=5, **VERDICTS[group.label])
    put(ax, zero, color="0.4", lw=0.8)
    ax.set_yticks(range(len(cv)), frame.y.names)
    ax.set_ylim(len(cv) - 0.5, -0.5)
    if frame.x.scale == "symlog":
        smallest = 10.0 ** math.floor(math.log10(min(p.difference for p in cv.scores if p.difference > 0)))
        ax.set_xscale("symlog", linthresh=smallest)
        ax.set_xlim(left=-smallest)
    describe(ax, frame, fontsize=10)
