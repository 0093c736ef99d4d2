"""Intervals by resampling records: how joint estimates scatter over sets of records drawn from those at hand.

Records drawn with replacement are a bootstrap over records (Efron & Tibshirani 1993; for inertial sensors Bakalli et
al. 2023), whose intervals hold whether or not the records have the same parameters: they are about the mean sensor. R
records have C(2R - 1, R) different sets with multinomial probabilities; if there are few enough, all of them are
estimated and the distribution is exact.

``t``: estimate +- t times the standard deviation over the sets, with R - 1 degrees of freedom and the factor
sqrt(R/(R - 1)) that drawing from R instead of from all records takes away. ``percentile``: quantiles over the sets,
as R's mgmwm; with few records they are too narrow, and how much is said.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float
from scipy.special import stdtr, stdtrit

from gmwm_jax._internal.cached import cached_property
from gmwm_jax._internal.checks import confidence, integer, require_x64, typed_key
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.progress import Progress, progress_bar
from gmwm_jax._internal.quantiles import normal_quantile
from gmwm_jax._internal.typing import PRNGKey
from gmwm_jax.fitting.standard_errors import evaluate
from gmwm_jax.fitting.tables import Estimate, EstimateTable
from gmwm_jax.inference.intervals import (
    as_parameters,
    in_table,
    line,
    on_the_line,
    replicated,
    replicates_needed,
)
from gmwm_jax.multisignal._refit import joint_refit
from gmwm_jax.multisignal.joint import JointFit, one_channel
from gmwm_jax.processes.base import Composite

KINDS = ("t", "percentile")
_KNOWN = 0.95
"""Probability of the sets that must know a quantity for it to have an interval."""


@dataclass(frozen=True, repr=False)
class RecordResamples:
    """The result of `resample_records`: joint estimates of B sets of records.

    Attributes
    ----------
    joint
        The estimate of all records.
    counts
        How often each set holds each record, shape (B, R).
    probability
        Of each set, shape (B,); they add up to one.
    values
        Estimates, shape (B, P), parameters per sample in the order of the model.
    converged
        Which searches converged; the others count as failures and enter nothing.
    exact
        All sets that there are, not a random choice?
    """

    joint: JointFit
    counts: Float[np.ndarray, "B R"]
    probability: Float[np.ndarray, " B"]
    values: Float[np.ndarray, "B P"]
    converged: Bool[np.ndarray, " B"]
    exact: bool

    @property
    def num_failed(self) -> int:
        """Sets whose search did not converge."""
        return int((~self.converged).sum())

    @cached_property
    def _draws(self) -> Float[np.ndarray, "G P"]:
        return on_the_line(self.joint.model, self.values[self.converged])

    def interval(
        self, kind: str = "t", level: float | None = None
    ) -> tuple[Float[np.ndarray, " P"], Float[np.ndarray, " P"]]:
        """Both ends of the intervals of all parameters per sample.

        There is none (NaN) for what is held, and for what more than 5 % of the sets do not know: the correlation time
        of a component without variance, and for ``t`` the variance of such a component itself.

        Parameters
        ----------
        kind
            ``t`` or ``percentile``.
        level
            Confidence, by default that of the fit.

        Raises
        ------
        ValueError
            Another kind; percentiles of too few records or sets for the level.
        """
        return as_parameters(self.joint.model, *self._ends(line, kind, self._level(level)))

    def parameters(self, kind: str = "t", level: float | None = None) -> EstimateTable:
        """The parameters per sample with these intervals; arguments as of `interval`."""
        table = self.joint.parameters()
        ends = zip(table, *self.interval(kind, level), strict=True)
        return self._table(table, [replace(e, ci_low=low, ci_high=high) for e, low, high in ends], kind, level)

    def continuous(self, kind: str = "t", level: float | None = None) -> EstimateTable:
        """What a Kalman filter wants, see `Fit.continuous`, with these intervals."""
        return self._continuous(self.joint.continuous(), kind, level)

    def datasheet(self, kind: str = "t", level: float | None = None) -> EstimateTable:
        """The units of datasheets, with these intervals."""
        return self._continuous(self.joint.datasheet(), kind, level)

    def percentile_coverage(self, level: float | None = None) -> float:
        """What percentile intervals of this few records really cover, if records scatter normally on the log scale.

        Their half width is z sqrt((R - 1)/R) standard errors where Student's distribution asks for t.

        Parameters
        ----------
        level
            What they are meant to cover, by default that of the fit.
        """
        R = self.counts.shape[1]
        return float(1 - 2 * stdtr(R - 1, -normal_quantile(self._level(level)) * np.sqrt((R - 1) / R)))

    def _level(self, level: float | None) -> float:
        return self.joint.level if level is None else confidence(level)

    def _continuous(self, table: EstimateTable, kind: str, level: float | None) -> EstimateTable:
        ends = self._ends(self.joint.fit.log_quantities, kind, self._level(level))
        return self._table(table, in_table(self.joint.fit, table, *ends), kind, level)

    def _table(self, table: EstimateTable, shown: list[Estimate], kind: str, level: float | None) -> EstimateTable:
        title = f"{table.title}, {kind} intervals by resampling {self.counts.shape[1]} records"
        return EstimateTable(title, tuple(shown), self._level(level))

    def _ends(
        self, quantity: Callable[[Composite], Array], kind: str, level: float
    ) -> tuple[Float[np.ndarray, " Q"], Float[np.ndarray, " Q"]]:
        """Both ends of the intervals of a quantity on the real line."""
        if kind not in KINDS:
            raise ValueError(f"kind is one of {', '.join(KINDS)}, and is {kind!r}.")
        spread = np.asarray(replicated(quantity, self.joint.model, jnp.asarray(self._draws)))
        weights = self.probability[self.converged] / self.probability[self.converged].sum()
        if kind == "percentile":
            self._require_enough(level)
        at, R = np.asarray(evaluate(quantity, self.joint.model)), self.counts.shape[1]
        t = stdtrit(R - 1, (1 + level) / 2) * np.sqrt(R / (R - 1))
        ends = np.full((2, len(at)), np.nan)
        for i, (x, column) in enumerate(zip(at, spread.T, strict=True)):
            # an amplitude of zero has a place in a percentile, and none in a standard deviation
            known = np.isfinite(column) if kind == "t" else ~np.isnan(column)
            own, w = column[known], weights[known]
            if w.sum() < _KNOWN:
                continue
            w = w / w.sum()
            if kind == "percentile":
                ends[:, i] = np.quantile(own, [(1 - level) / 2, (1 + level) / 2], method="inverted_cdf", weights=w)
            else:
                half = t * np.sqrt(w @ (own - w @ own) ** 2)
                ends[:, i] = (x - half, x + half) if half > 0 else np.nan
        return ends[0], ends[1]

    def _require_enough(self, level: float) -> None:
        R, tail = self.counts.shape[1], (1 - level) / 2
        needed = next(n for n in range(2, 100) if float(n) ** -n <= tail)
        if needed > R:
            raise ValueError(
                f"{R} records are too few for percentile intervals at {100 * level:g} %, which take {needed}: the set "
                f'that holds one record {R} times would be the end. Take kind="t" or more records.'
            )
        if not self.exact and self.converged.sum() < replicates_needed(level):
            raise ValueError(
                f"{self.converged.sum()} random sets are too few for percentile intervals at {100 * level:g} %, which "
                f"take {replicates_needed(level)}."
            )

    def __repr__(self) -> str:
        """What was done, and the parameters."""
        B, R = self.counts.shape
        sets = f"all {B} sets" if self.exact else f"{B} random sets"
        failed = f"; {self.num_failed} did not converge and are left out" if self.num_failed else ""
        few = (
            f"{100 * self.joint.level:g} % intervals by percentiles would cover about "
            f"{100 * self.percentile_coverage():.0f} % with this few records."
        )
        return (
            f"Resampling of {R} records of {self.joint.wv.channels[0]}: {sets}{failed}\n\n"
            f"{self.parameters()}\n\nThese intervals are about the mean over such sensors. {few}"
        )


def resample_records(
    joint: JointFit, limit: int = 500, *, key: PRNGKey | None = None, progress: Progress = False
) -> RecordResamples:
    """Estimate jointly from sets of records drawn with replacement, for intervals of the mean sensor.

    Parameters
    ----------
    joint
        Of one channel, from `fit_records`.
    limit
        Largest number of sets. If there are no more (up to six records for the default), all are taken, each with its
        probability, and nothing is random.
    key
        ``jax.random.key(seed)``, needed if there are more: then `limit` sets are drawn.
    progress
        Show a bar (needs the extra ``app``); or a function of what is done and the total, which may cancel by raising.

    Returns
    -------
    RecordResamples

    Raises
    ------
    ValueError
        No key where sets have to be drawn.
    TypeError
        Several channels, or no joint fit; a key of another kind.

    Examples
    --------
    >>> keys = jax.random.split(jax.random.key(0), 3)
    >>> records = [gj.datasets.simulated("mti-g", 2000, key=key, channels=["accel_x"]) for key in keys]
    >>> units = [gj.wavelet_variance(rec) for rec in records]
    >>> joint = gj.fit_records(units, "WN + RW")
    >>> resamples = gj.multisignal.resample_records(joint, 20, key=jax.random.key(0))
    >>> resamples.num_failed
    0
    """
    require_x64()
    joint = one_channel(joint, "resample_records")
    limit = integer("limit", limit, 2)
    R = len(joint.records)
    there_are = math.comb(2 * R - 1, R)
    exact = there_are <= limit
    num_sets = min(limit, there_are)
    # how often each record is in a set, the sum of its weights, and its factor in the joint fit
    most = FLOAT * num_sets * (2 * R + 2 * math.prod(joint.pool.omegas.shape[1:]))
    require_memory(most, f"{num_sets} sets of {R} records", "lower the limit")
    if exact:
        counts = np.array([np.bincount(c, minlength=R) for c in combinations_with_replacement(range(R), R)])
        arrangements = [math.factorial(R) / math.prod(math.factorial(int(n)) for n in row) for row in counts]
        probability = np.array(arrangements) / float(R) ** R
    else:
        if key is None:
            raise ValueError(f"{R} records have {there_are} sets: give key=... to draw {limit}, or raise the limit.")
        typed_key(key)
        chosen = np.asarray(jax.random.randint(key, (limit, R), 0, R))
        counts = np.array([np.bincount(row, minlength=R) for row in chosen])
        probability = np.full(limit, 1 / limit)
    counts = counts.astype(np.float64)
    omega = np.einsum("br,rjk->bjk", counts, joint.pool.omegas)
    bar = progress_bar(len(counts), "set", progress)
    try:
        found = joint_refit(joint, omega, counts @ joint.pool.moments, bar.update)
    finally:
        bar.close()
    return RecordResamples(joint, counts, probability, found.values, found.converged, exact)
