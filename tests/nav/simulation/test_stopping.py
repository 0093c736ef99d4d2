"""Monte Carlos that stop: at the same run whatever computed them, with tables that say so."""

import inspect
from dataclasses import replace

import jax
import numpy as np
import pytest

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.simulation import Anytime, Precision, Significant
from nav_jax.simulation.stopping import Stopped, Watch, rule_of

SCENARIO = nj.Scenario(
    nj.motions.lemniscate(6.0, 50.0),
    [nj.GnssPosition(horizontal=0.3, vertical=0.5, outages=[(2.5, 5.0)])],
    nj.InitialUncertainty(0.1, 0.05, 0.005),
    every=5,
)
RIGHT = nj.ImuErrors(gj.WN(6e-5) + gj.AR1(0.998, 1e-6), gj.WN(1.5e-6), 50.0)
SAME = nj.ImuErrors(gj.WN(6.1e-5) + gj.AR1(0.998, 1e-6), gj.WN(1.5e-6), 50.0)
WRONG = nj.ImuErrors(gj.WN(6e-1) + gj.AR1(0.998, 1e-12), gj.WN(1.5e-2), 50.0)
KEY = jax.random.key(7)
RULE = Significant(first=16)


def compare(filters, **options):
    given = {"num_runs": 96, "key": KEY, "gains": "reference", "chunk_size": 8, "workers": 1} | options
    return nj.compare(SCENARIO, RIGHT, filters, **given)


@pytest.fixture(scope="module")
def told_apart():
    return compare({"right": RIGHT, "wrong": WRONG}, stop=RULE)


@pytest.fixture(scope="module")
def all_runs():
    return compare({"right": RIGHT, "wrong": WRONG})


def test_it_stops_where_filters_are_told_apart(told_apart, all_runs):
    found = told_apart.stopped
    assert found.early
    assert found.looks[-1] == len(told_apart["right"]) < 96
    assert found.looks == RULE.looks(96)[: len(found.looks)]
    np.testing.assert_array_equal(told_apart["wrong"].error, all_runs["wrong"].error[: found.looks[-1]])
    assert not told_apart["right"].interrupted
    assert all_runs.stopped is None


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"chunk_size": 7}, {"workers": 2}, {"chunk_size": 40, "workers": 2}])
def test_it_stops_at_the_same_run_whatever_computes(told_apart, options):
    again = compare({"right": RIGHT, "wrong": WRONG}, stop=RULE, **options)
    assert again.stopped == told_apart.stopped
    assert len(again["right"]) == len(told_apart["right"])


def test_filters_that_are_alike_go_on_to_the_end():
    found = compare({"right": RIGHT, "same": SAME}, num_runs=32, stop=RULE)
    assert found.stopped == Stopped(RULE, (16, 32), 32, False, found.stopped.time)
    assert len(found["same"]) == 32


def test_the_table_takes_account_of_it(told_apart, all_runs):
    table, n = told_apart.table(), len(told_apart["right"])
    text = repr(table)
    assert f"{n} of at most 96 runs" in text
    assert "biased away from zero" in text
    worse = table["wrong"]
    ordinary = replace(told_apart, stopped=None).table()["wrong"]
    assert worse.paired.difference == ordinary.paired.difference
    assert worse.paired.high - worse.paired.low > 1.2 * (ordinary.paired.high - ordinary.paired.low)
    assert worse.p > ordinary.p
    assert worse.p < 0.05
    assert "worse than right" in worse.verdict
    assert "stopped" not in repr(all_runs.table())
    # at another epoch nothing has looked
    other = told_apart.table(at=2.0)
    assert "it looked at" in repr(other)
    assert other["wrong"].paired == replace(told_apart, stopped=None).table(at=2.0)["wrong"].paired


def test_it_is_saved(told_apart, tmp_path):
    for suffix in ("npz", "json"):
        told_apart.save(tmp_path / f"c.{suffix}")
        assert nj.load(tmp_path / f"c.{suffix}").stopped == told_apart.stopped
    again = nj.simulation.Comparison.from_xarray(told_apart.to_xarray())
    assert again.stopped == told_apart.stopped
    assert repr(again) == repr(told_apart)


