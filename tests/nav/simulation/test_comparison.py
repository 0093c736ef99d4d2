"""A comparison: its numbers against a second computation, what it claims and what it does not, and its way to disk."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from helpers import SIGMAS
from nav.simulation.test_runs import assert_same
from nav.synthetic import make_runs, make_track, with_failures

from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.ranking import Standing, _judge, _round, _with_se, common_runs
from nav_jax.trajectory.trajectory import Trajectory

N = 60


def make_reference():
    t = make_track(np.zeros((101, 15)))
    return Trajectory(t.time, t.position, t.velocity, t.quaternion, name="figure of eight")


@pytest.fixture(scope="module")
def reference():
    return make_reference()


@pytest.fixture(scope="module")
def comparison(reference):
    models = {
        "poor": with_failures("poor", [3], num_runs=N, scale=1.5, inflation=1.8, axes=(), noise=7),
        "right": with_failures("right", [9], num_runs=N, notes=("QN was left out.",)),
        "near": make_runs("near", N, scale=1.02, noise=6, notes=("QN was left out.",)),
    }
    return Comparison(reference, models, "MTi-G")


# -- the numbers ------------------------------------------------------------------------------------------------------


def test_the_table_counts_the_common_runs(comparison):
    table = comparison.table()
    assert table.num_runs == comparison.num_common == N - 2
    assert table.time == 80.0
    assert [one.model for one in table] == ["right", "near", "poor"]
    assert [one.num_failed for one in table] == [1, 0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("at", [None, 30.0])
def test_the_numbers_of_each_model(comparison, at):
    table = comparison.table(at)
    chosen = [i for i in range(N) if i not in (3, 9)]
    k = 80 if at is None else 30
    for one in table:
        r = comparison[one.model]
        e, P = r.error[chosen, k], r.position_covariance[chosen, k]
        distance = np.sqrt(np.sum(e[:, :3] ** 2, axis=1))
        assert one.mean_position == pytest.approx(distance.mean(), rel=1e-11)
        assert one.mean_position_se == pytest.approx(scipy.stats.sem(distance), rel=1e-11)
        assert one.rms_position == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-11)
        angle = np.sqrt(np.sum(e[:, 6:9] ** 2, axis=1))
        assert one.mean_orientation == pytest.approx(angle.mean(), rel=1e-11)
        assert one.mean_orientation_se == pytest.approx(scipy.stats.sem(angle), rel=1e-11)
        # the energy score by drawing from the filter's Gaussian
        rng = np.random.default_rng(3)
        x, y = (rng.standard_normal((2, 20_000, len(chosen), 3))[..., None, :] @ np.linalg.cholesky(P).mT)[..., 0, :]
        scores = np.linalg.norm(x - e[:, :3], axis=-1) - 0.5 * np.linalg.norm(x - y, axis=-1)
        by_draw = scores.mean(axis=1)
        assert abs(by_draw.mean() - one.energy_score) < SIGMAS * scipy.stats.sem(by_draw)
        # consistency of the pose
        nees = r.nees["pose"][chosen]
        assert one.nees == pytest.approx(nees[:, k].mean() / 6, rel=1e-11)
        low, high = scipy.stats.chi2(6 * (N - 2)).ppf([0.025, 0.975]) / (N - 2)
        inside = (nees.mean(axis=0) > low) & (nees.mean(axis=0) < high)
        assert one.nees_inside == inside[k]
        assert one.nees_share == pytest.approx(inside.mean())
        covered = np.mean(nees[:, k] <= scipy.stats.chi2(6).ppf(0.95))
        assert one.coverage == pytest.approx(covered)
        binomial = scipy.stats.binom(N - 2, 0.95)
        assert one.coverage_inside == (binomial.ppf(0.025) <= covered * (N - 2) <= binomial.ppf(0.975))


def test_differences_are_tested_in_the_same_runs(comparison):
    table = comparison.table()
    chosen = [i for i in range(N) if i not in (3, 9)]
    d = {name: np.linalg.norm(r.error[chosen, 80, :3], axis=-1) for name, r in comparison.runs.items()}
    pairs = [("right", "near"), ("right", "poor"), ("near", "poor")]
    p = np.array([scipy.stats.ttest_rel(d[a], d[b]).pvalue for a, b in pairs])
    order = np.argsort(p)
    holm = np.empty(3)
    holm[order] = np.maximum.accumulate(p[order] * [3, 2, 1])
    for one, i in ((table["near"], 0), (table["poor"], 1)):
        test = scipy.stats.ttest_rel(d[one.model], d["right"])
        interval = test.confidence_interval(0.95)
        assert one.against == "right"
        assert one.paired.difference == pytest.approx(np.mean(d[one.model] - d["right"]))
        assert (one.paired.low, one.paired.high) == pytest.approx((interval.low, interval.high))
        assert one.p == pytest.approx(min(holm[i], 1.0), rel=1e-9)
    assert table["right"].paired is None
    assert table["right"].verdict == "better than poor"
    assert table["poor"].verdict == "worse than right"
    assert table["near"].verdict.startswith("not distinguishable from right (would need ~")


def judge(distances):
    names = sorted(distances, key=lambda name: distances[name].mean())
    standings = [Standing(name, 10, 0, mean_position=float(distances[name].mean())) for name in names]
    return _judge(standings, distances, 0.95, None)


def test_ten_runs_do_not_tell_854_from_865_m():
    """The R package's own example (N = 10): the right model 8.54 m, the wrong one 8.65 m, and not a word of doubt."""
    rng = np.random.default_rng(0)
    right = rng.gamma(4, 1.0, 10)
    wrong = right + rng.normal(0, 1.0, 10)
    best, other = judge({"right": right - right.mean() + 8.54, "wrong": wrong - wrong.mean() + 8.65})
    assert best.verdict == "not distinguishable from any other"
    assert other.paired.difference == pytest.approx(0.11)
    needed = other.paired.num_runs_needed
    # the normal approximation: (1.96 + 0.84)^2 (sd / difference)^2
    assert needed == pytest.approx(7.849 * 10 * (other.paired.se / 0.11) ** 2, rel=0.02)
    assert other.verdict == f"not distinguishable from right (would need ~{_round(needed)} runs)"


