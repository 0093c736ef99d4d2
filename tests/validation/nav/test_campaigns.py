"""Campaigns under fire: processes that are killed, files that are damaged one by one, engines, memory, and the cost."""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np
import pytest
from clusters import LIMIT, children_of, cluster, local_client, within
from nav import campaigns, exits_of_campaigns
from nav.campaigns import arrays_of, campaign, files_of

import nav_jax as nj

pytest.importorskip("zarr")
pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """Workers find the programs compiled, as those of one campaign do."""
    with pytest.MonkeyPatch.context() as patch:
        if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
            patch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]))
        yield


def started(store, num_runs, workers=0):
    """The campaign in a process group of its own; the workers are a number, or the address of a scheduler."""
    command = [sys.executable, campaigns.__file__, str(store), str(num_runs), str(workers)]
    environment = os.environ | {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s"}
    return subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True, env=environment)


def finished(store, num_runs, workers=0):
    process = started(store, num_runs, workers)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """48 runs: 12 chunks, by threads of a fresh process."""
    store = tmp_path_factory.mktemp("undisturbed") / "study.zarr"
    finished(store, 48)
    return store


def marks(store):
    """When the checksum of each chunk was written."""
    of = store / "scenarios" / "drive" / "done" / "c"
    return {file.name: file.stat().st_mtime_ns for file in of.glob("*[0-9]")}


def wait_for(store, count, process):
    """Until so many chunks are there, or the process has ended."""
    while process.poll() is None and len(marks(store)) < count:
        time.sleep(0.002)


@pytest.mark.parametrize(("workers", "num_kills"), [(0, 4), (2, 4), (0, 20), (2, 20)])
def test_kill_9_of_all_at_random_moments(tmp_path, workers, num_kills):
    """What is whole stays as it is, what was in flight is done again, and the end is the undisturbed one.

    Five chunks of 4 runs for each kill, which comes after none to two more of them: two workers are quick at the end.
    """
    draw, store, undisturbed = random.Random(17), tmp_path / "study.zarr", tmp_path / "undisturbed.zarr"
    num_runs, kills, repeated = 20 * (num_kills + 1), 0, 0
    while kills < num_kills:
        before = marks(store)
        process = started(store, num_runs, workers)
        wait_for(store, len(before) + draw.choice([0, 1, 2]), process)
        time.sleep(0.05 * draw.random())
        assert process.poll() is None, "it ended before it was killed"
        os.killpg(process.pid, signal.SIGKILL)
        kills += 1
        process.wait()
        process.stderr.close()
        after = marks(store)
        repeated += sum(after[chunk] != time for chunk, time in before.items())
    finished(store, num_runs, workers)
    assert not repeated, "what was whole was computed again"
    finished(undisturbed, num_runs)
    assert arrays_of(store) == arrays_of(undisturbed)
    assert not nj.Campaign.open(store).status().num_missing


def test_kill_9_of_a_worker(undisturbed, tmp_path):
    """The pool is replaced, and the campaign goes on by itself."""
    store = tmp_path / "study.zarr"
    process = started(store, 48, 2)
    for count in (1, 5):
        wait_for(store, count, process)
        if workers := children_of(process.pid):
            os.kill(workers[-1], signal.SIGKILL)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert arrays_of(store) == arrays_of(undisturbed)


class Late(ThreadPoolExecutor):
    """Threads that wait, each task for as long as chance has it: they end in another order."""

    def __init__(self, workers):
        super().__init__(workers)
        self._draw = random.Random(5)

    def submit(self, fn, /, *args, **kwargs):
        wait = self._draw.random() / 10
        return super().submit(lambda: (time.sleep(wait), fn(*args, **kwargs))[1])


ENGINES = {
    "threads": ThreadPoolExecutor,
    "late threads": Late,
    "processes": lambda workers: nj.campaign.processes(workers)(),
    "Dask": local_client,
}

DIFFERENT = {"right": campaigns.RIGHT, "wrong": nj.ImuErrors("WN(sigma2=1e-1)", "WN(sigma2=1e-2)", campaigns.RATE)}
STOP = "significant"


def to_be_stopped():
    return campaign(512, filters=DIFFERENT)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """Chunks up to the look that told two filters apart, by the threads of this process."""
    study, store = to_be_stopped(), tmp_path_factory.mktemp("stopped") / "study.zarr"
    assert study.run(store, stop=STOP).complete
    looks = study.comparison(stop=STOP).stopped.looks
    assert 1 < len(looks) < len(nj.simulation.Significant().looks(512)), "this is about a stop at neither end"
    return store


