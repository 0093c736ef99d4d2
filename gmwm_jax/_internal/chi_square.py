"""Tests of residuals whose covariance is known: a chi-square test, and one that skewness hardly fools.

Residuals at an estimate are r = M (nu_hat - nu) to first order, M = 1 - A B with A = d nu/d eta and B the estimator's
derivative, so that their covariance is M V M', of rank J less the number of parameters. Hence the statistic
r' (M V M')^+ r, asymptotically chi-square for whatever weights (Hansen 1982).

Its normal approximation fails in the far tail where variances have few degrees of freedom: a chi-square variable with
two of them lies five standard deviations above its mean once in 400 times, a normal one once in 3.5 million. What says
that a model is wrong must not do so by chance: `misses` takes residuals for gamma variables, as skew as those of a
variance with 2 nu^2/V degrees of freedom (Pearson 1959), and the chi-square of those scales alone that have many.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import chdtrc, gammaincc

_RANK = 1e-9
"""Of the variance of a scale, or the largest eigenvalue of all: below it there is no residual, all of it is fitted."""
_CHANCE = 1e-6
"""That a right model is said to miss its data, by each of the two ways of `misses`."""
_MANY = 100.0
"""Degrees of freedom from which a variance is nearly normal: its skewness is 0.28."""


class ChiSquare(NamedTuple):
    """Of residuals."""

    statistic: float
    dof: int
    p_value: float
    """NaN where no degree of freedom is left."""
    pulls: Float[np.ndarray, " J"]
    """Residual of each scale in standard deviations; NaN at a scale that is fitted exactly."""


def chi_square(
    residuals: Float[np.ndarray, " J"], M: Float[np.ndarray, "J J"], V: Float[np.ndarray, "J J"]
) -> ChiSquare:
    """Test whether residuals r = M e are those of errors e of the covariance V."""
    sd = np.sqrt(np.diag(V))
    # as a correlation, so that scales of all sizes count
    scaled = _scaled(M, sd)
    covariance = scaled @ (V / np.outer(sd, sd)) @ scaled.T
    own = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        pulls = np.where(own > np.sqrt(_RANK), residuals / sd / own, np.nan)
    return ChiSquare(*_quadratic(residuals / sd, covariance), pulls)


def misses(
    residuals: Float[np.ndarray, " J"],
    M: Float[np.ndarray, "J J"],
    V: Float[np.ndarray, "J J"],
    nu: Float[np.ndarray, " J"],
) -> bool:
    """Return whether residuals are beyond what chance and skewness do: at one scale, or at all with many degrees.

    Parameters
    ----------
    residuals, M, V
        As of `chi_square`.
    nu
        The variances that are expected.
    """
    sd = np.sqrt(np.diag(V))
    scaled, skewness = _scaled(M, sd), 2 * sd / nu
    covariance = scaled @ (V / np.outer(sd, sd)) @ scaled.T
    own = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    left = own > np.sqrt(_RANK)
    if not np.any(left):
        return False
    # residuals are sums of errors of several scales with either sign: as skew as if all of them had one sign
    skew = (np.abs(scaled[left]) ** 3 @ skewness) / own[left] ** 3
    shape = 4 / skew**2
    beyond = np.abs(residuals[left] / sd[left]) / own[left]
    chance = 2 * gammaincc(shape, shape + np.sqrt(shape) * beyond)
    if np.min(chance) * np.sum(left) < _CHANCE:
        return True
    many = np.flatnonzero(2 * nu**2 / np.diag(V) > _MANY)
    return bool(len(many)) and _quadratic((residuals / sd)[many], covariance[np.ix_(many, many)])[2] < _CHANCE


def _scaled(M: Float[np.ndarray, "J J"], sd: Float[np.ndarray, " J"]) -> Float[np.ndarray, "J J"]:
    return M * sd[None, :] / sd[:, None]


def _quadratic(r: Float[np.ndarray, " J"], covariance: Float[np.ndarray, "J J"]) -> tuple[float, int, float]:
    """Statistic, degrees of freedom and p-value."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    seen = values > _RANK * max(1.0, values[-1])
    projected = vectors.T @ r
    statistic, dof = float(np.sum(projected[seen] ** 2 / values[seen])), int(seen.sum())
    return statistic, dof, float(chdtrc(dof, statistic)) if dof else np.nan
