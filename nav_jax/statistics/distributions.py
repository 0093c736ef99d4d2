"""Quantiles, bands and sample sizes behind the statistics over runs.

From `scipy.special`: to import `scipy.stats` takes longer than all of this package.
"""

import numpy as np
from jaxtyping import Float
from scipy.special import bdtr, betaincinv, elliprg, gammainc, gammaincinv, ndtri, stdtrit

_EXACT_UP_TO = 10_000
"""Runs up to which a sample size comes from the noncentral t; beyond, it is the same by Guenther's formula."""
_NO_EFFECT = 1e-8
"""Mean over standard deviation that is rounding; 1e17 runs would tell it from zero."""

_TALBOT = 28
"""Nodes of a contour: its error falls as 10^(-0.6 M), and rounding grows as e^(0.4 M)."""


def normal_quantile(level: float) -> float:
    """Return z such that a normal variable lies within +-z with probability `level`."""
    return float(ndtri((1 + level) / 2))


def t_quantile(level: float, dof: int) -> float:
    """Return t such that a Student variable lies within +-t with probability `level`."""
    return float(stdtrit(dof, (1 + level) / 2))


def chi2_quantile(p: float, dof: int | np.ndarray) -> np.ndarray:
    """Return what a chi-square variable does not exceed with probability `p`."""
    return np.asarray(2 * gammaincinv(np.asarray(dof) / 2, p))


def binomial_band(N: int, probability: float, confidence: float) -> tuple[float, float]:
    """Acceptance region, as fractions of N: outside of either end lies at most half of what `confidence` leaves."""
    tail = (1 - confidence) / 2
    cumulative = bdtr(np.arange(N + 1.0), N, probability)
    low, high = (int(np.searchsorted(cumulative, p)) / N for p in (tail, 1 - tail))
    return low, high


def clopper_pearson(
    count: Float[np.ndarray, "*shape"], N: int, confidence: float
) -> tuple[Float[np.ndarray, "*shape"], Float[np.ndarray, "*shape"]]:
    """Exact interval of a probability from counts (NaN stays NaN) in N trials."""
    tail = (1 - confidence) / 2
    # the formula has no value for a limit that is that of the range
    low = np.where(count == 0, 0.0, betaincinv(np.maximum(count, 1.0), N - count + 1, tail))
    high = np.where(count == N, 1.0, betaincinv(count + 1, np.maximum(N - count, 1.0), 1 - tail))
    return low, high


def gaussian_dof(e: Float[np.ndarray, "R *rest k"]) -> Float[np.ndarray, "*rest"]:
    """Degrees of freedom of the sum over runs of |e|^2 for Gaussian e without mean: N tr(M)^2/tr(M^2), M = E[e e'].

    Both traces without the bias that they have when M is taken from N runs. N for one component, 3 N for three alike.
    """
    N, k = e.shape[0], e.shape[-1]
    M = np.einsum("r...i,r...j->...ij", e, e) / N
    first, second = np.trace(M, axis1=-2, axis2=-1) ** 2, np.sum(M * M, axis=(-2, -1))
    second = (second - first / N) * N**2 / ((N - 1) * (N + 2))
    first = first - 2 * second / N
    # where there is no error at all: as many as there can be
    ratio = np.divide(first, second, out=np.full(first.shape, float(k)), where=second > first / k)
    return N * np.clip(ratio, 1.0, k)


def num_runs_needed(difference: float, sd: float, size: float, power: float) -> int | None:
    """Sample size of the paired t test for a true mean `difference` of pairs with the standard deviation `sd`.

    Parameters
    ----------
    difference, sd
        Of one pair.
    size, power
        Probabilities that the test finds a difference that is none, and this one.

    Returns
    -------
    None if no number of runs is enough: for a difference of zero, or of rounding beside its scatter.
    """
    effect = abs(difference) / sd if sd > 0 else np.inf
    if difference == 0 or effect < _NO_EFFECT:
        return None
    z = float(ndtri(1 - size / 2))
    # a power below the size is had for nothing
    normal = (max(z + float(ndtri(power)), 0.0) / effect) ** 2
    if normal > _EXACT_UP_TO:
        return int(np.ceil(normal + z**2 / 2))
    n = max(2, int(np.ceil(normal)))  # a t test needs more runs than one with a known variance
    while t_test_power(effect, n, size) < power:
        n += 1
    return n


def t_test_power(effect: float, n: int, size: float) -> float:
    """Power of the two-sided paired t test for a mean of `effect` standard deviations (noncentral t).

    With Z normal, P(T > c) = P(chi/sqrt(dof) < (effect sqrt(n) + Z)/c), averaged over Z by the trapezoidal rule:
    `scipy.special.nctdtr` is NaN far out.
    """
    dof, critical = n - 1, t_quantile(1 - size, n - 1)
    z = np.linspace(-9.0, 9.0, 1001)
    density = np.exp(-(z**2) / 2) / np.sum(np.exp(-(z**2) / 2))
    shift = effect * np.sqrt(n)
    return sum(
        float(density @ gammainc(dof / 2, dof / 2 * (np.maximum(z + s, 0.0) / critical) ** 2)) for s in (shift, -shift)
    )


def weighted_chi2_cdf(weights: Float[np.ndarray, "*E k"], x: float) -> Float[np.ndarray, "*E"]:
    """P(sum_i w_i z_i^2 <= x) for independent standard normal z and weights w >= 0.

    The Laplace transform of the distribution function, M(s)/s with M(s) = prod (1 + 2 w_i s)^(-1/2), has all its
    singularities on the negative real axis, where a Talbot contour turns around them (Abate & Valko 2004).
    """
    angle = np.arange(1, _TALBOT) * np.pi / _TALBOT
    cot = 1 / np.tan(angle)
    r = 2 * _TALBOT / 5
    s = np.append(r, r * angle * (cot + 1j)) / x
    step = np.append(0.5, 1 + 1j * (angle + (angle * cot - 1) * cot))
    transform = np.prod((1 + 2 * np.asarray(weights)[..., None, :] * s[:, None]) ** -0.5, axis=-1) / s
    total = np.sum(np.real(np.exp(s * x) * transform * step), axis=-1) * r / (_TALBOT * x)
    return np.asarray(np.clip(total, 0.0, 1.0))


def mean_length(P: Float[np.ndarray, "*E 3 3"]) -> Float[np.ndarray, "*E"]:
    """E|e| of a Gaussian e in three dimensions without mean, with the covariance P.

    e = P^(1/2) r u with a length r of chi with 3 degrees of freedom, of mean sqrt(8/pi), and a direction u that is
    independent of it and even over the sphere. The mean of |P^(1/2) u| over the sphere is Carlson's R_G of the
    eigenvalues of P (DLMF 19.16.3; 19.23.6).
    """
    roots = np.maximum(np.linalg.eigvalsh(P), 0.0)  # rounding may make one negative
    return np.sqrt(8 / np.pi) * elliprg(roots[..., 0], roots[..., 1], roots[..., 2])
