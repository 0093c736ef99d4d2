"""Intervals from bootstrap replicates (Davison & Hinkley 1997, ch. 5), for parameters and for what follows from them.

All on the real line of a parameter (log; logit for phi), x the estimate and x* its replicates: ``percentile`` takes
quantiles of x*; ``basic`` mirrors them at x, 2x - x*; ``studentised`` scales by standard errors, x - s (x* - x)/s*.

At a boundary the estimates are not normal and no bootstrap is right for all truths near it (Andrews 2000). Percentiles
still cover: where the estimate is zero, those of its replicates reach from zero to z standard deviations, which is as
far as the truth can be, and the replicates of the others move to the side on which they then are
(`gmwm_jax.fitting.boundary` has the same reach by theory). To mirror them would turn that to the wrong side, and
standard errors of replicates on both sides of the boundary have no common scale: there is neither ``basic`` nor
``studentised`` of a fit at a boundary. A coverage table in the validation has theory and percentiles beside each other.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.checks import confidence
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.standard_errors import delta_method, evaluate, parameter_covariance
from gmwm_jax.fitting.tables import Estimate, EstimateTable
from gmwm_jax.processes.base import Composite
from gmwm_jax.units import unit

KINDS = ("percentile", "basic", "studentised")
_IN_A_TAIL = 5
"""Replicates that must lie beyond each end of an interval, on average."""


def interval(
    fit: Fit, good: Float[np.ndarray, "G P"], kind: str, level: float
) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Both ends of the intervals of all parameters per sample.

    Parameters
    ----------
    fit
        What was replicated.
    good
        Estimates of the replicates, parameters per sample.
    kind
        ``percentile``, ``basic`` or ``studentised``.
    level
        Confidence.

    Returns
    -------
    low, high
        NaN where there is none: parameters that are held, or that too few replicates determine.

    Raises
    ------
    ValueError
        Another kind; too few replicates for the level; not percentiles, of a fit with a component at a boundary.
    """
    return as_parameters(fit.model, *_ends(fit, good, line, kind, level))


def continuous_intervals(
    fit: Fit, good: Float[np.ndarray, "G P"], kind: str, level: float, table: EstimateTable
) -> list[Estimate]:
    """The entries of a table of continuous-time quantities of a fit, with intervals from replicates."""
    return in_table(fit, table, *_ends(fit, good, fit.log_quantities, kind, level))


def as_parameters(
    model: Composite, low: Float[np.ndarray, " P"], high: Float[np.ndarray, " P"]
) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
    """Both ends of intervals on the real line as parameters per sample; NaN for those that are held."""
    parameters = [(q, q.name in p.fixed) for p in model.processes for q in p.parameters]

    def back(end: Float[np.ndarray, " P"]) -> Float[np.ndarray, " P"]:
        return np.array(
            [np.nan if held else float(q.from_line(e)) for (q, held), e in zip(parameters, end, strict=True)]
        )

    return back(low), back(high)


def in_table(
    fit: Fit, table: EstimateTable, low: Float[np.ndarray, " Q"], high: Float[np.ndarray, " Q"]
) -> list[Estimate]:
    """The entries of a table of continuous-time quantities, with intervals given for `Fit.log_quantities`."""
    quantities = zip(fit.model.labels, fit.log_quantities.quantities, strict=True)
    named = [(label, q) for label, qs in quantities for q in qs]
    at = {(label, q.symbol): i for i, (label, q) in enumerate(named)}
    entries = []
    for e in table:
        i = at[e.component, e.symbol]
        size = 1.0 if e.unit == named[i][1].si_unit(fit.unit) else unit(e.unit).factor
        ends = [np.exp(end[i]) / size if np.isfinite(e.value) else np.nan for end in (low, high)]
        entries.append(replace(e, ci_low=float(ends[0]), ci_high=float(ends[1])))
    return entries


def replicates_needed(level: float) -> int:
    """How many replicates an interval takes: `_IN_A_TAIL` beyond each end, on average."""
    return int(np.ceil(2 * _IN_A_TAIL / (1 - confidence(level)) - 1e-9))


def line(model: Composite) -> Array:
    """All parameters on the real line."""
    return model.parameter_lines()


