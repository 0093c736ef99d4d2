"""What a joint fit of several records is: a fit whose data are their weighted mean, and each record's part in it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import agreed_rate, confidence, require_x64, typed_key
from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.labelled import Arrays, Labelled, Values
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.estimator import fit_by_steps, fit_channels
from gmwm_jax.fitting.outcome import Outcome
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.standard_errors import parameter_covariance
from gmwm_jax.fitting.tables import EstimateTable
from gmwm_jax.fitting.weights import AbstractWeights, Covariance, WeightsLike, as_weights
from gmwm_jax.multisignal._pool import (
    Pool,
    as_records,
    covariances_of,
    mean_covariance,
    mean_of,
    pool,
    pooled,
    record_names,
)
from gmwm_jax.processes.base import AbstractProcess, Composite
from gmwm_jax.processes.parameter import Fixed
from gmwm_jax.processes.registry import as_model
from gmwm_jax.recordings.recording import Recording
from gmwm_jax.variance.wavelet import WaveletVariance, WaveletVariances

if TYPE_CHECKING:
    import pandas


@saved()
@dataclass(frozen=True, repr=False)
class JointFit(Drawable, Saved, Labelled):
    """One model fitted to several records of one channel (Bakalli et al. 2023).

    Its intervals hold if all records have the same parameters; `resample_records` gives intervals that do not need
    that, `compare_records` and `near_stationarity` tell whether it is so.

    Attributes
    ----------
    fit
        The fit to the weighted mean nu_bar of the records, with the sum of their weights as its `omega`; its tables,
        intervals and figures are those of the joint estimate.
    records
        The joint model as a fit of each record: wavelet variance, weights, objective and residuals of its own.
    """

    fit: Fit
    records: tuple[Fit, ...]

    @property
    def model(self) -> Composite:
        """The estimated model."""
        return self.fit.model

    @property
    def wv(self) -> WaveletVariance:
        """The weighted mean of the records."""
        return self.fit.wv

    @property
    def weights(self) -> AbstractWeights:
        """Of every record."""
        return self.fit.weights

    @property
    def status(self) -> Status:
        """How the search ended."""
        return self.fit.status

    @property
    def rate(self) -> float | None:
        """Hz, None if unknown."""
        return self.fit.rate

    @property
    def level(self) -> float:
        """Confidence of the intervals."""
        return self.fit.level

    @property
    def at_boundary(self) -> Mapping[str, Outcome]:
        """What became of components that are at a boundary, see `Fit`."""
        return self.fit.at_boundary

    @property
    def reduced(self) -> Composite:
        """The model that the data show, see `Fit.reduced`."""
        return self.fit.reduced

    @cached_property
    def objective(self) -> float:
        """The sum of the objectives of the records: what nu(theta) misses of their mean, and their scatter about it."""
        return float(np.sum([r.objective for r in self.records]))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the records; their numbers from 1 where they have none."""
        return record_names([r.wv for r in self.records])

    @cached_property
    def pool(self) -> Pool:
        """The records and their weights on common scales."""
        return pool([r.wv for r in self.records], [r.omega for r in self.records])

    @cached_property
    def record_covariances(self) -> tuple[Float[np.ndarray, "_ _"], ...] | None:
        """Covariance of each record's wavelet variance under the joint model; None where one has no theory."""
        return covariances_of([r.wv for r in self.records], self.model)

    def weights_efficiency(self, omegas: Sequence[np.ndarray] | None = None) -> Float[np.ndarray, " P"] | None:
        """Smallest variance that weights can give, over that with `omegas`, of each active parameter; to first order.

        Parameters
        ----------
        omegas
            One matrix a record, by default those of this fit.

        Returns
        -------
        Between 0 and 1; None where there is no theory of the wavelet variance.
        """
        covariances = self.record_covariances
        if covariances is None or not self.fit.active:
            return None
        best = [Covariance().omega(r.wv, self.model, V) for r, V in zip(self.records, covariances, strict=True)]
        used = [r.omega for r in self.records] if omegas is None else list(omegas)
        return np.diag(self._sandwich(best, covariances)) / np.diag(self._sandwich(used, covariances))

    def _sandwich(self, omegas: Sequence[np.ndarray], covariances: Sequence[np.ndarray]) -> np.ndarray:
        total = pool([r.wv for r in self.records], omegas).omegas.sum(axis=0)
        V = mean_covariance(omegas, covariances, self.wv.num_scales)
        whitener = np.linalg.cholesky(total).T
        return np.asarray(parameter_covariance(self.model, self.fit.active, self.wv.scales, whitener, V))

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

    def parameters(self) -> EstimateTable:
        """The parameters per sample, see `Fit.parameters`."""
        return self.fit.parameters()

    def continuous(self, rate: float | None = None) -> EstimateTable:
        """What a Kalman filter wants, see `Fit.continuous`."""
        return self.fit.continuous(rate)

    def datasheet(self, rate: float | None = None) -> EstimateTable:
        """The same in the units of datasheets, see `Fit.datasheet`."""
        return self.fit.datasheet(rate)

    def __repr__(self) -> str:
        return self.summary()

    @classmethod
    def table_of(cls, joints: Sequence["JointFit"], /) -> str:
        """Joint fits of several channels as text: objective, status and the parameters per sample of each."""
        return Fit.table_of([replace(j.fit, objective=j.objective) for j in joints])

    @classmethod
    def export_of(cls, joints: Sequence["JointFit"], /, format: str, **options: Any) -> str:
        """The noise of several channels in the format of another filter, see `Fit.export_of`."""
        return Fit.export_of([j.fit for j in joints], format, **options)

    def summary(self) -> str:
        """All of it as text."""
        wv = self.wv
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        lines = [
            f"{wv.estimator.title}GMWM fit of {' + '.join(self.model.labels)} to {len(self.records)} records of "
            f"{wv.channels[0]} [{self.fit.unit}]{rate}",
            f"objective {self.objective:.8g} ({self.weights.name} weights) with {self.model.num_free} free parameters; "
            f"{self.fit.search}",
            *(line.replace("test of fit:", "test of fit of their mean:", 1) for line in self.fit.verdict),
            "",
            str(self.parameters()),
        ]
        if self.rate:
            lines += ["", str(self.continuous()), "", str(self.datasheet()), "", str(self.fit.white_and_bias())]
        rows = [
            [name, str(r.wv.num_samples or "-"), str(r.wv.num_scales), number(r.objective)]
            for name, r in zip(self.names, self.records, strict=True)
        ]
        lines += ["", format_table(["record", "samples", "scales", "objective"], rows)]
        if self.fit.wv_covariance is None:
            lines += ["", "No intervals: they need num_samples, the scales 2 .. 2^J, the MODWT, no SIN."]
        else:
            lines += ["", "Intervals are those of records that all have the same parameters."]
        return "\n".join(lines)

    def to_pandas(self) -> "pandas.DataFrame":
        """A row an estimate, see `Fit.to_pandas`."""
        return self.fit.to_pandas()

    def _arrays(self) -> Arrays:
        """Those of the fit, and the wavelet variance of each record: NaN at scales that it does not have."""
        joint = self.fit._arrays()
        of_records = np.full((len(self.records), self.wv.num_scales), np.nan)
        for row, r in zip(of_records, self.records, strict=True):
            row[: r.wv.num_scales] = r.wv.variance
        variables = {
            "record_variance": Values(("record", "scale"), of_records, joint.variables["variance"].unit),
            "record_objective": Values("record", [r.objective for r in self.records]),
        }
        variables["objective"] = Values((), self.objective)
        coordinates = {**joint.coordinates, "record": Values("record", self.names)}
        return joint._replace(variables={**joint.variables, **variables}, coordinates=coordinates)

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
        return {**self.fit.to_dict(), "objective": self.objective, "records": records}


