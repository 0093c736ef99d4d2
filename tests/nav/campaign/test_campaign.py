"""Campaigns: what a store holds does not depend on who wrote it when, and what is damaged is never believed."""

import errno
import os
import shutil
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace

import jax
import numpy as np
import pytest
from nav import campaigns
from nav.campaigns import arrays_of, campaign, files_of

import nav_jax as nj
from gmwm_jax._internal import environment
from nav_jax.campaign import tasks
from nav_jax.campaign.contents import EDGES, KEEPS
from nav_jax.campaign.specification import NUMBERS
from nav_jax.campaign.store import Store

zarr = pytest.importorskip("zarr")


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """All runs of two chunks, at every epoch."""
    path = tmp_path_factory.mktemp("kept") / "runs.zarr"
    study = campaign(8, keep="runs")
    assert study.run(path).complete
    return study


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A finished store of three chunks; tests copy it."""
    path = tmp_path_factory.mktemp("done") / "done.zarr"
    assert campaign().run(path).complete
    return path


@pytest.fixture
def store(done, tmp_path):
    return shutil.copytree(done, tmp_path / "study.zarr")


@pytest.fixture
def computed(monkeypatch):
    """Chunks that were computed, in their order."""
    seen, compute = [], tasks.Bench.compute

    def counted(self, chunk):
        seen.append(chunk)
        return compute(self, chunk)

    monkeypatch.setattr(tasks.Bench, "compute", counted)
    return seen


class Shuffled(Executor):
    """Computes nothing before somebody waits, and then the last first."""

    def __init__(self):
        self.calls = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        self.calls.append((future, fn, args))
        if len(self.calls) == 3:
            for each, call, of in reversed(self.calls):
                each.set_result(call(*of))
        return future


# what is computed


def test_runs_are_those_of_compare(kept):
    runs = kept.comparison("drive")
    expected = nj.compare(
        campaigns.scenarios()["drive"],
        campaigns.RIGHT,
        campaigns.FILTERS,
        num_runs=8,
        key=jax.random.key(campaigns.KEY),
        chunk_size=4,
        workers=1,
    )
    assert repr(runs) == repr(expected)
    for name in expected:
        for a, b in ((runs[name].error, expected[name].error), (runs[name].sd, expected[name].sd)):
            assert a.tobytes() == b.tobytes()
        for sensor in expected[name].nis:
            assert runs[name].nis[sensor].tobytes() == expected[name].nis[sensor].tobytes()


def test_the_judged_epoch_gives_the_same_verdicts(kept, done):
    whole, judged = kept.comparison(), nj.Campaign.open(done).comparison()
    epoch = whole.epoch()
    assert judged["right"].time == whole["right"].time[epoch] == 3.0
    assert judged["right"].error[:8, 0].tobytes() == whole["right"].error[:, epoch].tobytes()
    assert "the epoch at 3 s was kept" in repr(judged)
    assert {one.model for one in judged.table()} == {"right", "white"}


def test_statistics_are_those_of_the_runs(kept):
    for name, runs in kept.comparison().runs.items():
        found = kept.statistics()[name]
        assert found.num_good == 8
        np.testing.assert_allclose(found.mean_error, runs.error.mean(axis=0), rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(found.rms_error, np.sqrt((runs.error**2).mean(axis=0)), rtol=1e-12)
        np.testing.assert_allclose(found.rms_sd, np.sqrt((runs.sd**2).mean(axis=0)), rtol=1e-12)
        lengths = np.linalg.norm(runs.errors("attitude"), axis=-1).mean(axis=0)
        np.testing.assert_allclose(found.mean_length["attitude"], lengths, rtol=1e-12)
        np.testing.assert_allclose(found.mean_nees["pose"], runs.nees["pose"].mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(found.mean_nis["gnss_position"], runs.nis["gnss_position"].mean(axis=0), rtol=1e-12)
        share = (runs.nees["pose"] <= 12.591587243743977).mean(axis=0)  # 95 % of chi-square with 6 degrees of freedom
        np.testing.assert_array_equal(found.coverage["pose"], share)
        standardised = (runs.error[..., 4] / runs.sd[..., 4]).ravel()
        counts = np.histogram(standardised, EDGES)[0]
        np.testing.assert_array_equal(found.histogram[4, 1:-1], counts)
        assert found.histogram[4].sum() == standardised.size


def test_statistics_save_and_draw_themselves(kept, tmp_path, rendered_figures):
    """The figure has the numbers that that of all runs has: the same intervals, bands and curves."""
    every = kept.statistics()
    one = every["right"]
    assert repr(nj.load(one.save(tmp_path / "right.npz"))) == repr(one)
    one.plot()
    nj.plotting.plot_statistics(every)
    assert len(rendered_figures) == 2
    runs = kept.comparison()
    position, _, orientation, claimed, nees, covered = nj.plotting.statistics_data(every)
    for frame, expected in zip((position, orientation), nj.plotting.mean_errors_data(runs), strict=True):
        for item, other in zip(frame.items, expected.items, strict=True):
            for a, b in zip(item, other, strict=True):
                if isinstance(b, np.ndarray):
                    np.testing.assert_allclose(a, b, rtol=1e-7)
                else:
                    assert a == b
    for frame, expected in zip((nees, covered), nj.plotting.consistency_data(runs, groups=("pose",)), strict=True):
        by_name = {item.label: item for item in frame.items}
        for item in expected.items:
            if item.label:
                np.testing.assert_allclose(by_name[item.label][1:3], item[1:3], rtol=1e-9)
    error, sd = (x[..., :3] ** 2 for x in (runs["right"].error, runs["right"].sd))
    ratio = np.sqrt(sd.sum(axis=2).mean(axis=0) / error.sum(axis=2).mean(axis=0))
    np.testing.assert_allclose(claimed.items[0].y, ratio, rtol=1e-9)


def test_the_judged_epoch_alone_is_seen_in_figures(done, rendered_figures):
    figure = nj.Campaign.open(done).comparison().plot()
    for ax in figure.axes[:5]:
        points = [line for line in ax.lines if len(line.get_xdata()) == 1]
        assert points
        assert all(line.get_marker() == "o" for line in points)


def test_what_killed_writers_left_is_removed_when_nobody_can_be_writing_it(store):
    old, new = (store / "scenarios" / "drive" / f"0.{name}.partial" for name in ("old", "new"))
    for file in (old, new):
        file.write_bytes(b"half")
    two_days_ago = time.time() - 2 * 24 * 3600
    os.utime(old, (two_days_ago, two_days_ago))
    assert campaign().run(store).complete
    assert not old.exists()
    assert new.exists()


def test_a_store_is_no_single_result(done):
    with pytest.raises(ValueError, match=r"is the store of a campaign, no single result: nav_jax\.Campaign\.open"):
        nj.load(done)


@pytest.mark.slow
def test_gains_of_the_reference():
    study = campaign(4, gains="reference", keep="judged")
    assert study.run("reference.zarr").complete
    sd = study.comparison()["right"].sd
    assert np.all(sd == sd[:1])
    with pytest.raises(ValueError, match='keep="judged" has no statistics'):
        study.statistics()


@pytest.mark.slow
def test_a_chunk_in_parts_has_their_runs_and_their_sums():
    """And half as many files; what would be computed at once by itself is what is computed at once as a part."""
    small, large = campaign(128, chunk_size=64), campaign(128, chunk_size=128)
    small.run("small.zarr")
    large.run("large.zarr")
    one, other = arrays_of("small.zarr"), arrays_of("large.zarr")
    per_run = [f"drive/{name}" for name in ("status", "error", "sd", "position_covariance", "nees")]
    assert [one[name] == other[name] for name in per_run] == [True] * 5
    for name, found in small.statistics().items():
        for field, value in vars(found).items():
            np.testing.assert_equal(getattr(large.statistics()[name], field), value, err_msg=field)
    assert 2 * len(files_of("large.zarr")) < len(files_of("small.zarr")) + 60


@pytest.mark.slow
def test_a_store_of_5000_runs_of_three_filters_takes_little_room():
    """One of its twenty chunks: 300 epochs, three sensors, each run with its own gains. Beside it all that is told."""
    reference = nj.motions.lemniscate(300.0, 2.0)
    fixes = {"horizontal": 0.1, "vertical": 0.2}
    aiding = nj.GnssPosition(**fixes), nj.GnssVelocity(**fixes), nj.Barometer(height=0.5)
    scenario = nj.Scenario(reference, aiding, nj.InitialUncertainty(0.1, 0.05, 0.005))
    models = "WN(sigma2=1e-4)", "WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-4) + GM(beta=0.01, variance=1e-6)"
    filters = {model: nj.ImuErrors(model, "WN(sigma2=1e-8) + RW(gamma2=1e-13)", 2.0) for model in models}
    study = nj.Campaign(scenario, filters[models[1]], filters, key=jax.random.key(0), num_runs=5000)
    cost = study.cost()
    assert cost.num_chunks == 20
    study.run("study.zarr", chunks=[0])
    written = sum(map(len, files_of("study.zarr").values()))
    assert cost.frame_bytes + 20 * (written - cost.frame_bytes) < 15e6
    assert cost.frame_bytes + cost.chunk_bytes == pytest.approx(written, rel=0.02)


def test_chunks_are_larger_where_sums_are_kept():
    sizes = {keep: campaign(keep=keep, chunk_size=None)._definition.chunk_size for keep in KEEPS}
    assert sizes == {"judged": 64, "statistics": 256, "runs": 64}


# who computes, and when


def test_order_and_engine_change_no_bit(done):
    campaign().run("shuffled.zarr", executor=Shuffled())
    assert files_of("shuffled.zarr") == files_of(done)


def test_a_finished_campaign_has_nothing_to_do(store, computed):
    before, told = files_of(store), []
    assert campaign().run(store, progress=lambda n, total: told.append(total)).complete
    assert (computed, told, files_of(store)) == ([], [0], before)


@pytest.mark.slow
def test_more_runs_continue(done, store, computed):
    """1,000 to 5,000 in small: only the new chunks, and what was there stays as it is; then all is as if at once."""
    assert campaign(20).run(store).complete
    assert sorted(computed) == [3, 4]
    before, after = files_of(done), files_of(store)
    same = [name for name in before if "/c/" in name]
    assert len(same) > 20
    assert all(after[name] == before[name] for name in same)
    campaign(20).run("at_once.zarr")
    assert files_of("at_once.zarr") == after
    assert campaign(8).run(store).complete  # fewer are among them
    assert nj.Campaign.open(store).num_runs == 20


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"chunk_size": 2}, "chunk_size is 4 in the store, and 2 in this campaign"),
        ({"key": jax.random.key(4)}, "key is 3 in the store, and 4 in"),
        ({"keep": "judged"}, 'keep is "statistics" in the store'),
        ({"gains": "reference"}, 'gains is "estimate" in the store'),
        ({"filters": {"right": campaigns.RIGHT}}, "filters is made of right, white in the store, and made of right in"),
        ({"truth": campaigns.WHITE}, "truth"),
        ({"of": ("drive", "free")}, "scenarios is made of drive in the store"),
    ],
)
def test_another_campaign_is_refused_by_its_field(done, store, options, field):
    with pytest.raises(ValueError, match=f"study.zarr is the store of another campaign: .*{field}"):
        campaign(**options).run(store)
    assert files_of(store) == files_of(done)


def begun_before(done, path, text):
    """A finished store that another version of the package has begun, with what is in this one."""
    study = nj.Campaign.open(done)
    former = Store(path, replace(study._specification, text=text), study._store().layouts, 3)
    former.restore()
    for chunk in range(3):
        former.write("drive", chunk, study._store().read("drive", chunk))


@pytest.mark.parametrize(("field", "said"), [('"numbers":1,', "1"), ("", "not stated")])
def test_a_store_of_other_random_numbers_is_read_and_not_continued(done, computed, field, said):
    text = campaign().specification
    begun_before(done, "former.zarr", text.replace(f'"numbers":{NUMBERS},', field))
    before = files_of("former.zarr")
    study = nj.Campaign.open("former.zarr")
    assert study.status().complete
    assert repr(study.comparison()) == repr(nj.Campaign.open(done).comparison())
    assert repr(study.statistics()) == repr(nj.Campaign.open(done).statistics())
    refused = f"^former.zarr was begun with other numbers .*numbers is {said} in the store, and {NUMBERS} here.: begin"
    for continues in (
        lambda: campaign(20).run("former.zarr"),
        lambda: study.run("former.zarr"),
        lambda: study.run("new.zarr"),
        lambda: nj.Campaign.merge(["former.zarr"], "new.zarr"),
        lambda: nj.Campaign.merge([done, "former.zarr"], "new.zarr"),
        lambda: nj.Campaign.merge([done], "former.zarr"),
    ):
        with pytest.raises(ValueError, match=refused):
            continues()
    assert files_of("former.zarr") == before
    assert not computed


def test_a_worker_of_another_version_computes_nothing(store, monkeypatch):
    """Who sent the task has another one: it says so, in the place of runs."""
    monkeypatch.setattr(tasks, "NUMBERS", NUMBERS + 1)
    monkeypatch.setattr(tasks, "_benches", {})
    told = tasks.run_task(str(store), campaign()._specification.digest, 3, "drive", 0)
    assert f"numbers is {NUMBERS} in the store, and {NUMBERS + 1} here" in told.problem


def test_the_version_of_the_numbers_is_that_of_these(done):
    """Who has changed what runs are, and finds it here, raises `NUMBERS`, and puts the new ones in this place."""
    known = {2: [0.248208, -0.291491, -0.119956]}
    errors = nj.Campaign.open(done).comparison()["right"].errors("position")[0, 0]
    np.testing.assert_allclose(errors, known[NUMBERS], rtol=1e-5)


def test_another_environment_is_said(store, monkeypatch):
    """It changes the last bits of new runs, and nothing of those that are there."""
    monkeypatch.setattr(environment, "_version", lambda name: "0.0.1")
    with pytest.warns(UserWarning, match=r"was begun elsewhere \(gmwm-jax was .*, is '0.0.1'.*to rounding, not to"):
        assert campaign().run(store).complete


def test_merging_stores(done, computed):
    campaign().run("a.zarr", chunks=[0, 2])
    campaign().run("b.zarr", chunks=[1, 2])
    assert nj.Campaign.open("a.zarr").status().missing == {"drive": (1,)}
    computed.clear()
    merged = nj.Campaign.merge(["a.zarr", "b.zarr"], "both.zarr")
    assert merged.status().complete
    assert not computed
    assert arrays_of("both.zarr") == arrays_of(done)
    campaign(keep="judged").run("c.zarr", chunks=[0])
    with pytest.raises(ValueError, match=r"c.zarr is the store of another campaign than a.zarr: keep is"):
        nj.Campaign.merge(["a.zarr", "c.zarr"], "d.zarr")


# what goes wrong


def broken(file, how):
    content = bytearray(file.read_bytes())
    if how == "deleted":
        return file.unlink()
    if how == "flipped":
        content[len(content) // 2] ^= 4
    return file.write_bytes(content[: len(content) // 2] if how == "truncated" else content)


def assert_mends(store, done, name, how):
    broken(store / name, how)
    with pytest.warns(UserWarning, match=r"damaged") as said:
        assert campaign().run(store).complete
    assert len(said) == 1
    assert files_of(store) == files_of(done)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["truncated", "deleted", "flipped"])
def test_damage_is_seen_and_mended(done, store, how):
    """One file of each kind; all of them in tests/validation."""
    for name in ("error/c/1/0/0", "histogram/c/2/0/0/0", "sum_error/zarr.json"):
        assert_mends(store, done, f"scenarios/drive/{name}", how)
    inputs = next(name for name in files_of(done) if name.startswith("inputs/") and "/c/" in name)
    assert_mends(store, done, inputs, how)
    if how != "deleted":
        assert_mends(store, done, "zarr.json", how)
        assert_mends(store, done, "scenarios/drive/done/c/0", how)


def test_what_is_damaged_is_not_read(store, computed):
    for name in ("scenarios/drive/error/c/1/0/0", "scenarios/drive/sd/c/2/0/0"):
        broken(store / name, "flipped")
    study = nj.Campaign.open(store)
    assert study.status().damaged == {"drive": (1, 2)}
    assert "damaged, to be computed again: drive 1, drive 2" in repr(study.status())
    comparison = study.comparison()
    assert len(comparison["right"]) == 4
    assert "8 of 12 runs are missing" in repr(comparison)
    assert study.statistics()["right"].num_good == 4


def test_a_chunk_in_the_place_of_another_is_none(store):
    """Its own checksum goes with it, and belongs to its place."""
    for of in (store / "scenarios" / "drive").iterdir():
        for file in of.glob("c/1*"):
            shutil.rmtree(file) if file.is_dir() else file.unlink()
            source = file.with_name("0")
            shutil.copytree(source, file) if source.is_dir() else shutil.copy(source, file)
    assert nj.Campaign.open(store).status().missing == {"drive": (1,)}


@pytest.mark.parametrize("how", ["truncated", "deleted", "flipped"])
def test_a_store_that_cannot_say_what_it_is(store, how):
    broken(store / "zarr.json", how)
    with pytest.raises(ValueError, match="says of itself is damaged: run the campaign"):
        nj.Campaign.open(store)


@pytest.mark.slow
def test_a_writer_that_dies_after_any_file(done, monkeypatch):
    """Each file of a chunk is its last: nothing of the chunk is believed, and the others stay."""
    put, left = zarr.storage._local._put, [0]

    class Dead(BaseException):
        pass

    def dying(path, value, exclusive=False):
        if not left[0]:
            raise Dead
        left[0] -= 1
        return put(path, value, exclusive)

    campaign().run("study.zarr", chunks=[0, 2])
    bench = tasks.bench_of(campaign()._specification, "drive")
    arrays = bench.compute(1)
    target = Store("study.zarr", bench.specification, {"drive": bench.layout}, 3)
    files = len([name for name in files_of(done) if "/c/1" in name])
    monkeypatch.setattr(zarr.storage._local, "_put", dying)
    for number in range(files):
        left[0] = number
        with pytest.raises(Dead):
            target.write("drive", 1, arrays)
        assert target.read("drive", 1) is None
        assert nj.Campaign.open("study.zarr").status().missing == {"drive": (1,)}
    left[0] = files
    target.write("drive", 1, arrays)
    assert files_of("study.zarr") == files_of(done)


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_is_full_or_read_only(done, store, monkeypatch, code):
    def refuses(*args, **kwargs):
        raise OSError(code, "no")

    with monkeypatch.context() as patch:
        patch.setattr(zarr.storage._local, "_put", refuses)
        with pytest.raises(OSError, match=r"study.zarr cannot be written \(.*\): what is whole in it is kept") as said:
            campaign(16).run(store)
    assert "\n" not in str(said.value)
    assert nj.Campaign.open(store).status().missing == {"drive": (3,)}
    assert all(files_of(store)[name] == content for name, content in files_of(done).items() if "/c/" in name)
    assert campaign(16).run(store).complete


def test_a_task_that_always_raises(monkeypatch):
    compute = tasks.Bench.compute

    def fails(self, chunk):
        if chunk == 1:
            raise FloatingPointError("bad luck")
        return compute(self, chunk)

    study = campaign()
    with monkeypatch.context() as patch:
        patch.setattr(tasks.Bench, "compute", fails)
        status = study.run("study.zarr")
    assert status.failed == {("drive", 1): "FloatingPointError: bad luck"}
    assert "drive 1 failed: FloatingPointError: bad luck" in repr(nj.Campaign.open("study.zarr").status())
    assert "8 runs of 12" in repr(study.comparison())
    assert "4 of 12 runs are missing" in repr(study.comparison())
    again = study.run("study.zarr")
    assert again.complete
    assert not again.failed


class Breaks(Shuffled):
    """A pool whose worker dies at its second task."""

    def submit(self, fn, /, *args, **kwargs):
        self.calls.append(fn)
        future = Future()
        if len(self.calls) == 1:
            future.set_result(fn(*args))
        else:
            future.set_exception(BrokenExecutor("killed"))
        return future


def test_workers_that_die_are_replaced_where_somebody_says_how(done):
    with pytest.raises(
        RuntimeError, match="A worker died while it had one of the chunks drive 1, drive 2: what is whole"
    ):
        campaign().run("given.zarr", executor=Breaks())
    assert nj.Campaign.open("given.zarr").status().missing == {"drive": (1, 2)}
    assert campaign().run("made.zarr", executor=Breaks).complete
    assert arrays_of("made.zarr") == arrays_of(done)


def test_a_task_that_kills_its_worker_is_found_and_named(done):
    """It breaks whatever pool it is in, and with it the tasks of others, which are done all the same."""

    class Kills(Executor):
        def __init__(self):
            self.broken = False

        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            self.broken = self.broken or args[-1] == 1
            if self.broken:
                future.set_exception(BrokenExecutor("killed"))
            else:
                future.set_result(fn(*args))
            return future

    status = campaign(20).run("study.zarr", executor=Kills)
    assert status.failed == {("drive", 1): "its worker died 3 times, as without memory"}
    assert status.missing == {"drive": (1,)}

    class Dead(Kills):
        def submit(self, fn, /, *args, **kwargs):
            raise BrokenExecutor("killed")

    with pytest.raises(RuntimeError, match="A worker died while it had one of"):
        campaign(40).run("dead.zarr", executor=Dead)


def test_what_has_an_executor(done):
    class Client:
        def get_executor(self):
            return Shuffled()

    campaign().run("client.zarr", executor=Client())
    assert arrays_of("client.zarr") == arrays_of(done)
    with pytest.raises(ValueError, match=r"what has get_executor\(\)"):
        campaign().run("none.zarr", executor=3)


def test_an_interrupt_keeps_what_is_done(monkeypatch):
    def interrupts(done, total):
        if done == 1:
            raise KeyboardInterrupt

    monkeypatch.setenv("GMWM_JAX_NUM_THREADS", "1")
    study = campaign(48)
    assert 0 < study.run("study.zarr", progress=interrupts).num_missing < 12
    assert study.run("study.zarr").complete


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"keep": "all"}, "keep is one of judged, statistics, runs, and is 'all'"),
        ({"gains": "own"}, "gains is one of"),
        ({"num_runs": 0}, "num_runs"),
        ({"chunk_size": 0}, "chunk_size"),
        ({"truth": 3}, "The truth of a campaign is ImuErrors"),
    ],
)
def test_what_is_no_campaign(options, message):
    with pytest.raises(ValueError, match=message):
        campaign(**options)


def test_names_and_places():
    scenario = campaigns.scenarios()["drive"]
    options = {"key": jax.random.key(0), "num_runs": 4}
    with pytest.raises(ValueError, match="A scenario is a folder of the store"):
        nj.Campaign({"a/b": scenario}, campaigns.RIGHT, **options)
    with pytest.raises(ValueError, match="at least one scenario"):
        nj.Campaign({}, campaigns.RIGHT, **options)
    study = campaign()
    with pytest.raises(ValueError, match="has no store yet"):
        study.status()
    with pytest.raises(FileNotFoundError):
        nj.Campaign.open("nothing.zarr")
    with open("file", "w") as file:
        file.write("data")
    with pytest.raises(FileExistsError, match="is no store of a campaign: it stays"):
        study.run("file")


def test_runs_are_rounded_up_to_chunks():
    assert campaign(9).num_runs == 12
    assert "12 runs in chunks of 4" in repr(campaign(9))
