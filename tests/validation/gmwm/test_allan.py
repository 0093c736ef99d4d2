"""Slope regression on Allan deviations: coverage."""

import jax
import numpy as np

import gmwm_jax as gj


def test_slope_regression_intervals_cover(judge):
    """400 records of 2^14 samples of white noise: the 95 % interval of N covers, band of 4 binomial sigmas."""
    num = 400
    x = np.asarray(
        jax.vmap(lambda k: gj.simulate(gj.WN(sigma2=1.0), 2**14, key=k))(jax.random.split(jax.random.key(3), num))
    ).T
    adev = gj.allan_deviation(gj.wavelet_variance(x, rate=1.0))
    covered = []
    for i in range(num):
        estimate = gj.fitting.slope_regression(adev[i], {"WN": (1.0, 64.0)}).table["WN", "N"]
        covered.append(estimate.ci_low <= 1.0 <= estimate.ci_high)
    band = 4 * np.sqrt(0.95 * 0.05 / num)
    judge("coverage of 95 % intervals", np.mean(covered), 0.95 - band, 0.95 + band, num_draws=num)
