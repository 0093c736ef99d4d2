"""Tasks that nobody takes end in a sentence after a time that is stated, and do not wait for ever."""

import time
from concurrent.futures import CancelledError, Executor, Future
from types import SimpleNamespace

import pytest

from gmwm_jax._internal import executors
from gmwm_jax._internal.executors import InThisThread, Pool
from gmwm_jax._internal.tasks import carry_out

config = pytest.importorskip("dask.config")

HERE = "tcp://here:1"
AT_WORK = {"status": "running"}
BUSY = {"status": "paused", "metrics": {"task_counts": {"executing": 1}}}
SHORT_OF_MEMORY = {"status": "paused", "metrics": {"task_counts": {"ready": 3}}}


class Client(Executor):
    """A Dask Client and its executor in one, which says what it is told of its workers, and computes nothing."""

    def __init__(self, *workers, asked=None):
        self.workers, self.status, self.scheduler = list(workers), "running", SimpleNamespace(address=HERE)
        self.cluster, self.num_asked, self.asked, self.futures = None, 0, asked, []

    def get_executor(self):
        return self

    def scheduler_info(self):
        self.num_asked += 1
        if self.asked is not None:
            self.asked(self)
        return {"workers": dict(enumerate(self.workers))}

    def submit(self, fn, /, *args, **kwargs):
        self.futures.append(Future())
        return self.futures[-1]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(executors, "_ASK", 0.01)


def carried_out(client, num=2):
    """Tasks by number -> what came of them."""
    found = {}

    def take(task, result):
        found[task] = result

    tasks = [(i,) for i in range(num)]
    carry_out(iter([tasks]), abs, (), Pool(client, InThisThread), take, died=lambda why, of: f"{why}: {of}")
    return found


@pytest.mark.parametrize("workers", [(), (SHORT_OF_MEMORY,)])
def test_without_workers(workers):
    client = Client(*workers)
    begin = time.monotonic()
    with (
        config.set({"distributed.scheduler.no-workers-timeout": "100ms"}),
        pytest.raises(
            RuntimeError, match=rf"^No worker of the Dask cluster at {HERE} has taken tasks for 0.1 s: .*0.*1"
        ),
    ):
        carried_out(client)
    assert 0.1 < time.monotonic() - begin < 10
    assert all(future.cancelled() for future in client.futures)


@pytest.mark.parametrize(("cluster", "seconds"), [("LocalCluster", "0.05"), ("SLURMCluster", "0.3")])
def test_a_queue_is_awaited_longer_than_this_machine(monkeypatch, cluster, seconds):
    monkeypatch.setattr(executors, "_ABSENT_HERE", 0.05)
    monkeypatch.setattr(executors, "_ABSENT_ELSEWHERE", 0.3)
    client = Client()
    client.cluster = type(cluster, (), {})()
    with pytest.raises(RuntimeError, match=f"has taken tasks for {seconds} s"):
        carried_out(client)


@pytest.mark.parametrize("worker", [AT_WORK, BUSY])
def test_who_is_at_work_is_awaited(monkeypatch, worker):
    """And the time without workers counts from when there was the last one: by the clock, here, three times in four."""

    def asked(client):
        client.workers = [] if client.num_asked % 4 else [worker]
        if client.num_asked == 40:
            for future in client.futures:
                future.set_result("done")

    client = Client(worker, asked=asked)
    monkeypatch.setattr(executors, "time", SimpleNamespace(monotonic=lambda: client.num_asked))
    with config.set({"distributed.scheduler.no-workers-timeout": "3s"}):
        assert carried_out(client) == {(0,): "done", (1,): "done"}
    assert client.num_asked >= 40


def test_after_a_result_the_time_counts_anew(monkeypatch):
    """Workers that come for one task each, and are never seen: as long without any, in all, ends nothing."""

    def asked(client):
        if client.num_asked % 3 == 0:
            client.futures[client.num_asked // 3 - 1].set_result("done")

    client = Client(asked=asked)
    monkeypatch.setattr(executors, "time", SimpleNamespace(monotonic=lambda: client.num_asked))
    with config.set({"distributed.scheduler.no-workers-timeout": "4s"}):
        assert carried_out(client, 5) == {(i,): "done" for i in range(5)}


def test_it_is_said_before(monkeypatch):
    monkeypatch.setattr(executors, "_ABSENT_SAID", 0.05)
    with (
        config.set({"distributed.scheduler.no-workers-timeout": "200ms"}),
        pytest.warns(UserWarning, match=rf"No worker .* at {HERE} takes tasks; they are awaited for 0.2 s") as said,
        pytest.raises(RuntimeError, match="has taken tasks"),
    ):
        carried_out(Client())
    assert len(said) == 1


def test_a_scheduler_that_has_ended():
    """Its client takes tasks all the same, and says nothing of them."""
    client = Client(AT_WORK)
    client.status = "closed"
    with pytest.raises(RuntimeError, match=f"^The scheduler of the Dask cluster at {HERE} has ended: "):
        carried_out(client)
    assert not any(future.cancelled() for future in client.futures), "nobody is there who could be asked to"


class GivesBack(Client):
    """Each task comes back so many times without a word, as where the scheduler is away for a while."""

    def __init__(self, times):
        super().__init__(AT_WORK)
        self.times = {(i,): times for i in range(3)}

    def submit(self, fn, /, *args, **kwargs):
        future = super().submit(fn, *args)
        if self.times[args]:
            self.times[args] -= 1
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_result(args[0])
        return future


def test_what_comes_back_undone_is_given_out_again():
    assert carried_out(GivesBack(2), 3) == {(0,): 0, (1,): 1, (2,): 2}


def test_what_always_comes_back_is_given_up():
    found = carried_out(GivesBack(1000), 3)
    assert [type(result) for result in found.values()] == [CancelledError] * 3


def test_executors_that_cannot_be_asked_are_awaited():
    class Slow(Executor):
        def submit(self, fn, /, *args, **kwargs):
            return InThisThread().submit(fn, *args)

    assert Pool(Slow(), InThisThread).asked_after is None
    assert carried_out(Slow()) == {(0,): 0, (1,): 1}
