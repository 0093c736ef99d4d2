"""The small non-negative least squares against scipy's active set (Lawson & Hanson 1974), problem by problem."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize

from gmwm_jax.fitting._nnls import solve_nonnegative, solve_passive

ROWS, COUNT = 19, 300
"""As many scales as an hour at 100 Hz has, and how many problems of each kind."""
TAU = 2.0 ** np.arange(1, ROWS + 1)


def powers(rng, columns):
    """Wavelet variances of noise processes, weighted as in a fit: slopes from tau^-2 to tau^2, 1e20 apart in size."""
    slopes = rng.choice([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0], size=(COUNT, columns), replace=True)
    slopes = slopes + rng.uniform(0, 0.1, slopes.shape)
    B = TAU[:, None] ** slopes[:, None, :]
    x = np.where(rng.random((COUNT, columns)) < 0.5, 0.0, rng.lognormal(0, 3, (COUNT, columns)))
    y = np.einsum("crp,cp->cr", B, x) * rng.lognormal(0, 0.2, (COUNT, ROWS)) + 1e-3
    return B / y[..., None], np.ones_like(y)


def gaussian(rng, columns):
    return rng.normal(size=(COUNT, ROWS, columns)), rng.normal(size=(COUNT, ROWS))


def positive(rng, columns):
    return rng.random((COUNT, ROWS, columns)), rng.normal(0.5, 1.0, (COUNT, ROWS))


def collinear(distance):
    """The last two columns (of at least two) differ by `distance`, or not at all."""

    def problems(rng, columns):
        B = rng.random((COUNT, ROWS, columns))
        if columns > 1:
            B[..., -1] = B[..., -2] * (1 + distance * rng.normal(size=(COUNT, ROWS)))
        return B, np.einsum("crp->cr", B) + 0.3 * rng.normal(size=(COUNT, ROWS))

    return problems


def all_wrong(rng, columns):
    """Every coefficient of the plain least squares is negative: the solution is zero."""
    B = rng.random((COUNT, ROWS, columns))
    return B, -rng.random((COUNT, ROWS))


def with_zero_column(rng, columns):
    """A component that is zero at all scales: its row of G is zero."""
    B, y = positive(rng, columns)
    B[..., 0] = 0.0
    return B, y


KINDS = {
    "powers": powers,
    "gaussian": gaussian,
    "positive": positive,
    "collinear 1e-3": collinear(1e-3),
    "collinear 1e-6": collinear(1e-6),
    "collinear 1e-9": collinear(1e-9),
    "identical": collinear(0.0),
    "all wrong": all_wrong,
    "zero column": with_zero_column,
}


@jax.jit
def many(B, y, guess=None):
    """x >= 0 that minimise |y - B x|^2, by columns of unit length as the estimator has them."""
    guess = jnp.ones((len(B), B.shape[2]), dtype=bool) if guess is None else guess
    length = jnp.linalg.norm(B, axis=1)
    length = jnp.where(length > 0, length, 1.0)
    U = B / length[:, None, :]
    G, b = U.mT @ U, jnp.einsum("crp,cr->cp", U, y)
    x, passive = solve_nonnegative(G, b, jnp.linalg.norm(y, axis=1), guess)
    return x / length, passive


def one(B, y):
    x, passive = many(B[None], y[None])
    return x[0], passive[0]


passive_solution = jax.jit(lambda G, b, passive: solve_passive(G[None], b[None], passive[None])[0])


@pytest.mark.parametrize("columns", [1, 2, 4, 7])
@pytest.mark.parametrize("kind", KINDS)
def test_objective_is_scipys(kind, columns):
    """To 1e-9 of it, for 300 problems at once; where the fit is perfect, to 1e-14 of |y|^2."""
    B, y = KINDS[kind](np.random.default_rng(columns), columns)
    x, passive = map(np.asarray, many(jnp.asarray(B), jnp.asarray(y)))
    assert np.all(x >= 0)
    assert np.all(x[~passive] == 0)
    best = np.array([scipy.optimize.nnls(B[i], y[i], maxiter=200)[1] ** 2 for i in range(COUNT)])
    seen = np.sum((y - np.einsum("crp,cp->cr", B, x)) ** 2, axis=1)
    slack = 1e-9 * best + 1e-14 * np.sum(y**2, axis=1)
    worst = np.argmax(seen - best - slack)
    assert seen[worst] <= best[worst] + slack[worst], (worst, seen[worst] / best[worst] - 1)


@pytest.mark.parametrize("kind", ["powers", "gaussian", "positive"])
def test_solution_is_scipys(kind):
    """Where the columns are apart the coefficients agree, not only the objective."""
    B, y = KINDS[kind](np.random.default_rng(0), 3)
    apart = np.linalg.cond(B / np.linalg.norm(B, axis=1, keepdims=True)) < 100
    assert np.sum(apart) > 100
    x = np.asarray(many(jnp.asarray(B), jnp.asarray(y))[0])[apart]
    expected = np.array([scipy.optimize.nnls(b, t)[0] for b, t in zip(B[apart], y[apart], strict=True)])
    np.testing.assert_allclose(x, expected, rtol=1e-7, atol=1e-9 * np.max(expected))


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_any_guess_leads_to_the_solution(share):
    """As does none at all: with no column in it, each is looked at once."""
    rng = np.random.default_rng(7)
    B, y = positive(rng, 4)
    guess = rng.random((COUNT, 4)) < share
    expected, _ = many(B, y)
    np.testing.assert_allclose(many(B, y, guess)[0], expected, rtol=1e-9, atol=1e-12)


def test_results_do_not_depend_on_the_others_of_a_batch():
    B, y = powers(np.random.default_rng(5), 5)
    together = np.asarray(many(jnp.asarray(B), jnp.asarray(y))[0])
    for i in range(20):
        np.testing.assert_allclose(one(jnp.asarray(B[i]), jnp.asarray(y[i]))[0], together[i], rtol=1e-9, atol=1e-12)


def test_known_solution():
    """Two orthogonal columns: the positive projection stays, the negative one is cut to zero."""
    x, passive = one(np.eye(3)[:, :2], np.array([2.0, -1.0, 5.0]))
    np.testing.assert_allclose(x, [2.0, 0.0], rtol=1e-12)
    np.testing.assert_array_equal(passive, [True, False])


def test_solve_passive_is_the_normal_equations():
    rng = np.random.default_rng(3)
    U = rng.normal(size=(10, 5))
    U /= np.linalg.norm(U, axis=0)
    G, b = U.T @ U, U.T @ rng.normal(size=10)
    for passive in ([1, 1, 1, 1, 1], [1, 0, 1, 0, 0], [0, 0, 0, 0, 1], [0, 0, 0, 0, 0]):
        inside = np.array(passive, dtype=bool)
        expected = np.zeros(5)
        expected[inside] = np.linalg.solve(G[np.ix_(inside, inside)], b[inside])
        seen = passive_solution(G, b, inside)
        np.testing.assert_allclose(seen, expected, rtol=1e-11, atol=1e-13)


def test_derivative_of_the_coefficients():
    """Through the passive set, which is constant nearby: what variable projection differentiates."""
    rng = np.random.default_rng(4)
    B, y = rng.random((10, 4)), rng.random(10)
    passive = one(B, y)[1]

    @jax.jit
    def coefficients(B):
        return solve_passive((B.T @ B)[None], (B.T @ y)[None], passive[None])[0]

    B = B / np.linalg.norm(B, axis=0)
    direction = rng.normal(size=B.shape)
    _, tangent = jax.jvp(coefficients, (B,), (direction,))
    h = 1e-6
    difference = np.asarray(coefficients(B + h * direction) - coefficients(B - h * direction)) / (2 * h)
    np.testing.assert_allclose(tangent, difference, rtol=1e-6, atol=1e-7)
