"""Designed filters on fresh noise."""

import jax
import numpy as np
import pytest
from nav import setups

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
