"""The covariance of the wavelet variance against Isserlis' theorem summed over every pair of coefficients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
from gmwm.cases import derivative_rows, exact, haar_filter, row_of, rows, sample_covariance, sample_mean
from helpers import CountTraces

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.covariance import wv_covariance

SUMS = [
    WN(1.0) + GM(0.01, 0.5),
    WN(4.9e-5) + RW(4.8e-13) + GM(1.7e-3, 1.2e-7) + GM(8.8e-5, 1.2e-7),
    QN(1.0) + WN(0.1) + RW(1e-4),
    WN(1.0) + AR1(-0.7, 2.0) + AR1(0.99, 0.01),
    WN(1.0) + DR(0.01),
    RW(0.01) + DR(0.1) + GM(0.3, 1.0),
    WN(1.0) + QN(2.0) + RW(1e-3) + DR(1e-2) + GM(0.5, 1.0) + GM(1e-3, 2.0),
]


def second_moments(model, num_samples):
    """Covariance (less what the filters do not see) and mean of the samples of a sum, from its rows in the table."""
    parts = [(row_of(p.kind), tuple(float(v) for v in p.values)) for p in model.processes]
    covariance = sum(sample_covariance(case, values, num_samples, less_variance=True) for case, values in parts)
    mean = sum(sample_mean(case, values, num_samples) for case, values in parts)
    return covariance, mean


def haar(x, tau):
    """Coefficients of span tau along axis 0, those that touch no end."""
    S, n = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)]), tau // 2
    return (S[tau:] - 2 * S[n:-n] + S[:-tau]) / tau


def dense(model, num_samples, num_levels):
    """Cov(nu_j, nu_k) = 1/(M_j M_k) sum_st [2 C_st^2 + 4 mu_s mu_t C_st], C = Cov(W_j, W_k) of all coefficients."""
    covariance, mean = second_moments(model, num_samples)
    result = np.empty((num_levels, num_levels))
    for j in range(num_levels):
        half, mu_j = haar(covariance, 2 ** (j + 1)), haar(mean, 2 ** (j + 1))
        for k in range(j + 1):
            C, mu_k = haar(half.T, 2 ** (k + 1)), haar(mean, 2 ** (k + 1))
            result[j, k] = result[k, j] = (2 * np.sum(C**2) + 4 * mu_k @ C @ mu_j) / C.size
    return result


@pytest.mark.parametrize("case", rows(ergodic=True))
def test_every_process_against_all_pairs_of_coefficients(case):
    """N = 300 is no power of two; J = 7."""
    for values in case.parameters:
        model = Composite((case.cls(*values),))
        seen = np.asarray(wv_covariance(model, 300))
        assert seen.shape == (7, 7)
        # an alternating process leaves rounding of the size of its variance in the dense sum
        rtol = 1e-6 if values[0] < -0.99 else case.covariance_rtol
        np.testing.assert_allclose(seen, dense(model, 300, 7), rtol=rtol, err_msg=str(values))


@pytest.mark.parametrize("model", SUMS, ids=repr)
def test_sums_against_all_pairs_of_coefficients(model):
    """A drift has no covariance of its own and enters with the noise beside it."""
    np.testing.assert_allclose(wv_covariance(model, 300), dense(model, 300, 7), rtol=1e-10)


@pytest.mark.parametrize(("num_samples", "num_levels"), [(4, 1), (5, 2), (63, 5), (257, 8)])
def test_short_records(num_samples, num_levels):
    """Down to four samples, and with one level more than the default, where a single coefficient may be left."""
    model = WN(1.0) + GM(0.1, 2.0) + DR(0.1)
    seen = wv_covariance(model, num_samples, num_levels)
    np.testing.assert_allclose(seen, dense(model, num_samples, num_levels), rtol=1e-10)


def test_white_noise_at_the_first_level():
    """By hand: W_t = (x_t - x_{t-1})/2 has the covariances 1/2, -1/4; Var(nu_1) = 2/M^2 (M/4 + 2 (M - 1)/16)."""
    M = 99
    assert float(wv_covariance(Composite((WN(1.0),)), 100)[0, 0]) == pytest.approx(
        2 / M**2 * (M / 4 + (M - 1) / 8), rel=1e-14
    )


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


def test_large_records_approach_the_chi_square_of_few_degrees():
    """White noise: Var(nu_1)/nu_1^2 -> 3/M (the covariance 1/2, -1/4 at lag 0, 1), Percival (1995)."""
    covariance = np.asarray(wv_covariance(Composite((WN(1.0),)), 1_000_000))
    assert covariance[0, 0] / 0.25 * 1_000_000 == pytest.approx(3.0, rel=1e-5)


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


def test_another_model_of_the_same_structure_does_not_retrace(monkeypatch):
    counter = CountTraces(GM.unit_haar_covariance)
    monkeypatch.setattr(GM, "unit_haar_covariance", counter)
    for k in range(1, 4):
        wv_covariance(WN(1.0 * k) + GM(0.01 * k, 2.0), 333)
    assert counter.count == 1


def test_vmap_over_parameters():
    betas = jnp.asarray([1e-5, 1e-2, 1.0])
    together = jax.vmap(lambda b: wv_covariance(WN(1.0) + GM(b, 2.0), 300))(betas)
    for b, seen in zip(betas, together, strict=True):
        np.testing.assert_allclose(seen, wv_covariance(WN(1.0) + GM(b, 2.0), 300), rtol=1e-12)


def test_gm_is_ar1():
    beta = 0.01
    ar1 = AR1(np.exp(-beta), -2.0 * np.expm1(-2 * beta))
    np.testing.assert_allclose(
        wv_covariance(Composite((GM(beta, 2.0),)), 1000), wv_covariance(Composite((ar1,)), 1000), rtol=1e-11
    )


def test_refusals():
    with pytest.raises(ValueError, match="no covariance of the wavelet variance of SIN"):
        wv_covariance(WN(1.0) + SIN(0.1, 1.0), 300)
    with pytest.raises(ValueError, match="GM has no value for beta"):
        wv_covariance(WN(1.0) + GM(), 300)
    with pytest.raises(ValueError, match="at least 4 samples"):
        wv_covariance(Composite((WN(1.0),)), 3)
    with pytest.raises(ValueError, match=r"9 levels need 2\^9 samples or more, and the record has 300"):
        wv_covariance(Composite((WN(1.0),)), 300, 9)
    model = Composite((WN(1.0),))
    with jax.enable_x64(False), pytest.raises(RuntimeError, match="jax_enable_x64"):
        wv_covariance(model, 300)
