"""The figure of what a campaign keeps of every epoch: mean errors and consistency, of runs that nobody has any more."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line, Mark, Span
from gmwm_jax._internal.figures import frames, legend_below
from nav_jax.campaign.contents import COVERAGE_LEVEL
from nav_jax.campaign.results import Statistics
from nav_jax.filter.layout import JUDGED
from nav_jax.plotting._style import DEGREES, TIME, draw, outage_items
from nav_jax.plotting.comparison import draw_consistent, draw_means
from nav_jax.statistics.distributions import binomial_band, chi2_quantile, t_quantile

_MEANS = {
    "position": ("position error", "mean position error", "m", 1.0),
    "velocity": ("velocity error", "mean velocity error", "m/s", 1.0),
    "attitude": ("orientation error", "mean orientation error", "deg", DEGREES),
}
_GROUP = "pose"


def statistics_data(
    statistics: Statistics | Mapping[str, Statistics], *, log: bool = True, level: float = 0.95
) -> tuple[Frame, ...]:
    """Return what `plot_statistics` shows: three mean errors, claimed over true sd, NEES and coverage of the pose.

    Parameters
    ----------
    statistics
        Of one filter or of several, see `nav_jax.Campaign.statistics`.
    log
        Logarithmic errors; else linear ones.
    level
        Of the intervals of means, and of the bands of a consistent filter.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> options = {"key": jax.random.key(0), "num_runs": 8, "chunk_size": 4}
    >>> study = nj.Campaign(scenario, truth, {"right": truth}, **options)
    >>> study.run("study.zarr").complete
    True
    >>> frames = nj.plotting.statistics_data(study.statistics())
    """
    models = {statistics.name: statistics} if isinstance(statistics, Statistics) else dict(statistics)
    outages = outage_items(sorted({i for s in models.values() for of in s.outages.values() for i in of}))
    scale = "log" if log else "linear"
    shown = []
    for block, (title, label, unit, factor) in _MEANS.items():
        items: list[Item] = []
        for name, s in models.items():
            mean = s.mean_length[block]
            # the mean square of a length is the sum of those of its components
            square = (s.rms_error[:, JUDGED.columns(block)] ** 2).sum(axis=1)
            half = t_quantile(level, s.num_good - 1) * np.sqrt(np.maximum(square - mean**2, 0.0) / (s.num_good - 1))
            items += [
                Band("", s.time, factor * (mean - half), factor * (mean + half)),
                Line(name, s.time, factor * mean),
            ]
        shown.append(Frame(title, TIME, Axis(label, unit, scale), (*items, *outages)))
    claims, nees, covered = [], [], []
    bands: list[tuple[Item, Item]] = []
    for name, s in models.items():
        columns = JUDGED.columns("position")
        claimed, true = (np.sqrt((x[:, columns] ** 2).sum(axis=1)) for x in (s.rms_sd, s.rms_error))
        with np.errstate(divide="ignore", invalid="ignore"):
            claims.append(_line(name, s.time, claimed / true))
        if (dof := s.dof.get(_GROUP)) is None:
            continue
        nees.append(_line(name, s.time, s.mean_nees[_GROUP] / dof))
        covered.append(_line(name, s.time, np.where(np.isnan(s.mean_nees[_GROUP]), np.nan, s.coverage[_GROUP])))
        low, high = (float(chi2_quantile(p, dof * s.num_good)) / (dof * s.num_good) for p in _tails(level))
        shares = binomial_band(s.num_good, COVERAGE_LEVEL, level)
        bands.append((Span("consistent", low, high, "y"), Span("consistent", *shares, "y")))
    of_nees, of_shares = ([pair[i] for pair in bands[:1]] for i in (0, 1))
    claim, of_dof = Axis("rms sd / rms error", "1"), Axis("mean NEES / dof", "1")
    region = Axis(f"coverage of the {100 * COVERAGE_LEVEL:g} % region", "1")
    return (
        *shown,
        Frame("claimed over true position error", TIME, claim, (*claims, _at(1.0), *outages)),
        Frame("NEES of position and attitude", TIME, of_dof, (*of_nees, *nees, _at(1.0), *outages)),
        Frame("coverage of position and attitude", TIME, region, (*of_shares, *covered, _at(COVERAGE_LEVEL), *outages)),
    )


@draw.register(Statistics)
def plot_statistics(
    statistics: Statistics | Mapping[str, Statistics],
    *,
    log: bool = True,
    level: float = 0.95,
    axes: GivenAxes | None = None,
) -> Figure:
    """Plot mean errors of every epoch with their intervals, what filters claim of them, and their consistency.

    Parameters
    ----------
    statistics
        Of one filter or of several, see `nav_jax.Campaign.statistics`.
    log
        Logarithmic errors, by which a filter with and without GNSS fits into one frame; else linear ones.
    level
        Of the intervals of means, and of the bands of a consistent filter.
    axes
        Six Axes to draw into, as in two rows of three; a new figure if left out.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> options = {"key": jax.random.key(0), "num_runs": 8, "chunk_size": 4}
    >>> study = nj.Campaign(scenario, truth, {"right": truth}, **options)
    >>> study.run("study.zarr").complete
    True
    >>> figure = nj.plotting.plot_statistics(study.statistics())
    >>> figure.savefig("statistics.png")
    """
    shown = statistics_data(statistics, log=log, level=level)
    models = [item.label for item in shown[0].items if isinstance(item, Line)]
    figure, drawn = frames(axes, 2, 3, (15, 8.6), sharex=True)
    for ax, frame in zip(drawn[:3], shown[:3], strict=True):
        draw_means(ax, frame)
    for ax, frame in zip(drawn[3:], shown[3:], strict=True):
        draw_consistent(ax, frame, models, is_share=frame is shown[-1])
    if axes is None:
        for ax in drawn[:3]:
            ax.set_xlabel("")
    most = max(s.num_good for s in ([statistics] if isinstance(statistics, Statistics) else statistics.values()))
    title = f"{most} runs; {100 * level:g} % intervals of the means, grey: of a consistent filter"
    legend_below(figure, drawn, alone=axes is None, title=title, title_fontsize=8)
    return figure


def _line(name: str, time: np.ndarray, y: np.ndarray) -> Line:
    known = np.isfinite(y)
    return Line(name, time[known], y[known])


def _at(value: float) -> Mark:
    return Mark("", value, "y")


def _tails(level: float) -> tuple[float, float]:
    return (1 - level) / 2, (1 + level) / 2