@pytest.mark.slow
def test_of_equal_models_none_is_called_better():
    """At 5 % for the whole table, though the best one is chosen by the same data: 1000 tables of 3 equal models."""
    rng = np.random.default_rng(1)
    tables = 1000
    claims = 0
    for _ in range(tables):
        common = rng.normal(10, 2, 15)
        claims += judge({name: common + rng.normal(0, 1, 15) for name in "abc"})[0].verdict.startswith("better")
    assert claims / tables < 0.05 + SIGMAS * np.sqrt(0.05 * 0.95 / tables)
    assert claims / tables > 0.02  # nor is the test so careful that it says nothing


def test_a_difference_is_found_with_the_runs_that_it_needs():
    """The number that a verdict names has the power that it promises, here for one pair: 80 %."""
    rng = np.random.default_rng(2)
    trials, effect = 1500, 0.5
    n = 34  # a paired t test needs 33.4 pairs to see half a standard deviation
    found = sum(
        judge({"a": (x := rng.normal(10, 2, n)), "b": x + rng.normal(effect, 1, n)})[0].verdict == "better than b"
        for _ in range(trials)
    )
    assert abs(found / trials - 0.8) < 0.01 + SIGMAS * np.sqrt(0.8 * 0.2 / trials)


def test_identical_models(reference):
    r = make_runs("a", 10)
    table = Comparison(reference, {"a": r, "b": r}).table()
    assert table["b"].verdict == "not distinguishable from a (no difference at all)"
    assert table["b"].p == 1.0


# -- what it says -----------------------------------------------------------------------------------------------------


