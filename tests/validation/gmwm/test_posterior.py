"""Intervals of the posterior by coverage: with shared parameters, with constraints, and with priors that are right."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import SIGMAS
from programs import MEDIUM, TRUTH, blank, draws, with_variance

import gmwm_jax as gj
from gmwm_jax.fitting import Constraint, Prior, posterior, posterior_mode
from gmwm_jax.variance.replicates import theory_draws

NUM = 500
TWICE = (gj.WN(2.0), gj.GM(0.03, 0.1))
"""The second channel: the same correlation time, other amplitudes."""

CASES = {
    "nothing more": {},
    "a shared correlation time": {"shared": ["GM beta"]},
    "a constraint": {"constraints": [Constraint({"a GM variance": 1.0, "b GM variance": -1.0}, np.log(2.0))]},
    "priors": {"priors": {"GM beta": Prior(0.03, factor=1.1), "b GM variance": Prior(0.1, factor=1.05)}},
}


@pytest.fixture(scope="module")
def records():
    """Two channels, whose truth is known, and their theory."""
    truths = (TRUTH, TWICE[0] + TWICE[1])
    data = np.stack([gj.simulate(t, MEDIUM, key=jax.random.key(k)) for k, t in enumerate(truths)], axis=1)
    return truths, gj.wavelet_variance(gj.Recording(data, rate=100.0, channels=("a", "b"), units=("1", "1")))


@pytest.mark.parametrize("case", CASES)
def test_intervals_cover(records, case, judge):
    """95 % of 500 data sets; where there is a prior, its median scatters about the truth as the prior says.

    The weights are those of one data set: to first order that makes no difference.
    """
    truths, wv = records
    found = posterior(wv, "WN + GM", **CASES[case])
    truth = np.concatenate([np.asarray(t.unconstrained()) for t in truths])
    nu = []
    for i, t in enumerate(truths):
        draw = theory_draws(t, wv[i], np.asarray(wv[i].covariance_under(t)))
        nu.append(np.asarray(draw(jax.random.split(jax.random.key(20 + i), NUM))))
    nu = np.stack(nu, axis=1)
    precision = np.asarray(found.density.precision)
    sd = np.divide(1.0, precision, out=np.zeros_like(precision), where=precision > 0)
    median = truth + sd * np.random.default_rng(3).normal(size=(NUM, len(truth)))

    @jax.jit
    @jax.vmap
    def modes(nu, median):
        density = replace(found.density, nu=nu, median=median)
        return density.eta(posterior_mode(density, jnp.asarray(found.z)))

    error = np.asarray(modes(jnp.asarray(nu), jnp.asarray(median))) - truth
    assert np.all(np.isfinite(error))
    inside = np.mean(np.abs(error) < 1.96 * np.sqrt(np.diag(found.covariance)), axis=0)
    band = SIGMAS * np.sqrt(0.95 * 0.05 / NUM)
    # V from one data set is off by its own scatter, some percent of the width
    judge(f"coverage of 95 % with {case}", inside, 0.95 - band - 0.01, 0.95 + band + 0.01, num_draws=NUM)


NUM_BOUNDED = 200
BOUNDED = {
    "a bound at the truth": {"GM beta": (0.03, 0.3)},
    "two bounds, one near the truth and one at it": {"GM beta": (0.028, 0.3), "WN sigma2": (0.5, 1.0)},
}


@pytest.mark.parametrize("case", BOUNDED)
def test_intervals_beside_bounds_cover(case, judge):
    """Of the parameter at the bound and of the others: 95 % or more, where about half of the estimates are at it."""
    truth, inside = [float(x) for p in TRUTH.processes for x in p.values], []
    for row in draws(TRUTH, MEDIUM, NUM_BOUNDED, 11):
        found = posterior(with_variance(blank(MEDIUM), np.asarray(row)), "WN + GM", bounds=BOUNDED[case])
        assert found.converged
        pairs = zip(found.parameters(), truth, strict=True)
        inside.append([e.ci_low * (1 - 1e-9) <= x <= e.ci_high * (1 + 1e-9) for e, x in pairs])
    band = SIGMAS * np.sqrt(0.95 * 0.05 / NUM_BOUNDED)
    seen = np.mean(inside, axis=0)
    judge(f"coverage of 95 % beside {case}", seen, 0.95 - band - 0.01, 1.0, num_draws=NUM_BOUNDED)
