"""Programs that may take all of XLA's threads on a CPU and wait for more: a few of them at a time.

LAPACK of a batch of matrices holds one thread of XLA's pool until others of the pool have done its parts (jaxlib 0.10).
The pool has a thread for each core. Two such programs, started by two Python threads, may each hold one of two and wait
for ever: two selections did within seconds, with pools of 2 to 4 threads. With 16, eight at a time came to their ends.
Two in one program that nothing puts in an order do it too: what a program decomposes is one batch after another.

More threads than cores are no answer for everybody: a step of a filter that goes through XLA operation by operation
takes twice as long with them. A page, whose users wait for each other's fits otherwise, asks for them.
"""

import functools
import os
import threading
from collections.abc import Callable
from typing import Any

import jax

from gmwm_jax._internal.compiling import is_traced

_NAME = "NPROC"
"""The variable by which XLA takes the size of its pool, in place of the number of cores."""
_ENOUGH = 16
_THREADS_EACH = 4
"""Of the pool, for each program that runs at a time."""


def have_enough_threads() -> None:
    """Let XLA have enough threads, where the machine has fewer cores; what the environment says stands.

    To be called before JAX computes anything, which is when it reads the variable.
    """
    if _num_cores() < _ENOUGH:
        os.environ.setdefault(_NAME, str(_ENOUGH))


def few_at_a_time(program: Callable[..., Any]) -> Callable[..., Any]:
    """Let a compiled program that has LAPACK of batches run only beside as few others as XLA's threads allow.

    Inside of another program it is traced as it is: who runs that one by several threads sees to it that there are
    enough.
    """

    @functools.wraps(program)
    def call(*values: Any) -> Any:
        if is_traced(*values):
            return program(*values)
        with _turns():
            return jax.block_until_ready(program(*values))

    # of the program that it is outside, where it has them
    names = ("_cache_size", "clear_cache")
    call.__dict__.update({name: getattr(program, name) for name in names if hasattr(program, name)})
    return call


@functools.cache
def _turns() -> threading.Semaphore:
    """One for all such programs, made when XLA has read the variable, or is about to."""
    stated = os.environ.get(_NAME, "")
    threads = int(stated) if stated.isdecimal() else _num_cores()
    return threading.Semaphore(max(1, threads // _THREADS_EACH))


def _num_cores() -> int:
    """Those that this process may use, as XLA counts them."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
