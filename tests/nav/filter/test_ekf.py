"""Updates against the textbook's joint ones in NumPy; the covariance stays one for ever."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nav_jax.filter.ekf import correction, inject, update
from nav_jax.kinematics.state import NavState

RNG = np.random.default_rng
JIT = jax.jit(update)


def covariance(rng, n, spread=3.0):
    """A covariance with strong correlations, whose standard deviations differ by orders of magnitude."""
    A = rng.normal(size=(n, n)) + 2 * rng.normal(size=(n, 1))
    D = 10.0 ** rng.uniform(-spread, 0, n)
    return (A @ A.T / n) * np.outer(D, D)


def measurements(rng, K):
    """Rows of H on the nine states of navigation, variances, residuals."""
    return rng.normal(size=(K, 9)) * (rng.random((K, 9)) < 0.4), rng.uniform(0.01, 1.0, K), rng.normal(size=K)


def joint(P, H, r, z):
    """Gain, covariance and NIS as a textbook has them."""
    H = np.hstack([H, np.zeros((len(H), len(P) - 9))])
    S = H @ P @ H.T + np.diag(r)
    K = np.linalg.solve(S, H @ P).T
    left = np.eye(len(P)) - K @ H
    return K @ z, left @ P @ left.T + K @ np.diag(r) @ K.T, z @ np.linalg.solve(S, z)


def sequential(P, H, r, z, valid):
    P_after, done = JIT(jnp.asarray(P)[:, :, None], jnp.asarray(H)[:, :, None], jnp.asarray(r), jnp.asarray(valid))
    c, innovation = correction(done.gain, jnp.asarray(z)[:, None], jnp.asarray(H)[:, :, None])
    return np.asarray(c)[:, 0], np.asarray(P_after)[:, :, 0], np.asarray(innovation)[:, 0], done


@pytest.mark.parametrize("seed", range(5))
def test_scalar_after_scalar_is_the_joint_update(seed):
    """Correction and covariance to 1e-11 of standard deviations; squared innovations sum to the joint NIS."""
    rng = RNG(seed)
    P = covariance(rng, 15)
    H, r, z = measurements(rng, 7)
    c, P_after, innovation, done = sequential(P, H, r, z, np.ones(7))
    c_joint, P_joint, nis = joint(P, H, r, z)
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(c / sd, c_joint / sd, rtol=0, atol=1e-11)
    np.testing.assert_allclose(P_after / np.outer(sd, sd), P_joint / np.outer(sd, sd), rtol=0, atol=1e-11)
    np.testing.assert_allclose(np.sum(innovation**2 / np.asarray(done.variance)[:, 0]), nis, rtol=1e-10)


def test_the_order_of_the_sensors_does_not_matter():
    rng = RNG(10)
    P = covariance(rng, 12)
    H, r, z = measurements(rng, 3)
    seen = [sequential(P, H[o], r[o], z[o], np.ones(3))[:2] for o in map(list, itertools.permutations(range(3)))]
    sd = np.sqrt(np.diag(P))
    for c, P_after in seen[1:]:
        np.testing.assert_allclose(c / sd, seen[0][0] / sd, rtol=0, atol=1e-11)
        np.testing.assert_allclose(P_after / np.outer(sd, sd), seen[0][1] / np.outer(sd, sd), rtol=0, atol=1e-11)


def test_what_is_not_measured_changes_nothing():
    rng = RNG(11)
    P = covariance(rng, 12)
    H, r, z = measurements(rng, 4)
    c, P_after, _, done = sequential(P, H, r, z, np.zeros(4))
    np.testing.assert_array_equal(c, 0)
    np.testing.assert_array_equal(P_after, (P + P.T) / 2)
    np.testing.assert_array_equal(done.gain, 0)
    valid = np.array([1.0, 0, 1, 0])
    some = sequential(P, H, r, z, valid)
    only = sequential(P, H[::2], r[::2], z[::2], np.ones(2))
    sd = np.sqrt(np.diag(P))
    np.testing.assert_allclose(some[0] / sd, only[0] / sd, rtol=0, atol=1e-12)
    np.testing.assert_allclose(some[1], only[1], rtol=0, atol=1e-12 * sd.max() ** 2)


def test_each_run_has_its_own():
    rng = RNG(12)
    Ps = [covariance(rng, 10) for _ in range(3)]
    H, r, z = measurements(rng, 3)
    together, _ = JIT(
        jnp.stack([jnp.asarray(P) for P in Ps], axis=-1), jnp.asarray(H)[:, :, None], jnp.asarray(r), jnp.ones(3)
    )
    for i, P in enumerate(Ps):
        np.testing.assert_allclose(together[..., i], sequential(P, H, r, z, np.ones(3))[1], rtol=0, atol=1e-12)


def test_a_covariance_stays_symmetric_and_positive():
    """1000 updates with measurements a million times better than what was known (variance 1e12)."""
    rng = RNG(13)
    P = jnp.asarray(covariance(rng, 24, spread=1.0) * 1e6)[:, :, None]
    r = float(np.asarray(P).trace()[0] / 24 * 1e-12)
    H = jnp.asarray(rng.normal(size=(1000, 1, 9, 1)))

    @jax.jit
    def many(P):
        one = jnp.ones(1)

        def body(P, h):
            P = update(P, h, r * one, one)[0]
            return P, jnp.linalg.eigvalsh(P[:, :, 0] / jnp.sqrt(jnp.outer(jnp.diag(P[..., 0]), jnp.diag(P[..., 0]))))[0]

        return jax.lax.scan(body, P, H)

    P, lowest = many(P)
    P = np.asarray(P)[:, :, 0]
    np.testing.assert_array_equal(P, P.T)
    assert np.diag(P).min() > 0
    # of correlations: rounding leaves 1e-16 a state
    assert np.asarray(lowest).min() > -1e-14
    # 1000 measurements of nine states: the variances are those of an average
    assert np.diag(P)[:9].max() < 1e3 * r


def test_inject_turns_in_the_frame_of_navigation():
    rng = RNG(14)
    q = Rotation.random(4, random_state=5)
    state = NavState(
        jnp.asarray(rng.normal(size=(3, 4))),
        jnp.asarray(rng.normal(size=(3, 4))),
        jnp.asarray(q.as_quat(scalar_first=True).T),
        jnp.asarray(rng.normal(size=(2, 4))),
    )
    c = rng.normal(size=(11, 4))
    after = inject(state, jnp.asarray(c))
    np.testing.assert_allclose(after.p, state.p + c[:3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(after.v, state.v + c[3:6], rtol=0, atol=1e-14)
    np.testing.assert_allclose(after.x, state.x + c[9:], rtol=0, atol=1e-14)
    turned = Rotation.from_quat(np.asarray(after.q).T, scalar_first=True)
    expected = Rotation.from_rotvec(c[6:9].T) * q
    assert (turned * expected.inv()).magnitude().max() < 1e-14 * 10
