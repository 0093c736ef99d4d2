"""A comparison comes back from a file with its table, its ranking and its figures."""

import numpy as np
import pytest
from helpers import arrays_of, assert_same_result
from nav.synthetic import make_runs, with_failures

import nav_jax as nj
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.runs import Runs

FORMATS = (".nc", ".zarr", ".npz", ".json")


@pytest.fixture(scope="module")
def comparison():
    models = [make_runs("right", 20), make_runs("poor", 20, inflation=2.0), with_failures("worse", [3], num_runs=20)]
    reference = nj.motions.lemniscate(duration=100.0, rate=1.0)
    return Comparison(reference, {runs.name: runs for runs in models}, "a model")


@pytest.mark.parametrize("suffix", FORMATS)
def test_one_function_reads_them_all(comparison, tmp_path, suffix):
    found = nj.load(comparison.save(tmp_path / f"runs{suffix}"))
    assert_same_result(found, comparison)
    assert repr(found.table()) == repr(comparison.table())
    runs = comparison["worse"]
    assert_same_result(nj.load(runs.save(tmp_path / f"runs{suffix}")), runs)


@pytest.mark.parametrize("figure", ["comparison_data", "consistency_data", "mean_errors_data", "nis_data"])
def test_it_is_drawn_as_before(comparison, tmp_path, figure):
    found = nj.load(comparison.save(tmp_path / "runs.nc"))
    data = getattr(nj.plotting, figure)
    shown = arrays_of(data(found))
    assert shown
    for a, b in zip(shown, arrays_of(data(comparison)), strict=True):
        np.testing.assert_array_equal(a, b)
    assert found.plot().get_axes()


@pytest.mark.parametrize("suffix", FORMATS)
def test_runs_and_comparisons_are_told_apart(comparison, tmp_path, suffix):
    path = comparison.save(tmp_path / f"c{suffix}")
    with pytest.raises(ValueError, match=rf"c\{suffix} holds a Comparison, and a Runs is wanted"):
        Runs.load(path)
    assert isinstance(Comparison.load(path), Comparison)


def test_another_ending_is_refused(comparison, tmp_path):
    with pytest.raises(ValueError, match=r"Results are \.npz, \.json or \.nc files or \.zarr folders"):
        comparison.save(tmp_path / "runs.csv")