def test_it_prints_all_that_a_reader_must_know(comparison):
    text = repr(comparison)
    assert text.startswith("Comparison of poor, right, near along figure of eight\ntruth: MTi-G\n")
    assert "right: 60 runs, 1 failed (" in text
    assert "near: 60 runs\n" in text
    assert "outages: 60 .. 80 s" in text
    assert "mean over 58 common runs at 80 s" in text
    assert "note on right, near: QN was left out." in text
    assert "* outside the 95 % band" in text
    assert "Holm over all 3 pairs" in text
    assert "right: better than poor" in text
    lines = text.splitlines()
    assert max(map(len, lines)) <= 140
    rows = [line.split()[0] for line in lines[lines.index(next(x for x in lines if x.startswith("model "))) + 2 :][:3]]
    assert rows == ["right", "near", "poor"]
    one = comparison.table()["right"]
    assert f"{one.mean_position:.2f} ± {one.mean_position_se:.2f}" in text


def test_the_table_as_plain_numbers(comparison):
    rows = json.loads(json.dumps(comparison.table().to_list()))
    assert rows[0]["model"] == "right"
    assert rows[0]["p"] is None
    assert rows[1]["paired"]["num_runs"] == N - 2
    with pytest.raises(KeyError, match="there are right, near, poor"):
        comparison.table()["wrong"]


def test_one_model_alone(reference):
    text = repr(Comparison(reference, {"only": make_runs("only", 20)}))
    assert "each model: 20 runs" in text
    assert "difference" not in text


def test_a_model_that_fails_everywhere_is_not_ranked(reference):
    models = {"broken": with_failures("broken", range(1, 6), num_runs=6), "works": make_runs("works", 6)}
    table = Comparison(reference, models).table()
    assert [one.model for one in table] == ["works", "broken"]
    assert table.num_runs == 6
    assert np.isnan(table["broken"].mean_position)
    assert "broken: finished 1 of 6 runs: not ranked" in repr(table)


@pytest.mark.parametrize("num_runs", [1, 4])
def test_too_few_runs(reference, num_runs):
    """One run; and models that never finish the same one."""
    half = num_runs // 2
    a = with_failures("a", range(half), num_runs=num_runs)
    b = with_failures("b", range(half, 2 * half), num_runs=num_runs)
    few = Comparison(reference, {"a": a, "b": b})
    assert "No ranking: it takes 2 or more runs" in repr(few)
    with pytest.raises(
        ValueError, match=f"takes 2 or more runs in which no model failed, and there are 0 of {num_runs}"
    ):
        few.table()


def test_an_interrupted_model_has_fewer_runs(reference):
    models = {"a": make_runs("a", 9), "b": make_runs("b", 6, num_requested=9)}
    text = repr(Comparison(reference, models))
    assert "b: 6 runs of 9 (interrupted)" in text
    assert "mean over 6 common runs" in text


def test_without_a_nees_at_the_start(reference):
    """From an exact start there is nothing to normalise with at the first epoch."""
    r = make_runs("a", 10)
    r.nees["pose"][:, 0] = np.nan
    table = Comparison(reference, {"a": r}).table()
    assert np.isfinite(table["a"].nees_share)
    first = Comparison(reference, {"a": r}).table(at=0.0)
    assert np.isnan(first["a"].nees)
    assert repr(first).splitlines()[-1].split()[-4:] == ["-", "95", "%", "-"]
    r.nees["pose"][:] = np.nan
    assert repr(Comparison(reference, {"a": r})).splitlines()[-1].split()[-3:] == ["-", "-", "-"]


def test_common_runs_are_the_same_numbers():
    models = {"a": with_failures("a", [1, 4], num_runs=6), "b": with_failures("b", [2], num_runs=5)}
    assert common_runs(models).tolist() == [0, 3]


@pytest.mark.parametrize(
    ("value", "se", "expected"),
    [
        (8.5432, 0.512, "8.54 ± 0.51"),
        (123.4, 12.3, "123 ± 12"),
        (1234.5, 123.4, "1234 ± 123"),
        (0.01234, 0.00056, "0.01234 ± 0.00056"),
        (2.0, 0.0, "2"),
        (np.nan, np.nan, "-"),
        (3e-12, 1e-13, "3e-12 ± 1e-13"),
    ],
)
def test_numbers_go_to_the_second_digit_of_their_error(value, se, expected):
    assert _with_se(value, se) == expected


