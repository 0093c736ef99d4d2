"""The memory of this machine, and the refusal of work that needs more: before it begins, and with what to make smaller.

An estimate stands beside the arrays that it counts. It is made of Python integers, never of traced values.
"""

import os
from pathlib import Path

from gmwm_jax._internal.limits import as_bytes, size_in_bytes

MEMORY_VARIABLE = "GMWM_JAX_MAX_MEMORY"
"""Environment variable that says how much memory may be used (``8GB``), in place of what the machine has left."""

FLOAT = 8
"""Bytes of a float64."""

_CGROUPS = (
    (Path("/sys/fs/cgroup"), "memory.max", "memory.current", "inactive_file"),
    (Path("/sys/fs/cgroup/memory"), "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
"""Limit and use of a container, and what of the use is copies of files: the unified hierarchy, and the older one."""


class OutOfMemoryError(ValueError, MemoryError):
    """What is asked for needs more memory than there is."""


def require_memory(num_bytes: int, what: str, make_smaller: str) -> None:
    """Raise unless there is memory for what is asked for.

    Parameters
    ----------
    num_bytes
        What it takes at its peak, within a factor of two.
    what
        A subject, such as ``1000 runs of 2 filters``.
    make_smaller
        What the caller can do, as a sentence without its end.

    Raises
    ------
    OutOfMemoryError
        There is less; the message says both.
    ValueError
        `MEMORY_VARIABLE` is no size.
    """
    there = available_memory()
    if there is not None and num_bytes > there:
        raise OutOfMemoryError(
            f"{what} would take about {as_bytes(num_bytes)} of memory, and {as_bytes(there)} are there: {make_smaller}."
            f" (The environment variable {MEMORY_VARIABLE} overrules what is there.)"
        )


def available_memory() -> int | None:
    """Return the bytes that this process may still take; None on machines that do not say it."""
    stated = os.environ.get(MEMORY_VARIABLE)
    if stated:
        try:
            return size_in_bytes(stated)
        except ValueError as error:
            raise ValueError(f'{MEMORY_VARIABLE} is a size such as "8GB", and is {stated!r}.') from error
    known = [size for size in (_free(), *(_left(*names) for names in _CGROUPS)) if size is not None]
    return min(known) if known else None


def _free() -> int | None:
    """Of the machine: what is free or can be freed, else all that is built in."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _left(folder: Path, limit: str, used: str, copies: str) -> int | None:
    """Of a container, where it has a limit; copies of files make room when it is needed."""
    try:
        left = int((folder / limit).read_text()) - int((folder / used).read_text())
        words = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return max(0, left + int(words.get(copies, 0)))
    except (OSError, ValueError):  # there is none, or it says "max"
        return None
