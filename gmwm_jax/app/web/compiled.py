"""Compiled programs are kept from one start of the server to the next, where nobody but their owner reads or writes."""

import hashlib
import platform
from pathlib import Path

import jax
import platformdirs


def keep_compiled(root: Path | None = None) -> Path | None:
    """Let JAX keep what it compiles; what another directory was chosen for stays there.

    Parameters
    ----------
    root
        Where; the user's folder of caches if left out.

    Returns
    -------
    :
        The folder: such programs are code that will be run, so that it is its owner's alone. None if
        ``JAX_COMPILATION_CACHE_DIR`` decides.

    Raises
    ------
    OSError
        The folder belongs to somebody else.

    Examples
    --------
    >>> from gmwm_jax.app.web.compiled import keep_compiled
    >>> keep_compiled()  # doctest: +SKIP
    PosixPath('/home/me/.cache/gmwm_jax/compiled/2f0c9d3b8a11')
    """
    if _chosen_before():
        return None
    folder = (root or Path(platformdirs.user_cache_dir("gmwm_jax"))) / "compiled" / _kind_of_cpu()
    folder.mkdir(parents=True, exist_ok=True)
    for private in (folder.parent, folder):
        private.chmod(0o700)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)  # what compiles faster is not faster read
    return folder


def _chosen_before() -> bool:
    return bool(jax.config.jax_compilation_cache_dir)  # type: ignore[attr-defined]


def _kind_of_cpu() -> str:
    """A short name of the processor and of JAX: a program that was compiled for one is wrong on another."""
    described = platform.machine() + platform.processor() + jax.__version__
    info = Path("/proc/cpuinfo")
    if info.exists():  # the first processor, without the lines of its clock
        lines = info.read_text().split("\n\n")[0].splitlines()
        described += "".join(line for line in lines if line.startswith(("model name", "flags", "Features")))
    return hashlib.sha256(described.encode()).hexdigest()[:12]
