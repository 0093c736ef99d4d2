"""Draws: recursions against a loop, moments and wavelet variances of many records against theory, named streams."""

import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from gmwm.cases import rows
from helpers import CountTraces, assert_mean

from gmwm_jax.processes._maths.recursion import first_order_recursion
from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.processes.simulation import simulate
from gmwm_jax.processes.white_noise import WN

NUM_RECORDS = 2000


def many(model, num_samples, key, num_records=NUM_RECORDS):
    """Records in rows."""
    draw = jax.jit(jax.vmap(lambda k: simulate(model, num_samples, key=k)))
    return np.asarray(draw(jax.random.split(key, num_records)))


# -- the recursion behind GM, AR1 and RW -----------------------------------------------------------------------------


recursion = jax.jit(first_order_recursion)


@pytest.mark.parametrize("num", [1, 5, 64, 65, 4096, 5000])
@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9999, 1.0, -0.3, -0.9999, -1.0])
def test_recursion_is_the_filter(num, phi):
    """x_t = phi x_{t-1} + e_t, against scipy's direct form; 5000 makes two levels of blocks."""
    rng = np.random.default_rng(num)
    e = rng.normal(size=num)
    for start in (0.0, 3.0):
        expected, _ = scipy.signal.lfilter([1.0], [1.0, -phi], e, zi=[phi * start])
        seen = recursion(jnp.asarray(phi), jnp.asarray(e), jnp.asarray(start))
        np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-11 * max(1.0, np.abs(expected).max()))


def test_recursion_is_the_loop():
    phi, x, e = -0.7, 2.0, np.random.default_rng(0).normal(size=130)
    expected = []
    for e_t in e:
        x = phi * x + e_t
        expected.append(x)
    np.testing.assert_allclose(recursion(jnp.asarray(phi), jnp.asarray(e), jnp.asarray(2.0)), expected, atol=1e-12)


def slopes_of_the_end(run):
    """In phi, the innovations and the start, of the squares of the last three."""
    return jax.jit(jax.grad(lambda *arguments: jnp.sum(run(*arguments)[-3:] ** 2), argnums=(0, 1, 2)))


by_scan = slopes_of_the_end(lambda phi, e, start: jax.lax.scan(lambda x, e_t: 2 * (phi * x + e_t,), start, e)[1])
by_blocks = slopes_of_the_end(first_order_recursion)


@pytest.mark.parametrize("phi", [0.0, 0.9, 1.0, -0.5])
def test_recursion_is_differentiable(phi):
    """In phi, the innovations and the start: against a scan."""
    e = np.random.default_rng(0).normal(size=200)
    for blocks, loop in zip(by_blocks(phi, e, 0.3), by_scan(phi, e, 0.3), strict=True):
        np.testing.assert_allclose(blocks, loop, rtol=1e-10, atol=1e-11)


# -- moments ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("process", [GM(1e-4, 2.0), AR1(0.9999, 1e-4), GM(1e-12, 2.0)])
def test_slow_processes_start_from_stationarity(process, key):
    """Var(X_1) is the variance of the process. (R's simts starts at zero: it would be 1e4 times too small.)"""
    first = jax.jit(jax.vmap(lambda k: process.simulate(2, k)))(jax.random.split(key, 4000))
    assert_mean(np.asarray(first) ** 2, float(process.autocovariance([0])[0]) * np.ones(2), sigmas=4.0)


# -- streams ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("added", [RW(0.1), QN(0.1), DR(0.01)], ids=repr)
def test_adding_a_component_leaves_the_others_as_they_were(added, key):
    """Common random numbers: a sum draws the sum of what its components draw alone, wherever they stand."""
    base = WN(1.0) + GM(0.1, 0.5)
    expected = simulate(base, 300, key=key) + simulate(added, 300, key=key)
    np.testing.assert_allclose(simulate(base + added, 300, key=key), expected, atol=1e-12)
    np.testing.assert_allclose(simulate(added + base, 300, key=key), expected, atol=1e-12)


def test_another_component_of_a_kind_leaves_the_others_as_they_were(key):
    """The second GM draws what it draws beside any other first one."""
    first, other, second = GM(0.1, 0.5), GM(0.3, 1.0), GM(0.01, 2.0)
    drawn = simulate(first + second, 300, key=key) - simulate(first, 300, key=key)
    again = simulate(other + WN(1.0) + second, 300, key=key) - simulate(other + WN(1.0), 300, key=key)
    np.testing.assert_allclose(drawn, again, atol=1e-12)


