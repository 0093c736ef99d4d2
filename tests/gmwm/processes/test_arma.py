"""ARMA processes: accuracy at any order and near unit roots, parameters, fits for the global minimum, intervals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from gmwm.cases import MP, _arma, exact
from scipy.optimize import minimize

import gmwm_jax as gj
from gmwm_jax.processes.arma import MAX_ORDER
from gmwm_jax.variance.covariance import wv_covariance

DYADIC = [2**j for j in range(1, 25)]


def relative_error(process, taus):
    p, q = type(process).num_ar, type(process).num_ma
    expected = [_arma(p, q)["closed_form"](*exact(tuple(map(float, process.values))), tau) for tau in taus]
    seen = np.asarray(process.wavelet_variance(taus))
    return np.array([float(abs(MP.mpf(float(v)) / e - 1)) for v, e in zip(seen, expected, strict=True)])


# -- accuracy --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "process",
    [
        gj.ARMA(4, 3)(0.5, -0.3, 0.2, 0.1, 0.4, -0.2, 0.3, sigma2=2.0),
        gj.AR(5)(1.2, -0.6, 0.3, -0.1, 0.05, sigma2=1.0),
        gj.MA(3)(-0.9, 0.5, -0.4, sigma2=1.0),
        gj.ARMA(1, 2)(0.99, 0.3, 0.2, sigma2=1.0),
    ],
    ids=repr,
)
def test_any_order_up_to_two_to_the_24(process):
    """The bar is 1e-10; also at spans that are no powers of two."""
    assert relative_error(process, [*DYADIC, 6, 1000, 12346]).max() < 1e-11


def test_accuracy_near_unit_roots_is_that_of_the_coefficients():
    """A root 1 - delta in doubles is known to 1e-16/delta; a double one to 1e-16/delta^2. Shorter spans keep more."""
    for delta in (1e-3, 1e-6, 1e-9):
        errors = relative_error(gj.AR(2)(1.5 - delta, -0.5 * (1 - delta), sigma2=1.0), DYADIC)
        assert errors.max() < 3e-15 / delta
        assert errors[np.array(DYADIC) < 0.01 / delta].max() < 1e-12
    for delta in (1e-2, 1e-3, 1e-4):
        errors = relative_error(gj.AR(2)(2 * (1 - delta), -((1 - delta) ** 2), sigma2=1.0), DYADIC)
        assert errors.max() < 3e-15 / delta**2


@pytest.mark.parametrize("theta", [-0.95, -0.3, 0.6])
def test_closed_forms_of_first_order(theta):
    """MA(1) and ARMA(1,1) as R's simts has them."""
    tau = np.array([2.0, 4.0, 16.0, 256.0])
    ma = ((1 + theta) ** 2 * tau - 6 * theta) / tau**2
    np.testing.assert_allclose(gj.MA(1)(theta, 1.0).wavelet_variance(tau), ma, rtol=1e-12)
    phi = 0.7
    inner = (theta + phi) * (1 + theta * phi) * (3 - 4 * phi ** (tau / 2) + phi**tau)
    arma = -2 * (-inner - (1 + theta) ** 2 * (phi**2 - 1) * tau / 2) / ((phi - 1) ** 3 * (1 + phi) * tau**2)
    np.testing.assert_allclose(gj.ARMA(1, 1)(phi, theta, 1.0).wavelet_variance(tau), arma, rtol=1e-11)


def test_spans_that_are_no_powers_of_two_are_not_guessed_under_jit():
    process = gj.MA(1)(0.5, 1.0)
    traced = jax.jit(lambda tau: process.wavelet_variance(tau))(jnp.asarray([4.0, 6.0]))
    assert traced[0] == pytest.approx(0.375, rel=1e-13)
    assert np.isnan(traced[1])


@pytest.mark.slow
@pytest.mark.parametrize("phi", [(1.98 * np.cos(0.2), -0.9801), (1.4 * np.cos(1.57), -0.49)], ids=str)
def test_covariance_of_the_wavelet_variance_of_what_rings(phi):
    """Twenty radians before it falls by e, and a period of four samples: against the sums over all lags."""
    num, levels = 5000, [1, 2, 4, 7, 11]
    process = gj.AR(2)(*phi, 1.0)
    gamma = np.empty(2 * num)
    gamma[:2] = process.autocovariance([0, 1])
    for i in range(2, 2 * num):
        gamma[i] = phi[0] * gamma[i - 1] + phi[1] * gamma[i - 2]
    both = np.concatenate([gamma[:0:-1], gamma])
    at = np.array(levels) - 1
    seen = np.asarray(wv_covariance(process, num))[np.ix_(at, at)]
    for a, j in enumerate(levels):
        for b, k in enumerate(levels):
            f_j, f_k = (np.repeat([1, -1], 2 ** (i - 1)) / 2**i for i in (j, k))
            M_j, M_k = num - 2**j + 1, num - 2**k + 1
            h = np.arange(1 - M_j, M_k)
            cross = scipy.signal.fftconvolve(both, scipy.signal.fftconvolve(f_j, f_k[::-1]))[2 * num + 2**k - 2 + h]
            pairs = np.minimum(num - 1, num - 1 + h) - np.maximum(2**j - 1, 2**k - 1 + h) + 1
            expected = np.sum(pairs * 2 * cross**2) / (M_j * M_k)
            assert seen[a, b] == pytest.approx(expected, rel=1e-8, abs=1e-9 * np.sqrt(seen[a, a] * seen[b, b]))


