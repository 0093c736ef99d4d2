"""A process that saves results is killed at any moment: the old file is there or the new one, and nothing else."""

import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import assert_same_result

import gmwm_jax as gj

ROOT = Path(__file__).resolve().parents[3]
FORMATS = (".npz", ".json", ".nc", ".zarr")

WRITER = """
import sys
import time
import jax
jax.config.update("jax_enable_x64", True)
import gmwm_jax as gj

*sources, target = sys.argv[1:]
results = [gj.load(source) for source in sources]
def save():
    for result in results:
        result.save(target)

save()  # imports what it needs
start = time.perf_counter()
save()
print(time.perf_counter() - start, flush=True)
while True:
    save()
"""


@pytest.fixture(scope="module")
def results():
    """Two that differ in size: a bootstrap and its fit."""
    fit = gj.fit(gj.wavelet_variance(gj.datasets.simulated("mti-g", 5000, channels=["accel_x"])), "WN + RW")
    return [gj.bootstrap(fit, 500, key=jax.random.key(0)), fit]


@pytest.mark.parametrize(("suffix", "num_kills"), list(zip(FORMATS, (13, 12, 13, 12), strict=True)))
def test_a_kill_at_any_moment(results, tmp_path, suffix, num_kills):
    sources = [r.save(tmp_path / f"{i}.npz") for i, r in enumerate(results)]
    folder, rng, left = tmp_path / "x", np.random.default_rng(len(suffix)), 0
    folder.mkdir()
    path = results[0].save(folder / f"x{suffix}")
    for _ in range(num_kills):
        command = [sys.executable, "-c", WRITER, *map(str, sources), str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT) as writer:
            assert writer.stdout is not None
            time.sleep(rng.uniform(0, 2 * float(writer.stdout.readline())))
            writer.kill()
        left += len(list(folder.iterdir())) > 1 or not path.exists()
        found = gj.load(path)
        assert_same_result(found, results[0 if isinstance(found, type(results[0])) else 1])
    assert left  # it was killed in the middle of a file, or this shows nothing
    results[1].save(path)
    assert [p.name for p in folder.iterdir()] == [path.name]
    assert_same_result(gj.load(path), results[1])
