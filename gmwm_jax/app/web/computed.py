"""Values that a thread computes from inputs of the page: only the value of the present inputs is ever shown."""

import asyncio
import logging
import secrets
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Generic, TypeVar

from shiny import reactive
from shiny.session import Session

from gmwm_jax.app.web.turns import PageTurns, SupersededError

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)

_LOG = logging.getLogger("gmwm_jax.app")


@dataclass(frozen=True)
class Outcome(Generic[T]):
    """What is known for the present inputs: a value, or why there is none."""

    value: T | None = None
    error: str = ""
    busy: str = ""
    """What is being done."""


class Computed(Generic[K, T]):
    """A value that is computed in a thread whenever its inputs change.

    Parameters
    ----------
    session
        Of the page.
    turns
        The computations of the page.
    key
        Reads the inputs; all that `work` depends on. None: there is nothing to compute yet. A ValueError is shown.
    work
        Computes the value. A ValueError is shown; of another error, which is a mistake of this program, a number.
    busy
        What is shown while it computes.
    words
        Python in a message -> the same as the page has it.
    later
        Nobody waits for it, see `PageTurns.run`.
    looked_at
        Is its place on the page seen? Nothing is computed before.
    """

    def __init__(
        self,
        session: Session,
        turns: PageTurns,
        key: Callable[[], K | None],
        work: Callable[[K], T],
        busy: str,
        words: Callable[[str], str] = str,
        *,
        later: bool = False,
        looked_at: Callable[[], bool] = lambda: True,
    ):
        self._key, self._work, self._busy, self._words, self._turns = key, work, busy, words, turns
        self._is_later, self._looked_at = later, looked_at
        self._done: reactive.Value[tuple[K, Outcome[T]] | None] = reactive.Value(None, name="computed")
        self._asked: K | None = None
        self._ended = False
        self._tasks: set[asyncio.Task[None]] = set()
        session.on_ended(self._end)
        self.outcome = reactive.calc(self._outcome)
        self._watch = reactive.effect(self._start)

    def __call__(self) -> Outcome[T]:
        """Tell what is known for the present inputs; reactive."""
        return self.outcome()

    def _end(self) -> None:
        self._ended = True

    def _outcome(self) -> Outcome[T]:
        try:
            key = self._key()
        except ValueError as error:
            return Outcome(error=self._words(str(error)))
        if key is None:
            return Outcome()
        done = self._done()
        return done[1] if done is not None and done[0] == key else Outcome(busy=self._busy)

    def _start(self) -> None:
        if not self._looked_at():
            return
        try:
            key = self._key()
        except ValueError:
            key = None
        if key is None or key == self._asked:
            return
        self._asked = key
        task = asyncio.get_running_loop().create_task(self._run(key))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _run(self, key: K) -> None:
        await asyncio.sleep(0)  # what else changes now comes first

        def wanted() -> bool:
            return key == self._asked and not self._ended

        try:
            value = await self._turns.run(lambda: self._work(key), wanted, later=self._is_later)
            found: Outcome[T] = Outcome(value=value)
        except SupersededError:
            return
        except (ValueError, OSError, ImportError, RuntimeError) as error:
            found = Outcome(error=self._words(str(error)))
        except Exception:
            number = secrets.token_hex(4)
            _LOG.exception("error %s", number)
            found = Outcome(error=f"Internal error {number}: the server's log says more.")
        if not wanted():
            return
        async with reactive.lock():
            self._done.set((key, found))
            await reactive.flush()
