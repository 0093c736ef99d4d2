"""Bandwidth, range and step: of one sample by hand, of a record against scipy and theory, and in a covariance."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from helpers import CountTraces, assert_mean

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.imu.emulation import emulate, write_out
from nav_jax.imu.output import Output, SaturationWarning

RATE = 100.0
STEPS = 200
RUNS = 40


def errors_of(output, noise=1e-2, **options):
    return nj.ImuErrors(gj.WN(noise), gj.WN(noise), RATE, output=output, **options)


@eqx.filter_jit
def said(errors, sensed, keys, pieces=1):
    """What is said of samples (N, 6) in each run, (N, 6, R), and what of the one that begins at the end of each."""
    ends = jnp.tile(jnp.eye(pieces)[-1:], (len(sensed), 1))[:, None]
    every = jnp.repeat(sensed[:, None, None], pieces, axis=2)
    after = jnp.concatenate([sensed[1:], sensed[-1:]])
    given = write_out(emulate(errors, keys, len(sensed), ends, (every, after)), ends)
    return given.per_step[:, 0] + every[:, 0, ..., None], given.per_segment.sample + after[..., None]


def keys(num=RUNS):
    return nj.filter.run_keys(jax.random.key(3), 0, num)


def motion(num=STEPS):
    return jnp.asarray(np.random.default_rng(0).normal(size=(num, 6)))


def record(output, sensed, **options):
    return np.asarray(said(errors_of(output, **options), sensed, keys())[0])[:, 0]


PLAIN = {"accel_range": 1.5, "gyro_range": [0.5, 1.0, np.inf]}
LIMITS = np.array([1.5, 1.5, 1.5, 0.5, 1.0, np.inf])


def test_nothing_leaves_the_range_and_what_is_inside_stays_as_it_is():
    free, clipped = (record(o, motion()) for o in (Output(), Output(**PLAIN)))
    np.testing.assert_allclose(clipped, np.clip(free, -LIMITS[:, None], LIMITS[:, None]), rtol=0, atol=1e-15)
    beyond = np.abs(free) > LIMITS[:, None]
    assert beyond[:, :5].any(axis=(0, 2)).all()
    assert not beyond[:, 5].any()


def test_an_output_that_does_nothing_adds_nothing_to_the_errors():
    ends = jnp.ones((STEPS, 1, 1))
    # compiled as the others are, and so with the same sums of products that are rounded once
    written = eqx.filter_jit(lambda errors, keys: write_out(emulate(errors, keys, STEPS, ends), ends))
    plain = written(errors_of(None), keys()).per_step[:, 0, 0]
    np.testing.assert_allclose(record(Output(), motion() * 0.0), plain, rtol=0, atol=1e-15)


def test_readings_are_multiples_of_the_step_and_rounding_is_white():
    """The step is half the noise's standard deviation: variance step^2/12 and no correlation, 4.5 sigma."""
    output = Output(accel_step=0.05, gyro_step=[0.05, 0.1, 0.0])
    free, rounded = (record(o, motion()) for o in (Output(), output))
    step = np.array([0.05, 0.05, 0.05, 0.05, 0.1])[:, None]
    steps = rounded[:, :5] / step
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    np.testing.assert_allclose(rounded[:, 5], free[:, 5], rtol=0, atol=1e-15)
    error = (rounded - free)[:, :5] / step
    assert np.abs(error).max() <= 0.5 + 1e-9
    assert_mean(error.mean(axis=(0, 1)), 0.0)
    assert_mean((error**2).mean(axis=(0, 1)), 1 / 12)
    assert_mean((error[1:] * error[:-1]).mean(axis=(0, 1)), 0.0)


