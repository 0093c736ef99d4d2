"""Regression with dependent errors: against dense matrices, against theory, and by Monte Carlo."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import assert_shows

import gmwm_jax as gj
from gmwm_jax.variance.blocked import host_wavelet_variance

MODELS = (
    "WN(sigma2=2.0)",
    "RW(gamma2=0.3)",
    "QN(q2=1.5)",
    "GM(beta=0.02, variance=3.0)",
    "AR1(phi=-0.7, sigma2=1.0)",
    "WN(sigma2=1.0) + DR(omega=0.01)",
    "WN(sigma2=1.0) + QN(q2=0.5) + RW(gamma2=0.01) + GM(beta=0.3, variance=2.0) + GM(beta=0.01, variance=1.0)",
)


def dense_covariance(model, num):
    """Sigma, element by element."""
    t = np.arange(1, num + 1)
    Sigma = np.zeros((num, num))
    for p in gj.parse_model(model).processes:
        if p.kind == "RW":
            Sigma += float(p.gamma2) * np.minimum(t[:, None], t)
        elif p.kind == "DR":
            Sigma += float(p.omega) ** 2 * np.outer(t, t)
        else:
            Sigma += np.asarray(p.autocovariance(t - 1))[np.abs(t[:, None] - t)]
    return Sigma


def seasonal_case(num=300, missing=0.15, seed=0):
    """Trend, seasonal and step over N samples at 2 Hz: regressors, matrix, and which samples are there."""
    rng = np.random.default_rng(seed)
    t = np.arange(num) / 2.0
    regressors = {
        **gj.regression.trend(t),
        **gj.regression.seasonal(t, num / 8.0, 2),
        **gj.regression.step(t, num / 6.0),
    }
    X = np.column_stack([np.ones(num), *(c.values for c in regressors.values())])
    return regressors, X, rng.random(num) >= missing, rng


# -- whitening --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_whitening_and_least_squares_against_dense_matrices(model, missing):
    _, X, present, rng = seasonal_case(missing=missing)
    y = 10 * rng.standard_normal(len(X))
    Sigma = dense_covariance(model, len(X))
    S, A, b = Sigma[np.ix_(present, present)], X[present], y[present]
    inverse = np.linalg.inv(S)
    poisoned = np.where(present, y, np.nan)

    white = gj.processes.whiten(model, X, present)
    np.testing.assert_allclose(white.columns.T @ white.columns, A.T @ inverse @ A, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(white.log_determinant, np.linalg.slogdet(S)[1], rtol=1e-9)
    assert not np.any(np.asarray(white.columns)[~present])

    gls = gj.processes.generalised_least_squares(model, poisoned, X, present)
    C = np.linalg.inv(A.T @ inverse @ A)
    expected = C @ A.T @ inverse @ b
    np.testing.assert_allclose(gls.estimates, expected, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(gls.covariance, C, rtol=1e-7, atol=1e-9 * np.max(C))
    e = b - A @ expected
    likelihood = -0.5 * (len(b) * np.log(2 * np.pi) + np.linalg.slogdet(S)[1] + e @ inverse @ e)
    np.testing.assert_allclose(gls.log_likelihood, likelihood, rtol=1e-9)

    np.testing.assert_allclose(gj.processes.covariance_times(model, X), Sigma @ X, rtol=1e-10, atol=1e-8)


def test_the_likelihood_differentiates():
    _, X, present, rng = seasonal_case()
    y = rng.standard_normal(len(X))

    def log_likelihood(beta):
        return gj.processes.generalised_least_squares(gj.WN(1.0) + gj.GM(beta, 2.0), y, X, present).log_likelihood

    step = 1e-5
    central = (log_likelihood(0.1 + step) - log_likelihood(0.1 - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(log_likelihood)(jnp.asarray(0.1)), central, rtol=1e-6)


def test_whitening_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match=r"shape \(N, C\)"):
        gj.processes.whiten("WN(sigma2=1.0)", np.ones(5))
    with pytest.raises(ValueError, match=r"present \(N,\)"):
        gj.processes.whiten("WN(sigma2=1.0)", np.ones((5, 1)), np.ones(4, dtype=bool))
    with pytest.raises(ValueError, match="no value for sigma2"):
        gj.processes.whiten("WN", np.ones((5, 1)))


# -- wavelet variance of residuals -------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["WN(sigma2=1.0) + RW(gamma2=0.05)", "WN(sigma2=1.0) + GM(beta=0.02, variance=2.0)"])
def test_the_residuals_and_the_spread_of_the_fit_add_up_to_the_noise(model):
    """The identity behind the correction, as traces of dense matrices; without it a fifth and more is missing."""
    _, X, _, _ = seasonal_case(256)
    Sigma = dense_covariance(model, len(X))
    C = np.linalg.inv(X.T @ np.linalg.solve(Sigma, X))
    M = np.eye(len(X)) - X @ C @ np.linalg.solve(Sigma, X).T
    spread = X @ np.linalg.cholesky(C)
    left = []
    for j in range(1, 8):
        h = np.repeat([1.0, -1.0], 2 ** (j - 1)) / 2**j
        W = np.array([np.pad(h, (t, len(X) - len(h) - t)) for t in range(len(X) - len(h) + 1)])
        residual = np.trace(W @ M @ Sigma @ M.T @ W.T) / len(W)
        added = sum(host_wavelet_variance(np.ascontiguousarray(c))[j - 1] for c in spread.T)
        truth = float(gj.parse_model(model).wavelet_variance(2.0**j))
        np.testing.assert_allclose(residual + added, truth, rtol=1e-8)
        left.append(residual / truth)
    assert min(left) < 0.8


# -- regress ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing", [0.0, 0.15])
def test_coefficients_and_errors_are_those_of_the_fitted_noise(missing, key):
    regressors, X, present, _ = seasonal_case(300, missing)
    y = X @ np.arange(1.0, 8.0) + np.asarray(gj.simulate("WN(sigma2=1.0) + RW(gamma2=0.05)", 300, key=key)) + 1e3
    r = gj.regress(np.where(present, y, np.nan), regressors, "WN + RW", rate=2.0)
    A, b = X[present], y[present]
    # the text form of a model has six digits: only the unit is taken from it
    S = sum(
        float(p.amplitude) * dense_covariance(repr(type(p)(1.0)), 300)[np.ix_(present, present)]
        for p in r.noise.reduced.processes
    )
    C = np.linalg.inv(A.T @ np.linalg.solve(S, A))
    np.testing.assert_allclose(r.coefficients.estimates, C @ A.T @ np.linalg.solve(S, b), rtol=1e-8)
    np.testing.assert_allclose(r.coefficients.standard_errors, np.sqrt(np.diag(C)), rtol=1e-8)
    P = np.linalg.pinv(A)
    np.testing.assert_allclose(r.ols.estimates, P @ b, rtol=1e-8)
    np.testing.assert_allclose(r.ols.standard_errors, np.sqrt(np.diag(P @ S @ P.T)), rtol=1e-8)
    np.testing.assert_allclose(r.residuals[present], b - A @ r.coefficients.estimates, atol=1e-8)
    assert np.all(np.isnan(r.residuals[~present]))
    assert r.num_missing == np.sum(~present)
    assert r.converged


def test_a_recording_knows_its_rate_and_unit_and_the_result_prints_itself(key):
    num = 600
    t = np.arange(num) / 100.0
    celsius = 20 + 5 * np.exp(-t)
    y = 9.8 + 1e-3 * celsius + 1e-3 * np.asarray(gj.simulate("WN(sigma2=1.0)", num, key=key))
    recording = gj.Recording.from_array(y, rate=100.0, units="m/s^2", channels="accel_z")
    regressors = gj.regression.polynomial(celsius, 2, name="temperature", unit="K")
    r = gj.regress(recording, regressors, "WN")
    same = gj.regress(y, regressors, "WN", rate=100.0, unit="m/s^2", name="accel_z")
    assert repr(r) == repr(same)
    assert list(r.coefficients) == ["intercept", "temperature", "temperature^2"]
    assert [c.unit for c in r.coefficients.values()] == ["m/s^2", "(m/s^2)/K", "(m/s^2)/K^2"]
    text = repr(r)
    for expected in (
        "accel_z [m/s^2]",
        "600 samples at 100 Hz",
        "temperature^2",
        "(m/s^2)/K^2",
        "sigma2",
        "std. error",
    ):
        assert expected in text
    c = r["temperature"]
    assert c.ci_low < c.value < c.ci_high
    np.testing.assert_allclose(c.ci_high - c.ci_low, 2 * 1.959963984540054 * c.standard_error)
    # white noise: both estimates are the same
    np.testing.assert_allclose(r.ols.estimates, r.coefficients.estimates, rtol=1e-9)
    np.testing.assert_allclose(r.ols.standard_errors, r.coefficients.standard_errors, rtol=1e-9)
    with pytest.raises(KeyError, match="No regressor 'trend'"):
        r["trend"]
    with pytest.raises(ValueError, match="99"):
        gj.regress(recording, regressors, "WN", rate=99.0)


@pytest.mark.slow
@pytest.mark.parametrize("num", [500, 5000])
def test_the_figure_shows_data_residuals_and_noise(num, key):
    y = np.array(gj.simulate("WN(sigma2=1.0)", num, key=key))
    y[10:300] = np.nan
    r = gj.regress(y, gj.regression.trend(np.arange(num)), "WN", rate=1.0, unit="rad/s", name="gyro_x")
    figure = r.plot()
    assert_shows(figure, gj.plotting.regression_data(r))
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert "gyro_x [rad/s]" in labels
    assert "residual [rad/s]" in labels
    assert any("wavelet variance" in label for label in labels)
    assert "290 missing" in figure.axes[0].get_title()


def test_masks_of_every_kind_are_one():
    rng = np.random.default_rng(0)
    y, t, present = rng.standard_normal(400), np.arange(400.0), rng.random(400) > 0.1
    by_nan = gj.regress(np.where(present, y, np.nan), gj.regression.trend(t), "WN", rate=1.0)
    by_argument = gj.regress(y, gj.regression.trend(t), "WN", rate=1.0, present=present)
    masked = gj.regress(np.ma.masked_array(y, ~present), gj.regression.trend(t), "WN", rate=1.0)
    assert repr(by_nan) == repr(by_argument) == repr(masked)
    assert f"{np.sum(~present)} missing" in repr(by_nan)


# -- regressors and bad input ----------------------------------------------------------------------------------------


def test_columns_have_names_and_units():
    t = np.arange(100) / 10.0
    assert gj.regression.trend(t)["trend"].unit == "s"
    assert list(gj.regression.seasonal(t, 4.0, 2)) == ["cos 4 s", "sin 4 s", "cos 2 s", "sin 2 s"]
    np.testing.assert_allclose(gj.regression.seasonal(t, 4.0)["sin 4 s"].values, np.sin(2 * np.pi * t / 4))
    np.testing.assert_array_equal(gj.regression.step(t, 5.0)["step 5 s"].values, t >= 5)
    powers = gj.regression.polynomial(t, 2, name="T", unit="K")
    assert [c.unit for c in powers.values()] == ["K", "K^2"]
    np.testing.assert_allclose(powers["T^2"].values, (t - t.mean()) ** 2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: gj.regression.seasonal(t, 0.0), "period must be positive"),
        (lambda t: gj.regression.seasonal(t, 10.0, 0), "harmonics must be an integer of 1"),
        (lambda t: gj.regression.step(t, 0.0), "from 0 s to 99 s"),
        (lambda t: gj.regression.step(t, 100.0), "outside of it"),
        (lambda t: gj.regression.polynomial(t, 0, name="T", unit="K"), "degree must be an integer of 1"),
        (lambda t: gj.regression.trend(t[:, None]), r"shape \(100, 1\)"),
        (lambda t: gj.regression.trend(["a", "b"]), "real numbers"),
    ],
)
def test_regressors_refuse(call, message):
    with pytest.raises(ValueError, match=message):
        call(np.arange(100.0))


T = np.arange(100.0)
Y = np.random.default_rng(5).standard_normal(100)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rate": None}, "rate is missing"),
        ({"rate": -1.0}, "positive number of Hz"),
        ({"time": T / 2}, "half a step off at index 1"),
        ({"time": T[1:]}, r"shape \(99,\)"),
        ({"time": np.where(T == 7, np.nan, T)}, "index 7"),
        ({"y": np.full(100, np.nan)}, "All 100 samples are missing"),
        ({"present": np.zeros(100, dtype=bool)}, "All 100 samples are missing"),
        ({"present": np.ones(100)}, "present must be True or False"),
        ({"present": np.ones(99, dtype=bool)}, "present must be True or False"),
        ({"y": np.where(T == 3, np.inf, Y)}, "infinite samples, the first at index 3"),
        ({"y": Y[:, None]}, r"shape \(100, 1\)"),
        ({"y": Y.astype(str)}, "real numbers"),
        ({"y": np.where(T < 2, Y, np.nan)}, "has 2 samples"),
        ({"y": 3 * T + 1}, "describe the record exactly"),
        ({"regressors": {"temperature": np.full(100, 20.0)}}, "'temperature' is constant, as the intercept is"),
        ({"regressors": {"heater": np.zeros(100)}, "intercept": False}, "'heater' is zero"),
        ({"regressors": {"a": T, "b": T**2, "c": 2 * T + 1}}, "intercept, a, c are collinear"),
        ({"regressors": {"a": T[:-1]}}, "'a' has 99 values, and the record has 100"),
        ({"regressors": {"a": np.where(T == 9, np.nan, T)}}, "'a' holds 1 values that are NaN.*index 9"),
        ({"regressors": {"intercept": T}}, "intercept=True adds one"),
        ({"regressors": {}, "intercept": False}, "nothing to estimate"),
        (
            {"regressors": {f"r{k}": np.cos(k * T) for k in range(1, 8)}, "present": T < 6},
            "6 samples for 8 coefficients",
        ),
        ({"regressors": gj.regression.step(T, 50.0), "present": T < 50}, "step 50 s' is zero"),
        ({"model": "WN + DR"}, "put trend"),
        ({"model": "WN + RW + 3*GM"}, "free parameters"),
        ({"unit": "deg/s"}, "deg/s"),
        ({"level": 95.0}, "between 0 and 1"),
    ],
)
def test_bad_input_is_named(changes, message):
    arguments = {"y": Y, "regressors": gj.regression.trend(T), "model": "WN", "rate": 1.0, **changes}
    with pytest.raises(ValueError, match=message):
        gj.regress(arguments.pop("y"), arguments.pop("regressors"), arguments.pop("model"), **arguments)


def test_a_regressor_may_be_unknown_where_the_record_is():
    temperature = np.where(T == 9, np.nan, T)
    r = gj.regress(
        np.where(T == 9, np.nan, Y), {"temperature": gj.regression.Regressor(temperature, "K")}, "WN", rate=1.0
    )
    assert r.num_missing == 1
    assert np.isfinite(r["temperature"].value)


def test_several_channels_are_refused():
    two = gj.Recording.from_array(np.column_stack([Y, Y]), rate=1.0, units="rad/s")
    with pytest.raises(ValueError, match="one channel at a time"):
        gj.regress(two, gj.regression.trend(T), "WN")
