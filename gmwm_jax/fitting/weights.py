"""Weighting matrices Omega of the GMWM objective.

``default``: 1/(width of the interval)^2 on the diagonal, the choice of R's simts, so that objectives compare.
``two-step``: the same with the variance of a first fit in place of the measured one, which takes out a bias.
``covariance``: the inverse of the whole covariance of the wavelet variance under a first fit, which for long records
gives the smallest variances there are from these moments (Hansen 1982; Guerrier et al. 2013).
``iterated``: that again under the fit that comes out, until nothing changes.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax.processes.base import Composite
from gmwm_jax.variance.wavelet import WaveletVariance

DEFAULT = "default"
TWO_STEP = "two-step"
COVARIANCE = "covariance"
ITERATED = "iterated"
GIVEN = "given"
STEPPED = (TWO_STEP, COVARIANCE, ITERATED)
"""Weights that need a first fit."""

_BEYOND = "beyond floating point: take other units, or scale the data."
_SINGULAR = 1e-12
"""Smallest eigenvalue of a correlation matrix of which an inverse keeps four digits."""


def default_weights(wv: WaveletVariance) -> Float[np.ndarray, "J J"]:
    """1/(ci_high - ci_low)^2 on the diagonal."""
    with np.errstate(divide="ignore", over="ignore"):
        weights = 1 / (wv.ci_high - wv.ci_low) ** 2
    if not np.all(np.isfinite(weights) & (weights > 0)):
        raise ValueError(
            f"The intervals are {wv.ci_high[0] - wv.ci_low[0]:g} wide, and the squares of widths are {_BEYOND}"
        )
    return np.diag(weights)


def given_weights(omega: Any, wv: WaveletVariance) -> Float[np.ndarray, "J J"]:
    """A user's vector or matrix as a matrix, checked."""
    J = wv.num_scales
    omega = np.asarray(omega, dtype=np.float64)
    if omega.shape == (J,):
        omega = np.diag(omega)
    if omega.shape != (J, J):
        raise ValueError(f"omega must have the shape ({J},) or ({J}, {J}), one entry a scale; it has {omega.shape}.")
    if not np.all(np.isfinite(omega)) or not np.allclose(omega, omega.T, rtol=1e-10, atol=0):
        raise ValueError("omega must be finite and symmetric.")
    scale = np.sqrt(np.abs(np.diag(omega)))
    if np.any(scale == 0) or np.linalg.eigvalsh(omega / np.outer(scale, scale))[0] <= 0:
        raise ValueError("omega must be positive definite: every eigenvalue above zero.")
    return omega


def two_step_weights(model: Composite, wv: WaveletVariance) -> Float[np.ndarray, "J J"]:
    """The default weights with the variance of a fitted model in place of the measured one."""
    fitted = np.asarray(model.wavelet_variance(wv.scales))
    if np.any(fitted <= 0):
        raise ValueError(f"{TWO_STEP} weights need a model with a variance, and {model} has none at some scale.")
    return np.diag((wv.variance / (fitted * (wv.ci_high - wv.ci_low))) ** 2)


def require_theory(wv: WaveletVariance, what: str) -> int:
    """Return N, or raise a ValueError: `what` needs the covariance of this wavelet variance, which is not known."""
    if wv.num_samples is None or not wv.has_theory:
        raise ValueError(
            f"{what} need the covariance of the wavelet variance: the number of samples, all scales 2 .. 2^J, and the "
            "MODWT."
        )
    return wv.num_samples


def covariance_weights(model: Composite, V: Float[np.ndarray, "J J"]) -> Float[np.ndarray, "J J"]:
    """Inverse of the covariance V of the wavelet variance under a model.

    Raises
    ------
    ValueError
        V is singular to rounding, as that of a model with no noise but a drift, or without any variance at some scale.
    """
    sd = np.sqrt(np.diag(V))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = V / np.outer(sd, sd)
    lowest = np.linalg.eigvalsh(correlation)[0] if np.all(np.isfinite(correlation)) else 0.0
    if lowest < _SINGULAR:
        raise ValueError(
            f"The covariance of the wavelet variance under {model} is singular (smallest eigenvalue of the correlation "
            f'{lowest:.1e}): its inverse cannot be weights. Take omega="{TWO_STEP}" or fewer scales.'
        )
    omega = np.linalg.inv(correlation) / np.outer(sd, sd)
    return (omega + omega.T) / 2
