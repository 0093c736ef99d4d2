"""How XLA compiles loops on a CPU.

It compiles what a loop does into one function where all iterations together touch little memory, and otherwise goes
through the operations of each iteration one by one, some 20 of them for a step of a filter whose arithmetic is done in
microseconds. An option of XLA, in no flag of its own and not for a single function, says what is little (jaxlib 0.7.1
and later). With it the whole time loop of a filter is one function, whose arrays stay in the cache.
"""

import os
import sys
import warnings
from importlib.metadata import version

_NAME = "xla_cpu_small_while_loop_byte_threshold"
_GROUP = "--xla_backend_extra_options="
_FLAGS = "XLA_FLAGS"
_BYTES = 1_000_000_000
_KNOWN = ((0, 7, 1), (0, 12))
"""Versions of jaxlib that have the option, from the first up to and without the second."""


def fast_loops() -> None:
    """Compile the time loops of filters as a whole, on CPUs: 1.2 to 2.5 times as many runs in the same time.

    A line for the top of a script or a notebook, since JAX reads the environment when it first computes. The command
    line ``nav-jax`` does it by itself; the packages never do. Numbers change by rounding. Processes that are started
    afterwards have it too; workers that somebody else starts take ``XLA_FLAGS`` from their own environment.

    Where the environment has extra options of XLA already, those stand, and nothing is changed.

    Raises
    ------
    RuntimeError
        JAX has computed something already: it is too late.

    Warns
    -----
    UserWarning
        This version of jaxlib is not known to have the option, and nothing was changed.

    Examples
    --------
    >>> nj.fast_loops()  # doctest: +SKIP
    """
    if loops_are_fast():
        return
    if _has_begun():
        raise RuntimeError("JAX has computed something already: fast_loops() belongs before that, at the top.")
    if not _is_known():
        warnings.warn(
            f"jaxlib {version('jaxlib')} is not known to compile loops as a whole; nothing was changed.", stacklevel=2
        )
        return
    _set()


def fast_loops_if_known() -> None:
    """The same for a command line, which has computed nothing, and without a word."""
    if _is_known():
        _set()


def loops_are_fast() -> bool:
    """Whether the environment says so."""
    return _NAME in os.environ.get(_FLAGS, "")


def _set() -> None:
    flags = os.environ.get(_FLAGS, "")
    if _GROUP not in flags:  # a second group would take the place of the first
        os.environ[_FLAGS] = f"{flags} {_GROUP}{_NAME}={_BYTES}".strip()


def _is_known() -> bool:
    parts = version("jaxlib").split(".")[:3]
    found = tuple(int(p) for p in parts if p.isdecimal())
    return _KNOWN[0] <= found < _KNOWN[1]


def _has_begun() -> bool:
    """Whether JAX has a backend, which has read the environment."""
    bridge = sys.modules.get("jax._src.xla_bridge")
    return bridge is not None and bridge.backends_are_initialized()
