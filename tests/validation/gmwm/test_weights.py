"""What weights from the covariance of the wavelet variance gain."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS

import gmwm_jax as gj
from gmwm_jax.fitting.result import Status
from gmwm_jax.fitting.weights import TwoStep

TRUTH = gj.parse_model("WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)")


NUM_SAMPLES, NUM_REPLICATES = 20_000, 200


@pytest.fixture(scope="module")
def records():
    """Wavelet variances of 200 records, as channels of one."""
    keys = jax.random.split(jax.random.key(4), NUM_REPLICATES)
    x = jax.jit(jax.vmap(lambda key: gj.simulate(TRUTH, NUM_SAMPLES, key=key), out_axes=1))(keys)
    return gj.wavelet_variance(np.asarray(x))


def test_the_gain_is_the_one_stated(records, judge):
    """The variance of 200 estimates over that with diagonal weights: as `weights_efficiency` says, at 4.5 sigma.

    The sigma of a ratio of two variances of correlated normal estimates with correlation r is 2 sqrt((1 - r^2)/n).
    """
    fits = {omega: gj.fit(records, "WN + GM", weights=omega) for omega in ("two-step", "covariance")}
    assert all(f.status is Status.converged for group in fits.values() for f in group.values())
    at = {k: np.array([f.model.unconstrained() for f in group.values()]) for k, group in fits.items()}
    stated = np.mean(
        [f.weights_efficiency(TwoStep().omega(f.wv, f.model)) for f in fits["covariance"].values()], axis=0
    )
    ratio = at["covariance"].var(axis=0) / at["two-step"].var(axis=0)
    for i in range(3):
        r = np.corrcoef(at["covariance"][:, i], at["two-step"][:, i])[0, 1]
        z = np.log(ratio[i] / stated[i]) / (2 * np.sqrt((1 - r**2) / NUM_REPLICATES))
        judge(f"gain of parameter {i}, off the one stated in sigmas", z, -SIGMAS, SIGMAS, num_draws=NUM_REPLICATES)
    assert stated.min() < 0.95  # or there is nothing to gain, and nothing was tested
    assert stated.max() <= 1 + 1e-9
    np.testing.assert_allclose(fits["covariance"][0].weights_efficiency(), 1.0, atol=0.02)
    assert "Weights on the diagonal only would have an efficiency of" in fits["covariance"][0].summary()
