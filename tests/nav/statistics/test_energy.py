"""The energy score against closed forms, 20-digit integrals and Monte Carlo, and that it is proper."""

import time

import mpmath
import numpy as np
import pytest
from helpers import assert_mean
from scipy.special import ndtr

from nav_jax.statistics import energy
from nav_jax.statistics.energy import energy_score, expected_norm

TOLERANCE = 1e-9


def rotation(rng):
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    return Q * np.sign(np.diag(R))


def covariance(rng, variances):
    Q = rotation(rng)
    P = Q @ np.diag(variances) @ Q.T
    return (P + P.T) / 2


def by_mpmath(mean, variances):
    """E|Z| with independent components, by Gauss-Legendre of the integral over t before any part is integrated."""
    with mpmath.workdps(20):
        lam, m2 = [mpmath.mpf(float(v)) for v in variances], [mpmath.mpf(float(m)) ** 2 for m in mean]

        def integrand(u):
            t = mpmath.e**u
            logs = [mpmath.log1p(2 * t * a) / 2 + t * b / (1 + 2 * t * a) for a, b in zip(lam, m2, strict=True)]
            return -mpmath.expm1(-sum(logs)) * mpmath.e ** (-u / 2)

        middle = -float(mpmath.log(sum(lam) + sum(m2)))
        value = mpmath.quad(integrand, [middle + 6 * i for i in range(-9, 10)], maxdegree=4)
        return float(value / (2 * mpmath.sqrt(mpmath.pi)))


@pytest.mark.parametrize("ratios", [(1, 1, 1), (1, 0.3, 0.01), (1, 1e-3, 1e-6), (1, 1e-6, 1e-6), (1, 1, 1e-6)])
@pytest.mark.parametrize(
    "mean", [(0, 0, 0), (0, 0, 1), (0.6, -0.64, 0.48), (60, -64, 48), (0, 1e-5, 0.02)], ids=lambda m: f"mean {m}"
)
def test_expected_norm_against_20_digits(ratios, mean):
    """In the principal axes."""
    seen = expected_norm(np.array(mean, dtype=float), np.diag(np.array(ratios, dtype=float)))
    assert seen == pytest.approx(by_mpmath(mean, ratios), rel=TOLERANCE, abs=0)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_isotropic_without_mean(unit):
    """The mean of the Maxwell distribution, 2 sqrt(2/pi) sd, in any unit."""
    seen = expected_norm(np.zeros((4, 3)), np.broadcast_to(unit**2 * np.eye(3), (4, 3, 3)))
    np.testing.assert_allclose(seen, 2 * np.sqrt(2 / np.pi) * unit, rtol=TOLERANCE)


def test_isotropic_with_mean():
    """E|Z| = sqrt(2/pi) s exp(-r^2/2) + (|m| + s^2/|m|) erf(r/sqrt 2), r = |m|/s: the noncentral chi of three."""
    rng = np.random.default_rng(3)
    r = 10.0 ** rng.uniform(-2, 2, size=500)
    m = rng.normal(size=(500, 3))
    m *= (r / np.linalg.norm(m, axis=1))[:, None]
    expected = np.sqrt(2 / np.pi) * np.exp(-(r**2) / 2) + (r + 1 / r) * (2 * ndtr(r) - 1)
    np.testing.assert_allclose(expected_norm(m, np.broadcast_to(np.eye(3), (500, 3, 3))), expected, rtol=TOLERANCE)


def crps(y, sd):
    """Of N(0, sd^2), in closed form."""
    z = y / sd
    return sd * (z * (2 * ndtr(z) - 1) + 2 * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) - 1 / np.sqrt(np.pi))


def test_one_dimension_is_the_crps():
    """Given as one dimension, and as a line in space: a covariance of rank one with the error along it."""
    rng = np.random.default_rng(4)
    sd, z = 10.0 ** rng.uniform(-3, 3, size=200), rng.normal(size=200) * 10.0 ** rng.uniform(-3, 2, size=200)
    expected = crps(z * sd, sd)
    np.testing.assert_allclose(energy_score((z * sd)[:, None], (sd**2)[:, None, None]), expected, rtol=1e-8)
    axis = np.array([0.48, -0.6, 0.64])
    line = energy_score((z * sd)[:, None] * axis, (sd**2)[:, None, None] * np.outer(axis, axis))
    # the line is one to rounding only
    np.testing.assert_allclose(line, expected, rtol=1e-6)


def test_nothing_claimed_scores_the_distance():
    rng = np.random.default_rng(5)
    error = rng.normal(size=(5, 7, 3))
    none = np.zeros((5, 7, 3, 3))
    np.testing.assert_allclose(energy_score(error, none), np.linalg.norm(error, axis=-1), rtol=TOLERANCE)
    assert np.all(energy_score(0 * error, none) == 0)
    # nearly so
    np.testing.assert_allclose(
        energy_score(error, none + 1e-12 * np.eye(3)), np.linalg.norm(error, axis=-1), rtol=1e-5, atol=0
    )


