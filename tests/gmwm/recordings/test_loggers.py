"""Files as loggers write them: one natural call each gives the samples that were written, rate and units understood."""

import bz2
import gzip
import lzma
import zipfile
import zlib

import numpy as np
import pytest

from gmwm_jax.recordings.files import read_recording

N = 400
G = 9.80665
DEG = np.pi / 180
AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
SI = ("rad/s",) * 3 + ("m/s^2",) * 3
RATE = 200.0
DRAWS = np.random.default_rng(7)
W = DRAWS.normal(size=(N, 3)) * 0.01  # rad/s
A = DRAWS.normal(size=(N, 3)) * 0.1 + [0.0, 0.0, -G]  # m/s^2
WA = np.concatenate([W, A], axis=1)
COUNTS = np.round(WA * 1e6).astype(int)
GYROS = [f"w_RS_S_{x} [rad s^-1]" for x in "xyz"]
ACCELS = [f"a_RS_S_{x} [m s^-2]" for x in "xyz"]


def table(rows, separator=","):
    return "".join(separator.join(v if isinstance(v, str) else repr(v) for v in row) + "\n" for row in rows)


def floats(values):
    return [float(v) for v in values]


def check(rec, expected=WA, rate=RATE, **tolerance):
    np.testing.assert_allclose(rec.data, expected, **({"rtol": 1e-12} | tolerance))
    assert (rec.channels, rec.units) == (AXES, SI)
    assert rec.rate == pytest.approx(rate, rel=1e-9)


# Xsens


def xsens(separator="\t", head="// Update Rate: 200.0Hz\n", keep=slice(None)):
    lines = ["// Start Time: Unknown\n", head, "// Filter Profile: human (46.1)\n", "// Firmware Version: 4.0.2\n"]
    names = ["PacketCounter", "SampleTimeFine", "Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Mag_X", ""]
    rows = [[(k + 65500) % 65536, "", *floats(A[k]), *floats(W[k]), 0.5, ""] for k in np.arange(N)[keep]]
    return "".join(lines) + separator.join(names) + "\n" + table([list(map(str, row)) for row in rows], separator)


@pytest.mark.parametrize("separator", ["\t", ";", ","])
def test_xsens(tmp_path, separator):
    """The rate is in the header; the counter wraps; a column is empty, and lines end in a separator."""
    file = tmp_path / "MT_0312.txt"
    file.write_text(xsens(separator))
    rec = read_recording(file)
    check(rec)
    assert rec.understood.format == "xsens"
    assert rec.understood.columns["gyro_x"] == ("Gyr_X", "rad/s")
    check(read_recording(file, format="xsens"))


def test_xsens_with_decimal_commas_in_utf_16(tmp_path):
    file = tmp_path / "MT.txt"
    file.write_text(xsens(";").replace(".", ",").replace("200,0Hz", "200.0Hz"), encoding="utf-16")
    check(read_recording(file))


def test_xsens_packets_that_were_lost(tmp_path):
    keep = np.delete(np.arange(N), [50, 51])
    file = tmp_path / "MT.txt"
    file.write_text(xsens(keep=keep))
    with pytest.raises(ValueError, match="2 samples are missing in 1 gaps"):
        read_recording(file)
    rec = read_recording(file, gaps="nan")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(rec.data[:, 0])), [50, 51])
    check(read_recording(file, gaps="longest"), WA[52:])


def test_xsens_by_its_clock(tmp_path):
    text = xsens(head="").splitlines(keepends=True)
    rows = [line.replace("\t\t", f"\t{10_000 + 50 * k}\t", 1) for k, line in enumerate(text[4:])]
    file = tmp_path / "MT.txt"
    file.write_text("".join(text[:4] + rows))
    check(read_recording(file))


# VectorNav


def test_vectornav(tmp_path):
    """Uncompensated axes are taken, and not those from which a filter took its bias."""
    names = ["Time [s]", "TimeStartup [ns]", "AngularRate X [rad/s]", "AngularRate Y [rad/s]", "AngularRate Z [rad/s]"]
    names += [f"UncompGyro {x} [rad/s]" for x in "XYZ"] + [f"UncompAccel {x} [m/s^2]" for x in "XYZ"] + ["Temp [°C]"]
    rows = [[k / 7, 10**12 + k * 5_000_000, 0.0, 0.0, 0.0, *floats(WA[k]), 25.0] for k in range(N)]
    file = tmp_path / "vn.csv"
    file.write_text(",".join(names) + "\n" + table(rows), encoding="utf-8")
    rec = read_recording(file)
    check(rec)
    assert rec.understood.format == "vectornav"
    file.write_text(",".join(names[:2] + [n.replace("omp", "OMP") for n in names[5:]]) + "\n" +
                    table([[*row[:2], *row[5:]] for row in rows]))  # fmt: skip
    check(read_recording(file))


