"""Errors of receivers and barometers, each alone: Monte Carlo against covariances, budgets, derivatives, vibration.

What is emulated comes from the reference at the times that count; what filters and covariances make of it is of first
order in a time offset, and an integral of what the IMU says. Bands are those of the number of runs: 4.5 sigma.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups
from scipy import stats

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.aiding import gnss as gnss_module
from nav_jax.filter.layout import GROUPS
from nav_jax.imu.emulation import stream
from nav_jax.lincov.derivatives import rms_of

RUNS = 256
RATE = 50.0
ERRORS = nj.ImuErrors(
    "WN(sigma2=6e-5) + GM(beta=0.002, variance=2e-5)", "WN(sigma2=1.5e-6) + GM(beta=0.005, variance=2e-7)", RATE
)
START = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([0.5, 0.5, 2.0]))
REFERENCE = nj.motions.lemniscate(15.0, RATE, attitude="navigation")
CLIMBING = nj.motions.helix(15.0, RATE)
P = {"horizontal": 0.02, "vertical": 0.03}
BOTH = P | {"horizontal_velocity": 0.02, "vertical_velocity": 0.03}
SLOW, SLOW_V = "GM(beta=0.05, variance=0.04)", "GM(beta=0.05, variance=4e-4)"
ARM = {"lever_arm": setups.ARM}
POSITION = nj.GnssPosition(2.0, **P)
EVERYTHING = {"lever_arm_sd": 0.3, "time_offset_sd": 0.02, "averaged": 0.25, "drift": SLOW, "drift_velocity": SLOW_V}

SOURCES = {
    "lever arm": (nj.GnssPosition(2.0, **P, **ARM, lever_arm_sd=0.3),),
    "lever arm of a velocity": (POSITION, nj.GnssVelocity(2.0, **P, lever_arm_sd=(0.3, 0.2, 0.1))),
    "drift": (nj.GnssPosition(2.0, **P, drift=(SLOW, "RW(gamma2=1e-4)")), nj.GnssVelocity(2.0, **P)),
    "time offset": (nj.GnssPosition(2.0, **P, time_offset_sd=0.02),),
    "time offset of a velocity": (POSITION, nj.GnssVelocity(2.0, **P, **ARM, time_offset_sd=0.02)),
    "age of a velocity": (POSITION, nj.GnssVelocity(2.0, **P, **ARM, averaged=0.25)),
    "all of a receiver": (nj.Gnss(2.0, **BOTH, **ARM, **EVERYTHING),),
    "offset": (POSITION, nj.Barometer(2.0, height=0.05, offset_sd=1.0, offset_noise=SLOW)),
    "scale": (POSITION, nj.Barometer(2.0, height=0.05, scale_sd=0.02)),
}


def scenario(name, **options):
    reference = CLIMBING if name == "scale" else REFERENCE
    return nj.Scenario(reference, SOURCES[name], START, every=5, output_interval=0.5, **options)


@pytest.mark.parametrize("name", SOURCES)
def test_runs_have_the_covariance_that_is_computed(name):
    """NEES of all groups at every output, mean squares over variances at every fifth, innovations; 4.5 sigma."""
    of = scenario(name)
    r = nj.monte_carlo(of, ERRORS, num_runs=RUNS, key=jax.random.key(11), gains="reference")
    exact = nj.analyse(of, ERRORS)["filter"]
    tail = stats.norm.sf(4.5)
    for group in GROUPS:
        low, high = stats.chi2.ppf([tail, 1 - tail], RUNS * r.dof[group]) / RUNS
        mean = r.nees[group].mean(axis=0)
        assert np.all((low < mean) & (mean < high)), (group, mean.min() / r.dof[group], mean.max() / r.dof[group])
    ratio = np.mean(r.error[..., :9] ** 2, axis=0) / exact.sd[:, :9] ** 2
    assert np.abs(ratio[4::5] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.02
    np.testing.assert_allclose(exact.true[:, :9, :9], exact.claimed[:, :9, :9], rtol=1e-9, atol=1e-14)
    for sensor, nis in r.nis.items():
        K = r.nis_dof[sensor]
        assert abs(nis.mean() / K - 1) < 4.5 * np.sqrt(2 / (K * nis.size)), sensor


def test_a_filter_may_lack_what_is_there_or_suspect_what_is_not():
    """A lever arm and an offset that the filter takes for zero: true errors are those of the runs."""
    sensors = (*SOURCES["lever arm"], nj.Barometer(2.0, height=0.05, offset_sd=1.0))
    of = nj.Scenario(REFERENCE, sensors, START, every=5, output_interval=0.5)
    names = ("gnss_position lever_arm", "barometer offset")
    whole = nj.analyse(of, ERRORS)["filter"]
    lacking, suspicious = (
        nj.analyse(dataclasses.replace(of, **{how: names}), ERRORS)["filter"] for how in ("neglected", "suspected")
    )
    # what it claims is that of a filter in a world without these errors
    known = (nj.GnssPosition(2.0, **P, **ARM), nj.Barometer(2.0, height=0.05))
    without = nj.analyse(dataclasses.replace(of, aiding=known), ERRORS)["filter"]
    np.testing.assert_allclose(lacking.claimed, without.claimed, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(suspicious.claimed, whole.claimed, rtol=1e-9, atol=1e-15)
    assert (lacking.sd[-1, :3] > 3 * whole.sd[-1, :3]).all()
    assert (suspicious.sd[-1, :3] <= whole.sd[-1, :3] * (1 + 1e-9)).all()
    lack = dataclasses.replace(of, neglected=names)
    r = nj.monte_carlo(lack, ERRORS, num_runs=RUNS, key=jax.random.key(12), gains="reference")
    ratio = np.mean(r.error[..., :9] ** 2, axis=0) / lacking.sd[:, :9] ** 2
    assert np.abs(ratio[4::5] - 1).max() < 4.5 * np.sqrt(2 / RUNS) + 0.02


def test_budgets_name_each_error_and_add_up():
    of = dataclasses.replace(scenario("all of a receiver"), neglected=("gnss time_offset",))
    budget, whole = nj.error_budget(of, ERRORS), nj.analyse(of, ERRORS)["filter"]
    kinds = ("lever_arm", "time_offset", "drift", "drift_velocity")
    assert set(budget.sources) > {f"gnss {kind}" for kind in kinds}
    variances = np.diagonal(whole.true, axis1=1, axis2=2)[:, :9]
    np.testing.assert_allclose(budget.part.sum(axis=0), variances, rtol=1e-12, atol=1e-18)
    rows = dict(zip(budget.sources, budget.part, strict=True))
    assert all((rows[f"gnss {kind}"][-1, :3] > 0).all() for kind in kinds)


PARAMETERS = {
    "lever arm sd": 0.3, "time offset sd": 0.02, "drift beta": 0.05, "drift variance": 0.04,
    "velocity drift variance": 4e-4, "offset sd": 1.0, "offset variance": 0.04, "scale sd": 0.02,
}  # fmt: skip


def built(x):
    arm, tau, beta, variance, of_velocity, offset, wander, scale = x
    slow = gj.GM(beta, variance)
    receiver = nj.Gnss(
        2.0, **BOTH, **ARM, averaged=0.25, lever_arm_sd=arm, time_offset_sd=tau, drift=slow,
        drift_velocity=gj.GM(0.05, of_velocity),
    )  # fmt: skip
    baro = nj.Barometer(1.0, height=0.05, offset_sd=offset, offset_noise=gj.GM(0.05, wander), scale_sd=scale)
    return receiver, baro


def test_derivatives_by_every_parameter():
    """Reverse, forward and differences, of the true RMS of a filter that believes other numbers: 1e-5."""
    x = jnp.array(list(PARAMETERS.values()))
    reference = nj.motions.helix(4.0, 20.0)
    errors = ERRORS.at_rate(20.0)
    experiment = nj.filter.prepare(nj.Scenario(reference, built(x), START, every=10, output_interval=1.0), rate=20.0)
    motion = nj.lincov.motion_of(experiment)

    @jax.jit
    def loss(y):
        there, believed = (experiment.with_sensors(built(z)) for z in (y, jnp.sqrt(x * y)))
        mixed = eqx.tree_at(lambda e: e.timeline.own, there, believed.timeline.own)
        found = nj.lincov.linear_covariance(mixed, errors, errors, motion=motion)
        return jnp.sum(rms_of(found.true.navigation)[:, -1])

    y = x * 1.3
    reverse, forward = jax.jit(jax.grad(loss))(y), jax.jit(jax.jacfwd(loss))(y)
    np.testing.assert_allclose(reverse, forward, rtol=1e-5)
    h = 1e-4
    for i, name in enumerate(PARAMETERS):
        moved = [loss(y.at[i].mul(1 + s * h)) for s in (-2.0, -1.0, 1.0, 2.0)]
        difference = float(moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * h * float(y[i]))
        np.testing.assert_allclose(difference, reverse[i], rtol=1e-5, atol=1e-9, err_msg=name)


def test_the_mean_of_a_velocity_is_no_approximation():
    """Without any error, fixes emulated from positions are what the filter predicts: 1e-3 m/s.

    The velocity at the time of the fix is off by more than a hundred times as much.
    """
    sensor = nj.GnssVelocity(2.0, horizontal=1e-6, vertical=1e-6, lever_arm=setups.ARM, averaged=0.25)
    of = nj.Scenario(REFERENCE, (sensor,), every=5)
    experiment = nj.filter.prepare(of, rate=RATE)
    quiet = nj.ImuErrors("WN(sigma2=1e-20)", "WN(sigma2=1e-20)", RATE)
    inputs = nj.filter.draw_inputs(experiment, quiet, nj.filter.run_keys(jax.random.key(0), 0, 1))
    out = nj.filter.run_filter(experiment, quiet, inputs)
    valid = np.asarray(experiment.timeline.valid[:, 0]) > 0
    innovation = np.asarray(out.innovation)[valid, :, 0]
    later = np.asarray(inputs.z - experiment.timeline.truth.v)[valid, :, 0]
    assert np.abs(innovation).max() < 1e-3
    assert np.abs(later).max() > 0.1


VIBRATION = 3.0
"""m/s^2, at 30 Hz."""


def shaken(t):
    """To and fro along the north, 2 m/s^2 at the most, on an engine."""
    slow, fast = 0.8, 2 * jnp.pi * 30.0
    north = -2.0 / slow**2 * jnp.cos(slow * t) - VIBRATION / fast**2 * jnp.cos(fast * t)
    return jnp.stack([north, 0.0 * t, 0.0 * t])


@pytest.mark.parametrize(("calm", "low", "high"), [(0.2, 0.9, 1.1), (1 / 200.0, 0.0, 0.6)])
def test_vibration_does_not_hide_a_time_offset(calm, low, high, monkeypatch):
    """Estimates of tau over what was drawn, of 64 runs: 1 with means over 0.2 s, much less with one sample."""
    monkeypatch.setattr(gnss_module, "_CALM", calm)
    rate = 200.0
    reference = nj.motions.from_path(shaken, duration=20.0, rate=rate, attitude=(0.0, 0.0, 0.0))
    sensors = (
        nj.GnssPosition(1.0, horizontal=0.05, vertical=0.05),
        nj.GnssVelocity(7.0, horizontal=0.02, vertical=0.02, time_offset_sd=0.05),
    )
    errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate)
    experiment = nj.filter.prepare(nj.Scenario(reference, sensors, START, every=20), rate=rate)
    keys = nj.filter.run_keys(jax.random.key(4), 0, 64)
    inputs = nj.filter.draw_inputs(experiment, errors, keys)
    out = nj.filter.run_filter(experiment, errors, inputs)
    of_states = jax.vmap(lambda k: stream(stream(k, "gnss_velocity"), "states"))(keys)
    truth = np.asarray(experiment.timeline.drawn.draw(1, jnp.ones(1, dtype=int), 1, of_states))[0, 0]
    slope = np.sum(truth * np.asarray(out.state.x)[-1, -1]) / np.sum(truth**2)
    assert low < slope < high
