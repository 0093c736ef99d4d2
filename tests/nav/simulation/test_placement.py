"""Runs over several devices: the same bits, and no word between the devices."""

import inspect
import re

import jax
import numpy as np
import pytest
from jax.sharding import NamedSharding, PartitionSpec
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal import cores
from nav_jax.filter.experiment import Setup, draw_inputs, gains_of, run_filter
from nav_jax.simulation import _placement
from nav_jax.simulation._placement import placement

KEY = jax.random.key(3)
REFERENCE = nj.motions.lemniscate(5.0, setups.RATE)
SCENARIO = nj.Scenario(REFERENCE, setups.aiding(2.5, 4.0), nj.InitialUncertainty(0.1, 0.05, 0.005))
TRUTH = nj.ImuErrors(gj.WN(6e-5) + gj.AR1(0.998, 1e-8), gj.WN(1.5e-6), setups.RATE)
DEVICES = jax.devices()[:2]


def compare(**options):
    return nj.compare(SCENARIO, TRUTH, {"right": TRUTH}, num_runs=10, key=KEY, **options)["right"]


@pytest.mark.slow
@pytest.mark.parametrize("gains", ["estimate", "reference"])
def test_two_devices_change_no_bit(gains):
    one, two = (compare(gains=gains, chunk_size=3, devices=devices) for devices in (None, DEVICES))
    assert len(DEVICES) == 2
    for name in ("error", "sd", "position_covariance", "status"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


@pytest.mark.slow
@pytest.mark.parametrize("gains", ["estimate", "reference"])
def test_devices_do_not_talk(gains):
    setup = Setup(SCENARIO, TRUTH.rate)
    place = placement(setup, 24, 6, chunk_size=3, workers=None, devices=DEVICES, shared=False, smooth=False)
    keys = place.keys(KEY, 0)
    shared = gains_of(setup.experiment, TRUTH) if gains == "reference" else None

    @jax.jit
    def run(keys):
        return run_filter(setup.experiment, TRUTH, draw_inputs(setup.experiment, TRUTH, keys), shared).judgement.error

    compiled = run.lower(keys).compile()
    words = "all-reduce|all-gather|all-to-all|collective-permute|reduce-scatter"
    assert re.findall(words, compiled.as_text()) == []
    spread = NamedSharding(place.sharding.mesh, PartitionSpec(None, None, "runs"))
    assert compiled.output_shardings.is_equivalent_to(spread, 3)


class Card:
    """A device that is no CPU, with so much memory."""

    platform = "gpu"

    def __init__(self, limit):
        self.limit = limit

    def memory_stats(self):
        return self.limit and {"bytes_limit": self.limit}


def place(num_runs=5000, **options):
    given = {"chunk_size": None, "workers": None, "devices": None, "shared": False, "smooth": False} | options
    return inspect.unwrap(placement)(Setup(SCENARIO, TRUTH.rate), 24, num_runs, **given)


@pytest.mark.parametrize(
    ("limit", "low", "high"), [(80e9, 5000, 5000), (40e6, 50, 400), (1e3, 1, 1), (None, 5000, 5000)]
)
def test_other_devices_take_all_that_find_room(monkeypatch, limit, low, high):
    monkeypatch.setattr(_placement.jax, "devices", lambda: [Card(limit)])
    found = place()
    assert low <= found.each <= high
    assert found.workers == 1


@pytest.mark.parametrize("cache", [None, 2**21])
def test_threads_of_a_cpu_have_chunks_that_come_out_even(monkeypatch, cache):
    monkeypatch.setattr(_placement, "core_cache", lambda: cache)
    assert place(128, workers=2).each == 64
    assert place(200, workers=2).each in (100, 104)
    assert place(10, workers=2).each == 8
    assert place(1000, devices=DEVICES).size == 2 * place(1000, devices=DEVICES).each


def test_chunks_fit_into_a_small_cache(monkeypatch):
    monkeypatch.setattr(_placement, "core_cache", lambda: 2**19)
    assert place(288, workers=2).each == 72
    assert place(200, workers=2).each == 52  # 2 x 52 are fewer than 2 x 72
    assert place(512, workers=2, shared=True).each == 64
    setup = Setup(SCENARIO, TRUTH.rate)
    options = {"chunk_size": None, "workers": 2, "devices": None, "shared": False, "smooth": False}
    assert placement(setup, 60, 560, **options).each == 28
    assert placement(setup, 18, 560, **options).each == 56  # 5 x 56 are 280
    monkeypatch.setattr(_placement, "core_cache", lambda: 2**15)
    assert place(480, workers=2).each == 24


def test_chunks_of_loops_that_are_compiled_as_a_whole(monkeypatch):
    monkeypatch.setattr(_placement, "core_cache", lambda: 2**20)
    assert place(200, workers=2).each == 100
    monkeypatch.setattr(_placement, "loops_are_fast", lambda: True)
    assert place(200, workers=2).each == 52
    assert place(512, workers=2, shared=True).each == 64


def test_the_cache_of_a_core(monkeypatch, tmp_path):
    monkeypatch.setattr(cores, "_CACHE", tmp_path / "size")
    assert cores.core_cache() is None
    for text, found in (("512K\n", 2**19), ("2M", 2**21), ("", None), ("much", None)):
        (tmp_path / "size").write_text(text)
        assert cores.core_cache() == found


def test_a_smoother_remembers_covariances():
    setup = Setup(SCENARIO, TRUTH.rate)
    assert place(smooth=True, workers=1).each <= place(workers=1).each
    assert place(smooth=True, workers=1).each * 16 * len(setup.schedule.time) * 24**2 <= 1e9


@pytest.mark.parametrize(
    ("options", "message"),
    [({"devices": []}, "one device or more"), ({"devices": DEVICES, "workers": 2}, "leave out workers=2")],
)
def test_bad_placement(options, message):
    with pytest.raises(ValueError, match=message):
        inspect.unwrap(nj.compare)(SCENARIO, TRUTH, num_runs=4, key=KEY, **options)
