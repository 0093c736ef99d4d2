"""Work that needs more memory than there is: refused before it begins, by an estimate that is near the truth."""

import time
import tracemalloc
from pathlib import Path

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax._internal import memory
from gmwm_jax._internal.memory import MEMORY_VARIABLE, OutOfMemoryError, available_memory, require_memory
from gmwm_jax.processes.registry import MAX_PROCESSES, parse_model
from gmwm_jax.processes.simulation import bytes_of_draw, simulate, simulate_each

MODEL = "WN(sigma2=1.0) + RW(gamma2=1e-4)"


def test_the_memory_of_this_machine(monkeypatch):
    monkeypatch.delenv(MEMORY_VARIABLE, raising=False)
    there = available_memory()
    assert there is None or 1e7 < there < 1e14


def test_the_environment_overrules_it(monkeypatch):
    monkeypatch.setenv(MEMORY_VARIABLE, "3GB")
    assert available_memory() == 3 * 10**9
    require_memory(3 * 10**9, "It", "ask for less")
    with pytest.raises(OutOfMemoryError, match=r"It would take about 3\.3 GB of memory, and 3 GB are there: ask for"):
        require_memory(3_300_000_000, "It", "ask for less")
    monkeypatch.setenv(MEMORY_VARIABLE, "much")
    with pytest.raises(ValueError, match=r"GMWM_JAX_MAX_MEMORY is a size such as \"8GB\", and is 'much'"):
        available_memory()


@pytest.mark.parametrize(
    ("files", "left"),
    [
        ({"memory.max": "1000", "memory.current": "700", "memory.stat": "anon 1\ninactive_file 200\n"}, 500),
        ({"memory.max": "max", "memory.current": "700", "memory.stat": ""}, None),
        ({"memory.max": "1000", "memory.current": "1700", "memory.stat": ""}, 0),
        ({}, None),
    ],
)
def test_the_limit_of_a_container(tmp_path, files, left):
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert memory._left(tmp_path, "memory.max", "memory.current", "inactive_file") == left


BIG = 10**13
"""Of anything: no machine has the memory."""


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: simulate(MODEL, BIG, key=jax.random.key(0)), "10000000000000 samples of WN.* draw fewer samples"),
        (lambda: gj.datasets.simulated("mti-g", BIG), r"samples of 6 channels .* \(num_samples\) or channels"),
    ],
)
def test_too_large(ask, message):
    begin = time.perf_counter()
    with pytest.raises(OutOfMemoryError, match=message):
        ask()
    assert time.perf_counter() - begin < 2


@pytest.fixture(scope="module")
def fit():
    key = jax.random.key(3)
    wv = gj.wavelet_variance(np.asarray(simulate("WN(sigma2=1.0)", 2000, key=key)), rate=1.0)
    return gj.fit(wv, "WN")


@pytest.mark.parametrize("route", ["records", "variances"])
def test_too_many_replicates(fit, route):
    with pytest.raises(OutOfMemoryError, match=r"10000000000000 replicates .* \(num_replicates\)"):
        gj.bootstrap(fit, BIG, key=jax.random.key(0), route=route)


def test_nothing_is_estimated_of_what_is_traced(monkeypatch):
    monkeypatch.setenv(MEMORY_VARIABLE, "1")
    assert simulate_each(parse_model("WN(sigma2=1.0)"), jax.random.split(jax.random.key(0), 2), 100).shape == (2, 100)


def resident(name):
    """Of the status of this process, in bytes."""
    text = Path("/proc/self/status").read_text()
    return next(1024 * int(line.split()[1]) for line in text.splitlines() if line.startswith(name))


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="The peak of the memory is told by Linux.")
def test_a_draw_takes_what_is_estimated():
    num, model = 1_000_000, parse_model(MODEL)
    key = jax.random.key(0)
    kept = simulate(model, num, key=key).block_until_ready()  # what is compiled stays
    before = resident("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    more = [simulate(model, num, key=jax.random.key(i)).block_until_ready() for i in range(2)]
    taken = resident("VmHWM") - before - kept.nbytes
    assert len(more) == 2
    assert taken < 2 * bytes_of_draw(model, num)


def test_models_of_many_processes():
    for text in ("999999999999*GM", "101*GM", "60*GM + 50*GM", "9" * 10_000 + "*GM"):
        with pytest.raises(ValueError, match="has more than 100 processes: the longest record") as caught:
            parse_model(text)
        assert len(str(caught.value)) < 400
    assert len(parse_model(f"{MAX_PROCESSES}*GM").processes) == MAX_PROCESSES
    for text in ("ARMA(999999,2)", "AR(100000)"):
        with pytest.raises(ValueError, match="orders up to"):
            parse_model(text)


@pytest.mark.slow
def test_an_estimate_counts_what_is_there():
    """The arrays of NumPy of a simulated recording, of which the draw itself is none."""
    num = 300_000
    tracemalloc.start()
    try:
        rec = gj.datasets.simulated("mti-g", num, channels=["gyro_x", "gyro_y"])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    estimate = 2 * memory.FLOAT * num * 2
    assert rec.data.shape == (num, 2)
    assert estimate / 2 < peak < 2 * estimate
