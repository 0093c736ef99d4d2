"""Compiled programs are kept from one start to the next, where nobody but their owner reads or writes."""

import contextlib
import gc
import hashlib
import os
import platform
from pathlib import Path

import jax
from jax.experimental.compilation_cache import compilation_cache

from gmwm_jax._internal.optional import import_optional

_SECONDS = 0.1
"""What compiles faster than this is not faster read."""
_MOST_BYTES = 1_000_000_000
"""Beyond which programs that have not been written for longest are let go; a page or a command has some ten MB."""


def keep_compiled(root: Path | None = None) -> Path | None:
    """Let JAX keep what it compiles, so that the next start need not compile it again.

    A line for the top of a script or a notebook: the packages themselves never change JAX's configuration. Command
    lines, the page and the workers of a campaign do it unless told otherwise by ``--no-cache``. What has been loaded by
    then is there to stay, and Python's collector of cycles is told so (`gc.freeze`): tracing, by which programs are
    found again, calls it often, and it would look at all of JAX each time.

    Parameters
    ----------
    root
        Where; the user's folder of caches if left out.

    Returns
    -------
    :
        The folder: such programs are code that will be run, so that it is its owner's alone. None where
        ``JAX_COMPILATION_CACHE_DIR`` or a configuration decides, or ``JAX_ENABLE_COMPILATION_CACHE=0`` wants none.

    Raises
    ------
    OSError
        The folder belongs to somebody else, or cannot be made.
    ImportError
        There is no root, and nobody to say where caches of this system are: the extra ``app`` is not installed.

    Examples
    --------
    >>> gj.keep_compiled()  # doctest: +SKIP
    PosixPath('/home/me/.cache/gmwm_jax/compiled/2f0c9d3b8a11')
    """
    gc.freeze()
    if _decided():
        return None
    caches = Path(import_optional("platformdirs", "app").user_cache_dir("gmwm_jax")) if root is None else root
    folder = caches / "compiled" / _kind_of_cpu()
    folder.mkdir(parents=True, exist_ok=True)
    for private in (folder.parent, folder):
        if hasattr(os, "getuid") and private.stat().st_uid != os.getuid():
            raise PermissionError(f"{private} belongs to somebody else, whose programs would be run.")
        private.chmod(0o700)
    _let_go(folder.parent)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", _SECONDS)
    compilation_cache.reset_cache()  # JAX asks once, when it first compiles, and that may have been before
    return folder


def kept_if_possible() -> None:
    """Keep what is compiled, where that can be: slower without, and as good."""
    with contextlib.suppress(OSError, ImportError):
        keep_compiled()


def _decided() -> bool:
    """Whether somebody else has said where, or that nothing is kept."""
    chosen = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    return bool(chosen) or not jax.config.jax_enable_compilation_cache  # type: ignore[attr-defined]


def _let_go(folder: Path) -> None:
    """Remove the oldest programs, of all processors and versions, when there are too many."""
    found = []
    for file in folder.glob("*/*"):
        with contextlib.suppress(OSError):  # another process may have removed it
            state = file.stat()
            found.append((state.st_mtime, state.st_size, file))
    total = sum(size for _, size, _ in found)
    for _, size, file in sorted(found):
        if total <= _MOST_BYTES:
            break
        with contextlib.suppress(OSError):
            file.unlink()
        total -= size


def _kind_of_cpu() -> str:
    """A short name of the processor and of JAX: a program that was compiled for one is wrong on another."""
    described = platform.machine() + platform.processor() + jax.__version__
    info = Path("/proc/cpuinfo")
    if info.exists():  # the first processor, without the lines of its clock
        lines = info.read_text().split("\n\n")[0].splitlines()
        described += "".join(line for line in lines if line.startswith(("model name", "flags", "Features")))
    return hashlib.sha256(described.encode()).hexdigest()[:12]