def test_does_not_depend_on_axes_or_unit():
    rng = np.random.default_rng(6)
    P, error, Q = covariance(rng, [4.0, 0.3, 1e-4]), rng.normal(size=3), rotation(rng)
    turned = Q @ P @ Q.T
    expected = energy_score(error, P)
    assert energy_score(Q @ error, (turned + turned.T) / 2) == pytest.approx(float(expected), rel=1e-9, abs=0)
    assert energy_score(1e4 * error, 1e8 * P) == pytest.approx(1e4 * float(expected), rel=1e-9, abs=0)


def test_against_monte_carlo():
    """The definition with 200,000 draws, within 4.5 standard errors."""
    rng = np.random.default_rng(7)
    for _ in range(4):
        P = covariance(rng, 10.0 ** rng.uniform(-3, 1, size=3))
        error = rng.normal(size=3) * 2
        root = np.linalg.cholesky(P)
        X, other = (rng.normal(size=(200_000, 3)) @ root.T for _ in range(2))
        # X is the forecast about the estimate, and the truth lies at -error from there
        draws = np.linalg.norm(X + error, axis=1) - np.linalg.norm(X - other, axis=1) / 2
        assert_mean(draws, energy_score(error, P))


def test_is_proper():
    """In the mean over truths, the covariance that they have scores better than one that is wrong in size or shape."""
    rng = np.random.default_rng(8)
    P = covariance(rng, [4.0, 1.0, 0.25])
    errors = rng.normal(size=(4000, 3)) @ np.linalg.cholesky(P).T
    right = energy_score(errors, np.broadcast_to(P, (4000, 3, 3)))
    for wrong in (P / 2, 2 * P, np.diag([4.0, 1.0, 0.25]), 1.75 * np.eye(3)):
        worse = energy_score(errors, np.broadcast_to(wrong, (4000, 3, 3))) - right
        assert worse.mean() > 4.5 * worse.std(ddof=1) / np.sqrt(4000)
    biased = energy_score(errors + 0.3, np.broadcast_to(P, (4000, 3, 3))) - right
    assert biased.mean() > 4.5 * biased.std(ddof=1) / np.sqrt(4000)
    # E|X - y| = E|X - X'| for the right one, whose score is half of that
    assert_mean(right, expected_norm(np.zeros(3), 2 * P) / 2)


def test_blocks_leave_no_trace():
    rng = np.random.default_rng(9)
    num = energy._BLOCK + 3
    A, error = rng.normal(size=(num, 3, 3)), rng.normal(size=(num, 3))
    P = A @ np.swapaxes(A, 1, 2)
    seen = energy_score(error, P)
    for i in (0, energy._BLOCK - 1, energy._BLOCK, num - 1):
        assert seen[i] == pytest.approx(float(energy_score(error[i], P[i])), rel=1e-12, abs=0)
    assert energy_score(error[:0], P[:0]).shape == (0,)


@pytest.mark.slow
def test_is_fast():
    """500 runs of 301 epochs take less than a second of one core; the limit is for busy machines."""
    rng = np.random.default_rng(10)
    A, error = rng.normal(size=(500, 301, 3, 3)), rng.normal(size=(500, 301, 3))
    P = A @ np.swapaxes(A, -1, -2)
    start = time.process_time()
    energy_score(error, P)
    assert time.process_time() - start < 3


def changed(x, index, value):
    x = x.copy()
    x[index] = value
    return x


def test_what_is_refused():
    P, error = np.broadcast_to(np.eye(3), (2, 4, 3, 3)).copy(), np.zeros((2, 4, 3))
    with pytest.raises(ValueError, match=r"Errors of shape \(2, 4, 3\) take covariances of shape \(2, 4, 3, 3\), and"):
        energy_score(error, P[:1])
    with pytest.raises(ValueError, match=r"The error is NaN or infinite at index \(1, 2, 0\)"):
        energy_score(changed(error, (1, 2, 0), np.nan), P)
    with pytest.raises(ValueError, match=r"The covariance is NaN or infinite at index \(0, 1, 2, 2\)"):
        energy_score(error, changed(P, (0, 1, 2, 2), np.inf))
    with pytest.raises(ValueError, match=r"1 of 8 covariances are not symmetric, the first of them at index \(1, 3\)"):
        energy_score(error, changed(P, (1, 3, 0, 1), 1e-3))
    with pytest.raises(ValueError, match=r"2 of 8 covariances are not positive semidefinite, .* index \(0, 2\)"):
        expected_norm(error, changed(P, (slice(None), 2, 1, 1), -1e-3))
