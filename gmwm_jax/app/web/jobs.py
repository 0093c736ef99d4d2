"""Long work that a page starts by a button: one of a page at a time, with progress, and cancelled by a button.

The work is told of in a function (done, total), which cancels by raising KeyboardInterrupt: what is done by then is
kept, as by the keyboard. All pages share one queue, so that clicks on them are answered meanwhile.
"""

import asyncio
import logging
import secrets
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, NamedTuple

from shiny import reactive
from shiny.session import Session

from gmwm_jax.app.web.computed import Outcome

_LOG = logging.getLogger("gmwm_jax.app")
_BETWEEN = 0.2
"""Seconds between two looks at how far the work has come."""
_PATIENCE = 1.0
"""Seconds that work stands aside, at each word of its progress, while others compute."""

BUSY = "This page computes already: cancel that first."
"""Said where `Jobs.start` refuses."""

Tell = Callable[[int, int | None], None]
"""What the work calls with what is done and the total."""


class Progress(NamedTuple):
    """How far work has come."""

    done: int = 0
    total: int | None = None
    seconds: float | None = None
    """Since it began; None while it waits for other pages."""
    cancelled: bool = False

    def sentence(self) -> str:
        """Say it.

        Examples
        --------
        >>> from gmwm_jax.app.web.jobs import Progress
        >>> Progress(120, 500, 2.0).sentence()
        '120 of 500, about 6 s left'
        """
        if self.cancelled:
            return "cancelling .. (what runs now comes to its end first; a compilation takes some seconds)"
        if self.seconds is None:
            return "waiting for the work of other pages .."
        if not self.done or not self.total:
            return "running .. (a model that is new to the server is compiled once, some seconds)"
        left = self.seconds / self.done * (self.total - self.done)
        return f"{self.done} of {self.total}, about {left:.0f} s left"


class _Run:
    """One piece of work: what its thread and the page tell each other."""

    def __init__(self, work: Callable[[Tell], Any], most: float, others: Callable[[], bool]):
        self._work, self._most, self._others = work, most, others
        self._stop = threading.Event()
        self._at: tuple[int, int | None] = 0, None
        self._began: float | None = None

    def cancel(self) -> None:
        """Ask it to end."""
        self._stop.set()

    def progress(self) -> Progress:
        """How far it has come."""
        seconds = None if self._began is None else time.monotonic() - self._began
        return Progress(*self._at, seconds, self._stop.is_set())

    def _tell(self, done: int, total: int | None) -> None:
        self._at = done, total
        assert self._began is not None  # it is told by the work, which has begun
        aside = time.monotonic() + _PATIENCE
        while self._others() and not self._stop.is_set() and time.monotonic() < aside:
            time.sleep(0.02)
        if self._stop.is_set() or time.monotonic() - self._began > self._most:
            raise KeyboardInterrupt

    def __call__(self) -> Any:
        """Do the work; None if nothing of it is left. No interrupt leaves this thread."""
        if self._stop.is_set():
            return None
        self._began = time.monotonic()
        try:
            return self._work(self._tell)
        except KeyboardInterrupt:
            return None


class Jobs:
    """The long work of one page.

    Parameters
    ----------
    session
        Of the page.
    queue
        Threads that do such work for all pages.
    most
        Seconds after which work is cancelled.
    words
        Python in a message -> the same as the page has it.
    others
        Is something computed at a click? Work stands aside then.
    """

    def __init__(
        self,
        session: Session,
        queue: Executor,
        most: float,
        words: Callable[[str], str] = str,
        others: Callable[[], bool] = lambda: False,
    ):
        self._session, self._queue, self._most, self._words, self._others = session, queue, most, words, others
        self._done: reactive.Value[dict[str, tuple[Any, Outcome[Any]]]] = reactive.Value({}, name="jobs")
        self._run: _Run | None = None
        self._tasks: set[asyncio.Task[None]] = set()
        session.on_ended(self.cancel)

    def start(self, name: str, key: Any, work: Callable[[Tell], Any]) -> bool:
        """Begin work, unless this page has some: False then.

        Parameters
        ----------
        name
            Of the kind of work: the newest result of each is kept.
        key
            All inputs that the result is of.
        work
            Is given the function to tell of progress.
        """
        if self._run is not None:
            return False
        self._run = _Run(work, self._most, self._others)
        task = asyncio.get_running_loop().create_task(self._follow(name, key, self._run))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return True

    def cancel(self) -> None:
        """End what runs; what is done is kept."""
        if self._run is not None:
            self._run.cancel()

    def result(self, name: str, key: Any) -> Outcome[Any]:
        """Return what is there for these inputs: an empty outcome if nothing is; reactive."""
        found = self._done().get(name)
        return found[1] if found is not None and found[0] == key else Outcome()

    async def _follow(self, name: str, key: Any, run: _Run) -> None:
        waited = asyncio.ensure_future(asyncio.get_running_loop().run_in_executor(self._queue, run))
        while not waited.done():
            await self._show(run.progress())
            await asyncio.wait({waited}, timeout=_BETWEEN)
        try:
            value = waited.result()
            found = Outcome(value=value, error="" if value is not None else "Cancelled before anything was done.")
        except (ValueError, OSError, ImportError, RuntimeError) as error:
            found = Outcome(error=self._words(str(error)))
        except Exception:
            number = secrets.token_hex(4)
            _LOG.exception("error %s", number)
            found = Outcome(error=f"Internal error {number}: the server's log says more.")
        self._run = None
        await self._show(None)
        async with reactive.lock():
            with reactive.isolate():
                known = self._done()
            self._done.set({**known, name: (key, found)})
            await reactive.flush()

    async def _show(self, progress: Progress | None) -> None:
        """Tell the page, which has one place for it."""
        message = None if progress is None else {**progress._asdict(), "text": progress.sentence()}
        await self._session.send_custom_message("gmwm-job", {"job": message})
