"""What is compiled by itself, in less time, is a part of what is traced."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from gmwm_jax._internal.compiling import SOONER, _compiled, compiled_quickly, compiled_sooner


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
