"""Frames of `gmwm_jax._internal.figure_data` as one Plotly figure: labels escaped, axes with powers of ten, two themes.

A style says how an item is drawn; what an item is (band, line, points, intervals, histogram, mark) decides the trace.
"""

import html
import json
import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from gmwm_jax._internal.figure_data import Axis, Band, Bars, Frame, Histogram, Item, Line, Mark, Points, Span
from gmwm_jax._internal.palette import COLOURS

GREY, FAINT, GRID = "#595959", "#8c8c8c", "#d9d9d9"
TEXT = "#1c1c1c"
_DARK = dict(
    zip(
        (*COLOURS, GREY, FAINT, GRID, TEXT),
        (
            *("#8ab8e6", "#f08a76", "#4fd1b5", "#ffc04d", "#dda6ef", "#d9b48f", "#8fb6ff"),
            *("#b0b0b0", "#8c8c8c", "#444444", "#ececec"),
        ),
        strict=True,
    )
)
"""What each colour is on a dark page."""

DASHES = ("dash", "dot", "dashdot", "longdash", "12px,3px,3px,3px,3px,3px", "6px,6px")
SYMBOLS = ("circle", "x", "triangle-up", "cross", "square", "triangle-down", "diamond")
"""In the order of `gmwm_jax._internal.palette`."""

_MAX_LABELLED = 8
"""Decades on an axis of which each has its number."""
_MAX_COLUMNS = 24
"""Names along an axis."""


class Style(NamedTuple):
    """How an item is drawn."""

    colour: str = COLOURS[0]
    dash: str = "solid"
    width: float = 1.6
    symbol: str = ""
    """Of the points of a line, or of points; none: a line alone."""
    opacity: float = 0.18
    """Of an area."""
    group: str = ""
    """Items of a group are shown and hidden together; their legend has one entry."""


def escaped(text: str) -> str:
    """A text as Plotly shows it: what would be read as a tag is none, and powers stand high.

    Examples
    --------
    >>> from gmwm_jax.app.web.frames import escaped
    >>> escaped("<b>x</b> [m/s^2]")
    '&lt;b&gt;x&lt;/b&gt; [m/s²]'
    """
    return html.escape(" ".join(text.split()), quote=False).replace("^2", "²").replace("^3", "³")


