"""Bounds on parameters: against scipy's constrained minimisers, and against fits in which the parameter is held."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from programs import MEDIUM, as_channels, draws, simulated

import gmwm_jax as gj
from gmwm_jax.fitting import estimate, posterior
from gmwm_jax.fitting._nnls import solve_between
from gmwm_jax.fitting.outcome import Outcome

COUNT = 300


@pytest.fixture(scope="module")
def wv():
    return simulated()


def objective_of(wv, model):
    """The default objective as residuals of the parameters on the real line, with their derivatives."""
    root = np.sqrt(np.diag(np.asarray(gj.fitting.weights.Default().omega(wv))))
    structure = gj.parse_model(model)

    @jax.jit
    def residuals(eta):
        return root * (wv.variance - structure.with_unconstrained(eta).wavelet_variance(wv.scales))

    slopes: Any = jax.jit(jax.jacfwd(residuals))
    return residuals, slopes


BOUNDS = [
    {"GM beta": (0.05, 0.5)},
    {"GM beta": (1e-4, 0.02)},
    {"GM beta": (0.001, 0.3)},  # holds the minimum
    {"WN sigma2": (1.02, 2.0)},
    {"WN sigma2": (0.5, 0.9), "GM beta": (0.04, 0.06)},
    {"GM variance": (0.3, np.inf)},
    {"GM variance": (0, 0.1), "WN sigma2": (1.1, 1.2)},
]


@pytest.mark.slow
@pytest.mark.parametrize("bounds", BOUNDS, ids=str)
def test_the_minimum_is_scipys(wv, bounds):
    """Least squares within the box by a trust region that reflects (Branch, Coleman & Li 1999), from many starts."""
    found = estimate(wv, "WN + GM", bounds=bounds)
    names, values = list(found.parameters), np.array([float(v) for v in found.parameters.values()])
    wide = {"WN sigma2": (1e-3, 1e2), "GM beta": (1e-5, 10.0), "GM variance": (1e-4, 1e2)}
    clipped = {k: (max(a, wide[k][0]), min(b, wide[k][1])) for k, (a, b) in bounds.items()}
    box = np.log([{**wide, **clipped}[name] for name in names])
    residuals, slopes = objective_of(wv, "WN + GM")
    starts = np.random.default_rng(0).uniform(*box.T, size=(12, 3))
    ends = [
        scipy.optimize.least_squares(residuals, x, slopes, tuple(box.T), xtol=1e-13, ftol=1e-13, gtol=1e-13)
        for x in starts
    ]
    best = min(ends, key=lambda end: end.cost)
    assert float(found.objective) <= 2 * best.cost * (1 + 1e-9)
    np.testing.assert_allclose(values, np.exp(best.x), rtol=1e-5)
    assert np.all((np.log(values) >= box[:, 0] - 1e-12) & (np.log(values) <= box[:, 1] + 1e-12))
    assert bool(found.converged)
    at_end = [np.any(np.isclose(v, bounds.get(n, (np.nan,)), rtol=1e-9)) for n, v in zip(names, values, strict=True)]
    np.testing.assert_array_equal(found.at_bound, at_end)


@pytest.mark.slow
def test_components_of_a_kind_have_their_own(wv):
    """They stay in their places; between them are the minima of all ways to place them."""
    bounds = {"GM_1 beta": (1e-3, 1e-2), "GM_2 beta": (0.05, 0.5)}
    found = estimate(wv, "WN + 2*GM", bounds=bounds)
    for name, (low, high) in bounds.items():
        assert low * (1 - 1e-12) <= float(found.parameters[name]) <= high * (1 + 1e-12)
    other = estimate(wv, "WN + 2*GM", bounds={"GM_1 beta": (0.05, 0.5), "GM_2 beta": (1e-3, 1e-2)})
    assert float(other.objective) == pytest.approx(float(found.objective), rel=1e-8)
    residuals, slopes = objective_of(wv, "WN + 2*GM")
    box = np.log([(1e-3, 1e2), bounds["GM_1 beta"], (1e-6, 1e2), bounds["GM_2 beta"], (1e-6, 1e2)])
    starts = np.random.default_rng(1).uniform(*box.T, size=(12, 5))
    best = min(scipy.optimize.least_squares(residuals, x, slopes, tuple(box.T)).cost for x in starts)
    assert float(found.objective) <= 2 * best * (1 + 1e-6)


def vector(found):
    return jnp.stack([jnp.asarray(v) for v in found.parameters.values()])


@pytest.mark.slow
def test_at_a_bound_the_derivative_is_that_of_the_held_problem(wv):
    """By the data; and by the bound, which is what holds it."""
    nu = jnp.asarray(wv.variance)

    def bounded(nu, high):
        found = estimate(replace(wv, variance=nu), "WN + GM", bounds={"GM beta": (1e-4, high)})
        return vector(found)

    def held(nu, beta):
        return vector(estimate(replace(wv, variance=nu), gj.WN() + gj.GM(beta=gj.Fixed(beta))))

    np.testing.assert_allclose(bounded(nu, 0.02), held(nu, 0.02), rtol=1e-9)
    for mine, its in zip(
        jax.jit(jax.jacfwd(bounded, (0, 1)))(nu, 0.02), jax.jit(jax.jacfwd(held, (0, 1)))(nu, 0.02), strict=True
    ):
        np.testing.assert_allclose(mine, its, rtol=1e-7, atol=1e-10 * np.abs(its).max())


@pytest.mark.slow
def test_at_a_bound_of_an_amplitude_too(wv):
    nu = jnp.asarray(wv.variance)

    def bounded(nu, low):
        return vector(estimate(replace(wv, variance=nu), "WN + GM", bounds={"WN sigma2": (low, 3.0)}))

    def held(nu, sigma2):
        return vector(estimate(replace(wv, variance=nu), gj.WN(gj.Fixed(sigma2)) + gj.GM()))

    for mine, its in zip(
        jax.jit(jax.jacfwd(bounded, (0, 1)))(nu, 1.05), jax.jit(jax.jacfwd(held, (0, 1)))(nu, 1.05), strict=True
    ):
        np.testing.assert_allclose(mine, its, rtol=1e-6, atol=1e-9 * np.abs(its).max())


@pytest.mark.slow
def test_vmap_over_data_and_bounds_is_the_loop(wv):
    batch = draws(gj.WN(1.0) + gj.GM(0.03, 0.2), MEDIUM, 6, 3)
    highs = np.array([0.02, 0.025, 0.03, 0.035, 0.04, 0.1])

    @jax.jit
    def of(nu, high):
        return vector(estimate(replace(wv, variance=nu), "WN + GM", bounds={"GM beta": (1e-4, high)}))

    together = jax.jit(jax.vmap(of))(batch, highs)
    np.testing.assert_allclose(together, [of(*each) for each in zip(batch, highs, strict=True)], rtol=1e-10)
    assert np.all(together[:, 1] <= highs * (1 + 1e-12))


def test_bounds_that_cannot_be_are_refused(wv):
    with pytest.raises(ValueError, match=r"no parameter 'GM tau'; there are WN sigma2, GM beta, GM variance"):
        estimate(wv, "WN + GM", bounds={"GM tau": (0.1, 0.2)})
    with pytest.raises(ValueError, match="lower one first"):
        estimate(wv, "WN + GM", bounds={"GM beta": (0.2, 0.1)})
    with pytest.raises(ValueError, match="lower one first"):
        estimate(wv, "WN + GM", bounds={"GM beta": (-0.2, 0.1)})
    with pytest.raises(ValueError, match="is held, and has bounds"):
        estimate(wv, "GM(beta=0.1 fixed)", bounds={"GM beta": (0.2, 0.3)})
    with pytest.raises(ValueError, match="searched for together"):
        estimate(wv, "ARMA(2,1)", bounds={"ARMA(2,1) phi1": (0.2, 0.3)})
    with pytest.raises(ValueError, match="lies beyond all that a record"):
        estimate(wv, "WN + GM", bounds={"GM beta": (100.0, np.inf)})


@pytest.mark.parametrize("columns", [1, 3, 6])
def test_the_linear_problem_is_scipys(columns):
    """`lsq_linear` by its active set (Stark & Parker 1995), problem by problem."""
    rng = np.random.default_rng(columns)
    B, y = rng.random((COUNT, 19, columns)), rng.normal(0.5, 1.0, (COUNT, 19))
    low = rng.choice([0.0, 0.1], (COUNT, columns))
    high = np.where(rng.random((COUNT, columns)) < 0.3, np.inf, low + rng.random((COUNT, columns)))
    B = B / np.linalg.norm(B, axis=1, keepdims=True)
    guess = rng.random((COUNT, columns)) < 0.5

    @jax.jit
    def solve(B, y, guess, low, high):
        b = jnp.einsum("crp,cr->cp", B, y)
        return solve_between(B.mT @ B, b, jnp.linalg.norm(y, axis=1), guess, low, high)

    x, passive = map(np.asarray, solve(B, y, guess, low, high))
    for i in range(COUNT):
        best = scipy.optimize.lsq_linear(B[i], y[i], (low[i], high[i]), method="bvls", tol=1e-14)
        cost = np.sum((y[i] - B[i] @ x[i]) ** 2) / 2
        assert cost <= best.cost * (1 + 1e-9)
    assert np.all((x >= low) & (x <= high))
    assert np.all(passive | (x == low) | (x == high))


# -- with intervals ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bounded(wv):
    return posterior(wv, "WN + GM", bounds={"GM beta": (1e-4, 0.02)})


def test_the_mode_between_bounds_is_the_constrained_minimum(wv, bounded):
    """Of the fit with the inverse covariance as weights: by scipy, and by the pure estimator."""
    found = estimate(wv, "WN + GM", weights=bounded.fits[0].omega, bounds={"GM beta": (1e-4, 0.02)})
    eta = np.asarray(bounded.density.eta(bounded.z))
    np.testing.assert_allclose(eta, found.model.unconstrained(), atol=1e-6)
    box = np.stack([bounded.density.low, bounded.density.high])
    minus_log = jax.jit(lambda z: jnp.sum(bounded.density.residuals(bounded.density.coordinates(z)) ** 2) / 2)
    best = scipy.optimize.minimize(minus_log, np.log([1.0, 0.01, 0.3]), jac=jax.jit(jax.grad(minus_log)),
                                   method="L-BFGS-B", bounds=box.T, options={"ftol": 1e-15, "gtol": 1e-9})  # fmt: skip
    np.testing.assert_allclose(eta, best.x, atol=1e-5)
    assert bounded.converged
    assert dict(bounded.at_bounds) == {"GM beta": Outcome.UPPER_BOUND}


@pytest.mark.slow
def test_what_is_at_a_bound_has_the_interval_inwards_and_the_others_follow(wv, bounded):
    """By the normal equations at the mode, in closed form."""
    table, z = bounded.parameters(), 1.959963984540054
    beta = table["GM", "beta"]
    assert beta.note is Outcome.UPPER_BOUND
    assert beta.value == pytest.approx(0.02, rel=1e-9)
    assert beta.ci_high == pytest.approx(0.02, rel=1e-9)
    J = np.asarray(jax.jacfwd(lambda eta: bounded.density.residuals(bounded.density.coordinates(eta)))(
        bounded.density.eta(bounded.z)))  # fmt: skip
    M = J.T @ J
    free, held = np.linalg.inv(M), np.linalg.inv(M[np.ix_([0, 2], [0, 2])])
    length = z * np.sqrt(free[1, 1])
    assert beta.ci_low == pytest.approx(0.02 * np.exp(-length), rel=1e-6)
    for k, name in enumerate([("WN", "sigma2"), ("GM", "variance")]):
        moves = -length * free[[0, 2][k], 1] / free[1, 1]
        half = z * np.sqrt(held[k, k])
        down, up = np.hypot(half, min(moves, 0)), np.hypot(half, max(moves, 0))
        assert np.log(table[name].value / table[name].ci_low) == pytest.approx(down, rel=1e-5)
        assert np.log(table[name].ci_high / table[name].value) == pytest.approx(up, rel=1e-5)
        assert bounded.covariance[[0, 2][k], [0, 2][k]] == pytest.approx(held[k, k], rel=1e-5)
    np.testing.assert_allclose(bounded.covariance[1], 0.0, atol=1e-15)


def test_bounds_that_hold_the_mode_change_only_the_ends(wv):
    plain, wide = posterior(wv, "WN + GM"), posterior(wv, "WN + GM", bounds={"GM beta": (0.025, 1.0)})
    np.testing.assert_allclose(wide.z, plain.z, atol=1e-7)
    assert not wide.at_bounds
    for mine, its in zip(wide.parameters(), plain.parameters(), strict=True):
        low = max(its.ci_low, 0.025) if mine.symbol == "beta" else its.ci_low
        assert mine.ci_low == pytest.approx(low, rel=1e-6)
        assert mine.ci_high == pytest.approx(its.ci_high, rel=1e-6)


@pytest.mark.slow
def test_a_shared_parameter_at_a_bound(wv):
    """Both channels have it there; as the one parameter that it is, it runs once."""
    second = draws(gj.WN(1.0) + gj.GM(0.03, 0.2), MEDIUM, 1, 8)[0]
    both = as_channels(wv, np.stack([wv.variance, second]))
    found = posterior(both, "WN + GM", shared=["GM beta"], bounds={"GM beta": (1e-4, 0.02)})
    assert dict(found.at_bounds) == {f"{c} GM beta": Outcome.UPPER_BOUND for c in "01"}
    a, b = found.parameters(0)["GM", "beta"], found.parameters(1)["GM", "beta"]
    assert a.ci_low == pytest.approx(b.ci_low, rel=1e-9)
    alone = posterior(both, "WN + GM", bounds={"0 GM beta": (1e-4, 0.02), "1 GM beta": (1e-4, 0.02)})
    assert a.ci_low > alone.parameters(0)["GM", "beta"].ci_low
    np.testing.assert_allclose(found.density.eta(found.z), alone.density.eta(alone.z), atol=1e-6)
    with pytest.raises(ValueError, match="contradicts the bounds"):
        posterior(both, "WN + GM", shared=["GM beta"], bounds={"0 GM beta": (1e-4, 0.02), "1 GM beta": (0.025, 1.0)})


@pytest.mark.slow
def test_the_density_ends_at_the_bounds(bounded):
    """And its mode moves with the bound alone where it is at one."""
    inside, outside = (bounded.density.coordinates(bounded.density.eta(bounded.z) + np.array([0, d, 0]))
                       for d in (-1e-3, 1e-3))  # fmt: skip
    assert np.isfinite(float(bounded.density(inside)))
    assert float(bounded.density(outside)) == -np.inf

    def mode(high):
        density = replace(bounded.density, high=bounded.density.high.at[1].set(high))
        return density.eta(gj.fitting.posterior_mode(density, jnp.asarray(bounded.z)))

    moves = jax.jit(jax.jacfwd(mode))(float(bounded.density.high[1]))
    assert float(moves[1]) == pytest.approx(1.0, rel=1e-9)
    step = 1e-4
    by_refits = (mode(np.log(0.02)) - mode(np.log(0.02) - step)) / step
    np.testing.assert_allclose(moves, by_refits, rtol=2e-3)


def test_bounds_in_place_of_a_prior(wv):
    """A process that the data put at a limit may have bounds instead of a prior, and is at one of them then."""
    walk = draws(gj.WN(1.0) + gj.RW(1e-4), MEDIUM, 1, 2)[0]
    one = as_channels(wv, walk[None])[0]
    with pytest.raises(ValueError, match="at a boundary"):
        posterior(one, "WN + GM")
    found = posterior(one, "WN + GM", bounds={"GM beta": (1e-4, 1.0)})
    assert dict(found.at_bounds) == {"GM beta": Outcome.LOWER_BOUND}
    beta = found.parameters()["GM", "beta"]
    assert beta.ci_low == pytest.approx(1e-4, rel=1e-9)
    assert 1e-4 < beta.ci_high <= 1.0
