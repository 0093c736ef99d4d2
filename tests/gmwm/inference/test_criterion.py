"""The criterion against brute force: objectives of linear models on simulated data and on other data."""

import numpy as np
import pytest
from helpers import SIGMAS, assert_mean

from gmwm_jax.inference._criterion import optimism, projection, standard_error

J, NUM = 7, 40_000
RNG = np.random.default_rng(7)
WHITENER = np.diag(RNG.uniform(0.5, 2.0, J))
ROOT = RNG.normal(size=(J, J))
S = WHITENER @ ROOT @ ROOT.T @ WHITENER.T
"""Covariance of whitened data: these weights are not its inverse."""
SMALL = RNG.normal(size=(J, 2))
LARGE = np.concatenate([SMALL, RNG.normal(size=(J, 2))], axis=1)
OTHER = RNG.normal(size=(J, 3))


def draws(covariance, seed, num=NUM):
    return np.random.default_rng(seed).multivariate_normal(np.zeros(J), covariance, size=num)


def residuals(z, tangents):
    """By ordinary least squares, one data set at a time."""
    return z - (tangents @ np.linalg.lstsq(tangents, z.T, rcond=None)[0]).T


def test_projection_is_that_of_least_squares():
    z = draws(np.eye(J), 1, 5)
    np.testing.assert_allclose(z - z @ projection(LARGE).T, residuals(z, LARGE), atol=1e-12)
    twice = np.concatenate([LARGE, 1e-9 * LARGE[:, :1]], axis=1)
    np.testing.assert_allclose(projection(twice), projection(LARGE), atol=1e-12)
    np.testing.assert_array_equal(projection(np.zeros((J, 0))), np.zeros((J, J)))


@pytest.mark.parametrize("tangents", [SMALL, LARGE, OTHER])
def test_optimism_is_what_the_objective_lacks_on_other_data(tangents):
    old, new = draws(S, 2), draws(S, 3)
    here = np.sum(residuals(old, tangents) ** 2, axis=1)
    there = np.sum((new - (old - residuals(old, tangents))) ** 2, axis=1)
    assert_mean(there - here, optimism(projection(tangents), S))


def test_optimism_with_the_inverse_covariance_is_twice_the_number_of_parameters():
    for tangents in (SMALL, LARGE, OTHER):
        assert optimism(projection(tangents), np.eye(J)) == pytest.approx(2 * tangents.shape[1])


def test_error_of_a_difference_of_nested_models_that_are_equally_good():
    """What the smaller one misses is drawn as noise is along the difference: then its criterion is on average equal."""
    Ps, Pl = projection(SMALL), projection(LARGE)
    D = Pl - Ps
    misfit = draws(D @ S @ D, 4)
    z = draws(S, 5) + misfit
    a, b = residuals(z, SMALL), residuals(z, LARGE)
    difference = np.sum(a * a, axis=1) - np.sum(b * b, axis=1) - (optimism(Pl, S) - optimism(Ps, S))
    assert_mean(difference, 0.0)
    # given the misfit: its own scatter is no error
    T = np.trace(D @ S @ D @ S)
    error = standard_error((a[0], Ps), (b[0], Pl), S, nested=True)
    assert_mean((difference - np.sum(misfit * misfit, axis=1) + np.trace(D @ S)) ** 2, error**2)
    assert error**2 == pytest.approx(6 * T)


def test_error_of_a_difference_of_other_models():
    """The squared errors are unbiased where the misfits differ by much."""
    misfit = 30 * RNG.normal(size=J)
    z = draws(S, 6, 4000) + misfit
    a, b = residuals(z, SMALL), residuals(z, OTHER)
    difference = np.sum(a * a, axis=1) - np.sum(b * b, axis=1)
    of = projection(SMALL), projection(OTHER)
    squares = [standard_error((x, of[0]), (y, of[1]), S, nested=False) ** 2 for x, y in zip(a, b, strict=True)]
    scatter = np.var(difference, ddof=1)
    assert abs(np.mean(squares) / scatter - 1) < SIGMAS * np.sqrt(2 / 4000)
