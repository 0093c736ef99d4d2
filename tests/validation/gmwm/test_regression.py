"""Regression with dependent errors: bias and coverage."""

import jax
import numpy as np
import pytest
from helpers import SIGMAS, assert_mean

import gmwm_jax as gj


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


@pytest.mark.parametrize("model", ["WN(sigma2=1.0) + GM(beta=0.05, variance=1.0)", "WN(sigma2=1.0) + RW(gamma2=0.01)"])
@pytest.mark.parametrize("missing", [0.0, 0.15])
def test_bias_and_coverage(model, missing, key, judge):
    """Intervals of 95 % cover; those of ordinary least squares that takes the noise as white do not.

    Of each record the share of its seven coefficients that are covered counts as one draw, so that their correlation
    enters the band of 4.5 standard errors, about 9 %. The fitted noise is unbiased, too: the mean over the records of
    the variance of the white noise and of a step of the random walk, or the level of the GM at its fastest.
    """
    num, replicates = 1500, 30
    regressors, X, _, rng = seasonal_case(num)
    truth = np.array([5.0, 1e-2, 2.0, -1.0, 0.5, 0.3, 3.0])
    z, covered, covered_naive, noise = [], [], [], []
    kinds = " + ".join(p.kind for p in gj.parse_model(model).processes)
    for one in jax.random.split(key, replicates):
        y = X @ truth + np.asarray(gj.simulate(model, num, key=one))
        present = rng.random(num) >= missing
        r = gj.regress(y, regressors, kinds, rate=2.0, present=present)
        assert r.converged
        z.append((r.coefficients.estimates - truth) / r.coefficients.standard_errors)
        covered.append(np.mean([c.ci_low < b < c.ci_high for c, b in zip(r.coefficients.values(), truth, strict=True)]))
        A, b = X[present], y[present]
        residual = b - A @ r.ols.estimates
        white = np.sqrt(residual @ residual / (len(b) - 7) * np.diag(np.linalg.inv(A.T @ A)))
        covered_naive.append(np.mean(np.abs(r.ols.estimates - truth) < 1.96 * white))
        noise.append([float(p.amplitude) for p in r.noise.model.processes])
    bias = assert_mean(z, np.zeros(7))
    judge("bias of coefficients, in standard errors", bias, 0, SIGMAS, num_draws=replicates)
    off = assert_mean(covered, 0.95)
    judge("coverage off 95 %, in standard errors", off, 0, SIGMAS, num_draws=replicates)
    naive = np.mean(covered_naive) + SIGMAS * np.std(covered_naive) / np.sqrt(replicates)
    judge("coverage of naive intervals and its band", naive, 0, 0.8, num_draws=replicates)
    bias = assert_mean(noise, [float(p.amplitude) for p in gj.parse_model(model).processes])
    judge("bias of the noise, in standard errors", bias, 0, SIGMAS, num_draws=replicates)
