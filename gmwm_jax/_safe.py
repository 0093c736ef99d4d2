"""Functions whose textbook form cancels or divides by zero, with finite values and gradients everywhere.

Each decides on a threshold, feeds a harmless constant into the branch that is not taken (so that its derivative
stays finite), and sums a Taylor series in the other.
"""

import math
from collections.abc import Callable

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float


def _series_or(
    x: Float[Array, "..."],
    coefficients: list[float],
    direct: Callable[[Float[Array, "..."]], Float[Array, "..."]],
    threshold: float,
) -> Float[Array, "..."]:
    """Horner's sum of `coefficients` for |x| < threshold, direct(x) beyond."""
    small = jnp.abs(x) < threshold
    x_small = jnp.where(small, x, 0.0)
    x_large = jnp.where(small, threshold, x)
    total = jnp.full_like(x_small, coefficients[-1])
    for c in reversed(coefficients[:-1]):
        total = total * x_small + c
    return jnp.where(small, total, direct(x_large))


def haar_exp(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """G(x) = (2x - 3 + 4 exp(-x) - exp(-2x)) / x^3, the Haar response to an exponential covariance; G(0) = 2/3.

    From sum_k (-1)^k (4 - 2^k) x^k / k!, which starts at k = 3.
    """
    series = [(-1) ** k * (4.0 - 2.0**k) / math.factorial(k) for k in range(3, 30)]
    return _series_or(x, series, lambda y: (2 * y - 3 + 4 * jnp.exp(-y) - jnp.exp(-2 * y)) / (y * y * y), threshold=1.0)


def sinh_excess(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """exp(-x) (sinh x - x) / x^3 for x >= 0; 1/6 at 0, no overflow for large x."""
    series = [1.0 / math.factorial(2 * k + 3) for k in range(12)]
    small = jnp.abs(x) < 1.0
    x_small = jnp.where(small, x, 0.0)
    x_large = jnp.where(small, 1.0, x)
    square = x_small * x_small
    total = jnp.full_like(square, series[-1])
    for c in reversed(series[:-1]):
        total = total * square + c
    direct = (-jnp.expm1(-2 * x_large) / 2 - x_large * jnp.exp(-x_large)) / (x_large * x_large * x_large)
    return jnp.where(small, jnp.exp(-x_small) * total, direct)


def exp_ratio(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """(1 - exp(-x)) / x; 1 at 0. (expm1 alone would keep the value, not the derivative.)"""
    series = [(-1) ** k / math.factorial(k + 1) for k in range(20)]
    return _series_or(x, series, lambda y: -jnp.expm1(-y) / y, threshold=1.0)


def exp_cubic(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """(1 - exp(-x) - x + x^2/2) / x^3; 1/6 at 0."""
    series = [(-1) ** (k + 1) / math.factorial(k) for k in range(3, 22)]
    return _series_or(x, series, lambda y: (-jnp.expm1(-y) - y + y * y / 2) / (y * y * y), threshold=1.0)
