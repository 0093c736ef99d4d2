"""Runs depend on their key alone: not on chunks, threads, other filters or how many there are. And what is refused."""

import importlib
import inspect

import jax
import numpy as np
import pytest
from helpers import CountTraces, Told
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter import experiment
from nav_jax.filter import loop as filter

REFERENCE = nj.motions.lemniscate(5.0, setups.RATE)
RIGHT = nj.ImuErrors(gj.WN(6e-5) + gj.AR1(0.998, 1e-8), gj.WN(1.5e-6), setups.RATE)
WRONG = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), setups.RATE)
AIDING = setups.aiding(2.5, 4.0)
KEY = jax.random.key(5)
START = nj.InitialUncertainty(0.1, 0.05, 0.005)


MONTE_CARLO = importlib.import_module("nav_jax.simulation.collected")
"""Whose name in the package is that of the function in it."""


SCENARIO = nj.Scenario(REFERENCE, AIDING, START)


def compare(filters=None, *, truth=RIGHT, scenario=SCENARIO, **options):
    """Seven runs in one chunk: other sizes are other programs."""
    filters = {"right": RIGHT, "wrong": WRONG} if filters is None else filters
    return nj.compare(
        scenario, truth, filters, **({"num_runs": 7, "chunk_size": 7, "workers": 1, "key": KEY} | options)
    ).runs


@pytest.fixture(scope="module")
def seven():
    return compare()


def assert_same(a, b, count=None, rtol=1e-8):
    """Equal numbers, of the first `count` runs; relative to the largest of each array."""
    for seen, expected in [
        (a.error, b.error),
        (a.sd, b.sd),
        (a.position_covariance, b.position_covariance),
        *((a.nees[g], b.nees[g]) for g in b.nees),
        *((a.nis[s], b.nis[s]) for s in b.nis),
        *((a.innovation[s], b.innovation[s]) for s in b.nis),
    ]:
        seen, expected = seen[:count], expected[:count]
        np.testing.assert_allclose(seen, expected, rtol=0, atol=rtol * np.nanmax(np.abs(expected)))


@pytest.mark.slow
@pytest.mark.parametrize(("chunk_size", "workers"), [(7, 2), (3, 1)])
def test_chunks_and_threads_change_nothing(seven, chunk_size, workers):
    again = compare(chunk_size=chunk_size, workers=workers)
    for name, runs in seven.items():
        assert_same(again[name], runs)


@pytest.mark.slow
def test_a_run_is_the_same_however_many_there_are(seven):
    more = compare(num_runs=9, chunk_size=3)
    assert more["right"].error.shape[0] == 9
    assert_same(more["right"], seven["right"], 7)


def test_all_filters_have_the_same_runs(seven):
    """Common random numbers: a filter alone has the runs that it has among others, and a copy of one has its runs."""
    alone = compare({"wrong": WRONG, "twin": WRONG})
    assert_same(alone["wrong"], seven["wrong"])
    np.testing.assert_array_equal(alone["twin"].error, alone["wrong"].error)
    # and filters whose beliefs differ make errors that go together
    a, b = (seven[name].error[:, 1, :3].ravel() for name in ("right", "wrong"))
    assert np.corrcoef(a, b)[0, 1] > 0.9


def test_the_right_filter_claims_the_size_of_its_errors(seven):
    """Of seven runs a mean NEES within a factor of 3; bands, coverage and innovations of 2000 are in tests/validation.

    The wrong filter claims too little.
    """
    for group, dof in seven["right"].dof.items():
        assert 1 / 3 < seven["right"].nees[group].mean() / dof < 3
    assert seven["wrong"].nees["navigation"].mean() > seven["right"].nees["navigation"].mean()


def test_another_key_makes_other_runs(seven):
    other = compare(key=jax.random.key(6))["right"]
    assert np.abs(other.error[:, -1, :3] - seven["right"].error[:, -1, :3]).min() > 1e-6


def test_one_filter_alone(seven):
    runs = nj.monte_carlo(SCENARIO, RIGHT, num_runs=7, key=KEY, chunk_size=7)
    assert_same(runs, seven["right"])
    assert runs.name == "filter"
    with pytest.raises(ValueError, match="state what the filter believes"):
        nj.monte_carlo(SCENARIO, recorded(600), num_runs=2, key=KEY)


