"""Ten minutes of a car on the ellipsoid with every error that can be estimated at once: runs against covariances.

200 runs with their own gains. A NEES is in its band where its mean over the runs is within two-sided 95 % of chi2/R. Of
independent epochs 95 % are; what errs slowly is on one side for long, which makes that 88 to 100 %.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import nav_jax as nj

RUNS = 200
RATE = 50.0
OUTAGES = [(150.0, 170.0), (300.0, 330.0), (450.0, 480.0)]
ARCSEC, MGAL = np.deg2rad(1 / 3600), 1e-5


def _car(t):
    """Bends, stretches and a hill: up to 26 m/s and 3 m/s^2, height within 8 m."""
    w = 2 * jnp.pi
    north = 300 * jnp.sin(w * t / 130) + 35 * jnp.sin(w * t / 37)
    east = 260 * jnp.cos(w * t / 170) + 25 * jnp.cos(w * t / 29)
    return jnp.stack([north, east, 8 * jnp.sin(w * t / 90)])


@pytest.fixture(scope="module")
def study():
    reference = nj.motions.from_path(_car, duration=600.0, rate=RATE, name="car")
    antenna = nj.Gnss(
        1.0, horizontal=0.5, vertical=1.0, horizontal_velocity=0.05, vertical_velocity=0.1, lever_arm=(0.6, 0.2, -1.1),
        lever_arm_sd=0.1, time_offset_sd=0.02, averaged=0.25, drift="GM(beta=0.01, variance=0.09)", outages=OUTAGES,
    )  # fmt: skip
    pressure = nj.Barometer(1.0, height=0.3, offset_sd=3.0, offset_noise="GM(beta=0.002, variance=1.0)", scale_sd=0.01)
    scenario = nj.Scenario(
        reference, [antenna, pressure], nj.InitialUncertainty(1.0, 0.1, np.deg2rad([0.5, 0.5, 2.0])),
        nj.Wgs84([0.81, 0.115, 500.0]), every=10, output_interval=1.0,
    )  # fmt: skip
    errors = nj.ImuErrors(
        "WN(sigma2=1e-4) + GM(beta=1e-4, variance=4e-5)", "WN(sigma2=1e-7) + GM(beta=1e-4, variance=4e-9)", RATE,
        deterministic=[
            nj.imu.ScaleFactor(2e-3, 2e-3), nj.imu.Misalignment(2e-3, 2e-3), nj.imu.GSensitivity([1e-5, 1e-5, 1e-5])
        ],
        gravity=nj.imu.GravityDisturbance(deflection=10 * ARCSEC, anomaly=30 * MGAL, distance=[2e3, 3e3, 4e3]),
    )  # fmt: skip
    runs = nj.monte_carlo(scenario, errors, num_runs=RUNS, key=jax.random.key(20), gains="estimate")
    return runs, nj.analyse(scenario, errors)["filter"]


def test_a_filter_of_all_states_says_what_is_true(study):
    runs, _ = study
    assert runs.num_good == RUNS
    seen = {}
    for group, nees in runs.nees.items():
        dof = runs.dof[group] * RUNS
        low, high = stats.chi2.ppf([0.025, 0.975], dof) / RUNS
        mean = nees.mean(axis=0)[1:]
        seen[group] = float(np.mean((mean > low) & (mean < high)))
    assert set(seen) == set(nj.filter.layout.GROUPS)
    assert min(seen.values()) >= 0.88, seen


def test_covariances_without_a_random_number_are_those_of_the_runs(study):
    runs, exact = study
    for block in ("position", "velocity", "attitude"):
        squares = np.sum(runs.errors(block) ** 2, axis=2)
        z = (squares.mean(axis=0) - exact.rms(block) ** 2) / (squares.std(axis=0) / np.sqrt(RUNS))
        assert np.mean(np.abs(z) < 4.0) >= 0.95
