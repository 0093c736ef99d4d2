"""Small matrices against LAPACK; singular ones have finite derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nav_jax.kinematics import linalg
from nav_jax.kinematics.linalg import matmul3, root, symmetrise, transpose

# written out pivot by pivot: hundreds of operations one by one, or one program
factor, whiten, log_det_and_trace = map(jax.jit, (linalg.factor, linalg.whiten, linalg.log_det_and_trace))

RNG = np.random.default_rng(1)


def covariance(n, rank=None):
    A = RNG.normal(size=(n, n if rank is None else rank))
    return A @ A.T


def test_products():
    C, X = RNG.normal(size=(3, 3, 5)), RNG.normal(size=(3, 4, 5))
    np.testing.assert_allclose(matmul3(jnp.asarray(C), jnp.asarray(X)), np.einsum("ijr,jkr->ikr", C, X), atol=1e-13)
    one = matmul3(jnp.asarray(C), jnp.asarray(X[..., :1]))
    np.testing.assert_allclose(one, np.einsum("ijr,jk->ikr", C, X[..., 0]), atol=1e-13)
    np.testing.assert_array_equal(transpose(jnp.asarray(X)), X.swapaxes(0, 1))
    P = RNG.normal(size=(4, 4, 5))
    np.testing.assert_allclose(symmetrise(jnp.asarray(P)), (P + P.swapaxes(0, 1)) / 2, atol=1e-14)


@pytest.mark.parametrize("shared", [False, True])
def test_whitening_holds_the_forms_of_all_leading_blocks(shared):
    R = 4
    P = [covariance(9) for _ in range(1 if shared else R)]
    e = RNG.normal(size=(9, R))
    y = np.asarray(jax.jit(whiten)(jnp.asarray(np.stack(P, -1)), jnp.asarray(e)))
    for r in range(R):
        for k in range(1, 10):
            block, part = P[0 if shared else r][:k, :k], e[:k, r]
            np.testing.assert_allclose(np.sum(y[:k, r] ** 2), part @ np.linalg.solve(block, part), rtol=1e-9)


def test_whitening_ends_where_the_matrix_is_singular():
    P = np.diag([1.0, 4.0, 0.0, 1.0])[:, :, None]
    y = np.asarray(whiten(jnp.asarray(P), jnp.asarray([[1.0], [4.0], [0.0], [2.0]])))[:, 0]
    np.testing.assert_allclose(y[:2], [1.0, 2.0])
    assert np.isnan(y[2])


@pytest.mark.parametrize("rank", [6, 3, 0])
def test_a_factor_of_any_covariance(rank):
    P = covariance(6, rank)
    if rank < 6:
        # known exactly, and two that are one
        P[1], P[:, 1] = 0.0, 0.0
    L = np.asarray(factor(jnp.asarray(P)))
    np.testing.assert_allclose(L @ L.T, P, rtol=0, atol=1e-7 * max(1.0, np.abs(P).max()))
    np.testing.assert_array_equal(np.triu(L, 1), 0.0)
    if rank == 6:
        np.testing.assert_allclose(L, np.linalg.cholesky(P), rtol=1e-10)


def test_the_factor_of_a_singular_matrix_has_finite_derivatives():
    def of(x):
        P = jnp.array([[1.0, 0.5, 0.0], [0.5, 2.0, 0.0], [0.0, 0.0, 0.0]]) * x
        return jnp.sum(factor(P)), factor(P)

    (_, L), slope = jax.value_and_grad(of, has_aux=True)(2.0)
    # the factor goes with the square root
    np.testing.assert_allclose(slope, np.sum(L) / 4, rtol=1e-11)
    assert factor(jnp.zeros((0, 0))).shape == (0, 0)


def test_a_root_is_flat_where_nothing_is():
    x = jnp.array([4.0, 0.0, -1.0])
    np.testing.assert_array_equal(root(x), [2.0, 0.0, 0.0])
    np.testing.assert_array_equal(jax.vmap(jax.grad(root))(x), [0.25, 0.0, 0.0])


def test_log_determinant_and_trace():
    """Against a library, for matrices of very different scales; NaN where P is not positive definite."""
    rng = np.random.default_rng(3)
    A, B = rng.standard_normal((2, 5, 5, 7))
    scale = 10.0 ** rng.uniform(-4, 4, (5, 1, 7))
    P, S = (np.einsum("ikr,jkr->ijr", scale * X, scale * X) for X in (A, B))
    log_det, trace = log_det_and_trace(jnp.asarray(P), jnp.asarray(S))
    for r in range(7):
        assert log_det[r] == pytest.approx(np.linalg.slogdet(P[..., r])[1], rel=1e-9)
        assert trace[r] == pytest.approx(np.trace(np.linalg.solve(P[..., r], S[..., r])), rel=1e-6)
    assert np.isnan(log_det_and_trace(-jnp.asarray(P), jnp.asarray(S))[0]).all()
