"""Tables of results, as the rooms show them beside every figure and as files take them away.

Numbers stay numbers: the page and the file decide how they are written.
"""

import csv
import io
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gmwm_jax.app.web.datasheet import Verdict
from gmwm_jax.app.web.formula import kinds, to_filter
from gmwm_jax.app.web.truth import beside
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.slopes import read_off
from gmwm_jax.fitting.tables import EstimateTable
from gmwm_jax.inference.bootstrapping import Bootstrap
from gmwm_jax.inference.goodness import goodness_of_fit
from gmwm_jax.inference.intervals import replicates_needed
from gmwm_jax.inference.selection import Selection
from gmwm_jax.processes.base import Composite
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.allan import allan_deviation
from gmwm_jax.variance.wavelet import AbstractWaveletVariance

Cell = str | float | int
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
"""With what a text begins that a spreadsheet takes for a formula."""


class Table(NamedTuple):
    """Rows under columns, each with a unit."""

    columns: tuple[str, ...]
    units: tuple[str, ...]
    """Of each column; "" for texts, and where a column beside it says the unit of each row."""
    rows: tuple[tuple[Cell, ...], ...]
    text: str
    """What the table is, and what stands below it: lines of plain text."""


def recording(rec: Recording) -> Table:
    """Tabulate what is known of each channel of a recording.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> tables.recording(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])).rows[0][:3]
    ('accel_x', 'm/s^2', 2000)
    """
    missing = rec.num_missing
    rows = tuple(
        (name, unit, len(rec), missing[name], *(float(f(x)) for f in (np.nanmean, np.nanstd, np.nanmin, np.nanmax)))
        for unit, (name, x) in zip(rec.units, rec.items(), strict=True)
    )
    columns = ("channel", "unit", "samples", "missing", "mean", "standard deviation", "lowest", "highest")
    length = f"{len(rec)} samples, {rec.duration:.6g} s at {rec.rate:g} Hz"
    text = f"{rec.name or 'Recording'}: {length}; numbers in the unit of the row"
    if rec.understood is not None:
        text += f"\n{rec.understood.in_short()}"
    return Table(columns, ("",) * 8, rows, text)


def preview(rec: Recording, rows: int = 5) -> Table:
    """Tabulate the first samples of a recording.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> tables.preview(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])).columns
    ('time', 'accel_x')
    """
    shown = min(rows, len(rec))
    first = [(float(i / rec.rate), *map(float, rec.data[i])) for i in range(shown)]
    columns, units = ("time", *rec.channels), ("s", *rec.units)
    return Table(columns, units, tuple(first), f"The first {shown} of {len(rec)} samples")


def scales(wv: AbstractWaveletVariance) -> Table:
    """Tabulate a wavelet variance: a row a scale and channel.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> tables.scales(wv).rows[0][:3]
    ('accel_x', 2, 0.02)
    """
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate(wv.channels):
        one = wv[i]
        values = (one.times, one.variance, one.shown.low, one.shown.high, one.shown.dof)
        numbers = zip(one.scales, *values, strict=True)
        rows += [(name, int(tau), *map(float, v)) for tau, *v in numbers]
    percent = f"{100 * wv.level:g} %"
    columns = ("channel", "scale", "scale in time", "wavelet variance", f"{percent} low", "high", "dof")
    squares = {"1": "1"}.get(wv.units[0], f"({wv.units[0]})^2") if len(set(wv.units)) == 1 else "unit of channel ^2"
    units = ("", "samples", "s" if wv.rate else "samples", squares, squares, squares, "1")
    missing = f" ({wv.missing})" if wv.missing else ""
    samples = f", {wv.num_samples} samples{missing}" if wv.num_samples else ""
    text = f"{wv.estimator.title}Haar wavelet variance{samples}{wv.shown.remark}"
    if len(set(wv.units)) > 1:
        text += "\n" + ", ".join(f"{c} in {u}" for c, u in zip(wv.channels, wv.units, strict=True))
    return Table(columns, units, tuple(rows), "\n".join([text, *(f"warning: {w}" for w in wv.warnings)]))


def readings(wv: AbstractWaveletVariance) -> Table:
    """Tabulate N, B and K of each channel, read off its Allan deviation as IEEE 952 does, in units of datasheets.

    Raises
    ------
    ValueError
        No rate, or fewer than three scales.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> [row[1] for row in tables.readings(wv).rows]
    ['N', 'B', 'K']
    """
    read = [(c, read_off(allan_deviation(wv[c]), datasheet=True)) for c in wv.channels]
    whole = _of_estimates(read[0][1])
    rows = tuple((channel, *row[1:]) for channel, table in read for row in _of_estimates(table).rows)
    return whole._replace(columns=("channel", *whole.columns[1:]), rows=rows)


