"""Means by two levels: the variance that is stated, by drawing the whole thing many times."""

import numpy as np
import pytest

import nav_jax as nj
from nav_jax.statistics.distributions import mean_length

REPEATS = 4000


def drawn(rng, N, n, of_difference):
    """Many repeats: cheap values, and dear ones that have another mean, a heavy tail, and differ by so much."""
    cheap = rng.exponential(2.0, (N, REPEATS))
    dear = cheap[:n] + 0.3 + 0.2 * cheap[:n] * of_difference + of_difference * rng.normal(size=(n, REPEATS))
    return cheap, cheap[:n], dear


@pytest.mark.parametrize("of_difference", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("n", [30, 200])
def test_it_is_unbiased_and_states_its_error(n, of_difference):
    """Over 4000 repeats: the mean within 4 sigma, the stated variance within 5 % of the one seen."""
    found = nj.statistics.two_level_mean(*drawn(np.random.default_rng(1), 200, n, of_difference))
    truth = 2.0 + 0.3 + 0.4 * of_difference
    sd = found.value.std(ddof=1)
    assert abs(found.value.mean() - truth) < 4 * sd / np.sqrt(REPEATS)
    assert np.mean(found.se**2) == pytest.approx(sd**2, rel=4 * np.sqrt(8 / REPEATS))
    covered = np.mean(np.abs(found.value - truth) < 2.05 * found.se)
    assert 0.93 < covered < 0.975
    np.testing.assert_allclose(found.correction.mean(), 0.3 + 0.4 * of_difference, atol=5 * sd / np.sqrt(REPEATS))


def test_with_all_runs_of_both_kinds_it_is_the_mean_of_the_dear_ones():
    cheap, same, dear = drawn(np.random.default_rng(2), 50, 50, 0.5)
    found = nj.statistics.two_level_mean(cheap, same, dear)
    np.testing.assert_allclose(found.value, dear.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(found.se, dear.std(axis=0, ddof=1) / np.sqrt(50), rtol=1e-9)


@pytest.mark.parametrize("of_difference", [0.0, 0.1, 2.0])
def test_a_known_mean_needs_no_cheap_values_of_its_own(of_difference):
    """Over 4000 repeats, of 30 runs: the mean within 4 sigma, the stated variance, and how often an interval covers."""
    _, same, dear = drawn(np.random.default_rng(3), 30, 30, of_difference)
    found = nj.statistics.controlled_mean(np.full(REPEATS, 2.0), same, dear)
    truth = 2.0 + 0.3 + 0.4 * of_difference
    sd = found.value.std(ddof=1)
    assert abs(found.value.mean() - truth) <= 4 * sd / np.sqrt(REPEATS) + 1e-12
    assert np.mean(found.se**2) == pytest.approx(sd**2, rel=4 * np.sqrt(8 / REPEATS))
    if of_difference:
        assert 0.93 < np.mean(np.abs(found.value - truth) < 2.05 * found.se) < 0.97


@pytest.mark.parametrize("sds", [(1.0, 2.0, 0.3), (2.0, 2.0, 2.0), (0.0, 0.0, 3.0), (0.0, 1.0, 1.0), (0.0, 0.0, 0.0)])
def test_a_mean_length_is_that_of_draws(sds):
    """400,000 of them, along axes that are turned, 4 sigma; exact for a sphere, a disc and a line."""
    rng = np.random.default_rng(5)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    found = float(mean_length(turn @ np.diag(np.square(sds)) @ turn.T))
    lengths = np.linalg.norm(rng.normal(size=(400_000, 3)) * sds, axis=1)
    assert abs(lengths.mean() - found) <= 4 * lengths.std() / np.sqrt(len(lengths))
    exact = {1: np.sqrt(2 / np.pi), 2: np.sqrt(np.pi / 2), 3: np.sqrt(8 / np.pi)}
    if len(set(filter(None, sds))) == 1:  # chi with 1, 2 or 3 degrees of freedom
        assert found == pytest.approx(exact[np.count_nonzero(sds)] * max(sds), rel=1e-7)


@pytest.mark.parametrize("ratio", [1e-4, 1e-2, 0.3])
def test_so_many_dear_values_keep_the_variance(ratio):
    """By the formula of the variance itself, in numbers of runs: one fewer would exceed it."""
    N = 5000
    n = nj.statistics.num_dear(ratio, N, 0.05)

    def variance(n):
        return (1 - ratio) / N + ratio / n

    assert variance(n) <= 1.05 / N * (1 + 1e-12)
    assert variance(n - 1) > 1.05 / N


def test_refusals():
    x = np.ones((3, 2))
    with pytest.raises(ValueError, match="at most the 3 cheap ones: there are 1"):
        nj.statistics.two_level_mean(x, x[:1], x[:1])
    with pytest.raises(ValueError, match="one shape"):
        nj.statistics.two_level_mean(x, x[:2], x)
    with pytest.raises(ValueError, match="there is 1"):
        nj.statistics.controlled_mean(x[0], x[:1], x[:1])
    with pytest.raises(ValueError, match="one shape"):
        nj.statistics.controlled_mean(x, x, x)
    assert nj.statistics.num_dear(0.0, 100) == 2
    with pytest.raises(ValueError, match="ratio must be"):
        nj.statistics.num_dear(-1.0, 100)
