"""What else the last bits of results depend on: the versions of the compiler, its flags, and the processor."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_CPUINFO = Path("/proc/cpuinfo")


def environment() -> dict[str, str]:
    """Name -> value, of this process.

    Examples
    --------
    >>> from gmwm_jax._internal.environment import environment
    >>> sorted(environment())
    ['XLA_FLAGS', 'gmwm-jax', 'jax', 'jaxlib', 'processor']
    """
    versions = {name: _version(name) for name in ("gmwm-jax", "jax", "jaxlib")}
    return versions | {"processor": _processor(), "XLA_FLAGS": os.environ.get("XLA_FLAGS", "")}


def differences(former: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What differs, as text; empty where nothing does."""
    return ", ".join(
        f"{name} was {former.get(name)!r}, is {now[name]!r}" for name in now if former.get(name) != now[name]
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """Model name where the system says it, else the architecture."""
    if _CPUINFO.exists():
        for line in _CPUINFO.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.machine()
