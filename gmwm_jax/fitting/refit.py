"""Estimates of many wavelet variances that resemble one already fitted: descents from that fit, vmapped.

The objective of a replicate differs from that of the data by noise, and so does its minimum. A descent from the fitted
correlation times, and one more from each of them moved by a factor of four either way, finds it: 2 K + 1 descents, and
no lattice.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float

from gmwm_jax.fitting.problem import Problem, pose, slots
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.search import SIZE, Data, Layout, Solution, minimise_near, smallest_slope
from gmwm_jax.fitting.weights import DEFAULT, TWO_STEP

_MOVED = np.log(4.0)


class Refits(NamedTuple):
    """Estimates from B wavelet variances."""

    values: Float[np.ndarray, "B P"]
    """Parameters in the order of the model, components of a kind from fast to slow."""
    objective: Float[np.ndarray, " B"]
    converged: Bool[np.ndarray, " B"]


def refit(fit: Fit, variances: Float[np.ndarray, "B J"], chunk_size: int = 64) -> Refits:
    """Estimate the model of a fit again from other wavelet variances on the same scales, with weights of the same kind.

    Default weights are those of each replicate's own intervals, two-step weights those under its own first fit. Weights
    from a covariance, and given ones, are those of the fit: to first order that makes no difference.

    Parameters
    ----------
    fit
        Where to start.
    variances
        Wavelet variances, positive.
    chunk_size
        Replicates estimated at once. It changes speed and memory, not the numbers.
    """
    problem = pose(fit.model, float(fit.wv.scales[-1]))
    starts = starts_near(problem)
    width = (fit.wv.ci_high - fit.wv.ci_low) / fit.wv.variance
    root = np.linalg.cholesky(fit.omega).T
    parts = []
    for first in range(0, len(variances), chunk_size):
        nu = variances[first : first + chunk_size]
        # the last chunk is filled up: another size would compile again
        filled = np.concatenate([nu, np.repeat(nu[-1:], chunk_size - len(nu), axis=0)])
        if fit.weights in (DEFAULT, TWO_STEP):
            whitener = _diagonals(1 / (width * filled))
        else:
            whitener = np.broadcast_to(root, (chunk_size, *root.shape))
        found = solve_near(problem, starts, _whitened(whitener, filled), whitener, fit.wv.scales)
        if fit.weights == TWO_STEP:
            fitted = np.asarray(fitted_variances(problem.layout, problem.shapes, found.solution, fit.wv.scales))
            # without any variance at a scale there is no second step
            fitted = np.where(np.all(fitted > 0, axis=1, keepdims=True), fitted, filled)
            whitener = _diagonals(1 / (width * fitted))
            found = solve_near(problem, starts, _whitened(whitener, filled), whitener, fit.wv.scales)
        num = len(nu)
        parts.append(jax.tree.map(lambda leaf, num=num: leaf[:num], found))
    whole = jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)
    return Refits(parameter_values(problem, whole.solution), whole.solution.objective, whole.converged)


class Found(NamedTuple):
    """Minima of B problems."""

    solution: Solution
    converged: Bool[np.ndarray, " B"]


def _diagonals(d: Float[np.ndarray, "B J"]) -> Float[np.ndarray, "B J J"]:
    return d[:, :, None] * np.eye(d.shape[1])


def starts_near(problem: Problem) -> Float[np.ndarray, "S C"]:
    """Starts around the coordinates of the problem's own model."""
    at = [np.zeros(0), *(np.atleast_1d(p.coordinate_from_shape(p.shape)) for p in problem.searched)]
    return starts_around(np.concatenate(at), problem.bounds)


def starts_around(at: Float[np.ndarray, " C"], bounds: Float[np.ndarray, "C 2"]) -> Float[np.ndarray, "S C"]:
    """Coordinates, and those with one of them moved."""
    moves = _MOVED * np.eye(len(at))
    return np.clip(np.concatenate([at[None], at + moves, at - moves]), *bounds.T)


def _whitened(whitener: Float[np.ndarray, "B J J"], nu: Float[np.ndarray, "B J"]) -> Float[np.ndarray, "B J"]:
    return np.einsum("bij,bj->bi", whitener, nu)


def solve_near(
    problem: Problem,
    starts: Float[np.ndarray, "S C"],
    y: Float[np.ndarray, "B J"],
    whitener: Float[np.ndarray, "B J J"],
    tau: Float[np.ndarray, " J"],
) -> Found:
    """The lowest minima of B problems that descents from the starts lead to: whitened wavelet variances y, L'."""
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
    return Found(found._replace(objective=found.objective * unit**2), converged)


@partial(jax.jit, static_argnums=0)
def _minimise_all(
    layout: Layout, starts: Any, y: Any, whitener: Any, tau: Any, bounds: Any, shapes: Any, amplitudes: Any
) -> Solution:
    def one(y: Array, whitener: Array) -> Solution:
        return minimise_near(layout, starts, Data(y, whitener, tau, bounds, shapes, amplitudes))

    return jax.vmap(one)(y, whitener)


@partial(jax.jit, static_argnums=0)
def fitted_variances(layout: Layout, shapes: Any, solution: Solution, tau: Any) -> Float[Array, "B J"]:
    """Wavelet variances of solutions."""
    total = jnp.zeros((solution.amplitudes.shape[0], tau.shape[0]))
    for i, kind in enumerate(layout.kinds):
        if i < layout.num_shapes:
            unit = jax.vmap(lambda z, kind=kind: kind.unit_wavelet_variance(kind.shape_from_coordinate(z), tau))(
                solution.coordinates[:, layout.position(i)]
            )
        else:
            unit = kind.unit_wavelet_variance(shapes[i - layout.num_shapes], tau)[None]
        total = total + solution.amplitudes[:, i, None] * unit
    return total


def parameter_values(problem: Problem, solution: Solution) -> Float[np.ndarray, "B P"]:
    """Parameters in the order of the model."""
    columns, times = [], []
    for i, p in enumerate(problem.processes):
        shape = p.shape
        if i < problem.layout.num_shapes:
            shape = p.shape_from_coordinate(jnp.asarray(solution.coordinates[:, problem.layout.position(i)]))
        values = [*shape, p.value_of(jnp.asarray(solution.amplitudes[:, i]))]
        columns.append(np.stack(np.broadcast_arrays(*map(np.asarray, values)), axis=1))
        times.append(np.broadcast_to(p.correlation_time(shape) if shape else 0.0, len(solution.objective)))
    time, gone = np.stack(times, axis=1), solution.amplitudes == 0
    return np.stack(
        [np.concatenate([columns[i][b] for i in slots(problem, time[b], gone[b])]) for b in range(len(time))]
    )
