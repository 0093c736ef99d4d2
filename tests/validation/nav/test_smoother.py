"""The smoother is consistent."""

import jax
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


REFERENCE = nj.motions.lemniscate(16.0, setups.RATE)


OUTAGE = (6.0, 12.0)


ERRORS = nj.ImuErrors(gj.WN(6e-5) + gj.GM(0.002, 2e-5), gj.WN(1.5e-6) + gj.GM(0.005, 2e-7), setups.RATE)


START = nj.InitialUncertainty(0.1, 0.05, 0.01)


AIDING = setups.aiding(*OUTAGE)[:2]


@pytest.mark.parametrize("gains", ["reference", "estimate"])
def test_it_is_consistent_and_better(gains, judge):
    """300 runs: mean NEES within 4.5 standard errors of its scatter, and RMS below the filter's inside the outage."""
    scenario = nj.Scenario(REFERENCE, AIDING, START, every=10)
    options = {"num_runs": 300, "key": jax.random.key(4), "gains": gains}
    plain = nj.monte_carlo(scenario, ERRORS, **options)
    smooth = nj.monte_carlo(scenario, ERRORS, smooth=True, **options)
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
