"""Derivatives of runs, forward and backward, against central differences with the same random numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj


def quick(function):
    """Compiled in a third of the time, for one call."""
    options = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
    return jax.jit(function, compiler_options=options)


@pytest.mark.slow
def test_exact_start_has_finite_derivatives():
    """Zero variances: of the start, and of states that start from zero."""
    e = nj.filter.prepare(nj.Scenario(nj.motions.lemniscate(2.0, setups.RATE), setups.aiding()), rate=setups.RATE)
    keys = nj.filter.run_keys(jax.random.key(3), 0, 2)

    def of(white):
        errors = nj.ImuErrors(gj.WN(white) + gj.AR1(0.99, white), gj.WN(1e-6), setups.RATE, start="zero")
        judged = nj.filter.run_filter(e, errors, nj.filter.draw_inputs(e, errors, keys)).judgement
        return jnp.mean(judged.error[-1, :3] ** 2) + jnp.mean(judged.sd[-1, :9])

    value, slope = quick(lambda x: jax.jvp(of, (x,), (jnp.ones(()),)))(jnp.asarray(1e-5))
    assert value > 0
    assert np.isfinite(slope)
    assert slope != 0
