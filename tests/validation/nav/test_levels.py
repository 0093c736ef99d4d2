"""Two levels: the mean of own-gain runs that are others, by linear runs whose mean is known and by shared gains."""

import jax
import numpy as np
import pytest
from nav import setups
from scipy import stats

import nav_jax as nj
from nav_jax.simulation.levels import STATISTICS, two_levels

SCENARIO = nj.Scenario(
    nj.motions.lemniscate(60.0, setups.RATE, attitude="navigation"), setups.aiding(30.0, 50.0),
    nj.InitialUncertainty(0.5, 0.05, np.deg2rad([1.0, 1.0, 5.0])), every=10,
)  # fmt: skip
FILTERS = {"right": setups.imu_errors("right"), "wrong": setups.imu_errors("wrong")}
TRUTH = FILTERS["right"]
NUM_RUNS = 1500

ROUGH = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-8)", "WN(sigma2=1e-7) + RW(gamma2=1e-11)", 10.0)
DRIVE = nj.Scenario(
    nj.motions.racetrack(80.0, 10.0), [nj.GnssPosition(horizontal=1.0, vertical=2.0, outages=[(50.0, 70.0)])],
    nj.InitialUncertainty(1.0, 0.1, 0.05), every=5,
)  # fmt: skip
"""Cheap runs, that are bent: 5.7 m after the outage, in which a difference of linear runs is 0.3 m."""
KEYS, OTHERS = 60, 8_000


@pytest.fixture(scope="module")
def others():
    """Other keys: independent of all runs of two levels."""
    return nj.compare(SCENARIO, TRUTH, FILTERS, num_runs=1000, key=jax.random.key(32))


def by_shared_gains():
    def run(gains, count):
        return nj.compare(SCENARIO, TRUTH, FILTERS, num_runs=count, key=jax.random.key(31), gains=gains)

    return two_levels(run, NUM_RUNS, 0.05, None)


def by_linear_runs():
    return nj.simulation.two_level(SCENARIO, TRUTH, FILTERS, num_runs=NUM_RUNS, key=jax.random.key(31))


@pytest.mark.parametrize(("two", "cheap"), [(by_linear_runs, "linear"), (by_shared_gains, "shared")])
def test_it_is_unbiased_with_few_runs_of_own_gains(two, cheap, others):
    """At the end of the outage, of each filter and statistic; 4 standard errors of the difference."""
    found = two()
    assert found.cheap == cheap
    assert found.num_own <= 0.5 * NUM_RUNS
    k = others.epoch()
    for name in FILTERS:
        for statistic in ("position", "attitude", "nees"):
            values = STATISTICS[statistic](others[name])[:, k]
            of = found.mean(name, statistic)
            se = np.hypot(of.se[k], values.std(ddof=1) / np.sqrt(len(values)))
            assert abs(of.value[k] - values.mean()) < 4 * se, (name, statistic)
            if statistic == "attitude":  # it is not printed, and does not set the number of runs
                continue
            # as sure as so many runs with their own gains; either variance is known to sqrt((kurtosis - 1) / n)
            spread = np.sqrt((stats.kurtosis(values, fisher=False) - 1) * (1 / len(values) + 1 / found.num_own))
            most = (1 + found.excess) * values.var(ddof=1) / NUM_RUNS
            assert of.se[k] ** 2 < most * (1 + 4 * spread), (name, statistic)


def test_intervals_cover_and_their_centre_is_right(judge):
    """Sixty keys of 64 runs each: intervals about the mean of all, and that mean against 8,000 other runs.

    Statistics of one key are correlated, so that the band of the coverage is that of sixty trials; 4 sigma.
    """
    found = [nj.simulation.two_level(DRIVE, ROUGH, num_runs=2000, key=jax.random.key(100 + i)) for i in range(KEYS)]
    own = nj.monte_carlo(DRIVE, ROUGH, num_runs=OTHERS, key=jax.random.key(7))
    k = own.epoch()
    for statistic, of in STATISTICS.items():
        means = [f.mean("filter", statistic) for f in found]
        value = np.array([m.value[k] for m in means])
        half = np.array([f.half_width(m.se[k]) for f, m in zip(found, means, strict=True)])
        # the mean of all has a part of each in it
        covered = np.mean(np.abs(value - value.mean()) < half * np.sqrt(1 - 1 / KEYS))
        judge(
            f"coverage of 95 % intervals, {statistic}",
            covered,
            0.95 - 4 * np.sqrt(0.95 * 0.05 / KEYS),
            1,
            num_draws=KEYS,
        )
        values = of(own)[:, k]
        se = np.hypot(value.std(ddof=1) / np.sqrt(KEYS), values.std(ddof=1) / np.sqrt(OTHERS))
        off = (value.mean() - values.mean()) / se
        judge(f"mean {statistic} off that of other runs, in standard errors", off, -4, 4, num_draws=OTHERS)
    assert {f.cheap for f in found} == {"linear"}
