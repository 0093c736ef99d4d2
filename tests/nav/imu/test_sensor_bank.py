"""Sensor states over a covariance step, against the whole system of samples written out, without any recursion."""

from functools import cache

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.imu.bank import alone, by_channel, step_noise

RATE = 100.0
MODELS = {
    "Markov": gj.WN(1e-4) + gj.AR1(0.9, 2e-5) + gj.AR1(0.99, 1e-6),
    "random walk": gj.WN(1e-4) + gj.RW(1e-5),
    "drift": gj.WN(1e-4) + gj.DR(1e-2) + gj.AR1(0.5, 1e-5),
    "white": gj.WN(1e-4),
}


@cache
def bank_of(which):
    """Models differ from axis to axis; two axes have a turn-on bias."""
    model = MODELS[which]
    return nj.ImuErrors([model, gj.WN(2e-4), model], [gj.WN(1e-6) + gj.RW(1e-8), model, gj.WN(1e-6)], RATE,
                        accel_bias_sd=[0.0, 0.1, 0.2]).bank()  # fmt: skip


STEPS = {
    "one": ([0.01], [1]),
    "part": ([0.004], [0]),
    "rest": ([0.006], [1]),
    "three": ([0.01] * 3, [1] * 3),
    "ten": ([0.01] * 10, [1] * 10),
    "cut and filled up": ([0.006, 0.01, 0.01, 0.003, 0.0, 0.0], [1, 1, 1, 0, 0, 0]),
    "empty": ([0.0] * 3, [0] * 3),
}


def written_out(bank, dt, ends):
    """Every random number a column: the state at the start, w of each sample that ends, v of each piece.

    Returns the matrices of y (6) and of the state at the end, and the covariance of the columns.
    """
    M, n = len(bank.states), len(dt)
    size = M + n * M + n * 6
    x = np.hstack([np.eye(M), np.zeros((M, size - M))])
    readout = np.zeros((6, M))
    readout[list(bank.channels), np.arange(M)] = np.asarray(bank.readout)
    covariance = np.zeros((size, size))
    y = np.zeros((6, size))
    for i, (length, end) in enumerate(zip(dt, ends, strict=True)):
        y += length * readout @ x
        at = M + n * M + 6 * i
        y[:, at : at + 6] += np.eye(6)
        # the integral of white noise of density r / f over a piece
        covariance[at : at + 6, at : at + 6] = np.diag(np.asarray(bank.white) / RATE * length)
        if end:
            x = np.asarray(bank.transition) @ x
            at = M + M * i
            x[:, at : at + M] += np.eye(M)
            covariance[at : at + M, at : at + M] = bank.driving
    return y, x, covariance


@eqx.filter_jit
def noise_of(bank, dt, ends):
    return step_noise(alone(bank), dt, ends)


@eqx.filter_jit
def maps_of(bank, noise, P):
    """What a step makes of the states: their part of the errors, where they go, and where a covariance goes."""
    one = jnp.eye(len(bank.states))
    carried, advanced = noise.carry(one[:, :, None])[:, :, 0].T, noise.advance(P[:, :, None])[:, :, 0]
    return by_channel(bank.channels, noise.weights * one), carried, advanced


