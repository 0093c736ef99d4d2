"""The mechanisation against 40 digits, against an ODE solver, and against itself in two steps."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nav_jax.kinematics import rotation, strapdown
from nav_jax.kinematics.earth import FlatEarth

RNG = np.random.default_rng(11)
G_N = jnp.asarray([0.0, 0.0, 9.80665])
SIZES = [0.0, 1e-9, 1e-3, 0.1, 0.7, 1.5]


def exact_gammas(theta):
    """Gamma1 and Gamma2 as power series of the matrix [theta x], with 40 digits."""
    with mpmath.workdps(40):
        x, y, z = map(mpmath.mpf, map(float, theta))
        k = mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        power, one, two = mpmath.eye(3), mpmath.zeros(3), mpmath.zeros(3)
        for n in range(40):
            one += power / mpmath.factorial(n + 1)
            two += power / mpmath.factorial(n + 2)
            power = power * k
        return (np.array(m.tolist(), dtype=float) for m in (one, two))


@pytest.mark.parametrize("size", SIZES)
def test_gammas(size):
    theta = RNG.normal(size=3)
    theta *= size / np.linalg.norm(theta)
    x = RNG.normal(size=3)
    one, two = exact_gammas(theta)
    t, v = jnp.asarray(theta), jnp.asarray(x)
    np.testing.assert_allclose(strapdown.gamma1(t, v), one @ x, atol=2e-14)
    np.testing.assert_allclose(strapdown.gamma2(t, v), two @ x, atol=1e-14)
    np.testing.assert_allclose(strapdown.gamma1_inverse(t, v), np.linalg.solve(one, x), atol=2e-14)


def random_state(runs):
    p, v, omega, f = (jnp.asarray(s * RNG.normal(size=(3, runs))) for s in (100.0, 20.0, 0.5, 10.0))
    q = rotation.quat_normalize(jnp.asarray(RNG.normal(size=(4, runs))))
    return p, v, q, omega, f


def test_one_step_is_two_partial_steps():
    p, v, q, omega, f = random_state(20)
    whole = strapdown.step(p, v, q, omega, f, 1.0, G_N)
    part = strapdown.step(p, v, q, omega, f, 0.3, G_N)
    parts = strapdown.step(*part, omega, f, 0.7, G_N)
    for a, b, size in zip(whole, parts, (200.0, 40.0, 1.0), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13 * size)


def test_a_step_solves_the_equations_of_motion():
    p, v, q, omega, f = (x[:, 0] for x in random_state(1))

    def rates(_, state):
        q = state[6:]
        w, x, y, z = q / np.linalg.norm(q)
        dcm = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        a, b, c = omega
        turning = np.array([[0, -a, -b, -c], [a, 0, c, -b], [b, -c, 0, a], [c, b, -a, 0]])
        return np.concatenate([state[3:6], dcm @ np.asarray(f) + np.asarray(G_N), 0.5 * turning @ q])

    start = np.concatenate([p, v, q])
    solved = solve_ivp(rates, (0, 1.2), start, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    found = np.concatenate(strapdown.step(p, v, q, omega, f, 1.2, G_N))
    np.testing.assert_allclose(found, solved, atol=1e-9)


def test_derivatives_at_rest():
    """Forward and reverse derivatives agree and are finite where body rate and specific force are zero."""
    zero, q = jnp.zeros(3), jnp.asarray([1.0, 0.0, 0.0, 0.0])

    def end(omega, f):
        return jnp.concatenate(strapdown.step(zero, zero, q, omega, f, 0.01, G_N))

    forward, reverse = (jax.jit(jac(end, (0, 1)))(zero, zero) for jac in (jax.jacfwd, jax.jacrev))
    for a, b in zip(forward, reverse, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-17)
    np.testing.assert_allclose(forward[0][7:], 0.005 * np.eye(3), atol=1e-16)
    np.testing.assert_allclose(forward[1][3:6], 0.01 * np.eye(3), atol=1e-16)
    np.testing.assert_allclose(forward[1][:3], 0.5e-4 * np.eye(3), atol=1e-18)


def test_there_is_no_branch_and_no_trigonometric_function():
    p, v, q, omega, f = random_state(2)
    program = str(jax.make_jaxpr(lambda *x: strapdown.step(*x, 0.01, G_N))(p, v, q, omega, f))
    assert not any(f" {name}" in program for name in ("cond", "select_n", "sin", "cos", "sqrt", "while", "div"))


def test_integration_keeps_the_unit_length_and_the_free_fall():
    num = 200_000
    earth = FlatEarth()
    omega = jnp.broadcast_to(jnp.asarray([0.3, -0.2, 1.0]), (num, 3))
    q = jnp.asarray([1.0, 0.0, 0.0, 0.0])
    run = strapdown.integrate(jnp.zeros(3), jnp.zeros(3), q, omega, 0.0 * omega, jnp.full(num, 0.01), earth)
    position, velocity, attitude = (np.asarray(x) for x in run)
    assert position.shape == (num + 1, 3)
    np.testing.assert_allclose(np.linalg.norm(attitude, axis=1), 1.0, atol=3e-15)
    np.testing.assert_allclose(velocity[-1], [0, 0, 9.80665 * 2000], rtol=1e-10)
    np.testing.assert_allclose(position[-1], [0, 0, 9.80665 / 2 * 2000**2], rtol=1e-10)
