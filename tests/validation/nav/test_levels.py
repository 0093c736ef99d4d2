"""Two levels along R's lemniscate, with its sensor and an outage: the mean of own-gain runs that are others."""

import jax
import numpy as np
import pytest
from nav import setups
from scipy import stats

import nav_jax as nj

SCENARIO = nj.Scenario(
    nj.motions.lemniscate(60.0, setups.RATE, attitude="navigation"), setups.aiding(30.0, 50.0),
    nj.InitialUncertainty(0.5, 0.05, np.deg2rad([1.0, 1.0, 5.0])), every=10,
)  # fmt: skip
FILTERS = {"right": setups.imu_errors("right"), "wrong": setups.imu_errors("wrong")}


@pytest.fixture(scope="module")
def both():
    truth = FILTERS["right"]
    found = nj.simulation.two_level(SCENARIO, truth, FILTERS, num_runs=1500, key=jax.random.key(31))
    # other keys: independent of all runs above
    return found, nj.compare(SCENARIO, truth, FILTERS, num_runs=1000, key=jax.random.key(32))


def test_it_is_unbiased_with_few_runs_of_own_gains(both):
    """At the end of the outage, of each filter and statistic; 4 standard errors of the difference."""
    found, own = both
    assert found.num_own <= 0.5 * found.num_runs
    k = own.epoch()
    for name in FILTERS:
        runs = own[name]
        nees = runs.nees["pose"][:, k] / runs.dof["pose"]
        for statistic, values in (
            ("position", np.linalg.norm(runs.errors("position")[:, k], axis=1)),
            ("attitude", np.linalg.norm(runs.errors("attitude")[:, k], axis=1)),
            ("nees", nees),
        ):
            of = found.mean(name, statistic)
            se = np.hypot(of.se[k], values.std(ddof=1) / np.sqrt(len(values)))
            assert abs(of.value[k] - values.mean()) < 4 * se, (name, statistic)
            if statistic == "attitude":  # it is not printed, and does not set the number of runs
                continue
            # as sure as so many runs with their own gains; either variance is known to sqrt((kurtosis - 1) / n)
            spread = np.sqrt((stats.kurtosis(values, fisher=False) - 1) * (1 / len(values) + 1 / found.num_runs))
            most = (1 + found.excess) * values.var(ddof=1) / found.num_runs
            assert of.se[k] ** 2 < most * (1 + 4 * spread), (name, statistic)
