"""Rotations against SciPy's, at the identity, near 180 deg and at the singular pitch."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nav_jax.kinematics import rotation

RNG = np.random.default_rng(7)
AXES = RNG.normal(size=(3, 60))
AXES /= np.linalg.norm(AXES, axis=0)
ANGLES = np.concatenate([10.0 ** RNG.uniform(-12, 0, 30), RNG.uniform(0, np.pi, 28), [0.0, np.pi - 1e-9]])
ROTVECS = AXES * ANGLES


def scipy_quat(q):
    return Rotation.from_quat(np.array(q).T, scalar_first=True)


def test_exponential_and_logarithm():
    q = rotation.quat_from_rotvec(jnp.asarray(ROTVECS))
    expected = Rotation.from_rotvec(ROTVECS.T).as_quat(scalar_first=True).T
    np.testing.assert_allclose(q, expected, rtol=0, atol=5e-15)
    np.testing.assert_allclose(rotation.quat_to_rotvec(q), ROTVECS, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(rotation.quat_to_rotvec(-q), ROTVECS, rtol=1e-13, atol=1e-14)


def test_the_exponential_is_accurate_for_rotations_of_any_size():
    big = AXES * np.linspace(3.0, 50.0, 60)
    np.testing.assert_allclose(
        rotation.dcm_from_quat(rotation.quat_from_rotvec(jnp.asarray(big))),
        Rotation.from_rotvec(big.T).as_matrix().transpose(1, 2, 0),
        atol=2e-13,
    )


def test_the_series_is_the_exponential_up_to_its_limit():
    steps = jnp.asarray(AXES * np.linspace(0, rotation.SMALL_ROTATION, 60))
    np.testing.assert_allclose(
        rotation.quat_from_small_rotvec(steps), rotation.quat_from_rotvec(steps), rtol=0, atol=5e-15
    )


def test_logarithm_is_the_shortest_rotation():
    rotvec = rotation.quat_to_rotvec(rotation.quat_from_rotvec(jnp.asarray(AXES * 4.0)))
    np.testing.assert_allclose(rotvec, AXES * (4.0 - 2 * np.pi), atol=1e-13)


@pytest.mark.parametrize("transform", [jax.jacfwd, jax.jacrev])
def test_derivatives_at_the_identity(transform):
    def jacobian(function):
        return jax.jit(transform(function))

    half = np.vstack([np.zeros(3), 0.5 * np.eye(3)])
    np.testing.assert_array_equal(jacobian(rotation.quat_from_rotvec)(jnp.zeros(3)), half)
    np.testing.assert_array_equal(jacobian(rotation.quat_from_small_rotvec)(jnp.zeros(3)), half)
    one = jnp.asarray([1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(jacobian(rotation.quat_to_rotvec)(one), 4 * half.T)


@pytest.mark.parametrize("size", [1e-8, 0.06, 0.0632, 0.0633, 0.1, 3.0])
def test_exponential_and_logarithm_are_inverse_in_their_derivatives(size):
    """Across the change from series to function, at a squared angle of 0.004."""
    rotvec = jnp.asarray(AXES[:, 0] * size)
    there = jax.jit(jax.jacfwd(rotation.quat_from_rotvec))(rotvec)
    back = jax.jit(jax.jacrev(rotation.quat_to_rotvec))(rotation.quat_from_rotvec(rotvec))
    np.testing.assert_allclose(back @ there, np.eye(3), atol=1e-12)


def test_products_matrices_and_vectors():
    a, b = jnp.asarray(ROTVECS[:, :30]), jnp.asarray(ROTVECS[:, 30:])
    qa, qb = rotation.quat_from_rotvec(a), rotation.quat_from_rotvec(b)
    sa, sb = scipy_quat(qa), scipy_quat(qb)
    v = RNG.normal(size=(3, 30))
    np.testing.assert_allclose(
        rotation.dcm_from_quat(rotation.quat_multiply(qa, qb)), (sa * sb).as_matrix().transpose(1, 2, 0), atol=2e-14
    )
    np.testing.assert_allclose(rotation.rotate(qa, jnp.asarray(v)), sa.apply(v.T).T, atol=2e-14)
    np.testing.assert_allclose(rotation.rotate_back(qa, rotation.rotate(qa, jnp.asarray(v))), v, atol=4e-14)
    np.testing.assert_allclose(
        rotation.rotate(rotation.quat_conjugate(qa), jnp.asarray(v)), sa.inv().apply(v.T).T, atol=2e-14
    )
    np.testing.assert_allclose(rotation.cross(a, jnp.asarray(v)), np.cross(np.asarray(a).T, v.T).T, atol=1e-14)


def test_quaternion_of_a_matrix_for_every_largest_element():
    q = np.concatenate([np.eye(4), RNG.normal(size=(50, 4))]).T
    q = rotation.quat_normalize(jnp.asarray(q))
    found = rotation.quat_from_dcm(rotation.dcm_from_quat(q))
    np.testing.assert_allclose(np.abs(np.sum(np.asarray(found * q), axis=0)), 1.0, atol=3e-15)
    assert np.all(np.asarray(found[0]) >= 0)


def test_euler_angles():
    euler = np.stack([RNG.uniform(-3, 3, 50), RNG.uniform(-1.5, 1.5, 50), RNG.uniform(-3, 3, 50)])
    q = rotation.quat_from_euler(jnp.asarray(euler))
    expected = Rotation.from_euler("ZYX", euler[::-1].T).as_matrix().transpose(1, 2, 0)
    np.testing.assert_allclose(rotation.dcm_from_quat(q), expected, atol=2e-14)
    np.testing.assert_allclose(rotation.euler_from_quat(q), euler, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 2.0])
def test_euler_angles_are_the_rotation_at_the_singular_pitch(pitch):
    q = rotation.quat_from_euler(jnp.asarray([0.3, pitch, -1.1]))
    again = rotation.quat_from_euler(rotation.euler_from_quat(q))
    np.testing.assert_allclose(np.abs(np.dot(q, again)), 1.0, atol=1e-14)


def test_trailing_axes():
    """The same numbers for one, for many, and for a table of rotations."""
    table = jnp.asarray(ROTVECS.reshape(3, 12, 5))
    for function in (rotation.quat_from_rotvec, rotation.quat_from_small_rotvec, rotation.quat_from_euler):
        whole = function(table)
        np.testing.assert_allclose(whole[:, 3, 2], function(table[:, 3, 2]), atol=1e-14)
    q = rotation.quat_from_rotvec(table)
    for function in (rotation.quat_to_rotvec, rotation.dcm_from_quat, rotation.euler_from_quat):
        np.testing.assert_allclose(function(q)[..., 3, 2], function(q[:, 3, 2]), atol=1e-14)
    assert rotation.quat_from_dcm(rotation.dcm_from_quat(q)).shape == (4, 12, 5)
