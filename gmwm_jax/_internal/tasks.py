"""Tasks of one piece of work, given to an executor and awaited, whoever of its workers dies meanwhile.

A task is pure: done again, by whomever, it has the same result. So what was lost is given out once more.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from typing import Any

from gmwm_jax._internal.executors import Pool, WorkersGoneError, prepare_worker
from gmwm_jax._internal.lazy import open_wide
from gmwm_jax._internal.states import State, from_state, to_state

_MOST_BREAKS = 16
"""Times in turn that a pool may break before a task is done."""

_MOST_DEATHS = 3
"""Workers that a task may cost that is alone with them."""

_MOST_LOSSES = 16
"""Times that a task may be given back without a word."""

Task = tuple[Any, ...]


class WorkerDied(RuntimeError):
    """What has become of a task that takes its worker with it."""


class SentAsState:
    """What goes to other processes as numbers of NumPy: arrays of JAX lose half their bits in one without x64."""

    __slots__ = ()

    def __reduce__(self) -> tuple[Any, ...]:
        """Of a registered class, see `gmwm_jax._internal.states`; the package has it, and what it is made of."""
        return _arrived, (type(self).__module__.partition(".")[0], to_state(self))


def _arrived(package: str, state: State) -> Any:
    """Build it, in a process that may have loaded nothing of the package: not even the function that it is for."""
    prepare_worker()
    open_wide(package)
    return from_state(state)


def why(error: Exception) -> str:
    """What is said of a task that could not be done."""
    return str(error) if isinstance(error, WorkerDied) else f"{type(error).__name__}: {error}"


def carry_out(
    rounds: Iterator[Sequence[Any]],
    function: Callable[..., Any],
    given: Sequence[Any],
    pool: Pool,
    take: Callable[[Any, Any], object],
    *,
    died: Callable[[str, list[Any]], str],
) -> None:
    """Send the tasks of each round out, and those whose worker died again, after the others and then one by one.

    A pool that breaks does not say which of its tasks was the reason: the one that breaks it alone. The pool is closed
    at the end, whatever that is.

    Parameters
    ----------
    rounds
        Lists of tasks; the next one is asked for when all before it are done.
    function, given
        Called with what is given and the task. It, they and the result may have to go to another process and back.
    pool
        Who calls.
    take
        Called here with each task and its result, or the exception that came in its place.
    died
        What has happened, such as "A worker died", and the tasks, of which one had that worker -> what it means, as a
        sentence.

    Raises
    ------
    RuntimeError
        Workers died, and nobody has said how to make others; a cluster has had none for too long, or has ended.
    """
    ended = False
    waiting: dict[Future[Any], Task] = {}
    todo: list[Task] = []
    order: dict[Task, int] = {}
    breaks, deaths, losses = 0, Counter[Task](), Counter[Task]()

    def in_order(tasks: Iterable[Task]) -> list[Task]:
        return sorted(tasks, key=order.__getitem__)

    try:
        while True:
            if not (todo or waiting):
                if not (tasks := next(rounds, [])):
                    break
                todo, order = list(tasks)[::-1], {task: i for i, task in enumerate(tasks)}
            broken = []
            try:
                while todo and len(waiting) < (1 if breaks > 1 else pool.waiting):
                    future = pool.executor.submit(function, *given, *todo[-1])
                    waiting[future] = todo.pop()
            except BrokenExecutor:
                broken.append(todo.pop())
            done = wait(waiting, timeout=pool.asked_after, return_when=FIRST_COMPLETED).done
            if not done or any(future.cancelled() for future in done):
                try:
                    pool.require_workers()
                except WorkersGoneError as gone:
                    raise RuntimeError(died(str(gone), in_order(waiting.values()))) from None
            for future in sorted(done, key=lambda one: order[waiting[one]]):
                task = waiting.pop(future)
                try:
                    result = future.result()
                except BrokenExecutor:
                    broken.append(task)
                    continue
                except CancelledError as error:  # by none of us: as by a client that has lost its scheduler for a while
                    losses[task] += 1
                    if losses[task] < _MOST_LOSSES:
                        todo.append(task)
                        continue
                    result = error
                except Exception as error:
                    result = error
                breaks = 0
                pool.has_answered()
                take(task, result)
            if broken:
                broken = in_order([*broken, *waiting.values()])
                waiting.clear()
                breaks += 1
                if breaks > _MOST_BREAKS or not pool.replace():
                    raise RuntimeError(died("A worker died", broken))
                deaths.update(broken if len(broken) == 1 else ())
                if deaths[broken[0]] == _MOST_DEATHS:
                    take(broken.pop(), WorkerDied(f"its worker died {_MOST_DEATHS} times, as without memory"))
                todo[:0] = reversed(broken)
        ended = True
    finally:
        for future in [] if pool.has_ended else waiting:
            future.cancel()
        pool.close(wait=ended)
