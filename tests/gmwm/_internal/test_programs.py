"""The programs that a process holds are bounded: beyond a number all are forgotten, and before it none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import CountTraces

from gmwm_jax._internal import programs


@pytest.fixture(autouse=True)
def begin_without_programs():
    """What other tests compiled is forgotten, and what they still hold is none of ours."""
    before = programs.MAX_PROGRAMS, programs._stayed
    programs.MAX_PROGRAMS, programs._stayed = -1, 0
    programs.bound_programs()
    yield
    programs.MAX_PROGRAMS, programs._stayed = before


def counted():
    counter = CountTraces(lambda x: 2.0 * x)
    return jax.jit(counter), counter


def test_up_to_the_limit_nothing_is_forgotten():
    double, counter = counted()
    for size in (1, 2, 3):
        double(np.ones(size))
    programs.MAX_PROGRAMS = programs.num_programs() - programs._stayed
    programs.bound_programs()
    for size in (1, 2, 3):
        np.testing.assert_array_equal(double(np.ones(size)), 2.0)
    assert counter.count == 3


def test_beyond_it_all_are_forgotten_and_compiled_again_when_called():
    double, counter = counted()
    left = programs.num_programs()
    for size in (1, 2, 3):
        double(np.ones(size))
    assert programs.num_programs() == left + 3
    programs.MAX_PROGRAMS = 2
    programs.bound_programs()
    assert programs.num_programs() <= left
    np.testing.assert_array_equal(double(np.ones(2)), 2.0)
    assert counter.count == 4


def test_programs_that_others_hold_do_not_count():
    """Or each scenario would forget the programs of the last."""
    double, counter = counted()
    held = [jax.jit(lambda x, i=i: x + i).lower(jnp.ones(())).compile() for i in range(1, 6)]
    programs.MAX_PROGRAMS = 3
    programs.bound_programs()
    assert programs.num_programs() >= len(held)
    double(np.ones(1))
    programs.bound_programs()
    double(np.ones(1))
    assert counter.count == 1
    assert [float(h(jnp.ones(()))) for h in held] == [2.0, 3.0, 4.0, 5.0, 6.0]


def test_inside_a_trace():
    """A program that is being traced is not disturbed, nor its derivative."""
    double, _ = counted()

    def outer(x):
        y = double(x)
        programs.bound_programs()
        return jnp.sum(double(y) ** 2)

    x = jnp.arange(3.0)
    np.testing.assert_allclose(jax.jit(jax.grad(outer))(x), 32.0 * x, rtol=1e-15)
