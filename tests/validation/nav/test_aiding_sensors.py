"""Sensors that are not linear in position and velocity: consistency of filters, Monte Carlo against covariances.

An antenna and a wheel on lever arms, and a wheel whose scale factor a filter estimates. Bands are those of the number
of runs: 4.5 sigma, an epoch and quantity each, so that all of them fail by chance once in a thousand.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups
from scipy import stats

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.layout import GROUPS
from nav_jax.imu.emulation import stream
from nav_jax.statistics.distributions import chi2_quantile

RUNS = 256
ERRORS = nj.ImuErrors(gj.WN(6e-5) + gj.GM(0.002, 2e-5), gj.WN(1.5e-6) + gj.GM(0.005, 2e-7), setups.RATE)
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
GNSS = nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1, lever_arm=(1.0, 0.5, -1.5))
WHEEL = nj.aiding.Odometer(4.0, speed=0.03, sideways=0.05, lever_arm=(-1.0, 0.3, 0.8), scale_sd=0.05)
SCENARIO = nj.Scenario(
    nj.motions.lemniscate(20.0, setups.RATE, attitude="navigation"),
    (GNSS, WHEEL),
    initial=START,
    every=10,
    output_interval=0.5,
)


@pytest.fixture(scope="module", params=["reference", "estimate"])
def runs(request):
    return nj.monte_carlo(SCENARIO, ERRORS, num_runs=RUNS, key=jax.random.key(5), gains=request.param)


@pytest.fixture(scope="module")
def covariances():
    return nj.analyse(SCENARIO, ERRORS)["filter"]


def test_filters_are_consistent_at_fixes_and_between(runs):
    """NEES in the band of chi-square, coverage in that of the binomial, at every output: half of them are fixes."""
    r = runs
    assert r.num_good == RUNS
    tail = stats.norm.sf(4.5)
    for group in GROUPS:
        dof = r.dof[group]
        low, high = stats.chi2.ppf([tail, 1 - tail], RUNS * dof) / RUNS
        mean = r.nees[group].mean(axis=0)
        assert np.all((low < mean) & (mean < high)), (group, mean.min() / dof, mean.max() / dof)
        inside = np.sum(r.nees[group] <= chi2_quantile(0.9, dof), axis=0)
        few, many = stats.binom.ppf([tail, 1 - tail], RUNS, 0.9)
        assert np.all((few <= inside) & (inside <= many)), group
    for sensor, nis in r.nis.items():
        K = r.nis_dof[sensor]
        assert abs(nis.mean() / K - 1) < 4.5 * np.sqrt(2 / (K * nis.size))


def test_covariances_are_those_of_the_runs(runs, covariances):
    """Mean squares of the errors over the true covariance at every fifth output: 4.5 sigma of RUNS normal numbers."""
    ratio = np.mean(runs.error**2, axis=0) / covariances.sd**2
    assert np.abs(ratio[4::5, :9] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.02
    np.testing.assert_allclose(covariances.true[:, :9, :9], covariances.claimed[:, :9, :9], rtol=1e-9, atol=1e-14)


def test_the_scale_is_estimated():
    """From 5 % to a few thousandths; its error over its standard deviation is a standard normal number."""
    setup = nj.filter.prepare(SCENARIO, rate=setups.RATE)
    keys = nj.filter.run_keys(jax.random.key(9), 0, RUNS)
    inputs = nj.filter.draw_inputs(setup, ERRORS, keys)
    out = nj.filter.run_filter(setup, ERRORS, inputs, nj.filter.gains_of(setup, ERRORS, smooth=True))
    of_states = jax.vmap(lambda k: stream(stream(k, "odometer"), "states"))(keys)
    truth = setup.timeline.own.draw(1, jnp.ones(80, dtype=int), 1, of_states)[0, 0]
    assert np.std(truth) == pytest.approx(0.05, rel=4.5 / np.sqrt(2 * RUNS))
    sd = np.sqrt(np.asarray(out.memory.P)[-1, -1, -1, 0])
    assert sd < 0.005
    scaled = np.asarray(out.state.x[-1, -1] - truth) / sd
    assert abs(np.mean(scaled**2) - 1) < 4.5 * np.sqrt(2 / RUNS)
    # what the smoother says of a constant does not depend on time
    smooth = nj.filter.run_filter(setup, ERRORS, inputs, nj.filter.gains_of(setup, ERRORS, smooth=True), smooth=True)
    np.testing.assert_allclose(smooth.memory.P[:, -1, -1, 0], sd**2, rtol=1e-6)
    spread = np.ptp(np.asarray(smooth.state.x)[:, -1], axis=0)
    assert spread.max() < 0.2 * sd


def test_the_smoother_is_consistent():
    r = nj.monte_carlo(SCENARIO, ERRORS, num_runs=RUNS, key=jax.random.key(6), gains="reference", smooth=True)
    plain = nj.monte_carlo(SCENARIO, ERRORS, num_runs=RUNS, key=jax.random.key(6), gains="reference")
    low, high = stats.chi2.ppf(stats.norm.cdf([-4.5, 4.5]), RUNS * 9) / RUNS
    mean = r.nees["navigation"].mean(axis=0)
    assert np.all((low < mean) & (mean < high))
    assert (r.sd[0, :-1, :9] < plain.sd[0, :-1, :9]).all()


def test_a_walking_scale_is_followed():
    """A scale that walks, from fix to fix: innovations have the variances that the filter states."""
    walk = nj.aiding.Odometer(4.0, speed=0.03, scale_sd=0.01, scale_noise=gj.RW(1e-5))
    scenario = nj.Scenario(SCENARIO.reference, (GNSS, walk), initial=START, every=10)
    r = nj.monte_carlo(scenario, ERRORS, num_runs=RUNS, key=jax.random.key(7), gains="reference")
    nis = r.nis["odometer"]
    assert abs(nis.mean() - 1) < 4.5 * np.sqrt(2 / nis.size)
    # the late ones too, where a filter that takes the scale for a constant would be far off
    assert abs(nis[:, -8:].mean() - 1) < 4.5 * np.sqrt(2 / nis[:, -8:].size)


def test_scale_factors_and_misalignments_are_estimated():
    """Of an IMU on a trajectory that turns: NEES of all groups, and the scale factor of the vertical accelerometer."""
    constants = (nj.imu.ScaleFactor(1e-2, 1e-2), nj.imu.Misalignment(1e-3, 5e-3))
    errors = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE, deterministic=constants)
    aiding = (
        nj.GnssPosition(5.0, horizontal=0.02, vertical=0.02),
        nj.GnssVelocity(5.0, horizontal=0.01, vertical=0.01),
    )
    scenario = nj.Scenario(SCENARIO.reference, aiding, initial=START, every=5)
    r = nj.monte_carlo(scenario, errors, num_runs=RUNS, key=jax.random.key(8), gains="reference")
    exact = nj.analyse(scenario, errors)["filter"]
    for group in GROUPS:
        low, high = stats.chi2.ppf(stats.norm.cdf([-4.5, 4.5]), RUNS * r.dof[group]) / RUNS
        mean = r.nees[group].mean(axis=0)
        assert np.all((low < mean) & (mean < high)), group
    ratio = np.mean(r.error**2, axis=0) / exact.sd**2
    assert np.abs(ratio[4::5] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.02
    # its error is 1 % of gravity at the start
    vertical = exact.sd[:, 11]
    assert vertical[-1] < 0.2 * 1e-2 * 9.8
