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
from jax import Array
from jaxtyping import Float

Points = Float[Array, "*P"]


def second_differences(
    K: Callable[[Any, Any], Any], lag: Points, parity: Points, n_j: Points, n_k: Points
) -> Float[Array, "*P"]:
    """sum_ab c_a c_b K(|m|, (-1)^m) / (tau_j tau_k) with m = lag - a n_j + b n_k."""
    terms = nine_terms(lag, parity, n_j, n_k)
    # mapped over the nine terms, K is traced and compiled once
    lags, parities = (jnp.stack([jnp.broadcast_to(t[i], lag.shape) for t in terms]) for i in (0, 1))
    weights = jnp.array([weight for *_, weight in terms])
    return jnp.tensordot(weights, jax.vmap(K)(lags, parities), axes=1) / (4 * n_j * n_k)


def nine_terms(lag: Points, parity: Points, n_j: Points, n_k: Points) -> list[tuple[Points, Points, float]]:
    """Lag |m|, parity (-1)^m and weight c_a c_b of the terms of a second difference in both coefficients."""
    # n = 2^(j-1) is odd only at level 1
    sign_j, sign_k = jnp.where(n_j == 1, -1.0, 1.0), jnp.where(n_k == 1, -1.0, 1.0)
    return [
        (
            jnp.abs(lag - a * n_j + b * n_k),
            parity * (sign_j if a == 1 else 1.0) * (sign_k if b == 1 else 1.0),
            c_a * c_b,
        )
        for a, c_a in enumerate((1.0, -2.0, 1.0))
        for b, c_b in enumerate((1.0, -2.0, 1.0))
    ]


def gap(lag: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """Samples between the two filters; negative where they overlap, and 0 where they touch."""
    return jnp.maximum(lag - 2 * n_j, -lag - 2 * n_k)


def where_filters_overlap(inside: Points, lag: Points, n_j: Points, n_k: Points) -> Float[Array, "*P"]:
    """The covariance of a process with independent increments: exactly zero where the filters do not overlap."""
    return jnp.where(gap(lag, n_j, n_k) < 1, inside, 0.0)