@pytest.mark.parametrize("workers", [1, 2, 8])
@pytest.mark.parametrize("engine", ENGINES)
def test_engines_and_their_workers_change_no_bit_and_no_stop(undisturbed, stopped, tmp_path, engine, workers):
    if engine == "Dask":
        pytest.importorskip("distributed")
    study = to_be_stopped()
    with within(LIMIT), ENGINES[engine](workers) as executor:
        assert campaign(48).run(tmp_path / "all.zarr", executor=executor).complete
        assert study.run(tmp_path / "stopped.zarr", executor=executor, stop=STOP).complete
    assert files_of(tmp_path / "all.zarr") == files_of(undisturbed)
    assert files_of(tmp_path / "stopped.zarr") == files_of(stopped)
    assert study.comparison(stop=STOP).stopped == nj.Campaign.open(stopped).comparison(stop=STOP).stopped


def test_kill_9_of_workers_clients_and_schedulers_of_dask(tmp_path):
    """In turn, and of all: what is whole stays, at most what the two workers had is done twice, and nobody hangs.

    Each comes when there is work under way: ten chunks of 4 runs for each, and after three to five more of them, of
    which those that had a client that was killed do two at most.
    """
    pytest.importorskip("distributed")
    draw, store, undisturbed = random.Random(11), tmp_path / "study.zarr", tmp_path / "undisturbed.zarr"
    num_kills, kills, seen, client = 20, 0, {}, None
    num_runs = 40 * (num_kills + 1)
    with cluster(tmp_path, seconds=1800) as dask:
        while kills < num_kills:
            client = client or started(store, num_runs, dask.address)
            wait_for(store, len(seen) + draw.choice([3, 4, 5]), client)
            time.sleep(0.05 * draw.random())
            assert client.poll() is None, client.stderr.read()
            which = ("worker", "client", "scheduler", "all")[kills % 4]
            if which == "worker" and not dask.kill_worker(draw.randrange(2)):
                continue  # it is only beginning
            kills += 1
            if which == "scheduler":
                dask.kill_scheduler()
                said = client.communicate(timeout=120)[1]
                assert client.returncode == 1
                assert "what is whole in" in said.splitlines()[-1], said
            elif which != "worker":
                os.killpg(client.pid, signal.SIGKILL)
                client.communicate()
            if which == "all":
                dask.kill_all()
            if which in ("scheduler", "all"):
                dask.start()
            client = client if which == "worker" else None
            now = marks(store) if store.exists() else {}
            assert sum(now[chunk] != when for chunk, when in seen.items()) <= 2, which
            seen = now
        if client is not None:
            client.communicate(timeout=LIMIT)
        finished(store, num_runs, dask.address)
    finished(undisturbed, num_runs)
    assert arrays_of(store) == arrays_of(undisturbed)
    assert not nj.Campaign.open(store).status().num_missing


def test_a_cluster_whose_workers_are_gone(tmp_path):
    """The campaign ends in a sentence, and goes on with whoever is there."""
    distributed, config = pytest.importorskip("distributed"), pytest.importorskip("dask.config")
    store = tmp_path / "study.zarr"
    ended = r"^No worker of the Dask cluster at tcp://\S+ has taken tasks for 5 s while it had one of the chunks drive"
    with cluster(tmp_path) as dask, distributed.Client(dask.address) as client:

        def kills(done, total):
            if done == 2:
                dask.kill_workers()

        with (
            config.set({"distributed.scheduler.no-workers-timeout": "5s"}),
            pytest.raises(RuntimeError, match=f"{ended}.*: what is whole in .*study.zarr is kept"),
        ):
            campaign(400).run(store, executor=client, progress=kills)
    assert 0 < nj.Campaign.open(store).status().num_missing <= 98
    campaign(400).run(store)
    campaign(400).run(tmp_path / "undisturbed.zarr")
    assert arrays_of(store) == arrays_of(tmp_path / "undisturbed.zarr")


@pytest.mark.parametrize("step", [1, 50])
def test_a_process_that_ends_after_any_file_operation(tmp_path, step):
    """Truly, with `os._exit`: what it leaves is gone on with by another process."""
    command = [sys.executable, exits_of_campaigns.__file__, str(tmp_path), str(step)]
    said = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    assert said.returncode == 0, said.stderr
    assert int(said.stdout) > 300


