"""A bound on the compiled programs that a process holds: JAX keeps every program that it ever compiled.

Each length of a scenario takes some seven programs of its own, of 10 to 15 MB each: the program, its trace, and what
the compiler remembers of it. Only functions that are marked as `bounded` are forgotten, and never those of the user.
"""

import ctypes
import gc
import threading
from typing import Any, TypeVar

MAX_PROGRAMS = 60
"""Programs of all bounded functions, before they are forgotten: 0.8 GB, some nine scenarios of different lengths."""

_F = TypeVar("_F")
_lock = threading.Lock()
_bounded: list[Any] = []


def bounded(function: _F) -> _F:
    """Mark a compiled function that has a program for each length."""
    # equinox has no public way to forget the programs of one function
    _bounded.append(getattr(function, "_cached", function))
    return function


def num_programs() -> int:
    """Number of programs that bounded functions hold."""
    return sum(f._cache_size() for f in _bounded)


def bound_programs() -> None:
    """Forget the programs of bounded functions when they are too many; called where a new scenario is prepared.

    What is called again after that is compiled again.
    """
    with _lock:
        if num_programs() <= MAX_PROGRAMS:
            return
        for f in _bounded:
            f.clear_cache()
        gc.collect()
        _return_memory()


def _return_memory() -> None:
    """Give freed memory back to the system: glibc keeps what is free between pieces that are not."""
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library, which does as it thinks best
        return
    trim(0)
