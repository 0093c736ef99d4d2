"""Many recordings, each by itself: the same fits whoever makes them, and nothing that fails ends the others."""

import os
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import Told, assert_same_result

import gmwm_jax as gj
from gmwm_jax.multisignal import each as module

MODEL = "WN + RW"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def record(seed, channels=("accel_x",)):
    return gj.datasets.simulated("mti-g", 2000, key=jax.random.key(seed), channels=list(channels))


@pytest.fixture(scope="module")
def units():
    """Files and recordings, of one channel and of two."""
    return {"a": record(1), "b": record(2, ("accel_x", "gyro_y")), "c": record(3)}


@pytest.fixture
def computed(monkeypatch):
    """Names of the recordings that were fitted, in their order."""
    seen, fit_one = [], module._fit_one

    def counted(how, name, source):
        seen.append(name)
        return fit_one(how, name, source)

    monkeypatch.setattr(module, "_fit_one", counted)
    return seen


def files_of(store):
    return {file.name: file.read_bytes() for file in Path(store).iterdir()}


class Shuffled(Executor):
    """Computes nothing before all are there, and then the last first."""

    def __init__(self):
        self.calls = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.calls.append((future, fn, args))
        if len(self.calls) == 3:
            for each, call, of in reversed(self.calls):
                each.set_result(call(*of))
        return future


def test_each_is_the_fit_of_its_recording(units):
    fits = gj.fit_each(units, MODEL, weights="two-step", level=0.9)
    assert list(fits) == ["a", "b", "c"]
    for name, rec in units.items():
        assert_same_result(fits[name], gj.fit(gj.wavelet_variance(rec), MODEL, weights="two-step", level=0.9))
    robust = gj.fit_each([units["a"]], MODEL, efficiency=0.6)
    (name,) = robust
    assert name == units["a"].name
    assert_same_result(robust[name], gj.fit(gj.wavelet_variance(units["a"], efficiency=0.6), MODEL))


def test_it_prints_as_a_table(units):
    fits = gj.fit_each({**units, "lost": "lost.npz"}, MODEL)
    lines = repr(fits).splitlines()
    assert lines[1].split()[:3] == ["recording", "channel", "unit"]
    assert [line.split()[:2] for line in lines[3:7]] == [
        ["a", "accel_x"], ["b", "accel_x"], ["b", "gyro_y"], ["c", "accel_x"]
    ]  # fmt: skip
    assert lines[-1].startswith("lost failed: FileNotFoundError")
    with pytest.raises(KeyError, match="lost could not be fitted"):
        fits["lost"]
    with pytest.raises(KeyError, match="No fit of 'd'; there are those of a, b, c"):
        fits["d"]
    assert list(fits.to_pandas().index.unique("recording")) == ["a", "b", "c"]


def test_what_is_no_name_is_said_and_nothing_may_be_fitted(units):
    with pytest.raises(ValueError, match="Names of recordings are texts, and one is 1"):
        gj.fit_each({1: units["a"]}, MODEL)
    assert gj.fit_each(["lost.csv"], MODEL).to_pandas().empty


