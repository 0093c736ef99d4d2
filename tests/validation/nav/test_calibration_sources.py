"""Each error that is no noise, alone and all together: covariances against runs, budgets, derivatives, smoother.

Bands are those of the number of runs: mean squares within 4.5 standard errors at every output looked at.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.joint_covariance import linear_covariance
from nav_jax.filter.parameters import ErrorLines

RUNS = 400
ARCSEC, MGAL = np.deg2rad(1 / 3600), 1e-5
FAST = nj.motions.racetrack(40.0, setups.RATE, speed=60.0, straight=5.0, turn=8.0, ramp=2.0)
EARTH = nj.Wgs84([0.81, 0.115, 500.0])
START = nj.InitialUncertainty(0.1, 0.05, 0.002)
SCENARIO = nj.Scenario(
    FAST,
    setups.aiding(25.0, 40.0)[:2],
    START,
    EARTH,
    every=5,
    output_interval=2.0,
    temperature=25.0 - 15.0 * np.exp(-FAST.time / 20.0),
)  # free inertial from 25 s on, and it warms up
# as large as a filter can still believe, so that they show: the distance is short, so that they change
SOURCES = {
    "scale factor": {"deterministic": [nj.imu.ScaleFactor(1e-3, 1e-3)]},
    "misalignment": {"deterministic": [nj.imu.Misalignment(1e-3, 1e-3)]},
    "g-sensitivity": {"deterministic": [nj.imu.GSensitivity([1e-5, 2e-5, 3e-5])]},
    "temperature": {"deterministic": [nj.imu.TemperatureBias(2e-3, 2e-5)]},
    "gravity": {
        "gravity": nj.imu.GravityDisturbance(deflection=60 * ARCSEC, anomaly=300 * MGAL, distance=[500.0, 800.0, 1e3])
    },
}
ALL = {
    "deterministic": [e for s in SOURCES.values() for e in s.get("deterministic", ())],
    "gravity": SOURCES["gravity"]["gravity"],
}
WHITE = (gj.WN(6e-6), gj.WN(1.5e-8), setups.RATE)


def moments(runs, exact, name):
    """Mean squares over covariances, in standard errors of so many runs."""
    for block in ("position", "velocity", "attitude"):
        squares = np.sum(runs.errors(block) ** 2, axis=2)
        z = (squares.mean(axis=0) - exact.rms(block) ** 2) / (squares.std(axis=0) / np.sqrt(RUNS))
        assert np.abs(z).max() < 4.5, (name, block, z)


@pytest.mark.parametrize("name", SOURCES)
def test_covariances_are_those_of_the_runs(name):
    """A filter that believes the source, and one that knows nothing of it."""
    truth, bare = nj.ImuErrors(*WHITE, **SOURCES[name]), nj.ImuErrors(*WHITE)
    filters = {"right": truth, "bare": bare}
    exact = nj.analyse(SCENARIO, truth, filters)
    runs = nj.compare(SCENARIO, truth, filters, num_runs=RUNS, key=jax.random.key(11), gains="reference")
    for f in filters:
        moments(runs[f], exact[f], f)
    # it matters, and the filter that believes it says what is true
    assert exact["bare"].rms("position")[-1] > 1.1 * exact["right"].rms("position")[-1]
    np.testing.assert_allclose(exact["right"].claimed[:, :9, :9], exact["right"].true[:, :9, :9], rtol=1e-8, atol=1e-15)


def test_all_together_each_run_with_its_own_gains():
    truth = nj.ImuErrors(*WHITE, **ALL)
    exact = nj.analyse(SCENARIO, truth)["filter"]
    runs = nj.monte_carlo(SCENARIO, truth, num_runs=RUNS, key=jax.random.key(12), gains="estimate")
    moments(runs, exact, "all")
    for group, dof in (("navigation", 9), ("sensors", 6)):
        assert runs.dof[group] == exact.dof(group) == dof
        low, high = dof * (1 - 4.5 * np.sqrt(2 / (dof * RUNS))), dof * (1 + 4.5 * np.sqrt(2 / (dof * RUNS)))
        nees = runs.nees[group].mean(axis=0)
        assert low < nees.min()
        assert nees.max() < high
        np.testing.assert_allclose(exact.nees(group), dof, rtol=1e-6)


def test_runs_are_paired():
    """What a source draws depends on no other: the scale factors of runs are the same with and without gravity."""
    setup = nj.filter.prepare(SCENARIO, rate=setups.RATE)
    keys = nj.filter.run_keys(jax.random.key(13), 0, 3)
    both, one = (
        nj.filter.draw_inputs(setup, nj.ImuErrors(*WHITE, **options), keys).errors
        for options in (ALL, SOURCES["scale factor"])
    )
    names = [str(s) for s in both.bank.states]
    for i, state in enumerate(one.bank.states):
        np.testing.assert_array_equal(both.x[names.index(str(state))], one.x[i])


def test_the_budget_names_them_and_adds_up():
    truth = nj.ImuErrors(*WHITE, **ALL)
    budget = nj.error_budget(SCENARIO, truth, nj.ImuErrors(*WHITE))
    assert {
        "accel scale", "gyro scale", "accel misalignment", "gyro misalignment", "gyro g-sensitivity",
        "accel temperature", "gyro temperature", "gravity deflection", "gravity anomaly",
    } <= set(budget.sources)  # fmt: skip
    whole = np.einsum("eii->ei", nj.analyse(SCENARIO, truth, nj.ImuErrors(*WHITE))["filter"].true[:, :9, :9])
    np.testing.assert_allclose(budget.part.sum(axis=0), whole, rtol=1e-12)
    assert (budget.share("position")[:, -1] > 0).all()


@pytest.fixture(scope="module")
def short():
    reference = nj.motions.racetrack(8.0, setups.RATE, speed=60.0, straight=1.0, turn=3.0, ramp=1.0)
    return dataclasses.replace(
        SCENARIO, reference=reference, aiding=setups.aiding(5.0, 8.0)[:2], temperature=20.0 + reference.time
    )


def test_reverse_and_forward_mode_are_differences(short):
    truth, believed = nj.ImuErrors(*WHITE, **ALL), nj.ImuErrors(*WHITE, **ALL)
    experiment = nj.filter.prepare(short, rate=setups.RATE)
    true, ours = ErrorLines(truth), ErrorLines(believed)
    at = [i for i, name in enumerate(true.names) if "gravity" in name or name.endswith(" sd")]
    half = len(true.start)

    @jax.jit
    def cost(vector):
        # a filter that believes something else than is true: else nothing depends on what it believes
        found = linear_covariance(experiment, true.build(vector[:half]), ours.build(vector[half:] + 0.5))
        return jnp.log(jnp.trace(found.true.navigation[-1, :3, :3]))

    x = jnp.concatenate([true.start, ours.start])
    back, forward = jax.jit(jax.grad(cost))(x), jax.jit(jax.jacfwd(cost))(x)
    np.testing.assert_allclose(back, forward, rtol=1e-9, atol=1e-11)
    seen = [*at, *(half + i for i in at)]
    for i in seen:
        h = 1e-3
        e = jnp.zeros(len(x)).at[i].set(h)
        # Richardson: of fourth order
        one, two = (cost(x + e) - cost(x - e)) / (2 * h), (cost(x + 2 * e) - cost(x - 2 * e)) / (4 * h)
        np.testing.assert_allclose(back[i], (4 * one - two) / 3, rtol=1e-5, atol=2e-9)
    assert np.count_nonzero(np.abs(np.asarray(back)[np.array(seen)]) > 1e-6) > len(seen) // 2


def test_sensitivities_smoother_and_design_have_them(short):
    truth = nj.ImuErrors(*WHITE, **ALL)
    slopes = nj.sensitivities(short, truth)
    for side in ("truth", "filter"):
        names = {n for n, s in zip(slopes.names, slopes.sides, strict=True) if s == side}
        assert {"gravity anomaly sd", "gravity deflection n distance"} <= names
    plain, smooth = (
        nj.monte_carlo(short, truth, num_runs=8, key=jax.random.key(3), gains="reference", smooth=s)
        for s in (False, True)
    )
    assert (smooth.sd[0, -2, :6] <= plain.sd[0, -2, :6] * (1 + 1e-9)).all()
    found = nj.design(short, truth, max_accel=0, max_gyro=0, num_starts=1)
    assert found.best().errors.gravity is not None
