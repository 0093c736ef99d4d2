"""Parametric bootstrap: how estimates scatter where the fitted model is the truth (Efron & Tibshirani 1993).

Two ways to the wavelet variance of a replicate. ``records`` simulates a record (from stationarity) and takes its
wavelet variance, leaving out the samples that are missing in the data. ``variances`` draws the wavelet variance itself,
from scaled chi-square margins with the mean and variance of theory, eta_j = 2 nu_j^2/V_jj degrees of freedom, joined by
a Gaussian copula with the correlations of V: it needs no record, and for a long one next to no time.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import gammaincinv, ndtr

from gmwm_jax._check import integer, require_x64, typed_key
from gmwm_jax._progress import progress_bar
from gmwm_jax._typing import PRNGKey
from gmwm_jax.pairs import find_pairs, gap_wavelet_variance
from gmwm_jax.refit import Refits, refit
from gmwm_jax.replicates import RECORDS, VARIANCES, Bootstrap
from gmwm_jax.result import Fit
from gmwm_jax.simulation import simulate_each
from gmwm_jax.wavelet_host import host_wavelet_variance
from gmwm_jax.weights import require_theory

_CHUNK = 64
"""Replicates refitted at once."""
_SAMPLES_AT_ONCE = 4_000_000
"""Of simulated records: 32 MB for each component of the model."""
_SMALLEST_SHAPE = 0.1
"""Half the degrees of freedom below which a chi-square variable is mostly zero."""


def bootstrap(
    fit: Fit,
    num_replicates: int = 500,
    *,
    key: PRNGKey,
    route: str = VARIANCES,
    progress: bool = False,
) -> Bootstrap:
    """Replicate a fit with its model as the truth.

    Parameters
    ----------
    fit
        A fit to a wavelet variance whose theory is known (MODWT, all scales, number of samples).
    num_replicates
        B.
    key
        ``jax.random.key(seed)``. Replicate b has a key of its own whatever B is.
    route
        ``variances`` draws wavelet variances from their theoretical distribution, ``records`` simulates records.
    progress
        Show a progress bar (needs the extra ``app``).

    Returns
    -------
    Bootstrap
        With fewer replicates than asked for if it was interrupted from the keyboard: what was done by then.

    Raises
    ------
    ValueError
        Another route; no theory; a model without any variance; records for a robust wavelet variance.
    TypeError
        The key is an integer or of the old kind.
    """
    require_x64()
    typed_key(key)
    num_replicates = integer("num_replicates", num_replicates, 1)
    if route not in (RECORDS, VARIANCES):
        raise ValueError(f'route is "{VARIANCES}" or "{RECORDS}", and is {route!r}.')
    num_samples = require_theory(fit.wv, "Replicates")
    if route == RECORDS and fit.wv.efficiency is not None:
        raise ValueError(f'A robust wavelet variance is replicated by route="{VARIANCES}", whose theory knows it.')
    if route == VARIANCES and fit.wv_covariance is None:
        raise ValueError(f'There is no theory of the scatter of {fit.model}: take route="{RECORDS}".')
    if np.any(fit.fitted <= 0):
        raise ValueError(f"{fit.model} has no variance at some scale: there is nothing to replicate.")
    keys = jax.vmap(lambda b: jax.random.fold_in(key, b))(jnp.arange(num_replicates, dtype=jnp.uint32))
    draw = _variances(fit) if route == VARIANCES else _records(fit, num_samples)
    done: list[tuple[np.ndarray, Refits]] = []
    bar = progress_bar(num_replicates, "replicate", progress)
    try:
        for first in range(0, num_replicates, _CHUNK):
            nu = draw(keys[first : first + _CHUNK])
            # by pairs a variance may be negative by chance: such a replicate is a failure
            good = np.all(nu > 0, axis=1)
            found = refit(fit, np.where(good[:, None], nu, fit.fitted), _CHUNK)
            done.append((nu, found._replace(converged=found.converged & good)))
            bar.update(len(nu))
    except KeyboardInterrupt:
        if not done:
            raise
    finally:
        bar.close()
    nu = np.concatenate([nu for nu, _ in done])
    refits = Refits(*(np.concatenate(leaves) for leaves in zip(*(r for _, r in done), strict=True)))
    return Bootstrap(fit, route, nu, *refits, num_requested=num_replicates)


def _variances(fit: Fit) -> Callable[[Any], np.ndarray]:
    """A function of keys that draws wavelet variances from their theoretical distribution."""
    V, nu = np.asarray(fit.wv_covariance), fit.fitted
    sd = np.sqrt(np.diag(V))
    # a symmetric root serves also where V is singular to rounding
    roots, vectors = np.linalg.eigh(V / np.outer(sd, sd))
    root = vectors * np.sqrt(np.maximum(roots, 0.0)) @ vectors.T
    shape = np.maximum(nu**2 / sd**2, _SMALLEST_SHAPE)

    def of_keys(keys: Any) -> np.ndarray:
        uniform = ndtr(np.asarray(_normal(keys, len(nu))) @ root)
        return nu * gammaincinv(shape, np.clip(uniform, 1e-15, 1 - 1e-15)) / shape

    return of_keys


@partial(jax.jit, static_argnums=1)
def _normal(keys: Any, num: int) -> Any:
    return jax.vmap(lambda key: jax.random.normal(key, (num,)))(keys)


def _records(fit: Fit, num_samples: int) -> Callable[[Any], np.ndarray]:
    """A function of keys that simulates records and takes their wavelet variances."""
    at_once = max(1, min(_CHUNK, _SAMPLES_AT_ONCE // num_samples))
    pairs = None if fit.wv.present is None else find_pairs(fit.wv.present, fit.wv.num_scales)

    some = max(1, at_once // 16)  # transforms take more memory than the records

    def variances_of(x: np.ndarray) -> list[np.ndarray]:
        if pairs is None:
            return [host_wavelet_variance(record, fit.wv.num_scales) for record in x]
        return [nu for first in range(0, len(x), some) for nu in gap_wavelet_variance(x[first : first + some], pairs)]

    def of_keys(keys: Any) -> np.ndarray:
        rows = []
        for first in range(0, len(keys), at_once):
            part = keys[first : first + at_once]
            # filled up: another size would compile again
            filled = part[jnp.minimum(jnp.arange(at_once), len(part) - 1)]
            x = np.asarray(simulate_each(fit.model, filled, num_samples))
            rows += variances_of(x[: len(part)])
        return np.stack(rows)

    return of_keys
