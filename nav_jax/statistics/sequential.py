"""Tests that look at the data more than once: bounds on the statistic z that hold at all looks together.

A test at 5 % that is repeated as runs come in is wrong more often than that: at a look each 64 runs up to 4,096, one
time in three. Two ways to look and be right. Where the largest number of runs is stated, a group sequential test spends
the size over the looks (Lan & DeMets 1983; Jennison & Turnbull 2000, ch. 7). Where nobody states it, a confidence
sequence holds at every number of runs (Robbins 1970; Waudby-Smith, Arbour, Sinha, Kennedy & Ramdas 2024).
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float64
from scipy.special import log_ndtr, ndtr, ndtri, ndtri_exp, stdtr, stdtrit

from gmwm_jax._internal.checks import integer, number, probability
from gmwm_jax._internal.typing import Real

_NODES = 240
"""Of the quadrature over what the statistic was at the look before."""
_FARTHEST = 10.0
"""Sigmas beyond which nothing is integrated: 1e-23 of the paths go there."""
_MOST = 40.0
"""Sigmas that a bound may have and still be sought; beyond, a probability is no number."""
_LEAST_P = 1e-12


def spending_bounds(information: Sequence[float], alpha: Real = 0.05) -> Float64[np.ndarray, " K"]:
    r"""Bounds on \|z\| at K looks of a two-sided group sequential test, by spending like O'Brien & Fleming.

    On each side alpha/2 is spent, by the time t = n / N of a look f(t) = 2 (1 - Phi(z_{1 - alpha/4} / sqrt(t))) of it
    (Lan & DeMets 1983): hardly anything early, so that the last bound is nearly that of a single test.

    The statistic S_k = z_k sqrt(t_k) is a Brownian motion at times t_k. With g_{k-1} the density of S_{k-1} on the
    paths that have crossed no bound (Armitage, McPherson & Rowe 1969),

        P(first crossing at k, above) = int g_{k-1}(u) (1 - Phi((c_k - u) / sqrt(t_k - t_{k-1}))) du,

    which is f(t_k) - f(t_{k-1}) for the bound z_k = c_k / sqrt(t_k), and

        g_k(s) = int g_{k-1}(u) phi((s - u) / sqrt(t_k - t_{k-1})) du / sqrt(t_k - t_{k-1}),   |s| < c_k.

    Parameters
    ----------
    information
        t_k, shares of the largest number of runs, increasing, at most 1.
    alpha
        Probability of crossing a bound at any look where there is no difference.

    Returns
    -------
    Infinite where so little is spent that no number says it.

    Raises
    ------
    ValueError
        Shares that do not increase or are not in (0, 1], or an alpha that is no probability.

    Examples
    --------
    >>> nj.statistics.sequential.spending_bounds([0.2, 0.4, 0.6, 0.8, 1.0]).round(2)
    array([4.88, 3.36, 2.68, 2.29, 2.03])
    """
    t, alpha = np.asarray(information, float), probability("alpha", alpha)
    if t.ndim != 1 or not len(t) or np.any(np.diff(t, prepend=0.0) <= 0) or not t[-1] <= 1:
        raise ValueError(f"information are shares that increase up to 1 at most, and is {list(information)}.")
    return np.array(_bounds(tuple(t.tolist()), alpha))


_gauss = lru_cache(np.polynomial.legendre.leggauss)


@lru_cache(maxsize=512)
def _bounds(t: tuple[float, ...], alpha: float) -> tuple[float, ...]:
    x, w = _gauss(_NODES)
    log_spent = np.log(2) + log_ndtr(ndtri(alpha / 4) / np.sqrt(np.array(t)))
    bounds: list[float] = []
    u = density = np.zeros(0)
    for k, now in enumerate(t):
        if k == 0:
            bounds.append(_upper(float(log_spent[0])))
            c = min(bounds[0], _FARTHEST) * np.sqrt(now)
            u, of_now = c * x, np.exp(-((c * x) ** 2) / (2 * now)) / np.sqrt(2 * np.pi * now)
        else:
            step = np.sqrt(now - t[k - 1])
            spent = float(np.exp(log_spent[k]) * -np.expm1(log_spent[k - 1] - log_spent[k]))
            bounds.append(_crossing(u, density, step, spent, np.sqrt(now)))
            c = min(bounds[k], _FARTHEST) * np.sqrt(now)
            away = (c * x[:, None] - u) / step
            u, of_now = c * x, np.exp(-(away**2) / 2) @ density / (step * np.sqrt(2 * np.pi))
        density = c * w * of_now
    return tuple(bounds)


def _upper(log_probability: float) -> float:
    """The z that a normal variable exceeds with that probability."""
    return float(-ndtri_exp(log_probability)) if np.isfinite(log_probability) else np.inf


def _crossing(u: np.ndarray, density: np.ndarray, step: float, spent: float, scale: float) -> float:
    """The bound on z that a path which was at u crosses from below with the probability `spent`, by bisection."""
    low, high = 0.0, _MOST
    if not spent > float(ndtr((u - high * scale) / step) @ density):
        return np.inf
    for _ in range(60):
        middle = (low + high) / 2
        above = float(ndtr((u - middle * scale) / step) @ density) > spent
        low, high = (middle, high) if above else (low, middle)
    return (low + high) / 2


def spending_p(z: Real, information: Sequence[float]) -> float:
    r"""Return the smallest alpha whose bound \|z\| crosses at the last of the looks, to 2 % of itself.

    The repeated p value (Jennison & Turnbull 2000, sec. 9.2): it holds whatever made the test end at that look.

    Parameters
    ----------
    z
        Of the last look.
    information
        See `spending_bounds`.

    Examples
    --------
    >>> round(nj.statistics.sequential.spending_p(2.68, [0.2, 0.4, 0.6]), 3)
    0.05
    """
    log_alpha, bounds = _of_last(tuple(float(t) for t in information))
    # z^2 is nearly linear in log alpha
    return float(np.exp(np.interp(-(min(abs(float(z)), _MOST) ** 2), -(bounds**2), log_alpha)))


@lru_cache(maxsize=64)
def _of_last(information: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Log alpha, increasing, and the bound of the last look, decreasing."""
    log_alpha = np.linspace(np.log(_LEAST_P), np.log(0.999), 60)
    bounds = np.array([min(spending_bounds(information, float(np.exp(a)))[-1], _MOST) for a in log_alpha])
    # p = 1 for what no size would find
    return np.append(log_alpha, 0.0), np.append(bounds, 0.0)


