"""Figures of several records: joint fit, parameters by record, test of near-stationarity, cross-validation."""

import math
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.figures import GivenAxes, frames
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.multisignal.comparison import RecordComparison
from gmwm_jax.multisignal.cross_validation import CrossValidation
from gmwm_jax.multisignal.joint import JointFit, JointFits
from gmwm_jax.multisignal.stationarity import NearStationarity
from gmwm_jax.plotting._style import draw, large_and_small, pairs_of_frames

_FIT, _DRAWS = "#c23b22", "#2a7f8e"
_RECORDS = ("#2a7f8e", "#7a4fa3", "#d98e04", "#4c9a2a", "#1f4e79", "#b5628c")
_MOST_NAMES = 8
"""Records that a legend names one by one."""


@draw.register(JointFit)
def plot_joint_fit(joint: JointFit, *, axes: GivenAxes | None = None) -> Figure:
    """Wavelet variances of all records, the joint fit, the range of the single fits; below, residuals of each record.

    Parameters
    ----------
    joint
        The joint fit of one channel.
    axes
        Two Axes to draw into; a new figure if left out.
    """
    figure, (top, bottom) = large_and_small(axes)
    rate, tau = joint.wv.rate or 1.0, joint.wv.scales
    dense = np.unique(2 * np.round(np.geomspace(tau[0], tau[-1], 200) / 2))
    if all(r.wv.num_scales >= joint.model.num_free for r in joint.records):
        alone = np.array([f.model.wavelet_variance(dense) for f in joint.singles])
        low, high = alone.min(axis=0), alone.max(axis=0)
        top.fill_between(dense / rate, low, high, color=_FIT, alpha=0.18, lw=0, label="range of single fits")
    bottom.axhspan(-1, 1, color="0.5", alpha=0.15, lw=0, label=f"{100 * joint.wv.level:g} % interval of one scale")
    bottom.axhline(0, color="0.4", lw=0.8)
    few = len(joint.records) <= _MOST_NAMES
    for i, (name, r, colour) in enumerate(zip(joint.names, joint.records, cycle(_RECORDS), strict=False)):
        wv = r.wv
        label = (f"record {name}" if name.isdigit() else name) if few else "records" if i == 0 else None
        top.loglog(wv.times, wv.variance, "o-", color=colour, ms=2.5, lw=0.8, label=label)
        half = np.where(r.residuals > 0, wv.variance - wv.ci_low, wv.ci_high - wv.variance)
        bottom.plot(wv.times, r.residuals / half, "o-", color=colour, ms=2.5, lw=0.5)
    top.loglog(dense / rate, np.asarray(joint.model.wavelet_variance(dense)), color=_FIT, lw=1.8, label="joint fit")
    unit = joint.unit.replace("^2", "²")
    top.set_ylabel("wavelet variance [1]" if unit == "1" else f"wavelet variance [({unit})²]")
    top.grid(True, which="major", color="0.88", lw=0.6)
    top.set_axisbelow(True)
    top.legend(fontsize=8)
    labels = " + ".join(joint.model.labels)
    channel = joint.wv.channels[0]
    top.set_title(f"{channel}, {len(joint.records)} records: {labels}, objective {joint.objective:.5g}", fontsize=10)
    bottom.set_yscale("symlog", linthresh=4)
    bottom.set_yticks([y for y in (-100, -10, 0, 10, 100) if abs(y) < 1.3 * np.abs(bottom.get_ylim()).max()])
    bottom.set_ylabel("residual\n[half CI]")
    bottom.set_xlabel("scale τ [s]" if joint.wv.rate else "scale τ [samples]")
    bottom.legend(fontsize=8, loc="best")
    return figure


@draw.register(JointFits)
def plot_joint_fits(joints: JointFits, *, axes: GivenAxes | None = None) -> Figure:
    """One panel a channel, see `plot_joint_fit`.

    Parameters
    ----------
    joints
        The joint fits of several channels.
    axes
        Two Axes a channel to draw into, of shape (2, channels), the small ones below; a new figure if left out.
    """
    figure, pairs = pairs_of_frames(axes, len(joints), 4.8, 0.0)
    for i, (joint, (top, bottom)) in enumerate(zip(joints.values(), pairs, strict=True)):
        plot_joint_fit(joint, axes=(top, bottom))
        top.set_title(f"{joint.wv.channels[0]}: objective {joint.objective:.4g}", fontsize=10)
        top.tick_params(labelbottom=False)
        bottom.get_legend().remove()  # type: ignore[union-attr]
        if i:
            top.get_legend().remove()  # type: ignore[union-attr]
    return figure


