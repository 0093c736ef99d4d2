"""Long work of a page: it ends at its limit with what is done; what went wrong is a sentence, or a number."""

import asyncio
import logging
import time
from concurrent.futures import ThreadPoolExecutor

from shiny import reactive

from gmwm_jax.app.web.jobs import Jobs


class Session:
    """Of the framework, as far as jobs know one."""

    def __init__(self):
        self.told = []

    def on_ended(self, _):
        pass

    async def send_custom_message(self, _, message):
        self.told.append(message["job"])


def outcome(work, most=60.0):
    """Of work that is begun and followed to its end, and what the page was told meanwhile."""
    session = Session()

    async def follow(queue):
        jobs = Jobs(session, queue, most)
        assert jobs.start("work", 1, work)
        assert not jobs.start("work", 1, work)  # one of a page at a time
        while True:
            await asyncio.sleep(0.01)
            with reactive.isolate():
                found = jobs.result("work", 1)
            if found.value is not None or found.error:
                return found

    with ThreadPoolExecutor(1) as queue:
        return asyncio.run(follow(queue)), session.told


def endless(tell):
    """Work that keeps what is done when it is cancelled."""
    for done in range(10_000):
        try:
            tell(done, 10_000)
        except KeyboardInterrupt:
            return done
        time.sleep(0.01)
    raise AssertionError("it was not ended")


def test_work_that_takes_too_long_keeps_what_is_done():
    found, told = outcome(endless, most=0.5)
    assert 0 < found.value < 10_000
    assert told[-1] is None  # the place of its progress is empty again
    assert any(t and t["total"] == 10_000 for t in told)


def test_errors_are_sentences_and_unknown_ones_a_number(caplog):
    def refuse(tell):
        raise ValueError("there is no such model")

    def break_(tell):
        raise KeyError("/secret/path")

    assert outcome(refuse)[0].error == "there is no such model"
    with caplog.at_level(logging.ERROR):
        error = outcome(break_)[0].error
    number = error.split()[2].rstrip(":")
    assert error.startswith("Internal error")
    assert "secret" not in error
    assert number in caplog.text


def test_that_nothing_is_done_is_said():
    assert outcome(lambda tell: tell(0, 1), most=0.0)[0].error == "Cancelled before anything was done."
