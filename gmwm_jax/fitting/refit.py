"""Estimates of many wavelet variances that resemble one already fitted: descents from that fit, vmapped.

The objective of a replicate differs from that of the data by noise, and so does its minimum. A descent from the fitted
correlation times, and one more from each of them moved by a factor of four either way, finds it: 2 K + 1 descents, and
no lattice.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax._internal.chunks import chunks
from gmwm_jax._internal.xla_threads import few_at_a_time
from gmwm_jax.fitting.problem import Problem
from gmwm_jax.fitting.reduced import Data, Layout
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.search import SIZE, Solution, minimise_near, smallest_slope
from gmwm_jax.processes.base import Composite

CHUNK = 64
"""Wavelet variances estimated at once."""


class Refits(NamedTuple):
    """Estimates from B wavelet variances."""

    values: Float[np.ndarray, "B P"]
    """Parameters in the order of the model, components of a kind from fast to slow."""
    objective: Float[np.ndarray, " B"]
    converged: Bool[np.ndarray, " B"]
    fitted: Float[np.ndarray, "B J"]
    """Their wavelet variances."""


def refit(fit: Fit, variances: Float[np.ndarray, "B J"]) -> Refits:
    """Estimate the model of a fit again from other wavelet variances on the same scales, with weights of the same kind.

    Default weights are those of each replicate's own intervals, two-step weights those under its own first fit. Weights
    from a covariance, and given ones, are those of the fit: to first order that makes no difference.

    Parameters
    ----------
    fit
        Where to start.
    variances
        Wavelet variances, positive.
    """
    width = (fit.wv.ci_high - fit.wv.ci_low) / fit.wv.variance
    again = partial(refit_whitened, fit.model, fit.wv.scales)
    if not fit.weights.of_replicates:
        root = fit.whitener
        whitener = np.broadcast_to(root, (len(variances), *root.shape))
        return again(_whitened(whitener, variances), whitener)
    fitted = variances
    for in_width in fit.weights.of_replicates:
        whitener = (1 / (width * in_width(variances, fitted)))[:, :, None] * np.eye(variances.shape[1])
        found = again(_whitened(whitener, variances), whitener)
        # without any variance at a scale there is no second step
        fitted = np.where(np.all(found.fitted > 0, axis=1, keepdims=True), found.fitted, variances)
    return found


def _whitened(whitener: Float[np.ndarray, "B J J"], nu: Float[np.ndarray, "B J"]) -> Float[np.ndarray, "B J"]:
    return np.einsum("bij,bj->bi", whitener, nu)


def refit_whitened(
    model: Composite,
    tau: Float[np.ndarray, " J"],
    y: Float[np.ndarray, "B J"],
    whitener: Float[np.ndarray, "B J J"],
    told: Callable[[int], object] = lambda count: None,
) -> Refits:
    """Estimate a model again, near its own values, from whitened wavelet variances.

    Parameters
    ----------
    model
        All parameters given: where to start.
    tau
        Spans.
    y, whitener
        L' nu_hat and L' of each, Omega = L L'.
    told
        Hears how many more are done.
    """
    problem = Problem.of(model, float(tau[-1]))
    starts, parts = problem.starts_near(), []
    for rows, count in chunks(len(y), CHUNK):
        solution, converged = _solve_near(problem, starts, y[rows], whitener[rows], tau)
        found = (
            problem.parameter_values(solution),
            solution.objective,
            converged,
            problem.fitted_variances(solution, tau),
        )
        parts.append([leaf[:count] for leaf in found])
        told(count)
    return Refits(*(np.concatenate(leaves) for leaves in zip(*parts, strict=True)))


def _solve_near(
    problem: Problem,
    starts: Float[np.ndarray, "S C"],
    y: Float[np.ndarray, "B J"],
    whitener: Float[np.ndarray, "B J J"],
    tau: Float[np.ndarray, " J"],
) -> tuple[Solution, Bool[np.ndarray, " B"]]:
    """The lowest minima of B problems that descents from the starts lead to, and which of them converged."""
    unit = np.max(np.abs(y), axis=1) / SIZE
    found = _minimise_all(
        problem.layout,
        starts,
        y / unit[:, None],
        whitener / unit[:, None, None],
        tau,
        problem.bounds,
        problem.shapes,
        problem.held,
    )
    found = jax.tree.map(np.asarray, found)
    converged = np.isfinite(found.objective) & (found.slope <= smallest_slope(found.objective))
    return found._replace(objective=found.objective * unit**2), converged


@few_at_a_time
@partial(jax.jit, static_argnums=0)
def _minimise_all(
    layout: Layout, starts: Any, y: Any, whitener: Any, tau: Any, bounds: Any, shapes: Any, amplitudes: Any
) -> Solution:
    def one(y: Array, whitener: Array) -> Solution:
        return minimise_near(layout, starts, Data(y, whitener, tau, bounds, shapes, amplitudes))

    return jax.vmap(one)(y, whitener)