@draw.register(RecordComparison)
def plot_record_comparison(comparison: RecordComparison, *, axes: GivenAxes | None = None) -> Figure:
    """A panel a parameter: each record's estimate with its interval, and the joint estimate.

    Parameters
    ----------
    comparison
        Of one channel.
    axes
        An Axes for each parameter to draw into; a new figure if left out.
    """
    joint, spreads = comparison.joint, comparison.spreads
    columns = min(3, len(spreads))
    rows = math.ceil(len(spreads) / columns)
    figure, drawn = frames(axes, rows, columns, (4.2 * columns, 3.2 * rows), num=len(spreads))
    numbers = np.arange(1, len(joint.records) + 1)
    parameters = {(label, q.name): (q, q.unit.format(u=joint.unit), value) for label, q, value in _parameters(joint)}
    z = normal_quantile(joint.level)
    for i, (ax, spread) in enumerate(zip(drawn, spreads, strict=True)):
        q, unit, value = parameters[spread.component, spread.symbol]
        x, half = comparison.estimates[:, i], z * np.sqrt(comparison.covariances[:, i, i])
        at, low, high = (np.asarray(q.from_line(e)) for e in (x, x - half, x + half))
        seen = np.isfinite(x)
        bars = np.array([at - low, high - at])[:, seen]
        label = f"single, {100 * joint.level:g} %"
        ax.errorbar(numbers[seen], at[seen], bars, fmt="o", color=_DRAWS, ms=4, capsize=3, label=label)
        ax.axhline(value, color=_FIT, lw=1.4, label="joint")
        ax.set_xticks(numbers)
        ax.set_xlabel("record")
        ax.set_ylabel(f"{spread.component} {spread.symbol} [{unit.replace('^2', '²')}]")
        if np.any(seen) and high[seen].max() > 3 * low[seen].min() > 0:
            ax.set_yscale("log")
        ax.set_title(f"p = {spread.p_value:.2g}, between records {100 * spread.between:.2g} %", fontsize=9)
        ax.set_xlim(0.5, len(numbers) + 0.5)
    drawn[0].legend(fontsize=7)
    if axes is None:
        figure.suptitle(
            f"{joint.wv.channels[0]}: the same in all {len(numbers)} records? p = {comparison.p_value:.2g}", fontsize=10
        )
    return figure


def _parameters(joint: JointFit):
    """Label, parameter and joint estimate."""
    for label, p in zip(joint.model.labels, joint.model.processes, strict=True):
        for q, value in zip(p.parameters, p.values, strict=True):
            yield label, q, float(value)


@draw.register(NearStationarity)
def plot_near_stationarity(test: NearStationarity, *, axes: GivenAxes | None = None) -> Figure:
    """Joint objectives of records with the same parameters, and that of the data.

    Parameters
    ----------
    test
        Of one channel.
    axes
        The Axes to draw into; a new figure if left out.
    """
    figure, (ax,) = frames(axes, 1, 1, (6, 3.6))
    good = test.objective[test.converged]
    far = test.joint.objective > 3 * good.max() or test.joint.objective < good.min() / 3
    bins = np.geomspace(good.min(), good.max(), 31) if far else 30
    ax.hist(good, bins=bins, color=_DRAWS, alpha=0.6, label="records with the same parameters")
    ax.axvline(test.joint.objective, color=_FIT, lw=1.6, label=f"data, p = {test.p_value:.2g}")
    ax.set_xscale("log" if far else "linear")
    ax.set_xlabel("joint objective")
    ax.set_ylabel("replicates")
    ax.legend(fontsize=8)
    count = len(test.joint.records)
    ax.set_title(f"{test.joint.wv.channels[0]}, {count} records: {' + '.join(test.joint.model.labels)}", fontsize=10)
    return figure


@draw.register(CrossValidation)
def plot_cross_validation(cv: CrossValidation, *, axes: GivenAxes | None = None) -> Figure:
    """Difference of each model to the best, with its standard error over records.

    Parameters
    ----------
    cv
        Of one channel.
    axes
        The Axes to draw into; a new figure if left out.
    """
    figure, (ax,) = frames(axes, 1, 1, (6.4, 0.9 + 0.42 * len(cv)))
    chosen = cv.recommended
    for y, p in enumerate(cv.scores):
        colour = _FIT if p is chosen else _DRAWS if p.equivalent else "0.55"
        ax.errorbar(p.difference, y, xerr=p.difference_error, fmt="o", color=colour, capsize=3, ms=5)
    ax.set_yticks(range(len(cv)), [f"{p.model} ({p.num_parameters})" for p in cv.scores])
    ax.invert_yaxis()
    ax.axvline(0, color="0.4", lw=0.8)
    positive = [p.difference for p in cv.scores if p.difference > 0]
    if positive and max(positive) > 100 * min(positive):
        smallest = 10.0 ** math.floor(math.log10(min(positive)))
        ax.set_xscale("symlog", linthresh=smallest)
        ax.set_xlim(left=-smallest)
    ax.set_xlabel("CV-WVIC above the best (± standard error)")
    channel, count = cv.fits[0].wv.channels[0], cv.splits.shape[1]
    ax.set_title(f"{channel}, {count} records; red: recommended, blue: equivalent", fontsize=10)
    return figure
