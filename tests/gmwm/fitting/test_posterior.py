"""Priors, shared parameters and constraints: against grids, against closed forms, and against fits."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

import gmwm_jax as gj
from gmwm_jax.fitting import Constraint, Prior, posterior
from gmwm_jax.fitting.weights import Covariance, Default, TwoStep, Within

TRUTH = gj.WN(1.0) + gj.GM(0.03, 0.2)


@pytest.fixture(scope="module")
def wv():
    return gj.wavelet_variance(gj.simulate(TRUTH, 20_000, key=jax.random.key(1)))


@pytest.fixture(scope="module")
def two():
    data = np.stack([gj.simulate(TRUTH, 20_000, key=jax.random.key(k)) for k in (1, 2)], axis=1)
    return gj.wavelet_variance(gj.Recording(data, rate=100.0, channels=("a", "b"), units=("1", "1")))


@pytest.fixture(scope="module")
def plain(wv):
    return posterior(wv, "WN + GM")


@pytest.mark.slow
def test_without_anything_it_is_the_fit(wv, plain):
    fit = gj.fit(wv, "WN + GM", weights="covariance")
    np.testing.assert_allclose(plain.density.eta(plain.z), fit.model.unconstrained(), atol=1e-6)
    A, _ = fit.derivatives
    np.testing.assert_allclose(plain.covariance, np.linalg.inv(A.T @ fit.omega @ A), rtol=1e-5)
    assert float(plain.density(plain.z)) == pytest.approx(-fit.objective / 2, rel=1e-9)
    for mine, its in zip(plain.parameters(), fit.parameters(), strict=True):  # whose V is under the last fit
        assert mine.value == pytest.approx(its.value, rel=1e-5)
        assert mine.ci_high / mine.ci_low == pytest.approx(its.ci_high / its.ci_low, rel=0.05)


def test_a_prior_adds_its_precision(wv, plain):
    """Where the model is linear nearby: the mean of data and prior, each by its precision."""
    i, tight = 1, 1.0 + 1e-4  # a prior far sharper than the data decides, a far wider one does nothing
    found = posterior(wv, "WN + GM", priors={"GM beta": Prior(0.05, factor=tight)})
    eta = np.asarray(found.density.eta(found.z))
    assert eta[i] == pytest.approx(np.log(0.05), abs=1e-5)
    assert np.sqrt(found.covariance[i, i]) == pytest.approx(np.log(tight), rel=1e-3)
    held = gj.fit(wv, gj.WN() + gj.GM(beta=gj.Fixed(0.05)), weights=found.fits[0].omega)
    np.testing.assert_allclose(np.delete(eta, i), np.delete(held.model.unconstrained(), i), atol=1e-5)
    wide = posterior(wv, "WN + GM", priors={"GM beta": Prior(0.05, factor=1e300)})
    np.testing.assert_allclose(wide.z, plain.z, atol=1e-6)
    equal = np.sqrt(plain.covariance[i, i])
    both = posterior(
        wv, "WN + GM", priors={"GM beta": Prior(float(np.exp(plain.density.eta(plain.z)[i])), np.exp(equal))}
    )
    np.testing.assert_allclose(both.z, plain.z, atol=1e-6)
    assert both.covariance[i, i] == pytest.approx(plain.covariance[i, i] / 2, rel=1e-5)


@pytest.mark.slow
def test_the_mode_is_the_highest_point_of_a_grid(wv):
    model = gj.WN() + gj.GM(beta=gj.Fixed(0.03), variance=gj.Fixed(0.2))
    found = posterior(wv, model, priors={"WN sigma2": Prior(1.01, factor=1.02)})
    grid = np.linspace(-0.1, 0.1, 2001)
    values = jax.vmap(found.density)(jnp.asarray(found.z + grid[:, None]))
    assert abs(grid[int(np.argmax(values))]) <= 1e-4
    # second difference: the curvature, which for small residuals is the expected one
    curvature = -(values[1001] - 2 * values[1000] + values[999]) / 1e-8
    assert float(curvature) == pytest.approx(1 / found.covariance[0, 0], rel=0.1)


@pytest.mark.slow
def test_a_shared_parameter_is_one(two):
    found = posterior(two, "WN + GM", shared=["GM beta"])
    alone = posterior(two, "WN + GM")
    a, b = found.models.values()
    assert float(a.processes[1].beta) == pytest.approx(float(b.processes[1].beta), rel=1e-12)
    assert float(a.processes[1].variance) != float(b.processes[1].variance)
    i, j = (found.names.index(f"{c} GM beta") for c in "ab")
    assert found.covariance[i, i] == pytest.approx(found.covariance[i, j], rel=1e-9)
    # two records know it better than each of them: by inverse variances, if nothing else were to be known
    assert found.covariance[i, i] < min(alone.covariance[i, i], alone.covariance[j, j])
    assert len(found.z) == 5
    assert float(found.density(found.z)) < float(alone.density(alone.z))


@pytest.mark.slow
def test_constraints_hold(two):
    ten = Constraint({"GM variance": 1.0, "WN sigma2": -1.0}, np.log(0.2))
    found = posterior(two, "WN + GM", constraints=[ten])
    for model in found.models.values():
        assert float(model.processes[1].variance / model.processes[0].sigma2) == pytest.approx(0.2, rel=1e-9)
    one = posterior(two, "WN + GM", constraints=[Constraint({"a GM beta": 1.0}, np.log(0.02))])
    assert float(one.models["a"].processes[1].beta) == pytest.approx(0.02, rel=1e-9)
    assert float(one.models["b"].processes[1].beta) != pytest.approx(0.02, rel=1e-3)
    assert len(found.z) == 4
    assert len(one.z) == 5


@pytest.mark.slow
@pytest.mark.parametrize("solver", [optx.BFGS(rtol=1e-10, atol=1e-10), optx.Dogleg(rtol=1e-10, atol=1e-10)])
def test_another_solver_finds_the_same(wv, plain, solver):
    found = posterior(wv, "WN + GM", solver=solver)
    assert found.converged
    np.testing.assert_allclose(found.z, plain.z, atol=1e-5)


@pytest.mark.slow
def test_the_mode_moves_with_the_moments(wv, plain):
    """By the implicit adjoint of the solver, against differences."""

    def of(nu):
        density = replace(plain.density, nu=nu)
        return gj.fitting.posterior_mode(density, jnp.asarray(plain.z))

    nu = plain.density.nu
    slope = jax.jit(jax.jacfwd(of))(nu)[:, 0]
    at, k = jax.jit(of), 4
    d = jnp.zeros_like(nu).at[0, k].set(1e-4 * nu[0, k])
    expected = (at(nu + d) - at(nu - d)) / (2 * d[0, k])
    np.testing.assert_allclose(slope[:, k], expected, rtol=1e-3, atol=1e-5 * np.abs(slope).max())


@pytest.mark.slow
def test_draws_have_the_moments_of_the_posterior(wv):
    """Of one parameter, whose posterior is a sum over a grid; within five errors of 200 independent draws."""
    pytest.importorskip("blackjax")
    found = posterior(wv, gj.WN() + gj.GM(beta=gj.Fixed(0.03), variance=gj.Fixed(0.2)))
    draws = found.sample(2000, key=jax.random.key(5))[:, 0]
    sd = np.sqrt(found.covariance[0, 0])
    grid = np.linspace(-8, 8, 4001) * sd
    # eta of the one free parameter is z up to its sign
    points = found.z + grid[:, None] * np.sign(np.asarray(found.density.basis)[0, 0])
    log = np.asarray(jax.vmap(found.density)(jnp.asarray(points)))
    weight = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
    eta = float(found.density.eta(found.z)[0]) + grid
    mean = weight @ eta
    spread = np.sqrt(weight @ (eta - mean) ** 2)
    assert abs(draws.mean() - mean) < 5 * spread / np.sqrt(200)
    assert draws.std() == pytest.approx(spread, rel=0.2)


def test_what_cannot_be_is_refused(wv, two):
    with pytest.raises(ValueError, match="There is no parameter 'GM phi'"):
        posterior(wv, "WN + GM", priors={"GM phi": Prior(0.1, 2.0)})
    with pytest.raises(ValueError, match="above 1"):
        posterior(wv, "WN + GM", priors={"GM beta": Prior(0.1, 0.5)})
    with pytest.raises(ValueError, match="nothing to share"):
        posterior(wv, "WN + GM", shared=["GM beta"])
    with pytest.raises(ValueError, match="contradicts itself"):
        posterior(wv, "WN + GM", constraints=[Constraint({"GM beta": 1.0}, v) for v in (-3.0, -2.0)])
    zero = gj.wavelet_variance(gj.simulate(gj.WN(1.0), 5000, key=jax.random.key(0)))
    if gj.fit(zero, "WN + RW", weights="covariance").at_boundary:
        with pytest.raises(ValueError, match="at a boundary"):
            posterior(zero, "WN + RW")
        found = posterior(zero, "WN + RW", priors={"RW gamma2": Prior(1e-7, 3.0)})
        assert np.all(np.isfinite(found.z))
    with pytest.raises(ValueError, match="need the covariance"):
        posterior(replace(two, num_samples=None), "WN")


@pytest.mark.parametrize("of", [Default(), TwoStep(), Covariance()])
def test_weights_within_a_range_of_time(wv, of):
    """A fit of the scales within alone, and intervals by the sandwich of those."""
    weights = Within(shortest=8.0, longest=1024.0, of=of)
    fit = gj.fit(wv, "WN + GM", weights=weights)
    kept = (wv.times >= 8) & (wv.times <= 1024)
    np.testing.assert_array_equal(np.diag(fit.omega) > 0, kept)
    assert np.all(fit.omega[~kept] == 0)
    if of.inverts_covariance:
        V = fit.wv_covariance[np.ix_(kept, kept)]
        np.testing.assert_allclose(fit.omega[np.ix_(kept, kept)] @ V, np.eye(kept.sum()), atol=0.15)
    A, _ = fit.derivatives
    B = np.linalg.solve(A.T @ fit.omega @ A, A.T @ fit.omega)
    np.testing.assert_allclose(fit.covariance, B @ fit.wv_covariance @ B.T, rtol=1e-6)
    with pytest.raises(ValueError, match="no scale between"):
        gj.fit(wv, "WN", weights=Within(shortest=9.0, longest=10.0))
    with pytest.raises(ValueError, match="range of spans is empty"):
        Within(shortest=2.0, longest=1.0)


def test_it_prints_mode_deviation_and_interval(plain):
    """Standard deviations per sample are those on the real line times the slope there."""
    np.testing.assert_allclose(
        plain.standard_deviations, np.exp(plain.density.eta(plain.z)) * np.sqrt(np.diag(plain.covariance)), rtol=1e-12
    )
    head, _, *rows = repr(plain).splitlines()[3:]
    assert head.split() == ["component", "quantity", "mode", "sd", "95", "%", "low", "high", "unit"]
    assert [row.split()[3] for row in rows] == [f"{sd:.5g}" for sd in plain.standard_deviations]


def test_its_figure_shows_densities(plain):
    """The marginal of each parameter integrates to one; that of draws is beside it."""
    draws = np.random.default_rng(0).multivariate_normal(plain.density.eta(plain.z), plain.covariance, 4000)
    frames = gj.plotting.posterior_data(plain, draws=draws)
    assert [frame.x.label for frame in frames] == list(plain.names)
    for frame, name in zip(frames, plain.names, strict=True):
        histogram, curve = frame.items[:2]
        assert np.trapezoid(curve.y, curve.x) == pytest.approx(1.0, rel=1e-9)
        assert np.sum(histogram.counts * np.diff(histogram.edges)) == pytest.approx(1.0, rel=1e-9)
        middle = 0.5 * (histogram.edges[1:] + histogram.edges[:-1])
        np.testing.assert_allclose(histogram.counts, np.interp(middle, curve.x, curve.y), atol=0.2 * curve.y.max())
        mean, sd = plain.marginal(name)
        assert curve.x[np.argmax(curve.y)] == pytest.approx(np.exp(mean - sd**2), rel=0.02 * sd + 1e-3)
    with pytest.raises(ValueError, match="of 2 parameters, and the posterior has 3"):
        gj.plotting.posterior_data(plain, draws=draws[:, :2])
