"""A day at rest on the ellipsoid: ten errors grow as an independent program has it, in the mechanisation and in theory.

The program integrates the equations of the local frame, the vertical held at the truth; see ../shared/reference.
"""

import json
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.error_model import Motion, transition
from nav_jax.imu.bank import alone, step_noise
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.earth import EarthInLoops

DT = 1.0
"""s of a step: of second order in what the Earth turns in it, 7.3e-5 rad."""

DEG_H, MGAL = np.deg2rad(0.01) / 3600, 1e-5


@pytest.fixture(scope="module")
def oracle(shared):
    known = json.loads((shared / "reference" / "error_growth.json").read_text())
    assert list(known["cases"]) == [
        "vN 0.1 m/s", "vE 0.1 m/s", "level error N 0.1 mrad", "level error E 0.1 mrad", "azimuth 1 mrad",
        "gyro N 0.01 deg/h", "gyro E 0.01 deg/h", "gyro D 0.01 deg/h", "accel N 10 mGal", "accel E 10 mGal",
    ]  # fmt: skip
    cases = np.array([case["nonlinear"] for case in known["cases"].values()])
    earth = nj.Wgs84([np.deg2rad(known["meta"]["lat_deg"]), 0.0, known["meta"]["height"]])
    return earth, np.array(known["time_s"]), cases


# each case: velocity, attitude, gyro, accelerometer, in the axes of n
ERRORS = np.zeros((4, 3, 10))
ERRORS[0, 0, 0] = ERRORS[0, 1, 1] = 0.1
ERRORS[1, 0, 2] = ERRORS[1, 1, 3] = 1e-4
ERRORS[1, 2, 4] = 1e-3
ERRORS[2, :, 5:8] = np.eye(3) * DEG_H
ERRORS[3, :2, 8:10] = np.eye(2) * 10 * MGAL


def along_the_surface(earth, p, v, psi):
    """Errors as the program states them, each (..., 3, cases): metres along the surface, and axes at the estimate."""
    flat = np.moveaxis(p, -2, -1).reshape(-1, 3)
    local = earth.local(flat).reshape(*np.moveaxis(p, -2, -1).shape, 3)
    v = np.einsum("...rij,...jr->...ir", local, v)
    turn = Rotation.from_matrix(local.reshape(-1, 3, 3)) * Rotation.from_rotvec(np.moveaxis(psi, -2, -1).reshape(-1, 3))
    psi = np.moveaxis(turn.as_rotvec().reshape(np.moveaxis(psi, -2, -1).shape), -1, -2)
    # north and east of a geodesic's small arc
    return np.concatenate([p[..., :2, :], v[..., :2, :], psi], axis=-2)


def check(found, cases):
    """To 0.5 % of the largest position, velocity or attitude through the day."""
    largest = np.abs(cases).max(axis=1, keepdims=True)
    kinds = np.concatenate([largest[..., a:b].max(axis=-1, keepdims=True).repeat(b - a, -1) for a, b in
                            ((0, 2), (2, 4), (4, 7))], axis=-1)  # fmt: skip
    assert (np.abs(found - cases) / kinds).max() < 5e-3


@jax.jit
def mechanised(earth, w_ie, f, errors, marks):
    """Navigation of all cases with their errors through a day, heights held."""
    v, psi, gyro, accel = errors
    p = jnp.zeros_like(v)
    q = jnp.stack([jnp.sqrt(1 - jnp.sum(psi**2, axis=0) / 4), *(psi / 2)])

    def advance(state, k):
        p, v, q = state
        g = earth.gravity_n(p + DT / 2 * v)
        p, v, q = strapdown.step(p, v, q, w_ie[:, None] + gyro, f[:, None] + accel, DT, g, earth.rate_n(p))
        up = -earth.gravity_n(p)
        up = up / jnp.linalg.norm(up, axis=0)[None]
        return (p - earth.height(p)[None] * up, v - jnp.sum(v * up, axis=0)[None] * up, q), None

    def until(state, num):
        return jax.lax.fori_loop(0, num, lambda k, s: advance(s, k)[0], state)

    states, state = [(p, v, q)], (p, v, q)
    for i in range(len(marks)):
        state = until(state, marks[i])
        states.append(state)
    return [jnp.stack(x) for x in zip(*states, strict=True)]


