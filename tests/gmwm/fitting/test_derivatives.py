"""What may be differentiated, and what says that it may not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting.problem import Problem
from gmwm_jax.fitting.reduced import Data
from gmwm_jax.fitting.search import minimise, minimise_near

TRUTH = gj.WN(1.0) + gj.GM(0.03, 0.2)


@pytest.fixture(scope="module")
def wv():
    return gj.wavelet_variance(gj.simulate(TRUTH, 20_000, key=jax.random.key(1)))


def test_the_objective_is_a_function_of_the_parameters(wv):
    """Its derivative in the variance of white noise is -2 r' Omega/tau, and jit and vmap leave it what it is."""

    def objective(sigma2):
        return gj.fitting.objective(wv, gj.WN(sigma2) + gj.GM(0.03, 0.2))

    at = 0.9
    fitted = np.asarray((gj.WN(at) + gj.GM(0.03, 0.2)).wavelet_variance(wv.scales))
    residual, omega = wv.variance - fitted, np.diag(1 / (wv.ci_high - wv.ci_low) ** 2)
    value, slope = jax.value_and_grad(objective)(at)
    assert isinstance(objective(at), float)
    assert objective(at) == pytest.approx(residual @ omega @ residual, rel=1e-12)
    assert float(value) == pytest.approx(objective(at), rel=1e-12)
    assert float(jax.jit(objective)(at)) == pytest.approx(objective(at), rel=1e-12)
    assert float(slope) == pytest.approx(-2 * residual @ omega @ (1 / wv.scales), rel=1e-10)
    assert float(jax.jit(lambda x: jax.jvp(objective, (x,), (1.0,))[1])(at)) == pytest.approx(float(slope), rel=1e-12)
    np.testing.assert_allclose(
        jax.jit(jax.vmap(objective))(np.array([0.8, at])), [objective(0.8), objective(at)], rtol=1e-12
    )


@pytest.mark.slow
def test_the_objective_is_level_at_the_minimum(wv):
    fit = gj.fit(wv, "WN + GM")
    eta = fit.model.unconstrained()
    slopes = jax.jit(jax.grad(lambda x: gj.fitting.objective(wv, fit.model.with_unconstrained(x))))(eta)
    assert np.abs(slopes).max() < 1e-4 * fit.objective


@pytest.fixture(scope="module")
def searches(wv):
    """The two searches as functions of the whitened wavelet variance."""
    problem, tau = Problem.of(TRUTH, float(wv.scales[-1])), wv.scales
    placements, nodes = problem.starting_points(None)
    near = problem.starts_near()
    whitener = np.diag(1 / (wv.ci_high - wv.ci_low))

    def data(y):
        return Data(y, jnp.asarray(whitener), jnp.asarray(tau), problem.bounds, problem.shapes, problem.held)

    def everywhere(y):
        return minimise(problem.layout, placements, nodes, data(y)).objective

    def nearby(y):
        return minimise_near(problem.layout, near, data(y)).objective

    return jnp.asarray(whitener @ wv.variance), {"minimise": everywhere, "minimise_near": nearby}


@pytest.mark.parametrize("name", ["minimise", "minimise_near"])
def test_a_search_has_no_derivatives_and_says_so(searches, name):
    y, search = searches[0], searches[1][name]
    for differentiated in (
        lambda: jax.jvp(search, (y,), (y,)),
        lambda: jax.grad(search)(y),
        lambda: jax.grad(jax.jit(search))(y),
        lambda: jax.jacfwd(jax.vmap(search))(y[None]),
    ):
        with pytest.raises(NotImplementedError, match=rf"of GM \+ WN has no derivatives .* `{name}` is a search"):
            differentiated()


@pytest.mark.slow
def test_a_search_is_still_jitted_and_vmapped(searches):
    y, both = searches
    objectives = [float(jax.jit(jax.vmap(search))(y[None])[0]) for search in both.values()]
    assert objectives[0] == pytest.approx(objectives[1], rel=1e-8)