def estimates(fit: Fit, truth: Composite | None = None) -> Table:
    """Tabulate the parameters of a fit per sample, with the objective and the test of fit below.

    Parameters
    ----------
    fit
        Of one channel.
    truth
        The model that was simulated, whose values stand beside the estimates; none for a record of a sensor.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> [row[:2] for row in tables.estimates(gj.fit(wv, "WN + RW")).rows]
    [('WN', 'sigma2'), ('RW', 'gamma2')]
    """
    table = _of_estimates(fit.parameters())
    below = [f"objective {fit.objective:.8g} ({fit.weights.name} weights); {fit.search}", *fit.verdict]
    table = table._replace(text="\n".join([table.text, *below]))
    if truth is None:
        return table
    known = beside(fit.model, truth)
    rows = tuple((*row[:2], value, *row[2:]) for row, value in zip(table.rows, known, strict=True))
    columns = (*table.columns[:2], "truth", *table.columns[2:])
    return Table(columns, ("",) * len(columns), rows, f"{table.text}\nsimulated: {truth}")


def goodness(fit: Fit) -> Table:
    """Tabulate where a fit misses its data: a row a scale, the test over all of them below.

    Raises
    ------
    ValueError
        See `gmwm_jax.goodness_of_fit`.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> tables.goodness(gj.fit(wv, "WN + RW")).columns[-1]
    'pull'
    """
    test, wv = goodness_of_fit(fit), fit.wv
    numbers = zip(wv.times, wv.variance, fit.fitted, test.pulls, strict=True)
    rows = tuple(tuple(map(float, row)) for row in numbers)
    square = "1" if fit.unit == "1" else f"({fit.unit})^2"
    said = f"chi-square {test.statistic:.4g} with {test.dof} degrees of freedom, p = {test.p_value:.3g}"
    text = f"Goodness of fit of {' + '.join(fit.model.labels)}: {said}\npull: residual in its standard deviations"
    return Table(("scale", "data", "model", "pull"), ("s" if wv.rate else "samples", square, square, ""), rows, text)


def filter(fit: Fit) -> Table:
    """Tabulate what a Kalman filter takes: densities and rates in SI.

    Raises
    ------
    ValueError
        The rate is not known.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> [(row[1], row[5]) for row in tables.filter(gj.fit(wv, "WN + RW")).rows]
    [('q', '(m/s^2)^2/Hz'), ('q', '(m/s^2)^2/s')]
    """
    return _of_estimates(fit.continuous())


def datasheet(fit: Fit) -> Table:
    """Tabulate what datasheets state: N, K, Q, R and the like in their units.

    Raises
    ------
    ValueError
        The rate is not known.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> [(row[1], row[5]) for row in tables.datasheet(gj.fit(wv, "WN + RW")).rows]
    [('N', 'ug/sqrt(Hz)'), ('K', 'm/s/h/sqrt(h)')]
    """
    return _of_estimates(fit.datasheet())


def formulas(model: Composite, rate: float, signal: str) -> Table:
    """Tabulate the quantities of a filter of a model, each with its formula and the numbers put in.

    Parameters
    ----------
    model
        All values given; processes that no formula of `gmwm_jax.app.web.formula` is of are named below.
    rate
        Sampling rate in Hz.
    signal
        SI unit of the signal.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> tables.formulas(gj.parse_model("WN(sigma2=1e-6) + BI(B=1e-9)"), 100.0, "rad/s").rows[0][:2]
    ('WN', 'q')
    """
    rows: list[tuple[Cell, ...]] = []
    others = []
    for label, p in zip(model.labels, model.processes, strict=True):
        if p.kind not in kinds():
            others.append(label)
            continue
        steps = to_filter(p.kind, [float(v) for v in p.values], rate, signal)
        rows += [(label, step.symbol, float(step.value), step.unit, step.text) for step in steps]
    text = f"Per sample to continuous time at f = {rate:g} Hz"
    text += f"\nwithout a formula here: {', '.join(others)}" if others else ""
    return Table(("component", "quantity", "value", "unit", "how"), ("",) * 5, tuple(rows), text)


