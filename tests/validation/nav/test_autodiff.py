"""Derivatives of runs and of covariances by all parameters of truth and filter, both ways, against differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


START = jnp.array([np.log(6e-5), np.log(2.0), np.log(1e-8), np.log(1.5e-6), np.log(0.3), np.log(0.05), np.log(2e-3)])
"""Logarithms: variance of white noise, beta (1/s) and drive of an AR1, gyro's white noise, sd of fix, start, bias."""


SIZE = len(START)


def quick(function):
    """Compiled in a third of the time, for one call."""
    options = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
    return jax.jit(function, compiler_options=options)


def model(x):
    """Sensor errors of the parameters."""
    accel = gj.WN(jnp.exp(x[0])) + gj.AR1(jnp.exp(-jnp.exp(x[1]) / setups.RATE), jnp.exp(x[2]))
    return nj.ImuErrors(accel, gj.WN(jnp.exp(x[3])), setups.RATE, accel_bias_sd=jnp.exp(x[6]))


def sensors(x):
    sd = jnp.exp(x[4])
    return (nj.GnssPosition(1.0, horizontal=sd, vertical=2 * sd), nj.Barometer(1.5, height=0.5))


def start(x):
    return nj.InitialUncertainty(0.1, jnp.exp(x[5]), 0.005)


@pytest.mark.parametrize("gains", ["estimate", "reference"])
def test_derivatives_are_those_of_differences(gains):
    """Final mean-square position error of 4 runs, by the 7 parameters of the truth and the same 7 of the filter.

    Backward and forward agree to 1e-8; central differences of fourth order to 1e-5, and 1e-6 of the largest.
    """
    scenario = nj.Scenario(nj.motions.lemniscate(4.0, setups.RATE), sensors(START), start(START))
    e = nj.filter.prepare(scenario, rate=setups.RATE)
    keys = nj.filter.run_keys(jax.random.key(3), 0, 4)

    def parts(e):
        return e.sensors, e.initial

    def cost(x):
        true, believed = x[:SIZE], x[SIZE:]
        inputs = nj.filter.draw_inputs(eqx.tree_at(parts, e, (sensors(true), start(true))), model(true), keys)
        ours = eqx.tree_at(parts, e, (sensors(believed), start(believed)))
        shared = nj.filter.gains_of(ours, model(believed)) if gains == "reference" else None
        error = nj.filter.run_filter(ours, model(believed), inputs, shared).judgement.error[-1, :3]
        return jnp.mean(jnp.sum(error**2, axis=0))

    x, h = jnp.concatenate([START, START]), 1e-3
    value, forward = quick(cost), quick(jax.jacfwd(cost))(x)
    steps = h * np.eye(2 * SIZE)
    differences = np.array(
        [(8 * (value(x + d) - value(x - d)) - (value(x + 2 * d) - value(x - 2 * d))) / (12 * h) for d in steps]
    )
    if gains == "estimate":  # the larger program of the two, and slow to compile
        backward = quick(jax.grad(cost))(x)
        np.testing.assert_allclose(backward, forward, rtol=1e-8, atol=1e-10 * np.abs(differences).max())
    for part in (slice(0, SIZE), slice(SIZE, None)):
        largest = np.abs(differences[part]).max()
        # each of them matters
        assert np.abs(differences[part]).min() > 1e-5 * largest
        np.testing.assert_allclose(forward[part], differences[part], rtol=1e-5, atol=1e-6 * largest)


def test_derivatives_of_covariances_by_everything():
    """Reverse, forward and central differences of fourth order: 1e-5 of each, 1e-8 between the first two.

    Reverse through several filters at once is that through each alone.
    """
    experiment = setups.experiment()
    start = jnp.log(jnp.array([6e-5, 2e-3, 2e-5, 1.5e-6, 1e-4, 9e-5, 5e-3, 1e-5, 2e-6, 0.025, 0.05, 0.02]))
    believed_part = slice(5, 9)

    def built(v, **options):
        return nj.ImuErrors(gj.WN(v[0]) + gj.GM(v[1], v[2]), gj.WN(v[3]), setups.RATE, **options)

    def size(found):
        return sum(
            jnp.log(jnp.trace(c.navigation[..., -1, :, :], axis1=-2, axis2=-1)) for c in (found.true, found.claimed)
        )

    def scene(v):
        aiding = (
            nj.GnssPosition(1.0, horizontal=v[9], vertical=0.05, outages=(setups.OUTAGE,)),
            *experiment.sensors[1:],
        )
        initial = nj.InitialUncertainty(v[10], 0.02, v[11])
        return eqx.tree_at(lambda e: (e.sensors, e.initial), experiment, (aiding, initial))

    def cost(x, believed=None):
        v = jnp.exp(x)
        believed = built(v[believed_part]) if believed is None else jax.vmap(lambda x: built(jnp.exp(x)))(believed)
        truth = built(v[:4], gyro_bias_sd=v[4])
        return size(nj.lincov.linear_covariance(scene(v), truth, believed, motion=motion))

    motion = setups.motion()
    value, forward, gradient = jax.jit(cost), jax.jit(jax.jacfwd(cost))(start), jax.jit(jax.grad(cost))
    backward = gradient(start)
    h = 2e-3
    steps = h * np.eye(len(start))
    differences = np.array(
        [
            (8 * (value(start + d) - value(start - d)) - value(start + 2 * d) + value(start - 2 * d)) / (12 * h)
            for d in steps
        ]
    )
    assert np.abs(differences).min() > 1e-6
    np.testing.assert_allclose(backward, forward, rtol=1e-7, atol=1e-11)
    np.testing.assert_allclose(forward, differences, rtol=1e-5, atol=1e-8)
    several = np.asarray(start[believed_part]) + np.array([[0.0], [0.5], [-1.0]])
    together = jax.jit(jax.grad(lambda x: jnp.sum(cost(start, x))))(several)
    for found, x in zip(together, several, strict=True):
        alone = gradient(start.at[believed_part].set(x))[believed_part]
        np.testing.assert_allclose(found, alone, rtol=1e-8)
