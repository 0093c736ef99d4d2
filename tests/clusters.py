"""A Dask cluster of processes that tests kill one by one, and a limit on the time of what could wait for ever."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

LIMIT = 300
"""s that a test of a cluster may take, unless it says otherwise."""


@contextlib.contextmanager
def within(seconds=LIMIT):
    """Raise a TimeoutError in the main thread, where tests run, if what is in here is not done by then.

    And again where tidying up after it does not end either.
    """

    def late(number, frame):
        raise TimeoutError(f"not done within {seconds} s")

    former = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds, 60)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, former)


@contextlib.contextmanager
def local_client(num_workers=2):
    """The client of a cluster whose nannies are threads of this process; with its begin and its end in the limit."""
    import distributed

    options = {"n_workers": num_workers, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with within(), distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        yield client


class Cluster:
    """A scheduler and workers, each with its nanny, as processes in groups of their own."""

    def __init__(self, folder, num_workers=2):
        self._file, self._num_workers = Path(folder) / "scheduler.json", num_workers
        self._processes = []
        self.start()

    def start(self):
        """Make it anew."""
        self.kill_all()
        self._file.unlink(missing_ok=True)
        self._scheduler = self._started("dask_scheduler", "--host", "127.0.0.1", "--port", "0")
        while not self._file.exists():
            time.sleep(0.02)
        one = ("--nthreads", "1", "--nworkers", "1")
        self._nannies = [self._started("dask_worker", *one) for _ in range(self._num_workers)]

    def _started(self, program, *options):
        command = [sys.executable, "-m", f"distributed.cli.{program}", "--scheduler-file", str(self._file)]
        environment = os.environ | {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s"}
        silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = subprocess.Popen(
            [*command, "--no-dashboard", *options], start_new_session=True, env=environment, **silent
        )
        self._processes.append(process)
        return process

    @property
    def address(self):
        """Where clients find the scheduler."""
        import json

        return json.loads(self._file.read_text())["address"]

    def kill_scheduler(self):
        """Kill it alone."""
        self._killed(self._scheduler)

    def kill_worker(self, which=0):
        """Kill the process that computes, which its nanny replaces; False where there is none."""
        children = children_of(self._nannies[which].pid)
        for child in children:
            os.kill(child, signal.SIGKILL)
        return bool(children)

    def kill_workers(self):
        """Kill all of them with their nannies: nobody replaces them."""
        for nanny in self._nannies:
            self._killed(nanny)

    def kill_all(self):
        """Kill whatever is there."""
        for process in self._processes:
            self._killed(process)
        self._processes = []

    def _killed(self, process):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def children_of(pid):
    """Processes that Python has spawned for the work of another one."""
    found = []
    for thread in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):  # it, or what it has begun, has ended meanwhile
            for child in thread.read_text().split():
                if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
    return found


@contextlib.contextmanager
def cluster(folder, num_workers=2, seconds=LIMIT):
    """A cluster of processes, none of which is left, within a limit."""
    with within(seconds):
        made = Cluster(folder, num_workers)
        try:
            yield made
        finally:
            made.kill_all()
