"""Sensors that show a heading without motion: consistency of filters, Monte Carlo against covariances.

Bands are those of the number of runs: 4.5 sigma, an epoch and quantity each.
"""

import jax
import numpy as np
import pytest
from nav import setups
from scipy import stats

import gmwm_jax as gj
import nav_jax as nj

RUNS = 256
ERRORS = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE, gyro_bias_sd=1e-3)
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 5.0]))
GNSS = nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1)
COMPASS = nj.aiding.Magnetometer(5.0, sd=5e-7, field=(22e-6, 1e-6, 43e-6), hard_iron_sd=1e-6)
PAIR = nj.aiding.DualAntenna(2.0, horizontal=0.01, vertical=0.02, baseline=(1.0, 0.2, 0.0), offset_sd=0.01)
CIRCLE = nj.motions.circle(duration=20.0, rate=setups.RATE)


@pytest.mark.parametrize("gains", ["reference", "estimate"])
@pytest.mark.parametrize("sensor", [COMPASS, PAIR], ids=lambda s: s.name)
def test_covariances_are_those_of_the_runs_and_filters_consistent(sensor, gains):
    scenario = nj.Scenario(CIRCLE, (GNSS, sensor), initial=START, every=5, output_interval=0.5)
    runs = nj.monte_carlo(scenario, ERRORS, num_runs=RUNS, key=jax.random.key(8), gains=gains)
    found = nj.analyse(scenario, ERRORS)["filter"]
    ratio = np.mean(runs.error[:, :, :9] ** 2, axis=0) / found.sd[:, :9] ** 2
    assert np.abs(ratio[4::5] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.05
    tail = stats.norm.sf(4.5)
    low, high = stats.chi2.ppf([tail, 1 - tail], RUNS * 9) / RUNS
    mean = runs.nees["navigation"].mean(axis=0)
    assert np.all((low < mean) & (mean < high)), (mean.min() / 9, mean.max() / 9)
    # 5 degrees of heading are gone within a second
    assert found.sd[1, 8] < np.deg2rad(2.5)


def test_budgets_add_up_and_name_the_states():
    scenario = nj.Scenario(CIRCLE, (GNSS, COMPASS, PAIR), initial=START, every=5, output_interval=1.0)
    budget = nj.error_budget(scenario, ERRORS)
    assert {"magnetometer hard_iron", "dual_antenna offset"} <= set(budget.sources)
    total = nj.analyse(scenario, ERRORS)["filter"].sd[:, :9] ** 2
    np.testing.assert_allclose(budget.part.sum(axis=0), total, rtol=1e-9, atol=1e-18)
