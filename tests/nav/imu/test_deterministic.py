"""Errors that are no noise: each kind is one row of CASES; what they do to a sample, and what a filter takes off."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from gmwm_jax import GM, WN
from nav_jax.imu.bank import alone, step_noise
from nav_jax.imu.channels import TEMPERATURE
from nav_jax.imu.deterministic import DETERMINISTIC, GSensitivity, Misalignment, ScaleFactor, TemperatureBias
from nav_jax.imu.emulation import emulate, write_out
from nav_jax.imu.errors import ImuErrors

CASES = {
    # kind -> whether the entry (channel read, channel sensed) of the matrix of errors may be other than zero
    ScaleFactor: lambda i, j: i == j,
    Misalignment: lambda i, j: i != j and i // 3 == j // 3,
    GSensitivity: lambda i, j: i >= 3 and j < 3,
    TemperatureBias: lambda i, j: j == TEMPERATURE,
}
every_kind = pytest.mark.parametrize("kind", CASES, ids=lambda k: k.__name__)


def test_every_kind_of_the_registry_has_a_row():
    assert set(CASES) == set(DETERMINISTIC.values())


def of(kind, accel_sd, gyro_sd):
    """One of a kind; gyros alone have a g-sensitivity."""
    return kind(gyro_sd) if kind is GSensitivity else kind(accel_sd, gyro_sd)


def errors_of(*deterministic, noise=0.0):
    model = WN(noise)
    return ImuErrors(model, model, 100.0, deterministic=deterministic)


def matrix(bank, x):
    """The errors as a matrix on what is sensed, the temperature last."""
    M = np.zeros((6, 7))
    for state, value in zip(bank.states, x, strict=True):
        M[state.channel, state.reads] += value
    return M


@every_kind
def test_errors_are_a_matrix_times_what_is_sensed(kind):
    bank = errors_of(of(kind, 1e-3, 2e-3)).bank()
    assert {(s.channel, s.reads) for s in bank.states} == {
        (i, j) for i in range(6) for j in range(7) if CASES[kind](i, j)
    }
    rng = np.random.default_rng(1)
    x, sensed = rng.normal(size=(len(bank.states), 4)), rng.normal(size=(7, 4))
    expected = np.stack([matrix(bank, x[:, r]) @ sensed[:, r] for r in range(4)], axis=1)
    np.testing.assert_allclose(bank.errors(jnp.asarray(x), jnp.asarray(sensed)), expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(bank.changing(jnp.asarray(x), jnp.asarray(sensed)), expected, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(bank.steady(jnp.asarray(x)), 0.0)


@every_kind
def test_a_compensated_sample_is_what_was_sensed_to_third_order(kind):
    """Errors of 1 %: what is left after one inversion by hand is below 1e-6 times the size squared of a sample."""
    bank = errors_of(of(kind, 1e-2, 1e-2)).bank()
    rng = np.random.default_rng(2)
    x, sensed = 1e-2 * rng.normal(size=(len(bank.states), 1)), rng.normal(size=(7, 1))
    M = np.vstack([matrix(bank, x[:, 0]), np.zeros((1, 7))])
    said = sensed + M @ sensed
    found = bank.compensated(jnp.asarray(said), jnp.asarray(x))
    np.testing.assert_allclose(found, sensed, atol=10 * np.abs(M @ M @ M).max() + 2 * np.abs(M).max() ** 3)
    assert np.abs(said - sensed).max() > 1e-3


@every_kind
def test_what_is_emulated_is_what_the_states_say(kind, key):
    """Two samples a step, the noise switched off: errors are the matrix of the drawn constants on perfect samples."""
    errors = errors_of(of(kind, [1e-3, 2e-3, 3e-3], 2e-3))
    ends = jnp.ones((3, 2, 2))
    rng = np.random.default_rng(3)
    imu, at_end = jnp.asarray(rng.normal(size=(3, 2, 2, 7))), jnp.asarray(rng.normal(size=(3, 7)))

    @eqx.filter_jit
    def written(keys):
        source = emulate(errors, keys, 12, ends, (imu, at_end))
        return source.x, write_out(source, ends)

    x, given = jax.tree.map(np.asarray, written(jax.random.split(key, 5)))
    bank = errors.bank()
    for run in range(5):
        M = matrix(bank, x[:, run])
        expected = np.einsum("ij,mgnj->mgni", M, imu)
        np.testing.assert_allclose(given.per_step[..., run], expected, rtol=1e-12, atol=1e-16)
        expected = np.einsum("ij,mj->mi", M, at_end)
        np.testing.assert_allclose(given.per_segment.lasting[..., run], expected, rtol=1e-12, atol=1e-16)
        np.testing.assert_allclose(given.per_segment.sample[..., run], expected, rtol=1e-12, atol=1e-16)
    with pytest.raises(ValueError, match="give the perfect samples"):
        emulate(errors, jax.random.split(key, 5), 12, ends)


def test_constants_have_their_standard_deviations_and_keep_them_at_another_rate():
    errors = errors_of(ScaleFactor([1e-3, 0.0, 3e-3]), Misalignment(gyro_sd=2e-3), noise=1e-6)
    for e in (errors, errors.at_rate(50.0)):
        bank = e.bank()
        names = [str(s) for s in bank.states]
        assert names[:2] == ["accel x scale", "accel z scale"]
        assert names[2:4] == ["gyro x misalignment y", "gyro x misalignment z"]
        np.testing.assert_allclose(np.sqrt(np.diag(bank.initial)), [1e-3, 3e-3, *[2e-3] * 6], rtol=1e-12)
        np.testing.assert_array_equal(bank.driving, 0.0)
        np.testing.assert_array_equal(bank.transition, np.eye(8))
    assert "ScaleFactor: sd accel" in repr(errors)


@pytest.mark.slow
def test_the_integral_of_an_error_over_a_step_weighs_by_the_mean_reading():
    """Scale factor beside a Gauss-Markov process, three samples: against the sum by hand."""
    model = WN(1e-6) + GM(0.1, 1e-4)
    bank = ImuErrors(model, model, 100.0, deterministic=(ScaleFactor(1e-3, 1e-3),)).bank()
    dt = jnp.full(3, 0.01)
    noise = step_noise(alone(bank), dt, jnp.ones(3))
    rng = np.random.default_rng(4)
    x, samples = rng.normal(size=(len(bank.states), 1)), rng.normal(size=(3, 6, 1))
    total = np.zeros((6, 1))
    state = jnp.asarray(x)
    for k in range(3):
        total += 0.01 * np.asarray(bank.errors(state, jnp.asarray(samples[k])))
        state = bank.advance(state, jnp.ones(()))
    found = noise.integrate(jnp.asarray(x)[:, None], jnp.asarray(samples.mean(axis=0)))
    np.testing.assert_allclose(np.asarray(found)[:, 0], total, rtol=1e-12)


def test_a_temperature_that_nobody_has_stated():
    bank = errors_of(TemperatureBias(1e-3, 1e-5)).bank()
    with pytest.raises(ValueError, match="depends on the temperature, which nobody has stated"):
        bank.errors(jnp.ones((6, 1)), jnp.ones((6, 1)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ScaleFactor(-1e-3), "ScaleFactor: accel_sd must be non-negative"),
        (lambda: Misalignment(gyro_sd=[1e-3, 1e-3]), "gyro_sd is one number or three"),
        (lambda: GSensitivity(-1e-6), "GSensitivity: gyro_sd must be non-negative"),
        (lambda: errors_of(ScaleFactor(1e-3), ScaleFactor(2e-3, 1e-3)), "Two errors have the same constants"),
        (lambda: errors_of(0.1), "must be of the class AbstractDeterministic"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
