"""Figures of the room, from the same arrays as those of `nav_jax.plotting`: pure functions of results."""

from collections.abc import Sequence

import plotly.graph_objects as go

from gmwm_jax._internal.figure_data import Band, Bars, Frame, Item, Line, Mark, Points, Span
from gmwm_jax._internal.palette import COLOURS
from gmwm_jax.app.web.frames import DASHES, FAINT, GREY, SYMBOLS, Style, figure_of
from nav_jax.lincov.analysis import Analysis
from nav_jax.lincov.budget import Budget
from nav_jax.lincov.filter_design import Design
from nav_jax.plotting.comparison import consistency_data, mean_errors_data
from nav_jax.plotting.lincov import analysis_data, budget_data, design_data
from nav_jax.plotting.navigation import navigation_data
from nav_jax.plotting.recorded import outages_data
from nav_jax.plotting.runs import errors_data, sensor_states_data
from nav_jax.plotting.trajectory import trajectory_data
from nav_jax.recorded.navigation import Navigation
from nav_jax.recorded.study import OutageStudy
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.runs import Runs
from nav_jax.trajectory.trajectory import Trajectory

_OUTAGE = "#e69f00"
_CLAIMED = ", as claimed"
_TRUE_DASHES = tuple(dash for dash in DASHES if dash != "dot")
"""Dots are for claims."""


def analysis(found: Analysis, *, columns: int = 2) -> go.Figure:
    """Draw true and claimed errors of the filters, and how consistent that makes them.

    Parameters
    ----------
    found
        Of `nav_jax.analyse`.
    columns
        Frames in a row.

    Examples
    --------
    >>> from nav_jax.app.web import figures
    >>> scenario = nj.Scenario(nj.motions.static(duration=5.0, rate=20.0), [nj.Barometer(height=0.5)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0)
    >>> [trace.name for trace in figures.analysis(nj.analyse(scenario, {"right": truth}["right"])).data][:2]
    ['filter', 'filter, as claimed']
    """
    names = list(found)
    frames = [_with_claims(f) if i < 2 else f for i, f in enumerate(analysis_data(found))]
    return _over_time(frames, names, columns)


def comparison(found: Comparison, *, columns: int = 2) -> go.Figure:
    """Draw mean errors of the filters with their intervals, NEES and coverage with the bands of a consistent filter.

    Parameters
    ----------
    found
        Of `nav_jax.compare`.
    columns
        Frames in a row.

    Raises
    ------
    ValueError
        Fewer than two runs in which no filter failed.
    """
    frames = (*mean_errors_data(found), *consistency_data(found, groups=("pose",)))
    return _over_time([f._replace(title=f.title.partition("\n")[0]) for f in frames], list(found), columns)


def trajectory(reference: Trajectory, *, columns: int = 2) -> go.Figure:
    """Draw where the vehicle goes: plan, with one scale for both axes, and height.

    Parameters
    ----------
    reference
        The trajectory.
    columns
        Frames in a row.

    Examples
    --------
    >>> from nav_jax.app.web import figures
    >>> figures.trajectory(nj.motions.circle(duration=10.0, rate=20.0)).layout.xaxis.title.text
    'east [m]'
    """
    frames = trajectory_data(reference, attitude=False)

    def style(_: Frame, i: int, item: Item) -> Style:
        return Style(COLOURS[3], symbol="circle") if isinstance(item, Points) else Style(COLOURS[0])

    figure = figure_of(frames, style, columns=columns, height=380 if columns > 1 else 780)
    figure.layout.yaxis.scaleanchor = "x"
    return figure


def budget(found: Budget, *, columns: int = 2) -> go.Figure:
    """Draw the shares that the sources have in the mean square errors, over time.

    Parameters
    ----------
    found
        Of `nav_jax.error_budget`.
    columns
        Frames in a row.
    """
    quantities = ("horizontal", "vertical", "tilt", "heading")
    frames = budget_data(found, quantities=quantities)[: len(quantities)]
    labels = list(dict.fromkeys(i.label for f in frames for i in f.items if isinstance(i, Band)))

    def style(_: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Mark):
            return Style(FAINT, "dot", 1)
        colour = GREY if item.label == "others" else COLOURS[labels.index(item.label) % len(COLOURS)]
        return Style(colour, opacity=0.85, group=item.label)

    ends = [(0.0, 100.0)] * len(frames)
    return figure_of(frames, style, columns=columns, shared_x=True, height=_height(len(frames), columns), y_ranges=ends)


def design(found: Design, *, columns: int = 2) -> go.Figure:
    """Draw what the designed filters reach, over their number of states.

    Parameters
    ----------
    found
        Of `nav_jax.design`.
    columns
        Frames in a row.
    """
    frames = design_data(found)
    labels = _labels(frames)

    def style(_: Frame, i: int, item: Item) -> Style:
        at = labels.index(item.label) if item.label in labels else 0
        if isinstance(item, Points):
            return Style(COLOURS[at % len(COLOURS)], symbol=SYMBOLS[at % len(SYMBOLS)])
        return Style(GREY if isinstance(item, Mark) else COLOURS[at % len(COLOURS)], "dot", 1.4)

    return figure_of(frames, style, columns=columns, height=_height(len(frames), columns))