def one_channel(joint: Any, caller: str) -> JointFit:
    """Return a joint fit, or raise a TypeError that says how to come by one."""
    if isinstance(joint, Channels):
        raise TypeError(f"{caller}() takes one channel, as in joint[{next(iter(joint))!r}].")
    if not isinstance(joint, JointFit):
        raise TypeError(f"{caller}() takes the result of fit_records(), not {type(joint).__name__}.")
    return joint


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


@overload
def fit_records(
    data: Sequence[WaveletVariance],
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> JointFit: ...
@overload
def fit_records(
    data: Sequence[WaveletVariances],
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> Channels[JointFit]: ...
@overload
def fit_records(
    data: Sequence[WaveletVariance | WaveletVariances] | Sequence[Recording],
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> JointFit | Channels[JointFit]: ...
def fit_records(
    data: Any,
    model: str | AbstractProcess | Composite,
    *,
    rate: float | None = None,
    weights: WeightsLike = None,
    key: PRNGKey | None = None,
    level: float = 0.95,
    throw: bool = True,
) -> JointFit | Channels[JointFit]:
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
    JointFit for one channel, `Channels` of them by name for several.

    Raises
    ------
    ValueError
        Records that do not belong together (see `gmwm_jax.multisignal._pool.as_records`); what `fit` raises.
    RuntimeError
        x64 is off, or (with `throw`) a search that did not converge.
    TypeError
        A single record, or data, model or key of another kind.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> joint.model.labels
    ('WN', 'RW')
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

    def search(omegas: list[list[np.ndarray]], weights: AbstractWeights) -> list[Fit]:
        means = [pooled(wvs, own) for wvs, own in zip(channels, omegas, strict=True)]
        options: Any = {"rate": rate, "key": key, "level": level, "weights": weights}
        return fit_channels([wv for wv, _ in means], model, [omega for _, omega in means], **options)

    def omegas_of(weights: AbstractWeights, c: int, before: Fit | None) -> list[Float[np.ndarray, "_ _"]]:
        if before is None:
            return [weights.omega(wv) for wv in channels[c]]
        if before.status is Status.non_finite:  # the weights that it had
            return list(mean_of(before.wv).omegas)
        known = covariances_of(channels[c], before.model) if weights.needs_theory else None
        covariances = [None] * len(records) if known is None else known
        return [weights.omega(wv, before.model, V) for wv, V in zip(channels[c], covariances, strict=True)]

    fits = fit_by_steps(weights, len(channels), omegas_of, search)
    if throw:
        for f in fits:
            if f.status is not Status.converged:
                raise RuntimeError(f"{f.wv.channels[0]}: {f.status.value}. throw=False returns the fit as it is.")
    joints = [_joint(f) for f in fits]
    return joints[0] if isinstance(records[0], WaveletVariance) else Channels.of(records[0].channels, joints)


def _joint(fit: Fit) -> JointFit:
    """The fit of a mean as that of its records."""
    mean = mean_of(fit.wv)
    parts = pool(mean.records, mean.omegas).objectives(fit.fitted[None])[0]
    records = zip(mean.records, mean.omegas, parts, strict=True)
    return JointFit(fit, tuple(replace(fit, wv=wv, omega=omega, objective=float(q)) for wv, omega, q in records))
