"""A bootstrap in parts: the same bytes whoever computes them in whatever order, and what is damaged is not believed."""

import errno
import pickle
import subprocess
import sys
import warnings
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest
from helpers import Told, assert_same_result
from programs import fitted, simulated

import gmwm_jax as gj
from gmwm_jax._internal import environment, parts
from gmwm_jax.fitting.weights import as_weights
from gmwm_jax.inference import bootstrapping
from gmwm_jax.inference.bootstrapping import BootstrapSource
from gmwm_jax.multisignal.each import EachBatch
from gmwm_jax.processes.registry import as_model

NUM, CHUNKS = 200, 4


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def replicated(num=NUM, seed=3, fit=None, **options):
    return gj.bootstrap(fit or fitted(), num, key=jax.random.key(seed), **options)


@pytest.fixture(scope="module")
def boot():
    """In this thread, without a store."""
    return replicated()


@pytest.fixture
def computed(monkeypatch):
    """First numbers of the chunks that were computed, in their order."""
    seen, replicates = [], BootstrapSource.replicates

    def counted(self, first, last):
        seen.append(first)
        return replicates(self, first, last)

    monkeypatch.setattr(BootstrapSource, "replicates", counted)
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
        if len(self.calls) == CHUNKS:
            for each, call, of in reversed(self.calls):
                each.set_result(call(*of))
        return future


class Client:
    """What has an executor, as a Dask Client."""

    def get_executor(self):
        return Shuffled()


# who computes


@pytest.mark.parametrize("executor", [Shuffled, Client(), None])
def test_order_engine_and_store_change_no_bit(boot, executor):
    assert_same_result(replicated(executor=executor, store="store"), boot)
    assert sorted(files_of("store")) == ["parts.json", *(f"replicates-{64 * i:07d}.npz" for i in range(CHUNKS))]


def test_threads_change_no_bit(boot):
    for num in (1, 2, 8):
        with ThreadPoolExecutor(num) as pool:
            assert_same_result(replicated(executor=pool, store=f"of_{num}"), boot)
    assert files_of("of_1") == files_of("of_2") == files_of("of_8")


@pytest.mark.slow
def test_records_change_no_bit():
    """A chunk in a store is whole, and one that is not has the same records in the same places."""
    few = replicated(10, route="records")
    kept = replicated(10, route="records", store="store")
    assert_same_result(kept, few)
    assert np.load("store/replicates-0000000.npz")["objective"].shape == (64,)


def test_what_is_no_executor():
    with pytest.raises(ValueError, match=r"what has get_executor\(\)"):
        replicated(executor=3)


ARRIVES = "import pickle, sys; print(type(pickle.load(sys.stdin.buffer)).__name__)"


@pytest.mark.slow
@pytest.mark.parametrize("cls", [BootstrapSource, EachBatch])
def test_what_tasks_are_given_arrives_before_their_function(cls):
    """Dask reads them in whatever order; what it cannot read ends the worker, whose nanny makes no other."""
    given = {
        BootstrapSource: BootstrapSource(fitted(), "variances", "threefry2x32", (0, 3), 64),
        EachBatch: EachBatch(as_model("WN + RW"), as_weights("two-step"), None, 0.95, "{}"),
    }[cls]
    said = subprocess.run([sys.executable, "-c", ARRIVES], input=pickle.dumps(given), capture_output=True, timeout=300)
    assert said.stdout.decode().strip() == cls.__name__, said.stderr.decode()


# when


def test_a_finished_bootstrap_has_nothing_to_do(boot, computed):
    replicated(store="store")
    assert computed == [0, 64, 128, 192]
    before = files_of("store")
    told = Told()
    assert_same_result(replicated(store="store", progress=told), boot)
    told.assert_whole(NUM)
    assert len(computed) == CHUNKS
    assert files_of("store") == before


def test_more_replicates_continue(boot, computed):
    assert_same_result(replicated(70, store="store"), replicated(70))
    computed.clear()
    before = files_of("store")
    assert_same_result(replicated(store="store"), boot)
    assert computed == [128, 192]
    assert {name: content for name, content in files_of("store").items() if name in before} == before
    assert_same_result(replicated(70, store="store"), replicated(70))  # fewer are among them


def test_an_interrupt_keeps_what_is_done(boot, computed):
    part = replicated(store="store", progress=Told(128, KeyboardInterrupt))
    np.testing.assert_array_equal(part.values, boot.values[:128])
    computed.clear()
    assert_same_result(replicated(store="store"), boot)
    assert computed == [128, 192]


def test_the_number_of_a_replicate_is_that_of_its_key(boot):
    """What came back beyond a chunk that is missing is in the store alone."""

    class Second(Executor):
        """Only its second task ends."""

        calls = 0

        def submit(self, fn, /, *args, **kwargs):
            self.calls += 1
            future = Future()
            if self.calls == 2:
                future.set_result(fn(*args))
            return future

    for store in (None, "store"):
        with pytest.raises(KeyboardInterrupt):
            replicated(executor=Second(), store=store, progress=Told(64, KeyboardInterrupt))
    assert sorted(files_of("store")) == ["parts.json", "replicates-0000064.npz"]
    assert_same_result(replicated(store="store"), boot)


# what it is of


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"seed": 4}, "key is 3 in the store, and 4 in this bootstrap"),
        ({"route": "records"}, 'route is "variances" in the store, and "records" in'),
        ({"fit": "WN"}, "fit.model.processes is "),
        ({"fit": "weights"}, "fit"),
    ],
)
def test_another_bootstrap_is_refused_by_its_field(options, field):
    replicated(64, store="store")
    before = files_of("store")
    other = {"WN": lambda: gj.fit(simulated(), "WN"), "weights": lambda: gj.fit(simulated(), "WN + GM")}
    options = {"store": "store", "num": 64} | options
    if "fit" in options:
        options["fit"] = other[options["fit"]]()
    with pytest.raises(ValueError, match=f"^store is the store of another bootstrap: .*{field}"):
        replicated(**options)
    assert files_of("store") == before


