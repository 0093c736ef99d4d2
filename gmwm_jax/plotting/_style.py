"""What the figures share: colours, labels, how variances are drawn, and the registry at which figures register."""

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import registry
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line
from gmwm_jax._internal.figures import GivenAxes, describe, frames, new_figure, put
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import AbstractWaveletVariance

draw = registry("gmwm_jax")
"""Draw a result by the function that has registered for its class: ``draw(result, **options)`` is `result.plot`."""

_OF_CHANNELS: dict[type, Callable[..., Figure]] = {}


def draws_channels_of(result: type) -> Callable[[Callable[..., Figure]], Callable[..., Figure]]:
    """Register a function that draws several results of a class, one for each channel."""

    def register(function: Callable[..., Figure]) -> Callable[..., Figure]:
        _OF_CHANNELS[result] = function
        return function

    return register


@draw.register(Channels)
def _draw_channels(channels: Channels[Any], **options: Any) -> Figure:
    return _OF_CHANNELS[type(channels[0])](channels, **options)


DATA, FIT, DATASHEET = "#1f4e79", "#c23b22", "#5b8c2a"
COMPONENTS = ("#e08e0b", "#7a4f9a", "#2a8f8f", "#b5628c", "#8c6d31", "#4f7fbf", "#6b6b6b")
DRAWS = "#2a7f8e"
TIME = Axis("time", "s")
MAX_POINTS = 4000
"""In a time series: more are drawn as the band between minima and maxima."""

Datasheet = str | AbstractProcess | Composite | Mapping[str, str | AbstractProcess | Composite]
"""A model, or where the channels have several units one for each of them: ``{"rad/s": ..., "m/s^2": ...}``."""


def scale_axis(wv: AbstractWaveletVariance) -> Axis:
    """Spans of the filter."""
    return Axis("scale τ", "s" if wv.rate else "samples", "log")


def variance_axis(unit: str) -> Axis:
    """Wavelet variances of a signal of this unit."""
    return Axis("wavelet variance", "1" if unit == "1" else f"({unit})^2", "log")


def variance_items(wv: AbstractWaveletVariance, label: str) -> list[Item]:
    """Wavelet variance of one channel with its interval."""
    return [Band("", wv.times, wv.ci_low, wv.ci_high), Line(label, wv.times, wv.variance)]


def datasheet_items(wv: AbstractWaveletVariance, models: Mapping[str, Composite]) -> list[Item]:
    """What the datasheet promises for the unit of one channel, if it says something of it."""
    if wv.units[0] not in models:
        return []
    return [Line("datasheet", wv.times, np.asarray(models[wv.units[0]].wavelet_variance(wv.scales)))]


def dense_scales(wv: AbstractWaveletVariance) -> np.ndarray:
    """Even spans between the scales: theory is drawn there too."""
    return np.unique(2 * np.round(np.geomspace(wv.scales[0], wv.scales[-1], 200) / 2))


def in_half_widths(wv: AbstractWaveletVariance, residuals: np.ndarray) -> np.ndarray:
    """Residuals over the half of the interval of confidence that they point away from."""
    return residuals / np.where(residuals > 0, wv.variance - wv.ci_low, wv.ci_high - wv.variance)


