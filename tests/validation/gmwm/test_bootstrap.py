"""The bootstrap: its replicates against theory, its intervals by coverage."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS, assert_mean
from programs import MEDIUM, TRUTH, drawn_channels, fitted

import gmwm_jax as gj


@pytest.fixture(scope="module")
def fit():
    return fitted()


@pytest.fixture(scope="module")
def boot(fit):
    return gj.bootstrap(fit, 1000, key=jax.random.key(6))


def test_both_routes_and_theory_agree(fit, boot, judge):
    """Standard deviations of the logs, 4.5 sigma of those of 200 and of 1000 draws; and the means."""
    records = gj.bootstrap(fit, 200, key=jax.random.key(7), route="records")
    assert records.num_failed == boot.num_failed == 0
    fast, slow = np.log(boot.good), np.log(records.good)
    theory = np.sqrt(np.diag(fit.covariance))
    routes = np.log(slow.std(axis=0) / fast.std(axis=0)) / np.sqrt(0.5 / 200 + 0.5 / 1000)
    judge("scatter by records over scatter by variances, in sigmas", routes, -SIGMAS, SIGMAS, num_draws=200)
    sandwich = np.log(fast.std(axis=0) / theory) / np.sqrt(0.5 / 1000)
    judge("scatter over theory, in sigmas", sandwich, -SIGMAS, SIGMAS, num_draws=1000)
    off = (slow.mean(axis=0) - fast.mean(axis=0)) / np.sqrt(slow.var(axis=0) / 200 + fast.var(axis=0) / 1000)
    judge("means by both routes apart, in sigmas", off, -SIGMAS, SIGMAS, num_draws=200)
    assert_mean(records.variances, fit.fitted)


def test_intervals_cover_and_the_test_has_its_size(judge):
    """200 data sets: 90 % intervals of each kind hold the truth, p below 10 % in 10 %, within 4.5 binomial sigmas.

    The data sets are wavelet variances drawn from theory under the truth; records are compared in another test.
    """
    num, level = 200, 0.9
    fits = gj.fit(drawn_channels(TRUTH, MEDIUM, num, 9), "WN + GM", weights="two-step")
    inside, small = {kind: np.zeros(3) for kind in ("percentile", "basic", "studentised")}, 0
    truth = np.array([1.0, 0.03, 0.2])
    for i, f in enumerate(fits.values()):
        boot = gj.bootstrap(f, 100, key=jax.random.fold_in(jax.random.key(10), i))
        small += boot.p_value < 0.1
        for kind in inside:
            low, high = boot.interval(kind, level)
            inside[kind] += (low < truth) & (truth < high)
    band = SIGMAS * np.sqrt(level * (1 - level) / num)
    for kind, counts in inside.items():
        judge(f"coverage of 90 % {kind} intervals", counts / num, level - band, level + band, num_draws=num)
    judge("share of p below 10 %", small / num, 0.1 - band, 0.1 + band, num_draws=num)
