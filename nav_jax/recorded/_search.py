"""The search of a tuning: the most likely parameters, and which of them the record determines.

A trust-region Newton method takes the expected information for the second derivative (scoring), in coordinates in which
it is the unit matrix where the search begins. What is observable depends on where one stands. So it is judged at the
start, and again at every solution: what the record no longer determines, such as a variance on its way to zero, is held
where it has got, what has become observable is sought too, and the search goes on until neither happens.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import minimize

from nav_jax.recorded._information import UNOBSERVABLE, observable_parameters, standard_errors, whitening
from nav_jax.recorded.likelihood import Model, Record, loss_and_slopes

_SLOPE = 1e-3
"""In standard errors of the parameters where a search begins: how far from the minimum it may end."""
_STEP = 1e-3
"""Of logarithms, for second derivatives: the error is of its square."""


class Found(NamedTuple):
    """`Slopes` on the host."""

    loss: float
    """Of the record and the penalty."""
    gradient: Float64[np.ndarray, " P"]
    """Of both."""
    information: Float64[np.ndarray, "P P"]
    """Of the record alone."""


class Objective:
    """Loss and penalty about a vector; the last is remembered, for which a solver asks three times.

    Where candidates are named, derivatives of the loss are theirs alone, and zero along all that is held.
    """

    def __init__(
        self,
        record: Record,
        model: Model,
        penalty: Float64[np.ndarray, "P P"],
        candidates: Sequence[int] | None = None,
    ):
        self.record, self.model, self.penalty = record, model, penalty
        self.along = None if candidates is None else jnp.eye(len(model.start))[:, np.array(candidates)]
        self.start = np.asarray(model.start)
        self.at: Any = None

    def __call__(self, vector: Float64[np.ndarray, " P"]) -> Found:
        """Loss, gradient and information there."""
        if self.at is None or not np.array_equal(self.at, vector):
            found = jax.tree.map(np.asarray, loss_and_slopes(self.record, self.model, jnp.asarray(vector), self.along))
            self.at = np.array(vector)
            self.last = Found(
                # a filter that breaks down is as unlikely as can be
                float(found.loss) + self.penalty_at(vector) if np.isfinite(found.loss) else np.inf,
                np.nan_to_num(found.gradient + self.penalty @ (vector - self.start)),
                np.nan_to_num(found.information),
            )
        return self.last

    def penalty_at(self, vector: Float64[np.ndarray, " P"]) -> float:
        """What the penalty adds to the loss."""
        off = vector - self.start
        return float(off @ self.penalty @ off) / 2

    def hessian(self, vector: Float64[np.ndarray, " P"], sought: Sequence[int]) -> Float64[np.ndarray, "P P"]:
        """Second derivatives of loss and penalty: central differences of the gradient, which is exact."""
        H = np.zeros((len(vector), len(vector)))
        for i in sought:
            h = np.zeros(len(vector))
            h[i] = _STEP
            H[:, i] = (self(vector + h).gradient - self(vector - h).gradient) / (2 * _STEP)
        return (H + H.T) / 2


class Solution(NamedTuple):
    """Where a search has ended."""

    vector: Float64[np.ndarray, " P"]
    sought: Bool[np.ndarray, " P"]
    """What the search has moved to its minimum; others are at their start, or lost."""
    lost: Bool[np.ndarray, " P"]
    """What it moved to where the record does not determine it, and held there."""
    observable: Bool[np.ndarray, " P"]
    """What the record determines without a penalty."""
    se: Float64[np.ndarray, " P"]
    loss: float
    """Of the record alone."""
    converged: bool


def search(objective: Objective, candidates: Sequence[int], max_steps: int, bar: Any) -> Solution:
    """Seek the most likely values of those candidates that the record determines; with a penalty, of all.

    Parameters
    ----------
    objective
        What is minimised.
    candidates
        Positions of parameters.
    max_steps
        Of one round.
    bar
        Told of every step.
    """
    everywhere = np.arange(len(objective.start))
    penalised = bool(objective.penalty.any())
    given_up: set[int] = set()
    vector, converged, interrupted = objective.start, True, False
    information = objective(vector).information
    sought = list(candidates) if penalised else observable_parameters(information, candidates)
    while True:
        if sought and not interrupted:
            vector, converged, interrupted = _minimise(objective, vector, sought, max_steps, bar)
        here = objective(vector)
        H = objective.hessian(vector, sought)
        kept = sought if penalised else observable_parameters(H, sought)
        given_up |= {*sought} - {*kept}
        wanted = kept
        if not penalised and converged and len(kept) == len(sought):
            wanted = observable_parameters(here.information, [i for i in candidates if i not in given_up], sought)
        if wanted == sought:
            break
        sought = wanted
    is_sought, lost = np.isin(everywhere, sought), np.isin(everywhere, sorted(given_up))
    shown = standard_errors(here.information, candidates) < UNOBSERVABLE if penalised else is_sought
    se = standard_errors(H, sought)
    return Solution(vector, is_sought, lost, shown, se, here.loss - objective.penalty_at(vector), converged)


def _minimise(
    objective: Objective, begin: Float64[np.ndarray, " P"], sought: Sequence[int], max_steps: int, bar: Any
) -> tuple[Float64[np.ndarray, " P"], bool, bool]:
    """The minimum over the sought parameters, or as far as one came; if it is one; if the keyboard interrupted it."""
    if not np.isfinite(objective(begin).loss):
        begin = objective.start
    basis = whitening(objective(begin).information + objective.penalty, sought)
    lowest, reached = objective(begin).loss, [np.zeros(len(sought))]

    def note(u: Any) -> None:
        reached.append(u)
        bar.update(1)

    try:
        found = minimize(
            lambda u: objective(begin + basis @ u).loss - lowest,
            reached[0],
            jac=lambda u: basis.T @ objective(begin + basis @ u).gradient,
            hess=lambda u: basis.T @ (objective(begin + basis @ u).information + objective.penalty) @ basis,
            method="trust-exact",
            callback=note,
            options={"maxiter": max_steps, "gtol": _SLOPE},
        )
    except KeyboardInterrupt:
        return begin + basis @ reached[-1], False, True
    return begin + basis @ found.x, bool(found.success), False
