"""Two levels of runs: what is combined, what is said, and when all runs have their own gains."""

import dataclasses

import jax
import numpy as np
import pytest

import nav_jax as nj
from nav_jax.simulation import levels

RATE = 20.0
KEY = jax.random.key(4)
ERRORS = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-7)", RATE)
SCENARIO = nj.Scenario(
    nj.motions.lemniscate(6.0, RATE), [nj.GnssPosition(horizontal=0.1, vertical=0.2, outages=[(2.5, 5.0)])],
    nj.InitialUncertainty(0.1, 0.05, np.deg2rad([1.0, 1.0, 5.0])),
)  # fmt: skip
FILTERS = {"right": ERRORS, "calm": nj.ImuErrors("WN(sigma2=1e-5)", "WN(sigma2=1e-8)", RATE)}


@pytest.fixture(scope="module")
def found():
    return nj.simulation.two_level(SCENARIO, ERRORS, FILTERS, num_runs=192, key=KEY, excess=0.5)


def test_the_first_runs_are_the_same_runs_with_gains_of_their_own(found):
    assert found.num_runs == 192
    assert 64 <= found.num_own < 192
    own = nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=found.num_own, key=KEY)
    shared = nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=192, key=KEY, gains="reference")
    of = {n: [np.linalg.norm(c[n].errors("position"), axis=2) for c in (shared, own)] for n in FILTERS}
    for name, (many, few) in of.items():
        expected = many.mean(axis=0) + (few - many[: len(few)]).mean(axis=0)
        np.testing.assert_allclose(found.mean(name).value, expected, rtol=1e-7)
    (a, b), (c, d) = of["right"], of["calm"]
    expected = (a - c).mean(axis=0) + ((b - d) - (a - c)[: len(b)]).mean(axis=0)
    np.testing.assert_allclose(found.difference("right", "calm").value, expected, rtol=1e-6, atol=1e-12)


def test_a_comparison_of_two_levels_is_that(found):
    again = nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=192, key=KEY, gains="two-level")
    assert isinstance(again, nj.simulation.TwoLevel)
    assert again.excess == 0.05
    assert again.num_own >= found.num_own  # fewer do where more excess is allowed
    np.testing.assert_array_equal(again.shared["calm"].error, found.shared["calm"].error)
    np.testing.assert_array_equal(again.own["calm"].error[: found.num_own], found.own["calm"].error)
    smoothed = nj.compare(SCENARIO, ERRORS, num_runs=8, key=KEY, gains="two-level", smooth=True)
    assert "the smoother" in smoothed.own["filter"].notes[-1]


@pytest.mark.parametrize("option", [{"keep": [1]}, {"stop": "significant"}])
def test_means_have_no_runs_to_keep_or_stop(option):
    with pytest.raises(ValueError, match="Leave keep and stop out"):
        nj.compare(SCENARIO, ERRORS, FILTERS, num_runs=8, key=KEY, gains="two-level", **option)
    with pytest.raises(ValueError, match=r"use nav_jax\.compare"):
        nj.monte_carlo(SCENARIO, ERRORS, num_runs=8, key=KEY, gains="two-level")


def test_it_prints_draws_and_saves_itself(found, tmp_path):
    text = repr(found)
    assert "192 runs on shared gains" in text
    assert "own - shared [m]" in text
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


def test_every_statistic_is_one_number_a_run_and_epoch(found):
    runs = found.shared["right"]
    for name, of in levels.STATISTICS.items():
        assert of(runs).shape == (len(runs), len(runs.time)), name
