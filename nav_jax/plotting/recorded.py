"""The figures of a tuning by a record, and of outages that were simulated on it."""

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Bars, Frame, Item, Mark, Points
from gmwm_jax._internal.figures import describe, frames, legend_below, put
from gmwm_jax._internal.palette import COLOURS
from nav_jax.imu.channels import CHANNELS
from nav_jax.plotting._style import INK, draw, grid, logarithmic, positive
from nav_jax.recorded.motion_noise import NoiseInMotion
from nav_jax.recorded.study import OutageStudy
from nav_jax.recorded.tuning import Tuning

_STYLES = {
    "start": {"color": INK, "lw": 1.0, "ls": ":"},
    "from the prior": {"color": COLOURS[3]},
    "not observable": {"color": COLOURS[1], "marker": "x", "ms": 8},
    "held": {"color": INK, "marker": "s", "ms": 8},
    "lost in the search": {"color": COLOURS[1], "marker": "D", "ms": 7},
}

_CLAIMED = "#b5cde4"


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


def outages_data(study: OutageStudy) -> tuple[Frame]:
    """Return what `plot_outages` shows: the error at the end of each outage, and what was claimed of it.

    Parameters
    ----------
    study
        Of outages.

    Examples
    --------
    >>> error, covariance = np.array([[0.3, 0.4]]), np.eye(2)[None]
    >>> once = np.array([60.0])
    >>> study = nj.recorded.OutageStudy("gnss", "m", np.array([0]), once, once + 15.0, error, covariance)
    >>> nj.plotting.outages_data(study)[0].y.unit
    'm'
    """
    order = np.argsort(study.start, kind="stable")
    k = np.arange(len(order), dtype=float)
    size, claimed = study.size[order], study.claimed[order]
    what = "horizontal error" if study.error.shape[1] == 2 else "error"
    title = f"{study.sensor}: median {study.median:.3g}, RMS {study.rms:.3g} {study.unit}"
    items = (Bars("claimed (rms)", k, claimed, 0 * claimed, claimed), Points("predicted - measured", k, size))
    names = tuple(f"{a:g}" for a in study.start[order])
    return (Frame(title, Axis("outage from, s", "", names=names), Axis(what, study.unit), items),)


@draw.register(OutageStudy)
def plot_outages(study: OutageStudy, *, axes: GivenAxes | None = None) -> Figure:
    """Plot the error at the end of each simulated outage beside what the filter claimed of it.

    Parameters
    ----------
    study
        Of outages.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> error, covariance = np.array([[0.3, 0.4]]), np.eye(2)[None]
    >>> once = np.array([60.0])
    >>> study = nj.recorded.OutageStudy("gnss", "m", np.array([0]), once, once + 15.0, error, covariance)
    >>> nj.plotting.plot_outages(study).savefig("study.png")
    """
    (frame,) = outages_data(study)
    figure, (ax,) = frames(axes, 1, 1, (max(6.0, 1.5 + 0.45 * len(study.start)), 4.2))
    claimed, measured = frame.items
    put(ax, claimed, color=_CLAIMED, fmt="|", elinewidth=7)
    put(ax, measured, color=INK, marker="o", ls="")
    describe(ax, frame)
    ax.set(xticks=range(len(study.start)), xticklabels=frame.x.names, xlim=(-0.6, len(study.start) - 0.4))
    ax.tick_params(axis="x", rotation=60 if len(study.start) > 8 else 0)
    ax.set_ylim(bottom=0.0)
    grid(ax)
    legend_below(figure, [ax], alone=axes is None)
    return figure


def noise_in_motion_data(found: NoiseInMotion) -> tuple[Frame]:
    """Return what `plot_noise_in_motion` shows: the factor of each axis with its interval.

    Parameters
    ----------
    found
        Of `nav_jax.recorded.noise_in_motion`.

    Examples
    --------
    >>> factor = np.array([0.1, 0.2, 0.1, 0.0, 0.3, 0.1])
    >>> low, high, ratio = factor / 2, 2 * factor + 0.1, 40 * factor
    >>> found = nj.recorded.NoiseInMotion(factor, low, high, ratio, 120.0, 0.25, 600, True, 0.95)
    >>> nj.plotting.noise_in_motion_data(found)[0].x.names[3]
    'gyro x'
    """
    k = np.arange(len(CHANNELS), dtype=float)
    bars = Bars(f"{100 * found.level:g} % interval", k, found.factor, found.ci_low, found.ci_high)
    title = f"2 log likelihood ratio {found.ratio_of_all:.3g}, p {found.p_of_all:.2g}"
    items = (Mark("as at rest", 0.0, "y"), bars)
    return (Frame(title, Axis("", "", names=CHANNELS), Axis("noise per variance of the samples", "1"), items),)


@draw.register(NoiseInMotion)
def plot_noise_in_motion(found: NoiseInMotion, *, axes: GivenAxes | None = None) -> Figure:
    """Plot how much of the vibration of a record is white noise of each axis; zero is the model of a sensor at rest.

    Parameters
    ----------
    found
        Of `nav_jax.recorded.noise_in_motion`.
    axes
        The Axes to draw into; a new figure if left out.

    Examples
    --------
    >>> factor = np.array([0.1, 0.2, 0.1, 0.0, 0.3, 0.1])
    >>> low, high, ratio = factor / 2, 2 * factor + 0.1, 40 * factor
    >>> found = nj.recorded.NoiseInMotion(factor, low, high, ratio, 120.0, 0.25, 600, True, 0.95)
    >>> nj.plotting.plot_noise_in_motion(found).savefig("vibration.png")
    """
    (frame,) = noise_in_motion_data(found)
    figure, (ax,) = frames(axes, 1, 1, (7.0, 4.2))
    at_rest, bars = frame.items
    put(ax, at_rest, color=INK, lw=1.0, ls=":")
    put(ax, bars, color=COLOURS[0], fmt="o", capsize=4, lw=1.6)
    describe(ax, frame)
    ax.set(xticks=range(len(CHANNELS)), xticklabels=CHANNELS, ylim=(-0.05, 1.05))
    grid(ax)
    legend_below(figure, [ax], alone=axes is None)
    return figure
