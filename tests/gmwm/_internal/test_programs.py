"""The programs of bounded functions are bounded: beyond a number they are forgotten, before it none, others never."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import CountTraces

from gmwm_jax._internal import programs
from gmwm_jax._internal.compiling import compiled_quickly, compiled_sooner


@pytest.fixture(autouse=True)
def no_bounded_functions(monkeypatch):
    """Those of the packages keep what other tests have compiled."""
    monkeypatch.setattr(programs, "_bounded", [])
    monkeypatch.setattr(programs, "MAX_PROGRAMS", 3)


def counted(compile=jax.jit):
    counter = CountTraces(lambda x: 2.0 * x)
    return programs.bounded(compile(counter)), counter


@pytest.mark.parametrize("compile", [jax.jit, eqx.filter_jit, compiled_quickly(), compiled_sooner])
def test_up_to_the_limit_nothing_is_forgotten_and_beyond_it_all(compile):
    double, counter = counted(compile)
    for size in (1, 2, 3):
        double(np.ones(size))
    assert programs.num_programs() == 3
    programs.bound_programs()
    for size in (1, 2, 3):
        np.testing.assert_array_equal(double(np.ones(size)), 2.0)
    assert counter.count == 3
    double(np.ones(4))
    programs.bound_programs()
    assert programs.num_programs() == 0
    np.testing.assert_array_equal(double(np.ones(2)), 2.0)  # compiled again when it is called
    assert counter.count == 5


def test_functions_of_others_are_left_alone():
    double, _ = counted()
    counter = CountTraces(lambda x: x + 1.0)
    of_the_user = jax.jit(counter)
    for size in range(1, 6):
        double(np.ones(size))
        of_the_user(np.ones(size))
    programs.bound_programs()
    assert programs.num_programs() == 0
    for size in range(1, 6):
        of_the_user(np.ones(size))
    assert counter.count == 5


def test_inside_a_trace():
    """A program that is being traced is not disturbed, nor its derivative."""
    double, _ = counted()
    for size in range(1, 6):
        double(np.ones(size))

    def outer(x):
        y = double(x)
        programs.bound_programs()
        return jnp.sum(double(y) ** 2)

    x = jnp.arange(3.0)
    np.testing.assert_allclose(jax.jit(jax.grad(outer))(x), 32.0 * x, rtol=1e-15)
