"""Processes of which one law is given, where the numbers are hard: long memories, resonances, derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gmwm.alone import LAWS, TAU, alone, difference_of_covariances

import gmwm_jax as gj

pytestmark = pytest.mark.usefixtures("quick_compilation")


@pytest.mark.parametrize(
    ("process", "law", "stationary", "ringing"),
    [
        (gj.RW(2.0), "unit_psd", False, 0.0),
        (gj.BI(1.0), "unit_psd", False, 0.0),
        (gj.FGN(0.8, 1.0), "unit_psd", True, 0.0),
        (gj.FGN(0.8, 1.0), "unit_autocovariance", True, 0.0),
        (gj.FGN(0.8, 1.0), "unit_wavelet_variance", True, 0.0),
        (gj.AR1(-0.9, 1.0), "unit_psd", True, 0.0),
        (gj.AR1(-0.9, 1.0), "unit_autocovariance", True, 0.0),
        (gj.MAT32(0.001, 1.0), "unit_psd", True, 0.0),
        (gj.AR(2)(1.5, -0.8, 1.0), "unit_psd", True, 5.0),
    ],
    ids=repr,
)
def test_long_memories_alternation_and_resonances(process, law, stationary, ringing):
    own = alone(type(process), law, stationary=stationary, ringing=ringing)(*process.values)
    tau = TAU[:20]
    np.testing.assert_allclose(own.wavelet_variance(tau), process.wavelet_variance(tau), rtol=1e-7)
    assert difference_of_covariances(own, process) < 1e-6


@pytest.mark.parametrize("law", LAWS)
def test_it_can_be_differentiated_and_mapped(law):
    """Values, forward and reverse derivatives, mapped over two processes, in one program."""

    def quantities(cls):
        def of(values):
            p = cls(*values)
            covariance = gj.variance.wv_covariance(p, 64)
            return jnp.concatenate([p.wavelet_variance(TAU[:6]), jnp.ravel(covariance), p.autocovariance([0.0, 300.0])])

        def all_of(values):
            return of(values), jax.jacfwd(of)(values), jax.grad(lambda v: jnp.sum(jnp.cos(of(v))))(values)

        return jax.jit(jax.vmap(all_of))

    batch = jnp.array([[0.02, 1.3], [0.3, 0.7]])
    ours, theirs = (quantities(cls)(batch) for cls in (alone(gj.GM, law), gj.GM))
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-8)