def test_precision():
    runs = compare({"right": RIGHT}, stop=Precision(position=1e3, least=16, every=16))
    assert runs.stopped.looks == (16,)
    se = np.linalg.norm(runs["right"].errors("position")[:, runs.epoch()], axis=1).std(ddof=1) / 4
    rule = Precision(position=float(se) * 0.75, least=16, every=16)  # wants about 1.8 times as many
    found = compare({"right": RIGHT}, stop=rule)
    assert found.stopped.early
    assert 16 < len(found["right"]) <= 64
    assert found.table()["right"].mean_position_se <= rule.position
    assert "ordinary" in repr(found.table())


def test_one_filter_may_be_precise():
    runs = nj.monte_carlo(
        SCENARIO, RIGHT, num_runs=48, key=KEY, gains="reference", chunk_size=8, stop=Precision(position=1e3, least=16)
    )
    assert len(runs) == 16


# -- rules alone ------------------------------------------------------------------------------------------------------


def drawn(num, means, seed=0, failed=()):
    rng = np.random.default_rng(seed)
    error = {f"f{i}": np.array([[10.0 + m, 0.0, 0.0]]) + rng.normal(size=(num, 1)) for i, m in enumerate(means)}
    return error, {name: ~np.isin(np.arange(num), failed) for name in error}


def test_differences_of_means():
    error, good = drawn(400, [0.0, 0.5])
    se = np.std(np.linalg.norm(error["f0"], axis=1) - np.linalg.norm(error["f1"], axis=1), ddof=1) / np.sqrt(400)
    for factor, enough in ((0.9, False), (1.1, True)):
        watch = Watch(Precision(difference=float(factor * se), least=400), 500, 1.0)
        assert (watch.look(400, error, good) is not None) is enough


def test_looks_see_the_first_runs_only():
    """However many are there, and in whatever portions they come."""
    error, good = drawn(512, [0.0, 0.35])
    at_once = Watch(Significant(), 512, 1.0)
    at_once.look(512, error, good)
    slowly = Watch(Significant(), 512, 1.0)
    for n in range(1, 513):
        if slowly.look(n, error, good) is not None:
            break
    assert slowly.ended == at_once.ended
    assert slowly.ended.early


def test_failed_runs_are_left_out():
    error, good = drawn(256, [0.0, 3.0], failed=range(40))
    for e in error.values():
        e[:40] = np.nan
    found = Watch(Significant(), 256, 1.0).look(256, error, good)
    assert found.looks == (64,)
    none = {name: np.zeros(256, bool) for name in good}
    assert not Watch(Significant(), 256, 1.0).look(256, error, none).early


def test_looks_are_at_whole_chunks():
    assert Watch(Significant(), 500, 1.0, whole=50).looks == (100, 150, 300, 500)
    assert Watch(Anytime(every=16), 100, 1.0, whole=50).looks == (50, 100)
    assert Precision(position=1.0).looks(100) == (100,)


def test_many_models_are_tested_more_strictly():
    """Of ten models alike but one: the pair alone would be told apart at once."""
    error, good = drawn(64, [0.0] + [1.1] * 9, seed=3)
    two = {name: error[name] for name in ("f0", "f1")}
    rule = Anytime()
    assert Watch(rule, 64, 1.0).look(64, two, {name: good[name] for name in two}).looks == (64,)
    looks = rule.looks(64)
    assert rule.bound(0.05 / 45, looks, 64) > rule.bound(0.05, looks, 64)


@pytest.mark.parametrize(
    ("stop", "message"),
    [
        ("soon", "stop is 'significant', 'anytime' or Precision"),
        (0.05, "stop is 'significant'"),
        ("significant", r"state Precision\(position"),
        (Precision(difference=1.0), r"state Precision\(position"),
    ],
)
def test_what_is_no_rule(stop, message):
    with pytest.raises(ValueError, match=message):
        inspect.unwrap(rule_of)(stop, 1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Precision(), "takes position= or difference="),
        (lambda: Precision(position=0.0), "position"),
        (lambda: Significant(alpha=1.0), "alpha"),
        (lambda: Significant(first=4), "first"),
        (lambda: Anytime(every=1), "every"),
    ],
)
def test_rules_that_cannot_be(make, message):
    with pytest.raises(ValueError, match=message):
        make()
