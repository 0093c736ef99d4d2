"""The covariance of the wavelet variance of every process: derivatives, and long records by sums over all lags."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from gmwm.cases import SUMS, derivative_rows, exact, haar_filter, row_of

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.variance.covariance import wv_covariance


def by_fft(model, num_samples, levels):
    """Direct sums over all lags; the cross-covariances from the exact autocovariance convolved with both filters."""
    num_lags = 2 * num_samples
    rows_of = [(row_of(p.kind), exact(tuple(float(v) for v in p.values))) for p in model.processes]
    covariances = []
    for case, values in rows_of:
        gamma = case.autocovariance(*values, num_lags)
        if case.stationary:
            gamma = [g - gamma[0] for g in gamma]  # a constant, which the filters do not see
        gamma = np.array([float(g) for g in gamma])
        covariances.append(np.concatenate([gamma[:0:-1], gamma]))  # lags -(2N - 1) .. 2N - 1
    result = np.empty((len(levels), len(levels)))
    for a, j in enumerate(levels):
        for b, k in enumerate(levels[: a + 1]):
            M_j, M_k = num_samples - 2**j + 1, num_samples - 2**k + 1
            h = np.arange(1 - M_j, M_k)
            cross, mu_j, mu_k = 0.0, 0.0, 0.0
            for (case, values), gamma in zip(rows_of, covariances, strict=True):
                f_j, f_k = (haar_filter(2**i, case.differences) / 2**i for i in (j, k))
                # Cov(W_j(t+h), W_k(t)) = sum_ab f_j(a) f_k(b) gamma(h - a + b)
                all_lags = scipy.signal.fftconvolve(gamma, scipy.signal.fftconvolve(f_j, f_k[::-1]))
                cross = cross + all_lags[num_lags - 1 + 2**k - 1 + h]
                mean = float(case.mean(*values))
                mu_j, mu_k = mu_j + mean * f_j.sum(), mu_k + mean * f_k.sum()
            first = np.maximum(2**j - 1, 2**k - 1 + h)  # the coefficients of level j that have a partner at lag h
            last = np.minimum(num_samples - 1, num_samples - 1 + h)
            terms = (last - first + 1) * (2 * cross**2 + 4 * mu_j * mu_k * cross)
            result[a, b] = result[b, a] = np.sum(terms) / (M_j * M_k)
    return result


LONG = [Composite((GM(beta, 1.0),)) for beta in (1e-6, 1e-4, 1.688923e-3, 0.05, 0.3, 2.0)] + [
    Composite((AR1(-0.9, 1.0),)),
    Composite((RW(1.0),)),
    Composite((MAT32(0.003, 1.0),)),
    Composite((MAT52(0.03, 1.0),)),
    Composite((FGN(0.2, 1.0),)),
    Composite((FGN(0.95, 1.0),)),
    Composite((BI(1.0),)),
]


@pytest.mark.parametrize("model", [*LONG, *SUMS], ids=repr)
def test_long_records_against_sums_over_all_lags_and_positive_definite(model):
    """The graded quadrature against all 2N terms a pair of scales, among them the longest three; N = 10 001."""
    levels = [1, 2, 5, 8, 10, 11, 12]
    at = np.array(levels) - 1
    covariance = np.asarray(wv_covariance(model, 10_001))
    expected = by_fft(model, 10_001, levels)
    size = np.sqrt(np.diag(expected))
    # the transforms leave rounding of the size of the diagonal
    off = np.abs(covariance[np.ix_(at, at)] - expected)
    assert np.all(off <= 1e-9 * expected + 1e-10 * np.outer(size, size))
    # and what a weighting matrix needs; the short scales of a smooth process are nearly one and the same
    smooth = any(type(p) in (MAT32, MAT52) for p in model.processes)
    np.testing.assert_array_equal(covariance, covariance.T)
    size = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(size, size)).min() > (1e-10 if smooth else 1e-6)


@pytest.mark.parametrize("case", [row for row in derivative_rows(ergodic=True) if row.id != "MA(1)"])
def test_gradient_forward_reverse_and_numerical(case):
    """Finite at every parameter set, equal both ways, and the difference quotient of the covariance."""

    def covariance(v):
        return wv_covariance(Composite((case.cls(*v),)), 300)

    forward, reverse = jax.jit(jax.jacfwd(covariance)), jax.jit(jax.jacrev(covariance))
    # those of AR(2) near a unit root leave no room for difference quotients, and FLK is slow
    for values in case.parameters[:1] if case.cls.kind in ("AR(2)", "FLK") else case.parameters:
        v = jnp.asarray(values)
        f, r = np.asarray(forward(v)), np.asarray(reverse(v))
        assert np.all(np.isfinite(f)), values
        assert np.all(np.isfinite(r)), values
        for i, x in enumerate(values):
            alternates = i == 0 and x < -0.99  # the covariance has no digits left for a difference quotient
            size = {AR1: 1 - abs(x), FGN: min(x, 1 - x)}.get(case.cls, x) if i == 0 else x
            h = np.zeros(len(values))
            h[i] = 1e-4 * size
            # fourth order
            stencil = [np.asarray(covariance(jnp.asarray(values + s * h))) for s in (-2, -1, 1, 2)]
            difference = (stencil[0] - 8 * stencil[1] + 8 * stencil[2] - stencil[3]) / (12 * h[i])
            scale = np.asarray(covariance(v)) / size
            f_i, r_i = f[..., i], r[..., i]
            assert np.all(np.abs(f_i - r_i) <= (1e-6 if alternates else 1e-9) * (np.abs(f_i) + scale)), values
            if not alternates:
                assert np.all(np.abs(f_i - difference) <= 1e-6 * (np.abs(difference) + 1e-3 * scale)), values
