"""Bounds of tests that look more than once: published ones, paths that are simulated, and the far ends."""

import numpy as np
import pytest
from scipy.special import ndtr, ndtri, stdtr

from nav_jax.statistics.sequential import (
    mixture_bound,
    mixture_p,
    normal_score,
    spending_bounds,
    spending_p,
    student_score,
)

EQUAL = [0.2, 0.4, 0.6, 0.8, 1.0]


def test_published_bounds_of_five_equal_looks():
    """Those of Jennison & Turnbull 2000 and of the R packages, with alpha/2 spent on each side."""
    np.testing.assert_allclose(spending_bounds(EQUAL), [4.877, 3.357, 2.680, 2.290, 2.031], atol=2e-3)


@pytest.mark.parametrize("alpha", [0.2, 0.05, 0.05 / 45])
def test_one_look_is_the_ordinary_test(alpha):
    assert 2 * ndtr(-spending_bounds([1.0], alpha)[0]) == pytest.approx(alpha, rel=1e-9)


@pytest.mark.parametrize("alpha", [0.2, 0.05, 0.05 / 45])
@pytest.mark.parametrize("t", [(0.5, 0.6, 1.0), (0.1, 0.7, 0.72), (0.3, 0.9, 1.0)])
def test_crossings_of_unequal_looks_by_another_quadrature(alpha, t):
    """What stays inside all bounds, on a fine grid by the trapezoidal rule; the spent part is the rest."""
    t, grid = np.array(t), 3001
    bounds = spending_bounds(t.tolist(), alpha)
    inside, at, before = np.ones(1), np.zeros(1), 0.0
    for now, bound in zip(t, bounds, strict=True):
        u = np.linspace(-min(bound, 9.0), min(bound, 9.0), grid) * np.sqrt(now)
        step, weight = np.sqrt(now - before), np.full(grid, u[1] - u[0])
        weight[[0, -1]] /= 2
        kernel = np.exp(-(((u[:, None] - at) / step) ** 2) / 2) / (step * np.sqrt(2 * np.pi))
        inside, at, before = weight * (kernel @ inside), u, now
    # half of alpha on each side, twice
    assert 1 - inside.sum() == pytest.approx(4 * ndtr(ndtri(alpha / 4) / np.sqrt(t[-1])), rel=1e-3)


@pytest.mark.parametrize(("alpha", "most"), [(0.05, 4096), (0.05 / 3, 5000), (0.3, 1000)])
def test_simulated_paths_cross_as_often_as_they_may(alpha, most):
    """200,000 Brownian paths at doubling sizes, to four standard errors."""
    looks = [64 * 2**k for k in range(20) if 64 * 2**k < most] + [most]
    t = np.array(looks) / most
    steps = np.sqrt(np.diff(t, prepend=0.0))
    paths = np.cumsum(np.random.default_rng(5).normal(size=(200_000, len(t))) * steps, axis=1)
    crossed = np.mean(np.any(np.abs(paths) / np.sqrt(t) > spending_bounds(t.tolist(), alpha), axis=1))
    assert abs(crossed - alpha) < 4 * np.sqrt(alpha * (1 - alpha) / 200_000)


@pytest.mark.parametrize("alpha", [0.05, 0.05 / 45, 1e-9])
@pytest.mark.parametrize("first", [1 / 128, 1e-4, 1e-9])
def test_a_first_look_that_spends_next_to_nothing(first, alpha):
    bounds = spending_bounds([first, 0.5, 1.0], alpha)
    assert bounds[0] > 8
    assert not np.any(np.isnan(bounds))
    np.testing.assert_allclose(bounds[1:], spending_bounds([0.5, 1.0], alpha), rtol=1e-5)


@pytest.mark.parametrize("last", [4097, 4100, 5000])
def test_a_last_look_that_follows_closely(last):
    """The bounds before it, and a bound that is near that of the same looks without the one before."""
    looks = [64 * 2**k for k in range(7)]
    bounds = spending_bounds([*(n / last for n in looks), 1.0])
    assert np.all(np.isfinite(bounds[1:]))
    assert bounds[-1] == pytest.approx(spending_bounds([n / last for n in (*looks[:-1], last)])[-1], rel=0.2)


@pytest.mark.parametrize("bad", [[], [0.5, 0.5], [0.0, 1.0], [0.5, 1.1], [0.6, 0.4], [np.nan]])
def test_shares_that_are_none(bad):
    with pytest.raises(ValueError, match="shares that increase"):
        spending_bounds(bad)


@pytest.mark.parametrize("alpha", [0.3, 0.05, 0.05 / 45, 1e-6])
@pytest.mark.parametrize("looks", [1, 3, 5])
def test_p_is_the_alpha_whose_bound_is_met(alpha, looks):
    t = EQUAL[:looks]
    assert spending_p(spending_bounds(t, alpha)[-1], t) == pytest.approx(alpha, rel=0.02)


def test_p_falls_with_z_and_stays_a_probability():
    p = [spending_p(z, EQUAL[:2]) for z in (0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, np.inf)]
    assert p[0] == pytest.approx(1.0)
    assert np.all(np.diff(p) <= 0)
    assert p[-1] < 1e-11


@pytest.mark.parametrize("num", [2, 64, 500, 100_000])
def test_mixture_bound_is_the_formula_and_its_p(num):
    alpha, r = 0.05, (-2 * np.log(0.05) + np.log(1 - 2 * np.log(0.05))) / 500
    half = np.sqrt(2 * (num * r + 1) / (num**2 * r) * np.log(np.sqrt(num * r + 1) / alpha))
    assert mixture_bound(num) == pytest.approx(half * np.sqrt(num), rel=1e-12)
    assert mixture_p(mixture_bound(num), num) == pytest.approx(alpha, rel=1e-9)
    assert mixture_p(0.0, num) == 1.0


def test_mixture_is_tightest_where_it_is_said():
    width = {n: mixture_bound(500, tightest_at=n) for n in (100, 400, 500, 600, 2000)}
    assert min(width, key=width.__getitem__) == 500


def test_mixture_holds_at_every_number():
    """5,000 paths of 2,000 runs: at most as many as may leave, and not next to none."""
    paths = np.cumsum(np.random.default_rng(6).normal(size=(5_000, 2_000)), axis=1)
    n = np.arange(1, 2001)
    z = np.abs(paths) / np.sqrt(n)
    left = np.mean(np.any(z > [mixture_bound(int(k)) for k in n], axis=1))
    assert 0.01 < left < 0.05 + 4 * np.sqrt(0.05 * 0.95 / 5_000)


@pytest.mark.parametrize("dof", [1, 15, 63, 5000])
@pytest.mark.parametrize("t", [-30.0, -2.0, 0.0, 0.1, 5.0, 12.0])
def test_scores_keep_the_tail(t, dof):
    z = normal_score(t, dof)
    assert np.sign(z) == np.sign(t)
    assert ndtr(-abs(z)) == pytest.approx(stdtr(dof, -abs(t)), rel=1e-9)
    assert student_score(abs(z), dof) == pytest.approx(abs(t), rel=1e-6, abs=1e-12)


def test_scores_of_no_scatter_at_all():
    assert normal_score(np.inf, 63) == np.inf
    assert normal_score(-np.inf, 63) == -np.inf
    assert student_score(np.inf, 63) == np.inf
