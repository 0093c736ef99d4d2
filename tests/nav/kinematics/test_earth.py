"""Gravity of a flat Earth."""

import jax.numpy as jnp
import numpy as np
import pytest

from nav_jax.kinematics.earth import FlatEarth


def test_gravity_is_down_everywhere():
    flat = FlatEarth(9.8056)
    np.testing.assert_array_equal(flat.gravity_n(jnp.ones((3, 2))), [[0, 0], [0, 0], [9.8056, 9.8056]])
    np.testing.assert_array_equal(flat.gravity_n(jnp.ones(3)), [0, 0, 9.8056])
    assert float(FlatEarth().gravity) == 9.80665


@pytest.mark.parametrize("gravity", [-1.0, np.nan, np.inf])
def test_gravity_that_is_none(gravity):
    with pytest.raises(ValueError, match="gravity must be non-negative"):
        FlatEarth(gravity)
