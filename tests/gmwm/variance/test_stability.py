"""Modified Allan and Hadamard deviations against allantools, and as results."""

import allantools
import numpy as np
import pytest
from helpers import assert_same_result
from programs import MEDIUM, white

import gmwm_jax as gj
from gmwm_jax.variance import hadamard_deviation, modified_allan_deviation

KINDS = {
    "modified Allan": (modified_allan_deviation, allantools.mdev),
    "Hadamard": (hadamard_deviation, allantools.ohdev),
}


@pytest.fixture(scope="module")
def record():
    data = np.stack([white(MEDIUM), np.cumsum(white(MEDIUM, seed=1)) * 0.01 + white(MEDIUM, seed=2)], axis=1)
    return gj.Recording.from_array(data + 5.0, rate=50.0, units="rad/s", channels=("gyro_x", "gyro_y"), name="unit 3")


@pytest.mark.parametrize("kind", KINDS)
def test_equals_allantools(record, kind):
    ours, theirs = KINDS[kind]
    found = ours(record)
    for i in range(2):
        taus, expected, _, _ = theirs(record.data[:, i], rate=50.0, data_type="freq", taus=found.times)
        np.testing.assert_allclose(found.times, taus)
        np.testing.assert_allclose(found.deviation[:, i], expected, rtol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_one_channel_of_several(record, kind, tmp_path):
    several = KINDS[kind][0](record, level=0.9)
    assert several.kind == kind
    one = several["gyro_y"]
    alone = KINDS[kind][0](record["gyro_y"], level=0.9)
    assert_same_result(one, alone)
    assert_same_result(gj.load(several.save(tmp_path / "d.npz")), several)
    assert repr(one).startswith(f"Overlapping {kind} deviation at 50 Hz\nT [s]  gyro_y [rad/s]  90 % low")
    assert "intervals at their nominal level" in repr(one)
    assert "gyro_x [rad/s]" in repr(several)
    with pytest.raises(KeyError, match="No channel 'gyro_z'; there are gyro_x, gyro_y"):
        several["gyro_z"]


def test_a_drift_is_not_in_a_hadamard_deviation(record):
    x = record.data[:, 0]
    drifting = x + 1e-3 * np.arange(len(x))
    still, moved = (hadamard_deviation(v, rate=50.0).deviation for v in (x, drifting))
    np.testing.assert_allclose(moved, still, rtol=1e-6)


def test_is_drawn(record, rendered_figures):
    found = modified_allan_deviation(record)
    (ax,) = found.plot().axes
    assert ax.get_ylabel() == "modified Allan deviation [rad/s]"
    assert ax.get_title() == "unit 3, gyro_x, gyro_y"
    assert ax.get_legend().get_title().get_text() == "band: 95 % interval, local power law"
    assert found["gyro_x"].plot().axes[0].get_title() == "unit 3, gyro_x"


def test_what_is_no_record_is_refused():
    with pytest.raises(ValueError, match="The sampling rate is missing"):
        hadamard_deviation(white(100))
    with pytest.raises(ValueError, match="at least 8 samples"):
        hadamard_deviation(white(7), rate=1.0)
    with pytest.raises(ValueError, match="does not change"):
        modified_allan_deviation(np.ones(100), rate=1.0)
    with pytest.raises(ValueError, match="real numbers in the shape"):
        modified_allan_deviation(np.ones((3, 3, 3)), rate=1.0)
    gap = white(100)
    gap[3] = np.nan
    with pytest.raises(ValueError, match="index 3"):
        modified_allan_deviation(gap, rate=1.0)
