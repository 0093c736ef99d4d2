"""Emulated errors against theory, and what they may not depend on."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import assert_covariance, assert_mean

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.imu.emulation import emulate, write_out

RATE = 100.0
RUNS = 4000
WHITE = gj.WN(1e-4)
MODEL = gj.WN(4.0) + gj.AR1(0.9, 1.0)


@pytest.fixture
def optimised():
    """As users have it: normals are of single precision, which programs that are not optimised round each its own way.

    Programs that are there are those of other tests, and let go.
    """
    jax.config.update("jax_disable_most_optimizations", False)
    jax.clear_caches()
    yield
    jax.config.update("jax_disable_most_optimizations", True)
    jax.clear_caches()


class Whole(NamedTuple):
    total: Any
    lasting: Any


@eqx.filter_jit
def emulated(errors, keys, num_samples):
    """The errors of each sample (N, 6, R) and the part of it that lasts."""
    ends = jnp.ones((num_samples, 1, 1))
    source = emulate(errors, keys, num_samples, ends)
    given = write_out(source, ends)
    # what lasts at the end of a sample is that of the next
    first = source.lasting(source.begin(), jax.tree.map(lambda a: a[0], source.per_segment))
    return Whole(given.per_step[:, 0, 0], jnp.concatenate([first[None], given.per_segment.lasting[:-1]]))


@eqx.filter_jit
def written(errors, keys, num_samples, ends):
    """The errors of every piece."""
    return write_out(emulate(errors, keys, num_samples, ends), ends)


def keys(num=RUNS, seed=1):
    return nj.filter.run_keys(jax.random.key(seed), 0, num)


def drawn(accel, num_samples=30, num=RUNS, **options):
    out = emulated(nj.ImuErrors(accel, WHITE, RATE, **options), keys(num), num_samples)
    return np.asarray(out.total), np.asarray(out.lasting)


def test_moments_of_white_noise_and_ar1():
    """Variance at each sample from the first on, autocovariance, independence of the axes: 4.5 sigma."""
    total, lasting = drawn(MODEL)
    stationary = 1.0 / (1 - 0.81)
    for k in (0, 1, 29):
        assert_mean(total[k].T, 0.0)
        assert_mean(total[k, :3].T ** 2, 4.0 + stationary)
        assert_mean(lasting[k, :3].T ** 2, stationary)
    for lag in (1, 5, 20):
        assert_covariance(total[0, 0], total[lag, 0], stationary * 0.9**lag)
        assert_covariance(total[9, 1], total[9 + lag, 1], stationary * 0.9**lag)
    assert_covariance(total[3, 0], total[3, 1], 0.0)
    assert_mean(total[7, 3:].T ** 2, 1e-4)
    np.testing.assert_array_equal(lasting[:, 3:], 0.0)


def test_moments_of_an_arma_process():
    """Its driving noise has rank one."""
    process = gj.ARMA(2, 1)(1.2, -0.5, 0.4, 1.0)
    _, lasting = drawn(process)
    gamma = np.asarray(process.autocovariance([0, 1, 2, 5]))
    for lag, expected in zip((0, 1, 2, 5), gamma, strict=True):
        assert_covariance(lasting[0, 0], lasting[lag, 0], expected)
        assert_covariance(lasting[9, 1], lasting[9 + lag, 1], expected)


def test_a_start_from_zero():
    """The first sample is the first innovation, as in R; the variance grows from there, and the walk's as well."""
    _, lasting = drawn([MODEL, WHITE + gj.RW(2.0), WHITE], start="zero")
    for k in (0, 1, 5, 29):
        assert_mean(lasting[k, 0] ** 2, (1 - 0.81 ** (k + 1)) / (1 - 0.81))
        assert_mean(lasting[k, 1] ** 2, 2.0 * (k + 1))


def test_random_walk_drift_and_bias():
    """A walk on the first axis, a drift on the second, biases of the gyros."""
    _, lasting = drawn([WHITE + gj.RW(2.0), WHITE + gj.DR(0.3), WHITE], gyro_bias_sd=[0.0, 0.5, 1.0])
    steps = np.diff(lasting[:, 0], axis=0)
    assert_mean(steps[5] ** 2, 2.0)
    assert_mean(steps[20] ** 2, 2.0)
    assert_covariance(steps[5], steps[6], 0.0)
    slope = np.diff(lasting[:, 1], axis=0)
    np.testing.assert_allclose(slope, np.broadcast_to(slope[:1], slope.shape), rtol=1e-9, atol=1e-11)
    assert_mean(slope[0] ** 2, 0.09)
    bias = lasting[:, 3:]
    np.testing.assert_array_equal(bias, np.broadcast_to(bias[:1], bias.shape))
    assert_mean(bias[0, 1:].T ** 2, [0.25, 1.0])
    np.testing.assert_array_equal(bias[:, 0], 0.0)
    np.testing.assert_array_equal(lasting[:, 2], 0.0)


def test_quantisation_noise_is_added_and_does_not_last():
    total, lasting = drawn(gj.WN(1.0) + gj.QN(2.0))
    np.testing.assert_array_equal(lasting, 0.0)
    assert_mean(total[4, 0] ** 2, 1.0 + 4.0)
    assert_covariance(total[4, 0], total[5, 0], -2.0)


