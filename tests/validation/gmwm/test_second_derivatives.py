"""Second derivatives of estimates, whose programs take long to compile."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import MEDIUM, TRUTH

import gmwm_jax as gj


@pytest.mark.usefixtures("quick_compilation")
def test_second_derivatives_are_differences_of_the_first():
    """Along one direction: forward over forward."""
    wv = gj.wavelet_variance(gj.simulate(TRUTH, MEDIUM, key=jax.random.key(1)))
    direction = jnp.asarray(np.random.default_rng(0).normal(size=wv.num_scales) * wv.variance)

    def estimates(nu):
        found = gj.fitting.estimate(replace(wv, variance=nu), "WN + GM")
        return jnp.stack(list(found.parameters.values()))

    @jax.jit
    def along(nu):
        return jax.jvp(estimates, (nu,), (direction,))[1]

    nu = jnp.asarray(wv.variance)
    _, second = jax.jit(lambda nu: jax.jvp(along, (nu,), (direction,)))(nu)
    h = 1e-4
    np.testing.assert_allclose(second, (along(nu + h * direction) - along(nu - h * direction)) / (2 * h), rtol=1e-5)