def sentence(kind, values):
    text = f"{kind}," + ",".join(f"{v:+010.6f}" for v in values)
    total = 0
    for byte in text.encode():
        total ^= byte
    return f"${text}*{total:02X}\r\n"


def test_vectornav_sentences(tmp_path):
    lines = [sentence("VNIMU", [0, 0, 0, *A[k], *W[k], 20.7, 84.322]) for k in range(N)]
    others = [sentence("VNGPE", [1, 2])] * 3
    file = tmp_path / "vn.log"
    file.write_text("".join(lines[:100] + others + lines[100:]))
    with pytest.raises(ValueError, match=r"sampling rate is missing.*rate="):
        read_recording(file)
    check(read_recording(file, rate=40.0), rate=40.0, atol=5.1e-7)
    lines[7] = lines[7].replace("+84", "+94").replace("+084", "+094")
    file.write_text("".join(lines))
    with pytest.raises(ValueError, match=r"'gyro_x' holds 1 values that are NaN, the first \(nan\) at index 7"):
        read_recording(file, rate=40.0)
    assert read_recording(file, rate=40.0, gaps="nan").num_missing["gyro_x"] == 1


# ROS


FIELDS = (
    ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", "field.orientation.x"]
    + [f"field.angular_velocity.{x}" for x in "xyz"]
    + ["field.angular_velocity_covariance0"]
    + [f"field.linear_acceleration.{x}" for x in "xyz"]
)


def test_ros_text(tmp_path):
    """Stamps of 19 digits are exact, and those of the sensor, not of the receipt."""
    stamps = 1_700_000_000_000_000_000 + np.arange(N) * 5_000_000
    late = DRAWS.integers(0, 2_000_000, size=N)
    rows = [
        [int(stamps[k] + late[k]), k, int(stamps[k]), "imu", 0.0, *floats(W[k]), 0.0, *floats(A[k])] for k in range(N)
    ]
    file = tmp_path / "imu.csv"
    file.write_text(",".join(FIELDS) + "\n" + table(rows))
    rec = read_recording(file)
    check(rec)
    assert rec.understood.format == "ros"
    assert rec.understood.time.jitter < 1e-9
    split = [f.replace("stamp", "stamp.secs") for f in FIELDS[:3]] + ["field.header.stamp.nsecs", *FIELDS[3:]]
    rows = [[row[0], row[1], row[2] // 10**9, row[2] % 10**9, *row[3:]] for row in rows]
    file.write_text(",".join(split) + "\n" + table(rows))
    check(read_recording(file))


# NovAtel


def log(text):
    return f"%{text}*{zlib.crc32(text.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF:08x}\r\n"


def raw_imu(k, kind="RAWIMUSA", more="", head="2209,0.0"):
    w, a = COUNTS[k, :3], COUNTS[k, 3:]
    seconds = 604799.0 + k / RATE  # the week ends
    when = f"{2209 + int(seconds // 604800)},{seconds % 604800:.9f}"
    return log(f"{kind},{head};{more}{when},00000077,{a[2]},{-a[1]},{a[0]},{w[2]},{-w[1]},{w[0]}")


def test_the_checksum_of_novatel_is_that_of_its_manual():
    text = "RAWIMUSA,2209,491612.254;2209,491612.253588,ea5afe00,329303960,-2512321,4410363,309705,607017,-1009773"
    assert log(text) == f"%{text}*1fb76c28\r\n"


SIZES = {"adis16488": (720 * 2.0**-31 * DEG, 200 * 2.0**-31), "hg1900": (2.0**-33, 0.3048 * 2.0**-27)}


@pytest.mark.parametrize("kind", ["RAWIMUSA", "RAWIMUA"])
@pytest.mark.parametrize("imu", SIZES)
def test_novatel(tmp_path, kind, imu):
    """Increments, in the order z, -y, x, among other logs; the type of IMU tells their size."""
    lines = [raw_imu(k, kind) for k in range(N)]
    lines = [line.replace("%", "#", 1) if kind == "RAWIMUA" else line for line in lines]
    file = tmp_path / "span.ASC"
    file.write_text("#BESTPOSA,COM1,0;SOL*00000000\r\n".join(["", *lines]))
    expected = COUNTS * np.repeat(SIZES[imu], 3) * RATE
    check(read_recording(file, scale=imu), expected, rtol=1e-9)
    gyro, accel = SIZES[imu]
    check(read_recording(file, scale={"gyro": f"{gyro} rad", "accel": f"{accel} m/s"}), expected, rtol=1e-9)
    with pytest.raises(ValueError, match=r"type of IMU is missing, .*scale=..., one of hg1700-ag11.*adis16488"):
        read_recording(file)
    with pytest.raises(ValueError, match=r"Unknown type of IMU 'stim'; known are"):
        read_recording(file, scale="stim")


def test_novatel_extended_logs_name_the_type(tmp_path):
    """And a line that was damaged is a sample that is missing."""
    lines = [raw_imu(k, "RAWIMUSXA", more="00,26,") for k in range(N)]
    lines[9] = lines[9].replace("0", "1", 1)
    file = tmp_path / "span.gps"  # told by the content
    file.write_text("".join(lines))
    rec = read_recording(file, gaps="nan")
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(rec.data[:, 0])), [9])
    expected = COUNTS * np.repeat([1e-9, 2e-8], 3) * RATE
    expected[9] = np.nan
    check(rec, expected, rtol=1e-9)
    assert rec.understood.notes[0] == "Counts of the IMU isa100c."


