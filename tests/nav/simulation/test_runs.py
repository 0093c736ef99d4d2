"""Runs: what they refuse, what they say of themselves, and that disk gives back what it was given or nothing."""

import json
import shutil
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
import xarray as xr
from nav.synthetic import OUTAGE, make_runs, with_failures

from nav_jax.filter.layout import JUDGED
from nav_jax.simulation.runs import Runs

FORMATS = (".zarr", ".nc")


@pytest.fixture(scope="module")
def runs():
    notes = ("QN of gyro_x has no state: σ² went to WN.", "second")
    return with_failures("right: σ", [3], num_runs=8, notes=notes, num_requested=10)


def assert_same(a, b):
    """Field by field; NaN of failed runs included."""
    for field in fields(Runs):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if field.name == "tracks":
            assert list(x) == list(y)
            for i in x:
                for part in ("time", "position", "velocity", "quaternion", "sensor_errors", "sd"):
                    np.testing.assert_array_equal(getattr(x[i], part), getattr(y[i], part))
                    np.testing.assert_array_equal(getattr(x[i].before, part), getattr(y[i].before, part))
        elif isinstance(x, dict) and field.name in ("nees", "nis", "nis_time", "innovation"):
            assert list(x) == list(y)
            for name in x:
                np.testing.assert_array_equal(x[name], y[name])
        elif isinstance(x, np.ndarray):
            np.testing.assert_array_equal(x, y)
            assert x.dtype == y.dtype
        else:
            assert x == y, field.name


def test_the_synthetic_runs_have_the_covariance_they_state():
    """The builder itself: its NEES is e' P^-1 e, and its sd the diagonal of P."""
    r = make_runs(num_runs=5)
    e, P = r.errors("position"), r.position_covariance
    np.testing.assert_allclose(
        np.einsum("rei,rei->re", e, np.linalg.solve(P, e[..., None])[..., 0]), r.nees["position"]
    )
    np.testing.assert_allclose(np.sqrt(np.diagonal(P, axis1=2, axis2=3)), r.sds("position"))


# -- which runs count -------------------------------------------------------------------------------------------------


def test_only_good_runs_count(runs):
    assert (len(runs), runs.num_good, runs.num_failed, runs.interrupted) == (8, 7, 1, True)
    assert runs.errors("velocity").shape == (7, 101, 3)
    np.testing.assert_array_equal(runs.errors("velocity")[3], runs.error[4, :, 3:6])
    np.testing.assert_array_equal(runs.sds("gyro", np.array([0, 5]))[1], runs.sd[5, :, 12:15])
    text = repr(runs)
    assert "8 runs of 10 (interrupted), 1 failed (the state or" in text
    assert "σ² went to WN" in text
    assert "at 80 s" in text
    rms = np.sqrt(np.mean(np.sum(runs.error[runs.good, 80, :3] ** 2, -1)))
    assert f"{rms:.4g}" in text


def test_where_all_are_good_nothing_is_copied():
    r = make_runs(num_runs=4)
    assert np.shares_memory(r.errors("position"), r.error)
    dataset = r.to_xarray()
    for name in ("error", "sd", "position_covariance"):
        assert np.shares_memory(dataset[name].values, getattr(r, name))


def test_no_good_run_still_has_a_text():
    assert repr(with_failures("none", range(3), num_runs=3)).startswith("none: 3 runs, 3 failed")


def test_an_axis_without_state_is_not_in_the_text():
    text = repr(make_runs(axes=()))
    assert "gyro" not in text
    assert "attitude" in text