def in_bins(t: np.ndarray, x: np.ndarray) -> tuple[int, Band, Line]:
    """A long record as the range and the mean of the samples in each of a few thousand bins; NaN are missing ones.

    Also the number of samples in a bin; the last may have fewer, no sample is left out.
    """
    size = -(-len(x) // (MAX_POINTS // 2))
    first = np.arange(0, len(x), size)
    at = (t[first] + t[np.append(first[1:], len(x)) - 1]) / 2
    with np.errstate(invalid="ignore"):  # none there: no mean
        mean = np.add.reduceat(np.nan_to_num(x), first) / np.add.reduceat(~np.isnan(x), first, dtype=float)
    band = Band("min .. max", at, np.fmin.reduceat(x, first), np.fmax.reduceat(x, first))
    return size, band, Line(f"mean of {size} samples", at, mean)


def draw_variance(ax: Axes, items: Sequence[Item], colour: str) -> None:
    """A band and its curve."""
    band, curve = items
    put(ax, band, color=colour, alpha=0.18)
    put(ax, curve, marker="o", color=colour, ms=3.5, lw=1)


def draw_variances(ax: Axes, frame: Frame) -> Sequence[Item]:
    """Bands and curves of one or several channels, log-log; returns the items that are left to draw."""
    finish_log_log(ax, frame)
    num = sum(isinstance(item, Band) for item in frame.items)
    for i, colour in zip(range(num), (DATA,) if num == 1 else cycle(COMPONENTS), strict=False):
        draw_variance(ax, frame.items[2 * i : 2 * i + 2], colour)
    return frame.items[2 * num :]


def draw_datasheet(ax: Axes, items: Sequence[Item]) -> None:
    """The promise, if there is one."""
    for item in items:
        put(ax, item, color=DATASHEET, lw=1.4, ls="-.")


def finish_log_log(ax: Axes, frame: Frame) -> None:
    """Labels, scales, and thin lines behind the data."""
    describe(ax, frame)
    ax.set(xscale=frame.x.scale, yscale=frame.y.scale)
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)


def legend(ax: Axes, level: float) -> None:
    """What is what, and what the bands are."""
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(fontsize=8, title=f"band: {100 * level:g} % interval", title_fontsize=8, ncols=1 + (len(handles) > 5))


def lowest(ci_low: np.ndarray, estimate: np.ndarray) -> float:
    """The lower end of a logarithmic axis, which has no place for an interval that starts at zero."""
    return float(np.min(np.where(ci_low > 0, ci_low, estimate)))


def title_of(wv: AbstractWaveletVariance, members: Sequence[int]) -> str:
    """Name and channels."""
    names = ", ".join(wv.channels[i] for i in members) if len(members) < 5 else f"{len(members)} channels"
    title = names if wv.name in ("", names) else f"{wv.name}, {names}"
    return f"{title}, robust ({wv.efficiency:g})" if wv.efficiency else title


def members_by_unit(wv: AbstractWaveletVariance) -> dict[str, list[int]]:
    """Unit -> numbers of the channels that have it: those share a frame."""
    members: dict[str, list[int]] = {}
    for i, unit in enumerate(wv.units):
        members.setdefault(unit, []).append(i)
    return members


def by_unit(datasheet: Datasheet | None, units: Sequence[str]) -> dict[str, Composite]:
    """Unit -> model; a single model is for the only unit there is."""
    if datasheet is None:
        return {}
    if isinstance(datasheet, Mapping):
        if not set(datasheet) & set(units):
            raise ValueError(f"The datasheet is about {', '.join(datasheet)}, and the data are in {', '.join(units)}.")
        return {unit: as_model(model) for unit, model in datasheet.items()}
    if len(set(units)) > 1:
        raise ValueError(
            f"The channels have the units {', '.join(dict.fromkeys(units))}, and a datasheet model belongs to one: "
            'give datasheet={"rad/s": ...}.'
        )
    return {units[0]: as_model(datasheet)}


def large_and_small(axes: GivenAxes | None) -> tuple[Figure, list[Axes]]:
    """A large frame above a small one."""
    return frames(axes, 2, 1, (7, 6.6), sharex=True, height_ratios=(3, 1))


def pairs_of_frames(
    axes: GivenAxes | None, num: int, width: Real, more_height: Real
) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """A large frame above a small one for each channel, three channels in a row."""
    if axes is not None:
        figure, given = frames(axes, 2, num, (0, 0))
        return figure, list(zip(given[:num], given[num:], strict=True))
    columns = min(num, 3)
    rows = -(-num // columns)
    figure = new_figure(width * columns, more_height + 4.9 * rows)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3, 1] * rows)
    pairs = []
    for i in range(num):
        row, column = divmod(i, columns)
        top = figure.add_subplot(grid[2 * row, column])
        pairs.append((top, figure.add_subplot(grid[2 * row + 1, column], sharex=top)))
    return figure, pairs
