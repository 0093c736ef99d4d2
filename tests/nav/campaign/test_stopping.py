"""Campaigns that a rule stops: what run() decides anybody finds in the store, and nothing more is computed."""

import numpy as np
import pytest
from nav import campaigns
from nav.campaigns import campaign

import nav_jax as nj
from nav_jax.campaign import tasks

pytest.importorskip("zarr")

STOP = nj.Precision(position=1.0, least=16, every=16)
"""Stops at its first look: four chunks."""
NEVER = nj.Precision(position=1e-9, least=16, every=16)
TOLD_APART = nj.simulation.Significant(first=16)
DIFFERENT = {"right": campaigns.RIGHT, "wrong": nj.ImuErrors("WN(sigma2=1e-1)", "WN(sigma2=1e-2)", campaigns.RATE)}


@pytest.fixture
def computed(monkeypatch):
    """Chunks that were computed, in their order."""
    seen, compute = [], tasks.Bench.compute

    def counted(self, chunk):
        seen.append(chunk)
        return compute(self, chunk)

    monkeypatch.setattr(tasks.Bench, "compute", counted)
    return seen


def test_chunks_beyond_the_stop_are_not_computed(tmp_path, computed):
    study = campaign(48)
    status = study.run(tmp_path / "study.zarr", stop=STOP)
    assert status.complete
    assert sorted(computed) == [0, 1, 2, 3]
    assert "drive: stopped at 16 of 48 runs (precise)" in repr(status)
    assert not study.status().complete
    computed.clear()
    assert study.run(tmp_path / "study.zarr", stop=STOP).complete
    assert not computed


def test_whoever_asks_later_finds_the_same(tmp_path):
    """Also in a store that has all runs, and after other workers."""
    few, all_of_them = campaign(48), campaign(48)
    few.run(tmp_path / "few.zarr", stop=STOP)
    all_of_them.run(tmp_path / "all.zarr")
    a, b = few.comparison(stop=STOP), all_of_them.comparison(stop=STOP)
    assert a.stopped == b.stopped
    assert a.stopped.early
    assert len(b["right"]) == b["right"].num_requested == 16
    assert str(a.table()) == str(b.table())
    assert "16 of at most 48 runs" in str(a.table())
    np.testing.assert_array_equal(a["white"].error, b["white"].error)
    assert len(all_of_them.comparison()["right"]) == 48


def test_each_scenario_stops_by_itself(tmp_path):
    """A standard error between those of two scenarios at the first look ends one of them there."""
    names = ("drive", "free")
    study, full = campaign(48, of=names), campaign(48, of=names)
    full.run(tmp_path / "full.zarr")
    se = {name: max(standard_error(r) for r in full.comparison(name).runs.values()) for name in names}
    early, late = sorted(names, key=se.__getitem__)
    rule = nj.Precision(position=float(np.sqrt(se[early] * se[late])), least=16, every=16)
    status = study.run(tmp_path / "study.zarr", stop=rule)
    assert status.complete
    assert status.stopped[early].looks == (16,)
    assert status.stopped.get(late) != status.stopped[early]
    for name in names:
        assert study.comparison(name, stop=rule).stopped == full.comparison(name, stop=rule).stopped


def standard_error(runs):
    """Of the mean length of the position error of the first 16 runs."""
    return np.linalg.norm(runs.error[:16, 0, :3], axis=1).std(ddof=1) / 4


def test_filters_that_are_told_apart(tmp_path):
    study = campaign(64, filters=DIFFERENT)
    status = study.run(tmp_path / "study.zarr", stop=TOLD_APART)
    ended = study.comparison(stop=TOLD_APART).stopped
    assert status.complete
    assert status.stopped == ({"drive": ended} if ended.early else {})
    assert "hold for all looks together" in str(study.comparison(stop=TOLD_APART).table())


def test_looks_are_at_whole_chunks(tmp_path):
    study = campaign(40, chunk_size=5)
    study.run(tmp_path / "study.zarr", stop=STOP)
    assert study.comparison(stop=STOP).stopped.looks == (20,)


def test_a_rule_that_never_stops_has_all_looks(tmp_path):
    study = campaign(40)
    assert study.run(tmp_path / "study.zarr", stop=NEVER).complete
    found = study.comparison(stop=NEVER)
    assert found.stopped.looks == (16, 32, 40)
    assert not found.stopped.early


def test_a_chunk_that_fails_before_a_look(tmp_path, monkeypatch):
    """There is no look without it: all that can be is computed, and once it is there the look is the same."""
    study, compute = campaign(32), tasks.Bench.compute

    def failing(self, chunk):
        if chunk == 2:
            raise MemoryError("none")
        return compute(self, chunk)

    monkeypatch.setattr(tasks.Bench, "compute", failing)
    status = study.run(tmp_path / "study.zarr", stop=STOP)
    assert status.missing == {"drive": (2,)}
    assert not status.stopped
    found = study.comparison(stop=STOP)
    assert found.stopped is None
    assert any("cannot look beyond" in note for note in found["right"].notes)
    monkeypatch.setattr(tasks.Bench, "compute", compute)
    status = study.run(tmp_path / "study.zarr", stop=STOP)
    assert status.complete
    assert status.stopped["drive"].looks == (16,)


def test_processes_stop_as_threads_do(tmp_path):
    """Their chunks are the same numbers, as other tests say; here it is that they are as many."""
    study, other = campaign(48), campaign(48)
    status = study.run(tmp_path / "threads.zarr", stop=STOP)
    assert (
        other.run(tmp_path / "processes.zarr", stop=STOP, executor=nj.campaign.processes(2)).stopped == status.stopped
    )
    assert other.status().missing == study.status().missing == {"drive": tuple(range(4, 12))}
    assert study.comparison(stop=STOP).stopped == other.comparison(stop=STOP).stopped


def test_some_chunks_and_a_rule(tmp_path):
    with pytest.raises(ValueError, match="leave either stop or chunks out"):
        campaign(8).run(tmp_path / "study.zarr", stop=STOP, chunks=[0])


def test_one_filter_is_not_told_apart(tmp_path):
    with pytest.raises(ValueError, match="there is one"):
        campaign(8, filters=campaigns.RIGHT).run(tmp_path / "study.zarr", stop="significant")
