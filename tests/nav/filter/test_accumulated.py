"""Accumulated segments beside a covariance that takes every step, which `test_error_model` has beside textbooks."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nav_jax as nj
from gmwm_jax import RW
from nav_jax.filter.accumulated import accumulates
from nav_jax.filter.between import Between
from nav_jax.filter.error_model import Covariance, Motion, blocks, full
from nav_jax.filter.joint_covariance import _joint, noise_of
from nav_jax.imu.bank import alone, step_noises
from nav_jax.imu.channels import NO_CHANNEL
from nav_jax.kinematics.earth import EarthInLoops

WHITE = "WN(sigma2=1e-4)"
TWO = WHITE + " + RW(gamma2=1e-6) + GM(beta=0.05, variance=1e-3)"
BANKS = {
    "nothing": nj.ImuErrors(WHITE, WHITE, 50.0),
    "two processes": nj.ImuErrors(TWO, TWO, 50.0),
    "another number on every axis": nj.ImuErrors([TWO, WHITE, TWO], [WHITE, WHITE + " + RW(gamma2=1e-6)", TWO], 50.0),
    "multiples of readings": nj.ImuErrors(
        TWO, TWO, 50.0, deterministic=[nj.imu.ScaleFactor(0.1, 0.1), nj.imu.GSensitivity([0.01, 0.01, 0.01])]
    ),
    "gravity that fades": nj.ImuErrors(
        TWO, WHITE, 50.0, gravity=nj.imu.GravityDisturbance(deflection=1e-3, anomaly=1e-2, distance=[20.0, 30.0, 40.0])
    ),
}
RUNS, STEPS = 3, 12
EARTH = EarthInLoops(nj.FlatEarth())


def motions(draw, depends, fades, num):
    """Any motion, one step after the other."""
    for k in range(STEPS):
        C = np.moveaxis(Rotation.random(num, random_state=k).as_matrix(), 0, -1)
        force = draw.normal(size=(3, num)) * 3
        reading = jnp.asarray(draw.normal(size=(6, num))) if depends else None
        distance = jnp.asarray(draw.uniform(0.0, 3.0, num)) if fades else None
        yield Motion(jnp.asarray(C), jnp.asarray(0.1 * force), jnp.asarray(0.004 * force), reading, distance=distance)


def both(bank, dt, num_motions=RUNS, banks=None):
    """Covariance and transition after some steps, accumulated and step by step."""
    banks = alone(bank) if banks is None else banks
    # steps of two kinds, the second of which ends before its last sample does
    kinds = step_noises(banks, jnp.asarray([dt, dt[::-1]]), jnp.ones((2, len(dt))).at[1, -1].set(0.0))
    draw, n, lanes = np.random.default_rng(1), 9 + len(bank.states), max(num_motions, len(banks.white))
    L = draw.normal(size=(n, n, lanes))
    P, one = jnp.asarray(np.einsum("ikr,jkr->ijr", L, L)), jnp.broadcast_to(jnp.eye(n)[:, :, None], (n, n, lanes))
    ways = [Between(bank, kinds, EARTH, at_every_step=every) for every in (False, True)]
    assert [w.accumulating for w in ways] == [True, False]
    found = []
    for way in ways:
        at = way.begin(blocks(P), one)
        step = eqx.filter_jit(way.step)
        given = motions(np.random.default_rng(2), bank.depends, bank.travel is not None, num_motions)
        for kind, motion in zip(itertools.cycle([0, 0, 1]), given):
            at = step(at, motion, jnp.asarray(kind))
        found.append(way.end(at))
    return found


@pytest.mark.parametrize("dt", [[0.02], [0.02, 0.013, 0.02]])
@pytest.mark.parametrize("name", BANKS)
def test_it_is_a_covariance_that_takes_every_step(name, dt):
    (P, Phi), (expected, transition) = both(BANKS[name].bank(), dt)
    P, expected = np.asarray(full(P)), np.asarray(full(expected))
    sd = np.sqrt(np.einsum("iir->ir", expected))
    np.testing.assert_allclose(P / (sd[:, None] * sd[None]), expected / (sd[:, None] * sd[None]), rtol=0, atol=1e-12)
    np.testing.assert_allclose(Phi, transition, rtol=1e-11, atol=1e-13)


def test_states_that_do_not_act_and_states_in_any_order():
    """As covariances of errors have them: the filter's, the true ones, and those of an aiding sensor."""
    scenario = nj.Scenario(
        nj.motions.lemniscate(4.0, 50.0), [nj.Barometer(1.0, height=WHITE + " + GM(beta=0.1, variance=1.0)")]
    )
    experiment = nj.filter.prepare(scenario, rate=50.0)
    bank = _joint(BANKS["two processes"].bank(), noise_of(experiment, BANKS["another number on every axis"]))
    assert bank.states[-1].channel == NO_CHANNEL
    (P, _), (expected, _) = both(bank, [0.02], num_motions=1)
    np.testing.assert_allclose(full(P), full(expected), rtol=1e-11, atol=1e-12)


def test_many_banks_along_one_motion():
    believed = jax.vmap(lambda q: nj.ImuErrors(WHITE, RW(q), 50.0).bank())(jnp.asarray([1e-6, 1e-4]))
    one = jax.tree.map(lambda a: a[1], believed)
    (P, _), (expected, _) = both(one, [0.02], num_motions=1, banks=believed)
    np.testing.assert_allclose(full(P), full(expected), rtol=1e-11, atol=1e-12)
    (alone_, _), _ = both(one, [0.02], num_motions=1)
    assert full(P).shape[2] == 2
    assert full(alone_).shape[2] == 1


def test_when_it_cannot_be():
    coupled = nj.ImuErrors(WHITE + " + MAT32(beta=0.1, variance=1e-3)", WHITE, 50.0).bank()
    assert not accumulates(coupled, EARTH)
    free = BANKS["two processes"].bank()
    assert accumulates(free, EARTH)
    assert accumulates(free, EarthInLoops(nj.Wgs84([0.8, 0.1, 300.0])))


def test_nothing_has_happened_yet():
    bank = BANKS["gravity that fades"].bank()
    way = Between(bank, step_noises(alone(bank), jnp.full((1, 1), 0.02), jnp.ones((1, 1))), EARTH)
    n = 9 + len(bank.states)
    P = blocks(jnp.asarray(np.random.default_rng(1).normal(size=(n, n, 2))))
    P = Covariance(P.navigation + jnp.swapaxes(P.navigation, 0, 1), P.mixed, P.sensors)
    found, Phi = way.end(way.begin(P))
    assert Phi is None
    np.testing.assert_array_equal(full(found)[:9], full(P)[:9])
    np.testing.assert_array_equal(found.sensors, P.sensors)
