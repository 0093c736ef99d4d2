"""ARMA processes: coverage of intervals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import assert_mean

import gmwm_jax as gj
from gmwm_jax.fitting.standard_errors import delta_method

NUM = 2**13


TRUTHS = {
    "AR(2)": "AR(2)(phi1=1.5, phi2=-0.8, sigma2=1)",
    "MA(1)": "MA(1)(theta1=0.6, sigma2=1)",
    "ARMA(2,1)": "ARMA(2,1)(phi1=1.2, phi2=-0.5, theta1=0.5, sigma2=1)",
    "WN + AR(2)": "WN(sigma2=1) + AR(2)(phi1=1.2, phi2=-0.25, sigma2=0.1)",
}


@pytest.fixture(scope="module")
def own_theory():
    """AR(2), fitted to its own wavelet variance."""
    x = np.asarray(gj.simulate(TRUTHS["AR(2)"], NUM, key=jax.random.key(3)))
    some = gj.wavelet_variance(x)
    nu = np.asarray(gj.parse_model(TRUTHS["AR(2)"]).wavelet_variance(some.scales))
    low, high = some.ci_low / some.variance * nu, some.ci_high / some.variance * nu
    return gj.fit(gj.variance.WaveletVariance.from_table(some.scales, nu, low, high, num_samples=NUM), "AR(2)")


def test_intervals_have_their_coverage(own_theory, judge):
    """200 simulated records: estimates without bias, scattered as the sandwich says; 95 % within 1.96 deviations."""
    boot = gj.bootstrap(own_theory, 200, key=jax.random.key(7), route="records")
    assert boot.num_failed == 0
    model, active = own_theory.model, own_theory.active
    errors = delta_method(lambda m: m.parameter_lines(), model, active, jnp.asarray(own_theory.covariance))
    lines = [gj.Composite((type(model.processes[0])(*v),)).parameter_lines() for v in boot.good]
    z = (np.array(lines) - np.asarray(model.parameter_lines())) / np.asarray(errors)
    band = 0.2 + 4 / np.sqrt(200)  # default weights lower a variance by 4/eta
    judge("bias in standard deviations", z.mean(axis=0), -band, band, num_draws=200)
    assert_mean(z**2 - z.mean(axis=0) ** 2, np.ones(3), sigmas=4.0)
    inside = np.mean(np.abs(z) < 1.96, axis=0)
    band = 4 * np.sqrt(0.95 * 0.05 / 200)
    judge("coverage of 95 % intervals", inside, 0.95 - band, 0.95 + band, num_draws=200)
