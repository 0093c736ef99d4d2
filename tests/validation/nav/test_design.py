"""Designed filters on fresh noise."""

import jax
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


START = nj.InitialUncertainty(0.05, 0.02, 0.002)


TRUTH = nj.ImuErrors(
    gj.WN(6e-5) + gj.GM(0.01, 4e-5) + gj.GM(0.0005, 1e-4),
    gj.WN(1.5e-6) + gj.GM(0.002, 3e-7),
    setups.RATE,
    gyro_bias_sd=1e-4,
)


@pytest.fixture(scope="module")
def designed():
    """Filters with no or one process of the gyros, for a truth with one, and two of the accelerometers."""
    scenario = nj.Scenario(nj.motions.lemniscate(12.0, setups.RATE), setups.aiding(6.0, 12.0), START, every=20)
    return nj.design(scenario, TRUTH, max_accel=0, max_gyro=1, num_starts=1)


def test_a_design_is_confirmed_on_fresh_noise(designed, judge):
    """Runs of the best filter, its naive counterpart and the right one have the errors that were computed."""
    (runs,) = designed.confirm(num_runs=64, key=jax.random.key(5), gains="reference")
    best = designed.best()
    expected = {"designed": best.covariances, "truncated": best.covariances_naive, "right": designed.right}
    assert list(runs) == list(expected)
    for name, (c,) in expected.items():
        k = c.epoch()
        squares = np.sum(runs[name].errors("position")[:, k] ** 2, axis=1)
        z = (squares.mean() - c.rms("position")[k] ** 2) / (squares.std() / np.sqrt(64))
        judge(f"mean square of {name}, in standard errors", z, -4.5, 4.5, num_draws=64)
