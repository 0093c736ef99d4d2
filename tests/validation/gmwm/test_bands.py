"""Coverage of intervals of wavelet, Allan, modified Allan and Hadamard variances: 95 % where 95 % is said.

Quantisation noise is the exception that is known: its errors are uniform and not normal, so that its variances scatter
less than theory has it, and the many degrees of freedom that it has are claimed with care where the slope is not sure.
Its bands hold the truth more often than they say.
"""

import allantools
import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.processes.simulation import simulate_each
from gmwm_jax.variance.wavelet import WaveletVariances

NUM = 1000
TRUTHS = {
    "WN(sigma2=1.0)": 0.98,
    "RW(gamma2=1.0)": 0.98,
    "GM(beta=0.03, variance=1.0)": 0.98,
    "WN(sigma2=1.0) + RW(gamma2=1e-4)": 0.98,
    "QN(q2=1.0)": 1.0,
}
"""Text -> the highest coverage that is allowed."""


def records(text, num_samples, num=NUM):
    return np.asarray(
        simulate_each(gj.parse_model(text), jax.random.split(jax.random.key(num_samples), num), num_samples)
    )


@pytest.mark.parametrize("num_samples", [1000, 2047, 4096])
@pytest.mark.parametrize("text", TRUTHS)
def test_bands_of_wavelet_variances_cover(text, num_samples, judge):
    """At every scale, the longest included: with 2 (a random walk of 4096) to 2000 degrees of freedom."""
    model = gj.parse_model(text)
    wv = gj.wavelet_variance(records(text, num_samples).T)
    assert isinstance(wv, WaveletVariances)
    truth = np.asarray(model.wavelet_variance(wv.scales))[:, None]
    band = wv.bands()
    covered = np.mean((band.low <= truth) & (truth <= band.high), axis=1)
    judge(f"{text}: coverage, local power law", covered, 0.92, TRUTHS[text], num_draws=NUM)
    own = np.stack([wv[i].bands(model).high / wv[i].variance for i in range(2)])
    np.testing.assert_allclose(own[0], own[1], rtol=1e-12)
    one = wv[0].bands(model)
    low, high = (v / wv[0].variance for v in (one.low, one.high))
    exact = np.mean((wv.variance * low[:, None] <= truth) & (truth <= wv.variance * high[:, None]), axis=1)
    judge(f"{text}: coverage, exact covariance", exact, 0.92, max(TRUTHS[text], 0.98), num_draws=NUM)
    of_weights = np.mean((wv.ci_low <= truth) & (truth <= wv.ci_high), axis=1)
    judge(f"{text}: coverage, weights of fits", of_weights, 0.95, 1.0, num_draws=NUM)


@pytest.mark.parametrize("kind", ["modified_allan_deviation", "hadamard_deviation"])
@pytest.mark.parametrize("text", ["WN(sigma2=1.0)", "RW(gamma2=1.0)"])
def test_intervals_of_other_deviations_cover(kind, text, judge):
    """The truth is the mean of the variances of all records."""
    x = records(text, 1500, 2 * NUM)
    found = getattr(gj.variance, kind)(x.T[:, :NUM], rate=1.0)
    truth = np.sqrt(np.mean(getattr(gj.variance, kind)(x.T[:, NUM:], rate=1.0).deviation ** 2, axis=1))[:, None]
    covered = np.mean((found.ci_low <= truth) & (truth <= found.ci_high), axis=1)
    judge(f"{text}: coverage of {kind}", covered, 0.92, 0.98, num_draws=NUM)


def test_allantools_has_the_same_deviations_of_a_long_record():
    x = np.asarray(gj.simulate("WN(sigma2=1.0) + RW(gamma2=1e-6)", 1_000_000, key=jax.random.key(1)))
    for ours, theirs in (
        (gj.variance.modified_allan_deviation, allantools.mdev),
        (gj.variance.hadamard_deviation, allantools.ohdev),
    ):
        found = ours(x, rate=100.0)
        _, expected, _, _ = theirs(x, rate=100.0, data_type="freq", taus=found.times)
        np.testing.assert_allclose(found.deviation, expected, rtol=1e-7)
