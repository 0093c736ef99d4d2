"""The right model is consistent: NEES, NIS and coverage of ten times 200 runs over 300 s, 40 s of it without GNSS."""

import jax
import numpy as np
import pytest
import scipy.stats
from nav import setups

import nav_jax as nj

NUM_RUNS = 2000
BATCH = 200
OUTAGE = (260.0, 300.0)
IN_OUTAGE = (0.95 - 4.5 * np.sqrt(0.95 * 0.05 * BATCH / NUM_RUNS), 1.0)
"""4.5 sigma of the average over 10 batches of a share, which lies between 0 and 1, so that its variance is at most that
of a batch which is in the band at all epochs or at none."""


@pytest.fixture(scope="module")
def runs():
    """Started from stationarity, with initial errors; the slowest process has a time constant of half a day."""
    start = nj.InitialUncertainty(0.05, 0.02, np.deg2rad([0.1, 0.1, 0.5]))
    scenario = nj.Scenario(nj.motions.lemniscate(300.0, setups.RATE), setups.aiding(*OUTAGE), start, every=10)
    return nj.monte_carlo(scenario, setups.imu_errors(), num_runs=NUM_RUNS, key=jax.random.key(20261121))


def share_in_band(values, dof):
    """Of epochs at which the mean over 200 runs lies in its 95 % chi-square band, averaged over batches of runs.

    The 41 epochs of the outage are one or two independent ones, since errors in it grow out of one another: a batch is
    in the band at all of them, mostly, or at half of them. So only the average over batches says anything there, and no
    more than `IN_OUTAGE`; how large the errors of an outage are says the mean.
    """
    low, high = scipy.stats.chi2.ppf([0.025, 0.975], dof * BATCH) / BATCH
    mean = values.reshape(-1, BATCH, values.shape[1]).mean(axis=1)
    return np.mean((low <= mean) & (mean <= high))


@pytest.mark.parametrize("group", ["position", "velocity", "attitude", "pose", "navigation", "sensors"])
def test_nees_is_in_its_band(runs, group, judge):
    """At 88-99 % of the epochs before the outage; its mean there and in it at 4.5 sigma of its scatter over runs."""
    nees, dof = runs.nees[group], runs.dof[group]
    before = runs.time < OUTAGE[0]
    for part, band in ((nees[:, before], (0.88, 0.99)), (nees[:, ~before], IN_OUTAGE)):
        judge(f"share of epochs in band, {group}", share_in_band(part, dof), *band, num_draws=NUM_RUNS)
        mean = part.mean(axis=1)
        off = (mean.mean() - dof) / (mean.std(ddof=1) / np.sqrt(NUM_RUNS))
        judge(f"mean NEES of {group}, in standard errors", off, -4.5, 4.5, num_draws=NUM_RUNS)


def test_innovations_are_white_and_of_the_stated_size(runs, judge):
    """NIS in its band, and no correlation of normalised innovations from fix to fix (4.5 sigma)."""
    for name, nis in runs.nis.items():
        share = share_in_band(nis, runs.nis_dof[name])
        judge(f"share of fixes in band, {name}", share, 0.88, 0.99, num_draws=NUM_RUNS)
        total = nis.sum(axis=1)
        expected = runs.nis_dof[name] * nis.shape[1]
        off = (total.mean() - expected) / np.sqrt(2 * expected / NUM_RUNS)
        judge(f"mean NIS of {name}, in standard errors", off, -4.5, 4.5, num_draws=NUM_RUNS)
        nu = runs.innovation[name]
        nu = nu / np.sqrt(np.mean(nu**2, axis=0))
        for lag in (1, 2, 5):
            together = np.mean(nu[:, lag:] * nu[:, :-lag], axis=1)
            off = together.mean(axis=0) * np.sqrt(NUM_RUNS * (nu.shape[1] - lag))
            judge(f"correlation of {name} at lag {lag}, in sigmas", off, -4.5, 4.5, num_draws=NUM_RUNS)


@pytest.mark.parametrize("level", [0.7, 0.95])
def test_coverage_is_what_it_says(runs, level, judge):
    """Averaged over epochs before the outage and in it; the scatter over runs makes the band, 4.5 sigma."""
    for group in ("position", "pose", "navigation", "sensors"):
        inside = runs.nees[group] <= scipy.stats.chi2.ppf(level, runs.dof[group])
        for part in (inside[:, runs.time < OUTAGE[0]], inside[:, runs.time >= OUTAGE[0]]):
            share = part.mean(axis=1)
            off = (share.mean() - level) / (share.std(ddof=1) / np.sqrt(NUM_RUNS))
            judge(f"coverage of {group} at {level}, in standard errors", off, -4.5, 4.5, num_draws=NUM_RUNS)


def test_standard_deviations_are_those_of_the_errors(runs, judge):
    """Of all 15 components at the end: variance ratios in their chi-square band at 4.5 sigma."""
    ratio = np.mean(runs.error[:, -1] ** 2 / runs.sd[:, -1] ** 2, axis=0)
    off = (ratio - 1) / np.sqrt(2 / NUM_RUNS)
    judge("variances over those claimed, off 1 in sigmas", off, -4.5, 4.5, num_draws=NUM_RUNS)
