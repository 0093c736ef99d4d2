"""The state-space form of a process has the second moments that define the process, see `cases`."""

import jax
import numpy as np
import pytest
from gmwm.cases import rows, sample_covariance, sample_mean

from gmwm_jax.processes.band_flicker import FLK
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN


def second_moments(form, num):
    """E(y_s y_t), s, t = 1..num, by propagating the covariance of the chain, one step at a time."""
    moments = np.zeros((num, num))
    h, P = form.readout, form.initial
    for s in range(num):
        carried = P
        for t in range(s, num):
            moments[s, t] = moments[t, s] = h @ carried @ h
            carried = carried @ form.transition.T
        moments[s, s] += form.white
        P = form.transition @ P @ form.transition.T + form.driving
    return moments


STATELESS = (FGN, BI, FLK)


@pytest.mark.parametrize("case", [row for row in rows() if row.values[0].cls not in STATELESS])
def test_second_moments_are_those_of_the_process(case):
    num = 12
    for values in case.parameters:
        form = jax.tree.map(np.asarray, case.cls(*values).state_space())
        mean = sample_mean(case, values, num)
        expected = sample_covariance(case, values, num) + np.outer(mean, mean)
        np.testing.assert_allclose(second_moments(form, num), expected, rtol=1e-11, atol=1e-13 * expected.max())


@pytest.mark.parametrize("case", [row for row in rows() if row.values[0].cls in STATELESS])
def test_what_has_no_state(case):
    assert case.cls(*case.parameters[0]).state_space() is None


def test_the_form_differentiates():
    slope = jax.grad(lambda omega: DR(omega).state_space().initial[1, 1])(3.0)
    assert slope == 6.0


@pytest.mark.parametrize("case", rows())
def test_a_process_without_values_says_so(case):
    with pytest.raises(ValueError, match="has no value for"):
        case.cls().state_space()