def test_outputs_are_where_they_were_asked_for(seven):
    runs = seven["right"]
    np.testing.assert_allclose(runs.time, [1, 2, 3, 4, 5], rtol=0, atol=1e-12)
    assert runs.outages == {"gnss_position": ((2.5, 4.0),), "gnss_velocity": ((2.5, 4.0),)}
    np.testing.assert_allclose(runs.nis_time["gnss_position"], [1, 2, 5])
    assert runs.nis_dof == {"gnss_position": 3, "gnss_velocity": 3, "barometer": 1}
    assert runs.dof["sensors"] == 3
    assert "sensors" not in seven["wrong"].dof
    np.testing.assert_array_equal(seven["wrong"].sd[..., 9:], 0.0)
    assert not runs.status.any()


def test_an_interrupt_returns_what_is_done(monkeypatch, seven):
    """The third chunk is interrupted; what is whole before it is kept, and what was asked for is remembered."""
    calls = []

    def interrupted(*args, **kwargs):
        calls.append(1)
        if len(calls) > 4:
            raise KeyboardInterrupt
        return experiment.run_filter(*args, **kwargs)

    monkeypatch.setattr(MONTE_CARLO, "run_filter", interrupted)
    runs = compare(chunk_size=3)
    assert {r.error.shape[0] for r in runs.values()} <= {3, 6}
    for name, r in runs.items():
        assert r.num_requested == 7
        assert_same(r, seven[name], r.error.shape[0])


def test_an_interrupt_before_anything_is_one(monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(MONTE_CARLO, "run_filter", interrupted)
    with pytest.raises(KeyboardInterrupt):
        compare(chunk_size=3)


@pytest.mark.slow
@pytest.mark.parametrize("gains", ["estimate", "reference"])
def test_whole_trajectories_of_chosen_runs(gains):
    runs = compare({"right": RIGHT}, keep=(4, 1), gains=gains)["right"]
    assert sorted(runs.tracks) == [1, 4]
    at_fixes = np.unique(np.concatenate(list(runs.nis_time.values())))
    for i, track in runs.tracks.items():
        assert len(track.time) == 501
        # an output falls on every hundredth epoch: estimate and claim are those that the run is judged by
        at = np.searchsorted(track.time, runs.time - 1e-6)
        truth = REFERENCE.position[100::100]
        np.testing.assert_allclose(track.position[at] - truth, runs.error[i, :, :3], rtol=0, atol=1e-6)
        np.testing.assert_allclose(track.sd[at], runs.sd[i], rtol=1e-7, atol=1e-12)
        # the side before a fix is that of the sample before it, moved on by 10 ms
        np.testing.assert_allclose(track.before.time, at_fixes, rtol=0, atol=1e-9)
        fixed = np.searchsorted(track.time, at_fixes - 1e-6)
        on = track.position[fixed - 1] + 0.01 * track.velocity[fixed - 1]
        np.testing.assert_allclose(track.before.position, on, rtol=0, atol=2e-3)
        assert np.all(track.before.sd[:, 2] > track.sd[fixed, 2])


def recorded(num=2000):
    rng = np.random.default_rng(0)
    return nj.RecordedErrors(rng.normal(size=(num, 3)) * 8e-3, rng.normal(size=(num, 3)) * 1e-3, setups.RATE)


@pytest.mark.slow
def test_recorded_errors():
    runs = compare({"wrong": WRONG, "right": RIGHT}, truth=recorded())
    for r in runs.values():
        assert "sensors" not in r.dof
        assert any("recording" in note for note in r.notes)
        assert np.isfinite(r.error).all()
    assert 3 < runs["wrong"].nees["navigation"].mean() < 20


@pytest.mark.slow
def test_nothing_is_compiled_twice(monkeypatch):
    """New numbers in the models, the same structure: the filter is not traced again."""
    counted = CountTraces(filter.mechanise_with_motion)
    monkeypatch.setattr(filter, "mechanise_with_motion", counted)
    # a structure that no other test of this file has
    aiding = (nj.GnssPosition(1.0, horizontal=0.3, vertical=0.5, name="only"),)
    compare({"a": RIGHT}, scenario=nj.Scenario(REFERENCE, aiding, START))
    first = counted.count
    assert first > 0
    other = nj.ImuErrors(gj.WN(5e-5) + gj.AR1(0.99, 2e-8), gj.WN(1e-6), setups.RATE)
    scenario = nj.Scenario(REFERENCE, aiding, nj.InitialUncertainty(0.2))
    compare({"b": other}, truth=other, scenario=scenario, key=jax.random.key(9))
    assert counted.count == first


def test_progress_is_told_and_cancels():
    told = Told()
    compare(chunk_size=3, workers=2, progress=told)
    told.assert_whole(18, at_least=4)  # two filters, three chunks, the last one filled up
    with pytest.raises(LookupError, match="enough"):
        compare(chunk_size=3, workers=2, progress=Told(4))


@pytest.mark.slow
def test_quantisation_noise_is_named_and_left_out():
    noisy = nj.ImuErrors(gj.WN(6e-5) + gj.QN(1e-6), gj.WN(1.5e-6), setups.RATE)
    runs = compare({"with": noisy, "without": WRONG}, truth=noisy)
    assert any("no state" in note for note in runs["with"].notes)
    assert not runs["without"].notes
    np.testing.assert_array_equal(runs["with"].error, runs["without"].error)


OTHER_RATE = nj.ImuErrors(gj.WN(6e-5), gj.WN(1.5e-6), 50.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"filters": {"slow": OTHER_RATE}}, "belongs to 50 Hz.*100 Hz"),
        ({"filters": {}}, "at least one filter"),
        ({"num_runs": 0}, "num_runs"),
        ({"num_runs": -3}, "num_runs"),
        ({"chunk_size": -1}, "chunk_size"),
        ({"workers": -1}, "workers"),
        ({"gains": "magic"}, "gains is one of"),
        ({"keep": (7,)}, "cannot be kept"),
        ({"keep": (1,), "smooth": True}, "are those of the filter"),
        ({"truth": recorded(300)}, "recording has 300 samples"),
        ({"truth": recorded(600), "filters": None}, "state what the filter believes"),
    ],
)
def test_bad_input(options, message):
    """Below the type checks of the test run, which users do not have."""
    given = {"scenario": SCENARIO, "truth": RIGHT, "filters": {"right": RIGHT}, "num_runs": 7, "key": KEY, **options}
    with pytest.raises(ValueError, match=message):
        inspect.unwrap(nj.compare)(**given)


