"""What a joint fit of several records is: a fit whose data are their weighted mean, and each record's part in it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.checks import agreed_rate, confidence, require_x64, typed_key
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.estimator import fit_by_steps, fit_channels
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.result import Fit, Fits, Status
from gmwm_jax.fitting.standard_errors import parameter_covariance
from gmwm_jax.fitting.weights import AbstractWeights, Covariance, WeightsLike, as_weights
from gmwm_jax.multisignal._pool import Pool, as_records, pool, pooled, record_names
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.registry import as_model
from gmwm_jax.variance.wavelet import WaveletVariance


@dataclass(frozen=True, repr=False)
class JointFit(Fit):
    """One model fitted to several records of one channel (Bakalli et al. 2023).

    It is a `Fit` whose `wv` is the weighted mean nu_bar of the records and whose `omega` is the sum of their weights.
    Its intervals hold if all records have the same parameters; `resample_records` gives intervals that do not need
    that, `compare_records` and `near_stationarity` tell whether it is so.

    Attributes
    ----------
    objective
        The sum of the objectives of the records: what nu(theta) misses of their mean, and their scatter about it.
    records
        The joint model as a fit of each record: wavelet variance, weights, objective and residuals of its own.
    """

    records: tuple[Fit, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the records; their numbers from 1 where they have none."""
        return record_names([r.wv for r in self.records])

    @cached_property
    def pool(self) -> Pool:
        """The records and their weights on common scales."""
        return pool([r.wv for r in self.records], [r.omega for r in self.records])

    @cached_property
    def record_covariances(self) -> tuple[Float[np.ndarray, "_ _"], ...] | None:
        """Covariance of each record's wavelet variance under the joint model; None where one has no theory."""
        known: dict[Any, Any] = {}
        for r in self.records:
            length = r.wv.num_samples, r.wv.num_scales
            if length not in known:
                known[length] = r.wv_covariance
            if known[length] is None:
                return None
        return tuple(known[r.wv.num_samples, r.wv.num_scales] for r in self.records)

    @cached_property
    def wv_covariance(self) -> Float[np.ndarray, "J J"] | None:
        """Covariance of nu_bar, Omega^-1 (sum_i Omega_i V_i Omega_i) Omega^-1, if the records are independent."""
        if self.record_covariances is None:
            return None
        return _mean_covariance([r.omega for r in self.records], self.record_covariances, self.wv.num_scales)

    def weights_efficiency(self, omega: Any = None) -> Float[np.ndarray, " P"] | None:
        """Smallest variance that weights can give, over that with `omega`, of each active parameter; to first order.

        Parameters
        ----------
        omega
            One matrix a record, by default those of this fit.

        Returns
        -------
        Between 0 and 1; None where there is no theory of the wavelet variance.
        """
        covariances = self.record_covariances
        if covariances is None or not self.active:
            return None
        best = [Covariance().omega(r.wv, self.model, V) for r, V in zip(self.records, covariances, strict=True)]
        used = [r.omega for r in self.records] if omega is None else list(omega)
        return np.diag(self._sandwich(best, covariances)) / np.diag(self._sandwich(used, covariances))

    def _sandwich(self, omegas: Sequence[np.ndarray], covariances: Sequence[np.ndarray]) -> np.ndarray:
        J = self.wv.num_scales
        total = pool([r.wv for r in self.records], omegas).omegas.sum(axis=0)
        V = _mean_covariance(omegas, covariances, J)
        return np.asarray(parameter_covariance(self.model, self.active, self.wv.scales, np.linalg.cholesky(total).T, V))

    @cached_property
    def singles(self) -> tuple[Fit, ...]:
        """Each record fitted alone, with the weights that it has here; failures are told by their status.

        Components that all records together put at a boundary are held there: a record that gives white noise a
        little would give a fast Gauss-Markov process so much less, and could not be compared with the others.

        Raises
        ------
        ValueError
            A record has fewer scales than the model free parameters.
        """
        model = _unfitted(self)
        # one after the other: the compiled search of the joint fit serves all
        options: Any = {"rate": self.rate, "key": None, "level": self.level, "weights": self.weights}
        return tuple(fit_channels([r.wv], model, [r.omega], **options)[0] for r in self.records)

    def summary(self) -> str:
        """All of it as text."""
        wv = self.wv
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        lines = [
            f"{wv.estimator.title}GMWM fit of {' + '.join(self.model.labels)} to {len(self.records)} records of "
            f"{wv.channels[0]} [{self.unit}]{rate}",
            f"objective {self.objective:.8g} ({self.weights.name} weights) with {self.model.num_free} free parameters; "
            f"{self.status.value}; {100 * self.agreement:.0f} % of the descents came to this minimum",
            "",
            str(self.parameters()),
        ]
        if self.rate:
            lines += ["", str(self.continuous()), "", str(self.datasheet())]
        rows = [
            [name, str(r.wv.num_samples or "-"), str(r.wv.num_scales), number(r.objective)]
            for name, r in zip(self.names, self.records, strict=True)
        ]
        lines += ["", format_table(["record", "samples", "scales", "objective"], rows)]
        if self.wv_covariance is None:
            lines += ["", "No intervals: they need num_samples, the scales 2 .. 2^J, the MODWT, no SIN."]
        else:
            lines += ["", "Intervals are those of records that all have the same parameters."]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain numbers and texts, for JSON; ``variance`` is the weighted mean of the records."""
        records = [
            {
                "name": name,
                "num_samples": r.wv.num_samples,
                "objective": r.objective,
                "scales": r.wv.scales.tolist(),
                "variance": r.wv.variance.tolist(),
                "ci_low": r.wv.ci_low.tolist(),
                "ci_high": r.wv.ci_high.tolist(),
            }
            for name, r in zip(self.names, self.records, strict=True)
        ]
        return {**super().to_dict(), "records": records}


@dataclass(frozen=True, repr=False)
class JointFits(Fits):
    """The joint fits of one model to several channels, by name of the channel."""

    fits: tuple[JointFit, ...]


def one_channel(joint: Any, caller: str) -> JointFit:
    """Return a joint fit, or raise a TypeError that says how to come by one."""
    if isinstance(joint, JointFits):
        raise TypeError(f"{caller}() takes one channel, as in joint[{next(iter(joint))!r}].")
    if not isinstance(joint, JointFit):
        raise TypeError(f"{caller}() takes the result of fit_records(), not {type(joint).__name__}.")
    return joint


def _mean_covariance(
    omegas: Sequence[np.ndarray], covariances: Sequence[np.ndarray], J: int
) -> Float[np.ndarray, "J J"]:
    """Omega^-1 (sum_i Omega_i V_i Omega_i) Omega^-1 on J scales."""
    total, scatter = np.zeros((J, J)), np.zeros((J, J))
    for omega, V in zip(omegas, covariances, strict=True):
        own = slice(len(omega))
        total[own, own] += omega
        scatter[own, own] += omega @ V @ omega
    d = np.sqrt(np.diag(total))
    inverse = np.linalg.inv(total / np.outer(d, d))
    return (inverse @ (scatter / np.outer(d, d)) @ inverse) / np.outer(d, d)


def _unfitted(joint: JointFit) -> Composite:
    """The model with no values but those that are held, and those at which a component is at its boundary."""
    processes = []
    for label, p in zip(joint.model.labels, joint.model.processes, strict=True):
        outcome = joint.at_boundary.get(label)
        held = set(p.fixed) | {
            q.name for q in (p.parameters if outcome is Outcome.ZERO else p.parameters[:-1] if outcome else ())
        }
        values = zip(p.parameters, p.values, strict=True)
        build: Any = type(p)
        processes.append(build(**{q.name: Fixed(v) if q.name in held else None for q, v in values}))
    return Composite(processes)


def fit_records(
    data: Any,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
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
    weights
        As of `fit`, of each record under the joint fit; no array, since records differ in length. The default compares
        with R's mgmwm.

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
    weights = as_weights(weights)
    if not weights.of_any_length:
        raise ValueError("fit_records() takes weights by name or as an object: an array suits one record.")
    if weights.needs_theory:
        for wv in records:
            wv.require_theory(f'Weights "{weights.name}"')
    channels = [[wv[c] for wv in records] for c in range(len(records[0].channels))]

    def search(omegas: list[list[np.ndarray]], weights: AbstractWeights) -> list[Any]:
        return _joint_channels(channels, model, omegas, rate=rate, key=key, level=level, weights=weights)

    def omegas_of(weights: AbstractWeights, c: int, before: Any) -> list[Float[np.ndarray, "_ _"]]:
        if before is None:
            return [weights.omega(wv) for wv in channels[c]]
        if before.status is Status.non_finite:  # the weights that it had
            return [r.omega for r in before.records]
        covariances = before.record_covariances if weights.needs_theory else None
        covariances = [None] * len(records) if covariances is None else covariances
        return [weights.omega(wv, before.model, V) for wv, V in zip(channels[c], covariances, strict=True)]

    fits: list[JointFit] = fit_by_steps(weights, len(channels), omegas_of, search)  # type: ignore[assignment]
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