def verdicts(found: Sequence[Verdict]) -> Table:
    """Tabulate a datasheet against a fit, see `gmwm_jax.app.web.datasheet.verdicts`.

    Examples
    --------
    >>> from gmwm_jax.app.web import datasheet, tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 4000, channels=["gyro_x"]))
    >>> verdicts = datasheet.verdicts(gj.fit(wv, "WN + RW"), "N=0.05 deg/s/sqrt(Hz)")
    >>> tables.verdicts(verdicts).rows[0][:2]
    ('N', 0.05)
    """
    rows = tuple((*map(_plain, verdict),) for verdict in found)
    columns = ("entry", "stated", "measured", "low", "high", "unit", "measured / stated", "verdict")
    text = (
        "The datasheet against the fit; N, B and K are compared" if rows else "N, B and K are compared: none is given"
    )
    return Table(columns, ("",) * len(columns), rows, text)


def _plain(value: Cell) -> Cell:
    return value if isinstance(value, str) else float(value)


def bootstrap(bootstrap: Bootstrap) -> Table:
    """Tabulate the parameters per sample with intervals of the replicates; without them where these are too few.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> boot = gj.bootstrap(gj.fit(wv, "WN + RW"), 20, key=jax.random.key(0))
    >>> len(tables.bootstrap(boot).rows)
    0
    """
    done = f"{len(bootstrap.good)} of {bootstrap.num_requested} replicates by {bootstrap.route}"
    test = f"objectives as large as that of the data or larger: p = {bootstrap.p_value:.3g}"
    needed = replicates_needed(bootstrap.fit.level)
    if len(bootstrap.good) < needed:
        table = _of_estimates(bootstrap.fit.parameters())._replace(rows=())
        return table._replace(text=f"{done}: intervals need {needed}\n{test}")
    table = _of_estimates(bootstrap.parameters())
    return table._replace(text=f"{table.text}\n{done}; {test}")


def selection(selection: Selection) -> Table:
    """Tabulate the candidates that are models of their own, the lowest criterion first.

    Examples
    --------
    >>> from gmwm_jax.app.web import tables
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> table = tables.selection(gj.select(rec, "WN + RW"))
    >>> table.columns[0], table.columns[-1]
    ('model', 'verdict')
    """
    equivalent = {c.name for c in selection.equivalent}
    rows = []
    for c in (c for c in selection.candidates if c.sound):
        verdict = "equivalent" if c.name in equivalent else f"worse than {c.worse_than}" if c.worse_than else ""
        verdict = "recommended" if c is selection.recommended else verdict
        numbers = (c.objective, c.optimism, c.criterion, c.difference, c.standard_error, c.p_value)
        rows.append((c.name, c.num_parameters, *map(float, numbers), verdict))
    columns = ("model", "parameters", "objective", "optimism", "WVIC", "difference", "its SE", "p of fit", "verdict")
    within = " + ".join(selection.superset.model.labels)
    text = f"{len(selection)} models within {within}, {selection.superset.weights.name} weights"
    left_out = len(selection) - len(rows)
    if left_out:
        text += f"\n{left_out} more are smaller models (a component came out as zero), or did not converge"
    return Table(columns, ("",) * len(columns), tuple(rows), text)


def to_csv(table: Table) -> str:
    r"""Write a table as a file of comma-separated values (RFC 4180): a row of names, one of units, then the rows.

    Numbers are written such that they are read back the same; a text that a spreadsheet would take for a formula gets a
    leading apostrophe. What is not known is empty.

    Examples
    --------
    >>> from gmwm_jax.app.web.tables import Table, to_csv
    >>> to_csv(Table(("channel", "value"), ("", "rad/s"), (("=cmd()", -1.5), ("x", float("nan"))), ""))
    "channel,value\r\n,rad/s\r\n'=cmd(),-1.5\r\nx,\r\n"
    """
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\r\n")
    writer.writerows([[_cell(c) for c in row] for row in (table.columns, table.units, *table.rows)])
    return file.getvalue()


def _cell(value: Cell) -> str:
    if isinstance(value, str):
        return f"'{value}" if value.lstrip(" \n").startswith(_FORMULAS) else value
    if isinstance(value, float):
        return repr(float(value)) if math.isfinite(value) else ""
    return str(value)


def _of_estimates(table: EstimateTable) -> Table:
    """Estimates as rows, each with its unit."""
    columns = ("component", "quantity", "estimate", f"{100 * table.level:g} % low", "high", "unit", "note")
    rows: Sequence[tuple[Cell, ...]] = [
        (e.component, e.symbol, float(e.value), float(e.ci_low), float(e.ci_high), e.unit, str(e.note)) for e in table
    ]
    return Table(columns, ("",) * len(columns), tuple(rows), "\n".join([table.title, *table.remarks]))
