"""What the figures share: colours, grids, shaded outages, axes, and the registry at which figures register."""

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, StrMethodFormatter

from gmwm_jax._internal.drawing import GivenAxes, registry
from gmwm_jax._internal.figure_data import Axis, Frame, Item, Line, Span
from gmwm_jax._internal.figures import describe, frames, put, put_in_turns
from gmwm_jax._internal.palette import COLOURS

draw = registry("nav_jax")
"""Draw a result by the function that has registered for its class: ``draw(result, **options)`` is `result.plot`."""

INK = "0.25"
DEGREES = 180 / np.pi
TIME = Axis("time", "s")
_OUTAGE = "#f3e3c3"
_ONE_VALUE = 1 + 1e-9
"""Values on a logarithmic axis that differ by less have no width of their own."""
_MANY = 500
"""Of a logarithmic axis that spans more, only powers of ten have room for a number."""


def plan_frame(items: Iterable[Item], title: str = "plan") -> Frame:
    """Seen from above."""
    return Frame(title, Axis("east", "m"), Axis("north", "m"), tuple(items))


def height_frame(items: Iterable[Item]) -> Frame:
    """Height over time."""
    return Frame("height", TIME, Axis("height", "m"), tuple(items))


def plan_and_height(axes: GivenAxes | None, shown: Sequence[Frame]) -> tuple[Figure, list[Axes]]:
    """Two labelled frames: a plan with one scale for both axes, and height over time."""
    figure, chosen = frames(axes, 1, 2, (10.5, 4.8))
    for ax, frame in zip(chosen, shown, strict=True):
        describe(ax, frame)
        grid(ax)
    chosen[0].set_aspect("equal", adjustable="datalim")
    return figure, chosen


def outage_items(outages: Iterable[tuple[float, float]]) -> list[Item]:
    """The outages, one entry for all of them in a legend."""
    return [Span("" if i else "outage", start, end) for i, (start, end) in enumerate(outages)]


def shade(ax: Axes, frame: Frame) -> None:
    """Draw the outages of a frame, behind everything."""
    for item in frame.items:
        if isinstance(item, Span) and item.of == "x":
            put(ax, item, color=_OUTAGE, zorder=0)


def without_outages(frame: Frame) -> list[Item]:
    """The items of a frame but for its outages."""
    return [item for item in frame.items if not (isinstance(item, Span) and item.of == "x")]


def bands_and_lines(ax: Axes, frame: Frame) -> list[Item]:
    """Draw a band and a line for each model in turns, of which none hides another; what was drawn."""
    items = without_outages(frame)
    num = len(items) // 2
    for i, (band, line) in enumerate(zip(items[::2], items[1::2], strict=True)):
        put(ax, band, color=COLOURS[i % len(COLOURS)], alpha=0.2)
        assert isinstance(line, Line)
        put_in_turns(ax, line, i, num)
    return items


def grid(ax: Axes) -> None:
    """Thin lines behind the data."""
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)


def logarithmic(ax: Axes, which: Literal["x", "y"] = "y") -> None:
    """With ticks that read as numbers, also where the axis has no power of ten on it, or but one value."""
    first, last = ax.dataLim.intervaly if which == "y" else ax.dataLim.intervalx
    if 0 < first <= last < first * _ONE_VALUE:
        ax.set(**{f"{which}lim": (first / 1.1, last * 1.1)})
    ax.set(**{f"{which}scale": "log"})
    low, high = ax.get_ylim() if which == "y" else ax.get_xlim()
    axis = ax.yaxis if which == "y" else ax.xaxis
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(LogLocator(subs=(2, 5)))
    axis.set_minor_formatter(StrMethodFormatter("{x:g}") if high < _MANY * low else NullFormatter())


def along_time(ax: Axes, frame: Frame) -> None:
    """Outages, a grid, and the whole width for the time."""
    shade(ax, frame)
    ax.margins(x=0)
    grid(ax)
    time_below(ax)


def time_below(ax: Axes) -> None:
    """Frames that share their time have it under the lowest."""
    spec = ax.get_subplotspec()
    if len(ax.get_shared_x_axes().get_siblings(ax)) == 1 or (spec and spec.is_last_row()):
        return
    ax.set_xlabel("")


def signed_logarithm(ax: Axes, around: float) -> None:
    """Linear within so much of zero and logarithmic beyond, with few ticks that read as numbers."""
    ax.set_yscale("symlog", linthresh=around)
    most = np.abs(ax.get_ylim()).max()
    powers = 10.0 ** np.arange(np.ceil(np.log10(around)), np.ceil(np.log10(most)))
    powers = powers[:: max(1, round(len(powers) / 2))]
    ax.set_yticks([*-powers[::-1], 0.0, *powers])
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.yaxis.set_minor_locator(NullLocator())


def beside_title(ax: Axes, text: str, colour: str) -> None:
    """A note on a frame, where it covers no curve."""
    ax.set_title(text, loc="right", fontsize=8, color=colour)


def positive(x: np.ndarray) -> np.ndarray:
    """NaN for what has no logarithm."""
    return np.where(x > 0, x, np.nan)
