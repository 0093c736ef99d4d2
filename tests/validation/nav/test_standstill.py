"""A vehicle that stands: consistency of filters, Monte Carlo against covariances, and what updates are good for.

Bands are those of the number of runs: 4.5 sigma, an epoch and quantity each.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups
from scipy import stats

import gmwm_jax as gj
import nav_jax as nj

RUNS = 256
SPEED, STOPS, GOES = 5.0, 6.0, 18.0
ERRORS = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE, accel_bias_sd=0.02, gyro_bias_sd=2e-3)
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
GNSS = nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1, outages=[(6.5, 24.0)])
ZUPT = nj.aiding.ZeroVelocity(5.0, sd=0.02)
# the mean of the gyros has white noise of its own
ZARU = nj.aiding.ZeroRate(2.0, sd=2e-3, believed=np.sqrt(2e-3**2 + 1.5e-6 / (0.4 * setups.RATE)))


def slowed(t, begin):
    """The integral of a smooth step from 0 to 1 within 2 s."""
    u = jnp.clip((t - begin) / 2.0, 0.0, 1.0)
    return 2.0 * (u**6 - 3 * u**5 + 2.5 * u**4) + jnp.maximum(t - begin - 2.0, 0.0)


def path(t):
    north = SPEED * (t - slowed(t, STOPS) + slowed(t, GOES))
    return jnp.stack([north, 0.0 * t, 0.0 * t])


DRIVE = nj.motions.from_path(path, duration=24.0, rate=setups.RATE, attitude=(0.0, 0.0, 0.0))


def scenario(*sensors):
    return nj.Scenario(DRIVE, (GNSS, *sensors), initial=START, every=5, output_interval=0.5)


@pytest.mark.parametrize("gains", ["reference", "estimate"])
@pytest.mark.parametrize("sensor", [ZUPT, ZARU], ids=lambda s: s.name)
def test_covariances_are_those_of_the_runs_and_filters_consistent(sensor, gains):
    one = scenario(sensor)
    runs = nj.monte_carlo(one, ERRORS, num_runs=RUNS, key=jax.random.key(5), gains=gains)
    found = nj.analyse(one, ERRORS)["filter"]
    ratio = np.mean(runs.error**2, axis=0) / found.sd**2
    assert np.abs(ratio[4::5, :9] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.05
    tail = stats.norm.sf(4.5)
    low, high = stats.chi2.ppf([tail, 1 - tail], RUNS * 9) / RUNS
    mean = runs.nees["navigation"].mean(axis=0)
    assert np.all((low < mean) & (mean < high)), (mean.min() / 9, mean.max() / 9)
    times = runs.nis_time[sensor.name]
    assert times.min() > STOPS + 1.0
    assert times.max() < GOES + 1.0


def test_they_are_worth_having():
    """At the end of the stop, 12 s after the last fix: the velocity by ZUPT, the biases of the gyros by ZARU."""
    at = 17.5
    plain, zupt, zaru = (nj.analyse(scenario(*s), ERRORS)["filter"] for s in ((), (ZUPT,), (ZARU,)))
    k = plain.epoch(at)
    assert (zupt.sd[k, 3:6] < 0.02).all()
    assert (plain.sd[k, 3:5] > 0.05).all()
    # as many means as there are, of a constant
    num = int((GOES - STOPS - 2.0) * 2)
    floor = float(ZARU.believed[0]) / np.sqrt(num)
    assert (zaru.sd[k, 12:15] < 1.3 * floor).all()
    assert (plain.sd[k, 14] > 1.5e-3).all()


def test_the_budget_adds_up():
    budget = nj.error_budget(scenario(ZUPT, ZARU), ERRORS)
    assert {"zero_velocity", "zero_rate"} <= set(budget.sources)
    total = nj.analyse(scenario(ZUPT, ZARU), ERRORS)["filter"].sd[:, :9] ** 2
    np.testing.assert_allclose(budget.part.sum(axis=0), total, rtol=1e-9, atol=1e-18)
