"""The table of pure functions, row by row, along four seconds."""

from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pure import assert_pure, documented, found

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.recorded.likelihood import Record
from nav_jax.recorded.navigation import prepare_navigation

pytestmark = pytest.mark.usefixtures("quick_compilation")

RATE = 20.0
NOISE = (1e-3, 1e-5, 0.05, 1e-6)
START = {"position_sd": 0.1, "velocity_sd": 0.1, "attitude_sd": 0.01}
KEYS = nj.filter.run_keys(jax.random.key(0), 0, 2)


@cache
def experiment():
    gnss = nj.GnssPosition(1.0, horizontal=0.02, vertical=0.04)
    scenario = nj.Scenario(nj.motions.lemniscate(4.0, RATE), [gnss], nj.InitialUncertainty(**START), every=4)
    return nj.filter.prepare(scenario, rate=RATE)


def errors(x):
    return nj.ImuErrors(gj.WN(x[0]), gj.WN(x[1]) + gj.GM(x[2], x[3]), RATE)


TRUTH = errors(NOISE)


def drawn(x):
    """By the uncertainty of the start, which is all that is drawn before a filter asks for more."""
    at = eqx.tree_at(lambda e: e.initial, experiment(), nj.InitialUncertainty(x[0], x[1], x[2]))
    start = nj.filter.draw_inputs(at, TRUTH, KEYS).start
    return jnp.concatenate([start.p, start.v, start.q])


def gains(x):
    """A bias whose standard deviation is traced has a state, be it zero or not: here the rows of the others."""
    found = nj.filter.gains_of(experiment(), errors(x))
    return jnp.concatenate([jnp.ravel(a) for a in (found.update.gain[:, :, :9], *found.claim)])


def filtered(x):
    """By what is believed, and by the truth that draws the inputs."""
    inputs = nj.filter.draw_inputs(experiment(), errors(x[4:]), KEYS)
    return nj.filter.run_filter(experiment(), errors(x[:4]), inputs).judgement.error


def covariance(x):
    found = nj.lincov.linear_covariance(experiment(), errors(x[4:]), errors(x[:4]))
    return jnp.stack([jnp.diagonal(c.navigation[-1]) for c in (found.true, found.claimed)]) / jnp.array(
        [[1.0] * 3 + [1.0] * 3 + [1e-3] * 3]
    )


@cache
def drive():
    samples, exact = nj.perfect_imu(nj.motions.lemniscate(4.0, RATE), RATE)
    rng = np.random.default_rng(0)
    imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.03, samples.accel.shape), RATE)
    gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (4, 3)))
    start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    done = prepare_navigation(imu, [fixes], TRUTH, every=1, output_interval=1.0, earth=nj.FlatEarth(), **start)
    return Record(done.timeline, done.inputs, nj.InitialUncertainty(**START)), done.sensors


def loss(x):
    record, sensors = drive()
    return nj.recorded.innovation_loss(record, errors(x), sensors)


CASES = {
    "filter.draw_inputs": (drawn, tuple(START.values())),
    "filter.gains_of": (gains, NOISE),
    "filter.run_filter": (filtered, (*NOISE, *NOISE)),
    "lincov.linear_covariance": (covariance, (*NOISE, *NOISE)),
    "recorded.innovation_loss": (loss, NOISE),
}


@pytest.fixture(scope="module", autouse=True)
def _prepared():
    """Not while something is traced."""
    experiment()
    drive()


def test_every_row_has_a_case():
    assert documented(nj) == list(CASES)


@pytest.mark.parametrize("name", CASES)
def test_what_is_documented_as_pure_is(name):
    function, x = CASES[name]
    assert callable(found(nj, name))
    assert_pure(function, x)
