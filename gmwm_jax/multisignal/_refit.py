"""Many joint estimates that resemble one already made: resamples, replicates and splits of records, vmapped."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax.fitting.problem import pose
from gmwm_jax.fitting.refit import fitted_variances, parameter_values, solve_near, starts_near
from gmwm_jax.multisignal._pool import whitened
from gmwm_jax.multisignal.joint import JointFit

CHUNK = 64
"""Estimates made at once: the last chunk is filled up to it, since another size would compile again."""


class JointRefits(NamedTuple):
    """B joint estimates."""

    values: Float[np.ndarray, "B P"]
    """Parameters in the order of the model."""
    fitted: Float[np.ndarray, "B J"]
    """Their wavelet variances, on the scales of the longest record."""
    converged: Bool[np.ndarray, " B"]


def joint_refit(joint: JointFit, omega: Float[np.ndarray, "B J J"], moment: Float[np.ndarray, "B J"]) -> JointRefits:
    """Estimate the model of a joint fit from B sums of quadratic forms, descending from its estimate.

    Parameters
    ----------
    joint
        Where to start.
    omega, moment
        Sums over records of Omega_i and of Omega_i nu_i.
    """
    tau = joint.wv.scales
    problem = pose(joint.model, float(tau[-1]))
    starts, parts = starts_near(problem), []
    for first in range(0, len(omega), CHUNK):
        own, num = slice(first, first + CHUNK), min(CHUNK, len(omega) - first)
        whitener, y = (_filled(a) for a in whitened(omega[own], moment[own]))
        found = solve_near(problem, starts, y, whitener, tau)
        fitted = np.asarray(fitted_variances(problem.layout, problem.shapes, found.solution, tau))
        parts.append([a[:num] for a in (parameter_values(problem, found.solution), fitted, found.converged)])
    return JointRefits(*(np.concatenate(leaves) for leaves in zip(*parts, strict=True)))


def _filled(a: np.ndarray) -> np.ndarray:
    return np.concatenate([a, np.repeat(a[-1:], CHUNK - len(a), axis=0)])