# -- parameters ------------------------------------------------------------------------------------------------------


def test_every_point_of_the_real_line_is_stationary_and_invertible():
    rng = np.random.default_rng(0)
    for p, q in ((2, 0), (3, 2), (0, 2), (5, 4)):
        cls = gj.ARMA(p, q)
        for _ in range(20):
            vector = rng.normal(0, 3, p + q + 1)
            process = cls.from_unconstrained(jnp.asarray(vector))
            np.testing.assert_allclose(process.unconstrained(), vector, rtol=1e-6, atol=1e-6)
            phi, theta = np.array(process.values[:p]), np.array(process.values[p:-1])
            for part in (phi, -theta):
                assert np.all(np.abs(np.roots([1, *-part])) < 1)


def test_coordinates_are_partial_autocorrelations():
    """The last coefficient of the best linear predictor of each order, from the autocovariance."""
    process = gj.AR(3)(0.5, -0.4, 0.3, 1.0)
    gamma = np.asarray(process.autocovariance(np.arange(4)))
    partial = [scipy.linalg.solve_toeplitz(gamma[:k], gamma[1 : k + 1])[-1] for k in (1, 2, 3)]
    np.testing.assert_allclose(np.tanh(process.unconstrained()[:3] / 2), partial, rtol=1e-11)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("AR(2)", "AR(2)"),
        ("wn + arma( 2 , 1 )", "WN + ARMA(2,1)"),
        ("AR(1)", "AR1"),
        ("ARMA(1,0)(phi=0.5)", "AR1(phi=0.5)"),
        ("ARMA(0,2)", "MA(2)"),
        ("2*AR(2) + RW", "AR(2) + AR(2) + RW"),
        ("MA(1)(theta1=-0.5 fixed, sigma2=2)", "MA(1)(theta1=-0.5 fixed, sigma2=2)"),
        ("ARMA(2,1)(phi1=0.5, phi2=.2, theta1=0.4) + GM", "ARMA(2,1)(phi1=0.5, phi2=0.2, theta1=0.4) + GM"),
        ("AR(2) + QN + WN", "AR(2) + QN + WN"),
        ("ARMA(1,1) + QN", "ARMA(1,1) + QN"),
        ("ARMA(2,1) + MA(1)", "ARMA(2,1) + MA(1)"),
    ],
)
def test_texts(text, meant):
    model = gj.parse_model(text)
    assert repr(model) == meant
    assert repr(gj.parse_model(repr(model))) == meant


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("AR", r"Unknown process 'AR'.*AR\(p\), MA\(q\), ARMA\(p,q\)"),
        ("ARMA(2)", r"Unknown process 'ARMA\(2\)'"),
        ("AR(0)", "orders up to 10, not both 0, and these are 0 and 0"),
        ("AR(11)", "orders up to 10"),
        ("AR(2)(phi=0.5)", "no parameter 'phi'.*phi1, phi2, sigma2"),
        ("AR(2)(phi1=1.5, phi2=0.2)", r"phi1=1.5, phi2=0.2 it is not stationary.*1.875, 0.2"),
        ("MA(2)(theta1=1.9, theta2=0.5)", "theta1=1.9, theta2=0.5 it is not invertible"),
        ("MA(1) + WN", r"MA\(1\) and WN cannot be told apart.*Leave WN out"),
        ("QN + MA(1)", r"MA\(1\) and QN cannot be told apart"),
        ("ARMA(2,2) + WN", r"ARMA\(2,2\) and WN cannot be told apart"),
        ("MA(1) + MA(2)", r"MA\(2\) and MA\(1\) cannot be told apart"),
        ("2*MA(1)", r"2 x MA\(1\): two MA\(1\) processes add up to one"),
    ],
)
def test_what_is_no_model(text, message):
    with pytest.raises(ValueError, match=message):
        gj.parse_model(text)


def test_classes():
    assert gj.AR(1) is gj.AR1
    assert gj.AR(2) is gj.ARMA(2, 0)
    assert gj.MA(1) is gj.ARMA(0, 1)
    assert len(gj.AR(MAX_ORDER).parameters) == MAX_ORDER + 1
    assert repr(gj.AR(2)(0.5, sigma2=1.0)) == "AR(2)(phi1=0.5, sigma2=1)"
    for wrong in (lambda: gj.AR(2)(0.5, 0.2, 1.0, 2.0), lambda: gj.AR(2)(0.5, phi1=0.5), lambda: gj.AR(2)(rho=1.0)):
        with pytest.raises(TypeError, match=r"AR\(2\) takes phi1, phi2, sigma2, each once"):
            wrong()


