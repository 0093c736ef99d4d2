"""Who computes tasks: anything with the interface of `concurrent.futures`."""

import multiprocessing
import os
import threading
import time
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from functools import partial
from typing import Any, TypeAlias, cast

import jax

from gmwm_jax._internal.checks import integer
from gmwm_jax._internal.compiled import kept_if_possible
from gmwm_jax._internal.cores import num_threads
from gmwm_jax._internal.interrupts import AbandonableExecutor

Workers: TypeAlias = Any
"""An executor, a function that makes one, or what has `get_executor`; None for what the work is done by otherwise."""

_WAITING = 64
"""Tasks that are with an executor at a time."""

_ASK = 5.0
"""s without a result after which a cluster is asked whether it has workers."""

_ABSENT_HERE, _ABSENT_ELSEWHERE, _ABSENT_SAID = 120.0, 86_400.0, 60.0
"""s without a worker after which a cluster of this machine is given up, whose workers are replaced at once, and one
elsewhere, whose workers come when a queue has room for them; and after which that is said."""


class WorkersGoneError(RuntimeError):
    """Nobody is there to compute, and nobody comes."""


class InThisThread(Executor):
    """Calls at once, in the thread that submits: nothing is done beside it, and an interrupt comes out there."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call a function, and say how that ended."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def threads() -> Executor:
    """As many threads as cores, which nobody need wait for."""
    return AbandonableExecutor(num_threads())


class Pool:
    """An executor, and a new one when it breaks, where somebody has said how to make it.

    Parameters
    ----------
    workers
        See `Workers`.
    otherwise
        Makes one where there are none.

    Attributes
    ----------
    executor
        The present one.
    waiting
        Tasks that it is given before the first is awaited.
    asked_after
        s without a result after which `require_workers` is called; None where that says nothing.

    Raises
    ------
    ValueError
        It is none of these.
    """

    def __init__(self, workers: Workers, otherwise: Callable[[], Executor]):
        self._make: Callable[[], Executor] | None = None
        if hasattr(workers, "get_executor"):
            self.executor: Executor = workers.get_executor()
        elif isinstance(workers, Executor):
            self.executor = workers
        else:
            make = otherwise if workers is None else workers
            if not callable(make):
                raise ValueError(
                    "executor= is a concurrent.futures.Executor, a function that makes one, or what has get_executor() "
                    f"such as a Dask Client, and is {workers!r}."
                )
            self._make = cast("Callable[[], Executor]", make)
            self.executor = self._make()
        self.waiting = 1 if isinstance(self.executor, InThisThread) else _WAITING
        client = workers if hasattr(workers, "get_executor") else getattr(workers, "_client", None)
        self._attendance = _Attendance(client) if hasattr(client, "scheduler_info") else None
        self.asked_after = None if self._attendance is None else _ASK

    @property
    def has_ended(self) -> bool:
        """Whether it is a cluster that has, which can be asked for nothing more."""
        return self._attendance is not None and self._attendance.has_ended

    def require_workers(self) -> None:
        """Raise a WorkersGoneError where a cluster has had none for too long: its tasks would wait for ever."""
        if self._attendance is not None:
            self._attendance.require()

    def has_answered(self) -> None:
        """Count the time without workers anew: there was one."""
        if self._attendance is not None:
            self._attendance.is_given()

    def replace(self) -> bool:
        """Take a new executor for one whose worker died; False where nobody has said how."""
        if self._make is None:
            return False
        self.executor.shutdown(wait=False, cancel_futures=True)
        self.executor = self._make()
        return True

    def close(self, *, wait: bool) -> None:
        """Let go of an executor that was made here; one that was given goes on."""
        if self._make is not None:
            self.executor.shutdown(wait=wait, cancel_futures=True)


class _Attendance:
    """Whether there are workers in the cluster of a Dask Client that take tasks, and since when there are none."""

    def __init__(self, client: Any):
        self._client, self._since, self._said = client, None, False
        self._name = f"the Dask cluster at {getattr(client.scheduler, 'address', 'an unknown address')}"

    @property
    def has_ended(self) -> bool:
        """Whether the client has lost its scheduler for good."""
        return self._client.status in ("closing", "closed")

    def is_given(self) -> None:
        """Begin anew."""
        self._since = None

    def require(self) -> None:
        """Raise a WorkersGoneError after too long, and say it before."""
        if self.has_ended:
            raise WorkersGoneError(f"The scheduler of {self._name} has ended")
        if any(_takes_tasks(worker) for worker in self._client.scheduler_info().get("workers", {}).values()):
            self.is_given()
            return
        now = time.monotonic()
        self._since = now if self._since is None else self._since
        most = self._patience()
        if now - self._since > most:
            raise WorkersGoneError(f"No worker of {self._name} has taken tasks for {most:g} s")
        if now - self._since > _ABSENT_SAID and not self._said:
            self._said = True
            warnings.warn(f"No worker of {self._name} takes tasks; they are awaited for {most:g} s.", stacklevel=6)

    def _patience(self) -> float:
        """What Dask's own configuration says of tasks that nobody takes, or what suits the kind of cluster."""
        from dask.config import get
        from dask.utils import parse_timedelta

        if (stated := get("distributed.scheduler.no-workers-timeout", None)) is not None:
            return float(parse_timedelta(stated))
        here = type(getattr(self._client, "cluster", None)).__name__ == "LocalCluster"
        return _ABSENT_HERE if here else _ABSENT_ELSEWHERE


def _takes_tasks(worker: Mapping[str, Any]) -> bool:
    """Whether a worker is at work, by what a scheduler says of it; one that is short of memory takes no new task."""
    metrics = worker.get("metrics", {})
    busy = metrics.get("task_counts", {}).get("executing", 0) or metrics.get("executing", 0)
    return worker.get("status", "running") == "running" or bool(busy)


def processes(workers: int | None = None) -> Callable[[], Executor]:
    """Say how to make a pool of processes, for ``executor=``.

    A script that uses it has its work under ``if __name__ == "__main__":``, since every worker imports it. A worker
    that dies is replaced, and all workers end with the process that started them, however that ends. What they compile
    is kept, see `gmwm_jax.keep_compiled`.

    Parameters
    ----------
    workers
        Their number; as many as cores that this process may use unless stated.

    Examples
    --------
    >>> make = gj.inference.processes(2)
    >>> pool = make()
    >>> pool.submit(sum, [1, 2]).result()
    3
    >>> pool.shutdown()
    """
    count = num_threads() if workers is None else integer("workers", workers, 1)
    spawn = multiprocessing.get_context("spawn")
    return partial(ProcessPoolExecutor, count, mp_context=spawn, initializer=_begin)


def prepare_worker() -> None:
    """Where nobody has done it: a worker computes in 64 bits, and what it compiles is kept."""
    if not jax.config.read("jax_enable_x64"):
        jax.config.update("jax_enable_x64", True)
        kept_if_possible()


def _begin() -> None:
    """Of a worker: it ends with its parent, and what it compiles is kept for others and the next time."""
    _end_with_parent()
    kept_if_possible()


def _end_with_parent() -> None:
    """A killed parent closes no queue: without this its workers would wait for ever."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
