"""`fit_records`: from several records of one sensor and a model to the joint estimate, all channels at once."""

from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate, confidence, require_x64, typed_key
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.estimator import fit_channels, require_fittable
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.weights import (
    COVARIANCE,
    DEFAULT,
    TWO_STEP,
    covariance_weights,
    default_weights,
    require_theory,
    two_step_weights,
)
from gmwm_jax.multisignal._pool import Pool, as_records, pool, pooled
from gmwm_jax.multisignal.joint import JointFit, JointFits
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import WaveletVariance


def fit_records(
    data: Any,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    omega: str | None = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Any:
    """Fit one model to several records of a sensor: replicates of a calibration, or units of a series.

    The estimate minimises sum_i (nu_i - nu(theta))' Omega_i (nu_i - nu(theta)) over all records i (Bakalli, Radi,
    Nassar, Guerrier, Zhang & Molinari 2023), globally and exactly as `fit` does for one.

    Parameters
    ----------
    data
        A list of wavelet variances or recordings: the same channels, units and rate, lengths as they are. A short
        record says nothing on scales that it does not have.
    model, rate, key, level, throw
        As of `fit`.
    omega
        Weights: None for 1/(ci_high - ci_low)^2 of each record, so that objectives compare with R's mgmwm;
        ``"two-step"`` for the same with the variance of the joint first fit in place of the measured ones, which takes
        out a bias; ``"covariance"`` for the inverse of the whole covariance of each under that two-step fit.

    Returns
    -------
    JointFit for one channel, JointFits for several.

    Raises
    ------
    ValueError
        Records that do not belong together (see `gmwm_jax.multisignal._pool.as_records`); what `fit` raises.
    RuntimeError
        x64 is off, or (with `throw`) a search that did not converge.
    TypeError
        A single record, or data, model or key of another kind.
    """
    require_x64()
    if key is not None:
        typed_key(key)
    level = confidence(level)
    model = as_model(model)
    records = as_records(data, "fit_records")
    rate = agreed_rate(records[0].rate, rate)
    require_fittable(model, max(records, key=lambda wv: wv.num_scales))
    if omega not in (None, TWO_STEP, COVARIANCE):
        raise ValueError(f'omega must be None, "{TWO_STEP}" or "{COVARIANCE}", and is {omega!r}.')
    if omega == COVARIANCE:
        for wv in records:
            require_theory(wv, f'Weights "{omega}"')
    channels = [[wv[c] for wv in records] for c in range(len(records[0].channels))]
    search = partial(
        _joint_channels, channels, model, rate=rate, key=key, level=level, weights=DEFAULT if omega is None else omega
    )
    fits = search([[default_weights(wv) for wv in channel] for channel in channels])
    if omega is not None:
        fits = search([_two_step(f) for f in fits])
    if omega == COVARIANCE:
        fits = search([_inverse_covariances(f) for f in fits])
    if throw:
        for f in fits:
            if f.status is not Status.converged:
                raise RuntimeError(f"{f.wv.channels[0]}: {f.status.value}. throw=False returns the fit as it is.")
    return fits[0] if records[0].is_single else JointFits(tuple(fits))


def _joint_channels(
    channels: list[list[WaveletVariance]],
    model: Composite,
    omegas: list[list[Float[np.ndarray, "_ _"]]],
    **options: Any,
) -> list[JointFit]:
    """Fit all channels, each with the weights of its records, in one compiled call."""
    pools = [pool(wvs, own) for wvs, own in zip(channels, omegas, strict=True)]
    means = [pooled(wvs, both) for wvs, both in zip(channels, pools, strict=True)]
    fits = fit_channels([wv for wv, _ in means], model, [o for _, o in means], **options)
    return [_joint(f, wvs, own, both) for f, wvs, own, both in zip(fits, channels, omegas, pools, strict=True)]


def _joint(fit: Fit, wvs: list[WaveletVariance], omegas: list[np.ndarray], both: Pool) -> JointFit:
    """The fit of a mean as that of its records."""
    parts = both.objectives(fit.fitted[None])[0]
    records = tuple(
        replace(fit, wv=wv, omega=omega, objective=float(q)) for wv, omega, q in zip(wvs, omegas, parts, strict=True)
    )
    known = {f.name: getattr(fit, f.name) for f in fields(Fit)}
    return JointFit(**{**known, "objective": float(parts.sum())}, records=records)


def _two_step(joint: JointFit) -> list[Float[np.ndarray, "_ _"]]:
    """Two-step weights of each record under the joint fit; those it had if there is none."""
    if joint.status is Status.non_finite:
        return [r.omega for r in joint.records]
    return [two_step_weights(joint.model, r.wv) for r in joint.records]


def _inverse_covariances(joint: JointFit) -> list[Float[np.ndarray, "_ _"]]:
    """Weights of each record from its covariance under the joint fit; those it had if there is none."""
    if joint.status is Status.non_finite:
        return [r.omega for r in joint.records]
    if joint.record_covariances is None:
        raise ValueError(f"There is no theory of the scatter of {joint.model}: take other weights.")
    return [covariance_weights(joint.model, V) for V in joint.record_covariances]
