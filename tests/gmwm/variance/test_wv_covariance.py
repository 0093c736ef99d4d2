"""The covariance of the wavelet variance against Isserlis' theorem summed over every pair of coefficients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import SUMS, row_of, rows, sample_covariance, sample_mean
from helpers import CountTraces

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN
from gmwm_jax.variance.covariance import wv_covariance


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


@pytest.mark.slow
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
        2 / M**2 * (M / 4 + (M - 1) / 8), rel=1e-13
    )


def test_large_records_approach_the_chi_square_of_few_degrees():
    """White noise: Var(nu_1)/nu_1^2 -> 3/M (the covariance 1/2, -1/4 at lag 0, 1), Percival (1995)."""
    covariance = np.asarray(wv_covariance(Composite((WN(1.0),)), 1_000_000))
    assert covariance[0, 0] / 0.25 * 1_000_000 == pytest.approx(3.0, rel=1e-5)


@pytest.mark.slow
def test_derivatives_both_ways():
    """Of all parameters of a sum, against differences; every process at every parameter set is in tests/validation."""

    def covariance(v):
        return wv_covariance(WN(v[0]) + GM(v[1], v[2]), 300)

    v, h = jnp.array([1.0, 0.05, 2.0]), 1e-4
    forward, reverse = jax.jit(jax.jacfwd(covariance))(v), jax.jit(jax.jacrev(covariance))(v)
    size = np.asarray(covariance(v))[..., None]
    assert np.all(np.abs(forward - reverse) <= 1e-9 * (np.abs(forward) + size))
    steps = h * np.asarray(v) * np.eye(3)
    differences = [(covariance(v + s) - covariance(v - s)) / (2 * s.sum()) for s in steps]
    assert np.all(np.abs(forward - np.stack(differences, -1)) <= 1e-6 * (np.abs(forward) + size))


@pytest.mark.parametrize("model", [SUMS[1], SUMS[-1]], ids=repr)
def test_it_is_a_covariance(model):
    """Symmetric and positive definite, as weights need it; every sum, and all its terms, are in tests/validation."""
    covariance = np.asarray(wv_covariance(model, 10_001))
    np.testing.assert_array_equal(covariance, covariance.T)
    size = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(size, size)).min() > 1e-6


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
        np.testing.assert_allclose(seen, wv_covariance(WN(1.0) + GM(b, 2.0), 300), rtol=1e-11)


def test_gm_is_ar1():
    beta = 0.01
    ar1 = AR1(np.exp(-beta), -2.0 * np.expm1(-2 * beta))
    np.testing.assert_allclose(
        wv_covariance(Composite((GM(beta, 2.0),)), 300), wv_covariance(Composite((ar1,)), 300), rtol=1e-11
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
