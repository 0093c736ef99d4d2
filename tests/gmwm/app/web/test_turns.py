"""Computations of pages: one of a page at a time, so many in all, and none for longer than the limit."""

import asyncio
import threading

import pytest

from gmwm_jax.app.web.turns import SupersededError, Turns


@pytest.fixture
def turns():
    """One thread for two pages."""
    made = Turns(1, pages=2, seconds=0.2)
    yield made
    made.end()


def test_what_takes_too_long_is_left_behind_and_others_go_on(turns):
    gate = threading.Event()

    async def both():
        slow, other = turns.of_page(), turns.of_page()
        with pytest.raises(ValueError, match="more than"):
            await slow.run(gate.wait)
        assert await other.run(lambda: 1) == 1  # though the thread of the first is still there
        again = asyncio.ensure_future(slow.run(lambda: 2))
        await asyncio.sleep(0.05)
        assert not again.done()  # a page holds one thread at most
        gate.set()
        return await again

    assert asyncio.run(both()) == 2
    assert turns.running == 0


def test_what_is_later_keeps_nobody_waiting():
    """With two threads: many pages have something for later, and clicks are answered at once, the page's own too."""
    turns, gate, order = Turns(2, pages=5, seconds=10.0), threading.Event(), []

    def slow(number):
        gate.wait(5)
        order.append(number)

    async def all_of_them():
        pages = [turns.of_page() for _ in range(5)]
        waiting = [asyncio.ensure_future(page.run(lambda k=k: slow(k), later=True)) for k, page in enumerate(pages)]
        await asyncio.sleep(0.05)
        for page in pages:
            assert await asyncio.wait_for(page.run(lambda: 1), 2) == 1
        assert not order
        gate.set()
        await asyncio.gather(*waiting)

    asyncio.run(all_of_them())
    turns.end()
    assert order == [0, 1, 2, 3, 4]


def test_what_nobody_wants_any_more_is_not_begun(turns):
    begun = []

    async def one():
        with pytest.raises(SupersededError):
            await turns.of_page().run(lambda: begun.append(1), lambda: False)

    asyncio.run(one())
    assert not begun


def test_a_page_that_asks_for_much_waits_for_itself(turns):
    order = []

    async def many():
        greedy, other = turns.of_page(), turns.of_page()
        await asyncio.gather(
            *(greedy.run(lambda: order.append("greedy")) for _ in range(5)), other.run(lambda: order.append("other"))
        )

    asyncio.run(many())
    assert order.index("other") <= 1