def errors(runs: Runs, *, columns: int = 3) -> go.Figure:
    """Draw north, east and down errors of position and the attitude errors of runs, with what the filter claims.

    Parameters
    ----------
    runs
        Of one filter.
    columns
        Frames in a row.
    """
    return _of_runs(errors_data(runs, blocks=("position", "attitude"), max_runs=20), columns)


def sensor_states(runs: Runs, *, columns: int = 2) -> go.Figure:
    """Draw the errors of the estimated sensor errors of runs, with what the filter claims.

    Parameters
    ----------
    runs
        Of one filter.
    columns
        Frames in a row.
    """
    return _of_runs(sensor_states_data(runs, max_runs=15), columns)


def drive(found: Navigation, *, columns: int = 2) -> go.Figure:
    """Draw where a recorded drive went: plan and height.

    Parameters
    ----------
    found
        Of `nav_jax.navigate`.
    columns
        Frames in a row.
    """
    frames = navigation_data(found)[:2]
    labels = _labels(frames)

    def style(frame: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Span):
            return Style(_OUTAGE, opacity=0.2)
        of = item.label or _label_before(frame, i)
        at = labels.index(of)
        colour = COLOURS[at % len(COLOURS)]
        return Style(colour, symbol=SYMBOLS[at % len(SYMBOLS)]) if isinstance(item, Points) else Style(colour)

    figure = figure_of(frames, style, columns=columns, height=420 if columns > 1 else 780)
    figure.layout.yaxis.scaleanchor = "x"
    return figure


def outages(study: OutageStudy) -> go.Figure:
    """Draw the error at the end of each simulated outage beside what the filter claimed of it.

    Parameters
    ----------
    study
        Of outages.

    Examples
    --------
    >>> from nav_jax.app.web import figures
    >>> error, covariance = np.array([[0.3, 0.4]]), np.eye(2)[None]
    >>> once = np.array([60.0])
    >>> study = nj.recorded.OutageStudy("gnss", "m", np.array([0]), once, once + 15.0, error, covariance)
    >>> [trace.name for trace in figures.outages(study).data]
    ['claimed (rms)', 'predicted - measured']
    """
    ends = (0.0, 1.08 * float(max(study.size.max(), study.claimed.max())))

    def style(_: Frame, i: int, item: Item) -> Style:
        return Style(FAINT, width=4, symbol="square") if isinstance(item, Bars) else Style(COLOURS[0])

    return figure_of(outages_data(study), style, height=420, y_ranges=[ends])


def _with_claims(frame: Frame) -> Frame:
    """With names for what filters claim, which follows what is true of each."""
    items: list[Item] = []
    for item in frame.items:
        named = isinstance(item, Line) and not item.label
        items.append(item._replace(label=f"{items[-1].label}{_CLAIMED}") if named else item)  # type: ignore[call-arg]
    return frame._replace(items=tuple(items))


def _labels(frames: Sequence[Frame]) -> list[str]:
    """All names, each once."""
    return list(dict.fromkeys(i.label for f in frames for i in f.items if i.label))


def _label_before(frame: Frame, i: int) -> str:
    """The name of what an item without one goes with."""
    return next(n.label for n in reversed(frame.items[:i]) if n.label)


def _over_time(frames: Sequence[Frame], names: Sequence[str], columns: int) -> go.Figure:
    """Curves of filters, each in its colour."""

    def style(frame: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Span):
            return Style(_OUTAGE, opacity=0.2) if item.of == "x" else Style(GREY, opacity=0.25)
        if isinstance(item, Mark):
            return Style(FAINT, "dot", 1)
        label = item.label or next(n.label for n in frame.items[i:] if n.label)  # a band comes before its curve
        name = label.removesuffix(_CLAIMED)
        at = names.index(name)
        if label != name:
            return Style(COLOURS[at % len(COLOURS)], "dot", 1.6)
        dash = "solid" if at == 0 else _TRUE_DASHES[(at - 1) % len(_TRUE_DASHES)]
        return Style(COLOURS[at % len(COLOURS)], dash, 2, group=name)

    return figure_of(frames, style, columns=columns, shared_x=True, height=_height(len(frames), columns))


def _of_runs(frames: Sequence[Frame], columns: int) -> go.Figure:
    labels = _labels(frames)

    def style(frame: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Span):
            return Style(_OUTAGE, opacity=0.2)
        if isinstance(item, Mark):
            return Style(FAINT, "dot", 1)
        of = item.label or _label_before(frame, i)
        if isinstance(item, Line) and " run" in of:
            return Style(GREY, width=0.6)
        return Style(COLOURS[labels.index(of) % len(COLOURS)], width=1.6, opacity=0.25)

    return figure_of(frames, style, columns=columns, shared_x=True, height=_height(len(frames), columns))


def _height(num: int, columns: int) -> int:
    return 130 + 280 * -(-num // columns)