def mixture_bound(num: int, alpha: Real = 0.05, *, tightest_at: int = 500, made_for: Real | None = None) -> float:
    r"""Bound on \|z\| that is crossed at any number of runs with the probability alpha, if there is no difference.

    The normal mixture of Robbins (1970) with the sample's variance, an asymptotic confidence sequence: its half width
    is, of n runs with the standard deviation s, s sqrt(2 (n r + 1) / (n^2 r) log(sqrt(n r + 1) / alpha)), and z is the
    mean over s / sqrt(n) (Waudby-Smith et al. 2024, theorem 2.2, with r = rho^2).

    Parameters
    ----------
    num
        n.
    alpha
        Of all numbers of runs together.
    tightest_at
        The number of runs at which the sequence is narrowest: r = (-2 log alpha + log(1 - 2 log alpha)) / that.
    made_for
        The alpha of that r, if another: one r for all sizes lets `mixture_p` be compared with each of them.

    Examples
    --------
    >>> round(nj.statistics.sequential.mixture_bound(500), 2)
    3.07
    """
    alpha, num = probability("alpha", alpha), integer("num", num, 1)
    nr = num * _rate(alpha if made_for is None else probability("made_for", made_for), tightest_at)
    return float(np.sqrt(2 * (nr + 1) / nr * (np.log(nr + 1) / 2 - np.log(alpha))))


def mixture_p(z: Real, num: int, alpha: Real = 0.05, *, tightest_at: int = 500) -> float:
    r"""Return the smallest size at which the sequence that is made for `alpha` excludes zero: `mixture_bound` solved.

    Examples
    --------
    >>> from nav_jax.statistics.sequential import mixture_bound, mixture_p
    >>> round(mixture_p(mixture_bound(200), 200), 6)
    0.05
    """
    alpha, num = probability("alpha", alpha), integer("num", num, 1)
    nr = num * _rate(alpha, tightest_at)
    return float(min(1.0, np.exp(np.log(nr + 1) / 2 - float(z) ** 2 * nr / (2 * (nr + 1)))))


def _rate(alpha: float, tightest_at: int) -> float:
    return (-2 * np.log(alpha) + np.log(1 - 2 * np.log(alpha))) / integer("tightest_at", tightest_at, 1)


def normal_score(t: Real, dof: int) -> float:
    """Return the normal variable that is as improbable as Student's t, with its sign."""
    tail = float(stdtr(integer("dof", dof, 1), -abs(number("t", t, negative_ok=True)))) if np.isfinite(t) else 0.0
    return float(np.copysign(-ndtri(tail), t))


def student_score(z: Real, dof: int) -> float:
    """Return Student's t that is as improbable as the normal variable z >= 0: `normal_score` the other way."""
    tail = float(ndtr(-number("z", z, zero_ok=True))) if np.isfinite(z) else 0.0
    return float(-stdtrit(integer("dof", dof, 1), tail)) if tail > 0 else np.inf
