"""A bound on the compiled programs that a process holds: JAX keeps every program that it ever compiled.

A scenario of another length takes some fifty of them, large ones of a filter and small ones of its preparation, and
each holds 2 MB: the program, its trace, and what the compiler remembers of it. Most belong to functions of JAX itself,
which forgets all or nothing.
"""

import ctypes
import gc
import threading

import jax
from jax.extend.backend import get_backend

MAX_PROGRAMS = 500
"""Programs that are compiled before all are forgotten: 1 to 1.5 GB, ten scenarios of different lengths."""

_lock = threading.Lock()
_stayed = 0
"""Programs that were left when all were forgotten last: somebody else holds them."""


def bound_programs() -> None:
    """Have JAX forget its programs when it has compiled too many; called where a new scenario is prepared.

    What is called again after that is compiled again, functions of the user too.
    """
    global _stayed
    with _lock:
        if num_programs() - _stayed <= MAX_PROGRAMS:
            return
        jax.clear_caches()
        gc.collect()
        _return_memory()
        _stayed = num_programs()


def num_programs() -> int:
    """Programs that are compiled and held by anybody in this process."""
    return len(get_backend().live_executables())


def _return_memory() -> None:
    """Give freed memory back to the system: glibc keeps what is free between pieces that are not."""
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library, which does as it thinks best
        return
    trim(0)