@pytest.mark.parametrize("how", ["truncated", "deleted", "flipped"])
def test_every_file(tmp_path, how):
    """None that is damaged is believed: the arrays end as they were."""
    draw = random.Random(3)
    done = tmp_path / "done.zarr"
    campaign(8).run(done)
    expected, arrays = files_of(done), arrays_of(done)
    for name, content in expected.items():
        store = shutil.copytree(done, tmp_path / "study.zarr")
        if how == "deleted":
            (store / name).unlink()
        else:
            damaged = bytearray(content[: draw.randrange(len(content))] if how == "truncated" else content)
            if how == "flipped":
                damaged[draw.randrange(len(damaged))] ^= 1 << draw.randrange(8)
            (store / name).write_bytes(damaged)
        found = campaigns_of(store)
        assert found is None or found == arrays, name
        assert arrays_of(store) == arrays, name
        shutil.rmtree(store)


def campaigns_of(store):
    """Run the campaign again, warned or not; what it held before is told by `Campaign.status`."""
    import warnings

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert campaign(8).run(store).complete
    assert len(said) <= 1
    return arrays_of(store)


PEAKS = """
import tracemalloc
from nav.campaigns import campaign
from nav_jax.campaign import tasks
arrays = tasks.bench_of(campaign(4)._specification, "drive").compute(0)
tasks.Bench.compute = lambda self, chunk: arrays  # made up, so that many are there at once
campaign(40).run("first.zarr")
for num_runs in 80, 400:
    tracemalloc.start()
    campaign(num_runs).run(f"{num_runs}.zarr")
    print(tracemalloc.get_traced_memory()[1])
    tracemalloc.stop()
"""


def test_memory_does_not_grow_with_the_runs(tmp_path):
    """Of a fresh process that sends tasks and computes them in threads."""
    said = subprocess.run([sys.executable, "-c", PEAKS], cwd=tmp_path, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    few, many = map(int, said.stdout.split())
    assert many < 1.25 * few + 500_000, (few, many)


SPECIFICATIONS = {
    "shared gains": {"num_runs": 4096, "gains": "reference"},
    "gains of their own": {"num_runs": 2048, "gains": "estimate"},
    "all of every run": {"num_runs": 256, "keep": "runs"},
}


@pytest.mark.parametrize("name", SPECIFICATIONS)
def test_cost_is_what_is_used(name, tmp_path):
    """Within 25 %, in the middle one of three comparisons, since other work on the machine takes part in each."""
    reference = nj.motions.lemniscate(60.0, 50.0)
    scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", 50.0)
    study = nj.Campaign(scenario, truth, key=jax.random.key(1), **SPECIFICATIONS[name])
    shares = []
    for i in range(3):
        cost = study.cost()
        begin = time.process_time()
        study.run(tmp_path / f"{i}.zarr")
        used = time.process_time() - begin
        shares.append(cost.chunk_seconds * cost.num_chunks / used)
    assert abs(sorted(shares)[1] - 1) < 0.25, shares
    num_bytes = sum(map(len, files_of(tmp_path / "0.zarr").values()))
    np.testing.assert_allclose(cost.num_bytes, num_bytes, rtol=0.25)


def guide():
    """The Python of the room's guide to clusters: Dask, a job of an array, the job that gathers."""
    text = nj.campaign.__doc__ or ""
    return re.findall(r"^```py\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def test_the_guide_to_slurm_with_workers_of_this_machine(undisturbed, tmp_path, monkeypatch):
    distributed, jobqueue = pytest.importorskip("distributed"), pytest.importorskip("dask_jobqueue")
    scripts = []

    def here(**options):
        """The script of a job is that of dask-jobqueue; the workers are none of SLURM."""
        with jobqueue_cluster(interface="lo", scheduler_options={"dashboard_address": None}, **options) as real:
            scripts.append(real.job_script())
        cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
        cluster.adapt = lambda maximum_jobs: None
        return cluster

    jobqueue_cluster = jobqueue.SLURMCluster
    monkeypatch.setattr(jobqueue, "SLURMCluster", here)
    monkeypatch.chdir(tmp_path)
    with within(LIMIT):
        exec(guide()[0], {"study": campaign(48)})
    assert files_of(tmp_path / "study.zarr") == files_of(undisturbed)
    for said in ("--cpus-per-task=8", "--nworkers 8", "--nthreads 1", "-t 02:00:00", "export GMWM_JAX_NUM_THREADS=1"):
        assert said in scripts[0]


def test_the_guide_to_arrays_of_jobs(undisturbed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    size = campaign(48)._definition.chunk_size
    part = guide()[1].replace("// 16", f"// {size}")
    for k in range(10):
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", str(k))
        exec(part, {"study": campaign(48), "os": os})
    found = {}
    exec(guide()[2], {"nj": nj, "Path": Path}, found)
    assert found["whole"].status().complete
    assert arrays_of(tmp_path / "whole.zarr") == arrays_of(undisturbed)
