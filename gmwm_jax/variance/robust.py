"""Robust Haar wavelet variance: the M-estimator of scale with Tukey's biweight, level by level.

Mondal & Percival (2012); Guerrier, Molinari, Victoria-Feser & Xu (2021). nu_j^2 solves

    mean_t g(W_{j,t} / nu_j) = a,    g(r) = r^2 (1 - r^2/c^2)^4 for |r| <= c, else 0,    a = E g(Z),

with Z standard normal. A coefficient beyond c scales has no weight at all, one of typical size nearly full weight. The
constant c is chosen by the efficiency on independent Gaussian coefficients: the variance of the classic estimator, the
mean of W^2, over that of this one.

How sure it is. The expansion of g in Hermite polynomials, g = sum_m c_2m He_2m / sqrt((2m)!), gives for coefficients of
correlation rho (Price's theorem) Cov(g(Z), g(Z')) = sum_{m>=1} c_2m^2 rho^2m, and by Stein's identity the slope of the
estimating equation in log nu^2 is -c_2/sqrt(2). To first order, then, what the covariance of two log variances has of
a pair of coefficients is

    2 rho^2 p(rho^2),    p(y) = sum_{m>=1} (c_2m / c_2)^2 y^(m-1),    p(0) = 1,  p(1) = 1 / efficiency.

The 1 alone is the classic estimator. Independent coefficients lose 1/efficiency; correlated ones, as at every scale
above the sampling interval, lose less: c_2m of a smooth g fall off, and so do powers of rho.

What it cannot do. The 1/M of the mean counts outliers: far ones bias nu^2 downwards, by 2 % for each percent of the
coefficients at the efficiency 0.6. Single outlying samples spread over longer spans until they look like noise there.
And a scale of few degrees of freedom is hardly a sample: on clean data nu^2 is too large by 2 to 5 % on average where
there are 16 of them, by 20 to 35 % at the longest span (the classic one by nothing; the intervals still cover).
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import lru_cache, partial
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from gmwm_jax._internal.checks import finite_record
from gmwm_jax._internal.cores import num_threads
from gmwm_jax.variance.blocked import working_array
from gmwm_jax.variance.haar import check_num_levels, degrees_of_freedom, scales

LOWEST, HIGHEST = 0.5, 0.99
"""Efficiencies on offer. The estimator holds while the good coefficients alone can reach a, and the outliers alone
cannot: up to 20 % of far outliers at 0.5, 26 % at 0.6, 33 % at 0.75, 8 % at 0.99. Below 0.5 it loses on every side: it
scatters more, far outliers bias it more (1 % of them by -2.0 % at 0.6, by -1.1 % at 0.99) and fewer break it."""

_TERMS = 14
"""Of the polynomial p; the last one takes up the rest (1e-8 at the efficiency 0.5)."""
_BLOCK = 1 << 13
"""Coefficients worked on at once: 64 kB, so that buffers stay in the cache, and too short for BLAS to wake its own
threads, which would fight with ours."""
_START = 1 << 16
"""Coefficients, evenly spread, whose median starts the search."""
_FEW = 32
"""Degrees of freedom up to which the estimating equation may have no root by chance."""
_MAX_PASSES = 100
_SMALL = 1e-6
"""A last step of Newton's method in log nu^2: what it leaves is of the order of its square."""


class Biweight(NamedTuple):
    """The constants of one efficiency."""

    c: float
    """Where the weight becomes zero, in scales."""
    consistency: float
    """a = E g(Z)."""
    polynomial: Float[np.ndarray, " K"]
    """Coefficients of p, constant first."""


def require_efficiency(efficiency: float) -> None:
    """Raise a ValueError unless it is an efficiency on offer."""
    if not isinstance(efficiency, Real) or not LOWEST <= efficiency <= HIGHEST:
        raise ValueError(
            f"efficiency must be a number between {LOWEST:g} and {HIGHEST:g}, and is {efficiency!r}: a lower one "
            "resists outliers less, a higher one hardly. None is the classic estimator."
        )


@lru_cache
def biweight(efficiency: float) -> Biweight:
    """Return the constants of an efficiency, to rounding.

    Raises
    ------
    ValueError
        An efficiency that is not between 0.5 and 0.99.
    """
    from scipy.optimize import brentq

    require_efficiency(efficiency)
    # efficient from zero at c = 2.395 (where c_2 = 0) up to 0.9996 at c = 30, all the way rising
    c = float(brentq(lambda c: _expansion(c)[2] - efficiency, 2.6, 30.0, xtol=1e-14, rtol=1e-15))  # type: ignore[arg-type]
    consistency, ratios, reached = _expansion(c)
    return Biweight(c, consistency, np.append(ratios, 1 / reached - np.sum(ratios)))


