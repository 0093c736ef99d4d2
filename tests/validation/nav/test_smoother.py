"""The smoother is consistent."""

import jax
import numpy as np
import pytest
from nav import setups

import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


OUTAGE = setups.SMOOTHED_OUTAGE


@pytest.mark.parametrize("gains", ["reference", "estimate"])
def test_it_is_consistent_and_better(gains, judge):
    """300 runs: mean NEES within 4.5 standard errors of its scatter, and RMS below the filter's inside the outage."""
    options = {"num_runs": 300, "key": jax.random.key(4), "gains": gains}
    plain = nj.monte_carlo(setups.SMOOTHED, setups.SMOOTHED_ERRORS, **options)
    smooth = nj.monte_carlo(setups.SMOOTHED, setups.SMOOTHED_ERRORS, smooth=True, **options)
    assert [n.startswith("Errors are those of the smoother") for n in smooth.notes] == [True]
    for group, dof in smooth.dof.items():
        nees = smooth.nees[group]
        z = (nees.mean(axis=0) - dof) / (nees.std(axis=0, ddof=1) / np.sqrt(300))
        judge(f"mean NEES of {group} at every epoch, in standard errors", z, -4.5, 4.5, num_draws=300)
        judge(f"NEES of {group} over its dimension", nees.mean() / dof, 0.9, 1.1, num_draws=300)
    inside = (plain.time > OUTAGE[0]) & (plain.time < OUTAGE[1])
    rms = [np.sqrt(np.mean(np.sum(r.errors("position") ** 2, axis=2), axis=0)) for r in (plain, smooth)]
    assert np.all(rms[1][inside] < rms[0][inside])
    assert rms[1][inside].max() < 0.5 * rms[0][inside].max()
