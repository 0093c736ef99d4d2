"""Every key of two configurations with values that it cannot have, and bad options: one message each, and code 2."""

import copy
import tomllib

import numpy as np
import pytest
import tomli_w
from nav.app.test_analysis_cli import RECORD, TEXT
from refusals import assert_refused

from nav_jax.app.cli import app

WRONG = {
    "text": "3 bananas", "empty": "", "list": [], "table": {"a": 1}, "truth": True, "nan": float("nan"),
    "large": -1e300,
}  # fmt: skip
"""What no key takes, with few exceptions."""


def places(tables, at=()):
    """The place of each value, as keys and numbers."""
    for key, value in tables.items() if isinstance(tables, dict) else enumerate(tables):
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            yield from places(value, (*at, key))
        else:
            yield (*at, key)


def put(tables, place, value):
    """The tables with another value there, or without it."""
    changed = copy.deepcopy(tables)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    if value is None:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return changed


SIMULATED, RECORDED = tomllib.loads(TEXT), tomllib.loads(RECORD)


def cases(tables):
    return [
        pytest.param(place, value, id=f"{'.'.join(map(str, place))} {what}")
        for place in places(tables)
        for what, value in WRONG.items()
        if (place[-1], what) != ("outages", "list")  # there are none
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("bad_inputs")
    time, still = np.arange(200) / 20, np.zeros(200)
    imu = np.stack([time, still + 3.6, still, still, still, still, still - 1.0], axis=1)
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(where / "imu.csv", imu, delimiter=",", header=names, comments="")
    seconds = np.arange(1.0, 10.0)
    np.savez(where / "gnss.npz", time_s=seconds, east_m=2 * seconds, north_m=seconds, down_km=-1e-3 * seconds)
    (where / "baro.csv").write_text("time_ms,height_m\n1000,5\n2500,6\n")
    (where / "good.toml").write_text(TEXT)
    (where / "record.toml").write_text(RECORD)
    (where / "results").mkdir()
    return where


@pytest.fixture(autouse=True)
def in_the_folder(folder, monkeypatch):
    monkeypatch.chdir(folder)


@pytest.mark.parametrize(("place", "value"), cases(SIMULATED))
def test_a_bad_value(folder, place, value):
    (folder / "bad.toml").write_text(tomli_w.dumps(put(SIMULATED, place, value)))
    message = assert_refused(app, ["run", "bad.toml"])
    assert str(place[-1]) in message or str(place[0]) in message  # where it is


@pytest.mark.parametrize(("place", "value"), cases(RECORDED))
def test_a_bad_value_of_a_record(folder, place, value):
    (folder / "bad.toml").write_text(tomli_w.dumps(put(RECORDED, place, value)))
    message = assert_refused(app, ["tune", "bad.toml"])
    named = str(place[-1]) in message or str(place[0]) in message
    # a file that is missing is named by its path, and nothing at all is the folder
    assert named or (place == ("record", "imu") and ("3 bananas" in message or "is a folder" in message))


@pytest.mark.parametrize("place", list(places(SIMULATED)), ids=lambda place: ".".join(map(str, place)))
def test_an_unknown_key_beside_it(folder, place):
    (folder / "bad.toml").write_text(tomli_w.dumps(put(SIMULATED, (*place[:-1], f"{place[-1]}2"), 1)))
    assert_refused(app, ["run", "bad.toml"])


TOML = {
    "empty": b"",
    "no TOML": b"[trajectory\nmotion = circle",
    "zeros": bytes(3000),
    "noise": np.random.default_rng(0).bytes(3000),
    "no sections": b"duration = 4\n",
    "twice": TEXT.encode() + b"\n[truth]\nrate = 20\n",
    "deep": b"a = " + b"[" * 5000 + b"]" * 5000,
    "latin": TEXT.replace("circle", "cercl\u00e9").encode("latin-1"),
    "utf-16": TEXT.encode("utf-16"),
    "a list": b"[[trajectory]]\nmotion = 'circle'\n",
}
COMMANDS = ("run", "compare", "budget", "design", "navigate", "outages", "tune", "vibration", "inspect", "align")


@pytest.mark.parametrize("what", TOML)
@pytest.mark.parametrize("command", COMMANDS)
def test_a_bad_configuration(folder, what, command):
    (folder / "bad.toml").write_bytes(TOML[what])
    assert_refused(app, [command, "bad.toml"])


def of(command, *options, values):
    """The command with each of the values behind the options."""
    return [(*command, *options, value) for value in values]


RUN, TUNE = ("run", "good.toml"), ("tune", "record.toml")
OPTIONS = [
    *((command, file) for command in COMMANDS
      for file in ("none.toml", "no/where.toml", "results", "imu.csv", "gnss.npz", "a\nb.toml")),
    *((command,) for command in COMMANDS if command != "outages"),
    ("compare", "good.toml"),
    *of(RUN, "--filter", values=("left", "", "1")),
    *of(RUN, "--num-runs", values=("0", "-1", "many", "1.5", "99999999999999")),
    *of(RUN, "--seed", values=("-1", "x", "1.5")),
    *of(RUN, "--out", values=("good.toml", "/nowhere/out", "good.toml/out", "/proc/self/out", "../elsewhere/deeper")),
    *of(RUN, "--json", values=("good.toml", "results", "/nowhere/x.json", "good.toml/x.json", "/proc/self/x.json")),
    *of(RUN, "--save", values=("x.csv", "x", "/nowhere/x.nc", "good.toml/x.zarr")),
    (*RUN, "--plot"),
    (*RUN, "--colour", "red"),
    (*RUN, "record.toml"),
    ("run", "record.toml"),
    ("navigate", "good.toml"),
    *of(("design", "good.toml"), "--max-accel", values=("-1", "1000", "999999999999", "two")),
    *of(("design", "good.toml"), "--max-gyro", values=("-1", "1000")),
    *of(("design", "good.toml"), "--max-states", values=("-1", "x")),
    *of(("design", "good.toml"), "--objective", values=("beauty", "")),
    *of(("design", "good.toml"), "--confirm", values=("0", "1", "99999999999999")),
    *of(TUNE, "--hold", values=("gyro colour", "")),
    *of(TUNE, "--prior", values=("0", "-1", "nan", "x")),
    *of(TUNE, "--max-steps", values=("0", "-1", "x")),
    *of(("navigate", "record.toml"), "--save", values=("x.bmp", "x", "/nowhere/x.npz", "record.toml/x.npz")),
    *of(("navigate", "record.toml"), "--export", values=("x.bmp", "x", "/nowhere/x.csv", "x.kml")),
    *of(("inspect", "record.toml"), "--most-offset", values=("0", "-1", "nan", "x")),
    ("inspect", "record.toml", "--plot"),
    *of(("outages", "record.toml"), "--last", values=("0", "-1", "nan", "x", "1e9")),
    *of(("outages", "record.toml"), "--every", values=("0", "-1", "5")),
    *of(("outages", "record.toml"), "--runs", values=("0", "x")),
    *of(("vibration", "record.toml"), "--window", values=("0", "-1", "nan", "x")),
    ("demo", "--fits", "results"),
    ("demo", "--fits", "none"),
    ("demo", "--num-runs", "1"),
    ("fly", "good.toml"),
]  # fmt: skip


@pytest.mark.parametrize("arguments", OPTIONS, ids=lambda a: " ".join(a)[:80].replace("\n", " "))
def test_a_bad_option(folder, arguments):
    before = sorted(p.name for p in folder.iterdir())
    assert_refused(app, arguments)
    assert sorted(p.name for p in folder.iterdir()) == before
