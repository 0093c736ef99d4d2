"""Energy score: how good a Gaussian forecast of the position is, its mean and its covariance in one number, in metres.

ES = E|X - y| - E|X - X'|/2 for the forecast X, X' ~ N(x_hat, P) and the truth y (Gneiting and Raftery 2007); lower is
better, and in the mean nothing scores better than the true distribution. In one dimension it is the CRPS.

Both terms are E|Z| of a Gaussian Z. With phi(t) = E exp(-t |Z|^2), a product over the principal axes of Z,
E|Z| = 2/sqrt(pi) times the integral of -phi'(w^2) over w > 0: the integrand is smooth, positive and even in w. After
w = c sinh(x) the trapezoidal rule converges exponentially.
"""

import numpy as np
from jaxtyping import Float

_STEP, _LAST, _SCALE = 0.21, 11.6, 0.6
"""Of the rule in x, and c for E|Z|^2 = 1. Relative error below 1e-9: half from the step, half from the cut at the end,
which matters only where all variance lies on one axis."""
_NODES = _SCALE * np.sinh(np.arange(0.0, _LAST, _STEP))
_WEIGHTS = 2 / np.sqrt(np.pi) * _STEP * np.sqrt(_NODES**2 + _SCALE**2)
_WEIGHTS[0] /= 2
_BLOCK = 4096
"""Gaussians worked off together: their arrays stay in the cache."""
_ROUNDING = 1e-9
"""Of a covariance, relative to its largest eigenvalue or entry."""


def energy_score(error: Float[np.ndarray, "... k"], covariance: Float[np.ndarray, "... k k"]) -> np.ndarray:
    """Compute the energy score of the forecast N(estimate, P) of each run and epoch; lower is better.

    Parameters
    ----------
    error
        Shape (R, E, k) or any (..., k): estimate less truth.
    covariance
        Shape (..., k, k): P as the filter claims it. It may be singular: for P = 0 the score is |error|.

    Returns
    -------
    Scores of shape (...), in the unit of the error.

    Raises
    ------
    ValueError
        Other shapes, NaN, a covariance that is not symmetric or has a negative eigenvalue.

    Examples
    --------
    >>> nj.statistics.energy_score(np.array([[[3.0, 4.0, 0.0]]]), np.zeros((1, 1, 3, 3))).round(9).tolist()
    [[5.0]]
    """
    variance, mean2 = _principal_axes(error, covariance)
    # X - X' ~ N(0, 2 P)
    score = _expected_norm(variance, mean2) - _expected_norm(variance, None) / np.sqrt(2)
    return score.reshape(error.shape[:-1])


def expected_norm(mean: Float[np.ndarray, "... k"], covariance: Float[np.ndarray, "... k k"]) -> np.ndarray:
    """E|Z| of Gaussians Z ~ N(mean, covariance), to a relative error below 1e-9.

    Parameters
    ----------
    mean, covariance
        Shapes (..., k) and (..., k, k); the covariance may be singular or zero.

    Raises
    ------
    ValueError
        As of `energy_score`.
    """
    return _expected_norm(*_principal_axes(mean, covariance)).reshape(mean.shape[:-1])


def _principal_axes(mean: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variances and squared means along the principal axes, each of shape (k, number of Gaussians)."""
    k = mean.shape[-1]
    if covariance.shape != (*mean.shape, k):
        raise ValueError(
            f"Errors of shape {mean.shape} take covariances of shape {(*mean.shape, k)}, and these have the shape "
            f"{covariance.shape}."
        )
    for what, x in (("error", mean), ("covariance", covariance)):
        if not np.all(np.isfinite(x)):
            first = tuple(int(i) for i in np.argwhere(~np.isfinite(x))[0])
            raise ValueError(f"The {what} is NaN or infinite at index {first}. Leave out the runs that failed.")
    P = covariance.reshape(-1, k, k)
    largest = np.abs(P).max(axis=(1, 2), initial=0.0)
    _refuse(np.abs(P - np.swapaxes(P, 1, 2)).max(axis=(1, 2), initial=0.0) > _ROUNDING * largest, mean, "not symmetric")
    variance, axes = np.linalg.eigh(P)
    _refuse(variance[:, 0] < -_ROUNDING * largest, mean, "not positive semidefinite")
    along = np.einsum("nij,ni->jn", axes, mean.reshape(-1, k))
    return np.maximum(variance.T, 0.0), along**2


def _refuse(bad: np.ndarray, mean: np.ndarray, what: str) -> None:
    if bad.any():
        first = tuple(int(i) for i in np.unravel_index(int(bad.argmax()), mean.shape[:-1]))
        raise ValueError(f"{bad.sum()} of {bad.size} covariances are {what}, the first of them at index {first}.")


def _expected_norm(variance: Float[np.ndarray, "k n"], mean2: Float[np.ndarray, "k n"] | None) -> np.ndarray:
    """E|Z|; without `mean2` for means of zero."""
    result = np.zeros(variance.shape[1])
    for start in range(0, len(result), _BLOCK):
        block = slice(start, start + _BLOCK)
        lam, m2 = variance[:, block], None if mean2 is None else mean2[:, block]
        square = lam.sum(axis=0) + (0.0 if m2 is None else m2.sum(axis=0))  # E|Z|^2
        scale = np.where(square > 0, square, 1.0)
        lam, m2 = lam / scale, None if m2 is None else m2 / scale
        total = np.zeros_like(square)
        for w, weight in zip(_NODES, _WEIGHTS, strict=True):
            total += weight * _minus_derivative(w**2, lam, m2)
        result[block] = np.sqrt(square) * total
    return result


def _minus_derivative(t: float, lam: np.ndarray, m2: np.ndarray | None) -> np.ndarray:
    """-phi'(t) of phi(t) = prod (1 + 2 t lam)^(-1/2) exp(-t m^2/(1 + 2 t lam))."""
    shrink = 1 / (1 + 2 * t * lam)
    root = np.sqrt(shrink.prod(axis=0))
    if m2 is None:
        return root * (lam * shrink).sum(axis=0)
    m2 = m2 * shrink
    return root * np.exp(-t * m2.sum(axis=0)) * ((lam + m2) * shrink).sum(axis=0)
