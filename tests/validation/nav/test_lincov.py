"""Linear covariances against Monte Carlo runs."""

import jax
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.statistics.distributions import chi2_quantile

pytestmark = pytest.mark.usefixtures("quick_compilation")


OUTAGE = (12.0, 20.0)


NUM_RUNS = 800


START = nj.InitialUncertainty(0.05, 0.02, np.deg2rad([0.1, 0.1, 0.5]))


TRUTH = nj.ImuErrors(
    gj.WN(6e-5) + gj.GM(0.002, 2e-5) + gj.RW(1e-11), gj.WN(1.5e-6) + gj.GM(0.005, 2e-7), setups.RATE, gyro_bias_sd=1e-4
)


FILTERS = {
    "right": TRUTH,
    "white": nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE),
    "fewer": nj.ImuErrors(gj.WN(6e-5) + gj.GM(0.01, 1e-5), gj.WN(3e-6), setups.RATE, gyro_bias_sd=5e-5),
    "more": nj.ImuErrors(
        gj.WN(9e-5) + gj.GM(0.002, 2e-5) + gj.MAT32(0.01, 1e-6), gj.WN(2e-6) + gj.DR(1e-8), setups.RATE
    ),
}


SCENARIO = nj.Scenario(nj.motions.lemniscate(20.0, setups.RATE), setups.aiding(*OUTAGE), START, every=10)


@pytest.fixture(scope="module")
def analysis():
    return nj.analyse(SCENARIO, TRUTH, FILTERS)


def judge_moments(judge, analysis, comparison, num_runs):
    """RMS of each block within 4 standard errors at 95 % of the epochs or more, NEES within 5 at all, coverage too."""
    for name, c in analysis.items():
        runs = comparison[name]
        for block in ("position", "velocity", "attitude", "accel", "gyro"):
            squares = np.sum(runs.errors(block) ** 2, axis=2)
            z = (squares.mean(axis=0) - c.rms(block) ** 2) / (squares.std(axis=0) / np.sqrt(num_runs))
            share = np.mean(np.abs(z) < 4)
            judge(f"{name}: share of epochs within 4 sigma, {block}", share, 0.95, 1, num_draws=num_runs)
            judge(f"{name}: mean square of {block}, in standard errors", z, -5.5, 5.5, num_draws=num_runs)
        for group in ("position", "attitude", "pose", "navigation"):
            nees = runs.nees[group]
            z = (nees.mean(axis=0) - c.nees(group)) / (nees.std(axis=0) / np.sqrt(num_runs))
            judge(f"{name}: mean NEES of {group}, in standard errors", z, -5, 5, num_draws=num_runs)
            inside = np.mean(nees <= float(chi2_quantile(0.95, c.dof(group))), axis=0)
            expected = c.coverage(group, 0.95)
            off = np.abs(inside - expected) / (4.5 * np.sqrt(expected * (1 - expected) / num_runs) + 2e-3)
            judge(f"{name}: coverage of {group} off its own, in bands", off, 0, 1, num_draws=num_runs)


def test_monte_carlo(analysis, judge):
    """800 runs of three filters, with states of other kinds and number than the truth's, through an outage."""
    comparison = nj.compare(
        SCENARIO,
        TRUTH,
        {name: f for name, f in FILTERS.items() if name != "right"},
        num_runs=NUM_RUNS,
        key=jax.random.key(5),
        gains="reference",
    )
    judge_moments(judge, {name: analysis[name] for name in comparison.runs}, comparison, NUM_RUNS)
    for name, runs in comparison.runs.items():
        for sensor, variance in analysis[name].innovation.items():
            z = (np.mean(runs.innovation[sensor] ** 2, axis=0) / variance - 1) / np.sqrt(2 / NUM_RUNS)
            judge(f"{name}: variance of innovations of {sensor}, in sigmas", z, -5, 5, num_draws=NUM_RUNS)


def test_noise_of_fixes_that_has_a_memory(judge):
    """GNSS errors of a Gauss-Markov process and a random walk, of which the filter knows nothing; quantisation."""
    aiding = (
        nj.GnssPosition(
            2.0,
            horizontal="WN(sigma2=1e-4) + GM(beta=0.2, variance=4e-3)",
            vertical="WN(sigma2=1e-3) + RW(gamma2=1e-4)",
            outages=((4.0, 6.0),), believed=(0.05, 0.1),
            first=1.5,
        ),
        nj.Barometer(1.0, height="QN(q2=0.01) + GM(beta=0.1, variance=0.1)", believed=0.3),
    )  # fmt: skip
    truth = nj.ImuErrors(
        "WN(sigma2=6e-5) + QN(q2=1e-4) + GM(beta=0.01, variance=1e-4)",
        "WN(sigma2=1.5e-6) + QN(q2=1e-5) + RW(gamma2=1e-9)",
        setups.RATE,
    )
    believed = {"filter": nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", setups.RATE)}
    scenario = nj.Scenario(nj.motions.lemniscate(10.0, setups.RATE), aiding, START, every=5)
    c = nj.analyse(scenario, truth, believed)
    runs = nj.compare(scenario, truth, believed, num_runs=NUM_RUNS, key=jax.random.key(6), gains="reference")
    # of the sensors what lasts: the rounding errors of quantisation are no part of it, here and there
    columns = {"position": slice(0, 3), "accel": slice(9, 12), "gyro": slice(12, 15)}
    for block, at in columns.items():
        squares = runs["filter"].errors(block) ** 2
        z = (squares.mean(axis=0) - c["filter"].sd[:, at] ** 2) / (squares.std(axis=0) / np.sqrt(NUM_RUNS))
        judge(f"mean square of {block}, in standard errors", z, -4.5, 4.5, num_draws=NUM_RUNS)
    # the fixes are worse than the filter thinks
    assert np.all(c["filter"].nees("position")[3:] > 4)