def test_what_is_no_model_or_no_scenario():
    """Below the type checks of the test run."""
    check = inspect.unwrap(experiment.check_rates)
    with pytest.raises(ValueError, match="believes ImuErrors"):
        check(RIGHT, {"fit": "WN(1)"})
    with pytest.raises(ValueError, match="truth is ImuErrors"):
        check("WN(1)", {"right": RIGHT})
    with pytest.raises(ValueError, match="scenario must be of the class Scenario"):
        inspect.unwrap(experiment.Setup.__init__)(object.__new__(experiment.Setup), REFERENCE, 100.0)


@pytest.mark.parametrize("key", [5, jax.random.PRNGKey(5)], ids=["integer", "old kind"])
def test_keys_are_typed(key):
    with pytest.raises(TypeError, match=r"jax.random.key"):
        inspect.unwrap(nj.compare)(SCENARIO, RIGHT, {"right": RIGHT}, num_runs=2, key=key)


def test_a_start_is_a_covariance():
    with pytest.raises(ValueError, match="not positive semi-definite"):
        nj.InitialUncertainty(covariance=np.eye(9) - 0.5)
    with pytest.raises(ValueError, match="symmetric"):
        nj.InitialUncertainty(covariance=np.triu(np.ones((9, 9))))
    with pytest.raises(ValueError, match=r"is \(9, 9\)"):
        nj.InitialUncertainty(covariance=np.eye(6))
    with pytest.raises(ValueError, match="position_sd"):
        nj.InitialUncertainty(-1.0)
    with pytest.raises(ValueError, match="one number or three"):
        nj.InitialUncertainty(velocity_sd=[1.0, 2.0])
    with pytest.raises(ValueError, match="not both"):
        nj.InitialUncertainty(1.0, covariance=np.eye(9))


@pytest.mark.parametrize("option", ["chunk_size", "workers"])
def test_zero_is_no_default(option):
    with pytest.raises(ValueError, match=f"{option} must be an integer of 1 or more"):
        compare(**{option: 0})
