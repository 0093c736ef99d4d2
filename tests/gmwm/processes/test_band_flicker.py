"""Flicker noise with a corner: the cosine integral, far lags at 80 digits, its Allan variance, fits, filters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import MP
from scipy.integrate import quad
from scipy.special import sici

import gmwm_jax as gj
from gmwm_jax.processes._maths.cosine_integral import cosine_integral


def test_cosine_integral_is_scipys():
    x = np.concatenate([np.geomspace(1e-12, 4, 500), np.linspace(3.9, 4.1, 101), np.geomspace(4, 1e9, 500)])
    expected = sici(x)[1]
    seen = np.asarray(jax.jit(cosine_integral)(x))
    np.testing.assert_allclose(seen, expected, rtol=1e-13, atol=1e-13)
    # beyond the switch also as a share of its size, 1/x
    assert np.max(np.abs(seen - expected)[x > 4] * x[x > 4]) < 1e-13


def test_cosine_integral_differentiates():
    """cos(x)/x, and once more, both ways, on either side of the switch."""
    for x in (1e-3, 2.0, 4.0, 30.0):
        at = jnp.asarray(x)
        assert float(jax.grad(cosine_integral)(at)) == pytest.approx(np.cos(x) / x, rel=1e-13)
        second = -np.sin(x) / x - np.cos(x) / x**2
        assert float(jax.grad(jax.grad(cosine_integral))(at)) == pytest.approx(second, rel=1e-12)


@pytest.mark.parametrize("f0", [1e-3, 0.05, 0.7])
def test_allan_variance_is_the_integral_over_the_band(f0):
    """IEEE 952: int S(f) 2 sin(pi f T)^4/(pi f T)^2 df over both signs of f, S = B^2/(2 pi f) up to f0; T = tau/2."""
    B, tau = 0.3, np.array([2.0, 8.0, 64.0])
    for span, nu in zip(tau, np.asarray(gj.FLK(f0, B).wavelet_variance(tau)), strict=True):
        T = span / 2

        def integrand(f, T=T):
            return 2 * B**2 / (2 * np.pi * f) * 2 * np.sin(np.pi * f * T) ** 4 / (np.pi * f * T) ** 2

        assert 2 * nu == pytest.approx(quad(integrand, 0, f0, limit=500, epsabs=0)[0], rel=1e-9)


def covariance_at_80_digits(f0, lag, n_j, n_k):
    """The fourth difference of the generalised covariance, which cancels, in 80 digits."""
    f0, total = MP.mpf(f0), MP.mpf(0)
    for a, c_a in enumerate((1, -2, 1)):
        for b, c_b in enumerate((1, -2, 1)):
            m = abs(MP.mpf(lag) - a * n_j + b * n_k)
            if m:
                X = 2 * MP.pi * f0 * m
                total += c_a * c_b * m**2 * (MP.log(m) - MP.ci(X) + MP.sin(X) / X + (1 - MP.cos(X)) / X**2) / 2
    return float(total / (4 * MP.pi * n_j * n_k))


@pytest.mark.parametrize("f0", [1e-6, 1e-3, 0.02, 0.1, 0.45, 3.0])
def test_haar_covariance_at_real_and_far_lags(f0):
    """1e-9 of the standard deviations: filters overlapping and apart, few waves in the band and many."""
    rng = np.random.default_rng(0)
    spans = [(2.0**a, 2.0**b) for a in (0, 3, 10) for b in (0, 3, 10)]
    n_j, n_k = (np.repeat([s[i] for s in spans], 25) for i in (0, 1))
    lag = rng.choice([-1, 1], len(n_j)) * np.exp(rng.uniform(np.log(0.5), np.log(1e6), len(n_j)))
    process = gj.FLK(f0, 1.0)
    arguments = [jnp.asarray(x) for x in (lag, np.ones_like(lag), n_j, n_k)]
    seen = np.asarray(process.unit_haar_covariance(process.shape, *arguments))
    expected = [covariance_at_80_digits(f0, *point) for point in zip(lag, n_j.tolist(), n_k.tolist(), strict=True)]
    size = np.sqrt(np.asarray(process.wavelet_variance(2 * n_j)) * np.asarray(process.wavelet_variance(2 * n_k)))
    assert np.max(np.abs(seen - expected) / size) < 1e-9


@pytest.mark.slow
def test_a_fit_recovers_corner_and_level():
    tau = 2.0 ** np.arange(1, 17)
    truth = gj.WN(1e-3) + gj.FLK(0.01, 0.2) + gj.RW(1e-9)
    nu = np.asarray(truth.wavelet_variance(tau))
    fit = gj.fit(
        gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, rate=100.0, unit="rad/s"), "WN + FLK + RW"
    )
    got = {type(p).kind: [float(v) for v in p.values] for p in fit.model.processes}
    assert got["FLK"] == pytest.approx([0.01, 0.2], rel=1e-4)
    assert fit.continuous()["FLK", "f0"].value == pytest.approx(1.0, rel=1e-4)
    assert fit.datasheet()["FLK", "f_0"].unit == "Hz"


def test_a_ladder_up_to_the_corner_approximates_it():
    f = np.geomspace(1e-4, 1e-3, 20)
    ladder = gj.processes.flicker_ladder(1e-5, 1e-4, 1e-2, 5)  # inside of the band
    np.testing.assert_allclose(ladder.psd(f), gj.FLK(0.01, 1e-5).psd(f), rtol=0.01)
