"""Files of visitors are read in a process of their own, which is ended when it takes too long or too much memory."""

import contextlib
import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from gmwm_jax._internal.limits import as_bytes
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.recordings.files import read_recording
from gmwm_jax.recordings.recording import Recording


def read_upload(path: Path, name: str, options: dict[str, Any], limits: Limits) -> Recording:
    """Read a file that somebody sent.

    Parameters
    ----------
    path
        Where it was stored.
    name
        The file's name there, which is never a path here.
    options
        Of `gmwm_jax.read_recording`.
    limits
        Of time, memory and channels.

    Raises
    ------
    ValueError
        What `gmwm_jax.read_recording` says of the file, by its own name; a limit.
    """
    found = read_apart(read_recording, path, name, options, limits)
    if found.num_channels > limits.channels:
        raise ValueError(
            f"{name} has {found.num_channels} channels, and this server takes {limits.channels}: name the columns."
        )
    found.data.flags.writeable = False
    return found


def read_apart(read: Callable[..., Any], path: Path, name: str, options: dict[str, Any], limits: Limits) -> Any:
    """Read a file that somebody sent in a process of its own.

    Parameters
    ----------
    read
        Function of a module, of the path, and of ``name``, ``max_bytes`` and the options by name.
    path, name, options, limits
        As of `read_upload`.

    Raises
    ------
    ValueError
        What the function says of the file, by its own name; a limit.
    """
    context: Any = multiprocessing.get_context(_START)
    receiving, sending = context.Pipe(duplex=False)
    process = context.Process(target=_read, args=(sending, read, path, name, options, limits), daemon=True)
    process.start()
    sending.close()
    try:
        if not receiving.poll(limits.read_seconds):
            raise ValueError(f"{name} was not read within {limits.read_seconds:g} s, the most that this server takes.")
        found = receiving.recv()
    except EOFError:
        raise ValueError(f"{name}: reading it took more than the {as_bytes(limits.read_memory)} of memory "
                         "that this server gives it.") from None  # fmt: skip
    finally:
        receiving.close()
        process.kill()
        process.join()
    if isinstance(found, str):
        raise ValueError(found.replace(str(path), name))
    return found


_START = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
"""A process from a small one, that has read the package already, starts in hundredths of a second."""


def start_reader() -> None:
    """Start the small process from which readers start; it is there a few seconds later."""
    if _START == "forkserver":
        from multiprocessing import forkserver

        multiprocessing.get_context(_START).set_forkserver_preload([__name__])
        forkserver.ensure_running()


def _read(
    sending: Connection, read: Callable[..., Any], path: Path, name: str, options: dict[str, Any], limits: Limits
) -> None:
    """Send what is read, or what is wrong as text."""
    with contextlib.suppress(ImportError):  # there is none on Windows
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (limits.read_memory, limits.read_memory))
        seconds = int(limits.read_seconds) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    try:
        sending.send(read(path, name=name, max_bytes=limits.read_memory, **options))
    except (ValueError, OSError, ImportError) as error:
        sending.send(str(error))
    except MemoryError:
        sending.send(f"{path} needs more than the {as_bytes(limits.read_memory)} of memory that this server gives it.")
