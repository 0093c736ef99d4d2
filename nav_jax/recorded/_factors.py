"""Factors that are not negative under which a record is most likely, and the ends of their likelihood intervals.

With information J and gradient g of the loss at x, a step of scoring is the d that minimises g'd + d'Jd/2 with
x + d >= 0. Of a variance that is linear in its factors this is right far from the minimum too.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.optimize import lsq_linear

_MAX_STEPS = 30
_LOSS = 1e-3
"""Of a loss: what is left to gain at its minimum."""
_END = 0.01
"""Of the loss that an interval ends at, over the minimum: how well its end is found."""
_NONE = 1e-12
"""Of the largest eigenvalue of an information: what is none."""


class Found(NamedTuple):
    """The loss about a point."""

    loss: float
    gradient: Float64[np.ndarray, " P"]
    information: Float64[np.ndarray, "P P"]


Evaluate = Callable[[Float64[np.ndarray, " P"]], Found]
"""The loss about a point."""


class Minimum(NamedTuple):
    """Where a search has ended."""

    factors: Float64[np.ndarray, " P"]
    loss: float
    converged: bool


def scoring_step(
    x: Float64[np.ndarray, " P"], gradient: Float64[np.ndarray, " P"], information: Float64[np.ndarray, "P P"]
) -> tuple[Float64[np.ndarray, " P"], float]:
    """The step, which does not leave x >= 0, and what it gains."""
    values, vectors = np.linalg.eigh(information)
    size = np.sqrt(np.maximum(values, max(_NONE * values[-1], np.finfo(float).tiny)))
    root = size[:, None] * vectors.T
    step = lsq_linear(root, -(vectors.T @ gradient) / size, bounds=(-x, np.inf), method="bvls").x
    step = np.maximum(step, -x)
    return step, float(-(gradient @ step) - step @ information @ step / 2)


def minimise(evaluate: Evaluate, x: Float64[np.ndarray, " P"], held: int | None = None) -> Minimum:
    """The factors that are most likely, of which one may be held; a step that gains nothing is halved."""
    free = np.array([i != held for i in range(len(x))])
    found, best = evaluate(x), x
    step, gain = np.zeros(len(x)), np.inf
    for _ in range(_MAX_STEPS):
        step = np.zeros(len(x))
        step[free], gain = scoring_step(best[free], found.gradient[free], found.information[np.ix_(free, free)])
        if gain < _LOSS:
            return Minimum(best, found.loss, True)
        for _ in range(_MAX_STEPS):
            after = evaluate(best + step)
            if after.loss < found.loss:
                break
            step = step / 2
        else:
            break
        found, best = after, best + step
    return Minimum(best, found.loss, False)


def likelihood_end(evaluate: Evaluate, best: Minimum, i: int, rise: float, *, upper: bool) -> tuple[float, bool]:
    """Where the loss, with the other factors most likely, is so much higher (Venzon & Moolgavkar 1988).

    Each step takes the others to their minimum and the factor to its end, by the parabola that the loss is there.

    Parameters
    ----------
    evaluate
        The loss about a point.
    best
        Where it is least.
    i
        Of which factor.
    rise
        So much higher.
    upper
        The upper end, and not the lower one, which is above zero.

    Returns
    -------
    The end, and whether it was found.
    """
    x = best.factors
    below, above = (x[i], np.inf) if upper else (0.0, x[i])
    others = np.arange(len(x)) != i
    for _ in range(_MAX_STEPS):
        loss, g, J = evaluate(x)
        step, gain = scoring_step(x[others], g[others], J[np.ix_(others, others)])
        over = loss - gain - best.loss - rise
        if abs(over) < _END * rise and gain < _END * rise:
            return float(x[i]), True
        moving = others.copy()
        moving[others] = x[others] + step > 0
        follow = -np.linalg.lstsq(J[np.ix_(moving, moving)], J[moving, i], rcond=None)[0]
        slope = g[i] + J[i, others] @ step
        curvature = max(J[i, i] + J[i, moving] @ follow, np.finfo(float).tiny)
        if upper == (over < 0):
            below = max(below, x[i])
        else:
            above = min(above, x[i])
        way = np.sqrt(max(slope**2 - 2 * curvature * over, 0.0))
        wanted = x[i] + ((way if upper else -way) - slope) / curvature
        if not below < wanted < above:
            wanted = (below + above) / 2 if np.isfinite(above) else 2 * x[i] + _LOSS
        x = x.copy()
        x[others] += step
        x[moving] += follow * (wanted - x[i])
        x = np.maximum(x, 0.0)
        x[i] = wanted
    return float(x[i]), False
