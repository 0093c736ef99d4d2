"""N, B and K from slopes of the Allan deviation, as they are read off by hand or by regression over chosen ranges.

Baselines beside the estimator: IEEE Std 952-1997, annex C, and the Allan variance with linear regression (AVLR).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax import units as units_
from gmwm_jax._internal.checks import sampling_rate
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax.fitting.bias import coefficient
from gmwm_jax.fitting.tables import Estimate, EstimateTable
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.continuous_form import AllanLine, Quantity
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.allan import FLICKER_FLOOR, AllanDeviation
from gmwm_jax.variance.wavelet import WaveletVariance


def read_off(adev: AllanDeviation, *, tolerance: float = 0.15, datasheet: bool = False) -> EstimateTable:
    """Read N, B and K of one channel off its Allan deviation, as IEEE 952 does.

    N is read where the local slope comes closest to -1/2, as the value of that line at 1 s; K where it comes closest
    to +1/2, at 3 s; B is the minimum divided by 0.664.

    Parameters
    ----------
    adev
        One channel.
    tolerance
        How far from -1/2 or +1/2 a slope may be; beyond it the coefficient is not there to be read.
    datasheet
        In deg/sqrt(h), ug/sqrt(Hz) and the like; else in SI.

    Returns
    -------
    EstimateTable
        N [u/sqrt(Hz)], B [u], K [u/sqrt(s)]. Intervals are those of the deviation at the point that was read;
        they know nothing of other processes in it. A coefficient that cannot be read is NaN, and the note says why.

    Examples
    --------
    >>> rec = gj.datasets.simulated("mti-g", 2000, channels=["accel_x"])
    >>> gj.fitting.read_off(gj.allan_deviation(rec))["Allan", "N"].unit
    'm/s^2/sqrt(Hz)'
    """
    _require_single(adev)
    T, d = adev.times, adev.deviation
    if len(T) < 3:
        raise ValueError(f"Slopes need at least 3 averaging times, and there are {len(T)}.")
    slopes = np.gradient(np.log(d), np.log(T))
    estimates = []
    for cls in (WN, RW):
        (slope, factor), coefficient = _line(cls)
        symbol, unit = coefficient.symbol, coefficient.si_unit(adev.wv.units[0])
        at = int(np.argmin(np.abs(slopes - slope)))
        if abs(slopes[at] - slope) > tolerance:
            note = f"no slope of {slope:+g} (nearest {slopes[at]:+.2f})"
            estimates.append(Estimate("Allan", symbol, np.nan, unit, note=note))
            continue
        scale = 1 / (factor * T[at] ** slope)
        values = (float(v[at] * scale) for v in (d, adev.ci_low, adev.ci_high))
        estimates.append(Estimate("Allan", symbol, next(values), unit, *values, note=f"slope at T = {T[at]:.4g} s"))
    at = int(np.argmin(d))
    values = (float(v[at] / FLICKER_FLOOR) for v in (d, adev.ci_low, adev.ci_high))
    note = f"minimum at T = {T[at]:.4g} s"
    if at in (0, len(T) - 1):
        note = f"an upper bound: the minimum is at the {'first' if at == 0 else 'last'} time"
    estimates.insert(1, Estimate("Allan", "B", next(values), adev.wv.units[0], *values, note=note))
    if datasheet:
        estimates = [_in_datasheet_units(e, adev.wv.units[0]) for e in estimates]
    return EstimateTable("Read off the Allan deviation (IEEE 952)", tuple(estimates), adev.wv.level)


@dataclass(frozen=True, repr=False)
class SlopeRegression:
    """The result of `slope_regression`: a coefficient for each process, and the model that they make."""

    table: EstimateTable
    model: Composite
    adev: AllanDeviation

    @property
    def implied_deviation(self) -> Float[np.ndarray, " J"]:
        """Allan deviation of the model: the root of the sum of the squares of its components."""
        return np.sqrt(2 * np.asarray(self.model.wavelet_variance(self.adev.wv.scales)))

    def __repr__(self) -> str:
        return repr(self.table)


def slope_regression(adev: AllanDeviation, ranges: Mapping[str, tuple[float, float]]) -> SlopeRegression:
    """Estimate coefficients by the mean of the log deviation along given slopes over given ranges (AVLR).

    Parameters
    ----------
    adev
        One channel.
    ranges
        Process -> (shortest, longest) averaging time in seconds over which it is taken to stand alone, for example
        ``{"WN": (0.01, 1.0), "RW": (100.0, 1000.0)}``; QN, WN, RW, DR.

    Returns
    -------
    SlopeRegression
        Q, N, K, R in SI. The intervals take the correlation between scales from the theory of the wavelet variance
        under the implied model; without the record's length and all octaves there are none.

    Raises
    ------
    ValueError
        A process that is no straight line, or a range without an averaging time.

    Notes
    -----
    El-Sheimy, Hou & Niu (2008). Not consistent as soon as two processes overlap (Guerrier et al. 2016).

    Examples
    --------
    >>> adev = gj.allan_deviation(gj.datasets.simulated("mti-g", 2000, channels=["accel_x"]))
    >>> slopes = gj.fitting.slope_regression(adev, {"WN": (0.02, 1.0)})  # the range in seconds
    >>> slopes.table["WN", "N"].unit
    'm/s^2/sqrt(Hz)'
    """
    _require_single(adev)
    f, unit = _rate(adev), adev.wv.units[0]
    lines = {k: cls for k, cls in PROCESSES.items() if cls.continuous is not None and cls.continuous.allan_line}
    chosen, coefficients = {}, {}
    for kind, (shortest, longest) in ranges.items():
        if kind not in lines:
            raise ValueError(f"{kind!r} is no straight line in the log Allan deviation; {', '.join(lines)} are.")
        inside = (adev.times >= shortest) & (adev.times <= longest)
        if not np.any(inside):
            raise ValueError(
                f"{kind}: no averaging time between {shortest:g} and {longest:g} s; "
                f"there are {', '.join(f'{t:g}' for t in adev.times)}."
            )
        slope, factor = _line(lines[kind])[0]
        chosen[kind] = inside
        coefficients[kind] = float(
            np.exp(np.mean(np.log(adev.deviation[inside]) - slope * np.log(adev.times[inside]))) / factor
        )
    model = Composite([_of_coefficient(lines[kind], value, f) for kind, value in coefficients.items()])

    nu = np.asarray(model.wavelet_variance(adev.wv.scales))
    V = adev.wv.covariance_under(model)
    # log deviation = log(nu)/2 + const
    correlated = None if V is None else V / np.outer(nu, nu) / 4
    z, estimates = normal_quantile(adev.wv.level), []
    for kind, value in coefficients.items():
        w = chosen[kind] / np.sum(chosen[kind])
        spread = np.nan if correlated is None else z * math.sqrt(w @ correlated @ w)
        ends = value * np.exp([-spread, spread])
        quantity = _line(lines[kind])[1]
        estimates.append(Estimate(kind, quantity.symbol, value, quantity.si_unit(unit), float(ends[0]), float(ends[1])))
    table = EstimateTable("Allan variance linear regression", tuple(estimates), adev.wv.level)
    return SlopeRegression(table, model, adev)


def _in_datasheet_units(e: Estimate, signal: str) -> Estimate:
    quantity = next(q for q in map(coefficient, (WN, BI, RW)) if q.symbol == e.symbol)
    shown = quantity.datasheet_units(signal)[0]
    if shown == e.unit:
        return e
    size = units_.unit(shown).factor
    return replace(e, value=e.value / size, ci_low=e.ci_low / size, ci_high=e.ci_high / size, unit=shown)


def _line(cls: type[AbstractProcess]) -> tuple[AllanLine, Quantity]:
    """The line of a process, and its coefficient."""
    form = cls.continuous
    assert form is not None
    assert form.allan_line is not None
    return form.allan_line, coefficient(cls)


def _of_coefficient(cls: type[AbstractProcess], coefficient: float, f: float) -> AbstractProcess:
    """The process whose line has a coefficient, to whose square the amplitude is proportional."""
    build: Any = cls
    of_unit = float(_line(cls)[1].value(1.0, f))
    return build(cls.value_of((coefficient / of_unit) ** 2))


def _rate(adev: AllanDeviation) -> float:
    return sampling_rate(adev.wv.rate)


def _require_single(adev: AllanDeviation) -> None:
    if not isinstance(adev.wv, WaveletVariance):
        raise ValueError(f"Choose one channel, as in adev[{adev.wv.channels[0]!r}]: there are {adev.wv.channels}.")
