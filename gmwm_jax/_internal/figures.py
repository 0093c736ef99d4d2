"""Figures without pyplot, which is a list of open figures and a backend for the whole process.

Nothing is left open, a notebook shows a figure once (as the last expression of a cell), and several threads may draw at
once. Imported by the rooms `plotting` alone, at the moment of drawing.
"""

import io
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import GivenAxes
from gmwm_jax._internal.figure_data import Band, Bars, Frame, Histogram, Item, Line, Mark, Points, Span
from gmwm_jax._internal.palette import turns
from gmwm_jax._internal.typing import Real

_SMALL, _HANDLE = 8, 5.5
"""Size of the text of a legend, and the place beside it in which dashes can be told apart, in that size."""

_RENDERING = threading.RLock()
"""Matplotlib lays out and sets text (formulas on logarithmic axes) with state that all figures share."""


class ResultFigure(Figure):
    """A figure that shows itself in a notebook, and whose drawing waits for that of another thread."""

    def draw(self, *args: Any, **options: Any) -> None:
        with _RENDERING:
            super().draw(*args, **options)

    def get_tightbbox(self, *args: Any, **options: Any) -> Any:
        with _RENDERING:
            return super().get_tightbbox(*args, **options)

    def savefig(self, *args: Any, **options: Any) -> None:
        with _RENDERING:
            super().savefig(*args, **options)

    def _repr_png_(self) -> bytes:
        """What IPython shows unless its inline backend is on, which has a way of its own to show any Figure."""
        file = io.BytesIO()
        self.savefig(file, format="png", bbox_inches="tight")
        return file.getvalue()


def new_figure(width: Real, height: Real) -> ResultFigure:
    """Make an empty figure, in inches, that finds the places of its frames itself."""
    figure = ResultFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)  # that of a bare Figure draws nothing
    return figure


def frames(
    axes: GivenAxes | None,
    rows: int,
    columns: int,
    size: tuple[Real, Real],
    *,
    num: int | None = None,
    **layout: Any,
) -> tuple[Figure, list[Axes]]:
    """Return the Axes to draw into: those that are given, or rows and columns of a new figure, in reading order.

    Parameters
    ----------
    axes
        What the caller was given; None for a new figure.
    rows, columns
        Of a new figure.
    size
        Its width and height in inches.
    num
        Of frames, if the last row is not full.
    **layout
        As `matplotlib.figure.Figure.subplots` takes it.

    Raises
    ------
    ValueError
        So many Axes were not given.
    """
    num = rows * columns if num is None else num
    if axes is None:
        figure = new_figure(*size)
        new = list(figure.subplots(rows, columns, squeeze=False, **layout).flat)
        for ax in new[num:]:
            ax.remove()
        return figure, new[:num]
    given = [axes] if isinstance(axes, Axes) else list(np.asarray(axes, dtype=object).flat)
    if len(given) != num:
        raise ValueError(f"This figure has {num} frames and draws into as many Axes; axes= has {len(given)}.")
    return figure_of(given[0]), given


def shared_legend(
    figure: Figure, drawn: Sequence[Axes], entries: Mapping[str, Any], *, alone: bool, **options: Any
) -> None:
    """Name what all frames have in common: beside those of an own figure, else in the first of the given Axes.

    Parameters
    ----------
    figure
        Where the frames are.
    drawn
        The frames.
    entries
        Label -> what carries it.
    alone
        Whether the figure has nothing but these frames.
    **options
        Of the legend of an own figure.
    """
    if alone:
        figure.legend(entries.values(), entries.keys(), **options)
    else:
        drawn[0].legend(list(entries.values()), list(entries.keys()), fontsize=_SMALL)


def legend_below(
    figure: Figure, drawn: Sequence[Axes], *, alone: bool, entries: Mapping[str, Any] | None = None, **options: Any
) -> None:
    """One legend for all frames, where it covers none of them: in as many columns as the figure is wide.

    Parameters
    ----------
    figure, drawn, alone
        As of `shared_legend`.
    entries
        Label -> what carries it; of all frames if left out.
    **options
        Of the legend.
    """
    entries = entries_of(*drawn) if entries is None else entries
    if not entries:
        return
    widest = _HANDLE + 0.6 * max(map(len, entries))  # in sizes of the font
    columns = max(1, int(72 * figure.get_figwidth() / (_SMALL * widest)))
    rows = -(-len(entries) // columns)
    place: dict[str, Any] = {"loc": "outside lower center", "ncols": -(-len(entries) // rows)}
    shared_legend(figure, drawn, entries, alone=alone, fontsize=_SMALL, handlelength=_HANDLE - 2, **place, **options)


def entries_of(*drawn: Axes) -> dict[str, Any]:
    """Return label -> what carries it, of all frames, each label once."""
    entries: dict[str, Any] = {}
    for ax in drawn:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    return entries


def put(ax: Axes, item: Item, **style: Any) -> Any:
    """Draw one item of a frame: a curve, or a band, of a single point as that point, or as its interval."""
    style["label"] = item.label or None
    match item:
        case Line() if len(item.x) == 1:
            return ax.plot(item.x, item.y, **{"marker": "o", "ms": 5} | style)
        case Line() | Points():
            return ax.plot(item.x, item.y, **style)
        case Band() if len(item.x) == 1:
            return ax.vlines(item.x, item.low, item.high, lw=8, **style)
        case Band():
            return ax.fill_between(item.x, item.low, item.high, lw=0, **style)
        case Bars():
            at = item.x if item.lying else item.y
            return ax.errorbar(
                item.x, item.y, **{"xerr" if item.lying else "yerr": [at - item.low, item.high - at]}, **style
            )
        case Histogram():
            return ax.hist(item.edges[:-1], bins=list(item.edges), weights=item.counts, **style)
        case Mark():
            return (ax.axvline if item.of == "x" else ax.axhline)(item.at, **style)
        case Span():
            return (ax.axvspan if item.of == "x" else ax.axhspan)(item.low, item.high, lw=0, **style)


def put_in_turns(ax: Axes, item: Line, index: int, num: int, **style: Any) -> None:
    """Draw one of some curves that may coincide: thin below all others, and its share of the way on top of them."""
    own = turns(index, num) | style
    if "ls" in own:
        whole = {name: value for name, value in own.items() if name not in ("ls", "lw")}
        put(ax, item._replace(label=""), **whole, lw=0.7, zorder=1.95)
    put(ax, item, **own)


def describe(ax: Axes, frame: Frame, *, apart: str = " ", **style: Any) -> None:
    """Write what is on the axes and in which units, and the title if there is one."""
    for axis, write in ((frame.x, ax.set_xlabel), (frame.y, ax.set_ylabel)):
        unit = axis.unit.replace("^2", "²").replace("^3", "³")
        write(f"{axis.label}{apart if axis is frame.y else ' '}[{unit}]" if unit else axis.label)
    if frame.title:
        ax.set_title(frame.title, **style)


def figure_of(ax: Axes) -> Figure:
    """Return the figure that an Axes is in."""
    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure
