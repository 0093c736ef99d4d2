"""Trajectories from every format and back; units and frames are stated, never guessed."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pymap3d
import pytest
import rdata
import xarray as xr
from nav.cases import angle_between

from nav_jax.trajectory import motions
from nav_jax.trajectory.files import read_trajectory, save_trajectory, to_geodetic

REF = motions.helix(5.0, 20.0, name="helix")
TABLE = np.column_stack([REF.time, REF.position, REF.euler])
NAMES = ["time", "north", "east", "down", "roll", "pitch", "yaw"]
FULL = np.column_stack([TABLE, REF.velocity])
STATED = {"position": "ned", "angles": "rad"}


def assert_same(found, *, velocity=1e-3):
    np.testing.assert_allclose(found.time, REF.time, atol=1e-9)
    np.testing.assert_allclose(found.position, REF.position, atol=1e-11)
    np.testing.assert_allclose(found.velocity, REF.velocity, atol=velocity)
    assert angle_between(found, REF) < 1e-13


def columns(table=TABLE, names=NAMES):
    return dict(zip(names, table.T, strict=True))


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".NPZ"])
def test_saved_trajectories_come_back(tmp_path, suffix, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = save_trajectory(REF, tmp_path / "folder" / f"a{suffix}")
    found = read_trajectory(path)
    assert_same(found, velocity=0)
    assert found.name == "a"
    assert read_trajectory(path, name="b").name == "b"


def test_arrays_in_the_stated_order():
    assert_same(read_trajectory(TABLE, **STATED))
    assert_same(read_trajectory(FULL, **STATED), velocity=0)
    turned = FULL[:, ::-1]
    assert_same(read_trajectory(turned, columns=range(9, -1, -1), **STATED), velocity=0)


def test_text_files(tmp_path):
    path = tmp_path / "walk.txt"
    degrees = TABLE * [1, 1, 1, 1, *[180 / np.pi] * 3]
    np.savetxt(path, degrees, header="a comment")
    found = read_trajectory(path, position="ned", angles="deg")
    assert_same(found)
    assert found.name == "walk"
    np.savetxt(path, degrees, delimiter=";", header="t;X_N;x_E;x_D;Roll [deg];pitch_deg;Heading (deg)", comments="")
    assert_same(read_trajectory(path))
    names = "t,n,e,d,phi,theta,psi"
    np.savetxt(tmp_path / "b.csv", degrees * [1e3, 1, 1, 1, 1, 1, 1], delimiter=",", header=names, comments="")
    picked = {"roll": "phi", "pitch": "theta", "yaw": 6}
    assert_same(read_trajectory(tmp_path / "b.csv", columns=picked, angles="deg", time_unit="ms"))


def test_tables_of_other_libraries(tmp_path):
    assert_same(read_trajectory(columns(), angles="rad"))
    frame = pd.DataFrame(columns(names=[*NAMES[:4], "roll_rad", "pitch_rad", "yaw_rad"]))
    assert_same(read_trajectory(frame))
    pq.write_table(pa.table(columns()), tmp_path / "a.parquet")
    assert_same(read_trajectory(tmp_path / "a.parquet", angles="rad"))
    angles = {name: ("time", np.degrees(x), {"units": "degrees"}) for name, x in list(columns().items())[4:]}
    moved = {name: ("time", x, {"units": "m"}) for name, x in list(columns().items())[1:4]}
    dataset = xr.Dataset(moved | angles, coords={"time": ("time", REF.time, {"units": "seconds"})})
    assert_same(read_trajectory(dataset))
    dataset.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    assert_same(read_trajectory(tmp_path / "a.nc"))
    stamps = np.datetime64("2026-11-21T12:00:00", "ns") + (REF.time * 1e9).round().astype("timedelta64[ns]")
    assert_same(read_trajectory(dataset.assign_coords(time=stamps)))


def test_published_trajectories(shared):
    """R's object, its copy as an archive, and the same flight in geodetic coordinates about R's origin."""
    from_r = read_trajectory(shared / "data" / "example_1_traj_ned.RData", **STATED)
    ned = read_trajectory(shared / "data" / "trajectory_example_1_ned.npz")
    np.testing.assert_array_equal(from_r.position, ned.position)
    np.testing.assert_array_equal(from_r.quaternion, ned.quaternion)
    assert ned.rate == pytest.approx(100.0, rel=1e-3)
    path = shared / "data" / "trajectory_example_1_ellipsoidal.npz"
    origin = (0.812783541, 0.114163411, 517.891)
    geodetic = read_trajectory(path, origin=origin)
    np.testing.assert_allclose(geodetic.position, ned.position, atol=5e-3)  # the origin is known to 1e-9 rad
    turn = angle_between(geodetic, ned)
    assert 1e-6 < turn < 1e-4  # the vertical 300 m away is another
    np.testing.assert_allclose(read_trajectory(path).position[0], 0.0, atol=1e-8)


def test_an_object_of_the_r_package_states_its_frame(tmp_path):
    table = pd.DataFrame(columns(names=["time", "x_N", "x_E", "x_D", "roll", "pitch", "yaw"]))
    rdata.write_rda(tmp_path / "a.RData", {"traj": {"trajectory": table, "system": "ned"}, "other": 1.0})
    assert_same(read_trajectory(tmp_path / "a.RData", variable="traj"))
    with pytest.raises(ValueError, match="is needed to choose one"):
        read_trajectory(tmp_path / "a.RData")
    with pytest.raises(ValueError, match="the file says 'ned'"):
        read_trajectory(tmp_path / "a.RData", variable="traj", position="geodetic")


def test_geodetic_positions_velocities_and_attitudes():
    """A level flight to the east along a parallel, against pymap3d."""
    lat, height, time = 0.8, 500.0, np.arange(101) / 10.0
    lon = 0.1 + 1e-5 * time
    radius = np.hypot(*pymap3d.geodetic2ecef(lat, 0.0, height, deg=False)[:2])
    velocity = [[0.0, 1e-5 * radius, 0.0]] * 101
    zero = np.zeros(101)
    table = np.column_stack([time, zero + lat, lon, zero + height, zero, zero, zero + np.pi / 2, velocity])
    found = read_trajectory(table, position="geodetic", angles="rad")
    expected = np.stack(pymap3d.geodetic2ned(lat, lon, height, lat, 0.1, height, deg=False), axis=1)
    np.testing.assert_allclose(found.position, expected, atol=1e-8)
    rate = np.gradient(found.position, time, axis=0)[1:-1]
    np.testing.assert_allclose(found.velocity[1:-1], rate, atol=1e-6)
    nose = np.stack([np.cos(found.euler[:, 2]), np.sin(found.euler[:, 2])], axis=1)
    np.testing.assert_allclose(nose, found.velocity[:, :2] / (1e-5 * radius), atol=1e-8)
    assert abs(found.euler[-1, 2] - np.pi / 2) > 1e-5  # the meridians converge
    back = to_geodetic(found, (lat, 0.1, height))
    np.testing.assert_allclose(back, table[:, 1:4], atol=1e-8)


def test_two_units_of_angles():
    degrees = TABLE.copy()
    degrees[:, 1:4] = [45.0, 7.0, 100.0] + 1e-5 * np.arange(101)[:, None]
    kinds = {"position": "deg", "attitude": "rad"}
    found = read_trajectory(degrees, position="geodetic", angles=kinds)
    assert found.duration == 5.0
    assert 100 < np.linalg.norm(found.position[-1]) < 200


def write(path, text):
    path.write_text(text)
    return path


ROW = "0,0,0,0,0,0,0\n1,1,0,0,0,0,0\n"


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda d: read_trajectory(TABLE, angles="rad"), "kind of position is not stated"),
        (lambda d: read_trajectory(TABLE, position="ned"), "unit of roll is not stated"),
        (lambda d: read_trajectory(TABLE, position="NED", angles="rad"), 'position is "ned"'),
        (lambda d: read_trajectory(TABLE, position="ned", angles="grad"), 'angles is "rad"'),
        (lambda d: read_trajectory(TABLE, position="ned", angles={"roll": "rad"}), "has the keys"),
        (lambda d: read_trajectory(TABLE[:, :6], **STATED), "7 or 10, and there are 6"),
        (lambda d: read_trajectory(TABLE[:, 0], **STATED), "table of numbers"),
        (lambda d: read_trajectory(TABLE[:1], **STATED), "1 epochs"),
        (lambda d: read_trajectory(TABLE[:0], **STATED), "0 epochs"),
        (lambda d: read_trajectory(TABLE[::-1], **STATED), "does not increase"),
        (lambda d: read_trajectory(TABLE * np.nan, **STATED), "column of time holds 101 values that are NaN"),
        (lambda d: read_trajectory(TABLE * 1000, **STATED), "no angle in rad but one in deg"),
        (lambda d: read_trajectory(TABLE, origin=(0, 0, 0), **STATED), "origin belongs to geodetic"),
        (lambda d: read_trajectory(TABLE + 45, position="geodetic", angles="rad"), "in deg"),
        (lambda d: read_trajectory(TABLE, time_unit="day", **STATED), "Unknown unit of time"),
        (lambda d: read_trajectory(TABLE, columns=[0, 1, 2, 3, 4, 5, 9], **STATED), "no column 9"),
        (lambda d: read_trajectory(columns(), columns={"yaw": "psi"}, angles="rad"), "no column 'psi'"),
        (lambda d: read_trajectory(columns(), columns={"Yaw": "yaw"}, angles="rad"), "the quantities are"),
        (lambda d: read_trajectory(columns(TABLE[:, :6], NAMES[:6]), angles="rad"), "No column is found for yaw"),
        (lambda d: read_trajectory(columns() | {"heading": REF.time}, angles="rad"), "Both 'yaw' and 'heading'"),
        (lambda d: read_trajectory(columns() | {"roll": REF.time[1:]}, angles="rad"), "one length"),
        (lambda d: read_trajectory(columns(names=[*NAMES[:6], "yaw_deg"]), angles="rad"), "yaw is in rad"),
        (lambda d: read_trajectory({"name": np.array("x")}, angles="rad"), "no column among name"),
        (lambda d: read_trajectory(write(d / "a.csv", ""), **STATED), r"a\.csv: .* no line of data"),
        (lambda d: read_trajectory(write(d / "a.csv", ROW + "2,3\n"), **STATED), "Line 3 has 2 fields"),
        (
            lambda d: read_trajectory(write(d / "a.csv", ROW + "2,x,0,0,0,0,0\n"), **STATED),
            "Line 3, column 1 holds the text 'x'",
        ),
        (
            lambda d: read_trajectory(write(d / "a.csv", "2;1,5;0;0;0;0;0\n0.5;1"), **STATED),
            "decimal commas",
        ),
        (lambda d: read_trajectory(write(d / "a.csv", "t,n,e\n")), "no data"),
        (lambda d: read_trajectory(write(d / "a.npz", "text")), "no NumPy file"),
        (lambda d: read_trajectory(write(d / "a.RData", "text")), "no R data file"),
        (lambda d: read_trajectory(write(d / "a.parquet", "text")), "no Parquet file"),
        (lambda d: read_trajectory(write(d / "a.nc", "text")), "no netCDF file"),
        (lambda d: read_trajectory(write(d / "a.xls", "1 2")), "Unknown suffix"),
        (lambda d: save_trajectory(REF, d / "a.mat"), r"saved as \.npz, \.csv, \.kml, \.gpx"),
        (lambda d: to_geodetic(REF, (45.0, 7.0, 0.0)), "in rad"),
    ],
)
def test_refusals(tmp_path, call, complaint):
    with pytest.raises(ValueError, match=complaint):
        call(tmp_path)


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="no file"):
        read_trajectory(tmp_path / "a.csv")


def test_columns_of_text_and_lines_of_units_are_left_out(tmp_path):
    rows = "".join(",".join(map(str, row)) + f",{'ok' if i else ''}\n" for i, row in enumerate(TABLE))
    named = write(tmp_path / "a.csv", ",".join([*NAMES, "status"]) + "\n" + rows)
    assert_same(read_trajectory(named, angles="rad"))
    units = write(tmp_path / "b.csv", ",".join([*NAMES, "status"]) + "\ns,m,m,m,rad,rad,rad,\n" + rows)
    assert_same(read_trajectory(units, angles="rad", header=2, columns=NAMES))
