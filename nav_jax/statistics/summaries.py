"""Statistics over Monte Carlo runs, each with its interval or band: arrays in, arrays out.

Runs are axis 0 of every array and are independent of each other; epochs of one run are not. So every standard error
is taken over runs, and what is averaged over time is averaged within each run first.

Two kinds of limits are told apart. An *interval* is about the unknown truth and moves with the data (`Curve`,
`Paired`). A *band* is where the statistic lies if the filter is consistent, and is known before any run
(`Consistency`, `Coverage`).

All functions raise a ValueError for fewer than two runs, NaN or infinity, and probabilities outside (0, 1).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import stdtr

from gmwm_jax._internal.checks import integer, probability
from nav_jax.statistics import distributions as dist


@dataclass(frozen=True, eq=False)
class Curve:
    """A statistic at every epoch with its confidence interval.

    Attributes
    ----------
    value, low, high, se
        Statistic, interval and standard error, each of shape (E,) or (E, k).
    level
        Confidence, pointwise: not that of the whole curve.
    num_runs
        Runs behind it.
    """

    value: Float[np.ndarray, "..."]
    low: Float[np.ndarray, "..."]
    high: Float[np.ndarray, "..."]
    se: Float[np.ndarray, "..."]
    level: float
    num_runs: int


@dataclass(frozen=True, eq=False)
class Consistency:
    """Mean normalised squared error (NEES) or innovation (NIS) against what a consistent filter shows.

    Attributes
    ----------
    value
        Shape (E,): mean over runs, expected `dof`.
    low, high
        Band of the mean of one epoch: it holds a share `level` of the epochs of a consistent Gaussian filter. That
        share is right on average only: neighbouring epochs leave the band together.
    dof, level, num_runs
        Degrees of freedom of one run, confidence of band and interval, runs.
    average, average_low, average_high
        Mean over epochs and runs and its interval over the runs, which assumes nothing about epochs.
    """

    value: Float[np.ndarray, " E"]
    low: float
    high: float
    dof: int
    level: float
    num_runs: int
    average: float
    average_low: float
    average_high: float

    @property
    def inside(self) -> Bool[np.ndarray, " E"]:
        """Which epochs lie in the band."""
        return (self.low <= self.value) & (self.value <= self.high)

    @property
    def share_inside(self) -> float:
        """Share of the epochs in the band."""
        return float(np.mean(self.inside))

    @property
    def verdict(self) -> str:
        """What the interval of the average says of the filter.

        "optimistic": errors are larger than its covariance claims; "conservative": smaller; else "consistent".
        """
        if self.average_low > self.dof:
            return "optimistic"
        return "conservative" if self.average_high < self.dof else "consistent"


@dataclass(frozen=True, eq=False)
class Coverage:
    """Fraction of runs whose truth lies in the region that the filter claims for it.

    Attributes
    ----------
    value
        Shape (E,) or (E, k); NaN where the filter claims nothing.
    low, high
        Band: exact binomial acceptance region of a fraction of `num_runs`, with at least the `confidence`.
    interval_low, interval_high
        Interval of Clopper and Pearson of the true coverage, with the same confidence.
    level, confidence, num_runs
        Probability of the region, confidence of band and interval, runs.
    """

    value: Float[np.ndarray, "..."]
    low: float
    high: float
    interval_low: Float[np.ndarray, "..."]
    interval_high: Float[np.ndarray, "..."]
    level: float
    confidence: float
    num_runs: int

    @property
    def inside(self) -> Bool[np.ndarray, "..."]:
        """Which values lie in the band."""
        # fractions of whole runs: half a run of slack only takes rounding out
        slack = 0.5 / self.num_runs
        return (self.low - slack < self.value) & (self.value < self.high + slack)

    @property
    def share_inside(self) -> float:
        """Share of the values, other than NaN, in the band; NaN if there are none."""
        known = ~np.isnan(self.value)
        return float(np.mean(self.inside[known])) if known.any() else np.nan


@dataclass(frozen=True)
class Paired:
    """Difference of two models on the same runs.

    Attributes
    ----------
    difference, se, low, high
        Mean of a - b, its standard error and interval.
    p
        Of the two-sided t test that there is no difference.
    num_runs_needed
        Runs with which such a test finds a true difference as large as the observed one with the wanted power; None if
        that is zero. It is an estimate, as uncertain as the difference is.
    num_runs, level
        Pairs, and confidence of the interval.
    """

    difference: float
    se: float
    low: float
    high: float
    p: float
    num_runs_needed: int | None
    num_runs: int
    level: float


def mean_curve(values: Float[np.ndarray, "R ..."], level: float = 0.95) -> Curve:
    """Mean over runs with Student's interval.

    Parameters
    ----------
    values
        One number a run at each epoch, e.g. the energy score.
    level
        Confidence.
    """
    level = probability("level", level)
    N = _runs("values", values)
    mean, se = _mean_and_se(values)
    half = dist.t_quantile(level, N - 1) * se
    return Curve(mean, mean - half, mean + half, se, level, N)


def mean_norm(error: Float[np.ndarray, "R E k"], level: float = 0.95) -> Curve:
    """Compute the mean over runs of the length of the error: metres of position, radians of attitude.

    Parameters
    ----------
    error
        Vectors of error.
    level
        Confidence of Student's interval; it is cut at zero, below which no length lies.

    Examples
    --------
    >>> error = np.array([[[3.0, 4.0]], [[0.0, 1.0]]])  # two runs, one epoch, two components
    >>> nj.statistics.mean_norm(error).value.tolist()
    [3.0]
    """
    _runs("error", error)
    c = mean_curve(np.linalg.norm(error, axis=-1), level)
    return Curve(c.value, np.maximum(c.low, 0.0), c.high, c.se, c.level, c.num_runs)


def rms(error: Float[np.ndarray, "R E k"], level: float = 0.95, *, per_component: bool = False) -> Curve:
    """Compute the root mean square over runs of the length of the error, or of each component.

    N rms^2 is taken for a scaled chi-square variable whose degrees of freedom follow from its variance (Satterthwaite).
    That variance is the larger of two: the one of Gaussian errors with the second moments seen, by which the interval
    holds with few runs, and the one seen, for heavier tails. A mean that all runs share, or light tails, make the
    interval wider than need be.

    Parameters
    ----------
    error
        Vectors of error.
    level
        Confidence.
    per_component
        Curves of shape (E, k) instead of (E,).

    Examples
    --------
    >>> error = np.array([[[3.0, 4.0]], [[0.0, 5.0]]])
    >>> nj.statistics.rms(error).value.tolist()
    [5.0]
    """
    level = probability("level", level)
    N = _runs("error", error)
    e = error[..., None] if per_component else error
    squares = np.einsum("...i,...i->...", e, e)
    mean, se = _mean_and_se(squares)
    # 2 mean^2/Var(mean), where both may be zero
    seen = 2.0 / np.maximum((se / np.where(mean > 0, mean, 1.0)) ** 2, np.finfo(float).tiny)
    dof = np.minimum(seen, dist.gaussian_dof(e))
    tail = (1 - level) / 2
    value = np.sqrt(mean)
    low, high = (value * np.sqrt(dof / dist.chi2_quantile(p, dof)) for p in (1 - tail, tail))
    return Curve(value, low, high, value / np.sqrt(2 * dof), level, N)


def mean_nees(nees: Float[np.ndarray, "R E"], dof: int, level: float = 0.95) -> Consistency:
    """Compute the mean NEES or NIS over runs, with the chi-square band of a consistent filter.

    The band of one epoch is chi2(dof N)/N. The overall verdict rests on one average a run, whose mean has an interval
    by Student's t on the log scale.

    Parameters
    ----------
    nees
        Squares e' P^-1 e of one group of states, or of the innovations of one sensor.
    dof
        Number of states in the group (components of the innovation): the expectation.
    level
        Confidence of band and interval.

    Raises
    ------
    ValueError
        No epoch, negative squares, a dof that is no positive integer.

    Examples
    --------
    >>> squares = np.random.default_rng(0).chisquare(6, size=(100, 50))  # 100 runs of an honest filter, 50 epochs
    >>> result = nj.statistics.mean_nees(squares, dof=6)
    >>> result.share_inside > 0.8
    True
    """
    level, dof = probability("level", level), integer("dof", dof, 1)
    N = _squares(nees)
    tail = (1 - level) / 2
    low, high = (float(dist.chi2_quantile(p, dof * N)) / N for p in (tail, 1 - tail))
    average, se = (float(x) for x in _mean_and_se(nees.mean(axis=1)))
    with np.errstate(over="ignore"):  # two runs and a high level: nothing is known, and the interval is (0, inf)
        factor = float(np.exp(dist.t_quantile(level, N - 1) * se / average)) if average > 0 else 1.0
    return Consistency(nees.mean(axis=0), low, high, dof, level, N, average, average / factor, average * factor)


def coverage(nees: Float[np.ndarray, "R E"], dof: int, level: float = 0.95, confidence: float = 0.95) -> Coverage:
    """Compute the share of runs whose truth lies in the filter's ellipsoid of probability `level`.

    Parameters
    ----------
    nees
        Squares e' P^-1 e of one group of states.
    dof
        Number of states in the group.
    level
        Probability that the ellipsoid claims.
    confidence
        Of the band and of the interval; it has nothing to do with `level`.

    Examples
    --------
    >>> squares = np.random.default_rng(0).chisquare(6, size=(100, 50))
    >>> round(float(nj.statistics.coverage(squares, dof=6).value.mean()), 2)
    0.95
    """
    level, confidence = probability("level", level), probability("confidence", confidence)
    N = _squares(nees)
    covered = nees <= dist.chi2_quantile(level, integer("dof", dof, 1))
    return _coverage(np.sum(covered, axis=0, dtype=np.float64), N, level, confidence)


def interval_coverage(
    error: Float[np.ndarray, "... k"],
    sd: Float[np.ndarray, "... n"],
    level: float = 0.95,
    confidence: float = 0.95,
) -> Coverage:
    """Fraction of runs whose error lies within +-z standard deviations, component by component.

    Parameters
    ----------
    error, sd
        Shape (R, E, k): errors, and the standard deviations that the filter gives them. Where these are zero in all
        runs, as for an axis without a state, the filter claims nothing and the coverage is NaN.
    level
        Probability of the interval: 0.95 for z = 1.96.
    confidence
        Of the band and of the interval of Clopper and Pearson.

    Raises
    ------
    ValueError
        Negative standard deviations, different shapes.
    """
    level, confidence = probability("level", level), probability("confidence", confidence)
    N = _runs("error", error)
    _runs("sd", sd)
    if error.shape != sd.shape:
        raise ValueError(f"Errors of shape {error.shape} and standard deviations of shape {sd.shape}: give one each.")
    if np.any(sd < 0):
        raise ValueError(f"A standard deviation is at least zero, and the least one here is {sd.min()}.")
    covered = np.sum(np.abs(error) <= dist.normal_quantile(level) * sd, axis=0, dtype=np.float64)
    return _coverage(np.where(np.any(sd > 0, axis=0), covered, np.nan), N, level, confidence)


def paired(a: Float[np.ndarray, " A"], b: Float[np.ndarray, " B"], level: float = 0.95, power: float = 0.8) -> Paired:
    """Compare two models run by run, on common random numbers.

    Parameters
    ----------
    a, b
        One number a run, in the same order: error at an epoch, or averaged over epochs.
    level
        Confidence of the interval; the test behind `num_runs_needed` has the size 1 - level.
    power
        Probability with which that many runs find the difference: by the noncentral t up to 10,000 runs, by the normal
        approximation with Guenther's correction, which is as good, beyond.

    Raises
    ------
    ValueError
        Not as many of a as of b.

    Examples
    --------
    >>> a, b = np.array([3.0, 4.0, 5.0, 6.0]), np.array([2.0, 3.1, 3.9, 5.0])
    >>> result = nj.statistics.paired(a, b)
    >>> round(result.difference, 6), result.p < 0.01
    (1.0, True)
    """
    level, power = probability("level", level), probability("power", power)
    N = _runs("a", a)
    _runs("b", b)
    if a.shape != b.shape:
        raise ValueError(f"Runs are compared in pairs, and there are {len(a)} of one model and {len(b)} of the other.")
    difference, se = (float(x) for x in _mean_and_se(a - b))
    half = dist.t_quantile(level, N - 1) * se
    t = abs(difference) / se if se > 0 else np.inf if difference else 0.0  # se = 0: all pairs differ by the same
    p = 2 * float(stdtr(N - 1, -t))
    needed = dist.num_runs_needed(difference, se * np.sqrt(N), 1 - level, power)
    return Paired(difference, se, difference - half, difference + half, p, needed, N, level)


def holm(p: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
    """P-values adjusted for several comparisons (Holm 1979), in the given order.

    Parameters
    ----------
    p
        Of each comparison. Compared with 5 % after the adjustment, they make one false claim or more in 5 % of all
        tables at most, however the comparisons depend on each other.

    Raises
    ------
    ValueError
        Outside [0, 1].
    """
    if not np.all((p >= 0) & (p <= 1)):
        raise ValueError(f"P-values lie between 0 and 1, and these are {p}.")
    order = np.argsort(p)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return adjusted


def _mean_and_se(x: np.ndarray) -> tuple[Any, Any]:
    return x.mean(axis=0), x.std(axis=0, ddof=1) / np.sqrt(x.shape[0])


def _coverage(covered: Any, N: int, level: float, confidence: float) -> Coverage:
    band, interval = dist.binomial_band(N, level, confidence), dist.clopper_pearson(covered, N, confidence)
    return Coverage(covered / N, *band, *interval, level, confidence, N)


def _runs(what: str, x: np.ndarray) -> int:
    """Return the number of runs, or raise if there are too few or failed ones among them."""
    if x.shape[0] < 2:
        raise ValueError(f"{what} has {x.shape[0]} runs, and this statistic takes 2 or more.")
    if not np.all(np.isfinite(x)):
        bad = np.flatnonzero(~np.all(np.isfinite(x.reshape(x.shape[0], -1)), axis=1))
        raise ValueError(
            f"{what} has NaN or infinite values in {len(bad)} of {x.shape[0]} runs, the first of them run {bad[0]}. "
            "Leave out runs that failed, and epochs at which a covariance is zero and normalises nothing."
        )
    return x.shape[0]


def _squares(nees: np.ndarray) -> int:
    N = _runs("nees", nees)
    if nees.shape[1] == 0:
        raise ValueError("nees has no epoch.")
    if np.any(nees < 0):
        raise ValueError(f"Normalised squares are at least zero, and the least one here is {nees.min()}.")
    return N
