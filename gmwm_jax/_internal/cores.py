"""How many threads a computation may start: one place that counts the cores."""

import os
from pathlib import Path

_CACHE = Path("/sys/devices/system/cpu/cpu0/cache/index2/size")

THREADS_VARIABLE = "GMWM_JAX_NUM_THREADS"
"""Environment variable that says how many, for a worker among many on one machine."""


def num_threads() -> int:
    """Return the number of threads to start: what `THREADS_VARIABLE` says, else the cores that this process may use.

    Raises
    ------
    ValueError
        The variable is no positive integer.
    """
    stated = os.environ.get(THREADS_VARIABLE)
    if stated:
        if not stated.strip().isdecimal() or int(stated) < 1:
            raise ValueError(f"{THREADS_VARIABLE} is a positive number of threads, and is {stated!r}.")
        return int(stated)
    # the cores of a container or of a worker that is bound to some, not those of the machine
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def core_cache() -> int | None:
    """Return the bytes of the second-level cache of a core, None where the system does not say."""
    try:
        text = _CACHE.read_text().strip()
    except OSError:
        return None
    units = {"K": 2**10, "M": 2**20}
    return int(text[:-1]) * units[text[-1]] if text[:-1].isdecimal() and text[-1] in units else None
