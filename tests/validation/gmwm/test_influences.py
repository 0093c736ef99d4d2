"""Influences where weights go with the data: a program of their own, and a large one."""

import jax
import numpy as np
import pytest

import gmwm_jax as gj

pytestmark = pytest.mark.usefixtures("quick_compilation")

MODEL = "WN + GM"


def test_weights_from_a_first_fit_go_with_the_data():
    """Estimates of a variance go with the scale of the data, others do not."""
    x = gj.simulate(gj.WN(1.0) + gj.GM(0.03, 0.2), 20_000, key=jax.random.key(1))
    wv = gj.wavelet_variance(np.asarray(x), rate=20.0)
    found = gj.fitting.influence(wv, MODEL, weights="two-step")
    np.testing.assert_allclose(found.elasticities.sum(axis=1), [1.0, 0.0, 1.0], atol=1e-7)
    fitted = gj.fit(wv, MODEL, weights="two-step").model
    np.testing.assert_allclose(found.values, [v for p in fitted.processes for v in p.values], rtol=1e-7)
