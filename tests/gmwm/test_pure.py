"""The table of pure functions, row by row."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pure import assert_pure, documented, found

import gmwm_jax as gj

RNG = np.random.default_rng(4)
THETA = (1.0, 0.05, 0.3)
SAMPLES = RNG.normal(size=40)
COLUMNS = RNG.normal(size=(30, 2))
TAU = np.array([2.0, 8.0, 32.0])


def model(x):
    return gj.WN(x[0]) + gj.GM(x[1], x[2])


def vector(one):
    return jnp.stack([jnp.asarray(v) for p in one.processes for v in p.values])


@cache
def measured():
    wv = gj.wavelet_variance(gj.simulate(model(THETA), 5000, key=jax.random.key(1)))
    assert isinstance(wv, gj.variance.WaveletVariance)
    return wv


def estimates(x):
    """By the wavelet variance at two scales, a weight and a value that is held."""
    wv = measured()
    nu = jnp.asarray(wv.variance) * jnp.ones(wv.num_scales).at[0].set(x[0]).at[4].set(x[1])
    weights = jnp.asarray(1 / (wv.ci_high - wv.ci_low) ** 2) * jnp.ones(wv.num_scales).at[2].set(x[2])
    held = gj.WN() + gj.GM(beta=gj.Fixed(x[3])) + gj.RW()
    outcome = gj.fitting.estimate(replace(wv, variance=nu), held, weights=weights)
    return jnp.stack([*(jnp.asarray(v) for v in outcome.parameters.values()), outcome.objective])


def searched(x):
    """With a shape to search for."""
    wv = measured()
    nu = jnp.asarray(wv.variance) * jnp.ones(wv.num_scales).at[4].set(x[0])
    outcome = gj.fitting.estimate(replace(wv, variance=nu), "WN + GM")
    return jnp.stack([jnp.asarray(v) for v in outcome.parameters.values()])


def objective(x):
    wv = measured()
    there = replace(wv, variance=jnp.asarray(wv.variance) * jnp.ones(wv.num_scales).at[3].set(x[3]))
    return gj.fitting.objective(there, model(x), weights=jnp.ones(wv.num_scales).at[1].set(x[4]))


CASES = {
    "processes.Composite.wavelet_variance": (lambda x: model(x).wavelet_variance(TAU), THETA),
    "processes.Composite.psd": (lambda x: model(x).psd(x[3:]), (*THETA, 0.01, 0.2)),
    "processes.Composite.autocovariance": (lambda x: model(x).autocovariance(np.arange(4.0)), THETA),
    "processes.Composite.unconstrained": (lambda x: model(x).unconstrained(), THETA),
    "processes.Composite.with_unconstrained": (lambda x: vector(model(THETA).with_unconstrained(x)), (0.1, -3.0, -1.0)),
    "processes.simulate": (lambda x: gj.simulate(model(x), 20, key=jax.random.key(3)), THETA),
    "processes.whiten": (lambda x: gj.processes.whiten(model(x), COLUMNS * x[3]).columns, (*THETA, 2.0)),
    "processes.generalised_least_squares": (
        lambda x: gj.processes.generalised_least_squares(model(x), COLUMNS[:, 0] * x[3], COLUMNS[:, 1:]).estimates,
        (*THETA, 2.0),
    ),
    "processes.covariance_times": (lambda x: gj.processes.covariance_times(model(x), COLUMNS * x[3]), (*THETA, 2.0)),
    "variance.haar_wavelet_variance": (gj.variance.haar_wavelet_variance, SAMPLES),
    "variance.haar_dwt_variance": (gj.variance.haar_dwt_variance, SAMPLES),
    "variance.block_sums": (lambda x: gj.variance.block_sums(x, 9).squares, SAMPLES),
    "variance.wv_covariance": (lambda x: gj.variance.wv_covariance(model(x), 100, 4), THETA),
    "fitting.objective": (objective, (*THETA, 1.0, 0.7)),
    "fitting.estimate": (estimates, (1.01, 0.99, 1.1, 0.04)),
}


@pytest.fixture(scope="module", autouse=True)
def _prepared():
    """Not while something is traced."""
    measured()


def test_every_row_has_a_case():
    assert documented(gj) == list(CASES)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_is_documented_as_pure_is(name):
    function, x = CASES[name]
    assert callable(found(gj, name))
    assert_pure(function, x)


@pytest.mark.slow
def test_the_estimator_that_searches_is_pure():
    assert_pure(searched, (1.02,))
