"""Model selection on data of known origin."""

from collections import Counter

import jax
import numpy as np
import pytest
from helpers import SIGMAS
from programs import FAINT, LARGE, drawn_channels

import gmwm_jax as gj

SUPERSET = "WN + QN + RW + GM"


@pytest.fixture(scope="module")
def data():
    return drawn_channels(FAINT, LARGE, 3, 1)


@pytest.mark.parametrize(
    "truth",
    [
        "WN(sigma2=1.0) + GM(beta=0.02, variance=0.1)",
        "WN(sigma2=1.0) + RW(gamma2=1e-6)",
        "QN(q2=1.0) + RW(gamma2=1e-6)",
    ],
)
def test_the_truth_is_recommended(truth, judge):
    """In 90 % of 20 data sets or more."""
    truth = gj.parse_model(truth)
    s = gj.select(drawn_channels(truth, LARGE, 20, 2), SUPERSET)
    want = Counter(p.kind for p in truth.processes)
    hits = sum(Counter(p.kind for p in gj.parse_model(x.recommended.name).processes) == want for x in s.values())
    judge("share of data sets for which the truth is recommended", hits / 20, 0.9, 1, num_draws=20)


def test_optimism_by_replicates_is_that_of_theory(data, judge):
    """2 tr of a sample covariance of B replicates around 2 p: standard deviation 2 sqrt(2 p / B)."""
    num = 200
    s = gj.select(data["2"], SUPERSET, num_replicates=num, key=jax.random.key(4))
    c = s["WN + GM"]
    off = (c.optimism - 2 * c.num_parameters) / (2 * np.sqrt(2 * c.num_parameters / num))
    judge("optimism off theory, in sigmas", off, -SIGMAS, SIGMAS, num_draws=num)
    assert s.num_replicates == num
    assert "200 replicates" in repr(s)


def test_a_weak_random_walk_is_not_left_out():
    """In none of six data sets where the model without it would be rejected."""
    wv = drawn_channels(FAINT + gj.RW(1e-7), LARGE, 6, 5)
    for s in gj.select(wv, SUPERSET).values():
        assert s.recommended.p_value >= 0.01
        if s["WN + GM"].p_value < 0.01:
            assert s.recommended is s["WN + GM + RW"]
