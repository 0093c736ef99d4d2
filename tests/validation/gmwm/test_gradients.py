"""Derivatives of the pure estimator on every process: against central differences of refits, and vmap against a loop.

Moments are those of a model, perturbed by some percent so that residuals are not zero, with the intervals of a record.
Models whose estimate is at a boundary there have one-sided derivatives, and are left out by name, not by chance.
"""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax.processes.registry import as_model

pytestmark = pytest.mark.usefixtures("quick_compilation")

NUM_SAMPLES = 1_000_000
WITH_WHITE_NOISE = {
    "WN": gj.WN(1.0),
    "QN": gj.QN(2.0) + gj.WN(0.5),
    "RW": gj.RW(1e-5) + gj.WN(1.0),
    "DR": gj.DR(1e-4) + gj.WN(1.0),
    "AR1": gj.AR1(0.98, 0.01) + gj.WN(1.0),
    "GM": gj.GM(0.01, 0.5) + gj.WN(1.0),
    "MAT32": gj.MAT32(0.01, 0.5) + gj.WN(1.0),
    "MAT52": gj.MAT52(0.01, 0.5) + gj.WN(1.0),
    "AR(2)": gj.AR(2)(1.5, -0.8, 1.0),
    "MA(1)": gj.MA(1)(0.5, 1.3),
    "ARMA(2,1)": gj.ARMA(2, 1)(1.5, -0.8, 0.4, 1.0),
    "FGN": gj.FGN(0.75, 1.3),
    "BI": gj.BI(0.1) + gj.WN(1.0),
    "FLK": gj.FLK(0.013, 0.3) + gj.WN(1.0),
    "SIN": gj.SIN(0.01, 0.5) + gj.WN(1.0),
    "WN + GM": gj.WN(1.0) + gj.GM(0.01, 0.5),
    "WN + RW + 2*GM": gj.WN(4.9e-5) + gj.RW(4.8e-13) + gj.GM(0.05, 1.2e-6) + gj.GM(1e-3, 4e-7),
    "QN + WN + RW": gj.QN(1.0) + gj.WN(0.1) + gj.RW(1e-6),
    "RW + DR + GM": gj.RW(1e-6) + gj.DR(1e-4) + gj.GM(0.3, 1.0),
}
"""The processes of `cases`, with white noise beside them where they may have it, and sums of them."""
LINEAR = ("WN", "QN", "RW", "DR", "BI", "QN + WN + RW")
"""Nothing but amplitudes."""
LESS_KNOWN = {"ARMA(2,1)": 2e-5, "SIN": 1e-5, "WN + RW + 2*GM": 1e-5}
"""Estimates so bent over the moments that only steps serve at which the rounding of refits shows."""


def free(model):
    """Its kinds, without values."""
    return " + ".join(p.kind for p in as_model(model).processes)


@cache
def measured(name):
    """Moments of a model that no model fits exactly."""
    model = WITH_WHITE_NOISE[name]
    J = gj.variance.wavelet_variance(np.arange(NUM_SAMPLES) % 7.0).num_scales
    tau = 2.0 ** np.arange(1, J + 1)
    nu = np.asarray(model.wavelet_variance(tau))
    dof = np.maximum((NUM_SAMPLES - tau + 1) / tau, 1.0)
    nu = nu * np.exp(0.3 * np.random.default_rng(7).normal(size=J) / np.sqrt(dof))
    width = 1.96 * np.sqrt(2 / dof)
    return gj.variance.WaveletVariance.from_table(tau, nu, nu / (1 + width), nu * (1 + width), num_samples=NUM_SAMPLES)


def vector(found):
    return jnp.stack([jnp.asarray(v) for v in found.parameters.values()])


def of_variance(name):
    wv, model = measured(name), free(WITH_WHITE_NOISE[name])
    return lambda nu: vector(gj.fitting.estimate(replace(wv, variance=nu), model))


@cache
def with_jacobian(name):
    """One program for the derivatives and for the refits beside them: its compilation is most of the time."""

    def twice(nu):
        found = of_variance(name)(nu)
        return found, found

    return jax.jit(jax.jacfwd(twice, has_aux=True))


def estimates(name, nu):
    return np.asarray(with_jacobian(name)(jnp.asarray(nu))[1])


def difference(function, x, k):
    """x_k d/dx_k from both sides, to the sixth power of the step; of the steps that where it hardly depends on it.

    Refits are known to 1e-9 or so, the objective being flat at its minimum: a short step shows that, a long one the
    curvature of the estimates, and each model has its own in between (Ridders 1982).
    """

    def central(h):
        d = np.zeros_like(x)
        d[k] = h * x[k]
        return (function(x + d) - function(x - d)) / (2 * h)

    found = [(64 * central(h / 4) - 20 * central(h / 2) + central(h)) / 45 for h in (0.05, 0.03, 0.015, 0.007, 0.003)]
    steadiest = np.argmin(np.abs(np.diff(found, axis=0)), axis=0)
    return np.take_along_axis(np.array(found), steadiest[None], axis=0)[0]


def test_all_processes_are_there():
    kinds = {p.kind for model in WITH_WHITE_NOISE.values() for p in as_model(model).processes}
    assert kinds == {"WN", "QN", "RW", "DR", "AR1", "GM", "MAT32", "MAT52", "AR(2)", "MA(1)", "ARMA(2,1)", "FGN", "BI",
                     "FLK", "SIN"}  # fmt: skip


@pytest.mark.parametrize("name", WITH_WHITE_NOISE)
def test_derivatives_are_those_of_refits(name):
    """To 1e-6 of the largest elasticity of each parameter: beside it a scale that hardly counts is rounding."""
    wv = measured(name)
    found = gj.fitting.estimate(wv, free(WITH_WHITE_NOISE[name]))
    assert bool(found.converged)
    assert not np.any(found.at_zero)
    J = np.asarray(with_jacobian(name)(jnp.asarray(wv.variance))[0]) * wv.variance
    slopes = [difference(lambda nu: estimates(name, nu), wv.variance, k) for k in range(wv.num_scales)]
    worst = np.max(np.abs(J - np.stack(slopes, axis=1)) / np.abs(J).max(axis=1, keepdims=True))
    assert worst < LESS_KNOWN.get(name, 1e-6)


@pytest.mark.parametrize("name", WITH_WHITE_NOISE)
def test_vmap_is_the_loop(name):
    """To rounding where there is nothing to search for.

    Else to what a minimum can be known to: batched programs round otherwise, and where the slope of the objective is
    rounding, the search has nothing to go by.
    """
    wv = measured(name)
    batch = wv.variance * np.exp(1e-3 * np.random.default_rng(2).normal(size=(6, wv.num_scales)))
    loop = np.stack([estimates(name, nu) for nu in batch])
    together = np.asarray(jax.jit(jax.vmap(of_variance(name)))(batch))
    np.testing.assert_allclose(together, loop, rtol=1e-11 if name in LINEAR else 2e-7)
