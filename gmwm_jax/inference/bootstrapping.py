"""Parametric bootstrap: how estimates scatter where the fitted model is the truth (Efron & Tibshirani 1993).

The wavelet variances of the replicates are those of simulated records, or drawn from their distribution, see
`gmwm_jax.variance.replicates`.
"""

import jax
import jax.numpy as jnp
import numpy as np

from gmwm_jax._internal.checks import integer, require_x64, typed_key
from gmwm_jax._internal.progress import progress_bar
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.refit import Refits, refit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.weights import require_theory
from gmwm_jax.inference.replicates import RECORDS, VARIANCES, Bootstrap
from gmwm_jax.variance.replicates import record_draws, theory_draws

_CHUNK = 64
"""Replicates refitted at once."""


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
    require_theory(fit.wv, "Replicates")
    if route == RECORDS and fit.wv.efficiency is not None:
        raise ValueError(f'A robust wavelet variance is replicated by route="{VARIANCES}", whose theory knows it.')
    if route == VARIANCES and fit.wv_covariance is None:
        raise ValueError(f'There is no theory of the scatter of {fit.model}: take route="{RECORDS}".')
    if np.any(fit.fitted <= 0):
        raise ValueError(f"{fit.model} has no variance at some scale: there is nothing to replicate.")
    keys = jax.vmap(lambda b: jax.random.fold_in(key, b))(jnp.arange(num_replicates, dtype=jnp.uint32))
    if route == VARIANCES:
        draw = theory_draws(fit.model, fit.wv, np.asarray(fit.wv_covariance))
    else:
        draw = record_draws(fit.model, fit.wv)
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