def test_a_store_goes_where_its_parent_is_and_on_from_a_first_write_that_was_killed(units, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("scratch") / "fits"
    whole = gj.fit_each({"a": units["a"]}, MODEL, store=elsewhere)
    Path("begun", ".parts.json.00000000.part").mkdir(parents=True)
    assert_same_result(gj.fit_each({"a": units["a"]}, MODEL, store="begun"), whole)
    assert {path.name for path in Path("begun").iterdir()} == {path.name for path in elsewhere.iterdir()}


def test_files_are_read_as_is_said():
    for seed in (1, 2):
        x = 180 / np.pi * record(seed, ("gyro_x",)).data
        np.savetxt(f"{seed}.csv", x, header="gyro_x", comments="")
    reading = {"rate": np.float32(100), "units": {"gyro": "deg/s"}, "columns": range(1)}
    fits = gj.fit_each(sorted(Path().glob("*.csv")), MODEL, reading=reading, store="fits")
    assert list(fits) == ["1.csv", "2.csv"]
    again = gj.fit(gj.wavelet_variance(gj.read_recording("1.csv", rate=100.0, units={"gyro": "deg/s"})), MODEL)
    assert_same_result(fits["1.csv"], again)
    assert "unit" in gj.fit_each(["1.csv"], MODEL, reading={"rate": 100.0}).failed["1.csv"]


def test_who_fits_and_when_changes_no_bit(units, computed):
    whole = gj.fit_each(units, MODEL)
    computed.clear()
    gj.fit_each({"c": units["c"]}, MODEL, store="fits")
    assert_same_result(gj.fit_each(units, MODEL, store="fits"), whole)
    assert computed == ["c", "a", "b"]
    before = files_of("fits")
    told = Told()
    assert_same_result(gj.fit_each(units, MODEL, store="fits", progress=told), whole)
    told.assert_whole(3)
    assert computed == ["c", "a", "b"]
    assert_same_result(gj.fit_each(units, MODEL, store="shuffled", executor=Shuffled()), whole)
    with ThreadPoolExecutor(2) as pool:
        assert_same_result(gj.fit_each(units, MODEL, store="threads", executor=pool), whole)
    assert files_of("shuffled") == files_of("threads") == files_of("fits") == before


def test_another_recording_is_fitted_again(units, computed):
    gj.save_recording(record(1), "a.npz")
    gj.fit_each({"a": "a.npz", "c": units["c"]}, MODEL, store="fits")
    gj.save_recording(record(7), "a.npz")
    os.utime("a.npz", (1e9, 1e9))
    computed.clear()
    fits = gj.fit_each({"a": "a.npz", "c": units["c"]}, MODEL, store="fits")
    assert computed == ["a"]
    assert_same_result(fits["a"], gj.fit(gj.wavelet_variance(gj.read_recording("a.npz")), MODEL))
    gj.fit_each({"c": units["a"]}, MODEL, store="fits")
    assert computed == ["a", "c"]


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"model": "WN"}, "model.processes is "),
        ({"level": 0.9}, "level is 0.95 in the store, and 0.9 in this batch of fits"),
        ({"weights": "two-step"}, "weights"),
        ({"efficiency": 0.6}, "efficiency is null in the store"),
        ({"reading": {"rate": 3.0}}, "reading is "),
    ],
)
def test_another_batch_is_refused_by_its_field(units, options, field):
    gj.fit_each({"a": units["a"]}, MODEL, store="fits")
    before = files_of("fits")
    with pytest.raises(ValueError, match=f"fits is the store of another batch of fits: .*{field}"):
        gj.fit_each({"a": units["a"]}, **{"model": MODEL, "store": "fits"} | options)
    assert files_of("fits") == before


def test_a_store_of_other_numbers_is_not_continued(units, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(module, "NUMBERS", 0)
        gj.fit_each({"a": units["a"]}, MODEL, store="fits")
    before = files_of("fits")
    with pytest.raises(ValueError, match=r"^fits was begun with other numbers .*is 0 in the store"):
        gj.fit_each({"a": units["a"]}, MODEL, store="fits")
    assert files_of("fits") == before


def test_what_fails_is_tried_again_and_ends_nothing(units):
    first = gj.fit_each({**units, "lost": "lost.npz"}, MODEL, store="fits")
    assert list(first) == ["a", "b", "c"]
    gj.save_recording(record(9), "lost.npz")
    again = gj.fit_each({**units, "lost": "lost.npz"}, MODEL, store="fits")
    assert list(again) == ["a", "b", "c", "lost"]
    assert not again.failed


def test_damage_is_seen_and_mended(units):
    whole = gj.fit_each(units, MODEL, store="fits")
    expected = files_of("fits")
    for name, content in expected.items():
        (Path("fits") / name).write_bytes(content[: len(content) // 2])
        with pytest.warns(UserWarning, match="damaged"):
            assert_same_result(gj.fit_each(units, MODEL, store="fits"), whole)
        assert files_of("fits") == expected


def test_an_interrupt_keeps_what_is_done(units):
    part = gj.fit_each(units, MODEL, progress=Told(2, KeyboardInterrupt))
    assert (list(part), part.missing) == (["a", "b"], ("c",))
    assert "1 recordings were not tried" in repr(part)


def test_workers_that_die(units):
    class Kills(Executor):
        """Whatever pool has the second is broken."""

        def __init__(self):
            self.broken = False

        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            self.broken = self.broken or args[1] == "b"
            if self.broken:
                future.set_exception(BrokenExecutor("killed"))
            else:
                future.set_result(fn(*args))
            return future

    fits = gj.fit_each(units, MODEL, executor=Kills)
    assert list(fits) == ["a", "c"]
    assert fits.failed == {"b": "its worker died 3 times, as without memory"}
    with pytest.raises(RuntimeError, match="A worker died while it had b or another one: with store="):
        gj.fit_each(units, MODEL, executor=Kills())


@pytest.mark.slow
def test_processes(units):
    """Those of tests compile otherwise than this one: to rounding."""
    fits = gj.fit_each(units, MODEL, executor=gj.multisignal.processes(1))
    for name, one in gj.fit_each(units, MODEL).singles.items():
        assert fits.singles[name].objective == pytest.approx(one.objective, rel=1e-6)


def test_what_is_no_batch(units):
    for given, message in (
        ([], "at least one recording"),
        ("a.npz", "One recording is fitted by"),
        ([units["a"], units["a"]], "Two recordings are called"),
        ({"a": 3}, "a is a file or a Recording, and is a int"),
    ):
        with pytest.raises(ValueError, match=message):
            gj.fit_each(given, MODEL)