def figure_of(
    frames: Sequence[Frame],
    style: Callable[[Frame, int, Item], Style],
    *,
    columns: int = 1,
    heights: Sequence[float] | None = None,
    shared_x: bool = False,
    height: int = 460,
    y_ranges: Sequence[tuple[float, float] | None] | None = None,
    note: str = "",
) -> go.Figure:
    """Draw frames beside and below each other.

    Parameters
    ----------
    frames
        In reading order.
    style
        Of an item, by the frame, its number in the frame, and itself.
    columns
        Frames in a row.
    heights
        Of the rows in proportion; all the same if left out.
    shared_x
        Zoom all frames together along x.
    height
        Of the whole, in pixels.
    y_ranges
        Both ends of the y axis of each frame, where its items do not decide.
    note
        What bands are, above the legend.
    """
    rows = -(-len(frames) // columns)
    layout = _grid(rows, columns, shared_x, None if heights is None else tuple(heights))
    titles = [text | {"text": escaped(f.title)} for text, f in zip(layout["annotations"], frames, strict=False)]
    layout |= _layout(height, escaped(note)) | {"meta": {"alt": _alternative(frames)}}
    traces, shapes, named = [], [], set[str]()
    for k, frame in enumerate(frames):
        number = str(k + 1) if k else ""
        names = {"xaxis": f"x{number}", "yaxis": f"y{number}"}
        for i, item in enumerate(frame.items):
            drawn = _drawn(frame, item, style(frame, i, item), named)
            traces += [trace | names for trace in drawn.traces]
            shapes += [shape | _across(names, *drawn.across) for shape in drawn.shapes]
        last_row = not shared_x or k // columns == rows - 1
        given = None if y_ranges is None else y_ranges[k]
        layout[f"xaxis{number}"] |= _axis(frame.x, _along(frame, "x"), titled=last_row)
        layout[f"yaxis{number}"] |= _axis(frame.y, _along(frame, "y") if given is None else given, upright=True)
    # made and checked as a whole: to change a figure of Plotly's is slow
    layout |= {"annotations": [title for title in titles if title["text"]], "shapes": shapes}
    return go.Figure({"data": traces, "layout": layout})


def _grid(rows: int, columns: int, shared_x: bool, heights: tuple[float, ...] | None) -> dict[str, Any]:
    """Places of the frames' axes and titles."""
    return json.loads(_json_of_grid(rows, columns, shared_x, heights))


@cache
def _json_of_grid(rows: int, columns: int, shared_x: bool, heights: tuple[float, ...] | None) -> str:
    build: Any = make_subplots  # its stubs know less than it does
    figure = build(
        rows,
        columns,
        shared_xaxes="all" if shared_x else False,
        subplot_titles=["-"] * (rows * columns),
        row_heights=None if heights is None else list(heights),
        vertical_spacing=min(0.12, 0.4 / rows),
        horizontal_spacing=min(0.12, 0.25 / columns),
    )
    layout = figure.update_annotations(font_size=13).layout.to_plotly_json()
    return json.dumps({name: value for name, value in layout.items() if name != "template"})


def themed(figure: go.Figure, *, dark: bool) -> go.Figure:
    """The same figure for a dark page, or as it is for a light one.

    Parameters
    ----------
    figure
        Of `figure_of`.
    dark
        Is the page?

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> from gmwm_jax.app.web.frames import themed
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> themed(figures.variance(wv), dark=True).layout.font.color
    '#ececec'
    """
    if not dark:
        return figure
    text = str(figure.to_json())
    for light, other in _DARK.items():
        text = text.replace(f'"{light}"', f'"{other}"').replace(_numbers(light), _numbers(other))
    return go.Figure(json.loads(text))


# -- traces -----------------------------------------------------------------------------------------------------------


class _Drawn(NamedTuple):
    """An item: traces and shapes as Plotly has them, without their axes."""

    traces: Sequence[dict[str, Any]]
    shapes: Sequence[dict[str, Any]] = ()
    across: tuple[str, float, float] = ("x", 0.0, 0.0)
    """Where the shapes lie: from one value of an axis to another, and over all of the other axis."""


def _drawn(frame: Frame, item: Item, style: Style, named: set[str]) -> _Drawn:
    legend: dict[str, Any] = {
        "type": "scatter",
        "name": escaped(item.label),
        "legendgroup": escaped(style.group or item.label or "-"),
        "showlegend": bool(item.label) and item.label not in named,
    }
    named.add(item.label)
    hover = f"{_hovered('x', frame.x)}<br>{_hovered('y', frame.y)}"
    drawn = style.opacity
    unseen = {"x": [None], "y": [None], "hoverinfo": "skip"}
    match item:
        case Line(x=x, y=y):
            interval = _interval_around(frame, item)
            extra = {}
            if interval is not None:
                extra["customdata"] = interval
                hover += f"<br>%{{customdata[0]:.4g}} .. %{{customdata[1]:.4g}} {escaped(frame.y.unit)}"
            if not len(x):  # a curve that is not there, and is named: without a point it had no entry in the legend
                x, y = np.array([np.nan]), np.array([np.nan])
            mode = "lines+markers" if style.symbol else "lines"
            line = {"color": style.colour, "width": style.width, "dash": style.dash}
            marker = {"symbol": f"{style.symbol or 'circle'}-open", "size": 7, "color": style.colour}
            shown = {"x": x, "y": y, "mode": mode, "line": line, "marker": marker, "hovertemplate": hover}
            return _Drawn([shown | extra | legend | {"connectgaps": False}])
        case Points(x=x, y=y):
            marker = {"symbol": style.symbol or "circle", "size": 8, "color": style.colour}
            names = item.names or _names_at(frame.x, x)
            texts = {"text": [escaped(name) for name in names]} if names else {}
            hover = "%{text}<br>" * bool(names) + (_hovered("y", frame.y) if frame.x.names else hover)
            shown = {"x": x, "y": y, "mode": "markers", "marker": marker, "hovertemplate": hover}
            return _Drawn([shown | texts | legend])
        case Band(x=x, low=low, high=high):
            area = {"fill": "toself", "fillcolor": _rgba(style.colour, drawn), "line": {"width": 0}}
            area |= {"mode": "lines", "hoverinfo": "skip"}
            parts = []
            for k, (xs, lows, highs) in enumerate(_unbroken(x, low, high)):
                ends = {"x": np.concatenate([xs, xs[::-1]]), "y": np.concatenate([highs, lows[::-1]])}
                parts.append(legend | area | ends | ({"showlegend": False} if k else {}))
            return _Drawn(parts)
        case Bars(x=x, y=y, low=low, high=high, lying=lying):
            centre = x if lying else y
            error = {"type": "data", "symmetric": False, "array": high - centre, "arrayminus": centre - low}
            error |= {"color": style.colour, "thickness": style.width}
            hover = f"{_hovered('x' if lying else 'y', frame.x if lying else frame.y)}"
            hover += "<br>%{customdata[0]:.4g} .. %{customdata[1]:.4g}"
            names = _names_at(frame.y, y) if lying else _names_at(frame.x, x)
            if names:
                hover = "%{text}<br>" + hover
                legend["text"] = [escaped(name) for name in names]
            marker = {"symbol": style.symbol or "circle", "size": 8, "color": style.colour}
            bars = {"error_x" if lying else "error_y": error, "customdata": np.column_stack([low, high])}
            return _Drawn(
                [{"x": x, "y": y, "mode": "markers", "marker": marker, "hovertemplate": hover} | bars | legend]
            )
        case Histogram(edges=edges, counts=counts):
            return _Drawn([_histogram(frame, edges, counts, style) | legend])
        case Mark(at=value, of=of):
            line = {"color": style.colour, "width": style.width, "dash": style.dash}
            entry = unseen | {"mode": "lines", "line": line} | legend
            return _Drawn([entry], [{"type": "line", "line": line}], (of, value, value))
        case Span(low=low, high=high, of=of):
            area = {"fillcolor": style.colour, "opacity": drawn, "line": {"width": 0}, "layer": "below"}
            marker = {"symbol": "square", "size": 12, "color": _rgba(style.colour, max(0.3, drawn))}
            entry = unseen | {"mode": "markers", "marker": marker} | legend
            return _Drawn([entry], [{"type": "rect"} | area], (of, low, high))


def _names_at(axis: Axis, values: np.ndarray) -> tuple[str, ...]:
    """Of the whole numbers that an axis has names of."""
    return tuple(axis.names[int(v)] for v in values) if axis.names else ()


def _histogram(frame: Frame, edges: np.ndarray, counts: np.ndarray, style: Style) -> dict[str, Any]:
    """Counts as an area with steps: bars have no width on a logarithmic axis."""
    x = np.repeat(edges, 2)
    y = np.concatenate([[0.0], np.repeat(counts.astype(float), 2), [0.0]])
    line = {"color": style.colour, "width": 1}
    fill = {"fill": "tozeroy", "fillcolor": _rgba(style.colour, max(style.opacity, 0.35))}
    hover = f"{_hovered('x', frame.x)}<br>%{{y}}"
    return {"x": x, "y": y, "mode": "lines", "line": line, "hovertemplate": hover} | fill


def _across(names: dict[str, str], of: str, low: float, high: float) -> dict[str, Any]:
    """Where a mark or a span lies: at values of one axis, and over all of the other."""
    x, y = names["xaxis"], names["yaxis"]
    if of == "x":
        return {"x0": low, "x1": high, "xref": x, "y0": 0, "y1": 1, "yref": f"{y} domain"}
    return {"y0": low, "y1": high, "yref": y, "x0": 0, "x1": 1, "xref": f"{x} domain"}


def _interval_around(frame: Frame, curve: Line) -> np.ndarray | None:
    """Both ends of the band that stands before a curve."""
    before = None
    for item in frame.items:
        if item is curve:
            break
        before = item
    if isinstance(before, Band) and not before.label and len(before.x) == len(curve.x):
        return np.column_stack([before.low, before.high])
    return None


def _unbroken(x: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """The parts of a band between missing values."""
    known = np.isfinite(low) & np.isfinite(high)
    if known.all():
        return [(x, low, high)]
    cuts = np.flatnonzero(np.diff(known.astype(int))) + 1
    parts = np.split(np.arange(len(x)), cuts)
    return [(x[part], low[part], high[part]) for part in parts if len(part) and known[part[0]]]


# -- axes -------------------------------------------------------------------------------------------------------------


def _along(frame: Frame, axis: str) -> tuple[float, float] | None:
    """The positive range of what a logarithmic axis shows; None for another, which finds its own."""
    if (frame.x if axis == "x" else frame.y).scale != "log":
        return None
    values: list[np.ndarray] = []
    for item in frame.items:
        match item:
            case Line() | Points():
                values.append(item.x if axis == "x" else item.y)
            case Band():
                values += [item.x] if axis == "x" else [item.low, item.high]
            case Bars() if item.lying == (axis == "x"):
                values += [item.low, item.high]
            case Histogram() if axis == "x":
                values.append(item.edges)
            case Mark() | Span() if item.of == axis:
                values.append(np.array([item.at] if isinstance(item, Mark) else [item.low, item.high]))
    known = np.concatenate([np.asarray(v, dtype=float).ravel() for v in values] or [np.array([1.0])])
    known = known[np.isfinite(known) & (known > 0)]
    return (float(known.min()), float(known.max())) if len(known) else (0.1, 10.0)


def _axis(
    axis: Axis, ends: tuple[float, float] | None, *, titled: bool = True, upright: bool = False
) -> dict[str, Any]:
    unit = f" [{escaped(axis.unit)}]" if axis.unit else ""
    made: dict[str, Any] = {"gridcolor": GRID, "linecolor": FAINT, "ticks": "outside", "zeroline": False}
    made |= {"mirror": True, "showline": True, "title": {"standoff": 8}}
    if titled:
        made["title"]["text"] = f"{escaped(axis.label)}{unit}"
    if axis.names:
        # rows are all named, from the top; columns from the left, as many as there is place for
        step = 1 if upright else -(-len(axis.names) // _MAX_COLUMNS)
        ends_of_names = (-0.5, len(axis.names) - 0.5)
        made |= {"tickmode": "array", "tickvals": list(range(0, len(axis.names), step)), "automargin": True}
        made |= {"ticktext": [escaped(name) for name in axis.names[::step]]}
        made |= {"range": list(ends_of_names[::-1] if upright else ends_of_names)}
    elif axis.scale == "log" and ends is not None:
        low, high = math.log10(ends[0]), math.log10(ends[1])
        pad = 0.03 * (high - low) + 0.05
        low, high = low - pad, high + pad
        made |= {
            "type": "log",
            "tickangle": 0,
            "exponentformat": "power",
            "dtick": -(-int(high - low) // _MAX_LABELLED) or 1,
        }
        if math.floor(high) - math.ceil(low) < 1:  # less than two powers of ten: numbers between them
            powers = [m * 10.0**k for k in range(math.floor(low), math.ceil(high) + 1) for m in (1, 2, 5)]
            labels = [f"{p:.4g}" if 1e-3 < p < 1e4 else _power(p) for p in powers]
            made |= {"tickmode": "array", "tickvals": powers, "ticktext": labels, "minor": {}}
        else:
            made |= {"minor": {"dtick": "D1", "ticks": "outside", "ticklen": 2}}
        made["range"] = [low, high]
    elif ends is not None:
        made["range"] = list(ends)
    else:
        made |= {"exponentformat": "power", "nticks": 6}
    return made


def _power(value: float) -> str:
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}×10<sup>{int(exponent)}</sup>"


def _hovered(name: str, axis: Axis) -> str:
    unit = f" {escaped(axis.unit)}" if axis.unit not in ("", "1") else ""
    return f"{escaped(axis.label)} %{{{name}:.4g}}{unit}"


def _layout(height: int, note: str) -> dict[str, Any]:
    return {
        "height": height,
        "autosize": True,
        "margin": {"l": 80, "r": 16, "t": 40, "b": 60},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"family": "system-ui, sans-serif", "size": 13, "color": TEXT},
        "hoverlabel": {"namelength": -1},
        "legend": {
            "orientation": "h",
            "yref": "container",  # at the lower end; the page's script makes place for its lines
            "yanchor": "bottom",
            "y": 0,
            "x": 0,
            "title": {"text": note, "side": "top", "font": {"size": 12}},
            "itemwidth": 40,
        },
        "template": "none",
    }


def _alternative(frames: Sequence[Frame]) -> str:
    """What stands for the figure where it is not seen; Plotly shows none of it."""
    parts = []
    for frame in frames:
        shown = ", ".join(dict.fromkeys(item.label for item in frame.items if item.label))
        parts.append(
            f"{frame.title or frame.y.label}: {frame.y.label} over {frame.x.label}" + f" ({shown})" * bool(shown)
        )
    return "; ".join(parts)


# -- colours ----------------------------------------------------------------------------------------------------------


def _numbers(colour: str) -> str:
    return f"rgba({', '.join(str(int(part, 16)) for part in re.findall('..', colour[1:]))},"


def _rgba(colour: str, opacity: float) -> str:
    return f"{_numbers(colour)} {opacity:g})"
