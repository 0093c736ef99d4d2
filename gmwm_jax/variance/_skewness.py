"""Skewness of the wavelet variance of a Gaussian process of known model, at each scale.

nu_j = W'W/M_j is a quadratic form: with C the covariance of the coefficients W_{j,t} and mu their mean,

    third cumulant = (8 tr C^3 + 24 mu' C^2 mu)/M^3,    variance = (2 tr C^2 + 4 mu' C mu)/M^2.

At the short spans of a long record nu_j is a sum of so many independent parts that a chi-square variable of the same
mean and variance has the skewness as well. At the longest ones, where a few eigenvalues of C dominate, C is smooth over
a record: the traces are integrals, taken with Gauss-Legendre nodes (Nystroem), or exact sums for short records.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from gmwm_jax.processes.base import Composite
from gmwm_jax.variance.haar import num_coefficients, scales

_NODES = 128
_LONG = 16
"""Spans in a record beyond which a scale counts as short: eight nodes a span at least."""


def wv_skewness(model: Composite, num_samples: int, V: Float[np.ndarray, "J J"]) -> Float[np.ndarray, " J"]:
    """Skewness of the Haar MODWT wavelet variance of a record of N samples.

    Parameters
    ----------
    model
        All parameters given.
    num_samples
        N.
    V
        Covariance of the wavelet variance under the model.
    """
    J = len(V)
    tau, M = scales(J), num_coefficients(num_samples, J)
    nu = np.asarray(model.wavelet_variance(tau))
    skewness = 2 * np.sqrt(np.diag(V)) / nu  # of a chi-square variable of shape nu^2/V
    few = np.flatnonzero(_LONG * tau >= M)
    if len(few):
        nodes, weights = zip(*(_rule(int(M[j])) for j in few), strict=True)
        third = np.asarray(_skewness(model, jnp.asarray(tau[few] / 2), jnp.stack(nodes), jnp.stack(weights)))
        skewness[few] = np.maximum(third, skewness[few])
    return skewness


def _rule(count: int) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
    """Times and weights of a sum over 0 .. count - 1, as shares of the whole; padded with weights of zero."""
    if count <= _NODES:
        return np.arange(_NODES, dtype=float), (np.arange(_NODES) < count) / count
    x, w = np.polynomial.legendre.leggauss(_NODES)
    return (x + 1) / 2 * count - 0.5, w / 2


@jax.jit
def _skewness(
    model: Composite, half: Float[Array, " S"], t: Float[Array, "S Q"], w: Float[Array, "S Q"]
) -> Float[Array, " S"]:
    def one(n: Array, t: Array, w: Array) -> Array:
        lag = jnp.abs(t[:, None] - t[None, :])
        shape = jnp.ones_like(lag)
        C, mu = jnp.zeros_like(lag), jnp.zeros(())
        for p in model.processes:
            C = C + p.amplitude * p.unit_haar_covariance(p.shape, lag, shape, n * shape, n * shape)
            mu = mu + jnp.sqrt(p.amplitude) * p.unit_haar_mean(n)
        root = jnp.sqrt(w)
        K = root[:, None] * C * root[None, :]
        v = mu * root
        K2, Kv = K @ K, K @ v
        variance = 2 * jnp.trace(K2) + 4 * v @ Kv
        return (8 * jnp.sum(K2 * K.T) + 24 * Kv @ Kv) / variance**1.5

    return jax.vmap(one)(half, t, w)