@pytest.mark.parametrize(
    ("outages", "gnss", "expected"),
    [
        ({"gnss": ((60.0, 80.0),)}, [59.0, 81.0], 80.0),  # the fix at the end is lost, too, as in R
        ({"gnss": ((60.0, 80.0),)}, [59.0, 80.0], 79.0),  # the fix at the end is used
        ({"gnss": ((10.0, 20.0), (60.0, 80.0))}, [50.0, 81.0], 80.0),
        ({"gnss": ((60.0, 80.0),), "baro": ((5.0, 90.0),)}, [59.0, 81.0], 90.0),
        ({"gnss": ((60.0, 80.5),)}, [59.0, 80.5], 80.0),
        ({"gnss": ((60.0, 100.0),)}, [59.0], 100.0),
        ({"gnss": ((60.0, 400.0),)}, [59.0], 100.0),
        ({}, [1.0, 2.0], 100.0),
        ({"gnss": ()}, [1.0, 2.0], 100.0),
    ],
)
def test_models_are_judged_where_the_last_outage_ends(outages, gnss, expected):
    r = make_runs(num_runs=2, outages=outages, innovation={})
    n = len(gnss)
    nis, times, dof = {"gnss": np.ones((2, n))}, {"gnss": np.array(gnss)}, {"gnss": 3}
    r = replace(r, nis=nis, nis_time=times, nis_dof=dof)
    assert r.time[r.epoch()] == expected


def test_another_epoch_can_be_chosen(runs):
    assert runs.epoch(33.4) == 33
    with pytest.raises(ValueError, match=r"at=101.0 s is outside the runs: 0 .. 100 s"):
        runs.epoch(101.0)


def test_an_epoch_without_nees_is_left_out():
    r = make_runs(num_runs=4)
    r.nees["pose"][:, 0] = np.nan
    r.nees["pose"][2, 7] = np.nan
    assert set(np.flatnonzero(~r.known_epochs("pose"))) == {0, 7}


# -- what is refused --------------------------------------------------------------------------------------------------


def broken(r, name, change):
    array = np.array(getattr(r, name))
    change(array)
    return {name: array}


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda r: {"nees": r.nees | {"pose": r.nees["pose"][:, 1:]}}, "NEES of pose has the shape"),
        (lambda r: {"dof": {"pose": 6}}, "NEES of .* and degrees of freedom of"),
        (lambda r: {"nis_time": r.nis_time | {"gnss": r.nis_time["gnss"][1:]}}, "NIS of gnss has the shape"),
        (lambda r: {"nis_time": {"gnss": r.nis_time["gnss"]}}, "times of .'gnss'., and NIS of"),
        (lambda r: {"innovation": {"gnss": r.innovation["gnss"][..., :2]}}, "innovation of gnss has the shape"),
        (lambda r: broken(r, "time", lambda t: t.__setitem__(5, 3.0)), "do not increase"),
        (lambda r: broken(r, "time", lambda t: t.__setitem__(5, np.nan)), "do not increase"),
        (lambda r: broken(r, "error", lambda e: e.__setitem__((2, 5, 1), np.nan)), "error has NaN or inf in run 2"),
        (lambda r: broken(r, "sd", lambda s: s.__setitem__((1, 5, 1), np.inf)), "sd has NaN or inf in run 1"),
        (lambda r: broken(r, "sd", lambda s: s.__setitem__((1, 5, 1), -1e-9)), "negative standard deviations"),
        (lambda r: {"tracks": {0: r.tracks[0], 1: replace(r.tracks[1], time=r.tracks[1].time + 1)}}, "different times"),
    ],
)
def test_runs_that_do_not_fit_together(change, complaint):
    r = make_runs(num_runs=4)
    with pytest.raises(ValueError, match=complaint):
        replace(r, **change(r))


def test_blocks_have_names(runs):
    with pytest.raises(ValueError, match="'height' is none of the blocks position, velocity"):
        runs.errors("height")


# -- xarray and pandas ------------------------------------------------------------------------------------------------