@pytest.mark.parametrize(("field", "said"), [('"numbers":0,', "0"), ("", "not stated")])
def test_a_store_of_other_numbers_is_not_continued(monkeypatch, field, said):
    written = bootstrapping.specification_of

    def former(source, numbers):
        now = written(source, numbers)
        return replace(now, text=now.text.replace(f'"numbers":{numbers},', field))

    with monkeypatch.context() as patch:
        patch.setattr(bootstrapping, "specification_of", former)
        replicated(64, store="store")
    before = files_of("store")
    refused = f"^store was begun with other numbers .*numbers is {said} in the store, and {bootstrapping.NUMBERS} here"
    with pytest.raises(ValueError, match=refused):
        replicated(store="store")
    assert files_of("store") == before


def test_the_version_of_the_numbers_is_that_of_these(boot):
    """Who has changed what a key gives, and finds it here, raises `NUMBERS`, and puts the new ones in this place."""
    known = {1: [0.507305, 0.257900, 0.135473]}
    np.testing.assert_allclose(boot.variances[0, :3], known[bootstrapping.NUMBERS], rtol=1e-5)


def test_another_environment_is_said(boot, monkeypatch):
    replicated(64, store="store")
    monkeypatch.setattr(environment, "_version", lambda name: "0.0.1")
    with pytest.warns(
        UserWarning, match=r"store was begun elsewhere \(gmwm-jax was .*, is '0.0.1'.*to rounding, not to"
    ):
        assert_same_result(replicated(store="store"), boot)


def test_other_things_stay():
    Path("folder").mkdir()
    Path("folder/notes.txt").write_text("mine")
    Path("file").write_text("mine")
    fitted().save("fit.npz")
    Path("other").mkdir()
    Path("fit.npz").rename("other/fit.npz")
    Path("newer").mkdir()
    replicated(64, store="newer")
    text = Path("newer/parts.json").read_text()
    Path("newer/parts.json").write_text(text.replace('"format": 1', '"format": 2'))
    for path in ("folder", "file"):
        with pytest.raises(FileExistsError, match=f"{path} is there and is no store of a bootstrap: it stays"):
            replicated(64, store=path)
    with pytest.raises(ValueError, match="newer version"):
        replicated(64, store="newer")
    assert Path("folder/notes.txt").read_text() == Path("file").read_text() == "mine"


# what goes wrong


@pytest.mark.parametrize("how", ["truncated", "deleted", "flipped"])
def test_every_file(boot, how):
    """None that is damaged is believed, and all are as they were in the end."""
    replicated(store="store")
    expected = files_of("store")
    for name, content in expected.items():
        file, middle = Path("store") / name, len(content) // 2
        if how == "deleted":
            file.unlink()
        else:
            rest = b"" if how == "truncated" else bytes([content[middle] ^ 4]) + content[middle + 1 :]
            file.write_bytes(content[:middle] + rest)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            assert_same_result(replicated(store="store"), boot)
        assert [name in str(one.message) and "damaged" in str(one.message) for one in said] == (
            [] if how == "deleted" and name != "parts.json" else [True]
        )
        assert files_of("store") == expected, name


def test_a_chunk_in_the_place_of_another_is_none(boot):
    replicated(store="store")
    Path("store/replicates-0000064.npz").write_bytes(Path("store/replicates-0000000.npz").read_bytes())
    with pytest.warns(UserWarning, match="replicates-0000064.npz is damaged, and computed again"):
        assert_same_result(replicated(store="store"), boot)


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_is_full_or_read_only(boot, monkeypatch, code):
    written, write = [], parts.write_state

    def refuses(path, content):
        if len(written) == 3:
            raise OSError(code, "no")
        written.append(path)
        return write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(parts, "write_state", refuses)
        with pytest.raises(OSError, match=r"store cannot be written \(.*\): what is whole in it is kept") as said:
            replicated(store="store")
    assert "\n" not in str(said.value)
    assert len(files_of("store")) == 3
    assert_same_result(replicated(store="store"), boot)


class Breaks(Executor):
    """A pool whose worker dies at its second task."""

    def __init__(self):
        self.calls = 0

    def submit(self, fn, /, *args, **kwargs):
        self.calls += 1
        future = Future()
        if self.calls == 1:
            future.set_result(fn(*args))
        else:
            future.set_exception(BrokenExecutor("killed"))
        return future


def test_workers_that_die_are_replaced_where_somebody_says_how(boot):
    with pytest.raises(
        RuntimeError, match="A worker died while it had one of the chunks of replicates from 64 on: with"
    ):
        replicated(executor=Breaks())
    with pytest.raises(RuntimeError, match="from 64 on: what is whole in store is kept"):
        replicated(executor=Breaks(), store="store")
    assert_same_result(replicated(executor=Breaks, store="store"), boot)


def test_a_chunk_that_cannot_be_computed_is_told(monkeypatch):
    def fails(self, first, last):
        raise FloatingPointError("bad luck")

    monkeypatch.setattr(BootstrapSource, "replicates", fails)
    with pytest.raises(FloatingPointError, match="bad luck"):
        replicated(store="store")


def test_a_process_of_ones_own_is_in_no_store():
    class Loud(gj.WN):
        kind = "LOUD"

    fit = gj.fit(simulated(), Loud() + gj.GM())
    assert len(replicated(10, fit=fit).values) == 10
    with pytest.raises(ValueError, match="no file can name it"):
        replicated(10, fit=fit, store="store")
