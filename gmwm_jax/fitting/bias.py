"""A model as two numbers, the white noise and the bias of a filter that has no other states, and the lowest deviation.

White at the step of a filter. The sum of n samples at the rate f, divided by f, is an angle or a velocity over the time
t = n/f. A component with the autocovariance R(h) gives it the variance (n/f^2) sum_{|h|<n} (1 - |h|/n) R(h), which for
n far beyond its correlation time is (t/f) sum_h R(h) = S(0) t: that of white noise with the density N_0^2 = S(0), the
PSD at frequency 0. Where the correlation time is at most a step of the filter, the filter never sees anything else.
Densities of independent components add up: N^2 = sum of N_0^2 over the components that are white at the step. White
noise that a fit has put to zero beside a Gauss-Markov process of half a sample is there again.

Bias. What is left, less what has no growing integral (quantisation), is the bias. A filter that knows one random walk
gets the one with the same Allan variance at one time T,

    K^2 = f nu_bias^2(2 T f)/u(2 T f),      u(tau) = (tau^2 + 2)/(12 tau),

u the wavelet variance of a random walk with steps of variance 1. The Allan variance at T is the mean squared change
between the biases of neighbouring intervals T, half of it: what the filter has to follow. Of a random walk K is its
own at every T; of a Gauss-Markov process it is sqrt(q), q = 2 beta f variance, for T far below the correlation time,
and less beyond. T is by default where the Allan deviation of the bias comes to that of the white noise: below it the
white noise hides the bias, and over that time a filter with these two numbers averages: what it then claims of an angle
it has integrated alone over times up to T is about what the angle does; over longer ones it claims too much error.

Bias instability. B is the lowest Allan deviation of the whole model over 0.664, as IEEE 952 and datasheets have it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax import units as units_
from gmwm_jax._internal.checks import number, sampling_rate
from gmwm_jax._internal.host import known
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting.boundary import root_sum_of_squares
from gmwm_jax.fitting.standard_errors import component_variances, evaluate
from gmwm_jax.fitting.tables import Estimate, EstimateTable, LogQuantities
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.continuous_form import Quantity
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.registry import as_model
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.allan import FLICKER_FLOOR

_DENSITY = "/sqrt(Hz)"
"""By which the quantity of a process is known that is its density as white noise."""
_SCALES = 2.0 ** np.arange(1, 21)
"""Of a model that no record stands behind, in samples."""


@dataclass(frozen=True, repr=False)
class WhiteAndBias:
    """A model of one channel as white noise and a bias; it prints itself as a table in datasheet units.

    Attributes
    ----------
    unit, rate
        SI unit of the signal, Hz.
    step
        Of the filter, s.
    N
        Density of all that is white at the step, u/sqrt(Hz): the angle or velocity random walk.
    white
        Labels of the components in it.
    error
        Standard error of log N, NaN if unknown.
    K
        Coefficient of the random walk that stands for the bias, u/sqrt(s).
    bias
        Labels of the components that it stands for.
    interval
        Averaging time at which both have the same Allan deviation, s.
    chosen
        How this time was found.
    B
        Lowest Allan deviation of the whole model over 0.664, u.
    lowest
        The averaging time of the lowest, s.
    upper_bound
        The lowest is at an end of the times, and B may be less.
    without
        Labels of the components that are in neither: their integral is bounded.
    times
        Averaging times, s, shape (J,).
    bias_deviation
        Allan deviation of the bias at these, shape (J,).
    level
        Confidence of the interval.
    ends
        Both ends of the interval of N, where a component in it is at a boundary or near one; None: by `error`.
    """

    unit: str
    rate: float
    step: float
    N: float
    white: tuple[str, ...]
    error: float
    K: float
    bias: tuple[str, ...]
    interval: float
    chosen: str
    B: float
    lowest: float
    upper_bound: bool
    without: tuple[str, ...]
    times: Float[np.ndarray, " J"]
    bias_deviation: Float[np.ndarray, " J"]
    level: float
    ends: tuple[float, float] | None = None

    def table(self, *, datasheet: bool = True) -> EstimateTable:
        """Return N, K and B as a table.

        Parameters
        ----------
        datasheet
            In deg/sqrt(h) and the like; else in SI.
        """
        spread = normal_quantile(self.level) * self.error
        low, high = (self.N * math.exp(sign * spread) for sign in (-1, 1)) if self.white else (math.nan, math.nan)
        if self.ends is not None:
            low, high = self.ends
        white = " + ".join(self.white) or "nothing is white at the step"
        walk = f"{' + '.join(self.bias)} at T = {self.interval:.4g} s" if self.bias else "nothing else is there"
        where = "an upper bound: lowest at the end," if self.upper_bound else "lowest at"
        rows = (
            (WN, "white", self.N, low, high, white, "density of all that is white at the step"),
            (RW, "bias", self.K, math.nan, math.nan, walk, "random walk of the same Allan deviation"),
            (BI, "all", self.B, math.nan, math.nan, f"{where} T = {self.lowest:.4g} s", "lowest Allan deviation/0.664"),
        )
        estimates = []
        for cls, component, value, lower, upper, note, meaning in rows:
            quantity = coefficient(cls)
            si = quantity.si_unit(self.unit)
            shown = quantity.datasheet_units(self.unit)[0] if datasheet else si
            size = 1.0 if shown == si else units_.unit(shown).factor
            values = (x / size for x in (value, lower, upper))
            estimates.append(
                Estimate(component, quantity.symbol, next(values), shown, *values, note=note, meaning=meaning)
            )
        remarks = [f"{label} is in neither: its integral does not grow." for label in self.without]
        title = f"White noise and bias of a filter with a step of {self.step:g} s"
        return EstimateTable(title, tuple(estimates), self.level, tuple(remarks))

    def to_dict(self) -> dict[str, Any]:
        """Return both tables for JSON, in SI and in datasheet units."""
        return {"continuous": self.table(datasheet=False).to_list(), "datasheet": self.table().to_list()}

    def __repr__(self) -> str:
        return repr(self.table())


def white_and_bias(
    model: str | AbstractProcess | Composite,
    rate: float,
    unit: str,
    *,
    step: float | None = None,
    interval: float | None = None,
    scales: Float[np.ndarray, " J"] | None = None,
    logs: tuple[np.ndarray, np.ndarray] | None = None,
    components: Float[np.ndarray, "C J"] | None = None,
    level: float = 0.95,
    ends: Callable[[list[int]], tuple[float, float]] | None = None,
) -> WhiteAndBias:
    """Reduce a model to the two numbers of a filter with white noise and a bias, and the lowest Allan deviation.

    Parameters
    ----------
    model
        All parameters given.
    rate
        Sampling rate in Hz.
    unit
        SI unit of the signal: ``rad/s``, ``m/s^2`` or ``1``.
    step
        Of the filter, s; by default the sampling interval. Components with a correlation time of at most a step are
        white to it.
    interval
        Averaging time in seconds, the nearest of the scales is taken, at which the random walk has the Allan deviation
        of all that is not white; by default where that comes to the deviation of the white noise, and if it does
        nowhere the end of the times at which it is nearer.
    scales
        Spans in samples, by default 2 .. 2^20.
    logs
        The logs of the quantities of `LogQuantities` and their covariance, if they are known; without it N has no
        interval.
    components
        Wavelet variance of each component at `scales`, if it is known.
    level
        Confidence of the interval.
    ends
        From the positions of quantities in `logs` to the interval of the root of their sum of squares, where it is not
        symmetric on the log scale: see `gmwm_jax.fitting.boundary`.

    Returns
    -------
    WhiteAndBias

    Raises
    ------
    ValueError
        A parameter without a value, a unit that is not SI, a rate that is not positive, a step below the sampling
        interval.

    Examples
    --------
    >>> model = "WN(sigma2=1e-6) + GM(beta=2, variance=5e-5) + RW(gamma2=1e-12)"  # a GM of half a sample
    >>> short = gj.fitting.white_and_bias(model, 100.0, "rad/s")
    >>> short.white, f'{short.table()["white", "N"].value:.3f} {short.table()["white", "N"].unit}'
    (('WN', 'GM'), '2.807 deg/sqrt(h)')
    >>> short.bias, f"{short.K:.3g}"
    (('RW',), '1e-05')
    """
    model = as_model(model)
    for p in model.processes:
        p.require_complete()
    units_.require_si(unit)
    f = sampling_rate(rate)
    step = 1 / f if step is None else number("step=...", step)
    if step * f < 1 - 1e-6:
        raise ValueError(f"step=... is {step:g} s, and the samples of the model are {1 / f:g} s apart: take no less.")
    tau = _SCALES if scales is None else np.asarray(scales, dtype=np.float64)
    if logs is None:
        values = np.asarray(evaluate(LogQuantities.of(model, f), model))
        logs = values, np.full((len(values), len(values)), np.nan)
    white_at = _densities_white_at(step * f, model)
    # a component without variance is neither; but it may have some
    at = {i: j for i, j in white_at.items() if logs[0][j] > -np.inf}
    may_be = [j for i, j in white_at.items() if i in at or not model.processes[i].shape]
    N, error = root_sum_of_squares(*logs, list(at.values()))
    parts = np.asarray(component_variances(model, tau) if components is None else components)
    slow = [i for i, p in enumerate(model.processes) if p.in_filter and i not in at and np.any(parts[i] > 0)]
    nu, times = parts[slow].sum(axis=0), tau / (2 * f)
    if interval is None:
        k, chosen = _meeting(nu, N * N * f / tau, times >= step * (1 - 1e-6))
    else:
        k = int(np.argmin(np.abs(np.log(times / number("interval=...", interval)))))
        chosen = "the time of the scales that is nearest to the one asked for"
    K = math.sqrt(f * nu[k] / ((tau[k] ** 2 + 2) / (12 * tau[k])))
    deviation = np.sqrt(2 * parts.sum(axis=0))
    j = int(np.argmin(deviation))
    labels = model.labels
    return WhiteAndBias(
        unit=unit,
        rate=f,
        step=step,
        N=N,
        white=tuple(labels[i] for i in at),
        error=error,
        K=K,
        bias=tuple(labels[i] for i in slow),
        interval=float(times[k]),
        chosen=chosen,
        B=float(deviation[j] / FLICKER_FLOOR),
        lowest=float(times[j]),
        upper_bound=j in (0, len(tau) - 1),
        without=tuple(
            labels[i] for i, p in enumerate(model.processes) if not p.in_filter and i not in at and np.any(parts[i] > 0)
        ),
        times=times,
        bias_deviation=np.sqrt(2 * nu),
        level=level,
        ends=None if ends is None or not may_be else ends(may_be),
    )


def coefficient(cls: type[AbstractProcess]) -> Quantity:
    """The coefficient of a process in datasheets: N, B, K."""
    assert cls.continuous is not None
    return cls.continuous.datasheet[0]


def summary_rows(names: Sequence[str], filters: Sequence[WhiteAndBias]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of a table of several channels, a row each."""
    head = ["channel", "N", "unit", "white", "K", "unit", "bias", "T [s]", "B", "unit"]
    rows = []
    for name, one in zip(names, filters, strict=True):
        N, K, B = one.table()
        cells = [f"{e.value:.5g}" for e in (N, K, B)]
        white, bias = " + ".join(one.white) or "-", " + ".join(one.bias) or "-"
        bound = "<= " if one.upper_bound else ""
        at = f"{one.interval:.4g}" if one.bias else "-"
        rows.append([name, cells[0], N.unit, white, cells[1], K.unit, bias, at, bound + cells[2], B.unit])
    return head, rows


