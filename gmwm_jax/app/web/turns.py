"""Who computes when: one computation of a page at a time, a few in all, and none for longer than the limit.

What stands below the figure that somebody waits for, as the intervals of a fit, is computed later: for one page less at
a time than there are threads, so that it never keeps anybody's click waiting. So a page that asks for much waits for
itself, and not the others for it. Nothing ends a thread: a computation that takes too long is left behind, and the next
one of its page begins when it has come to its end.
"""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any, TypeVar

from gmwm_jax._internal.interrupts import AbandonableExecutor

T = TypeVar("T")


class SupersededError(Exception):
    """Nobody wants the value any more."""


class Turns:
    """The computations of all pages.

    Parameters
    ----------
    num_threads
        That compute at a time.
    pages
        The most that are open; each may leave two computations behind.
    seconds
        That a computation may take.

    Examples
    --------
    >>> import asyncio
    >>> from gmwm_jax.app.web.turns import Turns
    >>> turns = Turns(2, pages=1, seconds=10.0)
    >>> asyncio.run(turns.of_page().run(lambda: 6 * 7))
    42
    >>> turns.end()
    """

    def __init__(self, num_threads: int, *, pages: int, seconds: float):
        self.executor = AbandonableExecutor(num_threads + 2 * pages)
        self.free, self.seconds = asyncio.Semaphore(num_threads), seconds
        self.later = asyncio.Semaphore(max(num_threads - 1, 1))
        self.running = 0
        """How many compute for pages: long work waits a little for them."""

    def of_page(self) -> "PageTurns":
        """Make those of a page."""
        return PageTurns(self)

    def end(self) -> None:
        """Begin nothing any more; what runs is left behind."""
        self.executor.shutdown(wait=False, cancel_futures=True)


class PageTurns:
    """The computations of one page: `Turns.of_page` makes it."""

    def __init__(self, turns: Turns):
        self._turns, self._now, self._later = turns, _Lane(), _Lane()

    async def run(self, work: Callable[[], T], wanted: Callable[[], bool] = lambda: True, *, later: bool = False) -> T:
        """Compute something in a thread when it is this page's turn.

        Parameters
        ----------
        work
            Computes it.
        wanted
            Asked when the turn has come: is the value still of use?
        later
            Nobody waits for it: it does not keep other computations of the page waiting either.

        Raises
        ------
        SupersededError
            It is not.
        ValueError
            It took too long.
        """
        turns, lane = self._turns, self._later if later else self._now
        async with contextlib.AsyncExitStack() as held:
            await held.enter_async_context(lane.lock)
            if lane.left is not None:
                await asyncio.wait({lane.left})
                lane.left = None
            if later:
                await held.enter_async_context(turns.later)
            await held.enter_async_context(turns.free)
            if not wanted():
                raise SupersededError
            turns.running += 1
            try:
                found = asyncio.get_running_loop().run_in_executor(turns.executor, work)
                done, _ = await asyncio.wait({found}, timeout=turns.seconds)
            finally:
                turns.running -= 1
            if done:
                return found.result()
            found.add_done_callback(lambda late: late.cancelled() or late.exception())  # nobody waits for it
            lane.left = found
            raise ValueError(
                f"This took more than {turns.seconds:g} s, the most that this server gives to a computation. It "
                "comes to its end unseen, and this page computes again then: take less data or a smaller model."
            )


class _Lane:
    """Computations of a page of which one runs at a time."""

    def __init__(self) -> None:
        self.lock = asyncio.Lock()
        self.left: asyncio.Future[Any] | None = None
