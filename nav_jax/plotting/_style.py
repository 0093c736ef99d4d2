"""What the figures share: colours, grids, shaded outages, axes, and the registry at which figures register."""

from collections.abc import Iterable
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from gmwm_jax._internal.drawing import registry
from gmwm_jax._internal.figures import GivenAxes, frames

draw = registry("nav_jax")
"""Draw a result by the function that has registered for its class: ``draw(result, **options)`` is `result.plot`."""

COLOURS = ("#1f4e79", "#c23b22", "#2a8f8f", "#e08e0b", "#7a4f9a", "#5b8c2a", "#b5628c", "#6b6b6b")
"""Of models, in their order."""

INK = "0.25"
DEGREES = 180 / np.pi
_OUTAGE = "#f3e3c3"
_MANY = 500
"""Of a logarithmic axis that spans more, only powers of ten have room for a number."""


def plan_and_height(axes: GivenAxes | None) -> tuple[Figure, list[Axes]]:
    """Two labelled frames: a plan with one scale for both axes, and height over time."""
    figure, chosen = frames(axes, 1, 2, (10.5, 4.8))
    plan, height = chosen
    plan.set(xlabel="east [m]", ylabel="north [m]", title="plan")
    plan.set_aspect("equal", adjustable="datalim")
    height.set(xlabel="time [s]", ylabel="height [m]", title="height")
    for ax in (plan, height):
        grid(ax)
    return figure, chosen


def shade(ax: Axes, outages: Iterable[tuple[float, float]], *, label: bool = True) -> None:
    """The outages as bands behind everything, one entry for all of them in the legend."""
    for i, (start, end) in enumerate(outages):
        ax.axvspan(start, end, color=_OUTAGE, lw=0, zorder=0, label="outage" if label and i == 0 else None)


def grid(ax: Axes) -> None:
    """Thin lines behind the data."""
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)


def logarithmic(ax: Axes, which: Literal["x", "y"] = "y") -> None:
    """With ticks that read as numbers, also where the axis has no power of ten on it."""
    ax.set(**{f"{which}scale": "log"})
    low, high = ax.get_ylim() if which == "y" else ax.get_xlim()
    axis = ax.yaxis if which == "y" else ax.xaxis
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(LogLocator(subs=(2, 5)))
    axis.set_minor_formatter(StrMethodFormatter("{x:g}") if high < _MANY * low else NullFormatter())


def along_time(ax: Axes, outages: Iterable[tuple[float, float]]) -> None:
    shade(ax, outages)
    ax.margins(x=0)
    grid(ax)
    time_below(ax)


def time_below(ax: Axes) -> None:
    """Frames that share their time have it under the lowest."""
    spec = ax.get_subplotspec()
    if len(ax.get_shared_x_axes().get_siblings(ax)) == 1 or (spec and spec.is_last_row()):
        ax.set_xlabel("time [s]")


def positive(x: np.ndarray) -> np.ndarray:
    """NaN for what has no logarithm."""
    return np.where(x > 0, x, np.nan)
