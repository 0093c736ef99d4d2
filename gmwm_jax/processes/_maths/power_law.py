"""Noise with the spectrum h |f|^-alpha, -1 < alpha <= 1, as a sensor samples it that integrates over each sample.

A rate sensor reads the increment of an angle or velocity over the sample, so x_t is the mean of the rate over it and
the running sum Y is the integral itself, whose generalised covariance (see `_haar`) is a power with the exponent
p = alpha + 1 (Mandelbrot & Van Ness 1968). A multiple of m^2 is seen by no Haar filter; taking one off keeps

    P(m) = (|m|^p - m^2)/(p - 2)

finite for flicker noise, p = 2, where it is m^2 log|m|. There is no scale but the sample, hence

    nu^2(tau) = (2 P(2n) - 8 P(n))/tau^2 = 2 n^(p-2) (2^(p-2) - 1)/(p - 2),    n = tau/2,

is an exact power of tau, and flat for flicker noise.
"""

from typing import Any

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax.processes._maths.haar import Points, second_differences
from gmwm_jax.processes._series import exp_ratio

_NUM_TERMS = 26
"""Of the series in (filter length/distance)^2 <= 1/4."""
_NEAR_FLICKER = 1.8
"""Above this exponent m^2 is taken off; below, |m|^p alone leaves the smaller numbers to cancel."""


def _log(m: Any) -> Any:
    """log(m), 0 at m = 0 (where every power below is 0 or has the factor m^2)."""
    return jnp.log(jnp.where(m > 0, m, 1.0))


def _power(m: Any, p: Any) -> Any:
    """m^p, 0 at m = 0, with derivative by p."""
    return jnp.where(m > 0, jnp.exp(p * _log(m)), 0.0)


def wavelet_variance(p: Any, tau: Float[Array, "*J"]) -> Float[Array, "*J"]:
    """2 n^(p-2) (2^(p-2) - 1)/(p - 2)."""
    ln2 = jnp.log(2.0)
    return 2 * ln2 * exp_ratio((2 - p) * ln2) * (tau / 2) ** (p - 2)


def haar_covariance(p: Any, lag: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """Cross-covariance of Haar coefficients (see `_haar`) for K = P; 0 < p <= 2."""

    def K(m: Any, _: Any) -> Any:
        y = (p - 2) * _log(m)
        flat = m * m * _log(m) * exp_ratio(-y)
        steep = _power(m, p) / jnp.where(p > _NEAR_FLICKER, -1.0, p - 2)
        return jnp.where(p > _NEAR_FLICKER, flat, steep)

    near = second_differences(K, lag, jnp.ones_like(lag), n_j, n_k)
    # Far apart the fourth difference is nothing beside its terms: sum its Taylor series about the distance c of the
    # centres instead, C(p,2k)/(p-2) c^(p-2k) [2 (n_j+n_k)^2k + 2 (n_j-n_k)^2k - 4 n_j^2k - 4 n_k^2k] over k = 2, 3, ..
    c = jnp.abs(lag - n_j + n_k)
    far = c > 2 * (n_j + n_k)
    c = jnp.where(far, c, 2 * (n_j + n_k))
    a = _even_binomials(p)

    def series(length: Any) -> Any:
        x = (length / c) ** 2
        return x * x * sum_powers(x, a)

    total = 2 * series(n_j + n_k) + 2 * series(n_j - n_k) - 4 * series(n_j) - 4 * series(n_k)
    return jnp.where(far, c**p * total / (4 * n_j * n_k), near)


def autocovariance(p: Any, lag: Float[Array, "*L"]) -> Float[Array, "*L"]:
    """(|h+1|^p - 2 |h|^p + |h-1|^p)/2 at integers h >= 0: of fractional Gaussian noise of variance 1."""
    # 2^(p-1) - 1 at h = 1, and beyond it the series of the second difference, which cancels as h^-2
    h = jnp.maximum(lag, 2.0)
    x = 1 / (h * h)
    beyond = h**p * x * (p * (p - 1) / 2 + (p - 2) * x * sum_powers(x, _even_binomials(p)))
    return jnp.where(lag == 0, 1.0, jnp.where(lag == 1, jnp.expm1((p - 1) * jnp.log(2.0)), beyond))


def psd(s: Any, frequency: Float[Array, "*F"]) -> Float[Array, "*F"]:
    """sum_k sinc(f+k)^2 |f+k|^(2-s) over all integers k, s = alpha + 2 > 1: the mean over a sample, and its aliases."""
    return (jnp.sin(jnp.pi * frequency) / jnp.pi) ** 2 * (hurwitz(s, frequency) + hurwitz(s, 1 - frequency))


def sum_powers(x: Any, coefficients: list[Any]) -> Any:
    """The polynomial with these coefficients, the constant first."""
    total = jnp.zeros_like(x)
    for a in reversed(coefficients):
        total = total * x + a
    return total


def _even_binomials(p: Any) -> list[Any]:
    """The binomial coefficients C(p, 2k) without their factor p - 2, k = 2, 3, .."""
    coefficients, product = [], p * (p - 1) / 6
    for k in range(2, _NUM_TERMS):
        product = product * (p - 2 * k + 1) / (2 * k)
        coefficients.append(product)
        product = product * (p - 2 * k) / (2 * k + 1)
    return coefficients


_EULER_MACLAURIN = (1 / 12, -1 / 720, 1 / 30240, -1 / 1209600, 1 / 47900160, -691 / 1307674368000, 1 / 74724249600)
"""Bernoulli numbers B_2k/(2k)!."""
_DIRECT = 10


def hurwitz(s: Any, q: Any) -> Any:
    """sum_{k>=0} (q + k)^-s, s > 1, by Euler and Maclaurin; differentiable in s as well."""
    total = jnp.zeros_like(q)
    for k in range(_DIRECT):
        total = total + (q + k) ** (-s)
    x = q + _DIRECT
    total = total + x ** (1 - s) / (s - 1) + x ** (-s) / 2
    term = s * x ** (-s - 1)
    for k, b in enumerate(_EULER_MACLAURIN):
        total = total + b * term
        term = term * (s + 2 * k + 1) * (s + 2 * k + 2) / (x * x)
    return total
