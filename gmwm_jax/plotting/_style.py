"""What the figures share: colours, labels, how a variance is drawn, and the registry at which figures register."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gmwm_jax._internal.drawing import registry
from gmwm_jax._internal.figures import GivenAxes, frames, new_figure
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import WaveletVariance

draw = registry("gmwm_jax")
"""Draw a result by the function that has registered for its class: ``draw(result, **options)`` is `result.plot`."""

DATA, FIT, DATASHEET = "#1f4e79", "#c23b22", "#5b8c2a"
COMPONENTS = ("#e08e0b", "#7a4f9a", "#2a8f8f", "#b5628c", "#8c6d31", "#4f7fbf", "#6b6b6b")
MAX_POINTS = 4000
"""In a time series: more are drawn as the band between minima and maxima."""

Datasheet = str | AbstractProcess | Composite | Mapping[str, str | AbstractProcess | Composite]
"""A model, or where the channels have several units one for each of them: ``{"rad/s": ..., "m/s^2": ...}``."""


def draw_variance(ax: Axes, wv: WaveletVariance, colour: str, label: str) -> None:
    ax.fill_between(wv.times, wv.ci_low, wv.ci_high, color=colour, alpha=0.18, lw=0)
    ax.loglog(wv.times, wv.variance, "o-", color=colour, ms=3.5, lw=1, label=label)


def draw_datasheet(ax: Axes, wv: WaveletVariance, model: Composite) -> None:
    nu = np.asarray(model.wavelet_variance(wv.scales))
    ax.loglog(wv.times, nu, "-.", color=DATASHEET, lw=1.4, label="datasheet")


def finish_variance(ax: Axes, wv: WaveletVariance, unit: str) -> None:
    ax.set_xlabel(time_label(wv))
    ax.set_ylabel("wavelet variance [1]" if unit == "1" else f"wavelet variance [({pretty(unit)})²]")
    legend(ax, wv.level)


def legend(ax: Axes, level: float) -> None:
    ax.grid(True, which="major", color="0.88", lw=0.6)
    ax.set_axisbelow(True)
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(fontsize=8, title=f"band: {100 * level:g} % interval", title_fontsize=8, ncols=1 + (len(handles) > 5))


def time_label(wv: WaveletVariance) -> str:
    return "scale τ [s]" if wv.rate else "scale τ [samples]"


def pretty(unit: str) -> str:
    return unit.replace("^2", "²").replace("^3", "³")


def lowest(ci_low: np.ndarray, estimate: np.ndarray) -> float:
    """The lower end of a logarithmic axis, which has no place for an interval that starts at zero."""
    return float(np.min(np.where(ci_low > 0, ci_low, estimate)))


def title_of(wv: WaveletVariance, members: Sequence[int]) -> str:
    names = ", ".join(wv.channels[i] for i in members) if len(members) < 5 else f"{len(members)} channels"
    title = names if wv.name in ("", names) else f"{wv.name}, {names}"
    return f"{title}, robust ({wv.efficiency:g})" if wv.efficiency else title


def coloured(wv: WaveletVariance, members: Sequence[int], single: str) -> Iterator[tuple[str, int, str]]:
    """Colour, number and label of the channels in one frame."""
    if len(members) == 1:
        yield DATA, members[0], single
    else:
        yield from ((colour, i, wv.channels[i]) for colour, i in zip(cycle(COMPONENTS), members, strict=False))


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


def unit_frames(wv: WaveletVariance, axes: GivenAxes | None) -> tuple[Figure, list[tuple[Axes, str, list[int]]]]:
    """A frame for each unit, with the numbers of the channels that it shows."""
    members: dict[str, list[int]] = {}
    for i, unit in enumerate(wv.units):
        members.setdefault(unit, []).append(i)
    figure, chosen = frames(axes, 1, len(members), (0.6 + 6 * len(members), 4.6))
    return figure, [(frame, unit, who) for frame, (unit, who) in zip(chosen, members.items(), strict=True)]


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
