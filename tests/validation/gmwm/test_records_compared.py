"""Tests of whether records share their parameters: size and power."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS
from programs import sets_of_records
from scipy import stats

import gmwm_jax as gj


@pytest.fixture(scope="module")
def records():
    return sets_of_records(1, 1)[0]


@pytest.fixture(scope="module")
def joint(records):
    return gj.fit_records(records, "WN + GM", weights="two-step")


@pytest.fixture(scope="module")
def same_test(joint):
    return gj.multisignal.near_stationarity(joint, 300, key=jax.random.key(4))


def test_size_and_power(judge):
    """20 sets of records with the same parameters: both tests are uniform; five with other times: the second rejects.

    Cochran's Q of 3 degrees of freedom has variance 6. The benchmark has 500 sets.
    """
    num, Q, p, p_all = 20, [], [], []
    for b, wvs in enumerate(sets_of_records(num, 3)):
        fit = gj.fit_records(wvs, "WN + GM", weights="two-step")
        comparison = gj.multisignal.compare_records(fit)
        Q.append([s.statistic for s in comparison.spreads])
        p_all.append(comparison.p_value)
        p.append(gj.multisignal.near_stationarity(fit, 63, key=jax.random.fold_in(jax.random.key(5), b)).p_value)
    band = SIGMAS * np.sqrt(6 / num)
    judge("mean of Cochran's Q of 3 degrees of freedom", np.mean(Q, axis=0), 3 - band, 3 + band, num_draws=num)
    for name, values in {"near-stationarity": p, "all parameters": p_all}.items():
        off, share = (np.mean(values) - 0.5) * np.sqrt(12 * num), np.mean(np.array(values) < 0.05)
        judge(f"mean p of {name} off 1/2, in sigmas", off, -SIGMAS, SIGMAS, num_draws=num)
        most = 0.05 + SIGMAS * np.sqrt(0.05 * 0.95 / num)
        judge(f"size of the test of {name} at 5 %", share, 0, most, num_draws=num)
    found = [
        gj.multisignal.near_stationarity(
            gj.fit_records(wvs, "WN + GM", weights="two-step"), 63, key=jax.random.key(b)
        ).p_value
        for b, wvs in enumerate(sets_of_records(5, 6, spread=0.7))
    ]
    judge("power of the test of near-stationarity", np.mean(np.array(found) < 0.05), 0.8, 1, num_draws=5)


def test_both_routes_agree(joint, same_test):
    """The distribution of the objective (Kolmogorov & Smirnov, p > 1e-5)."""
    slow = gj.multisignal.near_stationarity(joint, 60, key=jax.random.key(8), route="records")
    assert slow.num_failed == 0
    assert stats.ks_2samp(slow.objective, same_test.objective).pvalue > 1e-5
    assert slow.objective.std() > 0.3 * slow.objective.mean() / np.sqrt(20)
