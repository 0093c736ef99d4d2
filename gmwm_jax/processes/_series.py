"""Functions whose textbook form cancels or divides by zero, with finite values and gradients everywhere.

Each decides on a threshold, feeds a harmless constant into the branch that is not taken (so that its derivative
stays finite), and sums a Taylor series in the other.
"""

import math
from collections.abc import Callable

import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

_THRESHOLD = 0.5
"""Below it the series; there the direct forms still have 14 digits."""


def series_or(
    x: Float[Array, "..."],
    coefficients: list[float],
    direct: Callable[[Float[Array, "..."]], Float[Array, "..."]],
    threshold: float = _THRESHOLD,
) -> Float[Array, "..."]:
    """The power series with these coefficients for |x| < threshold, direct(x) beyond."""
    small = jnp.abs(x) < threshold
    y = jnp.where(small, x, 0.0)
    series = jnp.full_like(y, coefficients[-1])
    for c in reversed(coefficients[:-1]):
        series = series * y + c
    return jnp.where(small, series, direct(jnp.where(small, threshold, x)))


def haar_exp(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """G(x) = (2x - 3 + 4 exp(-x) - exp(-2x)) / x^3, the Haar response to an exponential covariance; G(0) = 2/3.

    From sum_k (-1)^k (4 - 2^k) x^k / k!, which starts at k = 3.
    """
    series = [(-1) ** k * (4.0 - 2.0**k) / math.factorial(k) for k in range(3, 24)]
    return series_or(x, series, lambda y: (2 * y - 3 + 4 * jnp.exp(-y) - jnp.exp(-2 * y)) / (y * y * y))


def sinh_excess(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """exp(-x) (sinh x - x) / x^3 for x >= 0; 1/6 at 0, no overflow for large x."""
    # (1 - exp(-2x) - 2x exp(-x)) / (2 x^3) = sum_k (-1)^k (k - 2^(k-1)) / k! x^(k-3)
    series = [(-1) ** k * (k - 2.0 ** (k - 1)) / math.factorial(k) for k in range(3, 24)]
    return series_or(x, series, lambda y: (-jnp.expm1(-2 * y) / 2 - y * jnp.exp(-y)) / (y * y * y))


def exp_ratio(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """(1 - exp(-x)) / x; 1 at 0. (expm1 alone would keep the value, not the derivative.)"""
    series = [(-1) ** k / math.factorial(k + 1) for k in range(16)]
    return series_or(x, series, lambda y: -jnp.expm1(-y) / y)


def exp_cubic(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """(1 - exp(-x) - x + x^2/2) / x^3; 1/6 at 0."""
    series = [(-1) ** (k + 1) / math.factorial(k) for k in range(3, 19)]
    return series_or(x, series, lambda y: (-jnp.expm1(-y) - y + y * y / 2) / (y * y * y))


def exp_tail(order: int, x: Float[Array, "..."]) -> Float[Array, "..."]:
    """1 - exp(-x) (1 + x + .. + x^(order-1)/(order-1)!) for x >= 0, order <= 5: incomplete gamma, regularised."""
    # Taylor series of the integral of t^(order-1) exp(-t)/(order-1)! from 0 to x, divided by x^order
    first = math.factorial(order - 1)
    series = [(-1) ** k / (math.factorial(k) * (order + k) * first) for k in range(16)]

    def direct(y: Float[Array, "..."]) -> Float[Array, "..."]:
        head, term = jnp.ones_like(y), jnp.ones_like(y)
        for k in range(1, order):
            term = term * y / k
            head = head + term
        return (1 - jnp.exp(-y) * head) / y**order

    return x**order * series_or(x, series, direct)


def four_sinh_squared(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """4 sinh(sqrt(x)/2)^2 = 2 (cosh(sqrt(x)) - 1), an entire function of x."""
    series = [0.0] + [2 / math.factorial(2 * k) for k in range(1, 14)]
    return series_or(x, series, lambda y: 4 * jnp.sinh(jnp.sqrt(y) / 2) ** 2)


def sinh_ratio(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """sinh(sqrt(x)) / sqrt(x), an entire function of x; 1 at 0."""
    series = [1 / math.factorial(2 * k + 1) for k in range(14)]
    return series_or(x, series, lambda y: jnp.sinh(jnp.sqrt(y)) / jnp.sqrt(y))
