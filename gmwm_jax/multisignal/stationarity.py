"""Do all records have the parameters of the joint fit? The objective against that of records that do.

Records are drawn with the joint model as the truth of every one, and fitted jointly again; the p-value is the share of
objectives that are at least the observed one (Bakalli et al. 2023). It is small where parameters change from record to
record ("near-stationary" records, each stationary by itself), and also where the model is wrong for all of them:
`compare_records` and `goodness_of_fit` tell these apart.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from gmwm_jax._internal.checks import integer, require_x64, typed_key
from gmwm_jax._internal.chunks import numbered_keys, replicate_p_value, replicates_done, stream_keys, until_interrupted
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.progress import Progress
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.inference.bootstrapping import CHUNK, RECORDS, VARIANCES
from gmwm_jax.multisignal._pool import Pool
from gmwm_jax.multisignal._refit import joint_refit
from gmwm_jax.multisignal.joint import JointFit, one_channel
from gmwm_jax.variance.replicates import record_draws, theory_draws


@saved(not_finite=("objective",))
@dataclass(frozen=True, repr=False)
class NearStationarity(Drawable, Saved):
    """The result of `near_stationarity`: the test, and what it is made of.

    Attributes
    ----------
    joint
        The fit of all records.
    route
        ``variances`` or ``records``.
    objective
        Joint objective of each of B sets of records drawn with the same parameters, shape (B,).
    converged
        Which searches converged; the others count as failures and enter nothing.
    num_requested
        More than B if it was interrupted.
    """

    joint: JointFit
    route: str
    objective: Float[np.ndarray, " B"]
    converged: Bool[np.ndarray, " B"]
    num_requested: int

    @property
    def p_value(self) -> float:
        """Share of objectives, that of the data counted in, which are at least that of the data."""
        return replicate_p_value(self.joint.objective, self.objective[self.converged])

    @property
    def num_failed(self) -> int:
        """Replicates whose search did not converge."""
        return int((~self.converged).sum())

    def __repr__(self) -> str:
        """The test in words."""
        done = replicates_done(len(self.objective), self.num_requested, self.num_failed, self.route)
        good = self.objective[self.converged]
        usual = f"{np.median(good):.4g} (median), {np.quantile(good, 0.95):.4g} (95 %)" if len(good) else "unknown"
        return (
            f"Near-stationarity of {len(self.joint.records)} records of {self.joint.wv.channels[0]} under "
            f"{' + '.join(self.joint.model.labels)}: {done}\n"
            f"objective {self.joint.objective:.6g}; of records with the same parameters {usual}; "
            f"p = {self.p_value:.3g}\n"
            "A small p: parameters change from record to record, or the model is wrong."
        )


def near_stationarity(
    joint: JointFit,
    num_replicates: int = 500,
    *,
    key: PRNGKey,
    route: str = VARIANCES,
    progress: Progress = False,
) -> NearStationarity:
    """Test whether all records have the same parameters, by replicates of records that do.

    Parameters
    ----------
    joint
        Of one channel, from `fit_records`, of records whose theory is known.
    num_replicates
        B.
    key
        ``jax.random.key(seed)``. Every record of every replicate has a key of its own, whatever B is.
    route
        ``variances`` draws wavelet variances from their theoretical distribution, ``records`` simulates records.
    progress
        Show a bar (needs the extra ``app``); or a function of what is done and the total, which may cancel by
        raising.

    Returns
    -------
    NearStationarity
        With fewer replicates than asked for if it was interrupted from the keyboard: what was done by then.

    Raises
    ------
    ValueError
        Another route; a record without theory of its wavelet variance; a model without any variance; simulated records
        for robust wavelet variances.
    TypeError
        Several channels, or no joint fit; the key is an integer or of the old kind.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> test = gj.multisignal.near_stationarity(joint, 20, key=jax.random.key(0))
    >>> 0 < test.p_value <= 1
    True
    """
    require_x64()
    typed_key(key)
    joint = one_channel(joint, "near_stationarity")
    num_replicates = integer("num_replicates", num_replicates, 1)
    # its key, and a chunk of variances of each record; the objectives are few
    most = FLOAT * (4 * num_replicates + CHUNK * len(joint.records) * joint.wv.num_scales)
    require_memory(most, f"{num_replicates} replicates", "ask for fewer (num_replicates)")
    draws = _draws(joint, route)
    keys = numbered_keys(key, range(num_replicates))
    done: list[tuple[np.ndarray, np.ndarray]] = []
    with until_interrupted(done, num_replicates, "replicate", progress) as bar:
        for first in range(0, num_replicates, CHUNK):
            own = keys[first : first + CHUNK]
            variances = np.zeros((len(own), len(draws), joint.wv.num_scales))
            for i, draw in enumerate(draws):
                nu = draw(stream_keys(own, i))
                variances[:, i, : nu.shape[1]] = nu
            done.append(_objectives(joint, variances))
            bar.update(len(own))
    objective, converged = (np.concatenate(leaves) for leaves in zip(*done, strict=True))
    return NearStationarity(joint, route, objective, converged, num_replicates)


def _draws(joint: JointFit, route: str) -> list[Callable[[Any], np.ndarray]]:
    """For each record, a function of keys that draws wavelet variances under the joint model."""
    if route not in (RECORDS, VARIANCES):
        raise ValueError(f'route is "{VARIANCES}" or "{RECORDS}", and is {route!r}.')
    for name, r in zip(joint.names, joint.records, strict=True):
        r.wv.require_theory(f"Replicates (record {name})")
    if np.any(joint.fit.fitted <= 0):
        raise ValueError(f"{joint.model} has no variance at some scale: there is nothing to replicate.")
    if route == RECORDS:
        if not all(r.wv.estimator.replicates_records for r in joint.records):
            raise ValueError(f'A robust wavelet variance is replicated by route="{VARIANCES}", whose theory knows it.')
        return [record_draws(joint.model, r.wv) for r in joint.records]
    if joint.record_covariances is None:
        raise ValueError(f'There is no theory of the scatter of {joint.model}: take route="{RECORDS}".')
    return [theory_draws(joint.model, r.wv, V) for r, V in zip(joint.records, joint.record_covariances, strict=True)]


def _objectives(joint: JointFit, variances: Float[np.ndarray, "B R J"]) -> tuple[np.ndarray, np.ndarray]:
    """Joint objectives of replicates with weights of the kind of the fit, and which searches converged.

    Default weights are those of each replicate's own intervals, two-step weights those under its own first fit. Weights
    from a covariance are those of the fit: to first order that makes no difference.
    """
    width = np.full(variances.shape[1:], np.inf)  # no weight where a record has no such scale
    for i, r in enumerate(joint.records):
        width[i, : r.wv.num_scales] = (r.wv.ci_high - r.wv.ci_low) / r.wv.variance
    there = np.isfinite(width)

    def diagonal(nu: np.ndarray) -> np.ndarray:
        weight = 1 / (width * np.where(there, nu, 1.0)) ** 2
        return weight[:, :, :, None] * np.eye(weight.shape[2])

    steps = joint.weights.of_replicates
    if not steps:
        both = Pool(variances, np.broadcast_to(joint.pool.omegas, (len(variances), *joint.pool.omegas.shape)))
        found = joint_refit(joint, both.omegas.sum(axis=1), both.moments.sum(axis=1))
    fitted = variances
    for in_width in steps:
        both = Pool(variances, diagonal(in_width(variances, fitted)))
        found = joint_refit(joint, both.omegas.sum(axis=1), both.moments.sum(axis=1))
        # without any variance at a scale there is no second step
        some = np.all(found.fitted > 0, axis=1)[:, None, None]
        fitted = np.where(some, found.fitted[:, None, :], variances)
    return both.objectives(found.fitted).sum(axis=1), found.converged
