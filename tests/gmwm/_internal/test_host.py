"""Single numbers on the host: NumPy's, and as quiet as JAX about infinities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax._internal.host import namespace


@pytest.mark.parametrize(("name", "value"), [("log", 0.0), ("exp", 1000.0), ("arctanh", 1.0), ("sqrt", -1.0)])
def test_numpy_says_of_infinities_what_jax_says(name, value):
    """Warnings are errors here, so that a word of NumPy would fail."""
    ours, theirs = getattr(namespace(value), name)(value), getattr(jnp, name)(jnp.asarray(value))
    np.testing.assert_array_equal(ours, theirs)
    assert isinstance(namespace(np.zeros(2)).exp(np.zeros(2)), np.ndarray)


def test_one_value_of_jax_makes_it_jax():
    assert namespace(1.0, jnp.zeros(2)) is jnp
    assert isinstance(jax.jit(lambda x: namespace(x).log(x))(1.0), jax.Array)


def test_a_model_without_amplitude_has_its_place_on_the_line():
    """What a fit has pushed to zero lies at -inf, and nobody is warned of it."""
    model = gj.WN(sigma2=0.0) + gj.GM(beta=0.1, variance=0.0)
    np.testing.assert_array_equal(model.unconstrained(), [-np.inf, np.log(0.1), -np.inf])