# Text without names, data sets


def test_kf_gins(tmp_path):
    file = tmp_path / "imu.txt"
    file.write_text(table([[456300 + k / RATE, *floats(WA[k] / RATE)] for k in range(N)], " "))
    check(read_recording(file, format="kf-gins"), rtol=1e-9)
    with pytest.raises(ValueError, match="7 columns without names: kf-gins, rtklibexplorer; say format"):
        read_recording(file, rate=200.0)
    file.write_text("1 2 3\n4 5 6\n")
    with pytest.raises(ValueError, match=r"no file of the format kf-gins, whose columns are time, gyro_x.*: it has 3"):
        read_recording(file, format="kf-gins")


def test_rtklibexplorer(tmp_path):
    """Milliseconds, rounded."""
    stamps = np.round(261906 + np.arange(N) * 1000 / 99.4).astype(int)
    rows = [[*floats(A[k] / G), *floats(W[k] / DEG), int(stamps[k])] for k in range(N)]
    file = tmp_path / "imu.csv"
    file.write_text(table(rows))
    rec = read_recording(file, format="rtklibexplorer")
    check(rec, rate=rec.rate)
    assert rec.rate == pytest.approx(99.4, rel=1e-3)
    assert "which are rounded to 0.001 s" in str(rec.understood)


def test_euroc(tmp_path):
    rows = [[1403636579758555392 + k * 5_000_000, *floats(WA[k])] for k in range(N)]
    file = tmp_path / "data.csv"
    file.write_text(",".join(["#timestamp [ns]", *GYROS, *ACCELS]) + "\n" + table(rows))
    rec = read_recording(file)
    check(rec)
    assert rec.understood.format == "euroc"


def kitti_row(k):
    values = np.zeros(30)
    values[11:14], values[17:20] = A[k], W[k]
    return floats(values)


def test_kitti(tmp_path):
    """A folder of frames, one of which is not there; or one text."""
    folder = tmp_path / "oxts"
    (folder / "data").mkdir(parents=True)
    times = [f"2011-09-26 13:02:{25 + k / 10:012.9f}" for k in range(300)]
    (folder / "timestamps.txt").write_text("\n".join(times) + "\n")
    for k in range(300):
        if k != 20:
            (folder / "data" / f"{k:010d}.txt").write_text(table([kitti_row(k)], " "))
    with pytest.raises(ValueError, match="1 samples are missing in 1 gaps"):
        read_recording(folder)
    rec = read_recording(folder, gaps="nan")
    expected = WA[:300].copy()
    expected[20] = np.nan
    check(rec, expected, rate=10.0)
    text = tmp_path / "all.txt"
    text.write_text(table([kitti_row(k) for k in range(N)], " "))
    check(read_recording(text, format="kitti", rate=10.0), rate=10.0)


