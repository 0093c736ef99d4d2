"""Two levels of runs: what is combined, what is said, and when all runs have their own gains."""

import dataclasses

import jax
import numpy as np
import pytest

import nav_jax as nj
from nav_jax.app.reports import two_level_report
from nav_jax.simulation import levels

RATE = 20.0
KEY = jax.random.key(4)
ERRORS = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-7)", RATE)
SCENARIO = nj.Scenario(
    nj.motions.lemniscate(6.0, RATE), [nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=[(2.5, 5.0)])],
    nj.InitialUncertainty(0.1, 0.05, np.deg2rad([1.0, 1.0, 5.0])),
)  # fmt: skip
FILTERS = {"right": ERRORS, "calm": nj.ImuErrors("WN(sigma2=1e-5)", "WN(sigma2=1e-8)", RATE)}


def runs_of(gains, count):
    return nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=count, key=KEY, gains=gains)


@pytest.fixture(scope="module")
def found():
    """As where nobody knows the mean of linear runs."""
    return levels.two_levels(runs_of, 192, 0.5, None)


@pytest.fixture(scope="module")
def controlled():
    return nj.simulation.two_level(SCENARIO, ERRORS, FILTERS, num_runs=192, key=KEY, excess=0.5)


def test_the_first_runs_are_the_same_runs_with_gains_of_their_own(found):
    assert found.num_runs == 192
    assert 64 <= found.num_own < 192
    own = runs_of("estimate", found.num_own)
    shared = runs_of("reference", 192)
    of = {n: [np.linalg.norm(c[n].errors("position"), axis=2) for c in (shared, own)] for n in FILTERS}
    for name, (many, few) in of.items():
        expected = many.mean(axis=0) + (few - many[: len(few)]).mean(axis=0)
        np.testing.assert_allclose(found.mean(name).value, expected, rtol=1e-7)
    (a, b), (c, d) = of["right"], of["calm"]
    expected = (a - c).mean(axis=0) + ((b - d) - (a - c)[: len(b)]).mean(axis=0)
    np.testing.assert_allclose(found.difference("right", "calm").value, expected, rtol=1e-6, atol=1e-12)


def test_linear_runs_stand_for_all_where_their_mean_is_known(controlled):
    """The mean is the one that is known, and what the runs with gains of their own have more."""
    assert controlled.cheap == "linear"
    assert controlled.num_own == controlled.num_runs == 64
    own = runs_of("estimate", 64)
    lengths = {n: np.linalg.norm(own[n].errors("position"), axis=2) for n in FILTERS}
    for name, values in lengths.items():
        linear = np.linalg.norm(controlled.shared[name].errors("position"), axis=2)
        expected = controlled.known[name]["position"] + (values - linear).mean(axis=0)
        np.testing.assert_allclose(controlled.mean(name).value, expected, rtol=1e-7)
        assert controlled.mean(name).se[4] < 0.2 * values[:, 4].std() / np.sqrt(192)
    expected = controlled.mean("right").value - controlled.mean("calm").value
    np.testing.assert_allclose(controlled.difference("right", "calm").value, expected, atol=1e-12)


def test_a_comparison_of_two_levels_is_that(controlled):
    again = nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=192, key=KEY, gains="two-level")
    assert isinstance(again, nj.simulation.TwoLevel)
    assert again.excess == 0.05
    np.testing.assert_allclose(again.own["calm"].error[:64], controlled.own["calm"].error, rtol=1e-7, atol=1e-12)
    smoothed = nj.compare(SCENARIO, ERRORS, num_runs=8, key=KEY, gains="two-level", smooth=True)
    assert "the smoother" in smoothed.own["filter"].notes[-1]
    assert smoothed.cheap == "shared"


def prepared(**runs):
    """Runs that are there already, as the argument of `two_levels`; what it asks for is written down."""
    asked = []

    def run(gains, count):
        asked.append((gains, count))
        return runs[gains]

    return run, asked


def test_means_that_the_runs_contradict_are_not_believed(found, controlled):
    wrong = {name: {of: 3.0 * mean for of, mean in known.items()} for name, known in controlled.known.items()}
    run, asked = prepared(estimate=controlled.own, linear=controlled.shared, reference=found.shared)
    assert levels.two_levels(run, 192, 0.5, wrong).cheap == "shared"
    assert [gains for gains, _ in asked[:3]] == ["estimate", "linear", "reference"]