def test_the_dataset_has_dimensions_and_units(runs):
    d = runs.to_xarray()
    assert d["error"].dims == ("run", "time", "component")
    assert tuple(d["component"].values) == JUDGED.components
    assert d["error"].sel(component="attitude_d").coords["unit"].item() == "rad"
    assert d["time"].attrs["units"] == "s"
    assert d["nis_gnss"].dims == ("run", "time_gnss")
    assert d["nees"].sel(group="pose", run=1, time=50.0).item() == runs.nees["pose"][1, 50]
    assert_same(Runs.from_xarray(d), runs)


def test_pandas_has_a_row_for_each_run_and_epoch(runs):
    frame = runs.to_pandas()
    assert frame.shape == (8 * 101, 30)
    assert frame.loc[(2, 40.0), ("sd", "velocity_e")] == runs.sd[2, 40, 4]
    assert frame.loc[(2, 40.0), ("error", "gyro_z")] == runs.error[2, 40, 14]


# -- disk -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", FORMATS)
def test_disk_gives_back_what_it_was_given(runs, tmp_path, suffix, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "new" / f"r{suffix}"
    assert runs.save(path) == path
    assert_same(Runs.load(path), runs)
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_without_tracks_sensors_and_states(tmp_path):
    bare = {"tracks": {}, "nis": {}, "nis_time": {}, "nis_dof": {}, "innovation": {}, "outages": {}}
    r = make_runs(num_runs=2, axes=(), **bare)
    assert_same(Runs.load(r.save(tmp_path / "bare.nc")), r)


def test_shared_covariances_may_be_views(tmp_path):
    """Of gains that all runs share there is one sd for all: without a copy each."""
    r = make_runs(num_runs=3)
    shared = replace(r, sd=np.broadcast_to(r.sd[:1], r.sd.shape))
    assert_same(Runs.load(shared.save(tmp_path / "r.zarr")), r)


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_other_programs_see(runs, tmp_path, suffix):
    """Time stays a number of seconds, and nothing warns."""
    path = runs.save(tmp_path / f"r{suffix}")
    with xr.open_dataset(path, engine={".zarr": "zarr", ".nc": "h5netcdf"}[suffix]) as seen:
        assert seen["time"].dtype == np.float64
        assert seen["error"].dims == ("run", "time", "component")


def test_xarray_itself_may_write(runs, tmp_path):
    runs.to_xarray().to_zarr(tmp_path / "r.zarr", zarr_format=2)
    runs.to_xarray().to_netcdf(tmp_path / "r.nc", engine="h5netcdf")
    for suffix in FORMATS:
        assert_same(Runs.load(tmp_path / f"r{suffix}"), runs)


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_former_result_is_replaced(runs, tmp_path, suffix):
    path = runs.save(tmp_path / f"r{suffix}")
    smaller = make_runs("other", num_runs=2, axes=())
    smaller.save(path)
    assert_same(Runs.load(path), smaller)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize(("suffix", "writer"), [(".zarr", "to_zarr"), (".nc", "to_netcdf")])
def test_an_interrupted_write_leaves_what_was_there(runs, tmp_path, monkeypatch, suffix, writer):
    path = runs.save(tmp_path / f"r{suffix}")
    real = getattr(xr.Dataset, writer)

    def half(self, target, **options):
        real(self, target, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(xr.Dataset, writer, half)
    with pytest.raises(KeyboardInterrupt):
        make_runs("other", num_runs=2).save(path)
    assert_same(Runs.load(path), runs)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_nothing_else_is_overwritten(runs, tmp_path):
    folder = tmp_path / "thesis.zarr"
    folder.mkdir()
    (folder / "chapter1.tex").write_text("words")
    with pytest.raises(FileExistsError, match="it stays"):
        runs.save(folder)
    with pytest.raises(FileExistsError, match="it stays"):
        runs.save(folder.rename(tmp_path / "thesis.nc"))
    assert (tmp_path / "thesis.nc" / "chapter1.tex").read_text() == "words"


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file(runs, tmp_path, share):
    path = runs.save(tmp_path / "r.nc")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ValueError, match=r"r\.nc (cannot be read|is corrupt|is not whole)"):
        Runs.load(path)


def test_a_flipped_bit_in_a_file(runs, tmp_path):
    path = runs.save(tmp_path / "r.nc")
    whole = path.read_bytes()
    at = whole.find(runs.error[5, 50:52].tobytes())
    assert at > 0
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with pytest.raises(ValueError, match="corrupt: error is not what was written"):
        Runs.load(path)


@pytest.mark.parametrize("name", ["error", "nees", "time", "nis_gnss", "track_position", "notes"])
def test_a_folder_with_a_missing_chunk(runs, tmp_path, name):
    """Zarr reads it as NaN or zero without a word."""
    path = runs.save(tmp_path / "r.zarr")
    next(p for p in (path / name).iterdir() if not p.name.startswith(".")).unlink()
    with pytest.raises(ValueError, match=f"(corrupt: {name} is not what was written|cannot be read)"):
        Runs.load(path)


def test_a_folder_with_a_missing_array(runs, tmp_path):
    path = runs.save(tmp_path / "r.zarr")
    shutil.rmtree(path / "nees")
    metadata = json.loads((path / ".zmetadata").read_text())
    for key in [k for k in metadata["metadata"] if k.startswith("nees/")]:
        del metadata["metadata"][key]
    (path / ".zmetadata").write_text(json.dumps(metadata))
    with pytest.raises(ValueError, match="not whole: nees is missing"):
        Runs.load(path)


def test_a_folder_whose_chunk_is_rubbish(runs, tmp_path):
    path = runs.save(tmp_path / "r.zarr")
    chunk = next(p for p in (path / "error").iterdir() if not p.name.startswith("."))
    chunk.write_bytes(b"rubbish" + chunk.read_bytes()[7:])
    with pytest.raises(ValueError, match=r"r\.zarr"):
        Runs.load(path)


@pytest.mark.parametrize(
    ("make", "error", "complaint"),
    [
        (lambda p: p / "none.nc", FileNotFoundError, "There is no"),
        (lambda p: p / "runs.csv", ValueError, r"Results are \.npz, \.json or \.nc files"),
        (lambda p: text(p / "text.nc"), ValueError, "cannot be read as h5netcdf"),
        (lambda p: (p / "empty.zarr").mkdir() or p / "empty.zarr", ValueError, "cannot be read as zarr"),
        (lambda p: foreign(p / "foreign.nc"), ValueError, "was not saved by gmwm_jax or nav_jax. It has temperature"),
        (lambda p: foreign(p / "f.nc", kind="nav_jax comparison"), ValueError, "is not one that Comparison"),
        (lambda p: foreign(p / "f.nc", kind="nav_jax runs"), ValueError, "is not one that to_xarray made"),
        (lambda p: foreign(p / "f.nc", kind="nav_jax runs", format=99), ValueError, "by a newer version"),
    ],
)
def test_something_else(tmp_path, make, error, complaint):
    with pytest.raises(error, match=complaint):
        Runs.load(make(tmp_path))


def text(path):
    path.write_text("time,position\n0,1\n")
    return path


def foreign(path, **attributes):
    xr.Dataset({"temperature": ("x", np.arange(3.0))}, attrs=attributes).to_netcdf(path, engine="h5netcdf")
    return path


@pytest.mark.parametrize(("missing", "suffix"), [("xarray", ".nc"), ("zarr", ".zarr"), ("h5py", ".nc")])
def test_a_missing_package_is_named(runs, tmp_path, monkeypatch, missing, suffix):
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ImportError, match=rf'needs the package {missing}: pip install "gmwm-jax\[io\]"'):
        runs.save(tmp_path / f"r{suffix}")
    assert not list(tmp_path.iterdir())


def test_the_outage_of_the_builder(runs):
    assert runs.outage_intervals == (OUTAGE,)
