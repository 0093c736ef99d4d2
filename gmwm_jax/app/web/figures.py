"""What the rooms of the page show, as Plotly figures: the same arrays that the figures of `gmwm_jax.plotting` draw.

Channel and file names are escaped: Plotly reads tags. Figures are for a light page, `frames.themed` makes dark ones.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from gmwm_jax._internal.figure_data import Axis, Band, Bars, Frame, Histogram, Item, Line, Mark, Points, Span
from gmwm_jax._internal.palette import COLOURS
from gmwm_jax.app.web.frames import DASHES, FAINT, GREY, SYMBOLS, Style, figure_of
from gmwm_jax.app.web.truth import beside
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.tables import Estimate
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.intervals import replicates_needed
from gmwm_jax.inference.selection import Selection
from gmwm_jax.multisignal.joint import JointFit
from gmwm_jax.plotting.fitting import fit_data
from gmwm_jax.plotting.inference import bootstrap_data, selection_data
from gmwm_jax.plotting.multisignal import joint_fit_data
from gmwm_jax.plotting.recordings import recording_data
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.datasheet import Datasheet
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.units import convert
from gmwm_jax.variance.bands import Bands
from gmwm_jax.variance.wavelet import AbstractWaveletVariance, WaveletVariance

_DATA, _FIT, _OTHER = COLOURS[0], COLOURS[1], COLOURS[2]
_DATASHEET = "datasheet"
_SLOPES = {"quantisation": -2, "white noise": -1, "flicker": 0, "random walk": 1, "drift": 2}
"""Of the variance over scale, in double logarithm."""
_MAX_STEPS = 400
"""Different steps of a record that are counted one by one; of more, ranges."""


def recording(rec: Recording, channel: str | int) -> go.Figure:
    """Draw the samples of one channel; of a long record the range in each of two thousand bins, and its mean.

    Parameters
    ----------
    rec
        The recording.
    channel
        Its name or number.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figures.recording(rec, "accel_x").layout.yaxis.title.text
    'accel_x [m/s²]'
    """
    (frame,) = recording_data(rec[[channel]])

    def style(_: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Band):
            return Style(_DATA, opacity=0.45)
        return Style(_FIT if i else _DATA, width=1)

    return figure_of([frame], style, height=320)


def steps(rec: Recording, channel: str | int) -> go.Figure:
    """Draw how often the samples of a channel change by how much: a coarse grid is the quantisation of the sensor.

    Parameters
    ----------
    rec
        The recording.
    channel
        Its name or number.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figures.steps(rec, 0).layout.xaxis.title.text
    'difference of neighbouring samples [m/s²]'
    """
    one = rec[[channel]]
    differences = np.diff(one.data[:, 0])
    differences = differences[np.isfinite(differences)]
    low, high = np.quantile(differences, [0.001, 0.999])
    inner = differences[(differences >= low) & (differences <= high)]
    # equal steps differ in the last digits
    grid = np.unique(np.round(inner / (np.ptp(inner) or 1.0), 7)) * (np.ptp(inner) or 1.0)
    title = f"{one.channels[0]}: no grid of quantisation is seen"
    edges = np.linspace(low, high, 122) if high > low else np.array([low - 0.5, low + 0.5])
    if 1 < len(grid) <= _MAX_STEPS:
        size = float(np.min(np.diff(grid)))
        title = f"{one.channels[0]}: steps are multiples of {size:.4g} {one.units[0]}"
        edges = np.concatenate([grid - size / 4, [grid[-1] + size / 4]])
        counts = np.histogram(inner, np.append(grid - size / 2, grid[-1] + size / 2))[0]
        items: tuple[Item, ...] = (Bars("", grid, counts.astype(float), np.zeros(len(grid)), counts.astype(float)),)
    else:
        items = (Histogram("", edges, np.histogram(inner, edges)[0]),)
    frame = Frame(title, Axis("difference of neighbouring samples", one.units[0]), Axis("number of steps", ""), items)
    return figure_of([frame], lambda *_: Style(_DATA, width=2), height=300)


def variance(
    wv: AbstractWaveletVariance,
    *,
    allan: bool = False,
    samples: bool = False,
    deviation: bool = False,
    band: bool = True,
    datasheet: Datasheet | None = None,
    robust: AbstractWaveletVariance | None = None,
    slopes: bool = False,
    unit: str | Mapping[str, str] | None = None,
    columns: int = 3,
) -> go.Figure:
    """Draw wavelet or Allan variances over scale, a frame for each channel; channels of one unit have the same axis.

    Parameters
    ----------
    wv
        Of one or several channels.
    allan
        The Allan variance, twice the wavelet variance at half the span, over averaging time.
    samples
        Spans in samples instead of seconds; of a wavelet variance without rate they are anyway.
    deviation
        The root.
    band
        Draw the intervals.
    datasheet
        A model of what the datasheet promises; by unit where channels have several.
    robust
        Another estimate of the same channels, drawn beside.
    slopes
        Draw the slopes that processes have.
    unit
        Of the signal, as ``deg/h``: for all channels, or by SI unit.
    columns
        Frames in a row, at most.

    Raises
    ------
    ValueError
        A unit of another quantity; a datasheet for none of the channels.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"]))
    >>> figures.variance(wv, allan=True, deviation=True, unit="deg/h").layout.yaxis.title.text
    'Allan deviation [deg/h]'
    """
    promised = _by_unit(datasheet, wv.units)
    frames = []
    for i, name in enumerate(wv.channels):
        shown_unit, factor = _shown_unit(wv.units[i], unit)
        one = _Curve(allan, deviation, samples, factor)
        label = f"{'Allan' if allan else 'wavelet'} {'deviation' if deviation else 'variance'}"
        classic = label if robust is None else _estimator(wv)
        items = one.items(wv[i], classic, band)
        if robust is not None:
            items += one.items(robust[i], _estimator(robust), band)
        if wv.units[i] in promised:
            promise = np.asarray(promised[wv.units[i]].wavelet_variance(wv.scales))
            items.append(Line(_DATASHEET, one.x(wv[i]), one.y(promise)))
        if slopes:
            items += _slopes(one.x(wv[i]), one.y(wv[i].variance), 0.5 if deviation else 1.0)
        time = "averaging time T" if allan else "scale τ"
        axis = Axis(time, "samples" if samples or not wv.rate else "s", "log")
        power = shown_unit if deviation or shown_unit == "1" else f"({shown_unit})^2"
        frames.append(Frame(name, axis, Axis(label, power, "log"), tuple(items)))

    def style(_: Frame, i: int, item: Item) -> Style:
        if item.label == _DATASHEET:
            return Style(GREY, "dashdot", 1.8)
        if item.label.partition(", slope")[0] in _SLOPES:
            return Style(FAINT, "dot", 1)
        other = robust is not None and i >= 1 + band
        return Style(_FIT if other else _DATA, symbol=SYMBOLS[1 if other else 0], dash="dash" if other else "solid")

    ranges: dict[str, list[float]] = {}
    for frame in frames:
        ranges.setdefault(frame.y.unit, []).extend(_ends(frame))
    columns = min(len(frames), columns)
    rows = -(-len(frames) // columns)
    return figure_of(
        frames,
        style,
        columns=columns,
        height=140 + 340 * rows,
        y_ranges=[(min(ranges[f.y.unit]), max(ranges[f.y.unit])) for f in frames],
        note=_band_note(wv.shown) if band else "",
    )


def fit(fit: Fit, *, residuals: bool = True, datasheet: Datasheet | None = None) -> go.Figure:
    """Draw the wavelet variance, the model and its components over scale; below, the residuals.

    Parameters
    ----------
    fit
        Of one channel.
    residuals
        In half widths of the interval, in a frame below.
    datasheet
        A model of what the datasheet promises; by unit if there are several.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> figure = figures.fit(gj.fit(wv, "WN + RW"))
    >>> [trace.name for trace in figure.data if trace.showlegend][:2]
    ['fit', 'WN']
    """
    above, below = fit_data(fit, datasheet=datasheet)
    data, curve, model, *more = above.items
    # the sum lies below its parts, of which one may be nearly all of it, and the data on top of them
    title = f"{fit.wv.channels[0]}: objective {fit.objective:.7g}"
    above = above._replace(title=title, items=(model, *more, data, curve))
    if residuals:
        pulls = [
            item._replace(label=item.label or "residual") if isinstance(item, Points) else item for item in below.items
        ]
        below = below._replace(items=tuple(pulls))
    parts = {label: i for i, label in enumerate(fit.model.labels)}

    def style(frame: Frame, i: int, item: Item) -> Style:
        if frame is below:
            if isinstance(item, Mark):
                return Style(FAINT, width=1)
            return Style(_DATA, opacity=0.12) if isinstance(item, Span) else Style(_FIT, symbol="circle")
        if item is model:
            return Style(_FIT, width=4)
        if item.label == _DATASHEET:
            return Style(GREY, "dashdot", 1.8)
        part = parts.get(item.label.removesuffix(": zero"))
        if part is not None:
            return Style(COLOURS[2:][part % len(COLOURS[2:])], DASHES[part % len(DASHES)], 2)
        return Style(_DATA, symbol="circle")

    shown = fit.shown
    low = float(np.min(np.where(shown.low > 0, shown.low, fit.wv.variance)))
    y_range = (low / 4, float(np.max(shown.high)) * 3)
    if not residuals:
        return figure_of([above], style, height=480, y_ranges=[y_range], note=_band_note(shown))
    limit = max(1.3, 1.15 * float(np.max(np.abs(below.items[-1].y))))  # type: ignore[union-attr]
    return figure_of(
        [above, below],
        style,
        heights=(3.0, 1.0),
        shared_x=True,
        height=640,
        y_ranges=[y_range, (-limit, limit)],
        note=_band_note(shown),
    )


def intervals(fit: Fit, bootstrap: Bootstrap | None, *, truth: str | Composite | None = None) -> go.Figure:
    """Draw the intervals of theory against those of replicates, each parameter over its estimate.

    Parameters
    ----------
    fit
        Of one channel.
    bootstrap
        Its replicates, or None: theory alone.
    truth
        The model that was simulated, to be marked where a parameter has a true value, see `gmwm_jax.app.web.truth`.

    Raises
    ------
    ValueError
        A truth of which the fit has no component.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> figures.intervals(gj.fit(wv, "WN + RW"), None).layout.yaxis.ticktext
    ('WN sigma2', 'RW gamma2')
    """
    theory = fit.parameters()
    kept = [i for i, e in enumerate(theory) if np.isfinite(e.value) and e.value > 0]
    names = tuple(f"{theory.estimates[i].component} {theory.estimates[i].symbol}" for i in kept)
    percent = f"{100 * fit.level:g} %"
    enough = bootstrap is not None and len(bootstrap.good) >= replicates_needed(fit.level)
    rows = np.arange(len(kept), dtype=float)
    apart = 0.14 if enough else 0.0
    values = np.array([theory.estimates[i].value for i in kept])
    items: list[Item] = [_bars(f"{percent} theory", theory.estimates, kept, values, rows - apart)]
    if bootstrap is not None and enough:
        label = f"{percent} of {len(bootstrap.good)} replicates by {bootstrap.route}"
        items.append(_bars(label, bootstrap.parameters().estimates, kept, values, rows + apart))
    items.append(Mark("estimate", 1.0))
    if truth is not None:
        model = as_model(truth)
        if not {p.kind for p in model.processes} & {p.kind for p in fit.model.processes}:
            raise ValueError(f"The truth is {model}, and what was fitted is {' + '.join(fit.model.labels)}.")
        known = np.array(beside(fit.model, model))[kept]
        some = known > 0
        items.append(Points("truth", known[some] / values[some], rows[some]))
    bars = [item for item in items if isinstance(item, Bars)]
    marked = [item.x for item in items if isinstance(item, Points)]
    ends = np.concatenate([*marked, *(end for item in bars for end in (item.low, item.high))])
    wide = float(ends.max()) > 3
    if wide:  # the axis has no place for an interval that begins at zero
        floor = min(1.0, float(ends[ends > 0].min())) / 3
        items = [item._replace(low=np.maximum(item.low, floor)) if isinstance(item, Bars) else item for item in items]
    axis = Axis("parameter over its estimate", "", "log" if wide else "linear")
    frame = Frame(f"{fit.wv.channels[0]}: intervals", axis, Axis("", "", names=names), tuple(items))

    def style(_: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Mark):
            return Style(FAINT, "dot", 1.2)
        if isinstance(item, Points):
            return Style(COLOURS[3], symbol="star")
        return Style(_OTHER if i else _FIT, symbol=SYMBOLS[4 if i else 0], width=2.5)

    return figure_of([frame], style, height=170 + 46 * len(kept))


def joint(joint: JointFit) -> go.Figure:
    """Draw the wavelet variances of several records with their joint fit; below, the residuals of each.

    Parameters
    ----------
    joint
        Of one channel.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> figures.joint(gj.fit_records(units, "WN + RW")).layout.yaxis2.title.text
    'residual [half CI]'
    """
    above, below = joint_fit_data(joint)
    others = (_DATA, *COLOURS[2:])

    def style(frame: Frame, i: int, item: Item) -> Style:
        match item:
            case Band():
                return Style(_FIT)
            case Span():
                return Style(_DATA, opacity=0.12)
            case Mark():
                return Style(FAINT, width=1)
        if item is above.items[-1]:
            return Style(_FIT, width=4)
        first = sum(not isinstance(other, Line) for other in frame.items)  # what is of no record comes before them
        return Style(others[(i - first) % len(others)], width=1, symbol=SYMBOLS[(i - first) % len(SYMBOLS)])

    return figure_of([above, below], style, heights=(3.0, 1.0), shared_x=True, height=640)


def replicates(bootstrap: Bootstrap) -> go.Figure:
    """Draw the replicates of each parameter with the estimate, and the intervals of replicates and of theory.

    Parameters
    ----------
    bootstrap
        Of one fit.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> boot = gj.bootstrap(gj.fit(wv, "WN + RW"), 20, key=jax.random.key(0))
    >>> figures.replicates(boot).layout.xaxis.title.text
    'WN sigma2 [(m/s²)²]'
    """
    frames = bootstrap_data(bootstrap)

    def style(_: Frame, i: int, item: Item) -> Style:
        match item:
            case Histogram():
                return Style(_OTHER)
            case Span():
                return Style(_FIT, opacity=0.15)
            case Mark(label="estimate"):
                return Style(_FIT, width=2)
        return Style(GREY, "dash", 1.2)

    columns = min(3, len(frames))
    return figure_of(frames, style, columns=columns, height=150 + 260 * -(-len(frames) // columns))


def selection(selection: Selection) -> go.Figure:
    """Draw the twenty lowest candidates: differences of the criterion to the lowest, with intervals.

    Parameters
    ----------
    selection
        Of one channel.

    Examples
    --------
    >>> from gmwm_jax.app.web import figures
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> figures.selection(gj.select(rec, "WN + RW")).layout.title.text is None
    True
    """
    (frame,) = selection_data(selection)
    styles = ((_FIT, "circle"), (_OTHER, "square"), (GREY, "x"))
    names = ("recommended", "none is", "worse")

    def style(_: Frame, i: int, item: Item) -> Style:
        if isinstance(item, Mark):
            return Style(FAINT, "dot", 1.2)
        colour, symbol = next(s for s, name in zip(styles, names, strict=True) if item.label.startswith(name))
        return Style(colour, symbol=symbol, width=2)

    groups = [item for item in frame.items if isinstance(item, Bars)]
    half = np.concatenate([group.high - group.x for group in groups])
    around = float(np.median(half[half > 0])) / 2 if np.any(half > 0) else 1.0

    def place(x: np.ndarray) -> np.ndarray:
        # linear around zero and logarithmic beyond: a difference of a thousand does not hide those that matter
        return np.arcsinh(x / around)

    placed = [g._replace(x=place(g.x), low=place(g.low), high=place(g.high)) for g in groups]
    shown = frame._replace(items=(*placed, Mark("", 0.0)), x=Axis(frame.x.label, ""))
    made: Any = figure_of([shown], style, height=170 + 30 * len(frame.y.names))
    for trace, group in zip(made.data, groups, strict=False):
        trace.customdata = np.column_stack([group.x, group.low, group.high])
        trace.hovertemplate = "%{text}<br>%{customdata[0]:.4g} (%{customdata[1]:.4g} .. %{customdata[2]:.4g})"
    ends = [min(float(np.min(g.low)) for g in groups), max(float(np.max(g.high)) for g in groups)]
    powers = 10.0 ** np.arange(np.ceil(np.log10(around)), np.ceil(np.log10(max(ends[1], 10 * around))) + 1)
    ticks = [-powers[0], 0.0, *powers] if ends[0] < -powers[0] / 2 else [0.0, *powers]
    low, high = place(np.array(ends)) + np.array([-0.3, 0.3])
    return made.update_xaxes(tickvals=place(np.array(ticks)), ticktext=[f"{t:g}" for t in ticks], range=[low, high])


# -- parts ------------------------------------------------------------------------------------------------------------


class _Curve(NamedTuple):
    """Which of the variances is drawn over what, and how large its unit is."""

    allan: bool
    deviation: bool
    samples: bool
    factor: float

    def x(self, wv: WaveletVariance) -> np.ndarray:
        """Spans, or averaging times."""
        spans = wv.scales if self.samples else wv.times
        return spans / 2 if self.allan else spans

    def y(self, variance: np.ndarray) -> np.ndarray:
        """From a wavelet variance in SI."""
        value = np.asarray(variance) * (2.0 if self.allan else 1.0) * self.factor**2
        return np.sqrt(value) if self.deviation else value

    def items(self, wv: WaveletVariance, label: str, band: bool) -> list[Item]:
        """The band and the curve of one channel."""
        x, shown = self.x(wv), wv.shown
        around: list[Item] = [Band("", x, self.y(shown.low), self.y(shown.high))] if band else []
        return [*around, Line(label, x, self.y(wv.variance))]


def _estimator(wv: AbstractWaveletVariance) -> str:
    return f"robust, efficiency {wv.efficiency:g}" if wv.efficiency else "classic"


def _shown_unit(si: str, unit: str | Mapping[str, str] | None) -> tuple[str, float]:
    """The unit of a channel on the page, and the number of it that an SI unit is."""
    chosen = unit if isinstance(unit, str) else (unit or {}).get(si)
    return (si, 1.0) if chosen is None else (chosen, convert(1.0, si, chosen))


def _by_unit(datasheet: Datasheet | None, units: Sequence[str]) -> dict[str, Composite]:
    """SI unit -> model; a single model is for the only unit that there is."""
    if datasheet is None:
        return {}
    if isinstance(datasheet, Mapping):
        return {unit: as_model(model) for unit, model in datasheet.items()}
    if len(set(units)) > 1:
        raise ValueError(f"The channels have the units {', '.join(dict.fromkeys(units))}: say whose the datasheet is.")
    return {units[0]: as_model(datasheet)}


def _slopes(x: np.ndarray, y: np.ndarray, power: float) -> list[Item]:
    """Lines of the slopes that processes have, through the middle of the data."""
    k = len(x) // 2
    lines: list[Item] = []
    for name, slope in _SLOPES.items():
        line = y[k] * (x / x[k]) ** (slope * power)
        inside = (line >= 0.3 * y.min()) & (line <= 3 * y.max())
        lines.append(Line(f"{name}, slope {f'{slope * power:+g}' if slope else 0}", x[inside], line[inside]))
    return lines


def _ends(frame: Frame) -> list[float]:
    """The range of the curves and of the bands as far as they are positive."""
    ends: list[float] = []
    for item in frame.items:
        if isinstance(item, Band):
            ends += [float(np.max(item.high)), *(float(v) for v in item.low if v > 0)]
        elif isinstance(item, Line) and len(item.y):
            ends += [float(np.max(item.y)), float(np.min(item.y))]
    return ends


def _band_note(shown: Bands) -> str:
    return f"band: {100 * shown.level:g} % interval, {shown.basis}"


def _bars(label: str, table: Sequence[Estimate], kept: list[int], values: np.ndarray, rows: np.ndarray) -> Bars:
    """Intervals over estimates; a point where there is none."""
    ends = np.array([(table[i].ci_low, table[i].ci_high) for i in kept]).T / values
    low, high = (np.where(np.isfinite(end), end, 1.0) for end in ends)
    return Bars(label, np.ones(len(kept)), rows, low, high, lying=True)
