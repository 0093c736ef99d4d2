"""Do records of one sensor have the same parameters? Each fitted alone, against what estimation errors explain.

With x_i the estimate of a parameter from record i on the real line (log; logit for phi) and s_i its standard error by
theory under the joint model, Cochran's (1954)

    Q = sum_i (x_i - x_bar)^2/s_i^2,    x_bar weighted with 1/s_i^2,

is chi-square with R - 1 degrees of freedom if all records have the same parameter. What is left over is the variance
between records, (Q - (R - 1))/(sum w - sum w^2/sum w) with w = 1/s^2, or zero (DerSimonian & Laird 1986). The same with
the vector of all parameters and their covariances tests them together.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.special import chdtrc

from gmwm_jax._internal.drawing import Drawable
from gmwm_jax._internal.saved import Saved
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.result import Fit, Status
from gmwm_jax.fitting.standard_errors import parameter_covariance
from gmwm_jax.multisignal.joint import JointFit, one_channel
from gmwm_jax.processes.parameter import Parameter

_MAY_BE_UNKNOWN = ("low", "high", "observed", "expected", "statistic", "p_value", "between")


@saved(not_finite=_MAY_BE_UNKNOWN)
@dataclass(frozen=True)
class ParameterSpread:
    """How one parameter differs between records, on the real line (log; logit for phi).

    Attributes
    ----------
    component, symbol
        Which parameter.
    low, high
        Smallest and largest estimate of a single record, per sample.
    observed
        Standard deviation of the estimates over the records.
    expected
        What their errors alone would make it (root of the mean of the squared standard errors).
    statistic, dof, p_value
        Cochran's Q and its test; NaN with fewer than two records.
    between
        Estimated standard deviation of the parameter itself between records: 0.1 is 10 %.
    num_left_out
        Records whose estimate is at a boundary or did not converge: they have no place on the real line, and if there
        are many the test is about the others.
    """

    component: str
    symbol: str
    low: float
    high: float
    observed: float
    expected: float
    statistic: float
    dof: int
    p_value: float
    between: float
    num_left_out: int


@saved(not_finite=("estimates", "covariances", "statistic", "p_value"))
@dataclass(frozen=True, repr=False)
class RecordComparison(Drawable, Saved):
    """The result of `compare_records`: estimates from single records, and how they differ.

    Attributes
    ----------
    joint
        The fit of all records.
    estimates
        Of the parameters that the joint fit determines, on the real line, from each record alone, shape (R, A); NaN
        where a record does not determine one.
    covariances
        What theory says of each row under the joint model, shape (R, A, A).
    spreads
        A row a parameter.
    statistic, dof, p_value
        Cochran's test of all parameters together, over the records that determine all; p is NaN with fewer than two.
    """

    joint: JointFit
    estimates: Float[np.ndarray, "R A"]
    covariances: Float[np.ndarray, "R A A"]
    spreads: tuple[ParameterSpread, ...]
    statistic: float
    dof: int
    p_value: float

    @property
    def between_covariance(self) -> Float[np.ndarray, "A A"]:
        """Covariance of the parameters between records: that of the estimates less the mean of theory.

        A moment estimate, which by chance may have negative variances; NaN with fewer than two complete records.
        """
        complete = np.isfinite(self.estimates).all(axis=1)
        if complete.sum() < 2:
            return np.full(self.covariances.shape[1:], np.nan)
        seen = np.atleast_2d(np.cov(self.estimates[complete], rowvar=False))
        return seen - self.covariances[complete].mean(axis=0)

    def __getitem__(self, key: tuple[str, str]) -> ParameterSpread:
        for s in self.spreads:
            if (s.component, s.symbol) == key:
                return s
        known = ", ".join(f"({s.component!r}, {s.symbol!r})" for s in self.spreads)
        raise KeyError(f"No parameter {key}; there are {known}.")

    def __repr__(self) -> str:
        """The test of all, and a row a parameter."""
        head = ["component", "quantity", "lowest", "highest", "scatter", "by error", "Q", "dof", "p", "between", ""]
        rows = [
            [
                s.component,
                s.symbol,
                *(number(x) for x in (s.low, s.high)),
                *(number(x, 3) for x in (s.observed, s.expected, s.statistic)),
                str(s.dof),
                *(number(x, 3) for x in (s.p_value, s.between)),
                f"{s.num_left_out} left out" if s.num_left_out else "",
            ]
            for s in self.spreads
        ]
        return (
            f"{len(self.estimates)} records of {self.joint.wv.channels[0]}, each fitted alone: same parameters? "
            f"chi-square {self.statistic:.4g} with {self.dof} degrees of freedom, p = {self.p_value:.3g}\n"
            f"{format_table(head, rows, left=2)}\n"
            "scatter: standard deviation of the logs; by error: what it would be with the same parameters; between: "
            "what is left of it (0.1 is 10 %)"
        )


def compare_records(joint: JointFit) -> RecordComparison:
    """Compare the parameters of single records with each other.

    Parameters
    ----------
    joint
        Of one channel, from `fit_records`, of records whose theory is known.

    Returns
    -------
    RecordComparison

    Raises
    ------
    ValueError
        A record without theory of its wavelet variance, or with fewer scales than the model has free parameters; no
        parameter that the records determine.
    TypeError
        Several channels, or no joint fit.

    Notes
    -----
    Components of a kind are told apart by their correlation time alone: where these come near each other, rows of the
    table may mix them. Theory is that of estimates near the joint one: of records so short that their parameters
    scatter by a factor of two or more, prefer `near_stationarity`.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> print(gj.multisignal.compare_records(joint))
    3 records of accel_x, each fitted alone: same parameters? ...
    """
    joint = one_channel(joint, "compare_records")
    for name, r in zip(joint.names, joint.records, strict=True):
        r.wv.require_theory(f"Comparisons (record {name})")
    covariances = joint.record_covariances
    if covariances is None:
        raise ValueError(f"There is no theory of the scatter of {joint.model}.")
    active = list(joint.fit.active)
    if not active:
        raise ValueError(f"No parameter of {joint.model} is free and inside its range: there is nothing to compare.")
    x = np.stack([_on_the_line(single, joint) for single in joint.singles])
    theory = np.stack(
        [
            np.asarray(
                parameter_covariance(
                    joint.model,
                    joint.fit.active,
                    jnp.asarray(r.wv.scales),
                    jnp.asarray(np.linalg.cholesky(r.omega).T),
                    jnp.asarray(V),
                )
            )
            for r, V in zip(joint.records, covariances, strict=True)
        ]
    )
    x = np.where(np.isnan(np.einsum("raa->ra", theory)), np.nan, x)  # not told apart from another
    complete = np.isfinite(x).all(axis=1)
    statistic = _statistic(x[complete], theory[complete])
    dof = max(0, int(complete.sum()) - 1) * len(active)
    p_value = float(chdtrc(dof, statistic)) if dof else np.nan
    parameters = [
        (label, q) for label, p in zip(joint.model.labels, joint.model.processes, strict=True) for q in p.parameters
    ]
    spreads = tuple(
        _spread(parameters[at][0], parameters[at][1], x[:, i], theory[:, i, i]) for i, at in enumerate(active)
    )
    return RecordComparison(joint, x, theory, spreads, statistic, dof, p_value)


def _on_the_line(single: Fit, joint: JointFit) -> Float[np.ndarray, " A"]:
    """The parameters of a single fit that the joint fit determines; NaN for those that this record does not.

    A component that is white noise or a random walk in one of them only is another process, variance included.
    """
    if single.status is not Status.converged:
        return np.full(len(joint.fit.active), np.nan)
    known = [
        single.at_boundary.get(label) == joint.at_boundary.get(label)
        for label, p in zip(joint.model.labels, joint.model.processes, strict=True)
        for _ in p.parameters
    ]
    inside = np.isin(np.arange(len(known)), single.active) & np.array(known)
    with np.errstate(divide="ignore"):
        values = np.where(inside, np.asarray(single.model.unconstrained()), np.nan)
    return values[list(joint.fit.active)]


def _statistic(x: Float[np.ndarray, "C A"], covariances: Float[np.ndarray, "C A A"]) -> float:
    """Cochran's Q of vectors."""
    if len(x) < 2:
        return np.nan
    weights = np.linalg.inv(covariances)
    mean = np.linalg.solve(weights.sum(axis=0), np.einsum("rab,rb->a", weights, x))
    return float(np.einsum("ra,rab,rb->", x - mean, weights, x - mean))


def _spread(label: str, q: Parameter, x: Float[np.ndarray, " R"], variance: Float[np.ndarray, " R"]) -> ParameterSpread:
    seen: Bool[np.ndarray, " R"] = np.isfinite(x)
    num = int(seen.sum())
    num_left_out = len(x) - num
    if num < 2:
        none = np.nan
        return ParameterSpread(label, q.name, none, none, none, none, none, 0, none, none, num_left_out)
    x, w = x[seen], 1 / variance[seen]
    Q = _statistic(x[:, None], variance[seen][:, None, None])
    left = (Q - (num - 1)) / (w.sum() - (w**2).sum() / w.sum())
    return ParameterSpread(
        label,
        q.name,
        float(q.from_line(x.min())),
        float(q.from_line(x.max())),
        observed=float(x.std(ddof=1)),
        expected=float(np.sqrt(variance[seen].mean())),
        statistic=Q,
        dof=num - 1,
        p_value=float(chdtrc(num - 1, Q)),
        between=float(np.sqrt(max(0.0, left))),
        num_left_out=num_left_out,
    )