@pytest.mark.parametrize("which", MODELS)
@pytest.mark.parametrize("step", STEPS)
def test_a_step_is_what_its_samples_add_up_to(which, step):
    bank = bank_of(which)
    M = len(bank.states)
    dt, ends = (np.asarray(a, float) for a in STEPS[step])
    noise = noise_of(bank, jnp.asarray(dt), jnp.asarray(ends))
    B = np.random.default_rng(2).normal(size=(M, M))
    weights, carried, advanced = maps_of(bank, noise, jnp.asarray(B @ B.T))
    y, x, R = written_out(bank, dt, ends)
    np.testing.assert_allclose(noise.duration, dt.sum(), rtol=1e-14)
    np.testing.assert_allclose(noise.inverse_duration, 1 / dt.sum() if dt.sum() else 0.0, rtol=1e-13)
    # from the states at the start
    np.testing.assert_allclose(weights, y[:, :M], rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(carried, x[:, :M], rtol=1e-11, atol=1e-14)
    # from the noise
    np.testing.assert_allclose(noise.integrated[..., 0], np.diag(y @ R @ y.T), rtol=1e-10, atol=1e-21)
    np.testing.assert_allclose(noise.cross[..., 0], y @ R @ x.T, rtol=1e-10, atol=1e-19)
    np.testing.assert_allclose(noise.driving[..., 0], x @ R @ x.T, rtol=1e-10, atol=1e-19)
    np.testing.assert_allclose(advanced, x[:, :M] @ B @ B.T @ x[:, :M].T + x @ R @ x.T, rtol=1e-10, atol=1e-12)


def test_two_parts_of_a_sample_are_the_sample():
    bank = bank_of("Markov")
    whole, part, rest = (noise_of(bank, *(jnp.asarray(a, float) for a in STEPS[s])) for s in ("one", "part", "rest"))
    np.testing.assert_allclose(np.asarray(part.weights) + np.asarray(rest.weights), whole.weights, rtol=1e-13)
    np.testing.assert_allclose(np.asarray(part.integrated) + np.asarray(rest.integrated), whole.integrated, rtol=1e-13)
    np.testing.assert_allclose(np.asarray(part.transition) * np.asarray(rest.transition), whole.transition, rtol=1e-13)
    np.testing.assert_allclose(np.asarray(part.driving) + np.asarray(rest.driving), whole.driving, rtol=1e-13)


@pytest.mark.parametrize("n", [1, 3, 10])
def test_second_integral_of_white_noise(n):
    """Pulses in the middle of n samples: the variance of sum (T - s_i) w_i over that of sum w_i, less T^2/2."""
    bank = bank_of("white")
    T = n / RATE
    arms = T - (np.arange(n) + 0.5) / RATE
    noise = noise_of(bank, jnp.asarray(np.full(n, 1 / RATE)), jnp.asarray(np.ones(n)))
    np.testing.assert_allclose(noise.second_integral, np.mean(arms**2) - T**2 / 2, rtol=1e-11)


def test_channels_without_states_are_zero():
    X = np.random.default_rng(3).normal(size=(3, 2))
    out = by_channel((1, 1, 4), jnp.asarray([[1.0], [2.0], [3.0]] * X))
    expected = np.zeros((6, 2))
    expected[1], expected[4] = X[0] + 2 * X[1], 3 * X[2]
    np.testing.assert_allclose(out, expected, rtol=1e-14)
    np.testing.assert_array_equal(by_channel((), jnp.zeros((0, 2))), np.zeros((6, 2)))


@pytest.mark.parametrize("which", MODELS)
def test_errors_and_their_advance(which):
    bank = bank_of(which)
    x = np.random.default_rng(4).normal(size=(len(bank.states), 3))
    after = bank.advance(jnp.asarray(x), jnp.asarray(1.0))
    np.testing.assert_allclose(after, np.asarray(bank.transition) @ x, rtol=1e-11, atol=1e-13)
    np.testing.assert_array_equal(bank.advance(jnp.asarray(x), jnp.asarray(0.0)), x)
    np.testing.assert_allclose(bank.errors(jnp.asarray(x)), by_channel(bank.channels, bank.readout[:, None] * x))


def test_states_that_go_their_own_way_keep_the_fast_path():
    """White noise has no state, and makes no matrix of a diagonal."""
    model = gj.WN(1e-4) + gj.GM(0.1, 1e-4) + gj.RW(1e-8)
    assert nj.ImuErrors(model, gj.WN(1e-6), 100.0, gyro_bias_sd=1e-4).bank().diagonal
    assert not nj.ImuErrors(model + gj.DR(1e-6), gj.WN(1e-6), 100.0).bank().diagonal
