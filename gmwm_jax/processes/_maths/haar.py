"""Covariances of Haar wavelet coefficients from the generalised covariance of the integrated process.

With Y_t the running sum of the process, the Haar MODWT coefficient of level j (half span n, span tau = 2n) is

    W_{j,t} = (Y_t - 2 Y_{t-n} + Y_{t-2n}) / tau,

a second difference of Y. Two of them remove polynomials up to degree 3 from a covariance, so all that matters of Y is
a *generalised* covariance K(m), defined up to such a polynomial: K(m) = -Var(Y_{t+m} - Y_t)/2 if the process is
stationary, and gamma2 (|m|^3 - |m|)/12 if it is a random walk. Hence, with c = (1, -2, 1),

    Cov(W_{j,t+h}, W_{k,t}) = sum_ab c_a c_b K(h - a n_j + b n_k) / (tau_j tau_k)

and the wavelet variance is (2 K(2n) - 8 K(n)) / tau^2 with K(0) = 0. (Matheron 1973 for generalised covariances.)
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

Points = Float[Array, "*P"]


def second_differences(
    K: Callable[[Any, Any], Any], lag: Points, parity: Points, n_j: Points, n_k: Points
) -> Float[Array, "*P"]:
    """sum_ab c_a c_b K(|m|, (-1)^m) / (tau_j tau_k) with m = lag - a n_j + b n_k."""
    lags, signs, weights = nine_terms(lag, parity, n_j, n_k)
    # mapped over the nine terms, K is traced and compiled once
    return jnp.tensordot(weights, jax.vmap(K)(lags, signs), axes=1) / (4 * n_j * n_k)


def nine_terms(
    lag: Points, parity: Points, n_j: Points, n_k: Points
) -> tuple[Float[Array, "9 *P"], Float[Array, "9 *P"], Float[Array, "9"]]:
    """Lags |m|, parities (-1)^m and weights c_a c_b of the terms of a second difference in both coefficients."""
    a, b = (np.reshape(x, (9, *(1,) * lag.ndim)) for x in np.indices((3, 3), dtype=float))
    lag, parity, n_j, n_k = (jnp.broadcast_to(x, lag.shape)[None] for x in (lag, parity, n_j, n_k))
    # n = 2^(j-1) is odd only at level 1
    signs = [jnp.where((x == 1) & (n == 1), -1.0, 1.0) for x, n in ((a, n_j), (b, n_k))]
    weights = np.outer((1.0, -2.0, 1.0), (1.0, -2.0, 1.0)).ravel()
    return jnp.abs(lag - a * n_j + b * n_k), parity * signs[0] * signs[1], jnp.asarray(weights)


def gap(lag: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """Samples between the two filters; negative where they overlap, and 0 where they touch."""
    return jnp.maximum(lag - 2 * n_j, -lag - 2 * n_k)


def where_filters_overlap(inside: Points, lag: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """The covariance of a process with independent increments: exactly zero where the filters do not overlap."""
    return jnp.where(gap(lag, n_j, n_k) < 1, inside, 0.0)