def test_a_filter_that_fails_has_no_stand_in(found, controlled):
    """The runs that fail are others: what shared gains do in them says nothing, so that all have gains of their own."""
    own = controlled.own["calm"]
    status = np.zeros(len(own), dtype=np.int64)
    status[3] = nj.filter.Status.non_finite
    error = np.where((status > 0)[:, None, None], np.nan, own.error)
    failing = dataclasses.replace(own, status=status, error=error)
    pilot = dataclasses.replace(controlled.own, runs={"right": controlled.own["right"], "calm": failing})
    run, asked = prepared(estimate=pilot, linear=controlled.shared, reference=found.shared)
    levels.two_levels(run, 192, 0.5, controlled.known)
    assert asked[-1] == ("estimate", 192)


@pytest.mark.parametrize("option", [{"keep": [1]}, {"stop": "significant"}])
def test_means_have_no_runs_to_keep_or_stop(option):
    with pytest.raises(ValueError, match="Leave keep and stop out"):
        nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=8, key=KEY, gains="two-level", **option)
    with pytest.raises(ValueError, match=r"use nav_jax\.compare"):
        nj.monte_carlo(SCENARIO, ERRORS, num_runs=8, key=KEY, gains="two-level")


@pytest.mark.parametrize("which", ["found", "controlled"])
def test_it_prints_draws_and_saves_itself(which, request, tmp_path):
    found = request.getfixturevalue(which)
    text = repr(found)
    first, less = {
        "found": ("192 runs on shared gains", "own - shared [m]"),
        "controlled": ("64 runs with gains of their own, and what linear filters do in them", "own - linear [m]"),
    }[which]
    assert first in text
    assert less in text
    assert ("as sure as" in text) == (which == "controlled")
    assert len(found.plot().axes) == 2
    for suffix in (".npz", ".json", ".nc", ".zarr"):
        back = nj.load(found.save(tmp_path / f"levels{suffix}"))
        assert repr(back) == text
    np.testing.assert_array_equal(back.mean("calm", "nees").se, found.mean("calm", "nees").se)
    with pytest.raises(ValueError, match="'height' is none of position, velocity, attitude, nees"):
        found.mean("right", "height")
    with pytest.raises(ValueError, match="same filters"):
        dataclasses.replace(found, own=nj.simulation.Comparison(found.own.reference, {"right": found.own["right"]}))


def test_where_shared_gains_do_not_stand_for_own_ones_all_runs_have_their_own():
    """A heading that is known to 60 deg: what the filter linearises about is another one in every run."""
    start = nj.InitialUncertainty(0.1, 0.05, np.deg2rad([1.0, 1.0, 60.0]))
    with pytest.warns(nj.filter.LinearisationWarning):
        lost = dataclasses.replace(SCENARIO, initial=start)
    found = nj.simulation.two_level(lost, ERRORS, num_runs=128, key=KEY)
    assert found.num_own == found.num_runs == 128
    assert "All runs have gains of their own" in repr(found)
    own = np.linalg.norm(found.own["filter"].errors("position"), axis=2)
    np.testing.assert_allclose(found.mean("filter").value, own.mean(axis=0), rtol=1e-9)


def test_a_filter_without_good_runs_is_left_out(found):
    """And a run that failed is not counted under another number."""
    own = found.own["right"]
    failed = np.arange(len(own)) < 3
    error = np.where(failed[:, None, None], np.nan, own.error)
    some = dataclasses.replace(own, status=failed.astype(np.int64), error=error)
    none = dataclasses.replace(found.own["calm"], status=np.ones(len(own), dtype=np.int64))
    partly = dataclasses.replace(found, own=dataclasses.replace(found.own, runs={"right": some, "calm": none}))
    assert partly.with_means == ("right",)
    assert partly.num_common == found.num_own - 3
    lengths = [np.linalg.norm(c["right"].errors("position"), axis=2) for c in (found.shared, found.own)]
    differences = lengths[1][3:] - lengths[0][3 : found.num_own]
    np.testing.assert_allclose(partly.mean("right").correction, differences.mean(axis=0), rtol=1e-9, atol=1e-15)
    with pytest.raises(ValueError, match="calm has no mean"):
        partly.mean("calm")
    text = repr(partly)
    assert "only those count in which no filter failed" in text
    assert "right: " in text
    assert len(partly.plot().axes) == 2
    assert list(two_level_report(partly).content["models"]) == ["right"]


def test_every_statistic_is_one_number_a_run_and_epoch(found):
    runs = found.shared["right"]
    for name, of in levels.STATISTICS.items():
        assert of(runs).shape == (len(runs), len(runs.time)), name
