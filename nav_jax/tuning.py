"""Noise parameters from recorded navigation data: those under which the innovations of the filter are most likely.

Parameters are sought on the real line (logarithms) by a trust-region Newton method that takes the expected information
for the second derivative (scoring), in coordinates in which it is the unit matrix at the start. What the record does
not determine is found before the search, held at its start, and marked.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import minimize

from nav_jax._check import number as check_number
from nav_jax._distributions import normal_quantile
from nav_jax._table import format_table, number
from nav_jax.earth import FlatEarth
from nav_jax.initial import InitialUncertainty
from nav_jax.likelihood import Model, Record, loss_and_slopes
from nav_jax.measurements._base import AbstractAiding
from nav_jax.navigate import Fixes, prepare_navigation
from nav_jax.noise import ImuErrors
from nav_jax.parameters import AidingLines, ErrorLines
from nav_jax.sensors import Imu

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNOBSERVABLE = 1.0
"""Standard error of a logarithm above which a record says nothing of a parameter: a factor of e either way."""

_SLOPE = 1e-3
"""In standard errors of the parameters at the start: how far from the minimum the search may end."""
_STEP = 1e-3
"""Of logarithms, for second derivatives: the error is of its square."""
_WEAKEST = 1e-12
"""Of the eigenvalues of a matrix of correlations: less is rounding."""


@dataclass(frozen=True, eq=False, repr=False)
class Tuning:
    """Noise parameters that a recorded run makes most likely.

    Attributes
    ----------
    errors
        The tuned model.
    aiding
        The sensors, with the standard deviations that were found if they were sought.
    names
        Of P parameters.
    start, value
        Before and after, per sample (factors for aiding sensors), shape (P,).
    se
        Standard errors on the real line (of logarithms; of the logit of a phi), NaN where unobservable.
    ci_low, ci_high
        Limits of the intervals, NaN where unobservable.
    observable
        Whether the record determines the parameter; the others were held at their start.
    held
        Names that were not sought because it was asked for.
    loss_start, loss
        Minus the logarithm of the likelihood, less a constant.
    num_innovations
        Scalars that entered it.
    converged
        Whether the search came to its end.
    level
        Confidence of the intervals.
    """

    errors: ImuErrors
    aiding: tuple[AbstractAiding, ...]
    names: tuple[str, ...]
    start: Float64[np.ndarray, " P"]
    value: Float64[np.ndarray, " P"]
    se: Float64[np.ndarray, " P"]
    ci_low: Float64[np.ndarray, " P"]
    ci_high: Float64[np.ndarray, " P"]
    observable: Bool[np.ndarray, " P"]
    held: tuple[str, ...]
    loss_start: float
    loss: float
    num_innovations: int
    converged: bool
    level: float

    def table(self) -> str:
        """Each parameter before and after, with its interval."""
        p = f"{100 * self.level:g} %"
        head = ["parameter", "start", "tuned", f"{p} low", f"{p} high", "se (log)", ""]
        rows = [
            [name, *(number(float(x), 4) for x in row), self._remark(name, bool(seen))]
            for name, seen, *row in zip(
                self.names, self.observable, self.start, self.value, self.ci_low, self.ci_high, self.se, strict=True
            )
        ]
        return format_table(head, rows)

    def _remark(self, name: str, seen: bool) -> str:
        if name in self.held:
            return "held"
        return "" if seen else "not observable: held"

    def __repr__(self) -> str:
        ended = "converged" if self.converged else "NOT converged: the search ended at its step limit"
        gain = self.loss_start - self.loss
        return (
            f"Tuning by the likelihood of {self.num_innovations} innovations: {ended}\n"
            f"log likelihood {gain:+.4g} against the start\n{self.table()}"
        )

    def plot(self) -> "Figure":
        """See `nav_jax.plot_analysis.plot_tuning`."""
        from nav_jax.plot_analysis import plot_tuning

        return plot_tuning(self)


def tune(
    imu: Imu,
    aiding: Sequence[Fixes],
    errors: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    initial: InitialUncertainty,
    tune_aiding: bool = False,
    hold: Sequence[str] = (),
    max_steps: int = 50,
    prior: Any = None,
    every: int = 10,
    earth: FlatEarth | None = None,
    level: float = 0.95,
) -> Tuning:
    """Find the noise parameters under which the innovations of a recorded run are most likely.

    Parameters
    ----------
    imu, aiding, position, velocity, quaternion, initial, every, earth
        See `nav_jax.navigate`.
    errors
        Where the search starts, such as fits of a static recording; its structure is that of the result.
    tune_aiding
        Seek also the standard deviations that the filter believes of the aiding sensors.
    hold
        Names of parameters that are not sought.
    max_steps
        Of the search.
    prior
        Penalise the way from the start: a standard deviation of the logarithms, or their covariance (P, P).
    level
        Confidence of the intervals.

    Raises
    ------
    ValueError
        No fix, an unknown name, a prior that is no covariance, nothing that the record determines, a filter that fails
        at the start; as of `nav_jax.navigate`.
    """
    if not aiding:
        raise ValueError("Without aiding there are no innovations, and nothing to tune by.")
    done = prepare_navigation(
        imu,
        aiding,
        errors,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        every=every,
        output_interval=imu.duration,
        earth=earth,
    )
    record = Record(done.timeline, done.inputs, initial)
    model = Model(ErrorLines(errors), AidingLines(done.sensors), tune_aiding)
    names, size = model.names, len(model.names)
    if unknown := sorted(set(hold) - set(names)):
        raise ValueError(f"There is no parameter {unknown[0]!r} to hold; there are {', '.join(names)}.")
    penalty = _penalty(prior, size)
    about = _About(record, model, penalty)
    start = np.asarray(model.start)
    begin = about(start)
    if not np.isfinite(begin.loss):
        raise ValueError("The filter fails at the start: look at the record with navigate first.")
    sought = observable_parameters(begin.information, [i for i in range(size) if names[i] not in hold])
    if not sought:
        raise ValueError("The record determines none of the parameters: it is too short, or its aiding too poor.")
    basis = whitening(begin.information, sought)
    found = minimize(
        lambda u: about(start + basis @ u).loss - begin.loss,
        np.zeros(len(sought)),
        jac=lambda u: basis.T @ about(start + basis @ u).gradient,
        hess=lambda u: basis.T @ about(start + basis @ u).information @ basis,
        method="trust-exact",
        options={"maxiter": max_steps, "gtol": _SLOPE},
    )
    vector = start + basis @ found.x
    se = standard_errors(_hessian(about, vector, sought), sought)
    seen = se < UNOBSERVABLE
    z = normal_quantile(level)
    lines = [vector + k * z * np.where(seen, se, np.nan) for k in (-1, 1)]
    tuned, sensors = model.build(jnp.asarray(vector))
    limits = np.stack([_values(model, np.where(seen, x, vector)) for x in lines])
    return Tuning(
        errors=tuned,
        aiding=sensors,
        names=names,
        start=_values(model, np.asarray(model.start)),
        value=_values(model, vector),
        se=np.where(seen, se, np.nan),
        ci_low=np.where(seen, limits.min(axis=0), np.nan),
        ci_high=np.where(seen, limits.max(axis=0), np.nan),
        observable=seen,
        held=tuple(hold),
        loss_start=float(begin.loss),
        loss=float(found.fun + begin.loss - _off(penalty, vector - start)),
        num_innovations=int(np.asarray(record.timeline.valid).sum()),
        converged=bool(found.success),
        level=level,
    )


class _Found(NamedTuple):
    """`Slopes` on the host, of loss and penalty."""

    loss: float
    gradient: Float64[np.ndarray, " P"]
    information: Float64[np.ndarray, "P P"]


class _About:
    """Loss and penalty about a vector; the last is remembered, for which a solver asks three times."""

    def __init__(self, record: Record, model: Model, penalty: Float64[np.ndarray, "P P"]):
        self.record, self.model, self.penalty = record, model, penalty
        self.at: Any = None

    def __call__(self, vector: Float64[np.ndarray, " P"]) -> _Found:
        if self.at is None or not np.array_equal(self.at, vector):
            found = jax.tree.map(np.asarray, loss_and_slopes(self.record, self.model, jnp.asarray(vector)))
            off = vector - np.asarray(self.model.start)
            self.at = np.array(vector)
            self.last = _Found(
                # a filter that breaks down is as unlikely as can be
                float(found.loss) + _off(self.penalty, off) if np.isfinite(found.loss) else np.inf,
                np.nan_to_num(found.gradient + self.penalty @ off),
                np.nan_to_num(found.information + self.penalty),
            )
        return self.last


def _off(penalty: Float64[np.ndarray, "P P"], off: Float64[np.ndarray, " P"]) -> float:
    return float(off @ penalty @ off) / 2


def _hessian(about: _About, vector: Float64[np.ndarray, " P"], sought: Sequence[int]) -> Float64[np.ndarray, "P P"]:
    """Second derivatives of loss and penalty: central differences of the gradient, which is exact."""
    H = np.zeros((len(vector), len(vector)))
    for i in sought:
        h = np.zeros(len(vector))
        h[i] = _STEP
        H[:, i] = (about(vector + h).gradient - about(vector - h).gradient) / (2 * _STEP)
    return (H + H.T) / 2


def observable_parameters(info: Float64[np.ndarray, "P P"], candidates: Sequence[int]) -> list[int]:
    """Parameters that all have a standard error below `UNOBSERVABLE`: the least sure is given up first."""
    left = list(candidates)
    while left:
        errors = standard_errors(info, left)[left]
        worst = int(np.argmax(errors))
        if errors[worst] < UNOBSERVABLE:
            return left
        del left[worst]
    return []


def standard_errors(info: Float64[np.ndarray, "P P"], active: Sequence[int]) -> Float64[np.ndarray, " P"]:
    """Of the active parameters, from their information; inf for others and for what is singular."""
    out, at = np.full(len(info), np.inf), np.ix_(active, active)
    scale = np.sqrt(np.maximum(np.diag(info)[list(active)], np.finfo(float).tiny))
    roots, vectors = np.linalg.eigh(info[at] / np.outer(scale, scale))
    if not np.isfinite(roots).all():
        return out
    inverse = np.where(roots > _WEAKEST, 1 / np.where(roots > _WEAKEST, roots, 1.0), np.inf)
    with np.errstate(invalid="ignore"):
        out[list(active)] = np.sqrt(np.nansum(vectors**2 * inverse, axis=1)) / scale
    return out


def whitening(info: Float64[np.ndarray, "P P"], sought: Sequence[int]) -> Float64[np.ndarray, "P k"]:
    """B with B' I B = 1 over the sought parameters, zero rows for the others."""
    at = np.ix_(sought, sought)
    basis = np.zeros((len(info), len(sought)))
    basis[list(sought)] = np.linalg.inv(np.linalg.cholesky(info[at])).T
    return basis


def _values(model: Model, vector: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, " P"]:
    """Parameters per sample, and factors."""
    size = len(model.errors.names)
    return np.concatenate([model.errors.values(vector[:size]), np.exp(vector[size:])])


def _penalty(prior: Any, size: int) -> Float64[np.ndarray, "P P"]:
    if prior is None:
        return np.zeros((size, size))
    if np.ndim(prior) == 0:
        return np.eye(size) / check_number("prior", prior) ** 2
    covariance = np.asarray(prior, dtype=float)
    if covariance.shape != (size, size) or not np.isfinite(covariance).all():
        raise ValueError(f"The covariance of the prior is ({size}, {size}) and finite; this one is {covariance.shape}.")
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise ValueError("The covariance of the prior is not positive definite.") from error
    return np.linalg.inv(covariance)
