"""Analyses, designs and tunings as Datasets and tables."""

import numpy as np
from nav.synthetic_analysis import TIME, make_analysis, make_design, make_tuning

from nav_jax.filter.layout import JUDGED


def test_an_analysis():
    analysis = make_analysis()
    d = analysis.to_xarray()
    assert d["true"].dims == ("filter", "time", "component", "component_2")
    np.testing.assert_array_equal(d["time"], TIME)
    one = analysis["optimist"]
    picked = d["claimed"].sel(filter="optimist", time=20.0, component="velocity_e", component_2="velocity_e")
    assert picked.item() == one.claimed[19, 4, 4]
    assert d["block_unit"].sel(block="attitude").item() == JUDGED.blocks[2].unit == "rad"
    frame = analysis.to_pandas()
    assert frame.loc[("optimist", 20.0, "position"), "rms"] == one.rms("position")[19]
    assert frame.loc[("optimist", 20.0, "position"), "rms_claimed"] == one.rms_claimed("position")[19]


def test_a_design():
    design = make_design()
    frame = design.to_pandas()
    assert frame["loss"].tolist() == [c.loss for c in design.candidates]
    assert frame["best"].sum() == len(design.pareto)
    assert design.to_xarray()["position"].attrs["units"] == "m"
    first = design.candidates[0].covariances[0]
    np.testing.assert_allclose(frame["position"].iloc[0], first.rms("position")[first.epoch()], rtol=1e-12)


def test_a_tuning():
    tuning = make_tuning()
    frame = tuning.to_pandas()
    assert list(frame.index) == list(tuning.names)
    np.testing.assert_array_equal(frame["value"], tuning.value)
    assert frame["remark"].tolist() == list(tuning.remarks)
    assert "per sample" in tuning.to_xarray()["value"].attrs["units"]
