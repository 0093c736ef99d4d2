"""Tables of a model's parameters: per sample, in continuous time, in datasheet units, with intervals if known."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax import units as units_
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.standard_errors import evaluate
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.continuous_form import Quantity
from gmwm_jax.processes.parameter import Limit
from gmwm_jax.processes.registry import as_model

_WIDEST = 30.0
"""Half width, on the log scale, of the widest interval that is worth printing: a factor of 1e13 either way."""


@dataclass(frozen=True)
class Estimate:
    """One number with its interval, which is NaN where there is none."""

    component: str
    symbol: str
    value: float
    unit: str
    ci_low: float = np.nan
    ci_high: float = np.nan
    note: Outcome | str = Outcome.ESTIMATED
    """What became of it, or a remark on how it was read."""
    meaning: str = ""

    @property
    def at_boundary(self) -> bool:
        """Is it zero or at a limit of its component?"""
        return isinstance(self.note, Outcome) and self.note.at_boundary


@dataclass(frozen=True, repr=False)
class EstimateTable:
    """A table of estimates that prints itself; ``table["GM_1", "q"]`` is one of them."""

    title: str
    estimates: tuple[Estimate, ...]
    level: float = 0.95
    remarks: tuple[str, ...] = ()
    """Sentences that stand below the table."""

    def __getitem__(self, key: tuple[str, str]) -> Estimate:
        for e in self.estimates:
            if (e.component, e.symbol) == key:
                return e
        known = ", ".join(f"({e.component!r}, {e.symbol!r})" for e in self.estimates)
        raise KeyError(f"No estimate {key}; there are {known}.")

    def __iter__(self) -> Iterator[Estimate]:
        return iter(self.estimates)

    def __len__(self) -> int:
        return len(self.estimates)

    def __repr__(self) -> str:
        """An aligned table, without the columns that are empty."""
        head = ["component", "quantity", "estimate", f"{100 * self.level:g} % low", "high", "unit", "note"]
        rows = [
            [e.component, e.symbol, number(e.value), number(e.ci_low), number(e.ci_high), e.unit, e.note]
            for e in self.estimates
        ]
        intervals = any(np.isfinite(e.ci_low) for e in self.estimates)
        notes = any(e.note for e in self.estimates)
        kept = [i for i in range(7) if (intervals or i not in (3, 4)) and (notes or i != 6)]
        table = format_table([head[i] for i in kept], [[r[i] for i in kept] for r in rows], left=2)
        return "\n".join([self.title, *([table] if rows else []), *self.remarks])

    def to_list(self) -> list[dict[str, Any]]:
        """Plain dictionaries for JSON; None where there is no number."""
        return [
            {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in vars(e).items()} for e in self
        ]


def parameter_table(
    model: Composite,
    unit: str,
    *,
    z: float,
    level: float,
    errors: Float[np.ndarray, " P"],
    boundary: Mapping[str, Outcome],
    ends: tuple[np.ndarray, np.ndarray] | None = None,
) -> EstimateTable:
    """Parameters per sample, with intervals symmetric on the log (for phi: logit) scale.

    Parameters
    ----------
    model, unit
        All parameters given; SI unit of the signal.
    z, level
        Normal quantile and confidence of the intervals.
    errors
        Standard errors on the real line, NaN for what was not estimated.
    boundary
        Label -> what became of it, for components at a boundary: what data do not determine there is NaN.
    ends
        Both ends of the intervals on the real line, where these are not symmetric: see `gmwm_jax.fitting.boundary`.
    """
    spread = z * errors
    # next to zero a logarithm has any error, and the interval that begins at zero knows it
    widest = _WIDEST if ends is None else np.inf
    estimates, at = [], 0
    for label, p in zip(model.labels, model.processes, strict=True):
        for i, (q, value) in enumerate(zip(p.parameters, p.values, strict=True)):
            note = _outcome(boundary.get(label, Outcome.ESTIMATED), p, (i,), q.determined_at)
            low = high = np.nan
            if _is_confused(spread, at, note, widest):
                note = Outcome.NOT_TOLD_APART
            elif ends is not None:
                low, high = (float(q.from_line(end[at])) for end in ends)
            elif spread[at] > 0 and note is not Outcome.NOT_IDENTIFIED:
                x = q.to_line(value)
                low, high = float(q.from_line(x - spread[at])), float(q.from_line(x + spread[at]))
            shown = np.nan if note is Outcome.NOT_IDENTIFIED else float(value)
            estimates.append(Estimate(label, q.name, shown, q.unit.format(u=unit), low, high, note, q.meaning))
            at += 1
    return EstimateTable("Parameters per sample", tuple(estimates), level)


def continuous_table(
    model: str | AbstractProcess | Composite,
    rate: float,
    unit: str,
    *,
    datasheet: bool = False,
    z: float = np.nan,
    level: float = 0.95,
    errors: Callable[["LogQuantities"], tuple[np.ndarray, np.ndarray]] | None = None,
    boundary: Mapping[str, Outcome] | None = None,
    ends: tuple[np.ndarray, np.ndarray] | None = None,
) -> EstimateTable:
    """Tabulate the continuous-time quantities of a model, in SI or in the units of datasheets.

    Parameters
    ----------
    model
        All parameters given.
    rate
        Sampling rate in Hz.
    unit
        SI unit of the signal: ``rad/s``, ``m/s^2`` or ``1``.
    datasheet
        False: q, beta, 1/beta as a Kalman filter wants them, SI. True: N, K, Q, LSB, R, sigma in deg/sqrt(h) etc.
    z, level, boundary
        As of `parameter_table`.
    errors
        The logs of quantities and their standard errors; without it there are no intervals.
    ends
        Both ends of the intervals of the logs, where these are not symmetric: see `gmwm_jax.fitting.boundary`.

    Returns
    -------
    EstimateTable

    Raises
    ------
    ValueError
        A parameter without a value, a unit that is not SI, a rate that is not positive.

    Examples
    --------
    >>> table = gj.fitting.continuous_table("WN(sigma2=1e-4)", 100.0, "rad/s")
    >>> f'{table["WN", "q"].value:.3g} {table["WN", "q"].unit}'
    '1e-06 (rad/s)^2/Hz'
    """
    model = as_model(model)
    for p in model.processes:
        p.require_complete()
    units_.require_si(unit)
    f = sampling_rate(rate)
    logs = LogQuantities.of(model, f)
    if errors is None:
        values, sd = np.asarray(evaluate(logs, model)), np.nan
    else:
        values, sd = errors(logs)
    values, spread = np.exp(values), np.broadcast_to(z * sd, values.shape)
    widest = _WIDEST if ends is None else np.inf
    estimates, remarks, at = [], [], -1
    for label, p in zip(model.labels, model.processes, strict=True):
        form = p.continuous
        if form is None:
            remarks.append(f"{label} has no continuous-time form: its class does not define `continuous`.")
            continue
        for i, q in enumerate((*form.filter, *form.datasheet)):
            at += 1
            of_datasheet = i >= len(form.filter)
            if of_datasheet != datasheet and not q.in_both:
                continue
            note = _outcome((boundary or {}).get(label, Outcome.ESTIMATED), p, q.reads, q.determined_at)
            if _is_confused(spread, at, note, widest):
                note = Outcome.NOT_TOLD_APART
            value, factor = float(values[at]), np.exp(spread[at]) if 0 < spread[at] < _WIDEST else np.nan
            low, high = value / factor, value * factor
            if ends is not None and note is not Outcome.NOT_TOLD_APART:
                with np.errstate(over="ignore"):
                    low, high = (float(np.exp(end[at])) for end in ends)
            if np.isnan(value):
                note, low, high = form.undefined, np.nan, np.nan
            if note is Outcome.NOT_IDENTIFIED:
                value = np.nan
                low, high = (low, high) if ends is not None else (np.nan, np.nan)
            si = q.si_unit(unit)
            shown = q.datasheet_units(unit)[0] if datasheet else si
            size = 1.0 if shown == si else units_.unit(shown).factor
            value, low, high = (x / size for x in (value, low, high))
            estimates.append(Estimate(label, q.symbol, value, shown, low, high, note, q.meaning))
    title = "Datasheet units" if datasheet else "Continuous time, SI"
    return EstimateTable(f"{title} (at {f:g} Hz)", tuple(estimates), level, tuple(remarks))


@dataclass(frozen=True)
class LogQuantities:
    """The logs of continuous-time quantities of all components, as a hashable function of the model."""

    quantities: tuple[tuple[Quantity, ...], ...]
    rate: float

    @classmethod
    def of(cls, model: Composite, rate: float) -> "LogQuantities":
        """Those of a model, for both tables at once: what was compiled for one serves the other.

        There are none of a process without a continuous-time form.
        """
        forms = [p.continuous for p in model.processes]
        return cls(tuple(() if form is None else (*form.filter, *form.datasheet) for form in forms), rate)

    def __call__(self, model: Composite) -> Array:
        """Logs of all quantities, component by component."""
        pairs = zip(model.processes, self.quantities, strict=True)
        return jnp.log(jnp.array([q.value(*p.values, self.rate) for p, qs in pairs for q in qs]))


def _is_confused(spread: Float[np.ndarray, " P"], at: int, note: Outcome, widest: float) -> bool:
    """Was it estimated, and has it no error while others have one?"""
    return note is Outcome.ESTIMATED and bool(np.any(spread > 0)) and not bool(spread[at] < widest)


def _outcome(boundary: Outcome, process: AbstractProcess, reads: tuple[int, ...], determined_at: Limit) -> Outcome:
    """What became of a quantity that depends on the parameters at the positions `reads`."""
    if all(process.parameters[i].name in process.fixed for i in reads):
        return Outcome.FIXED
    if boundary is Outcome.ZERO:
        return Outcome.ZERO if len(process.parameters) - 1 in reads else Outcome.NOT_IDENTIFIED
    # Towards a limit the parameters run off together, and data know only what survives there. Of an end nobody knows.
    known = boundary in (Outcome.ESTIMATED, Outcome.at(determined_at), Outcome.END_OF_RANGE)
    return boundary if known else Outcome.NOT_IDENTIFIED