def _expansion(c: float) -> tuple[float, Float[np.ndarray, " m"], float]:
    """E g(Z), the ratios (c_2m/c_2)^2 from m = 1 on, and the efficiency c_2^2 / Var g(Z) of a constant c."""
    # Gauss's rule is exact to rounding here (a polynomial times an analytic function), and nothing cancels in it
    nodes, weights = np.polynomial.legendre.leggauss(160)
    z = c * (nodes + 1) / 2
    density = weights * c * np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
    g = (z * (1 - (z / c) ** 2) ** 2) ** 2
    mean = float(density @ g)
    previous, hermite, coefficients = np.ones_like(z), z, []  # normalised Hermite polynomials
    for n in range(1, 2 * _TERMS - 2):
        previous, hermite = hermite, (z * hermite - np.sqrt(n) * previous) / np.sqrt(n + 1)
        if n % 2:
            coefficients.append(density @ (g * hermite))
    squares = np.array(coefficients) ** 2
    return mean, squares / squares[0], float(squares[0] / (density @ (g * g) - mean * mean))


def widening(efficiency: float, num_levels: int) -> Float[np.ndarray, " J"]:
    """By what the variance of log nu_j^2 exceeds the classic one, level by level.

    For coefficients whose spectrum is flat on the octave of the level and zero outside: the assumption under which the
    classic estimator has eta_j = M_j/tau_j degrees of freedom ("eta 3" of Percival 1995), so that eta_j divided by the
    result is right where eta_j is. At the efficiency 0.6 it is 1.43 at the span 2 and 1.31 from 4 on, not 1/0.6 = 1.67.
    """
    # from 64 samples on the sum over lags is the integral
    factors = [_octave_excess(biweight(efficiency).polynomial, int(min(tau, 64))) for tau in scales(num_levels)]
    return 1 + np.array(factors)


def error_of_log_ratio(efficiency: float, num_samples: int, num_levels: int) -> Float[np.ndarray, " J"]:
    """Standard error of log(classic/robust) of a clean record, level by level.

    The robust estimator is the efficient one plus an error that is uncorrelated with it (Hausman 1978), to the order of
    the powers of rho^2 beyond the first, so that the variance is the difference of both.
    """
    eta = degrees_of_freedom(num_samples, num_levels)
    return np.sqrt(2 * (widening(efficiency, num_levels) - 1) / eta)


def _octave_excess(polynomial: Float[np.ndarray, " K"], tau: int) -> float:
    """1/tau sum_h rho(h)^2 (p(rho(h)^2) - 1), with 1/tau sum_h rho(h)^2 = 1."""
    s = np.arange(1, 64 * tau) / tau
    y = ((np.sin(2 * np.pi * s) - np.sin(np.pi * s)) / (np.pi * s)) ** 2
    excess = np.polyval([*polynomial[:0:-1], 0.0], y) * y
    return float((np.sum(polynomial[1:]) + 2 * np.sum(excess)) / tau)


def robust_wavelet_variance(
    x: Shaped[np.ndarray, " N"],
    num_levels: int | None = None,
    *,
    efficiency: float = 0.6,
    scratch: str | os.PathLike | None = None,
    name: str = "the record",
) -> Float[np.ndarray, " J"]:
    """Robust Haar MODWT wavelet variance of an array or memory map.

    Parameters
    ----------
    x
        Record of N samples.
    num_levels
        J, by default floor(log2 N) - 1.
    efficiency
        On clean data, between 0.5 and 0.99.
    scratch
        A folder for temporary files of 24 N bytes, which then take the place of as much memory.
    name
        Of the record, for messages.

    Returns
    -------
    nu_j^2 at the spans 2, 4, .. 2^J, solved to 1e-10 or better; zero where half of the coefficients or more are.
    Where the mean of g stays below a: its maximum, to which the root then has moved. By chance this happens at scales
    of a few degrees of freedom, at the longest span of one record in twenty; elsewhere it is an error.

    Raises
    ------
    ValueError
        Too short; NaN or inf in the record; an efficiency not on offer; a level with so many outliers that its
        coefficients have no scale.
    """
    constants = biweight(efficiency)
    num = x.shape[0]
    J = check_num_levels(num, num_levels)
    finite_record(np.asarray(x), name)
    origin = float(np.mean(x[:_BLOCK]))  # a constant changes no coefficient; without it the sums stay small
    variances, solved = np.empty(J), np.empty(J, dtype=bool)
    with ExitStack() as stack:
        S, T, squares = (stack.enter_context(working_array(num, scratch)) for _ in range(3))
        team = stack.enter_context(ThreadPoolExecutor(num_threads()))
        _in_blocks(team, num, lambda block: np.subtract(x[block], origin, out=S[block], dtype=np.float64))
        for j in range(J):
            n, M = 1 << j, num - (2 << j) + 1
            _in_blocks(team, M, partial(_next_level, S, T, squares, n))
            variance, solved[j] = _scale(team, squares[:M], constants)
            variances[j] = variance / 4.0 ** (j + 1)
            S, T = T, S
    lost = ~solved & (degrees_of_freedom(num, J) > _FEW)
    if np.any(lost):
        raise ValueError(
            f"{name}: at spans of {', '.join(f'{tau:g}' for tau in scales(J)[lost])} samples the coefficients have no "
            "robust scale: a quarter of them or more are outliers. An efficiency of 0.75 bears a third; else cut the "
            "record to its undisturbed part, or use the classic estimator."
        )
    return variances


