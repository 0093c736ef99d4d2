"""A tuning comes back from a file as it was."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from helpers import arrays_of, assert_same_result
from nav.synthetic_analysis import make_tuning

import nav_jax as nj
from gmwm_jax._internal.state_files import Content, write_state
from gmwm_jax._internal.states import State, to_state
from nav_jax.filter.parameters import AidingLines, ErrorLines


def tuned():
    """As `tune` makes it: built from numbers of JAX, and with correlated sensors that are believed otherwise."""
    given = make_tuning()
    lines = ErrorLines(given.errors)
    sensors = (*given.aiding, nj.GnssPosition(covariance=np.diag([1.0, 2.0, 3.0]) + 0.1, name="other"))
    aiding = AidingLines(sensors)
    believed = aiding.believe(0.1 * jnp.arange(1.0, len(aiding.names) + 1))
    return replace(given, errors=lines.build(lines.start + 0.1), aiding=believed)


@pytest.mark.parametrize("suffix", [".npz", ".json", ".nc", ".zarr"])
@pytest.mark.parametrize("make", [make_tuning, tuned])
def test_a_tuning_comes_back_as_it_was(tmp_path, make, suffix):
    given = make()
    found = nj.load(given.save(tmp_path / f"x{suffix}"))
    assert_same_result(found, given)
    assert found.table() == given.table()
    for a, b in zip(*(arrays_of(nj.plotting.tuning_data(t)) for t in (found, given)), strict=True):
        np.testing.assert_array_equal(a, b)


def test_names_are_those_of_the_values(tmp_path):
    state = to_state(make_tuning())
    path = write_state(tmp_path / "x.npz", Content("nav_jax.Tuning", State({**state.tree, "names": []}, state.arrays)))
    with pytest.raises(ValueError, match="It has 0 names and 4 values"):
        nj.load(path)