def test_the_mechanisation_wanders_as_another_one(oracle):
    earth, time, cases = oracle
    marks = np.diff(time) / DT
    assert (marks == np.rint(marks)).all()
    g = np.asarray(earth.gravity_n(jnp.zeros(3)))
    w = np.asarray(earth.rate_n(jnp.zeros(3)))
    p, v, q = (np.asarray(x) for x in mechanised(earth, w, -g, ERRORS, tuple(int(m) for m in marks)))
    psi = np.stack([Rotation.from_quat(x.T, scalar_first=True).as_rotvec().T for x in q])
    check(np.moveaxis(along_the_surface(earth, p, v, psi), -1, 0), cases)


def test_the_error_model_knows_how(oracle):
    """Phi of steps of 6 s, one after the other: what all covariances are made of."""
    earth, time, cases = oracle
    T = 6.0
    looped = EarthInLoops(earth)
    errors = nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), 1 / T, accel_bias_sd=1.0, gyro_bias_sd=1.0)
    noise = step_noise(alone(errors.bank()), jnp.full(1, T), jnp.ones(1))
    zero = jnp.zeros((3, 1))
    f = -earth.gravity_n(zero)
    motion = Motion(jnp.eye(3)[:, :, None], T * f, T**2 / 2 * f, gradient=looped.pull(zero).gradient, rate=looped.rate)
    num = 9 + errors.bank().initial.shape[0]
    Phi = np.asarray(transition(jnp.eye(num)[:, :, None], motion, noise))[:, :, 0]
    held = np.ones(num)
    held[[2, 5]] = 0.0
    Phi = held[:, None] * Phi * held
    X = np.zeros((num, 10))
    X[3:6], X[6:9] = ERRORS[0], ERRORS[1]
    # the error of the estimate of a bias is minus the bias: states are accelerometers first
    X[9:12], X[12:15] = -ERRORS[3], -ERRORS[2]
    powers = np.linalg.matrix_power
    found = [powers(Phi, round(t / T)) @ X for t in time]
    p, v, psi = (np.stack([x[a : a + 3] for x in found]) for a in (0, 3, 6))
    check(np.moveaxis(along_the_surface(earth, p, v, psi), -1, 0), cases)


def test_its_periods_are_those_of_schuler_and_foucault(oracle):
    """88.15 and 80.94 minutes, and the day, in the eigenvalues of the error model."""
    earth, _, _ = oracle
    T, zero = 6.0, jnp.zeros((3, 1))
    looped = EarthInLoops(earth)
    f = -earth.gravity_n(zero)
    motion = Motion(jnp.eye(3)[:, :, None], T * f, T**2 / 2 * f, gradient=looped.pull(zero).gradient, rate=looped.rate)
    noise = step_noise(alone(nj.ImuErrors(gj.WN(0.0), gj.WN(0.0), 1 / T).bank()), jnp.full(1, T), jnp.ones(1))
    Phi = np.asarray(transition(jnp.eye(9)[:, :, None], motion, noise))[:, :, 0]
    kept = [0, 1, 3, 4, 6, 7, 8]
    angle = np.unique(np.round(np.abs(np.angle(np.linalg.eigvals(Phi[np.ix_(kept, kept)]))), 12)) / T
    minutes = np.sort(2 * np.pi / angle[angle > 1e-6] / 60)
    np.testing.assert_allclose(minutes, [80.94, 88.15, 1436.07], rtol=2e-3)


class EveryStep(nj.Wgs84):
    """The same Earth, of which loops ask at every step."""

    is_vast: ClassVar[bool] = False


@pytest.mark.parametrize(("attitude_sd", "off"), [(1e-4, 1e-4), ((1e-4, 1e-4, 0.1), 2e-3)])
def test_covariances_that_feel_the_earth_once_a_segment(attitude_sd, off):
    """Segments of 10 s, the longest, free inertial for 600 s: standard deviations against those of steps of 1 s.

    A heading error h moves a body by g w h T^3/12 more than it should in a segment: most in the first ones.
    """
    found = []
    for earth in (nj.Wgs84, EveryStep):
        scenario = nj.Scenario(
            nj.motions.straight(600.0, 10.0, heading=0.7, speed=100.0),
            initial=nj.InitialUncertainty(10.0, 0.1, attitude_sd),
            earth=earth([0.81, 0.115, 500.0]),
            every=10,
            output_interval=10.0,
        )
        errors = nj.ImuErrors("WN(sigma2=1e-8)", "WN(sigma2=1e-14)", 10.0, accel_bias_sd=1e-4, gyro_bias_sd=1e-7)
        found.append(nj.analyse(scenario, errors)["filter"].sd[:, :9])
    np.testing.assert_allclose(*found, rtol=off)