def _in_blocks(team: ThreadPoolExecutor, size: int, work: Callable[[slice], Any]) -> list[Any]:
    """Work on blocks of 0 .. size that do not depend on each other, on all cores: NumPy leaves the interpreter lock."""
    workers = num_threads()
    starts = range(0, size, _BLOCK)
    if len(starts) == 1:
        return [work(slice(0, size))]

    def share(w: int) -> list[Any]:
        return [work(slice(i, min(i + _BLOCK, size))) for i in starts[w::workers]]

    return [result for results in team.map(share, range(workers)) for result in results]


@np.errstate(over="ignore", invalid="ignore")  # seen from the median, or outliers without weight
def _next_level(S: np.ndarray, T: np.ndarray, squares: np.ndarray, n: int, block: slice) -> None:
    """From sums of n samples to those of 2n, and the squares of their differences: (tau W)^2."""
    early, late = S[block], S[block.start + n : block.stop + n]
    np.add(late, early, out=T[block])
    D = np.subtract(late, early, out=squares[block])
    np.multiply(D, D, out=D)


def _scale(team: ThreadPoolExecutor, squares: Float[np.ndarray, " M"], constants: Biweight) -> tuple[float, bool]:
    """Robust mean of squares (zero if half of them are), and whether it solves the equation."""
    c2, a = constants.c**2, constants.consistency
    M = squares.size
    start = float(np.median(squares[:: -(-M // _START)]))
    if start == 0:
        return 0.0, True
    if not np.isfinite(start):
        raise ValueError("The squares of the record are beyond floating point: take other units, or scale the data.")

    def excess(log_v: float) -> tuple[float, float]:
        """The mean of g less a, and its derivative, at log nu^2."""
        cubic, quartic = np.sum(_in_blocks(team, M, partial(_moments, squares, np.exp(-log_v) / c2)), axis=0) * c2 / M
        return quartic - a, 4 * cubic - 5 * quartic

    # the median of the square of a standard normal variable
    log_v, solved = _falling_root(excess, np.log(start / 0.45494))
    return float(np.exp(log_v)), solved


def _moments(squares: np.ndarray, factor: float, block: slice) -> tuple[float, float]:
    """Sums of q (1 - q)^3 and q (1 - q)^4 over q = factor * squares up to 1: g is c^2 times the latter."""
    q = squares[block] * factor
    np.minimum(q, 1.0, out=q)
    t = 1 - q
    q *= t
    q *= t
    q *= t
    return float(np.sum(q)), float(np.dot(q, t))


def _falling_root(function: Callable[[float], tuple[float, float]], x: float) -> tuple[float, bool]:
    """Where a function that rises and then falls below zero falls through it; or its maximum and False if it is below.

    The mean of g rises from zero (all weights zero) to a maximum and falls like 1/nu^2: where it falls through a is the
    consistent root. Should outliers make a second maximum, it is the root beside the start, which is the median.

    Newton's method inside a bracket. At its lower end the function is positive or still rises, at its upper end it is
    negative and falls; between lies the root, or a maximum below zero.
    """
    low, high = -np.inf, np.inf
    for _ in range(_MAX_PASSES):
        value, slope = function(x)
        upwards = value > 0 or slope >= 0
        low, high = (x, high) if upwards else (low, x)
        step = float(np.clip(-value / slope, -2, 2)) if slope < 0 else 1.0
        if slope < 0 and abs(step) < _SMALL:
            return x + step, True
        x += step
        if not low < x < high:
            x = (low + high) / 2
        if high - low < _SMALL:
            break
    return x, False
