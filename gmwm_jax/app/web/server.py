"""The server of the page: which socket, who may come, where files lie, and how it ends."""

import contextlib
import functools
import multiprocessing.util
import os
import shutil
import socket
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import uvicorn

from gmwm_jax._internal.compiled import keep_compiled
from gmwm_jax._internal.interrupts import AbandonableExecutor
from gmwm_jax._internal.xla_threads import have_enough_threads
from gmwm_jax.app.web.guard import Guard
from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.page import application
from gmwm_jax.app.web.rooms.model import compile_usual_models
from gmwm_jax.app.web.turns import Turns
from gmwm_jax.app.web.uploads import start_reader

PREFIX = "gmwm-jax-app-"
"""Of the folder of a server's temporary files, followed by its process."""
LOCAL = ("127.0.0.1", "localhost", "[::1]")
_TRIES = 20
_SWITCH = 5e-4
"""Seconds; a tenth of what Python has."""
_QUIET = 3.0
"""Seconds until the usual models are compiled: the first page comes first."""


class Running:
    """A server on a socket: `run` it here, or `start` it in a thread.

    Parameters
    ----------
    host, port
        Where it listens; port 0: any that is free.
    limits
        Of sizes and counts.
    num_threads
        That compute for all pages.
    root_path
        Under which a proxy shows it.
    names
        By which a proxy, or anybody, may call it besides the host.
    prewarm
        Compile the usual models while nobody waits.

    Examples
    --------
    >>> from gmwm_jax.app.web.server import Running
    >>> with Running(port=0) as server:  # doctest: +SKIP
    ...     print(server.url)
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 8000,
        *,
        limits: Limits | None = None,
        num_threads: int = 2,
        root_path: str = "",
        names: Sequence[str] = (),
        prewarm: bool = False,
    ):
        limits = limits or Limits()
        self._socket = _listen(host, port)
        self.port = self._socket.getsockname()[1]
        self.url = f"http://{'127.0.0.1' if host in ('0.0.0.0', '::') else host}:{self.port}{root_path}/"
        self._turns = Turns(num_threads, pages=limits.sessions, seconds=limits.compute_seconds)
        self._queue = AbandonableExecutor(1)  # long work leaves a core to those who click
        known = {*LOCAL, host.lower(), *(name.lower() for name in names)}
        if host in ("0.0.0.0", "::"):
            known |= {socket.gethostname().lower(), socket.getfqdn().lower()}
        config = uvicorn.Config(
            Guard(application(self._turns, self._queue, limits), known, limits),
            log_level="warning",
            ws="websockets-sansio",
            ws_max_size=limits.message,
            server_header=False,
            root_path=root_path,
            timeout_graceful_shutdown=1,
            limit_concurrency=20 * limits.sessions,
            access_log=False,
        )
        self._server = uvicorn.Server(config)
        self._thread: threading.Thread | None = None
        self._warming = threading.Timer(_QUIET, self._turns.executor.submit, [compile_usual_models])
        self._warming.daemon = True
        if prewarm:
            self._warming.start()
        _sweep(Path(tempfile.gettempdir()))
        self._before = tempfile.tempdir
        tempfile.tempdir = str(_own_folder())
        multiprocessing.util.get_temp_dir()  # of the process that starts readers; it lives as long as this one
        start_reader()
        self._folder = tempfile.tempdir = tempfile.mkdtemp(prefix="files-")

    def run(self) -> None:
        """Serve until an interrupt."""
        try:
            with contextlib.suppress(KeyboardInterrupt):  # the usual end
                self._server.run(sockets=[self._socket])
        finally:
            self._end()

    def __enter__(self) -> "Running":
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.should_exit = self._server.force_exit = True
        if self._thread is not None:
            self._thread.join()
        self._end()

    def _end(self) -> None:
        self._warming.cancel()
        self._socket.close()
        self._turns.end()
        self._queue.shutdown(wait=False, cancel_futures=True)
        tempfile.tempdir = self._before
        shutil.rmtree(self._folder, ignore_errors=True)


def serve(
    host: str,
    port: int,
    say: Callable[[str], Any],
    *,
    browser: bool,
    room: str = "",
    cache: bool = True,
    **options: Any,
) -> None:
    """Serve the page until an interrupt.

    Parameters
    ----------
    host, port
        Where it listens. Of a port that is taken, the next free one.
    say
        Told the address, in one line, and what is unsafe.
    browser
        Open it there.
    room
        In which the page opens; the first if left out.
    cache
        Keep what is compiled in the user's folder of caches.
    options
        Of `Running`.

    Raises
    ------
    OSError
        No port is free, or the host is none of this machine.
    """
    have_enough_threads()
    # a thread that makes many short calls of JAX waits so long after each for one that computes in Python
    sys.setswitchinterval(_SWITCH)
    if cache:
        try:
            keep_compiled()
        except OSError as error:  # a folder that cannot be written: slower, and as good
            say(f"Compiled models are not kept from start to start ({error}).")
    server = Running(host, port, prewarm=True, **options)
    if port and server.port != port:
        say(f"Port {port} is taken.")
    if host not in LOCAL or options.get("names"):
        say("There is no login: everybody who reaches this machine can use it.")
    url = f"{server.url}?room={room}" if room else server.url
    say(f"gmwm_jax is at {url} (Ctrl-C ends it)")
    if browser:
        threading.Timer(0.5, webbrowser.open, [url]).start()
    server.run()


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for tried in range(port, port + (_TRIES if port else 1)):
        found = socket.socket(family, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((host.strip("[]"), tried))
            found.listen(128)
            return found
        except OSError as error:
            found.close()
            last = error
    raise OSError(f"No port from {port} on is free at {host}: {last.strerror}. Name another with --port.")


@functools.cache
def _own_folder() -> Path:
    """The folder of this process for files of visitors."""
    folder = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{os.getpid()}-"))
    # after that of multiprocessing, -100
    multiprocessing.util.Finalize(None, shutil.rmtree, args=(folder, True), exitpriority=-200)
    return folder


def _sweep(root: Path) -> None:
    """Remove the folders that killed servers left."""
    for left in root.glob(f"{PREFIX}*"):
        number = left.name.removeprefix(PREFIX).partition("-")[0]
        if left.is_dir() and number.isdigit() and not _alive(int(number)):
            shutil.rmtree(left, ignore_errors=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # of somebody else
        return True
    return True
