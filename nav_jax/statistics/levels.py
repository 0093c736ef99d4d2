"""Means by two levels of a computation: many cheap values, corrected by a few dear ones of the same random numbers."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import integer, number
from gmwm_jax._internal.typing import Real


class TwoLevelMean(NamedTuple):
    """The mean of what is dear to compute.

    Attributes
    ----------
    value, se
        The mean, unbiased, and its standard error.
    correction, correction_se
        Mean of dear - cheap in the same runs: what the cheap computation leaves out.
    ratio
        Variance of dear - cheap over that of the dear values; NaN where these do not vary.
    """

    value: Float64[np.ndarray, " *E"]
    se: Float64[np.ndarray, " *E"]
    correction: Float64[np.ndarray, " *E"]
    correction_se: Float64[np.ndarray, " *E"]
    ratio: Float64[np.ndarray, " *E"]


def two_level_mean(
    cheap: Float64[np.ndarray, "N *E"], of_the_same: Float64[np.ndarray, "n *E"], dear: Float64[np.ndarray, "n *E"]
) -> TwoLevelMean:
    """Estimate a mean from N cheap values and n <= N of both kinds.

    With D = dear - cheap the mean of the dear values is that of the N cheap ones plus that of the n differences:
    without bias, whatever the correlation (Giles 2015, Multilevel Monte Carlo methods, sec. 1.2). The n runs are among
    the N, so that the two means are correlated by cov(cheap, D) / N, and

        var = (var(cheap) + 2 cov(cheap, D)) / N + var(D) / n = (var(dear) - var(D)) / N + var(D) / n.

    Parameters
    ----------
    cheap
        Of all runs.
    of_the_same
        The cheap values of the runs that have dear ones.
    dear
        The dear values of those.

    Raises
    ------
    ValueError
        Fewer than two runs of both kinds, more of them than of cheap ones, or shapes that differ.

    Examples
    --------
    >>> cheap = np.array([1.0, 2.0, 3.0, 4.0])
    >>> found = nj.statistics.two_level_mean(cheap, cheap[:2], cheap[:2] + 0.5)
    >>> float(found.value), float(found.correction)
    (3.0, 0.5)
    """
    N, n = len(cheap), len(dear)
    if of_the_same.shape != dear.shape or cheap.shape[1:] != dear.shape[1:]:
        raise ValueError(f"Values of the same runs have one shape: {of_the_same.shape}, {dear.shape} of {cheap.shape}.")
    if not 2 <= n <= N:
        raise ValueError(f"It takes two runs or more of both kinds, and at most the {N} cheap ones: there are {n}.")
    D = dear - of_the_same
    var_D = D.var(axis=0, ddof=1)
    # of the cheap values all runs tell the variance; of how they go with D only n do
    covariance = ((of_the_same - of_the_same.mean(axis=0)) * (D - D.mean(axis=0))).sum(axis=0) / (n - 1)
    variance = (cheap.var(axis=0, ddof=1) + 2 * covariance) / N + var_D / n
    # with n = N that is var(dear) / N; with few it may come out below what the differences alone leave
    variance = np.maximum(variance, var_D * (1 / n - 1 / N))
    return TwoLevelMean(
        cheap.mean(axis=0) + D.mean(axis=0), np.sqrt(variance), D.mean(axis=0), np.sqrt(var_D / n), _ratio(D, dear)
    )


def controlled_mean(
    known: Float64[np.ndarray, " *E"], of_the_same: Float64[np.ndarray, "n *E"], dear: Float64[np.ndarray, "n *E"]
) -> TwoLevelMean:
    """Estimate a mean as `two_level_mean` does, where the mean of the cheap values is known.

    That is known + mean(D), of variance var(D) / n: as if there were cheap values without end (a control variate with
    the coefficient one, which is not estimated: without bias).

    Parameters
    ----------
    known
        Mean of the cheap values.
    of_the_same, dear
        Values of both kinds in the same runs.

    Raises
    ------
    ValueError
        Fewer than two runs, or shapes that differ.

    Examples
    --------
    >>> found = nj.statistics.controlled_mean(np.array(2.0), np.array([1.0, 3.5]), np.array([1.5, 4.0]))
    >>> float(found.value), float(found.se)
    (2.5, 0.0)
    """
    if of_the_same.shape != dear.shape or known.shape != dear.shape[1:]:
        raise ValueError(f"Values of the same runs have one shape: {of_the_same.shape}, {dear.shape} of {known.shape}.")
    if len(dear) < 2:
        raise ValueError(f"It takes two runs or more of both kinds: there is {len(dear)}.")
    D = dear - of_the_same
    se = D.std(axis=0, ddof=1) / math.sqrt(len(dear))
    return TwoLevelMean(known + D.mean(axis=0), se, D.mean(axis=0), se, _ratio(D, dear))


def _ratio(D: Float64[np.ndarray, "n *E"], dear: Float64[np.ndarray, "n *E"]) -> Float64[np.ndarray, " *E"]:
    """See `TwoLevelMean`."""
    of_D, of_dear = D.var(axis=0, ddof=1), dear.var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(of_dear > 0, of_D / of_dear, np.nan)


def num_dear(ratio: Real, N: int, excess: Real = 0.05) -> int:
    """Return how many of N runs need the dear computation.

    By the variance of `two_level_mean`, which is then at most 1 + excess times that of N dear values:
    n = N r / (excess + r), where r is the variance of the differences over that of the dear values.

    Parameters
    ----------
    ratio
        That r.
    N
        Number of cheap values.
    excess
        Of the variance.

    Examples
    --------
    >>> nj.statistics.num_dear(1e-3, 5000)
    99
    """
    ratio, excess, N = number("ratio", ratio, zero_ok=True), number("excess", excess), integer("N", N, 1)
    return min(N, max(2, math.ceil(N * ratio / (excess + ratio))))