# -- fits ------------------------------------------------------------------------------------------------------------

NUM = 2**13
TRUTHS = {
    "AR(2)": "AR(2)(phi1=1.5, phi2=-0.8, sigma2=1)",
    "MA(1)": "MA(1)(theta1=0.6, sigma2=1)",
    "ARMA(2,1)": "ARMA(2,1)(phi1=1.2, phi2=-0.5, theta1=0.5, sigma2=1)",
    "WN + AR(2)": "WN(sigma2=1) + AR(2)(phi1=1.2, phi2=-0.25, sigma2=0.1)",
}


def lowest_by_scipy(wv, model, num_starts=8):
    """Quasi-Newton from random points of the real line."""
    rng = np.random.default_rng(1)
    parsed, weights = gj.parse_model(model), 1 / (wv.ci_high - wv.ci_low) ** 2
    ends = np.cumsum([len(p.parameters) for p in parsed.processes])

    def objective(v):
        return jnp.sum(weights * (wv.variance - parsed.with_unconstrained(v).wavelet_variance(wv.scales)) ** 2)

    compiled = jax.jit(jax.value_and_grad(objective))
    found = []
    for _ in range(num_starts):
        start = rng.normal(0, 1.5, parsed.num_parameters)
        start[ends - 1] += np.log(wv.variance[0])
        end = minimize(lambda v: [np.asarray(x) for x in compiled(jnp.asarray(v))], start, jac=True, method="BFGS")
        found.append(end.fun)
    return np.nanmin(found)


@pytest.mark.slow
@pytest.mark.parametrize("model", TRUTHS)
def test_the_global_minimum_is_found(model):
    x = np.asarray(gj.simulate(TRUTHS[model], NUM, key=jax.random.key(3)))
    wv = gj.wavelet_variance(x)
    fit = gj.fit(wv, model)
    assert fit.objective <= lowest_by_scipy(wv, model) * (1 + 1e-9)
    assert fit.objective == pytest.approx(gj.fitting.objective(wv, fit.model), rel=1e-9, abs=0)


@pytest.fixture(scope="module")
def own_theory():
    """AR(2), fitted to its own wavelet variance."""
    x = np.asarray(gj.simulate(TRUTHS["AR(2)"], NUM, key=jax.random.key(3)))
    some = gj.wavelet_variance(x)
    nu = np.asarray(gj.parse_model(TRUTHS["AR(2)"]).wavelet_variance(some.scales))
    low, high = some.ci_low / some.variance * nu, some.ci_high / some.variance * nu
    return gj.fit(gj.variance.WaveletVariance.from_table(some.scales, nu, low, high, num_samples=NUM), "AR(2)")


@pytest.mark.slow
def test_parameters_are_recovered_and_have_intervals(own_theory):
    table = own_theory.parameters()
    for name, value in (("phi1", 1.5), ("phi2", -0.8), ("sigma2", 1.0)):
        estimate = table["AR(2)", name]
        assert estimate.value == pytest.approx(value, rel=1e-5, abs=0)
        assert estimate.ci_low < value < estimate.ci_high
    # the least that any estimator of an AR(2) can have: (1 - phi2^2)/N
    width = (table["AR(2)", "phi2"].ci_high - table["AR(2)", "phi2"].ci_low) / 2 / 1.96
    assert np.sqrt((1 - 0.8**2) / NUM) < width < 3 * np.sqrt((1 - 0.8**2) / NUM)


def test_held_coefficients():
    x = np.asarray(gj.simulate(TRUTHS["AR(2)"], NUM, key=jax.random.key(3)))
    wv = gj.wavelet_variance(x)
    held = gj.fit(wv, "AR(2)(phi1=1.5 fixed, phi2=-0.8 fixed)")
    assert [float(v) for v in held.model.processes[0].shape] == [1.5, -0.8]
    with pytest.raises(ValueError, match=r"AR\(2\): the coefficients are estimated together. Hold all of phi1, phi2"):
        gj.fit(wv, "AR(2)(phi1=1.5 fixed)")


@pytest.mark.slow
def test_a_unit_root_is_named():
    """A random walk fitted by an AR(2)."""
    tau = 2.0 ** np.arange(1, 13)
    nu = np.asarray(gj.RW(1e-6).wavelet_variance(tau))
    fit = gj.fit(gj.variance.WaveletVariance.from_table(tau, nu, 0.9 * nu, 1.1 * nu, num_samples=NUM), "AR(2)")
    assert fit.at_boundary == {"AR(2)": "at boundary: unit root"}
    assert float(fit.model.processes[0].sigma2) == pytest.approx(1e-6, rel=1e-2)
    assert sum(map(float, fit.model.processes[0].shape)) == pytest.approx(1, abs=1e-4)
