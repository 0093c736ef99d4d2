"""Programs with LAPACK of batches: as many at a time as XLA's threads allow, and inside of others as they are."""

import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import pytest

from gmwm_jax._internal import xla_threads
from gmwm_jax._internal.xla_threads import few_at_a_time, have_enough_threads


@pytest.fixture
def threads(monkeypatch):
    """Function that says how many XLA has."""

    def has(count):
        monkeypatch.setenv("NPROC", str(count))
        xla_threads._turns.cache_clear()

    yield has
    xla_threads._turns.cache_clear()


@pytest.mark.parametrize(("count", "at_a_time"), [(1, 1), (2, 1), (4, 1), (8, 2), (16, 4)])
def test_as_many_run_at_a_time_as_threads_allow(threads, count, at_a_time):
    threads(count)
    square, lock, running, most = jax.jit(jnp.square), threading.Lock(), 0, 0

    def slow(x):
        nonlocal running, most
        with lock:
            running += 1
            most = max(most, running)
        time.sleep(0.05)
        with lock:
            running -= 1
        return square(x)

    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(few_at_a_time(slow), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])) == [1, 4, 9, 16, 25, 36]
    assert most == at_a_time


def test_inside_of_another_program_it_is_traced(threads):
    """One that is called in one that runs would wait for the turn of the first for ever."""
    threads(2)
    inner = few_at_a_time(jax.jit(lambda x: x * 2.0))
    outer = few_at_a_time(jax.jit(lambda x: inner(x) + inner(3.0)))
    assert outer(1.0) == 8.0
    assert jax.jit(jax.vmap(outer))(jnp.arange(2.0)).tolist() == [6.0, 8.0]
    assert jax.grad(outer)(1.0) == 2.0
    assert outer._cache_size() == 1


def test_an_error_gives_the_turn_back(threads):
    threads(2)

    @few_at_a_time
    @jax.jit
    def wrong(x):
        raise ArithmeticError(f"of {x}")

    for _ in range(3):
        with pytest.raises(ArithmeticError, match="of"):
            wrong(1.0)


def test_threads_are_asked_for_where_cores_are_few(monkeypatch):
    monkeypatch.setattr(xla_threads, "_num_cores", lambda: 2)
    monkeypatch.setenv("NPROC", "3")
    have_enough_threads()
    assert os.environ["NPROC"] == "3"  # what the environment says stands
    monkeypatch.delenv("NPROC")
    have_enough_threads()
    assert os.environ["NPROC"] == "16"
    monkeypatch.delenv("NPROC")
    monkeypatch.setattr(xla_threads, "_num_cores", lambda: 64)
    have_enough_threads()
    assert "NPROC" not in os.environ