def _densities_white_at(step: float, model: Composite) -> dict[int, int]:
    """Number of a component that is white at a step (in samples) -> where `LogQuantities` has its density."""
    found, start = {}, 0
    for i, p in enumerate(model.processes):
        if p.continuous is None:
            continue
        quantities = (*p.continuous.filter, *p.continuous.datasheet)
        at = next((k for k, q in enumerate(quantities) if q.suffix == _DENSITY), None)
        time = float(p.correlation_time(known(*p.shape))) if p.shape else 0.0
        if at is not None and time <= step * (1 + 1e-6):
            found[i] = start + at
        start += len(quantities)
    return found


def _meeting(nu: np.ndarray, white: np.ndarray, possible: np.ndarray) -> tuple[int, str]:
    """Where the wavelet variance of the bias first comes to that of the white noise, or the nearer end; and how."""
    if not np.any(possible):
        return len(nu) - 1, "the longest of the scales, below the step"
    first = int(np.argmax(possible))
    above = np.flatnonzero(possible & (nu >= white))
    if not len(above):
        return len(nu) - 1, "the longest of the scales: the bias stays below the white noise"
    if above[0] == first:
        return first, "the shortest of the scales: the bias is above the white noise already there"
    return int(above[0]), "where the bias comes to the white noise"
