"""Ctrl-C ends a computation within seconds, although nothing stops XLA while it compiles or runs a program.

A program that runs in another thread can be left behind: `AbandonableExecutor`. One that runs in the main thread keeps
Python from hearing of the interrupt at all: `leave_when_deaf`, for a command line.
"""

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

INTERRUPTED = 130
"""Exit code of a process that was stopped from the keyboard."""

_abandoned: set[threading.Thread] = set()


class AbandonableExecutor(Executor):
    """A pool of threads that nobody need wait for: ``shutdown(wait=False)`` leaves the running calls to themselves.

    The threads of `concurrent.futures.ThreadPoolExecutor` are joined when the process ends, however long they take.

    Parameters
    ----------
    num_threads
        Their number.
    """

    def __init__(self, num_threads: int):
        self._calls: SimpleQueue[tuple[Future[Any], Callable[[], Any]] | None] = SimpleQueue()
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(num_threads)]
        for thread in self._threads:
            thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function in one of the threads."""
        future: Future[Any] = Future()
        self._calls.put((future, partial(fn, *args, **kwargs)))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let the threads end after the calls that are waiting, or after those that are running."""
        with contextlib.suppress(Empty):
            while cancel_futures and (waiting := self._calls.get_nowait()):
                waiting[0].cancel()
        for _ in self._threads:
            self._calls.put(None)
        if wait:
            for thread in self._threads:
                thread.join()
            return
        if not _abandoned:
            atexit.register(_leave)
        _abandoned.update(self._threads)

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            future, function = call
            if future.set_running_or_notify_cancel():
                try:
                    future.set_result(function())
                except BaseException as error:  # an interrupt is for who waits
                    future.set_exception(error)
            del call, future, function  # results live no longer than their futures


def _leave() -> None:
    """End the process while abandoned threads are at work: ended under its feet, XLA's compiler would abort it."""
    for thread in _abandoned:
        thread.join(0.2)
    if any(thread.is_alive() for thread in _abandoned):
        _exit()


def leave_at_once(*_: Any) -> None:
    """End the process: a handler of interrupts for as long as nothing is done."""
    print("Interrupted: nothing was done.", file=sys.stderr)  # noqa: T201
    _exit()


def leave_when_deaf(grace: float = 3.0) -> None:
    """From now on, end the process at an interrupt that Python has not heard of within some seconds.

    An interrupt that it hears of raises KeyboardInterrupt as ever. To be called in the main thread.

    Parameters
    ----------
    grace
        Seconds.
    """
    heard = threading.Event()

    def handler(number: int, frame: Any) -> None:
        heard.set()
        signal.default_int_handler(number, frame)

    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.signal(signal.SIGINT, handler)
    # the number of a signal is written when it comes, its handler called when the main thread returns to Python
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)

    def watch() -> None:
        while numbers := os.read(reading, 64):
            if signal.SIGINT in numbers:
                if not heard.wait(grace):
                    print("Interrupted: nothing was done by then.", file=sys.stderr)  # noqa: T201
                    _exit()
                heard.clear()

    threading.Thread(target=watch, daemon=True).start()


def _exit() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)
