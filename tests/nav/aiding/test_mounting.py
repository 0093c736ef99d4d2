"""Axes of a vehicle beside rotations of another library."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import nav_jax as nj
from nav_jax.aiding.mounting import along_vehicle


def test_axes_are_those_of_a_yaw_and_then_a_pitch():
    draw = np.random.default_rng(1)
    u, (pitch, yaw) = draw.normal(size=(3, 5)), draw.normal(size=(2, 5))
    expected = Rotation.from_euler("ZY", np.stack([yaw, pitch], axis=1)).inv().apply(u.T).T
    np.testing.assert_allclose(along_vehicle(*map(jnp.asarray, (u, pitch, yaw))), expected, rtol=0, atol=1e-14)


def test_states_of_an_odometer():
    assert nj.Odometer(speed=0.1, lever_arm_sd=0.0, mount_sd=0.0).states == ()
    sensor = nj.Odometer(speed=0.1, scale_sd=0.01, lever_arm_sd=(0.0, 0.1, 0.2), mount_sd=(0.0, 0.02))
    assert [(s.name, float(s.sd)) for s in sensor.states] == [
        ("scale", 0.01), ("lever_arm x", 0.0), ("lever_arm y", 0.1), ("lever_arm z", 0.2), ("mount pitch", 0.0),
        ("mount yaw", 0.02),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="mount_sd is one number or two"):
        nj.Odometer(speed=0.1, mount_sd=(0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="lever_arm_sd is one number or 3"):
        nj.Odometer(speed=0.1, lever_arm_sd=(0.1, 0.1))