@pytest.mark.usefixtures("optimised")
def test_what_an_accelerometer_and_a_gyro_share_is_not_seen():
    """The two halves of a pair of numbers: independent, squares too, and the same whoever has a process."""
    both, one = (nj.ImuErrors(MODEL, gyro, RATE) for gyro in (MODEL, WHITE))
    total, alone = (np.asarray(emulated(errors, keys(), 12).total) for errors in (both, one))
    variance = 4.0 + 1.0 / (1 - 0.81)
    for axis in range(3):
        accel, gyro = total[11, axis], total[11, 3 + axis]
        assert_covariance(accel, gyro, 0.0)
        assert_covariance(accel**2, gyro**2, 0.0, mean_a=variance, mean_b=variance)
    np.testing.assert_allclose(alone[:, :3], total[:, :3], rtol=1e-11, atol=1e-13)


SHORT = 101
"""Samples of the two runs of the tests below."""


def test_a_run_does_not_depend_on_the_others():
    errors = nj.ImuErrors(MODEL, WHITE, RATE)
    many = np.asarray(emulated(errors, keys(20), SHORT).total)
    few = emulated(errors, keys(20)[7:9], SHORT).total
    np.testing.assert_allclose(many[..., 7:9], few, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("model", [MODEL, MODEL + gj.QN(0.1)], ids=["states", "with quantisation"])
def test_a_longer_run_begins_as_a_shorter_one(model):
    errors = nj.ImuErrors(model, WHITE, RATE)
    long, short = (np.asarray(emulated(errors, keys(2), n).total) for n in (230, SHORT))
    np.testing.assert_allclose(long[:SHORT], short, rtol=1e-11, atol=1e-13)


@pytest.mark.slow
@pytest.mark.usefixtures("optimised")
def test_another_process_leaves_the_rest_alone():
    """What is added is added: the white noise and the processes that were there keep their numbers."""
    one = emulated(nj.ImuErrors(MODEL, WHITE, RATE), keys(2), SHORT)
    two = emulated(nj.ImuErrors(MODEL + gj.RW(1.0), WHITE + gj.RW(1.0), RATE), keys(2), SHORT)
    walk = emulated(nj.ImuErrors(gj.WN(0.0) + gj.RW(1.0), gj.RW(1.0), RATE), keys(2), SHORT)
    np.testing.assert_allclose(two.total, np.asarray(one.total) + walk.lasting, rtol=0, atol=1e-11)


@pytest.mark.slow
@pytest.mark.usefixtures("optimised")
def test_a_sample_in_several_pieces_has_one_error():
    """Pieces that do not end their sample, and steps of several pieces, change nothing."""
    errors = nj.ImuErrors(MODEL, WHITE, RATE)
    whole = jax.tree.map(np.asarray, emulated(errors, keys(2), SHORT))
    ends = jnp.array([[[1.0, 0.0, 1.0], [0.0, 0.0, 1.0]], [[1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]])
    given = written(errors, keys(2), 5, ends)
    pieces = np.asarray(given.per_step).reshape(12, 6, 2)
    np.testing.assert_allclose(pieces[:8], whole.total[[0, 1, 1, 2, 2, 2, 3, 4]], rtol=1e-11)
    np.testing.assert_allclose(given.per_segment.lasting[0], whole.lasting[3], rtol=1e-11)
    quantised = nj.ImuErrors(MODEL + gj.QN(0.1), WHITE, RATE)
    pieces = np.asarray(written(quantised, keys(2), 5, ends).per_step).reshape(12, 6, 2)
    expected = np.asarray(emulated(quantised, keys(2), 5).total)[[0, 1, 1, 2, 2, 2, 3, 4]]
    np.testing.assert_allclose(pieces[:8], expected, rtol=1e-11)


def test_slices_of_a_recording():
    record = np.arange(300.0)[:, None] * np.arange(1.0, 7.0)
    recorded = nj.RecordedErrors(record[:, :3], record[:, 3:], RATE)
    out = emulated(recorded, keys(200), 100)
    total = np.asarray(out.total)
    assert np.isnan(out.lasting).all()
    first = total[0, 0] + 149.5
    np.testing.assert_allclose(first, np.rint(first), atol=1e-9)
    assert first.min() >= 0
    assert first.max() <= 200
    assert len(np.unique(np.rint(first))) > 90
    # one slice for all channels, as it was recorded, without the mean of the whole
    expected = (first[None, :] + np.arange(100.0)[:, None] - 149.5)[:, None, :] * np.arange(1.0, 7.0)[None, :, None]
    np.testing.assert_allclose(total, expected, rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match="recording has 300 samples"):
        emulated(recorded, keys(2), 301)
    np.testing.assert_allclose(emulated(recorded, keys(1), 300).total[:, 0, 0], np.arange(300.0) - 149.5)


def test_what_is_nothing_but_its_start_has_one_from_zero_too():
    """The slope of a drift and the phase of a sinusoid: with a start of zero the process would not be there."""
    model = {"accel": gj.WN(1e-4) + gj.DR(1e-5), "gyro": gj.WN(1e-6) + gj.SIN(0.1, 1e-4)}
    zero, free = (nj.ImuErrors(**model, rate=100.0, start=start).bank() for start in ("zero", "stationary"))
    np.testing.assert_array_equal(zero.initial, free.initial)
    assert np.linalg.matrix_rank(zero.initial) > 0
    driven = nj.ImuErrors(gj.WN(1e-4) + gj.AR1(0.9, 1e-9), gj.WN(1e-6), rate=100.0, start="zero").bank()
    np.testing.assert_array_equal(driven.initial, driven.driving)