def test_the_sum_of_rounded_increments_is_never_off_by_more_than_half_a_step():
    """And the error of a reading is quantisation noise: variance 2 q2, correlation -q2 with the next, 4.5 sigma."""
    step = 5e-4
    free, rounded = (record(o, motion()) for o in (Output(), Output(accel_step=step, gyro_step=step, increments=True)))
    steps = rounded / RATE / step
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-7)
    assert np.abs(np.cumsum(rounded - free, axis=0)).max() / RATE <= 0.5 * step * (1 + 1e-9)
    error, q2 = (rounded - free)[1:].reshape(-1, 6 * RUNS), (step * RATE) ** 2 / 12
    assert_mean((error**2).mean(axis=0), 2 * q2)
    assert_mean((error[1:] * error[:-1]).mean(axis=0), -q2)


def test_the_low_pass_is_that_of_scipy():
    """Sample by sample, from a first one that has always been there; above half the rate it passes all."""
    output = Output(accel_bandwidth=[10.0, 20.0, 40.0], gyro_bandwidth=[30.0, 50.0, np.inf])
    free, slow = (record(o, motion()) for o in (Output(), output))
    for channel, band in enumerate((10.0, 20.0, 40.0, 30.0, None, None)):
        expected = free[:, channel]
        if band is not None:
            b, a = scipy.signal.butter(2, band, fs=RATE)
            start = scipy.signal.lfilter_zi(b, a)[:, None] * expected[:1]
            expected, _ = scipy.signal.lfilter(b, a, expected, axis=0, zi=start)
        np.testing.assert_allclose(slow[:, channel], expected, rtol=1e-9, atol=1e-12)


def test_the_spectrum_of_noise_behind_the_low_pass():
    """White noise times |H|^2 = 1/(1 + (tan(pi f/f_s)/tan(pi b/f_s))^4), half at the bandwidth b: 4.5 sigma to 2 b."""
    band, frequency = 15.0, np.fft.rfftfreq(STEPS, 1 / RATE)[1:60]
    slow = record(Output(accel_bandwidth=band, gyro_bandwidth=band), 0.0 * motion())
    periodogram = np.abs(np.fft.rfft(slow, axis=0)[1:60]) ** 2 / (STEPS * 1e-2)
    H2 = 1 / (1 + (np.tan(np.pi * frequency / RATE) / np.tan(np.pi * band / RATE)) ** 4)
    assert H2[frequency == band] == pytest.approx(0.5)
    assert_mean(periodogram.reshape(59, -1).T, H2)


def test_first_the_low_pass_then_the_range_then_the_step():
    """A spike is made smaller before it is clipped, and the range is no multiple of the step."""
    output = Output(accel_bandwidth=20.0, accel_range=0.26, accel_step=0.1)
    sensed = np.zeros((STEPS, 6))
    sensed[50] = 1.0
    found = record(output, jnp.asarray(sensed), noise=1e-30)[:, 0, 0]
    b, a = scipy.signal.butter(2, 20.0, fs=RATE)
    expected = np.round(np.clip(scipy.signal.lfilter(b, a, sensed[:, 0]), -0.26, 0.26) / 0.1) * 0.1
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert 0.29 < found.max() < 0.31


def test_a_sample_of_two_pieces_is_read_once():
    """Parts of a sample, and the sample that begins at an event, are what the whole sample is."""
    output = Output(accel_bandwidth=20.0, gyro_step=1e-3, accel_step=1e-3, gyro_range=1.0, increments=True)
    errors = errors_of(output)
    whole, following = said(errors, motion(20), keys(3))
    parts, after = said(errors, motion(20), keys(3), pieces=2)
    np.testing.assert_allclose(parts[:, 0], whole[:, 0], atol=1e-12)
    np.testing.assert_allclose(parts[:, 1], whole[:, 0], atol=1e-12)
    np.testing.assert_allclose(following[:-1], whole[1:, 0], atol=1e-12)
    np.testing.assert_allclose(after, following, atol=1e-12)


