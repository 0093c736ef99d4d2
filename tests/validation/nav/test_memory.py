"""Memory of a gradient through a run."""

import jax
import jax.numpy as jnp
import pytest
from nav import setups

import gmwm_jax as gj
import nav_jax as nj

pytestmark = pytest.mark.usefixtures("quick_compilation")


def quick(function):
    """Compiled in a third of the time, for one call."""
    options = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
    return jax.jit(function, compiler_options=options)


def test_reverse_mode_keeps_segments_not_steps():
    """Memory of a gradient over 80 s: a segment (1 s) keeps its carry, its steps live one segment at a time.

    If every step kept only its covariance and state, 4000 steps of 16 runs would take 47 MB; a quarter is allowed
    (6.7 MB were seen for 10 s and 8.5 MB for 80 s).
    """

    e = nj.filter.prepare(nj.Scenario(nj.motions.lemniscate(80.0, 50.0), setups.aiding()), rate=50.0)
    errors = nj.ImuErrors(gj.WN(1e-5), gj.WN(1e-6), 50.0)
    inputs = jax.eval_shape(lambda: nj.filter.draw_inputs(e, errors, nj.filter.run_keys(jax.random.key(3), 0, 16)))

    def of(white, inputs):
        believed = nj.ImuErrors(gj.WN(white), gj.WN(1e-6), 50.0)
        return jnp.mean(nj.filter.run_filter(e, believed, inputs).judgement.error[-1, :3] ** 2)

    compiled = quick(jax.grad(of)).lower(jnp.asarray(1e-5), inputs).compile()
    assert compiled.memory_analysis().temp_size_in_bytes < 4000 * 16 * (81 + 10) * 8 / 4
