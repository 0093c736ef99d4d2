"""A vehicle on wheels: non-holonomic constraint or odometer, with a mounting and a lever arm that are not known.

Bands are those of the number of runs: 4.5 sigma, an epoch and quantity each.
"""

import dataclasses

import jax
import numpy as np
import pytest
from nav import setups
from scipy import stats

import gmwm_jax as gj
import nav_jax as nj

RUNS = 256
ERRORS = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE, accel_bias_sd=0.02, gyro_bias_sd=1e-3)
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
GNSS = nj.GnssPosition(1.0, horizontal=0.05, vertical=0.1, outages=[(22.0, 36.0)])
AXLE = nj.aiding.NonHolonomic(
    5.0, right=0.03, down=0.05, lever_arm=(-1.2, 0.0, 0.4), lever_arm_sd=0.1, mount_sd=0.03,
    mount_noise="RW(gamma2=1e-7)",
)  # fmt: skip
WHEEL = nj.Odometer(
    5.0, speed=0.03, sideways=0.05, lever_arm=(-1.2, 0.7, 0.4), lever_arm_sd=0.1, scale_sd=0.01, mount_sd=0.03,
    mount_noise="RW(gamma2=1e-7)",
)  # fmt: skip
FLAT, ROUND = nj.FlatEarth(), nj.Wgs84([0.81, 0.115, 500.0])
TRACK = nj.motions.racetrack(duration=36.0, rate=setups.RATE, straight=8.0, turn=10.0, speed=8.0)


def scenario(*sensors, **options):
    return nj.Scenario(TRACK, (GNSS, *sensors), initial=START, every=5, output_interval=0.5, **options)


@pytest.mark.parametrize(
    ("sensor", "gains", "earth"),
    [(AXLE, "reference", FLAT), (AXLE, "estimate", FLAT), (AXLE, "estimate", ROUND), (WHEEL, "estimate", ROUND)],
    ids=["axle-reference-flat", "axle-estimate-flat", "axle-estimate-round", "wheel-estimate-round"],
)
def test_covariances_are_those_of_the_runs_and_filters_consistent(sensor, gains, earth):
    one = scenario(sensor, earth=earth)
    runs = nj.monte_carlo(one, ERRORS, num_runs=RUNS, key=jax.random.key(6), gains=gains)
    found = nj.analyse(one, ERRORS)["filter"]
    ratio = np.mean(runs.error**2, axis=0) / found.sd**2
    assert np.abs(ratio[4::5, :9] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.05
    tail = stats.norm.sf(4.5)
    low, high = stats.chi2.ppf([tail, 1 - tail], RUNS * 9) / RUNS
    mean = runs.nees["navigation"].mean(axis=0)
    assert np.all((low < mean) & (mean < high * 1.05)), (mean.min() / 9, mean.max() / 9)
    nis, dof = runs.nis[sensor.name], len(sensor.axes)
    assert abs(nis.mean() / dof - 1) < 4.5 * np.sqrt(2 / dof / nis.size) + 0.01


def test_it_bridges_an_outage_and_its_mounting_is_found():
    plain, aided = (nj.analyse(scenario(*s), ERRORS)["filter"] for s in ((), (AXLE,)))
    k = plain.epoch(36.0)
    assert np.linalg.norm(aided.sd[k, :2]) < 0.4 * np.linalg.norm(plain.sd[k, :2])
    # a filter that takes a mounting of 2 degrees for none is worse than its claim
    lacking = dataclasses.replace(scenario(AXLE), neglected=("non_holonomic mount",))
    wrong = nj.analyse(lacking, ERRORS)["filter"]
    assert np.trace(wrong.true[k, :2, :2]) > 9 * np.trace(wrong.claimed[k, :2, :2])


def test_an_odometer_finds_its_mounting_and_its_lever_arm():
    """The yaw and the pitch by what is measured sideways, the arm by the turns of the track."""
    bare = nj.Odometer(5.0, speed=0.03, sideways=0.05, lever_arm=(-1.2, 0.7, 0.4))
    lacking = dataclasses.replace(scenario(WHEEL), neglected=("odometer mount", "odometer lever_arm"))
    right, wrong, exact = (nj.analyse(s, ERRORS)["filter"] for s in (scenario(WHEEL), lacking, scenario(bare)))
    k = right.epoch(36.0)
    horizontal = [np.trace(found.true[k, :2, :2]) for found in (exact, right, wrong)]
    assert horizontal[0] < horizontal[1] < horizontal[2] / 4
    assert np.trace(wrong.claimed[k, :2, :2]) < 0.25 * horizontal[2]


@pytest.mark.parametrize("sensor", [AXLE, WHEEL], ids=lambda s: s.name)
def test_the_budget_adds_up_and_names_the_states(sensor):
    budget = nj.error_budget(scenario(sensor), ERRORS)
    assert {sensor.name, f"{sensor.name} mount", f"{sensor.name} lever_arm"} <= set(budget.sources)
    total = nj.analyse(scenario(sensor), ERRORS)["filter"].sd[:, :9] ** 2
    np.testing.assert_allclose(budget.part.sum(axis=0), total, rtol=1e-9, atol=1e-18)


def _axle(sds):
    return nj.aiding.NonHolonomic(
        5.0, right=0.03, down=0.05, lever_arm=(-1.2, 0.0, 0.4), lever_arm_sd=sds[:2],
        mount_sd=sds[2:], mount_noise="RW(gamma2=1e-7)",
    )  # fmt: skip


def _wheel(sds):
    return nj.Odometer(
        5.0, speed=0.03, sideways=0.05, lever_arm=(-1.2, 0.7, 0.4), lever_arm_sd=sds[0], scale_sd=sds[1] / 10,
        mount_sd=sds[2:], mount_noise="RW(gamma2=1e-7)",
    )  # fmt: skip


@pytest.mark.parametrize("sensor", [_axle, _wheel])
def test_gradients_by_what_is_not_known_are_differences(sensor):
    experiment = nj.filter.prepare(scenario(sensor([0.1, 0.1, 0.03, 0.03])), rate=setups.RATE)

    def variance(sds):
        given = experiment.with_sensors([GNSS, sensor(sds)])
        return nj.filter.gains_of(given, ERRORS).claim.navigation[-1, 0, 0, 0]

    at = np.array([0.1, 0.1, 0.03, 0.03])
    backward, forward = jax.grad(variance)(at), jax.jacfwd(variance)(at)
    np.testing.assert_allclose(backward, forward, rtol=1e-6)
    for i, slope in enumerate(backward):
        step = np.zeros(4)
        step[i] = 1e-3 * at[i]
        rise = [float(variance(at + s * step) - variance(at - s * step)) / (2 * s * step[i]) for s in (1, 2)]
        assert (4 * rise[0] - rise[1]) / 3 == pytest.approx(
            float(slope), rel=1e-4, abs=1e-9 * float(abs(backward).max())
        )
