"""Bootstraps under fire: processes that are killed, and engines; their programs are compiled as those of users."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest
from clusters import cluster, local_client
from helpers import assert_same_result
from programs import fitted

import gmwm_jax as gj

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    """Workers find the programs compiled, as those of one bootstrap do."""
    with pytest.MonkeyPatch.context() as patch:
        if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
            patch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        patch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
        patch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]))
        yield


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """As a file has it."""
    return gj.load(fitted().save(tmp_path_factory.mktemp("fit") / "fit.npz"))


def replicated(fit, num=200, **options):
    return gj.bootstrap(fit, num, key=jax.random.key(3), **options)


def chunks_of(store):
    return {file.name: file.read_bytes() for file in Path(store).glob("*.npz")}


@pytest.fixture(scope="module")
def boot(fit):
    """In this thread, without a store."""
    return replicated(fit)


def test_processes_change_no_bit(fit, boot):
    for num in (1, 2):
        assert_same_result(replicated(fit, executor=gj.inference.processes(num), store=f"of_{num}"), boot)
    assert chunks_of("of_1") == chunks_of("of_2")


def test_dask_changes_no_bit(fit, boot):
    pytest.importorskip("distributed")
    with local_client() as client:
        assert_same_result(replicated(fit, executor=client), boot)


def test_a_cluster_whose_workers_are_gone(fit, tmp_path):
    """The bootstrap ends in a sentence, and goes on in this thread."""
    distributed, config = pytest.importorskip("distributed"), pytest.importorskip("dask.config")
    ended = r"^No worker of the Dask cluster at tcp://\S+ has taken tasks for 5 s while it had one of the chunks of"
    with cluster(tmp_path) as dask, distributed.Client(dask.address) as client:

        def kills(done, total):
            if done == 64:
                dask.kill_workers()

        with (
            config.set({"distributed.scheduler.no-workers-timeout": "5s"}),
            pytest.raises(RuntimeError, match=f"{ended} replicates from .*: what is whole in store is kept"),
        ):
            replicated(fit, 640, executor=client, store="store", progress=kills)
    assert 0 < len(chunks_of("store")) < 10
    assert_same_result(replicated(fit, 640, store="store"), replicated(fit, 640))


def test_a_process_that_ends_after_any_file_operation(tmp_path):
    """Truly, with `os._exit`: what it leaves is gone on with by another process."""
    command = [sys.executable, str(ROOT / "tests" / "gmwm" / "exits_of_bootstraps.py"), str(tmp_path), "1"]
    said = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert said.returncode == 0, said.stderr
    assert int(said.stdout) > 20


PROGRAM = """
import sys
import jax
jax.config.update("jax_enable_x64", True)
import gmwm_jax as gj
if __name__ == "__main__":
    workers = int(sys.argv[1])
    executor = gj.inference.processes(workers) if workers else None
    options = {"key": jax.random.key(3), "route": "records", "executor": executor}
    gj.bootstrap(gj.load("fit.npz"), 640, store=sys.argv[2], **options)
"""


@pytest.mark.parametrize("workers", [0, 2])
def test_kill_9_of_all_at_random_moments(fit, workers):
    """What is whole stays as it is, what was in flight is done again, and the end is the undisturbed one."""
    fit.save("fit.npz")
    Path("program.py").write_text(PROGRAM)
    undisturbed = replicated(fit, 640, route="records", store="undisturbed")
    draw, store, kills = np.random.default_rng(17), Path("store"), 0

    def whole():
        return {file.name: file.stat().st_mtime_ns for file in store.glob("*.npz")} if store.exists() else {}

    def started():
        command = [sys.executable, "program.py", str(workers), "store"]
        return subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)

    for count in (0, 2, 5):
        before, process = whole(), started()
        while process.poll() is None and len(whole()) < max(count, len(before) + (count > 0)):
            time.sleep(0.002)
        time.sleep(0.1 * draw.random())
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
        process.stderr.close()
        after = whole()
        assert {name: after[name] for name in before} == before
    process = started()
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert kills == 3
    assert chunks_of(store) == chunks_of("undisturbed")
    assert_same_result(replicated(fit, 640, route="records", store="store"), undisturbed)
