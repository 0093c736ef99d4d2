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
from nav import campaigns
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
    """The campaign in a process group of its own."""
    command = [sys.executable, campaigns.__file__, str(store), str(num_runs), str(workers)]
    return subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)


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
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        workers = [int(c) for c in children if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]
        if workers:
            os.kill(workers[-1], signal.SIGKILL)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert arrays_of(store) == arrays_of(undisturbed)


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_write_the_same_bytes(undisturbed, tmp_path, workers):
    finished(tmp_path / "study.zarr", 48, workers)
    assert files_of(tmp_path / "study.zarr") == files_of(undisturbed)


def test_threads_write_the_same_bytes(undisturbed, tmp_path):
    with ThreadPoolExecutor(1) as one:
        campaign(48).run(tmp_path / "one.zarr", executor=one)
    assert files_of(tmp_path / "one.zarr") == files_of(undisturbed)


def test_dask_writes_the_same_bytes(undisturbed, tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        assert campaign(48).run(tmp_path / "dask.zarr", executor=client).complete
    assert files_of(tmp_path / "dask.zarr") == files_of(undisturbed)


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
