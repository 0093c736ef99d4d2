"""Designed filters on fresh noise, and what a calibration leaves open."""

import jax
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


@pytest.fixture(scope="module")
def designed():
    return setups.designed()


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


def test_a_component_at_zero_may_be_other_than_zero():
    """A random walk that the gyros' recording does not show: the same estimate, and a larger error may come of it."""
    fits = setups.fits()
    unseen = gj.fit(fits[1].wv, "WN + RW")
    assert unseen.at_boundary == {"RW": "at boundary: zero"}, "the key was chosen so"
    alone, more = (
        nj.calibration_effect(setups.SCENARIO, fits[0], gyro, key=jax.random.key(1), num_draws=48)
        for gyro in (fits[1], unseen)
    )
    np.testing.assert_allclose(more.rms["heading"], alone.rms["heading"], rtol=1e-2)
    assert more.interval("heading")[1, -1] > 1.01 * alone.interval("heading")[1, -1]
