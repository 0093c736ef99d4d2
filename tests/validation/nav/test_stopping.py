"""Rules of stopping on campaigns that cost nothing: lengths of errors are drawn, and looked at as those of runs are.

Of each campaign three filters have errors in common and some of their own: normal, exponential, and half of both:
differences are skewed. Their standard deviation is 1.
"""

import functools
from itertools import combinations

import numpy as np
import pytest

from nav_jax.simulation.stopping import Anytime, Precision, Significant, Watch, score
from nav_jax.statistics.sequential import student_score
from nav_jax.statistics.summaries import paired

CAMPAIGNS = 1000
MOST = 1024
PAIRS = 3


def lengths(seed, shift=0.0):
    """R lengths of three filters; the last is worse by `shift` standard deviations of a difference."""
    rng = np.random.default_rng([seed, 7])
    common = 10.0 + rng.exponential(1.0, (MOST, 1))
    normal, skewed = rng.normal(size=(MOST, 3)), rng.exponential(1.0, (MOST, 3)) - 1.0
    # two filters have half of the variance each, which their difference adds
    own = normal * np.sqrt([0.5, 0.25, 0.0]) + skewed * np.sqrt([0.0, 0.25, 0.5])
    return common + own + np.array([0.0, 0.0, shift])


def ended(rule, of):
    """What the rule makes of all runs."""
    error = {str(i): np.stack([of[:, i], 0 * of[:, i], 0 * of[:, i]], axis=1) for i in range(of.shape[1])}
    good = {name: np.ones(len(of), bool) for name in error}
    return Watch(rule, len(of), 0.0).look(len(of), error, good)


@functools.cache
def crossed(rule, shift=0.0):
    """Campaigns x pairs: whether the pair crosses its bound at any look, be the campaign at an end or not."""
    looks = rule.looks(MOST)
    bounds = [rule.bound(rule.alpha / PAIRS, looks[: k + 1], MOST) for k in range(len(looks))]
    found = np.zeros((CAMPAIGNS, PAIRS), bool)
    for seed in range(CAMPAIGNS):
        of = lengths(seed, shift)
        for pair, (i, j) in enumerate(combinations(range(3), 2)):
            difference = of[:, j] - of[:, i]
            found[seed, pair] = any(abs(score(difference[:n])) > c for n, c in zip(looks, bounds, strict=True))
    return found


@pytest.mark.parametrize(("rule", "least"), [(Significant(), 0.02), (Anytime(), 0.005)])
def test_false_alarms_of_all_pairs_and_looks(rule, least):
    """5 % wanted; the upper limit is that plus two standard errors of 1,000 campaigns."""
    share = crossed(rule).any(axis=1).mean()
    assert least <= share <= 0.065


@pytest.mark.parametrize("rule", [Significant(), Anytime()])
@pytest.mark.parametrize("pairs", [1, 3, 45])
def test_p_says_what_the_bound_says(rule, pairs):
    """At each look, to 2 %: who stops because filters are told apart has a table that says so."""
    looks = rule.looks(MOST)
    for k in range(1, len(looks) + 1):
        bound = rule.bound(rule.alpha / pairs, looks[:k], MOST)
        assert bound > 12 or pairs * rule.p(bound, looks[:k], MOST) == pytest.approx(rule.alpha, rel=0.02)


def test_power_is_about_that_of_one_test():
    """A difference of 0.12 sd, of one pair at alpha/3: the one test of all runs has at most 5 % more."""
    fixed = np.mean([paired(lengths(s, 0.12)[:, 2], lengths(s, 0.12)[:, 0]).p < 0.05 / PAIRS for s in range(CAMPAIGNS)])
    sequential = crossed(Significant(), 0.12)[:, 1].mean()
    assert 0.5 < fixed < 0.99
    assert fixed - 0.05 < sequential <= fixed + 0.02


@pytest.mark.parametrize("rule", [Significant(), Anytime()])
@pytest.mark.parametrize("shift", [0.0, 0.15, 0.4])
def test_intervals_hold_after_the_stop(rule, shift):
    """Of one pair: at least 95 %, less two standard errors; and a clear difference takes fewer runs."""
    covered, runs = [], []
    for seed in range(CAMPAIGNS):
        of = lengths(seed, shift)[:, [0, 2]]
        stop = ended(rule, of)
        n = stop.looks[-1]
        found = paired(of[:n, 1], of[:n, 0])
        half = student_score(rule.bound(0.05, stop.looks, MOST), n - 1) * found.se
        covered.append(abs(found.difference - shift) <= half)
        runs.append(n)
    assert np.mean(covered) >= 0.95 - 2 * np.sqrt(0.05 * 0.95 / CAMPAIGNS)
    assert shift != 0.4 or np.mean(runs) < MOST / 3


@pytest.mark.parametrize("se", [0.08, 0.06, 0.045])
def test_ordinary_intervals_hold_after_precision(se):
    covered, runs = [], []
    for seed in range(2 * CAMPAIGNS):
        of = lengths(seed)[:, :2]
        n = ended(Precision(difference=se), of).looks[-1]
        found = paired(of[:n, 1], of[:n, 0])
        covered.append(found.low <= 0.0 <= found.high)
        runs.append(n)
    assert 0.93 <= np.mean(covered) <= 0.96
    assert np.mean(runs) < MOST
