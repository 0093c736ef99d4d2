"""Results as Datasets and tables: named axes, units, and the numbers that the results themselves have."""

import sys

import jax
import numpy as np
import pytest

import gmwm_jax as gj
from gmwm_jax._internal.channels import Channels


def record(num_samples, seed, channels=("accel_x",)):
    return gj.datasets.simulated("mti-g", num_samples, key=jax.random.key(seed), channels=list(channels))


@pytest.fixture(scope="module")
def several():
    return gj.wavelet_variance(record(2000, 2, ("accel_x", "gyro_y")))


@pytest.fixture(scope="module")
def fits(several):
    return gj.fit(several, "WN + RW")


def test_a_wavelet_variance(several):
    d = several.to_xarray()
    assert dict(d.sizes) == {"scale": 9, "channel": 2}
    assert d["variance"].sel(channel="gyro_y", scale=8.0).item() == several["gyro_y"].variance[2]
    assert d["unit"].sel(channel="gyro_y").item() == "rad/s"
    assert d["time"].attrs["units"] == "s"
    one = several["accel_x"].to_xarray()
    assert one["ci_low"].attrs["units"] == "(m/s^2)^2"
    assert one.attrs["rate"] == 100.0
    frame = several.to_pandas()
    assert frame.loc[(8.0, "gyro_y"), "ci_high"] == several["gyro_y"].ci_high[2]
    assert several["accel_x"].to_pandas()["variance"].tolist() == several["accel_x"].variance.tolist()


def test_a_fit(fits):
    fit = fits["accel_x"]
    d = fit.to_xarray()
    np.testing.assert_array_equal(d["fitted"] + d["residual"], fit.wv.variance)
    np.testing.assert_array_equal(d["component_variance"].sel(component="RW"), fit.decomposition()["RW"])
    assert d["estimate"].sel(parameter="WN sigma2").item() == fit.parameters()["WN", "sigma2"].value
    assert d["parameter_unit"].values.tolist() == ["(m/s^2)^2", "(m/s^2)^2"]
    assert (d["objective"].item(), d["status"].item()) == (fit.objective, "converged")
    frame = fit.to_pandas()
    assert frame["form"].tolist() == ["per sample"] * 2 + ["continuous"] * 2 + ["datasheet"] * 2
    assert frame["value"].tolist() == [
        e.value for t in (fit.parameters(), fit.continuous(), fit.datasheet()) for e in t
    ]
    assert frame["ci_low"].dtype == float


def test_fits_of_channels(fits):
    d = fits.to_xarray()
    assert d["channel"].values.tolist() == ["accel_x", "gyro_y"]
    assert d["unit"].values.tolist() == ["m/s^2", "rad/s"]
    assert d["variance"].attrs["units"] == "of the channel: see the coordinate unit"
    for name, fit in fits.items():
        np.testing.assert_array_equal(d["fitted"].sel(channel=name), fit.fitted)
        assert d["objective"].sel(channel=name).item() == fit.objective
    frame = fits.to_pandas()
    assert frame.loc["gyro_y"]["value"].tolist() == fits["gyro_y"].to_pandas()["value"].tolist()
    assert frame.index.names[0] == "channel"


def test_a_selection(fits):
    selection = gj.select(fits["accel_x"].wv, "WN + QN + RW")
    d = selection.to_xarray()
    for name, candidate in selection.items():
        row = d.sel(model=name)
        assert row["criterion"].item() == candidate.criterion
        assert row["recommended"].item() == (candidate is selection.recommended)
        np.testing.assert_array_equal(row["fitted"], candidate.fit.fitted)
    frame = selection.to_pandas()
    assert list(frame.index) == list(selection)
    assert frame["recommended"].sum() == 1


def test_a_bootstrap(fits):
    boot = gj.bootstrap(fits["accel_x"], 20, key=jax.random.key(0))
    d = boot.to_xarray()
    np.testing.assert_array_equal(d["value"].sel(parameter="WN sigma2"), boot.values[:, 0])
    np.testing.assert_array_equal(d["variance"].sel(scale=4.0), boot.variances[:, 1])
    frame = boot.to_pandas()
    assert frame.columns.tolist() == ["objective", "converged", "WN sigma2", "RW gamma2"]
    np.testing.assert_array_equal(frame["RW gamma2"], boot.values[:, 1])


def test_a_joint_fit():
    joint = gj.fit_records([gj.wavelet_variance(record(n, n)) for n in (1000, 2000)], "WN + RW")
    d = joint.to_xarray()
    assert d["objective"].item() == joint.objective
    assert d["record_objective"].values.tolist() == [r.objective for r in joint.records]
    assert np.isnan(d["record_variance"].sel(record="1", scale=512.0).item())
    assert d["record_variance"].sel(record="1", scale=2.0).item() == joint.records[0].wv.variance[0]
    assert joint.to_pandas().equals(joint.fit.to_pandas())


def test_what_has_no_table(fits):
    class Plain:
        @classmethod
        def table_of(cls, results):
            return ""

    for given, complaint in ((Channels({"x": Plain()}), "Plain has no table"), (Channels({}), "Nothing has no table")):
        for act in (given.to_xarray, given.to_pandas):
            with pytest.raises(TypeError, match=complaint):
                act()


@pytest.mark.parametrize(("missing", "kind"), [("xarray", "several"), ("pandas", "several"), ("pandas", "fits")])
def test_a_missing_package_is_named(request, monkeypatch, missing, kind):
    result = request.getfixturevalue(kind)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ImportError, match=rf'needs the package {missing}: pip install "gmwm-jax\[io\]"'):
        result.to_pandas()