@pytest.mark.parametrize(
    ("n", "expected"), [(2, "2"), (61, "61"), (601, "610"), (123_456, "130\u2009000"), (9_999, "10\u2009000")]
)
def test_numbers_of_runs_are_round(n, expected):
    assert _round(n) == expected


# -- what is refused --------------------------------------------------------------------------------------------------


def test_models_that_cannot_be_compared(reference):
    a, b = make_runs("a", 3), make_runs("b", 3)
    with pytest.raises(ValueError, match="takes one model or more"):
        Comparison(reference, {})
    with pytest.raises(ValueError, match="a and b have different epochs"):
        Comparison(reference, {"a": a, "b": replace(b, time=b.time + 1)})
    moved = b.nis_time | {"gnss": b.nis_time["gnss"] + 0.1}
    with pytest.raises(ValueError, match="different fixes of gnss"):
        Comparison(reference, {"a": a, "b": replace(b, nis_time=moved)})
    with pytest.raises(KeyError, match="No model 'c'; there are a, b"):
        Comparison(reference, {"a": a, "b": b})["c"]


def test_the_key_is_the_name(reference):
    assert Comparison(reference, {"mine": make_runs("filter", 3)})["mine"].name == "mine"


# -- xarray and disk --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def uneven(reference):
    """Models that differ in runs, states, sensors and tracks."""
    b = make_runs("b", 4, axes=(0, 5), num_requested=6, outages={})
    only = {name: {"gnss": getattr(b, name)["gnss"]} for name in ("nis", "nis_time", "nis_dof", "innovation")}
    b = replace(b, tracks={0: b.tracks[0], 3: make_track(b.error[3])}, **only)
    models = {"a, b": make_runs("a, b", 6, axes=()), "b": b, "z": with_failures("z", [0], num_runs=6, tracks={})}
    return Comparison(reference, models, "τ = 3 s")


def test_the_dataset_has_a_dimension_of_models(comparison):
    d = comparison.to_xarray()
    assert d["error"].dims == ("model", "run", "time", "component")
    assert d["model"].values.tolist() == ["poor", "right", "near"]
    picked = d["sd"].sel(model="near", run=4, time=70.0, component="velocity_e").item()
    assert picked == comparison["near"].sd[4, 70, 4]
    assert d["reference_position"].attrs["units"] == "m"
    assert d["status"].sel(model="poor").values.tolist() == comparison["poor"].status.tolist()


def test_gaps_are_marked(uneven):
    d = uneven.to_xarray()
    assert d["status"].sel(model="b").values.tolist() == [0, 0, 0, 0, -1, -1]
    assert d["status"].sel(model="z").values.tolist() == [1, 0, 0, 0, 0, 0]
    assert d["dof"].sel(group="sensors").values.tolist() == [0, 2, 6]
    assert np.all(np.isnan(d["error"].sel(model="b", run=5)))


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
@pytest.mark.parametrize("which", ["comparison", "uneven"])
def test_disk_gives_back_what_it_was_given(request, tmp_path, which, suffix):
    given = request.getfixturevalue(which)
    found = Comparison.load(given.save(tmp_path / f"c{suffix}"))
    assert list(found.runs) == list(given.runs)
    assert (found.truth, found.reference.name) == (given.truth, given.reference.name)
    for name in given.runs:
        assert_same(found[name], given[name])
    for part in ("time", "position", "velocity", "quaternion"):
        np.testing.assert_array_equal(getattr(found.reference, part), getattr(given.reference, part))
    assert repr(found) == repr(given)


def test_xarray_itself_may_write(uneven, tmp_path):
    """As the README has it: cmp.to_xarray().to_zarr(...)."""
    uneven.to_xarray().to_zarr(tmp_path / "c.zarr", zarr_format=2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Zarr's, of its third format
        uneven.to_xarray().to_zarr(tmp_path / "3.zarr", zarr_format=3)
    for name in ("c", "3"):
        assert_same(Comparison.load(tmp_path / f"{name}.zarr")["b"], uneven["b"])


def test_a_dataset_of_runs_is_no_comparison(uneven):
    with pytest.raises(ValueError, match="not one that Comparison"):
        Comparison.from_xarray(uneven["b"].to_xarray())
