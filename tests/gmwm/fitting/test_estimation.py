"""The estimator as a pure function: the same minimum as `fit`, under jit and vmap, and derivatives of every kind."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import CountTraces

import gmwm_jax as gj
from gmwm_jax.fitting import estimation

TRUTH = gj.WN(1.0) + gj.GM(0.03, 0.2)
WEIGHTS = ("default", "two-step", "covariance")


@pytest.fixture(scope="module")
def wv():
    return gj.wavelet_variance(gj.simulate(TRUTH, 20_000, key=jax.random.key(1)))


@pytest.fixture(scope="module")
def batch(wv):
    """Wavelet variances that scatter about as much as those of records do."""
    rng = np.random.default_rng(2)
    return wv.variance * np.exp(0.01 * rng.normal(size=(8, wv.num_scales)))


def vector(found):
    return jnp.stack([jnp.asarray(v) for v in found.parameters.values()])


def of_variance(wv, model, **options):
    """The estimates as a function of the wavelet variance."""
    return lambda nu: vector(gj.fitting.estimate(replace(wv, variance=nu), model, **options))


@pytest.fixture(scope="module")
def estimates(wv):
    return jax.jit(of_variance(wv, "WN + GM"))


@pytest.fixture(scope="module")
def by_variance(wv):
    return jax.jit(jax.jacfwd(of_variance(wv, "WN + GM")))


@pytest.mark.slow
@pytest.mark.parametrize("weights", WEIGHTS)
def test_it_is_the_fit(wv, weights):
    found, fit = gj.fitting.estimate(wv, "WN + GM", weights=weights), gj.fit(wv, "WN + GM", weights=weights)
    np.testing.assert_allclose(vector(found), [v for p in fit.model.processes for v in p.values], rtol=1e-8)
    assert float(found.objective) == pytest.approx(fit.objective, rel=1e-12)
    assert bool(found.converged)
    assert not np.any(found.at_zero)
    assert float(found.agreement) == pytest.approx(fit.agreement, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "model"),
    [
        (gj.GM(0.03, 0.2) + gj.WN(1.0), "2*GM + QN + WN"),  # components that are zero, and come last of their kind
        (gj.RW(1e-4) + gj.WN(1.0), "GM + WN"),  # at a limit
        (gj.WN(1.0) + gj.RW(1e-4), "WN + RW"),  # nothing to search for
    ],
)
def test_it_is_the_fit_at_boundaries_too(truth, model):
    wv = gj.wavelet_variance(gj.simulate(truth, 20_000, key=jax.random.key(3)))
    assert isinstance(wv, gj.variance.WaveletVariance)
    found, fit = gj.fitting.estimate(wv, model), gj.fit(wv, model)
    assert float(found.objective) == pytest.approx(fit.objective, rel=1e-12)
    np.testing.assert_allclose(found.model.wavelet_variance(wv.scales), fit.fitted, rtol=1e-6)
    np.testing.assert_array_equal(found.at_zero, [float(p.amplitude) == 0 for p in fit.model.processes])


@pytest.mark.slow
def test_vmap_is_the_loop(wv, batch, estimates):
    """Over arrays, and over a wavelet variance whose arrays have a leading axis."""
    loop = np.stack([estimates(nu) for nu in batch])
    together = jax.jit(jax.vmap(of_variance(wv, "WN + GM")))(batch)
    np.testing.assert_allclose(together, loop, rtol=1e-11)
    several = jax.tree.map(lambda a: jnp.broadcast_to(a, (len(batch), *a.shape)), wv)
    several = jax.tree.unflatten(jax.tree.structure(several), [jnp.asarray(batch), *jax.tree.leaves(several)[1:]])
    of_pytree = jax.jit(jax.vmap(lambda w: vector(gj.fitting.estimate(w, "WN + GM"))))(several)
    np.testing.assert_allclose(of_pytree, loop, rtol=1e-11)


@pytest.mark.slow
def test_new_numbers_compile_nothing(wv, batch, monkeypatch):
    counted = CountTraces(estimation._solve_once)
    monkeypatch.setattr(estimation, "_solve", jax.jit(counted, static_argnums=0))
    for nu in batch[:3]:
        gj.fitting.estimate(replace(wv, variance=nu), "WN + GM")
    assert counted.count == 1


def central(function, x, k, step=1e-4):
    """x_k d/dx_k from both sides: its error is the square of the step."""
    d = np.zeros_like(x)
    d[k] = step * x[k]
    return (np.asarray(function(x + d)) - np.asarray(function(x - d))) / (2 * step)


@pytest.mark.slow
def test_derivatives_are_those_of_refits(wv, estimates, by_variance):
    """To 1e-6 of the largest: a scale that hardly counts moves the estimates by less than their rounding."""
    J = np.asarray(by_variance(wv.variance)) * wv.variance
    for k in range(wv.num_scales):
        slope = central(estimates, wv.variance, k)
        np.testing.assert_array_less(np.abs(J[:, k] - slope), 1e-6 * np.abs(J).max(axis=1))


@pytest.mark.slow
def test_forward_and_reverse_agree(wv, by_variance):
    reverse = jax.jit(jax.jacrev(of_variance(wv, "WN + GM")))(jnp.asarray(wv.variance))
    np.testing.assert_allclose(reverse, by_variance(wv.variance), rtol=1e-10)


@pytest.mark.slow
def test_derivatives_are_the_first_order_expansion_of_the_fit(wv, by_variance):
    """The influence of the wavelet variance that standard errors are made from, but for the curvature beside residuals.

    B of `Fit.derivatives` is -(A'Omega A)^-1 A'Omega; here the residual bends A as well, by its size.
    """
    fit = gj.fit(wv, "WN + GM")
    # with moments that the model fits exactly, and weights that do not move with them, both are the same
    exact = replace(wv, variance=fit.fitted)
    J = jax.jit(jax.jacfwd(of_variance(exact, "WN + GM", weights=np.diag(fit.omega))))(jnp.asarray(fit.fitted))
    _, B = gj.fit(exact, "WN + GM", weights=np.diag(fit.omega)).derivatives
    np.testing.assert_allclose(J / vector(gj.fitting.estimate(exact, "WN + GM"))[:, None], B, rtol=1e-5, atol=1e-9)


@pytest.mark.slow
def test_derivatives_by_weights_and_by_held_values(wv):
    omega = np.diag(np.asarray(gj.fitting.weights.Default().omega(wv)))

    def of_weights(w):
        return vector(gj.fitting.estimate(wv, "WN + GM", weights=w))

    J, at = jax.jit(jax.jacfwd(of_weights))(jnp.asarray(omega)), jax.jit(of_weights)
    for k in (0, 6):
        np.testing.assert_allclose(J[:, k] * omega[k], central(at, omega, k, 1e-3), rtol=1e-5)

    def of_held(beta):
        model = gj.WN() + gj.GM(beta=gj.Fixed(beta)) + gj.RW()
        return vector(gj.fitting.estimate(wv, model))

    J = jax.jit(jax.jacfwd(of_held))(0.03)
    slope = central(lambda x: jax.jit(of_held)(x[0]), np.array([0.03]), 0) / 0.03
    assert float(J[1]) == 1.0
    np.testing.assert_allclose(J, slope, rtol=1e-6, atol=1e-12)


@pytest.mark.slow
def test_a_component_at_zero_stays_there(wv):
    """The derivative is that of the model without it."""
    nu = jnp.asarray(wv.variance)
    whole = jax.jit(jax.jacfwd(of_variance(wv, "WN + GM + RW")))(nu)
    part = jax.jit(jax.jacfwd(of_variance(wv, "WN + GM")))(nu)
    assert bool(gj.fitting.estimate(wv, "WN + GM + RW").at_zero[2])
    np.testing.assert_allclose(whole[:3], part, rtol=1e-7)
    np.testing.assert_array_equal(whole[3], 0.0)


@pytest.mark.slow
def test_a_scale_of_weight_zero_is_left_out(wv):
    weights = np.diag(np.asarray(gj.fitting.weights.Default().omega(wv))).copy()
    weights[[2, 7]] = 0.0
    J = jax.jit(jax.jacfwd(of_variance(wv, "WN + GM", weights=weights)))(jnp.asarray(wv.variance))
    np.testing.assert_array_equal(np.asarray(J)[:, [2, 7]], 0.0)
    wrong = wv.variance.copy()
    wrong[[2, 7]] *= 100
    low, high = np.minimum(wv.ci_low, wrong / 2), np.maximum(wv.ci_high, wrong * 2)
    fit = gj.fit(replace(wv, variance=wrong, ci_low=low, ci_high=high), "WN + GM", weights=weights)
    whole = gj.fit(wv, "WN + GM", weights=weights)
    np.testing.assert_allclose(fit.model.unconstrained(), whole.model.unconstrained(), rtol=1e-8)
    np.testing.assert_allclose(vector(gj.fitting.estimate(wv, "WN + GM", weights=weights)),
                               [v for p in fit.model.processes for v in p.values], rtol=1e-8)  # fmt: skip


@pytest.mark.slow
def test_the_objective_is_traced_in_all_it_takes(wv):
    """Envelope: at the minimum its derivative by the data is the partial one, -2 Omega r."""
    fit = gj.fit(wv, "WN + GM")

    def lowest(nu):
        return gj.fitting.estimate(replace(wv, variance=nu), "WN + GM", weights=np.diag(fit.omega)).objective

    def here(nu):
        return gj.fitting.objective(replace(wv, variance=nu), fit.model, weights=np.diag(fit.omega))

    nu = jnp.asarray(wv.variance)
    slope = 2 * fit.omega @ (wv.variance - fit.fitted)
    np.testing.assert_allclose(jax.jit(jax.grad(here))(nu), slope, rtol=1e-9)
    np.testing.assert_allclose(jax.jit(jax.grad(lowest))(nu), slope, rtol=1e-5, atol=1e-7 * np.abs(slope).max())


def test_what_is_no_pure_function_says_so(wv):
    with pytest.raises(TypeError, match=r"gmwm_jax\.fitting\.estimate"):
        jax.jit(lambda nu: gj.fit(replace(wv, variance=nu), "WN").objective)(wv.variance)
    with pytest.raises(ValueError, match="until nothing changes"):
        gj.fitting.estimate(wv, "WN", weights="iterated")
    rec = gj.datasets.simulated("mti-g", 2000, channels=["gyro_x", "gyro_y"])
    with pytest.raises(ValueError, match="takes one channel"):
        gj.fitting.estimate(gj.wavelet_variance(rec), "WN")
    with pytest.raises(ValueError, match="free parameters"):
        gj.fitting.estimate(wv, "WN + 7*GM")
    with pytest.raises(ValueError, match="zero at all scales"):
        gj.fit(wv, "WN", weights=np.zeros(wv.num_scales))


def test_results_are_pytrees(wv):
    """Their arrays go in and come out; what describes them stays, and of other scales it is another structure."""
    back = jax.jit(lambda w: w)(wv)
    assert isinstance(back, gj.variance.WaveletVariance)
    np.testing.assert_array_equal(back.variance, wv.variance)
    assert back.channels == wv.channels
    assert back.num_samples == wv.num_samples
    np.testing.assert_array_equal(back.scales, wv.scales)
    fit = gj.fit(wv, "WN + GM")
    doubled = jax.jit(lambda f: jax.tree.map(lambda a: 2 * a, f))(fit)
    assert doubled.status is fit.status
    assert float(doubled.model.processes[0].sigma2) == 2 * float(fit.model.processes[0].sigma2)
    shorter = gj.wavelet_variance(np.random.default_rng(0).normal(size=1000))
    assert jax.tree.structure(shorter) != jax.tree.structure(wv)
    assert jax.tree.structure(gj.wavelet_variance(np.ones(20_000) + np.arange(20_000) % 7.0)) == jax.tree.structure(wv)


@pytest.mark.slow
def test_estimates_print_themselves(wv, batch):
    """Alone, at a bound, as a batch, and while they are traced."""
    one = gj.fitting.estimate(wv, "WN + GM", bounds={"GM beta": (0.05, 0.5)})
    assert repr(one).startswith("Estimates: WN(sigma2=")
    assert "the search converged" in repr(one)
    assert repr(one).endswith("at a bound: GM beta")
    said = []

    def of(nu):
        found = gj.fitting.estimate(replace(wv, variance=nu), "WN + GM")
        said.append(repr(found))
        return found

    several = jax.jit(jax.vmap(of))(batch)
    assert said == ["Estimates: WN(sigma2=?) + GM(beta=?, variance=?)\ntraced"]
    assert "ShapeDtypeStruct" in repr(jax.eval_shape(of, batch[0]))
    assert f"a batch of {len(batch)}, of which {len(batch)} searches converged" in repr(several)
