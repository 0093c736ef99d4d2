"""Derivatives of every process by its parameters, forward and reverse: of its laws in 160 digits, and of its draws."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.cases import MP, derivative_rows, exact, row_of, rows

from gmwm_jax.processes.base import Composite
from gmwm_jax.processes.simulation import simulate

pytestmark = pytest.mark.usefixtures("quick_compilation")


def both_ways(function):
    """Forward and reverse derivatives by the first argument, in one program."""
    return jax.jit(lambda *arguments: (jax.jacfwd(function)(*arguments), jax.jacrev(function)(*arguments)))


def differentiable(cls):
    """The wavelet variance as a function of the parameters."""
    return lambda values, tau: cls(*values).wavelet_variance(tau)


@cache
def numerical(kind, values, index, tau, order):
    """A derivative of the textbook formula by a difference quotient at 160 digits, and what an error is relative to.

    That is the derivative, or nu^2/parameter^order where that is larger (GM has none left at beta = 50).
    """
    case = row_of(kind)

    def of_one(x):
        parameters = exact(values)
        parameters[index] = x
        return case.closed_form(*parameters, tau)

    reference = MP.diff(of_one, MP.mpf(values[index]), order)
    return reference, abs(reference) + case.closed_form(*exact(values), tau) / (abs(values[index]) or 1.0) ** order


def derivative_error(case, values, taus, seen, index, order):
    worst = 0.0
    for tau, value in zip(taus, seen, strict=True):
        reference, scale = numerical(case.cls.kind, values, index, tau, order)
        worst = max(worst, float(abs(MP.mpf(float(value)) - reference) / scale))
    return worst


@pytest.mark.parametrize("case", rows())
def test_gradient_forward_reverse_and_numerical(case):
    taus = [2**j for j in (1, 2, 3, 5, 8, 12, 18, 24)]
    derivatives = both_ways(differentiable(case.cls))
    for values in case.parameters:
        f, r = map(np.asarray, derivatives(jnp.asarray(values), jnp.asarray(taus, dtype=float)))
        assert np.all(np.isfinite(f))
        assert np.all(np.isfinite(r))
        for index in range(len(values)):
            assert derivative_error(case, values, taus, f[:, index], index, 1) < 1e-9, values
            assert derivative_error(case, values, taus, r[:, index], index, 1) < 1e-9, values


@pytest.mark.parametrize("case", derivative_rows())
def test_second_derivatives(case):
    taus = [2**j for j in (1, 2, 3, 5, 8, 12, 18, 24)]
    second = jax.jit(jax.jacfwd(jax.jacrev(differentiable(case.cls))))
    for values in case.parameters:
        hessian = np.asarray(second(jnp.asarray(values), jnp.asarray(taus, dtype=float)))
        assert np.all(np.isfinite(hessian)), values
        if values[0] < -0.99:
            continue  # 1/(1 + phi)^3: finite, and no more is asked of an alternating process
        for index in range(len(values)):
            error = derivative_error(case, values, taus, hessian[:, index, index], index, 2)
            assert error < case.second_derivatives_rtol, values


@pytest.mark.parametrize("case", rows(stationary=True))
def test_gradient_of_the_autocovariance(case):
    """At phi = 0 as well, where the derivative of phi^0 must not become 0/0."""
    lags = jnp.arange(6.0)

    def autocovariance(v):
        return case.cls(*v).autocovariance(lags)

    derivatives = both_ways(autocovariance)
    for values in case.parameters:
        f, r = derivatives(jnp.asarray(values))
        np.testing.assert_allclose(f, r, rtol=1e-12, atol=1e-14, err_msg=str(values))
        for index in range(len(values)):

            def of_one(x, lag, values=values, index=index):
                parameters = exact(values)
                parameters[index] = x
                return case.autocovariance(*parameters, 6)[lag]

            expected = [float(MP.diff(lambda x, lag=lag: of_one(x, lag), MP.mpf(values[index]))) for lag in range(6)]
            np.testing.assert_allclose(f[:, index], expected, rtol=1e-10, atol=1e-14, err_msg=str(values))


@pytest.mark.parametrize("case", rows())
def test_differentiable_in_parameters(case, key):
    """Forward = reverse = central difference of one record, at a fixed key."""
    values = np.array({"AR1": (0.7, 1.7), "GM": (0.3, 0.6)}.get(case.cls.kind, case.parameters[0]))

    def record(v):
        return simulate(Composite((case.cls(*v),)), 40, key=key)

    forward, reverse = jax.jit(lambda v: (jax.jacfwd(record)(v), jax.jacrev(record)(v)))(values)
    # the root of MAT52's 3 x 3 driving noise has a condition of 1e4
    np.testing.assert_allclose(forward, reverse, rtol=1e-10, atol=1e-11 if case.cls.kind == "MAT52" else 1e-12)
    for i in range(len(values)):
        h = np.zeros(len(values))
        h[i] = 1e-6 * values[i]
        above, below = (np.asarray(record(jnp.asarray(v))) for v in (values + h, values - h))
        difference = (above - below) / (2 * h[i])
        np.testing.assert_allclose(forward[:, i], difference, rtol=1e-6, atol=1e-7 * np.abs(difference).max())
