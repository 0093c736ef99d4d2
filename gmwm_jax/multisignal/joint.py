"""What a joint fit of several records is: a fit whose data are their weighted mean, and each record's part in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.estimator import fit_channels, require_fittable
from gmwm_jax.fitting.result import Fit, Fits
from gmwm_jax.fitting.standard_errors import parameter_covariance
from gmwm_jax.fitting.tables import ZERO
from gmwm_jax.fitting.weights import covariance_weights
from gmwm_jax.multisignal._pool import Pool, pool, record_names
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.parameter import Fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        best = [covariance_weights(self.model, V) for V in covariances]
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
        for r in self.records:
            require_fittable(model, r.wv)
        # one after the other: the compiled search of the joint fit serves all
        options: Any = {"rate": self.rate, "key": None, "level": self.level, "weights": self.weights}
        return tuple(fit_channels([r.wv], model, [r.omega], **options)[0] for r in self.records)

    def summary(self) -> str:
        """All of it as text."""
        wv, robust = self.wv, f"Robust (efficiency {self.wv.efficiency:g}) " if self.wv.efficiency else ""
        rate = f" at {self.rate:g} Hz" if self.rate else ""
        lines = [
            f"{robust}GMWM fit of {' + '.join(self.model.labels)} to {len(self.records)} records of "
            f"{wv.channels[0]} [{self.unit}]{rate}",
            f"objective {self.objective:.8g} ({self.weights} weights) with {self.model.num_free} free parameters; "
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

    def plot(self, **options: Any) -> "Figure":
        """All records with the joint fit and the single ones, see `gmwm_jax.plotting.multisignal.plot_joint_fit`."""
        from gmwm_jax.plotting.multisignal import plot_joint_fit

        return plot_joint_fit(self, **options)


@dataclass(frozen=True, repr=False)
class JointFits(Fits):
    """The joint fits of one model to several channels, by name of the channel."""

    fits: tuple[JointFit, ...]

    def plot(self, **options: Any) -> "Figure":
        """A panel a channel, see `gmwm_jax.plotting.multisignal.plot_joint_fits`."""
        from gmwm_jax.plotting.multisignal import plot_joint_fits

        return plot_joint_fits(self, **options)


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
        note = joint.at_boundary.get(label, "")
        held = set(p.fixed) | {q.name for q in (p.parameters if note == ZERO else p.parameters[:-1] if note else ())}
        values = zip(p.parameters, p.values, strict=True)
        build: Any = type(p)
        processes.append(build(**{q.name: Fixed(v) if q.name in held else None for q, v in values}))
    return Composite(processes)
