"""Files: the same samples come back from every format, and every refusal names its cause."""

import gzip
import math
import sys

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import rdata

from gmwm_jax.recordings.files import read_recording, save_recording
from gmwm_jax.recordings.recording import Recording

DEG = math.pi / 180
X = np.random.default_rng(5).normal(size=(40, 3))
T = np.arange(40) / 50.0
STATED = {"rate": 50.0, "units": "rad/s"}


@pytest.fixture
def write(tmp_path):
    def write(text, name="record.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_bytes(text.encode(encoding))
        return path

    return write


def lines(separator, data=X, end="\n"):
    return "".join(separator.join(f"{v:.17g}" for v in row) + end for row in data)


# NumPy


def test_npy(tmp_path):
    np.save(tmp_path / "a.npy", X)
    rec = read_recording(tmp_path / "a.npy", **STATED)
    np.testing.assert_array_equal(rec.data, X)
    assert (rec.name, rec.rate, rec.units) == ("a", 50.0, ("rad/s",) * 3)
    (tmp_path / "a.npy").rename(tmp_path / "a.NPY")
    rec = read_recording(str(tmp_path / "a.NPY"), **STATED, names=["x", "y", "z"], name="n")
    assert (rec.channels, rec.name) == (("x", "y", "z"), "n")


def test_npy_vector_columns_and_time(tmp_path):
    np.save(tmp_path / "v.npy", X[:, 0])
    np.testing.assert_array_equal(read_recording(tmp_path / "v.npy", **STATED).data, X[:, :1])
    np.save(tmp_path / "t.npy", np.column_stack([X[:, 0], T, X[:, 1:]]))
    rec = read_recording(tmp_path / "t.npy", units="deg/s", time=1)
    np.testing.assert_allclose(rec.data, X * DEG, rtol=1e-15)
    assert rec.rate == pytest.approx(50.0, rel=1e-12, abs=0)
    rec = read_recording(tmp_path / "t.npy", units="1", time=1, columns=[3, 0])
    np.testing.assert_array_equal(rec.data, X[:, [2, 0]])


def test_npz_needs_to_know_which_variable(tmp_path):
    np.savez(tmp_path / "one.npz", x=X)
    np.testing.assert_array_equal(read_recording(tmp_path / "one.npz", **STATED).data, X)
    np.savez(tmp_path / "two.npz", x=X, y=-X)
    np.testing.assert_array_equal(read_recording(tmp_path / "two.npz", **STATED, variable="y").data, -X)
    with pytest.raises(ValueError, match=r"2 variables \(x, y\); variable=... is needed"):
        read_recording(tmp_path / "two.npz", **STATED)
    with pytest.raises(ValueError, match=r"\(x, y\); there is no variable 'z'"):
        read_recording(tmp_path / "two.npz", **STATED, variable="z")


def test_bad_numpy_files(tmp_path):
    np.save(tmp_path / "a.npy", X)
    np.savez(tmp_path / "a.npz", x=X)
    for name in ("a.npy", "a.npz"):
        path = tmp_path / name
        path.write_bytes(path.read_bytes()[:-200])
        with pytest.raises(ValueError, match=f"{name}: .*truncated or corrupt"):
            read_recording(path, **STATED)
    np.save(tmp_path / "o.npy", np.array([{}, 1.0]), allow_pickle=True)
    with pytest.raises(ValueError, match="no NumPy file"):
        read_recording(tmp_path / "o.npy", **STATED)
    np.save(tmp_path / "cube.npy", np.zeros((4, 3, 2)))
    with pytest.raises(ValueError, match=r"\(4, 3, 2\)"):
        read_recording(tmp_path / "cube.npy", **STATED)
    np.save(tmp_path / "text.npy", np.array(["a", "b"]))
    with pytest.raises(ValueError, match=r"Column '0' holds .*not numbers"):
        read_recording(tmp_path / "text.npy", **STATED)


# Saving


@pytest.fixture
def saved():
    units = {"gyro": "deg/s", "Accel X": "g"}
    return Recording.from_array(X, rate=50.0, units=units, channels=["gyro_x", "gyro_y", "Accel X"], name="bench 7")


def test_saved_recordings_come_back_as_they_were(tmp_path, saved):
    path = save_recording(saved, tmp_path / "r.npz")
    back = read_recording(path)
    np.testing.assert_array_equal(back.data, saved.data)
    assert (back.rate, back.channels, back.units, back.name) == (saved.rate, saved.channels, saved.units, saved.name)
    part = read_recording(path, columns=["Accel X", "gyro_x"], name="other")
    np.testing.assert_array_equal(part.data, saved.data[:, [2, 0]])
    assert (part.units, part.name) == (("m/s^2", "rad/s"), "other")


def test_what_a_saved_file_states_is_not_overridden(tmp_path, saved):
    path = save_recording(saved, tmp_path / "r.npz")
    with pytest.raises(
        ValueError, match=r"units=... says that gyro_x is in deg/s, and the file says rad/s: leave it out"
    ):
        read_recording(path, units="deg/s")
    with pytest.raises(ValueError, match=r"Wrong rate .*: rate= says 100 Hz, and the file 50 Hz"):
        read_recording(path, rate=100.0)


def test_saving_is_atomic(tmp_path, saved, monkeypatch):
    path = save_recording(saved, tmp_path / "r.npz")
    with path.open("rb") as reader:  # who reads the old file meanwhile is not disturbed
        save_recording(saved["gyro"], path)
        assert len(reader.read()) > len(path.read_bytes())
    before = path.read_bytes()

    def full_disk(stream, **arrays):
        stream.write(b"half")
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez", full_disk)
    with pytest.raises(OSError, match="no space left"):
        save_recording(saved["gyro"], path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["r.npz"]


def test_only_npz_is_saved(tmp_path, saved):
    with pytest.raises(ValueError, match=r"saved as .npz.*r\.csv"):
        save_recording(saved, tmp_path / "r.csv")


# Text


def test_a_tab_from_the_shell_and_what_is_no_delimiter(write):
    file = write("a\tb\n1\t2\n3\t5\n6\t4\n")
    assert read_recording(file, rate=1.0, units="1", delimiter="\\t").channels == ("a", "b")
    with pytest.raises(ValueError, match="A delimiter is one character, and ', ' is not"):
        read_recording(file, rate=1.0, units="1", delimiter=", ")


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(FileNotFoundError, match="is a folder, not a file"):
        read_recording(tmp_path, rate=1.0, units="1")


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", "   ", ", ", " ; "])
@pytest.mark.parametrize(
    "head",
    [
        "",
        "Gyro.X{s}Gyro.Y{s}Gyro.Z\n",
        '"Gyro-X"{s}"Gyro-Y"{s}"Gyro-Z"\n',
        "# static, 20 degrees\n\n#gyro_x{s}gyro_y{s}gyro_z\n",
        "% 1 of 6\n% GYRO_X{s}GYRO_Y{s}GYRO_Z\n",
    ],
)
def test_text_separators_and_names(write, separator, head):
    rec = read_recording(write(head.format(s=separator) + lines(separator)), **STATED)
    np.testing.assert_array_equal(rec.data, X)  # 17 digits come back bit by bit
    assert rec.channels == (("gyro_x", "gyro_y", "gyro_z") if head else ("channel_0", "channel_1", "channel_2"))


@pytest.mark.parametrize("name", ["a.csv", "a.TSV", "a.txt", "a.dat", "a.log"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\n\n"])
def test_text_suffixes_and_line_ends(write, name, end):
    np.testing.assert_array_equal(read_recording(write(lines(",", end=end), name), **STATED).data, X)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_text_encodings(write, encoding):
    file = write("gx [°/s],gy [°/s],gz [°/s]\n" + lines(","), encoding=encoding)
    rec = read_recording(file, rate=50.0)
    assert (rec.channels, rec.units) == (("gx", "gy", "gz"), ("rad/s",) * 3)
    np.testing.assert_allclose(rec.data, X * DEG, rtol=1e-15)
    with pytest.raises(ValueError, match="says that gx is in rad/s, and the file says deg/s"):
        read_recording(file, **STATED)
    np.testing.assert_array_equal(read_recording(write(lines(","), encoding=encoding), **STATED).data, X)


def test_text_quoted_values_and_trailing_comments(write):
    path = write('"","a, b","c"\n"1",0.5,2 # first\n"2",0.25,3\n"3",4,5\n#end\n')
    rec = read_recording(path, **STATED)
    assert rec.channels == ("column_0", "a_b", "c")
    np.testing.assert_array_equal(rec.data, [[1, 0.5, 2], [2, 0.25, 3], [3, 4, 5]])


def test_text_given_header_and_delimiter(write):
    text = "Logger 3\na,b,c\ndeg/s,deg/s,deg/s\n" + lines(",")
    for header in (None, 2, 3):
        rec = read_recording(write(text), rate=50.0, header=header)
        np.testing.assert_allclose(rec.data, X * DEG, rtol=1e-15)
        assert rec.channels == ("a", "b", "c")
    renamed = read_recording(write(text), rate=50.0, names=["u", "v", "w"], channels=["c", "a", "b"])
    assert renamed.channels == ("u", "v", "w")
    np.testing.assert_allclose(renamed.data, X[:, [2, 0, 1]] * DEG, rtol=1e-15)
    assert read_recording(write(text), rate=50.0, names={"b": "y"}).channels == ("a", "y", "c")
    assert len(read_recording(write("1,2\n" + lines(",", X[:, :2])), **STATED, header=1)) == 40
    np.testing.assert_array_equal(read_recording(write(lines("|")), **STATED, delimiter="|").data, X)


def test_text_columns_and_time_by_name_or_number(write):
    text = "Time [s],status,Gyro. X,Gyro. Y,Gyro. Z\n" + "".join(
        f"{t:.17g},ok,{row}\n" for t, row in zip(T, lines(",").split(), strict=True)
    )
    for columns, time in ((["gyro_z", "Gyro. X"], "time_s"), ([4, "gyro_x"], "Time [s]"), ([4, 0, 2], 0)):
        rec = read_recording(write(text), units="rad/s", columns=columns, time=time)
        np.testing.assert_array_equal(rec.data, X[:, [2, 0]])
        assert rec.channels == ("gyro_z", "gyro_x")
        assert rec.rate == pytest.approx(50.0, rel=1e-12, abs=0)


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        ("", {}, "holds no line of data"),
        ("a,b\n# nothing\n", {}, "holds no line of data"),
        ("1,2\n3,4\n5,abc\n", {}, "Line 3, column 1 holds the text 'abc', not a number"),
        ("# c\na,b\n1,2\n\n3,x 4\n", {}, "Line 5, column 1 holds the text 'x 4'"),
        ("1;2.0\n1;2,5\n", {}, "Line 2, column 1 holds the text '2,5', not a number. Write decimal commas as points"),
        ("a,b\nrad,s\n1,2\n2,1\n", {}, "units=... says that a is in rad/s, and the file says rad"),
        ("1,2\n3,\n", {}, "Line 2, column 1 is empty"),
        ("1,2,\n3,4,\n", {"columns": [2]}, "Line 1, column 2 is empty"),
        ("1,2\n3,4\n5\n", {}, r"Line 3 has 1 fields, and the first line of data 2: \['5'\]"),
        ("1 2\n3 4 5\n", {}, "Line 2 has 3 fields, and the first line of data 2"),
        ("1,2,3\n4,5,6,7\n", {"columns": [0]}, "Line 2 has 4 fields"),
        ("1,2,3\n4,5\n", {"columns": [0]}, "Line 2 has 2 fields"),
        ("a,b\n1,2,3\n", {}, "line of names does not match the 3 columns.*header=1"),
        ("1,2\n3,4\n", {"columns": [2]}, "no column 2; the file has 2, numbered from 0 without names"),
        ("1,2\n3,4\n", {"columns": [-1]}, "no column -1"),
        ("1,2\n3,4\n", {"time": "t"}, "no column 't'.*without names"),
        ("a,b\n1,2\n3,4\n", {"columns": ["c"]}, "no column 'c'; the file has 2, numbered from 0: a, b"),
        ("t\n1\n2\n", {"time": "t"}, "No column is left to read besides that of time"),
        ("1,2\n3,4\n", {"names": ["x"]}, "1 channel names"),
        (
            "1,2\n3,4\n",
            {"channels": ["x"]},
            "no channel or group 'x'; the channels are: channel_0, channel_1. New names",
        ),
        ("a,b\n1,2\n3,4\n", {"names": {"c": "d"}}, "renames c, and the channels are: a, b"),
        ("a b,a_b\n1,2\n3,4\n", {}, "occur twice: a_b"),
        ("1,2\n3,nan\n", {}, r"'channel_1' holds 1 values.*\(nan\) at index 1"),
        ("1,2\n3,2\n", {}, "'channel_1' is constant"),
    ],
)
def test_bad_text(write, text, arguments, message):
    path = write(text)
    with pytest.raises(ValueError, match=message) as raised:
        read_recording(path, **STATED, **arguments)
    assert str(raised.value).startswith(f"{path}: ")


# Rates, time and units


def timed(times, data=X):
    return "t,x,y,z\n" + lines(",", np.column_stack([times, data[: len(times)]]))


@pytest.mark.parametrize(
    ("unit", "size"), [("s", 1), ("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("min", 1 / 60), ("h", 1 / 3600)]
)
def test_time_units(write, unit, size):
    rec = read_recording(write(timed(1000 + T * size)), units="1", time="t", time_unit=unit)
    assert rec.rate == pytest.approx(50.0, rel=1e-7, abs=0)
    assert rec.channels == ("x", "y", "z")


def test_a_given_rate_that_agrees_with_time_holds(write):
    assert read_recording(write(timed(T * 1.005)), units="1", time="t", rate=50.0).rate == 50.0


@pytest.mark.parametrize(
    ("times", "arguments", "message"),
    [
        (
            T * 1.02,
            {"rate": 50.0},
            r"Wrong rate \(or time_unit\): rate= says 50 Hz, and the column of time 't' .s. 49.0",
        ),
        (T, {"time_unit": "ms", "rate": 50.0}, "Wrong rate .*the column of time 't' .ms. 50000 Hz"),
        (T, {"time_unit": "fortnight"}, "Unknown unit of time 'fortnight'"),
        (np.delete(T, 7), {}, "gap of 0.04 s before index 7, where the usual step is 0.02 s"),
        (np.where(np.arange(40) == 9, 0.1, T), {}, "does not increase at index 9"),
        (np.round(T, 1), {}, "does not increase at index 1.*too few digits"),
    ],
)
def test_bad_time(write, times, arguments, message):
    with pytest.raises(ValueError, match=message):
        read_recording(write(timed(times)), units="1", time="t", **arguments)


@pytest.mark.parametrize(
    "name", ["t", "Time", "TIMESTAMP", "timestamps", "sec", "Seconds", "t_ms", "time_s", "timestamp_ns", "sys_time"]
)
def test_a_column_of_time_is_no_channel(write, name):
    file = write(timed(T).replace("t,", f"{name},", 1))
    with pytest.raises(ValueError, match=rf"'{name.lower()}' looks like time.*time=.*columns="):
        read_recording(file, rate=50.0, units="1")
    assert read_recording(file, rate=50.0, units="1", columns=["x", "z"]).channels == ("x", "z")
    assert read_recording(file, units="1", time=name).channels == ("x", "y", "z")


def test_a_saved_channel_may_be_called_time(tmp_path):
    rec = Recording.from_array(X[:, 0], rate=50.0, units="1", channels="t")
    assert read_recording(save_recording(rec, tmp_path / "t.npz")).channels == ("t",)


def test_rates_and_units_are_never_guessed(write):
    path = write(lines(","))
    with pytest.raises(ValueError, match=r"sampling rate is missing.*give rate=.*or time=.*never guessed"):
        read_recording(path, units="rad/s")
    with pytest.raises(ValueError, match=r"record\.csv: The unit of the samples is missing.*never guessed"):
        read_recording(path, rate=1.0)
    with pytest.raises(ValueError, match="positive number of Hz"):
        read_recording(path, rate=0.0, units="rad/s")


def test_missing_files(tmp_path, write):
    write("1", "record.csv")
    with pytest.raises(FileNotFoundError, match=r"no file .*recrod\.csv.*similar name are there: record\.csv"):
        read_recording(tmp_path / "recrod.csv", **STATED)
    with pytest.raises(FileNotFoundError, match="no file"):
        read_recording(tmp_path / "nowhere" / "record.csv", **STATED)
    with pytest.raises(FileNotFoundError, match=r"datasets\.load\('cont.imu1'\)"):
        read_recording(tmp_path / "cont.imu1.rda")
    with pytest.raises(ValueError, match=r"Unknown suffix '\.mat'; read are \.npy"):
        read_recording(write("1", "record.mat"), **STATED)


# Parquet


def test_parquet(tmp_path):
    stamps = np.datetime64("2026-01-01", "ns") + np.arange(40) * np.timedelta64(20_000_000, "ns")
    columns = {"Stamp": stamps, "Gyro. X": X[:, 0], "Gyro. Y": X[:, 1].astype(np.float32), "note": ["ok"] * 40}
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table(columns), path)
    rec = read_recording(path, units="deg/s", columns=["gyro_y", "gyro_x"], time="stamp")
    np.testing.assert_allclose(rec.data, np.column_stack([X[:, 1].astype(np.float32), X[:, 0]]) * DEG, rtol=1e-15)
    assert rec.rate == pytest.approx(50.0, rel=1e-12, abs=0)
    assert read_recording(path, units="deg/s", time="stamp").channels == ("gyro_x", "gyro_y")  # text is left out
    with pytest.raises(ValueError, match=r"Column 'note' holds .*ok.*not numbers"):
        read_recording(path, units="deg/s", time="stamp", columns=["note"])
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="no Parquet file, or it is truncated or corrupt"):
        read_recording(path, units="deg/s", time="stamp")


def test_parquet_nulls_are_missing_samples(tmp_path):
    pq.write_table(pa.table({"n": [1, None, 3]}), tmp_path / "a.parquet")
    with pytest.raises(ValueError, match=r"'n' holds 1 values.*\(nan\) at index 1"):
        read_recording(tmp_path / "a.parquet", **STATED)


# R data


def write_r(path, **objects):
    rdata.write_rda(path, objects)
    return path


def test_r_matrices_vectors_and_frames(tmp_path):
    import pandas as pd

    rec = read_recording(write_r(tmp_path / "m.rda", m=X), **STATED)
    np.testing.assert_array_equal(rec.data, X)
    rec = read_recording(write_r(tmp_path / "v.RData", v=X[:, 0]), **STATED)
    np.testing.assert_array_equal(rec.data, X[:, :1])
    frame = pd.DataFrame({"Gyro. X": X[:, 0], "count": np.arange(40, dtype=np.int32)})
    rec = read_recording(write_r(tmp_path / "f.rda", f=frame), **STATED)
    assert rec.channels == ("gyro_x", "count")
    np.testing.assert_array_equal(rec.data, np.column_stack([X[:, 0], np.arange(40)]))


def test_r_files_of_several_objects(tmp_path):
    path = write_r(tmp_path / "two.rda", a=X, b=-X)
    np.testing.assert_array_equal(read_recording(path, **STATED, variable="b").data, -X)
    with pytest.raises(ValueError, match=r"2 variables \(a, b\); variable=... is needed"):
        read_recording(path, **STATED)


def test_r_objects_that_are_no_record(tmp_path):
    with pytest.raises(ValueError, match="R object is a dict"):
        read_recording(write_r(tmp_path / "l.rda", x={"a": 1.0}), **STATED)
    integers_with_na = np.ma.array(np.arange(5, dtype=np.int32), mask=[0, 0, 1, 0, 0])
    with pytest.raises(ValueError, match=r"holds 1 values.*\(nan\) at index 2"):
        read_recording(write_r(tmp_path / "na.rda", x=integers_with_na), **STATED)


@pytest.mark.parametrize("compression", ["gzip", "bzip2", "xz", None])
@pytest.mark.parametrize("kept", [0.0, 0.01, 0.5, 0.99])
def test_truncated_r_files(tmp_path, compression, kept):
    path = tmp_path / "cut.rda"
    rdata.write_rda(path, {"m": X}, compression=compression or "gzip")
    whole = path.read_bytes() if compression else gzip.decompress(path.read_bytes())
    path.write_bytes(whole)
    np.testing.assert_array_equal(read_recording(path, **STATED).data, X)
    path.write_bytes(whole[: int(kept * len(whole))])
    with pytest.raises(ValueError, match=r"cut\.rda: .*truncated or corrupt: fetch or save it again"):
        read_recording(path, **STATED)


def test_a_file_that_may_not_be_read_is_not_called_corrupt(tmp_path, monkeypatch):
    np.save(tmp_path / "a.npy", X)

    def refuse(*arguments, **options):
        raise PermissionError("not yours")

    monkeypatch.setattr(np, "load", refuse)
    with pytest.raises(PermissionError, match="not yours"):
        read_recording(tmp_path / "a.npy", **STATED)


def test_files_that_are_not_what_they_are_called(write):
    with pytest.raises(ValueError, match="no R data file"):
        read_recording(write(lines(","), "text.rda"), **STATED)
    with pytest.raises(ValueError, match="no Parquet file"):
        read_recording(write(lines(","), "text.parquet"), **STATED)


# Optional packages


@pytest.mark.parametrize(
    ("name", "package", "modules"),
    [("a.rda", "rdata", ["rdata"]), ("a.parquet", "pyarrow", ["pyarrow", "pyarrow.parquet"])],
)
def test_missing_packages_are_named(write, monkeypatch, name, package, modules):
    for module in modules:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf'package {package}: pip install "gmwm-jax\[io\]"'):
        read_recording(write("", name), **STATED)


# netCDF and archives of vectors


def test_netcdf_states_units(tmp_path):
    import xarray as xr

    channels = {name: ("t", X[:, i], {"units": "deg/s"}) for i, name in enumerate(("Gyro X", "gyro_y"))}
    xr.Dataset({**channels, "t": T}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    rec = read_recording(tmp_path / "a.nc", time="t")
    assert (rec.channels, rec.units) == (("gyro_x", "gyro_y"), ("rad/s", "rad/s"))
    np.testing.assert_allclose(rec.data, X[:, :2] * DEG, rtol=1e-15)
    with pytest.raises(ValueError, match=r"says that gyro_x is in rad/s, and the file says deg/s"):
        read_recording(tmp_path / "a.nc", time="t", units="rad/s")
    with pytest.raises(ValueError, match="'t' looks like time"):
        read_recording(tmp_path / "a.nc", rate=50.0)
    xr.Dataset({**channels, "other": ("t", X[:, 2])}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    rec = read_recording(tmp_path / "b.nc", rate=50.0)
    assert (rec.channels, rec.understood.notes) == (("gyro_x", "gyro_y"), ("Left out, of unknown unit: other.",))
    with pytest.raises(ValueError, match="states units, but not of other"):
        read_recording(tmp_path / "b.nc", rate=50.0, channels=["gyro", "other"])
    assert read_recording(tmp_path / "b.nc", rate=50.0, columns=["gyro_y"]).channels == ("gyro_y",)


def test_vectors_of_an_archive_are_channels(tmp_path):
    np.savez(tmp_path / "a.npz", x=X[:, 0], y=X[:, 1])
    rec = read_recording(tmp_path / "a.npz", **STATED)
    assert rec.channels == ("x", "y")
    np.testing.assert_array_equal(rec.data, X[:, :2])
    np.savez(tmp_path / "b.npz", x=X[:, 0], matrix=X)  # nothing is left out silently
    with pytest.raises(ValueError, match=r"Beside the columns x there are matrix, .*variable="):
        read_recording(tmp_path / "b.npz", **STATED)
    np.testing.assert_array_equal(read_recording(tmp_path / "b.npz", **STATED, variable="matrix").data, X)
    assert read_recording(tmp_path / "b.npz", **STATED, columns=["x"]).channels == ("x",)
