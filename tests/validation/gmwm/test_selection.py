"""Model selection on data of known origin."""

from collections import Counter
from dataclasses import replace

import jax
import numpy as np
import pytest
from helpers import SIGMAS

import gmwm_jax as gj
from gmwm_jax.variance.replicates import variance_draws

NUM_SAMPLES = 200_000


SUPERSET = "WN + QN + RW + GM"


TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.02, variance=0.1)")


def drawn(truth, num, seed):
    """Wavelet variances drawn from their theory under a truth, as channels."""
    x = gj.simulate("WN(sigma2=1.0)", NUM_SAMPLES, key=jax.random.key(0))
    wv = gj.wavelet_variance(np.asarray(x), rate=100.0)
    kinds = " + ".join(p.kind for p in truth.processes)
    true = replace(gj.fit(wv, kinds), model=truth)
    nu = variance_draws(true.fitted, true.wv_covariance)(jax.random.split(jax.random.key(seed), num))
    low, high = wv.ci_low / wv.variance, wv.ci_high / wv.variance
    columns = (nu.T, (nu * low).T, (nu * high).T)
    names = tuple(str(i) for i in range(num))
    return gj.variance.WaveletVariances(wv.scales, *columns, wv.num_samples, wv.level, 100.0, names, ("1",) * num)


@pytest.fixture(scope="module")
def data():
    return drawn(TRUTH, 3, 1)


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
    s = gj.select(drawn(truth, 20, 2), SUPERSET)
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
