"""What the figures share: colours, labels, how variances are drawn, and the registry at which figures register."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import GivenAxes, registry
from gmwm_jax._internal.figure_data import Axis, Band, Frame, Item, Line
from gmwm_jax._internal.figures import describe, frames, new_figure, put, put_in_turns
from gmwm_jax._internal.palette import COLOURS, DASHES, MARKERS
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.datasheet import Datasheet
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.bands import Bands
from gmwm_jax.variance.stability import StabilityDeviation
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


DATA, FIT, DATASHEET = COLOURS[0], COLOURS[1], "0.35"
DRAWS = COLOURS[2]
VERDICTS = {
    "recommended": {"color": FIT, "fmt": "o"},
    "equivalent": {"color": DRAWS, "fmt": "s"},
    "worse": {"color": "0.55", "fmt": "x"},
}
"""Of models that are compared."""

TIME = Axis("time", "s")
MAX_POINTS = 4000
"""In a time series: more are drawn as the band between minima and maxima."""


def scale_axis(wv: AbstractWaveletVariance) -> Axis:
    """Spans of the filter."""
    return Axis("scale τ", "s" if wv.rate else "samples", "log")


def variance_axis(unit: str) -> Axis:
    """Wavelet variances of a signal of this unit."""
    return Axis("wavelet variance", "1" if unit == "1" else f"({unit})^2", "log")


def variance_items(wv: AbstractWaveletVariance, label: str, shown: Bands | None = None) -> list[Item]:
    """Wavelet variance of one channel with its interval, by default the one that is printed."""
    band = wv.shown if shown is None else shown
    return [Band("", wv.times, band.low, band.high), Line(label, wv.times, wv.variance)]


def datasheet_items(wv: AbstractWaveletVariance, models: Mapping[str, Composite]) -> list[Item]:
    """What the datasheet promises for the unit of one channel, if it says something of it."""
    if wv.units[0] not in models:
        return []
    return [Line("datasheet", wv.times, np.asarray(models[wv.units[0]].wavelet_variance(wv.scales)))]


def dense_scales(wv: AbstractWaveletVariance) -> np.ndarray:
    """Even spans between the scales: theory is drawn there too."""
    return np.unique(2 * np.round(np.geomspace(wv.scales[0], wv.scales[-1], 200) / 2))


def in_half_widths(wv: AbstractWaveletVariance, residuals: np.ndarray, shown: Bands | None = None) -> np.ndarray:
    """Residuals over the half of the interval of confidence that they point away from."""
    band = wv.shown if shown is None else shown
    return residuals / np.where(residuals > 0, wv.variance - band.low, band.high - wv.variance)


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


def component_style(index: int) -> dict[str, Any]:
    """Colour and dashes of a part of the model; those of the data and of the fit are left to them."""
    return {"color": COLOURS[2:][index % len(COLOURS[2:])], "ls": DASHES[index % len(DASHES)], "lw": 1.4}


def draw_variance(ax: Axes, items: Sequence[Item], colour: str, marker: str) -> None:
    """A band and its curve."""
    band, curve = items
    put(ax, band, color=colour, alpha=0.18)
    put(ax, curve, marker=marker, color=colour, ms=3.5, lw=1)


def draw_variances(ax: Axes, frame: Frame) -> Sequence[Item]:
    """Bands and curves of one or several channels, log-log; returns the items that are left to draw."""
    finish_log_log(ax, frame)
    num = sum(isinstance(item, Band) for item in frame.items)
    for i in range(num):
        band, curve = frame.items[2 * i : 2 * i + 2]
        assert isinstance(curve, Line)
        put(ax, band, color=COLOURS[i % len(COLOURS)], alpha=0.18)
        style = {"lw": 1} if num == 1 else {}
        put_in_turns(ax, curve, i, num, marker=MARKERS[i % len(MARKERS)], ms=3.5, **style)
    return frame.items[2 * num :]


def draw_datasheet(ax: Axes, items: Sequence[Item]) -> None:
    """The promise, if there is one."""
    for item in items:
        put(ax, item, color=DATASHEET, lw=1.4, ls=(0, (8, 2, 1, 2, 1, 2)))


def finish_log_log(ax: Axes, frame: Frame) -> None:
    """Labels, scales, and thin lines behind the data."""
    describe(ax, frame)
    ax.set(xscale=frame.x.scale, yscale=frame.y.scale)
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)


def few_ticks(ax: Axes, scale: str) -> None:
    """Numbers along x that have room beside each other; less than two decades are counted as a linear axis is."""
    ax.set_xscale(scale)
    low, high = ax.get_xlim()
    if scale == "linear":
        ax.locator_params(axis="x", nbins=4)
    elif low > 0 and high < 100 * low:
        ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())


def in_standard_units(ax: Axes) -> None:
    """Residuals along y: linear where they should be and logarithmic beyond, with numbers that have room."""
    ax.set_yscale("symlog", linthresh=4)
    low, high = ax.get_ylim()
    ax.set_yticks([y for y in (-1000, -100, -10, -2, 0, 2, 10, 100, 1000) if low <= y <= high])
    ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def band_title(shown: Bands) -> dict[str, Any]:
    """What the bands are, above a legend."""
    return {"title": f"band: {100 * shown.level:g} % interval, {shown.basis}", "title_fontsize": 8}


def legend(ax: Axes, shown: Bands) -> None:
    """What is what in a frame, and what the bands are."""
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(fontsize=8, ncols=1 + (len(handles) > 5), handlelength=3.5, **band_title(shown))


def lowest(ci_low: np.ndarray, estimate: np.ndarray) -> float:
    """The lower end of a logarithmic axis, which has no place for an interval that starts at zero."""
    return float(np.min(np.where(ci_low > 0, ci_low, estimate)))


def title_of(wv: AbstractWaveletVariance | StabilityDeviation, members: Sequence[int]) -> str:
    """Name and channels."""
    names = ", ".join(wv.channels[i] for i in members) if len(members) < 5 else f"{len(members)} channels"
    title = names if wv.name in ("", names) else f"{wv.name}, {names}"
    robust = isinstance(wv, AbstractWaveletVariance) and wv.efficiency
    return f"{title}, robust ({robust:g})" if robust else title


def members_by_unit(wv: AbstractWaveletVariance | StabilityDeviation) -> dict[str, list[int]]:
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
    return frames(axes, 2, 1, (7, 7.4), sharex=True, height_ratios=(3, 1))


def pairs_of_frames(axes: GivenAxes | None, num: int, width: Real) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """A large frame above a small one for each channel, three channels in a row."""
    if axes is not None:
        figure, given = frames(axes, 2, num, (0, 0))
        return figure, list(zip(given[:num], given[num:], strict=True))
    columns = min(num, 3)
    rows = -(-num // columns)
    figure = new_figure(width * columns, 0.5 + 4.9 * rows)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=[3, 1] * rows)
    pairs = []
    for i in range(num):
        row, column = divmod(i, columns)
        top = figure.add_subplot(grid[2 * row, column])
        pairs.append((top, figure.add_subplot(grid[2 * row + 1, column], sharex=top)))
    return figure, pairs
