"""Wavelet variances of records of a known model, drawn at random, in two ways.

`record_draws` simulates records (from stationarity) and takes their wavelet variances, leaving out the samples that are
missing in the data. `theory_draws` draws the wavelet variances themselves, from shifted and scaled chi-square margins
joined by a Gaussian copula with the correlations of theory: no record is needed, and for a long one next to no time.

A wavelet variance is a quadratic form of normal variables, sum_i lambda_i chi^2_1. The margins have its mean, its
variance and its skewness (Pearson 1959; Imhof 1961): with a shape k = 4/skewness^2 it is
nu + sd (g - k)/sqrt(k), g a gamma variable of shape k. The plain chi-square with eta = 2 nu^2/V_jj degrees of freedom,
without a shift, has lighter tails than the truth where a few lambda_i dominate, at the longest spans.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from jaxtyping import Float
from scipy.special import gammaincinv, ndtr

from gmwm_jax._internal.chunks import chunks
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.simulation import simulate_each
from gmwm_jax.variance.wavelet import WaveletVariance

_RECORDS = 64
"""Simulated at once, at most."""
_SAMPLES_AT_ONCE = 4_000_000
"""Of simulated records: 32 MB for each component of the model."""
_SMALLEST_SHAPE = 0.1
"""Half the degrees of freedom below which a chi-square variable is mostly zero."""


def theory_draws(model: Composite, wv: WaveletVariance, V: Float[np.ndarray, "J J"]) -> Callable[[Any], np.ndarray]:
    """A function of keys that draws wavelet variances of records like that of `wv` under a model of known V.

    The skewness is known for the classic wavelet variance of a complete record; others are drawn as chi-square.
    """
    skewness = None if wv.num_samples is None else wv.estimator.skewness(model, wv.num_samples, V)
    return variance_draws(np.asarray(model.wavelet_variance(wv.scales)), V, skewness)


def variance_draws(
    nu: Float[np.ndarray, " J"], V: Float[np.ndarray, "J J"], skewness: Float[np.ndarray, " J"] | None = None
) -> Callable[[Any], np.ndarray]:
    """A function of keys that draws wavelet variances, as the module says.

    Parameters
    ----------
    nu, V
        Mean and covariance.
    skewness
        Of each, see `gmwm_jax.variance._skewness`; by default that of a chi-square variable of this mean and variance.
    """
    sd = np.sqrt(np.diag(V))
    # a symmetric root serves also where V is singular to rounding
    roots, vectors = np.linalg.eigh(V / np.outer(sd, sd))
    root = vectors * np.sqrt(np.maximum(roots, 0.0)) @ vectors.T
    plain = nu**2 / sd**2
    # never less skew than the plain one: no variance would be negative
    shape = plain if skewness is None else np.minimum(plain, 4 / skewness**2)
    shape = np.maximum(shape, _SMALLEST_SHAPE)

    def of_keys(keys: Any) -> np.ndarray:
        uniform = ndtr(np.asarray(_normal(keys, len(nu))) @ root)
        g = gammaincinv(shape, np.clip(uniform, 1e-15, 1 - 1e-15))
        return np.maximum(nu + sd * (g - shape) / np.sqrt(shape), 0.0)

    return of_keys


@partial(jax.jit, static_argnums=1)
def _normal(keys: Any, num: int) -> Any:
    return jax.vmap(lambda key: jax.random.normal(key, (num,)))(keys)


def record_draws(model: Composite, wv: WaveletVariance) -> Callable[[Any], np.ndarray]:
    """A function of keys that simulates records like that of `wv` and takes their wavelet variances."""
    num_samples = wv.num_samples or 0
    at_once = max(1, min(_RECORDS, _SAMPLES_AT_ONCE // num_samples))
    variances_of = wv.estimator.of_records(wv.num_scales, wv.present)

    def of_keys(keys: Any) -> np.ndarray:
        rows = []
        for part, count in chunks(len(keys), at_once):
            x = np.asarray(simulate_each(model, keys[part], num_samples))
            rows.append(variances_of(x[:count]))
        return np.concatenate(rows)

    return of_keys
