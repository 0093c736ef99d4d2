"""Factors of 0 to 1 under which a record is most likely, and the ends of their likelihood intervals.

With information J and gradient g of the loss at x, a step of scoring is the d that minimises g'd + d'Jd/2 with
0 <= x + d <= 1. Of a variance that is linear in its factors this is right far from the minimum too.
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
    information: Float64[np.ndarray, "P P"]
    converged: bool


def scoring_step(
    x: Float64[np.ndarray, " P"], gradient: Float64[np.ndarray, " P"], information: Float64[np.ndarray, "P P"]
) -> tuple[Float64[np.ndarray, " P"], float]:
    """The step, which does not leave 0 to 1, and what it gains."""
    values, vectors = np.linalg.eigh(information)
    size = np.sqrt(np.maximum(values, max(_NONE * values[-1], np.finfo(float).tiny)))
    root = size[:, None] * vectors.T
    step = lsq_linear(root, -(vectors.T @ gradient) / size, bounds=(-x, 1.0 - x), method="bvls").x
    step = np.clip(step, -x, 1.0 - x)
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
            return Minimum(best, found.loss, found.information, True)
        for _ in range(_MAX_STEPS):
            after = evaluate(best + step)
            if after.loss < found.loss:
                break
            step = step / 2
        else:
            break
        found, best = after, best + step
    return Minimum(best, found.loss, found.information, False)


def likelihood_end(evaluate: Evaluate, best: Minimum, i: int, rise: float, *, upper: bool) -> tuple[float, bool]:
    """Where the loss, with the other factors most likely, is so much higher.

    The root of the rise is nearly linear in the factor, so that secants find it, and halves of where it must be.

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
        The upper end, and not the lower one, which is above zero. One is the end where the loss does not rise so much.

    Returns
    -------
    The end, and whether it was found.
    """
    sign, edge = (1.0, 1.0) if upper else (-1.0, 0.0)
    at, inner, outer, root = best, float(best.factors[i]), edge, 0.0
    x, wanted = inner, inner + sign * np.sqrt(rise / max(best.information[i, i] / 2, rise))
    for _ in range(_MAX_STEPS):
        before = x, root
        x = min(max(wanted, 0.0), 1.0)
        at = minimise(evaluate, np.where(np.arange(len(best.factors)) == i, x, at.factors), i)
        above = max(at.loss - best.loss, 0.0)
        if abs(above - rise) < _END * rise or (x == edge and above < rise):
            return x, at.converged
        inner, outer = (x, outer) if above < rise else (inner, x)
        root = np.sqrt(above)
        slope = (root - before[1]) / (x - before[0])
        wanted = x + (np.sqrt(rise) - root) / slope if sign * slope > 0 else edge
        if wanted * sign >= outer * sign and outer == edge:
            wanted = edge
        elif not min(inner, outer) < wanted < max(inner, outer):
            wanted = (inner + outer) / 2
    return x, False