# Counts, increments, units in names


def test_counts_with_a_scale(tmp_path):
    """Of an ADIS16470; the temperature has no unit and is no axis, and is left out."""
    counts = np.round(DRAWS.normal(size=(N, 6)) * 30).astype(int)
    file = tmp_path / "adis.csv"
    rows = [[k * 5, *map(int, counts[k]), 25] for k in range(N)]
    file.write_text("t_ms,gx,gy,gz,ax,ay,az,temp\n" + table(rows))
    rec = read_recording(file, time="t_ms", scale={"gyro": "0.1 deg/s", "accel": "1.25 mg"})
    np.testing.assert_allclose(rec.data, counts * np.repeat([0.1 * DEG, 1.25e-3 * G], 3), rtol=1e-12)
    assert (rec.channels, rec.rate) == (("gx", "gy", "gz", "ax", "ay", "az"), 200.0)
    assert rec.understood.notes == ("Left out, of unknown unit: temp.",)
    one = read_recording(file, time="t_ms", columns=["gx"], scale="1/10 deg/s")
    np.testing.assert_allclose(one.data, rec.data[:, :1], rtol=1e-12)
    for scale, message in (
        ({"gyro": "0.1"}, "size of a count is a number with a unit, as in \"0.1 deg/s\", and not '0.1'"),
        ({"mag": "0.1 deg/s"}, "scale names mag, and the channels are: gx"),
        ({"gyro": "0.1 V"}, "Unknown unit 'V'"),
        ({"gyro": "0.1 deg/s"}, "No unit is given for: ax, ay, az, temp"),
    ):
        with pytest.raises(ValueError, match=message):
            read_recording(file, time="t_ms", scale=scale)


def test_increments_by_their_names(tmp_path):
    names = [f"dtheta_{x}[rad]" for x in "xyz"] + [f"dvel_{x}[m/s]" for x in "xyz"]
    file = tmp_path / "inc.csv"
    file.write_text(",".join(["time[s]", *names]) + "\n" + table([[k / RATE, *floats(WA[k] / RATE)] for k in range(N)]))
    rec = read_recording(file, time="time[s]")
    np.testing.assert_allclose(rec.data, WA, rtol=1e-9)
    assert rec.channels == ("dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z")
    assert rec["dtheta"].units == ("rad/s",) * 3


def test_names_that_only_units_tell_apart(tmp_path):
    """And what is no number (a thousands separator, here) is not left out silently."""
    file = tmp_path / "a.csv"
    file.write_text("gyro_x [deg/s];gyro_x [rad/s];much\n1;2;1.234,5\n2;1;2.345,6\n")
    rec = read_recording(file, rate=1.0)
    assert (rec.channels, rec.understood.notes) == (("gyro_x_deg_s", "gyro_x_rad_s"), ("Left out, no numbers: much.",))