def test_numbers_of_an_output_are_mapped_and_have_derivatives():
    """By the range 1 where it holds a sample, by the step what rounding adds, and 1 through rounding."""
    x = jnp.asarray([[0.3], [2.0], [-2.0], [0.2], [0.2], [0.2]])

    def read(limit, x):
        output = Output(accel_range=limit, gyro_step=limit, accel_bandwidth=10 * limit, gyro_bandwidth=20.0)
        return output.read(output.begin(x, RATE), x, RATE)[1][:, 0]

    @jax.jit
    def derivatives(x):
        by_range, mapped = jax.jacfwd(read)(1.0, x), jax.vmap(read, in_axes=(0, None))(jnp.array([0.5, 1.5]), x)
        return by_range, mapped, jax.jacrev(read, argnums=1)(1.0, x), jax.jacfwd(read, argnums=1)(1.0, x)

    by_range, mapped, back, forth = derivatives(x)
    np.testing.assert_allclose(by_range[:4], [0, 1, -1, -0.2], atol=1e-9)
    np.testing.assert_allclose(mapped[:, 1], [0.5, 1.5])
    np.testing.assert_allclose(back, forth, atol=1e-12)
    np.testing.assert_allclose(np.diag(back[:, :, 0])[3:], 1.0, atol=1e-9)


def test_new_numbers_are_no_new_program():
    traces = CountTraces(lambda errors: errors.bank().white)
    white = eqx.filter_jit(traces)
    for step in (1e-3, 2e-3):
        white(errors_of(Output(gyro_step=step, accel_range=100 * step)))
    assert traces.count == 1
    white(errors_of(Output(gyro_step=1e-3)))  # without a range: another
    assert traces.count == 2


def test_a_covariance_has_the_rounding_as_noise():
    rates = errors_of(Output(accel_step=0.1, gyro_step=0.2, accel_range=1.0))
    for bank in (rates.bank(), rates.bank(complete=True)):
        np.testing.assert_allclose(bank.white, 1e-2 + np.repeat([0.01, 0.04], 3) / 12, rtol=1e-12)
        assert not bank.states
    increments = errors_of(Output(gyro_step=1e-3, increments=True))
    assert not increments.bank().states
    complete = increments.bank(complete=True)
    assert not any(s.in_filter for s in complete.states)
    h, P = np.asarray(complete.readout), np.asarray(complete.initial)
    np.testing.assert_allclose(h @ P @ h, 3 * 2 * 0.1**2 / 12, rtol=1e-12)
    assert any("quantisation" in n or "QN of gyro x" in n for n in increments.notes())


def test_another_rate_leaves_the_output_as_it_is_and_a_state_brings_it_back():
    output = Output(gyro_range=1.0, gyro_step=1e-3, accel_bandwidth=[10.0, 20.0, 30.0], increments=True)
    errors = errors_of(output).at_rate(50.0)
    assert eqx.tree_equal(errors.output, output)
    again = gj._internal.states.from_state(gj._internal.states.to_state(errors))
    assert eqx.tree_equal(again, errors)
    assert "Output of increments: range" in repr(errors)
    assert repr(Output()) == "Output of rates: as it is sensed"


def test_a_motion_beyond_the_range_is_said():
    reference = nj.motions.static(duration=5.0, rate=RATE)
    scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=1.0, vertical=1.0)])
    errors = errors_of(Output(accel_range=9.0, accel_step=1e-3, gyro_bandwidth=20.0))
    with pytest.warns(SaturationWarning, match=r"accel z 9.81 \(range 9\)"):
        analysis = nj.analyse(scenario, errors)
    notes = analysis["filter"].notes
    assert sum("covariances" in note for note in notes) == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Output(accel_range=0.0), "accel_range must be positive"),
        (lambda: Output(gyro_step=-1e-3), "gyro_step must be zero or positive"),
        (lambda: Output(gyro_step=np.inf), "a step is finite"),
        (lambda: Output(gyro_bandwidth=np.nan), "gyro_bandwidth must be positive"),
        (lambda: Output(gyro_range=[1.0, 2.0]), "gyro_range is one number or three"),
        (lambda: errors_of(0.1), "must be of the class Output"),
        (lambda: emulate(errors_of(Output()), keys(), 3, jnp.ones((3, 1, 1))), "give the perfect samples"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