def on_the_line(model: Composite, good: Float[np.ndarray, "G P"]) -> Float[np.ndarray, "G P"]:
    """Replicates on the real line: -inf for an amplitude of zero, NaN for the shape of a process without amplitude."""
    columns, at = [], 0
    with np.errstate(divide="ignore"):
        for p in model.processes:
            own = good[:, at : at + len(p.parameters)]
            *shape, amplitude = map(np.asarray, p.to_lines(tuple(jnp.asarray(own.T))))
            columns += [*(np.where(own[:, -1] > 0, line, np.nan) for line in shape), amplitude]
            at += len(p.parameters)
    return np.stack(columns, axis=1)


def _ends(
    fit: Fit, good: Float[np.ndarray, "G P"], quantity: Callable[[Composite], Array], kind: str, level: float
) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
    """Ends of the intervals of a quantity on the real line."""
    if kind not in KINDS:
        raise ValueError(f"kind is one of {', '.join(KINDS)}, and is {kind!r}.")
    tail, needed = (1 - level) / 2, replicates_needed(level)
    if len(good) < needed:
        raise ValueError(
            f"{len(good)} replicates are too few for {100 * level:g} % intervals, which take {needed}: "
            f"{_IN_A_TAIL} beyond each end."
        )
    if fit.at_boundary and kind != "percentile":
        seen = ", ".join(f"{label} {outcome}" for label, outcome in fit.at_boundary.items())
        raise ValueError(
            f"There are no {kind} intervals here ({seen}): mirrored or scaled, replicates of an estimate at its "
            'boundary lie on the wrong side of it. Take kind="percentile", which covers there.'
        )
    draws = on_the_line(fit.model, good)
    x = np.asarray(evaluate(quantity, fit.model))
    spread = np.asarray(replicated(quantity, fit.model, jnp.asarray(draws)))
    with np.errstate(invalid="ignore"):
        if kind == "studentised":
            s, own = _errors(fit, quantity, draws)
            spread = (spread - x) / own
            low, high = _quantiles(spread, tail, needed)
            return x - s * high, x - s * low
        low, high = _quantiles(spread, tail, needed)
        return (low, high) if kind == "percentile" else (2 * x - high, 2 * x - low)


def _quantiles(
    draws: Float[np.ndarray, "G Q"], tail: float, needed: int
) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
    """Both quantiles of each column without its NaN; NaN where too few are left."""
    ends = np.full((2, draws.shape[1]), np.nan)
    for i, column in enumerate(draws.T):
        known = column[~np.isnan(column)]
        if len(known) >= needed:
            # no interpolation: between -inf and a number there is none
            ends[:, i] = np.quantile(known, [tail, 1 - tail], method="inverted_cdf")
    return ends[0], ends[1]


@partial(jax.jit, static_argnums=0)
def replicated(quantity: Callable[[Composite], Array], model: Composite, draws: Float[Array, "G P"]) -> Array:
    """A quantity of each replicate."""
    return jax.vmap(lambda v: quantity(model.with_unconstrained(v)))(draws)


def _errors(
    fit: Fit, quantity: Callable[[Composite], Array], draws: Float[np.ndarray, "G P"]
) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, "G Q"]]:
    """Standard errors by theory: at the estimate, and at each replicate."""
    whitener, V = (jnp.asarray(a) for a in (fit.whitener, fit.wv_covariance))
    estimate = delta_method(quantity, fit.model, fit.active, jnp.asarray(fit.covariance))
    tau, fitted = jnp.asarray(fit.wv.scales), jnp.asarray(fit.fitted)
    own = _replicated_errors(quantity, fit.active, fit.model, whitener, V, tau, fitted, jnp.asarray(draws))
    return np.asarray(estimate), np.asarray(own)


@partial(jax.jit, static_argnums=(0, 1))
def _replicated_errors(
    quantity: Callable[[Composite], Array],
    active: tuple[int, ...],
    model: Composite,
    whitener: Float[Array, "J J"],
    V: Float[Array, "J J"],
    tau: Float[Array, " J"],
    fitted: Float[Array, " J"],
    draws: Float[Array, "G P"],
) -> Float[Array, "G Q"]:
    """Standard errors at each replicate.

    The covariance of a replicate's wavelet variance is that of the fit, scaled as the variances are: to first order the
    correlations do not change.
    """

    def of(v: Array) -> Array:
        replicate = model.with_unconstrained(v)
        ratio = replicate.wavelet_variance(tau) / fitted
        covariance = parameter_covariance(replicate, active, tau, whitener, V * ratio[:, None] * ratio[None, :])
        return delta_method(quantity, replicate, active, covariance)

    return jax.vmap(of)(draws)