def test_names_as_they_stand_in_the_file(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("Zeit ü [ms];Drehrate X;Drehrate Y (°/s);Status\n" +
                    table([[5.0 * k, *floats(W[k, :2]), "ok"] for k in range(N)], ";"), encoding="latin-1")  # fmt: skip
    rec = read_recording(
        file, time="Zeit ü [ms]", units={"Drehrate X": "rad/s"}, channels=["Drehrate Y (°/s)", "Drehrate X"]
    )
    np.testing.assert_allclose(rec.data, W[:, [1, 0]] * [DEG, 1.0], rtol=1e-12)
    assert (rec.channels, rec.rate) == (("drehrate_y", "drehrate_x"), 200.0)
    with pytest.raises(ValueError, match=r"time_unit='s' contradicts the file, in which 'Zeit ü .ms.' is in ms"):
        read_recording(file, time="Zeit ü [ms]", time_unit="s", units="rad/s")


# Packed files, encodings, separators


def packed(path, suffix, data):
    file = path.with_name(path.name + suffix)
    match suffix:
        case ".gz":
            file.write_bytes(gzip.compress(data))
        case ".bz2":
            file.write_bytes(bz2.compress(data))
        case ".xz":
            file.write_bytes(lzma.compress(data))
        case ".zip":
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.writestr(f"logs/{path.name}", data)
    return file


@pytest.mark.parametrize("suffix", [".gz", ".bz2", ".xz", ".zip"])
def test_packed_files(tmp_path, suffix):
    text = ",".join(["#timestamp [ns]", *GYROS, *ACCELS]) + "\n"
    text += table([[k * 5_000_000, *floats(WA[k])] for k in range(N)])
    file = packed(tmp_path / "data.csv", suffix, text.encode())
    check(read_recording(file))
    file.rename(tmp_path / "renamed.csv")  # told by its first bytes
    check(read_recording(tmp_path / "renamed.csv"))
    np.save(tmp_path / "a.npy", WA)
    data = (tmp_path / "a.npy").read_bytes()
    np.testing.assert_array_equal(
        read_recording(packed(tmp_path / "a.npy", suffix, data), rate=1.0, units="1").data, WA
    )
    whole = packed(tmp_path / "data.csv", suffix, text.encode())
    whole.write_bytes(whole.read_bytes()[:-2000])
    with pytest.raises(ValueError, match="truncated or corrupt"):
        read_recording(whole)


def test_an_archive_holds_one_file(tmp_path):
    file = tmp_path / "a.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("a.csv", "1")
        archive.writestr("b.csv", "1")
    with pytest.raises(ValueError, match=r"holds 2 files \(a\.csv, b\.csv\) and not one"):
        read_recording(file)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
@pytest.mark.parametrize(("separator", "decimal"), [("|", "."), ("|", ","), (";", ","), ("\t", ","), (" ", ",")])
def test_separators_decimal_commas_and_encodings(tmp_path, encoding, separator, decimal):
    text = separator.join(["gx[°/s]", "gy[°/s]", "gz[°/s]"]) + "\n" + table([floats(row) for row in W], separator)
    file = tmp_path / "a.txt"
    file.write_bytes(text.replace(".", decimal).encode(encoding))
    rec = read_recording(file, rate=100.0)
    np.testing.assert_allclose(rec.data, W * DEG, rtol=1e-15)
    assert rec.channels == ("gx", "gy", "gz")


def test_lines_of_a_logger_before_the_names(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("sep=;\nLogger 3\nSerial: 12\n\ntime;gyro_x;state\ns;deg/s;-\n" +
                    table([[k / RATE, float(W[k, 0]), "ok"] for k in range(N)], ";"))  # fmt: skip
    for how in ({}, {"header": 5}):
        rec = read_recording(file, time="time", **how)
        np.testing.assert_allclose(rec.data, W[:, :1] * DEG, rtol=1e-15)
        assert rec.channels == ("gyro_x",)


@pytest.mark.parametrize("names", ["gyro_x [deg/s] gyro_y [deg/s]", "Gyro X [deg/s]   Gyro Y [deg/s]"])
def test_names_with_blanks_in_a_file_with_blanks(tmp_path, names):
    file = tmp_path / "a.txt"
    file.write_text(f"{names}\n" + table([floats(row[:2]) for row in W], " "))
    np.testing.assert_allclose(read_recording(file, rate=1.0).data, W[:, :2] * DEG, rtol=1e-15)
    file.write_text("Gyro X [deg/s]\n" + table([[float(w)] for w in W[:, 0]]))
    assert read_recording(file, rate=1.0).channels == ("gyro_x",)


def test_a_line_that_is_no_line(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("1," * 40_000)
    with pytest.raises(ValueError, match=r"longer than 65536 characters"):
        read_recording(file, rate=1.0, units="1")


# Time


@pytest.mark.parametrize(
    ("names", "stamps", "time"),
    [
        (["stamp"], lambda k: [f"2026-01-31T23:59:59.{k:03d}Z"], "stamp"),
        (["date", "time"], lambda k: ["31.01.2026", f"12:00:00,{k:03d}"], ["date", "time"]),
        (["week", "tow"], lambda k: [2209, 604799 + k / 1000], ["week", "tow"]),
        (["sec", "nanosec"], lambda k: [5 + (k + 800) // 1000, (k + 800) % 1000 * 1_000_000], ["sec", "nanosec"]),
    ],
)
def test_time_in_texts_and_in_two_columns(tmp_path, names, stamps, time):
    file = tmp_path / "a.csv"
    file.write_text(";".join([*names, "gyro_x"]) + "\n" + table([[*stamps(k), float(W[k, 0])] for k in range(N)], ";"))
    rec = read_recording(file, time=time, units="rad/s", format="text")
    np.testing.assert_allclose(rec.data, W[:, :1], rtol=1e-15)
    assert rec.rate == pytest.approx(1000.0, rel=1e-9)


def test_missing_samples(tmp_path):
    lost = np.isin(np.arange(N), [100, 101, 300])
    stamps = np.round(np.arange(N) / 152.3, 3)[~lost]
    file = tmp_path / "a.csv"
    file.write_text("t,gyro_x\n" + table(np.column_stack([stamps, W[~lost, 0]]).tolist()))
    with pytest.raises(ValueError, match=r'3 samples are missing in 2 gaps.*gaps="nan" puts NaN.*gaps="longest" takes'):
        read_recording(file, time="t", units="rad/s")
    full = read_recording(file, time="t", units="rad/s", gaps="nan")
    expected = np.where(lost, np.nan, W[:, 0])
    np.testing.assert_array_equal(full.data[:, 0], expected)
    assert full.gaps
    assert full.num_missing == {"gyro_x": 3}
    assert full.understood.notes == ("3 missing samples became NaN.",)
    run = read_recording(file, time="t", units="rad/s", gaps="longest")
    np.testing.assert_array_equal(run.data[:, 0], W[102:300, 0])
    assert not run.gaps
    with pytest.raises(ValueError, match="gaps is one of refuse, nan, longest, and is 'close'"):
        read_recording(file, time="t", units="rad/s", gaps="close")


def test_a_clock_that_falls_back_and_rows_written_twice(tmp_path):
    file = tmp_path / "a.csv"
    order = np.r_[np.arange(100), np.arange(50, 200), 199, np.arange(200, 300)]
    file.write_text("t,gyro_x\n" + table([[k / RATE, float(W[k, 0])] for k in order.tolist()]))
    with pytest.raises(ValueError, match=r"does not increase at index 100"):
        read_recording(file, time="t", units="rad/s")
    rec = read_recording(file, time="t", units="rad/s", gaps="longest")
    np.testing.assert_array_equal(rec.data[:, 0], W[50:300, 0])
    assert rec.understood.time.duplicated == 1
    assert rec.understood.notes[0] == "The clock falls back; taken were rows 100 to 350 of 351."


def test_the_longest_run_without_nan(tmp_path):
    x = W[:, 0].copy()
    x[[10, 11, 250]] = np.nan
    np.save(tmp_path / "a.npy", x)
    rec = read_recording(tmp_path / "a.npy", rate=1.0, units="1", gaps="longest")
    np.testing.assert_array_equal(rec.data[:, 0], W[12:250, 0])
    np.save(tmp_path / "a.npy", np.full(5, np.nan))
    with pytest.raises(ValueError, match="no run without"):
        read_recording(tmp_path / "a.npy", rate=1.0, units="1", gaps="longest")


def test_drift_against_a_second_clock(tmp_path):
    own = np.arange(N) / RATE
    file = tmp_path / "a.csv"
    file.write_text("t,gps_tow [ms],gyro_x\n" + table([[t, 3e6 + 1e3 * t / (1 + 25e-6), float(w)] for t, w in zip(own.tolist(), W[:, 0].tolist(), strict=True)]))  # fmt: skip  # noqa: E501
    rec = read_recording(file, time="t", clock="gps_tow [ms]", units="rad/s")
    assert rec.channels == ("gyro_x",)
    assert rec.understood.drift[0] == pytest.approx(25.0, abs=1e-3)
    assert "clock drift +25 +- " in str(rec.understood)


# What is asked for


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"format": "xbow"}, "Unknown format 'xbow'; known are xsens, vectornav"),
        ({"format": "xsens"}, "no file of the format xsens: no column is an axis of an IMU"),
        ({"time": ["a", "b", "c"]}, "one column, or two that belong together, and these are 3"),
    ],
)
def test_what_is_asked_for_and_not_there(tmp_path, arguments, message):
    file = tmp_path / "a.csv"
    file.write_text("a,b,c\n1,2,3\n2,3,1\n")
    with pytest.raises(ValueError, match=message):
        read_recording(file, rate=1.0, units="1", **arguments)
