"""How many degrees of freedom variances of stability have, where the noise is locally a power law.

The overlapping Allan variance (the Haar wavelet variance twice), the modified one and the overlapping Hadamard variance
are means of M squares of d-th differences, over m samples, of the phase x (the running sum of the samples) or of its
running sum X. For noise with the spectrum of a power law, a generalised covariance g of x or X is known, and
differences that are stationary have the autocovariance (the signs cancel in a correlation)

    gamma(h) = sum_k (-1)^k C(2d, d + k) g(h + k m),    k = -d .. d,

with g = |h| for white noise, h^2 log|h| for flicker noise, |h|^3 - |h| for a random walk of x, and each twice
integrated for X (odd powers are those of sums, not of integrals: C(h + 1, 3), C(h + 2, 5)). By Isserlis' theorem the
variance of the mean is 2/M^2 sum_h (M - |h|) gamma(h)^2, and a chi-square variable of the same mean and variance has

    eta = 2 nu^2/Var(nu) = M^2/sum_h (M - |h|) rho(h)^2

degrees of freedom, rho the correlation. (Greenhall & Riley 2003, "Uncertainty of stability variances based on finite
differences", have the same sums approximated by formulas.) Between two power laws the relative standard deviation is
interpolated by the slope, as a mixture of two independent noises has it if their correlations hardly overlap.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import comb, digamma

_STEPS = 32
"""Lags in a difference of many samples at which correlations are taken: they are smooth but at multiples of m."""
_REACH = 16
"""Differences after which flicker noise has forgotten: the squared correlation is below 1e-5 there."""
_WINDOWS = (1, 2)
"""Neighbours to either side from which the slope of a scale is, twice as many to one side at the ends; the flatter one
counts."""
_ROUNDS = 4
"""Of slopes and degrees of freedom, which depend on each other."""


class Statistic(NamedTuple):
    """A variance of stability."""

    order: int
    """d, of the differences."""
    averaged: bool
    """Are they of X, the running sum of the phase?"""

    def num_terms(self, num_samples: int, m: Float[np.ndarray, " J"]) -> Float[np.ndarray, " J"]:
        """M, of how many squares it is the mean."""
        return num_samples + 1 - self.order * m + self.averaged

    @property
    def slopes(self) -> tuple[float, ...]:
        """Of the variance over averaging time: quantisation, white noise, flicker noise, random walk."""
        return (-3.0 if self.averaged else -2.0, -1.0, 0.0, 1.0)


ALLAN = Statistic(2, averaged=False)
MODIFIED_ALLAN = Statistic(3, averaged=True)
HADAMARD = Statistic(3, averaged=False)


def local_degrees_of_freedom(
    statistic: Statistic, num_samples: int, m: Float[np.ndarray, " J"], variance: Float[np.ndarray, "J *C"]
) -> Float[np.ndarray, "J *C"]:
    """Degrees of freedom of variances at averaging times m, of the power law that each has with its neighbours.

    Parameters
    ----------
    statistic
        Which variance it is.
    num_samples
        N.
    m
        Averaging times in samples, each twice the one before.
    variance
        Of one channel or of several.

    Returns
    -------
    eta, at least 1.
    """
    of_laws = degrees_of_freedom_of_laws(statistic, num_samples, m)
    columns = variance.reshape(len(m), -1)
    eta = np.broadcast_to(of_laws[:, 2:3], columns.shape)
    for _ in range(_ROUNDS):
        # a slope that is too steep, by chance or since it changes, would claim the many degrees of freedom of
        # quantisation noise
        slope = np.max([np.sum(local_slopes(m, columns, eta, window), axis=0) for window in _WINDOWS], axis=0)
        sd = [np.interp(row, statistic.slopes, law**-0.5) for row, law in zip(slope, of_laws, strict=True)]
        eta = np.maximum(np.array(sd) ** -2.0, 1.0)
    return eta.reshape(variance.shape)


def local_slopes(
    m: Float[np.ndarray, " J"], variance: Float[np.ndarray, "J C"], eta: Float[np.ndarray, "J C"], window: int
) -> tuple[Float[np.ndarray, "J C"], Float[np.ndarray, "J C"]]:
    """Slopes of log variance over log m, by weighted lines through each scale and so many to either side; and errors.

    A variance with eta degrees of freedom has a logarithm with a mean of digamma(eta/2) - log(eta/2) and a variance of
    about 2/eta: scales that hardly know their variance hardly count, and a single scale has the slope of white noise.
    """
    J = len(m)
    if J == 1:
        return np.full_like(variance, -1.0), np.zeros_like(variance)
    y = np.log(variance) - (digamma(eta / 2) - np.log(eta / 2))
    t, slopes, errors = np.log(m), np.empty_like(y), np.empty_like(y)
    for j in range(J):
        near = slice(max(0, min(j, J - 1 - window) - window), max(j, window) + window + 1)
        w = eta[near] * 0.5 ** np.abs(np.arange(J)[near] - j)[:, None]
        w = w / w.sum(axis=0)
        dt = t[near, None] - np.sum(w * t[near, None], axis=0)
        spread = np.sum(w * dt**2, axis=0)
        slopes[j] = np.sum(w * dt * y[near], axis=0) / spread
        errors[j] = np.sqrt(np.sum((w * dt) ** 2 * 2 / eta[near], axis=0)) / spread
    return slopes, errors


def degrees_of_freedom_of_laws(
    statistic: Statistic, num_samples: int, m: Float[np.ndarray, " J"]
) -> Float[np.ndarray, "J 4"]:
    """Degrees of freedom for quantisation noise, white noise, flicker noise and a random walk."""
    M = statistic.num_terms(num_samples, m)
    return np.array(
        [[_eta(statistic, law, float(n), float(M_n)) for law in range(4)] for n, M_n in zip(m, M, strict=True)]
    )


def _eta(statistic: Statistic, law: int, m: float, M: float) -> float:
    if law == 0 and not statistic.averaged:  # white phase: correlated at multiples of m only
        d = statistic.order
        lags, weight = np.arange(d + 1) * m, np.ones(d + 1)
        rho = comb(2 * d, d + np.arange(d + 1)) / comb(2 * d, d)
    else:
        lags, weight = _lags(m, _REACH if law == 2 else statistic.order)
        rho = _autocovariance(statistic, law, lags, m)
        rho = rho / rho[0]
    both = np.where(lags > 0, 2.0, 1.0)
    return float(M**2 / np.sum(both * weight * np.maximum(M - lags, 0.0) * rho**2))


def _lags(m: float, reach: int) -> tuple[np.ndarray, np.ndarray]:
    """Lags from 0 to reach m, and the weights of a sum over all of them: Simpson's between lags that are left out."""
    if m <= _STEPS:
        lags = np.arange(reach * m + 1)
        return lags, np.ones(len(lags))
    lags = np.linspace(0, reach * m, reach * _STEPS + 1)
    weight = np.tile([2.0, 4.0], reach * _STEPS // 2 + 1)[: len(lags)] * (m / _STEPS) / 3
    weight[-1] /= 2
    # the sum of both sides has lag 0 once: half of the integral of a side is added to what stands for it there
    weight[0] = 2 * (m / _STEPS) / 3
    return lags, weight


def _autocovariance(statistic: Statistic, law: int, h: np.ndarray, m: float) -> np.ndarray:
    d = statistic.order
    total = np.zeros_like(h)
    for k in range(-d, d + 1):
        x = np.abs(h + k * m) / (1.0 if m <= _STEPS else m)
        one = 0.0 if m > _STEPS else 1.0  # long differences: the limit of integrals
        total += (-1) ** k * comb(2 * d, d + k) * _generalised(law - 1 + statistic.averaged, x, one, law)
    return total


def _generalised(power: int, x: np.ndarray, one: float, law: int) -> np.ndarray:
    """The covariance g of a law; `power` counts integrations of a random walk."""
    if law == 2:
        logarithm = np.log(np.where(x > 0, x, 1.0))
        return x**4 * logarithm if power == 2 else x**2 * logarithm
    if power <= 0:
        return x
    return x**3 - one * x if (power == 1 or (power == 2 and law == 3)) else x * (x**2 - one) * (x**2 - 4 * one)
