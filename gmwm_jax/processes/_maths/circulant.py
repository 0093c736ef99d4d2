"""Exact draws of a stationary Gaussian process from its autocovariance alone, by circulant embedding."""

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

from gmwm_jax._internal.typing import PRNGKey


def draw_stationary(autocovariance: Float[Array, " N1"], key: PRNGKey) -> Float[Array, " N"]:
    """Draw N samples with the given autocovariance at the lags 0 .. N, in O(N log N).

    The covariance matrix of the samples is a corner of a circulant of size 2N, which the Fourier transform factorises
    (Davies & Harte 1987; Dietrich & Newsam 1997). Its eigenvalues are never negative if the autocovariance is negative
    at all lags but 0 (Craigmile 2003) or decreasing and convex, which is true of what is drawn here.

    Parameters
    ----------
    autocovariance
        gamma(0) .. gamma(N).
    key
        Of the random numbers.
    """
    num = autocovariance.shape[0] - 1
    eigenvalues = _eigenvalues(autocovariance)  # rounding may leave a zero slightly below
    positive = eigenvalues > 0
    root = jnp.where(positive, jnp.sqrt(jnp.where(positive, eigenvalues, 1.0)), 0.0)
    parts = jax.random.normal(key, (2, num + 1), dtype=jnp.float64)
    # frequencies 0 and N are real, the others have half their variance in each part
    ends = (jnp.arange(num + 1) == 0) | (jnp.arange(num + 1) == num)
    real = root * jnp.where(ends, parts[0], parts[0] / jnp.sqrt(2.0))
    imaginary = root * jnp.where(ends, 0.0, parts[1] / jnp.sqrt(2.0))
    return jnp.fft.irfft(jax.lax.complex(real, imaginary), n=2 * num)[:num] * jnp.sqrt(2.0 * num)


def negative_share(autocovariance: Float[Array, " N1"]) -> Float[Array, ""]:
    """What the negative eigenvalues of the circulant are of the positive ones: what `draw_stationary` leaves out.

    The first is that of the mean, which hides all others of a process that hardly moves.
    """
    eigenvalues = _eigenvalues(autocovariance)
    negative = jnp.sum(jnp.minimum(eigenvalues, 0.0))
    return -negative / jnp.sum(jnp.maximum(eigenvalues[1:], 0.0))


def _eigenvalues(autocovariance: Float[Array, " N1"]) -> Float[Array, " N1"]:
    """Of the even sequence gamma(0) .. gamma(N) gamma(N-1) .. gamma(1)."""
    return jnp.fft.rfft(jnp.concatenate([autocovariance, autocovariance[-2:0:-1]])).real
