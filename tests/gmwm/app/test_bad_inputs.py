"""A table of bad files and bad options: each ends with one message in the words of the command line, and code 2."""

import bz2
import gzip
import io
import lzma
import zipfile

import numpy as np
import pytest
from refusals import assert_refused

import gmwm_jax as gj
from gmwm_jax.app.cli import app


def table(rows, names="time,gyro_x [rad/s],accel_x [m/s^2]"):
    """Text of a table at 100 Hz of noise."""
    rng = np.random.default_rng(0)
    lines = [f"{i / 100:.2f},{a:.6f},{b:.6f}" for i, (a, b) in enumerate(rng.normal(size=(rows, 2)))]
    return "\n".join([names, *lines]) + "\n"


GOOD = table(200)


def lines_of(text, **changed):
    """The table with lines, counted from 0, in place of its own."""
    lines = text.splitlines()
    for place, line in changed.items():
        lines[int(place[1:])] = line
    return ("\n".join(lines) + "\n").encode()


def npy(array, **options):
    stream = io.BytesIO()
    np.save(stream, array, **options)
    return stream.getvalue()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def zipped(**files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in files.items():
            archive.writestr(name.replace("_", "."), content)
    return stream.getvalue()


NOISE = np.random.default_rng(1).bytes(3000)

FILES = {
    "empty.csv": b"",
    "blank.csv": b"\n\n  \n",
    "only_names.csv": b"time,gyro_x,accel_x\n",
    "only_comments.txt": b"# nothing\n% here\n// at all\n",
    "one_row.csv": b"time,gyro_x [rad/s]\n0.0,1.0\n",
    "two_rows.csv": b"time,gyro_x [rad/s]\n0.0,1.0\n0.01,1.1\n",
    "ragged.csv": lines_of(GOOD, l90="0.89,1.0"),
    "more_fields.csv": lines_of(GOOD, l90="0.89,1.0,2.0,3.0"),
    "word.csv": lines_of(GOOD, l90="0.89,one,2.0"),
    "empty_field.csv": lines_of(GOOD, l90="0.89,,2.0"),
    "two_points.csv": lines_of(GOOD, l90="0.89,1.0.0,2.0"),
    "nan.csv": lines_of(GOOD, l90="0.89,nan,2.0"),
    "infinite.csv": lines_of(GOOD, l90="0.89,inf,2.0"),
    "overflow.csv": lines_of(GOOD, l90="0.89,1e999,2.0"),
    "time_back.csv": lines_of(GOOD, l90="0.10,1.0,2.0"),
    "time_nan.csv": lines_of(GOOD, l90="nan,1.0,2.0"),
    "time_still.csv": GOOD.replace("\n1.", "\n0.").encode(),
    "gap.csv": "".join(line for i, line in enumerate(GOOD.splitlines(True)) if not 100 < i < 150).encode(),
    "same_name_twice.csv": lines_of(GOOD, l0="time,gyro_x [rad/s],gyro_x [rad/s]"),
    "names_too_few.csv": lines_of(GOOD, l0="time,gyro_x"),
    "names_too_many.csv": lines_of(GOOD, l0="time,gyro_x,gyro_y,gyro_z"),
    "no_units.csv": lines_of(GOOD, l0="time,gyro_x,accel_x"),
    "no_names.csv": GOOD.split("\n", 1)[1].encode(),
    "no_time.csv": lines_of(GOOD, l0="a,gyro_x [rad/s],accel_x [m/s^2]"),
    "quoted.csv": lines_of(GOOD, l90='"0.89,1.0,2.0'),
    "wide.csv": ((",".join(["1.0"] * 1500) + "\n") * 3).encode(),
    "long_line.csv": b"time,gyro_x\n" + b"1" * 200_000 + b"\n",
    "long_line_later.csv": GOOD.encode() + b"1" * 2_000_000 + b"\n",
    "one_line.txt": b"0.5 " * 200_000,
    "noise.csv": NOISE,
    "noise.txt": NOISE,
    "noise.npy": NOISE,
    "noise.npz": NOISE,
    "noise.parquet": NOISE,
    "noise.nc": NOISE,
    "noise.rda": NOISE,
    "noise.RData": NOISE,
    "noise.bag": NOISE,
    "noise.mcap": NOISE,
    "noise.db3": NOISE,
    "noise.csv.gz": NOISE,
    "noise.csv.bz2": NOISE,
    "noise.csv.xz": NOISE,
    "noise.csv.zip": NOISE,
    "noise.mat": NOISE,
    "noise": NOISE,
    "zeros.csv": bytes(5000),
    "page.csv": b"<!DOCTYPE html><html><body><p>404, 404</p></body></html>\n" * 3,
    "object.json.csv": b'{"gyro": [1, 2, 3], "rate": 100}\n',
    "half.npz": npz(data=np.ones((300, 2)))[:2000],
    "half.npy": npy(np.ones((300, 2)))[:2000],
    "objects.npy": npy(np.array([{"a": 1}] * 50, dtype=object), allow_pickle=True),
    "words.npy": npy(np.array(["a", "b"] * 50)),
    "complex.npy": npy(np.ones(300) * 1j),
    "cube.npy": npy(np.ones((30, 3, 3))),
    "scalar.npy": npy(np.array(1.0)),
    "nothing.npy": npy(np.zeros((0, 3))),
    "turned.npy": npy(np.ones((3, 300))),
    "lying.npy": npy(np.ones(300)).replace(b"(300,)", b"(10**12,)".ljust(6)[:6]),
    "claims.npy": npy(np.ones(300)).replace(b"(300,), }       ", b"(999999999999,),"),
    "none.npz": npz(),
    "several.npz": npz(a=np.ones((300, 2)), b=np.ones((200, 2))),
    "lengths.npz": npz(a=np.ones(300), b=np.ones(200)),
    "half.csv.gz": gzip.compress(GOOD.encode())[:900],
    "half.csv.bz2": bz2.compress(GOOD.encode())[:900],
    "half.csv.xz": lzma.compress(GOOD.encode())[:900],
    "bomb.csv.gz": gzip.compress(bytes(40_000_000)),
    "none.zip": zipped(),
    "two.zip": zipped(a_csv=GOOD, b_csv=GOOD),
    "half.csv.zip": zipped(a_csv=GOOD)[:900],
    "utf16.csv": GOOD.encode("utf-16")[:-1001],
    "xsens.txt": b"// Start Time: 1\n// Sample rate: 100.0Hz\nPacketCounter;Acc_X\n",
    "vectornav.csv": b"$VNIMU,-00.2,x,1*00\n" * 20,
    "kitti": None,
}
"""Name -> content, each with one fault; None: a folder."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("bad_inputs")
    for name, content in FILES.items():
        if content is None:
            (where / name).mkdir()
        else:
            (where / name).write_bytes(content)
    (where / "good.csv").write_text(GOOD)
    gj.save_recording(gj.read_recording(where / "good.csv", time="time"), where / "good.npz")
    (where / "dangling.csv").symlink_to(where / "nowhere.csv")
    (where / "loop.csv").symlink_to(where / "loop.csv")
    return where


@pytest.fixture(autouse=True)
def in_the_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


@pytest.mark.parametrize("name", [*FILES, "nowhere.csv", "no/where.csv", "dangling.csv", "loop.csv", "a\nb.csv", "."])
@pytest.mark.parametrize("command", [("wv",), ("fit", "--model", "WN")])
def test_a_bad_file(name, command):
    stated = ["--rate", "100", "--unit", "rad/s"] if ".np" in name else ["--time", "time"] if ".csv" in name else []
    assert_refused(app, [command[0], name, *stated, *command[1:]])


@pytest.mark.parametrize(
    ("name", "options"),
    [("no_units.csv", {"units": "rad/s"}), ("nan.csv", {"gaps": "longest"}), ("gap.csv", {"gaps": "longest"})],
)
def test_what_mends_it(name, options):
    """The one fault of some of these is mended by an option."""
    assert len(gj.read_recording(name, time="time", **options)) >= 50


WV, FIT, SELECT = ((command, "good.csv", "--time", "time") for command in ("wv", "fit", "select"))
UNITS = ("units",)
SIMULATE = ("data", "simulate")


def of(command, *options, values):
    """The command with each of the values behind the options."""
    return [(*command, *options, value) for value in values]


OPTIONS = [
    *of(WV, "--channels", values=("mag", "", ",", "gyro_x;accel_x", "7")),
    *of(WV, "--rate", values=("0", "-1", "nan", "inf", "50", "fast", "")),
    *of(WV, "--unit", values=("deg/w", "", "gyro=", "=deg/s", "gyro=deg/s,g", "mag=T", "rad/s,rad/s")),
    *of(WV, "--scale", values=("", "0 deg/s", "-1 deg/s", "one deg/s", "gyro=1", "adis99999", "nan deg/s")),
    *of(WV, "--time", values=("when", "99", "-1", "time,time,time", "")),
    *of(WV, "--time-unit", values=("fortnight", "", "m")),
    *of(WV, "--clock", values=("when", "99")),
    *of(WV, "--gaps", values=("close", "", "NAN ")),
    *of(WV, "--format", values=("sensors", "", "xsens", "novatel", "kf-gins")),
    *of(WV, "--columns", values=("gyro_w", "99", "-1", "1,1", "", "time")),
    *of(WV, "--names", values=("a", "a,b,c", "a,a", "mag=m", "gyro_x=accel_x", "")),
    *of(WV, "--delimiter", values=("::", "", "|")),
    *of(WV, "--header", values=("-1", "99999", "1.5", "two")),
    *of(WV, "--variable", values=("data",)),
    *of(WV, "--max-bytes", values=("-1", "much", "0", "")),
    *of(WV, "--level", values=("0", "1", "95", "nan", "-0.5", "high")),
    *of(WV, "--method", values=("cwt", "")),
    *of(WV, "--levels", values=("0", "-1", "40", "999999999999", "two")),
    *of(WV, "--robust", "--efficiency", values=("0", "2", "-1", "nan")),
    *of(WV, "--json", values=("kitti", "good.csv", "/proc/self/x.json", "good.csv/x.json")),
    *of(WV, "--json", values=("/nowhere/x.json", "../elsewhere/deeper/x.json")),
    *of(WV, "--plot", values=("x.bmp", "x", "/nowhere/x.png", "good.csv/x.png")),
    (*WV, "--json", "x.png", "--plot", "x.png"),
    (*WV, "--colour", "red"),
    (*WV, "good.npz"),
    ("wv",),
    ("wave", "good.csv"),
    *of(FIT, "--model", values=(
        "", "+", "WN +", "XY", "WN + XY", "WN WN", "0*GM", "-1*GM", "1.5*GM", "999999999999*GM", "GM(beta=",
        "GM(beta=-1)", "GM(beta=nan, variance=1)", "GM(gamma=1)", "WN(sigma2=one)", "ARMA(99999,1)", "ARMA(0,0)",
        "ARMA(-1,1)", "WN + WN", "6*GM + WN", "(((((WN)))))", "WN; import os", "WN" * 5000, "AR(2.5)", "☃",
    )),
    *of(FIT, "--model", "WN", "--weights", values=("best", "", "Default")),
    *of(FIT, "--model", "WN", "--bootstrap", values=("-1", "1.5", "99999999999999")),
    *of(FIT, "--model", "WN", "--seed", values=("x", "1.5")),
    *of(FIT, "--model", "WN", "--datasheet", values=("N", "N=", "N=5", "X=5 deg/h", "N=-5 deg/sqrt(h)", "N=5 m")),
    *of(FIT, "--model", "WN", "--export", values=("kalibr", "kalibr=", "gtsam2=x", "=x", "kalibr=kitti")),
    *of(FIT, "--model", "WN", "--export", "px4=x.txt", "--step", values=("0", "-1", "nan", "1e-9")),
    *of(FIT, "--model", "WN", "--export", "px4=x.txt", "--interval", values=("0", "-1", "nan")),
    FIT,
    *of(SELECT, "--model", values=("WN", "2*WN", "", "9*GM", "WN + XY")),
    (*SELECT, "--model", "WN", "--model", "WN"),
    (*SELECT, "--model", "WN + RW", "--bootstrap", "-3"),
    UNITS,
    (*UNITS, "1"),
    (*UNITS, "1", "deg/h"),
    (*UNITS, "1", "deg/h", "g"),
    (*UNITS, "one", "deg/h", "rad/s"),
    (*UNITS, "1", "☃", "rad/s"),
    (*UNITS, "1", "deg/h", "rad/s", "4"),
    *of(UNITS, "--rate", "100", "--model", values=("WN", "WN(sigma2=-1)", "WN(sigma2=1", "GM(beta=0, variance=1)", "")),
    *of(UNITS, "--model", "WN(sigma2=1)", "--rate", values=("0", "-1", "nan", "inf")),
    (*UNITS, "--model", "WN(sigma2=1)"),
    (*UNITS, "--model", "WN(sigma2=1)", "--rate", "1", "--signal", "deg/s"),
    *of(UNITS, "--rate", "100", "--datasheet", values=("", "N", "N=1", "Q=1 deg/h", "N=1 deg/sqrt(h), K=1 m/s")),
    (*SIMULATE, "mti-h", "--out", "x.npz"),
    (*SIMULATE, "mti-g"),
    *of(SIMULATE, "mti-g", "--out", "x.npz", "--samples", values=("0", "-1", "1", "1e3", "99999999999999")),
    *of(SIMULATE, "mti-g", "--samples", "100", "--out", values=("x.csv", "kitti", "/nowhere/x.npz", "good.csv/x.npz")),
    ("data", "fetch", "nothing"),
    ("data", "fetch", "../../etc/passwd"),
    *of(("demo",), "--samples", values=("0", "1", "-5", "99999999999999")),
    *of(("demo",), "--samples", "1000", "--out", values=("good.csv", "/nowhere/out", "good.csv/out", "/proc/self/out")),
]  # fmt: skip


@pytest.mark.parametrize(
    "arguments", OPTIONS, ids=lambda a: " ".join(a)[:80].encode("ascii", "backslashreplace").decode()
)
def test_a_bad_option(folder, arguments):
    before = sorted(p.name for p in folder.iterdir())
    assert_refused(app, arguments)
    assert sorted(p.name for p in folder.iterdir()) == before  # nothing is left behind
