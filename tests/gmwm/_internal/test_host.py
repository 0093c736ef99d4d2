"""Single numbers on the host: NumPy's, and as quiet as JAX about infinities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax._internal.host import SOONER, _compiled, compiled_quickly, compiled_sooner, namespace


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


def test_what_is_compiled_quickly_is_a_part_of_what_is_traced():
    """Also where all that it is given is known: a program inside of another has no options of its own."""

    @compiled_quickly(static_argnums=(1,))
    def power(x, n):
        return jnp.sum(x) ** n

    x = np.array([1.0, 2.0])
    assert float(power(x, 2)) == 9.0
    assert power._cache_size() == 1
    assert float(jax.jit(lambda y: y * power(x, 2))(2.0)) == 18.0
    assert float(jax.grad(lambda y: jax.jit(lambda z: power(z * x, 2) + power(x, 2))(y))(2.0)) == 36.0
    np.testing.assert_array_equal(jax.vmap(lambda y: power(x, 2) * power(y * x, 1))(x), [27.0, 54.0])


def test_what_is_compiled_sooner_is_a_part_of_what_is_traced_and_compiled_once_there():
    traced = []

    @compiled_sooner
    def scaled(x, *, by):
        traced.append(1)
        return by["factor"] * x

    x, by = np.array([1.0, 2.0]), {"factor": 3.0, "name": "a text is no array"}
    for _ in range(2):
        np.testing.assert_array_equal(scaled(x, by=by), 3 * x)
    assert scaled._cache_size() == len(traced) == 1
    for _ in range(2):
        np.testing.assert_array_equal(jax.vmap(jax.grad(lambda y: scaled(y, by=by)))(x), [3.0, 3.0])
    assert float(jax.jit(lambda y: scaled(y, by=by))(2.0)) == 6.0
    scaled.clear_cache()
    assert scaled._cache_size() == 0


def test_options_that_this_version_of_xla_lacks_are_left_out():
    """They make it faster and change nothing else, so that a later version may do without them; other errors stay."""

    def doubled(x):
        return 2.0 * x

    double = _compiled(doubled, doubled, lambda **how: jax.jit(doubled, **how), SOONER | {"xla_of_another_age": True})
    for _ in range(2):
        np.testing.assert_array_equal(double(np.ones(3)), 2.0)
    assert double._cache_size() == 1
    refuse = _compiled(doubled, doubled, lambda **how: jax.jit(doubled, **how), {"xla_backend_optimization_level": "x"})
    with pytest.raises(jax.errors.JaxRuntimeError, match="not a valid"):
        refuse(np.ones(3))