def test_components_of_one_kind_are_independent(key):
    first = many(GM(0.2, 1.0), 20, key)
    second = many(GM(0.2, 1.0) + GM(0.2, 1.0), 20, key) - first
    assert_mean(first * second, np.zeros(20))


def test_kinds_have_streams_of_their_own(key):
    """White noise is not the driving noise of the walk beside it."""
    white = many(WN(1.0), 20, key)
    steps = np.diff(many(RW(1.0), 20, key), axis=1)
    markov = many(GM(5.0, 1.0), 20, key)
    for other in (steps, markov[:, 1:]):
        assert_mean(white[:, 1:] * other, np.zeros(19))


def test_records_of_different_keys_differ(key):
    a, b = (simulate(WN(1.0), 50, key=k) for k in jax.random.split(key))
    assert not np.any(np.asarray(a) == np.asarray(b))


@pytest.mark.slow
def test_results_do_not_depend_on_vmap_or_jit(key):
    model = GM(0.01, 2.0) + QN(0.3)
    keys = jax.random.split(key, 5)
    one_by_one = np.stack([simulate(model, 200, key=k) for k in keys])
    together = jax.jit(jax.vmap(lambda k: simulate(model, 200, key=k)))(keys)
    chunked = jax.lax.map(lambda k: simulate(model, 200, key=k), keys, batch_size=2)
    np.testing.assert_allclose(together, one_by_one, rtol=0, atol=1e-11)
    np.testing.assert_allclose(chunked, one_by_one, rtol=0, atol=1e-11)


@pytest.mark.parametrize("case", rows())
def test_a_key_draws_one_record(case, key):
    model = Composite((case.cls(*case.parameters[0]),))
    np.testing.assert_array_equal(simulate(model, 40, key=key), simulate(model, 40, key=key))


def test_new_parameter_values_do_not_retrace(key, monkeypatch):
    counter = CountTraces(GM.simulate)
    monkeypatch.setattr(GM, "simulate", lambda self, *a: counter(self, *a))
    for k in range(3):
        simulate(GM(0.1 + 0.1 * k, 1.0 + k), 123, key=jax.random.fold_in(key, k))
    assert counter.count == 1


# -- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PROCESSES)
def test_incomplete_models_are_refused(kind, key):
    with pytest.raises(ValueError, match=f"{kind} has no value for"):
        simulate(kind, 10, key=key)


@pytest.mark.parametrize("num_samples", [0, -3])
def test_empty_records_are_refused(num_samples, key):
    with pytest.raises(ValueError, match="num_samples must be an integer of 1 or more"):
        simulate("WN(sigma2=1)", num_samples, key=key)


def test_the_length_may_be_numpys_integer(key):
    assert np.array_equal(simulate("WN(sigma2=1)", np.int64(10), key=key), simulate("WN(sigma2=1)", 10, key=key))


@pytest.mark.parametrize("wrong", [0, None, np.array([0, 1], dtype=np.uint32)])
def test_keys_are_typed(wrong):
    """Below the type checks of the test run, which users do not have."""
    with pytest.raises(TypeError, match=r"such as jax.random.key\(0\)"):
        inspect.unwrap(simulate)("WN(sigma2=1)", 10, key=wrong)


def test_model_text_and_one_sample(key):
    assert simulate("WN(sigma2=1) + GM(beta=0.1, variance=2)", 1, key=key).shape == (1,)


def test_single_precision_is_refused(key):
    model = WN(1.0)
    with jax.enable_x64(False), pytest.raises(RuntimeError, match="jax_enable_x64"):
        simulate(model, 10, key=key)


@pytest.mark.parametrize("model", [WN(2.0), GM(0.1, 3.0)], ids=repr)
def test_variances_of_a_few_records(model, key):
    """Of all samples of 64 records; means, covariances and wavelet variances of every process are in tests/validation.

    Of 64 * 200 samples with a correlation time of 10 some 640 are independent: 4.5 sigma are a quarter.
    """
    x = np.stack([np.asarray(simulate(model, 200, key=one)) for one in jax.random.split(key, 64)])
    np.testing.assert_allclose(np.var(x), float(model.autocovariance([0])[0]), rtol=0.25)
