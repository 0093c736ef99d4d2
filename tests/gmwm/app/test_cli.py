"""The command line: tables, JSON, figures, and one clear line for every bad input.

Fits compile for each model: all but two tests share one.
"""

import gzip
import importlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import rich.text
import typer
from typer.testing import CliRunner

import gmwm_jax as gj
from gmwm_jax import __main__
from gmwm_jax._internal import limits
from gmwm_jax.app.cli import app
from gmwm_jax.app.options import Source, _as_options
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.exports.registry import FORMATS
from gmwm_jax.fitting.result import Status
from gmwm_jax.fitting.weights import NAMED
from gmwm_jax.recordings import datasets
from gmwm_jax.recordings.files import read_recording, save_recording
from gmwm_jax.variance.wavelet import wavelet_variance

MODEL = "WN + RW"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Somebody works where the files are, and folders below are made."""
    monkeypatch.chdir(tmp_path)


def call(*arguments, code=0):
    """Run a command; the result's stdout and stderr are separate."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


@pytest.fixture(scope="module")
def rec():
    return datasets.simulated("mti-g", 3000, channels=["gyro_x", "gyro_y", "accel_x"])


@pytest.fixture(scope="module")
def npz(rec, tmp_path_factory):
    return save_recording(rec, tmp_path_factory.mktemp("cli") / "rec.npz")


@pytest.fixture(scope="module")
def csv(rec, tmp_path_factory):
    """In other units, with a column of time."""
    path = tmp_path_factory.mktemp("cli") / "rec.csv"
    table = np.column_stack([rec.time() * 1.0, np.rad2deg(rec["gyro"].data), rec.column("accel_x") / 9.80665])
    np.savetxt(path, table, delimiter=",", header="time,gyro_x,gyro_y,accel_x", comments="", fmt="%.17g")
    return path


@pytest.fixture(scope="module")
def wv(rec):
    return wavelet_variance(rec)


# wv


def test_wv_prints_the_table(npz, wv):
    assert call("wv", npz).stdout == f"{wv}\n"


def test_wv_of_a_text_file_in_other_units(csv, wv):
    stdout = call("wv", csv, "--unit", "gyro=deg/s,accel=g", "--time", "time", "--json", "-").stdout
    content = json.loads(stdout)
    assert content["rate"] == pytest.approx(100.0, rel=1e-9, abs=0)
    assert content["num_samples"] == 3000
    np.testing.assert_array_equal(content["scales"], wv.scales)
    for name, one in wv.items():
        of = content["channels"][name]
        assert of["unit"] == one.units[0]
        for key in ("variance", "ci_low", "ci_high"):
            np.testing.assert_allclose(of[key], getattr(one, key), rtol=1e-9)


def test_the_options_of_the_reader(rec, tmp_path):
    """Counts in two groups, milliseconds in the name, a sample that is missing; what was understood is said."""
    counts = np.round(rec.data / [1e-5, 1e-5, 1e-4]).astype(int)
    rows = [f"{10 * k};{a};{b};{c};ok\n" for k, (a, b, c) in enumerate(counts.tolist()) if k != 7]
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(("t_ms;gx;gy;az;state\n" + "".join(rows)).encode("utf-16")))
    options = ("wv", path, "--time", "t_ms", "--scale", "gyro=1e-5 rad/s,accel=1e-4 m/s^2")
    refused = call(*options, code=2).stderr
    assert "1 samples are missing in 1 gaps" in refused
    assert "--gaps nan puts NaN" in refused
    assert "--gaps longest takes the longest run" in refused
    names = ("--channels", "az,gx", "--names", "az=accel_z,gx=roll", "--gaps", "nan", "--json", "-")
    result = call(*options, *names)
    assert list(json.loads(result.stdout)["channels"]) == ["accel_z", "roll"]
    understood = result.stderr.splitlines()
    assert understood[0].startswith("Read as a table: 100 Hz by the column of time 't_ms' [ms], 1 missing in 1 gaps")
    assert [line.split() for line in understood[3:5]] == [
        ["accel_z", "az", "1e-4", "m/s^2"], ["roll", "gx", "1e-5", "rad/s"],
    ]  # fmt: skip
    assert understood[5:] == ["Left out, no numbers: state.", "1 missing samples became NaN."]


def test_columns_time_unit_delimiter_and_level(rec, wv, tmp_path):
    """A file without names: number, time in ms, and what is picked, separated by bars."""
    gyro = np.rad2deg(rec["gyro"].data)
    table = np.column_stack([np.arange(3000), rec.time() * 1000, gyro])
    np.savetxt(tmp_path / "rec.txt", table, delimiter="|", fmt="%.17g")
    reading = ("--unit", "deg/s", "--time", "1", "--time-unit", "ms", "--columns", "2, 3", "--delimiter", "|")
    content = json.loads(call("wv", tmp_path / "rec.txt", *reading, "--level", "0.5", "--json", "-").stdout)
    assert content["rate"] == pytest.approx(100.0, rel=1e-9, abs=0)
    assert content["level"] == 0.5
    for (one, half), name in zip(content["channels"].items(), ("gyro_x", "gyro_y"), strict=True):
        np.testing.assert_allclose(half["variance"], wv[name].variance, rtol=1e-9, err_msg=one)
        assert np.all(np.array(half["ci_high"]) < wv[name].ci_high)
    arguments = ("fit", tmp_path / "rec.txt", *reading, "--model", "WN", "--json", "-")
    wide, narrow = (json.loads(call(*arguments, "--level", level).stdout)[0] for level in (0.95, 0.5))
    np.testing.assert_allclose(narrow["variance"], wv["gyro_x"].variance, rtol=1e-9)
    assert narrow["parameters"][0]["ci_high"] < wide["parameters"][0]["ci_high"]


@pytest.mark.parametrize(
    ("asked", "got"),
    [
        ("all", ["gyro_x", "gyro_y", "accel_x"]),
        ("gyro", ["gyro_x", "gyro_y"]),
        ("accel_x", ["accel_x"]),
        ("accel, gyro_y", ["accel_x", "gyro_y"]),
    ],
)
def test_channels(npz, asked, got):
    content = json.loads(call("wv", npz, "--channels", asked, "--json", "-").stdout)
    assert list(content["channels"]) == got


def test_wv_options(npz, rec):
    content = json.loads(call("wv", npz, "--method", "dwt", "--levels", "5", "--json", "-").stdout)
    dwt = wavelet_variance(rec["gyro_x"], method="dwt", num_levels=5)
    np.testing.assert_allclose(content["channels"]["gyro_x"]["variance"], dwt.variance, rtol=1e-15)


def test_allan(npz):
    stdout = call("wv", npz, "--allan").stdout
    assert stdout.startswith("Overlapping Allan deviation at 100 Hz")
    assert stdout.count("Read off the Allan deviation (IEEE 952)") == 3
    assert "deg/sqrt(h)" in stdout
    one = json.loads(call("wv", npz, "--allan", "--json", "-").stdout)["channels"]["gyro_x"]
    si, shown = (one[key][0] for key in ("read_off", "read_off_datasheet"))
    assert (si["unit"], shown["unit"]) == ("rad/s/sqrt(Hz)", "deg/sqrt(h)")
    assert shown["value"] == pytest.approx(np.rad2deg(si["value"]) * 60, rel=1e-12)


@pytest.mark.parametrize(
    ("option", "of", "title"),
    [
        ("--modified-allan", gj.variance.modified_allan_deviation, "Overlapping modified Allan deviation"),
        ("--hadamard", gj.variance.hadamard_deviation, "Overlapping Hadamard deviation"),
    ],
)
def test_deviations_of_the_phase(npz, rec, option, of, title):
    assert call("wv", npz, option).stdout.startswith(f"{title} at 100 Hz")
    content = json.loads(call("wv", npz, option, "--level", "0.9", "--json", "-").stdout)
    expected = of(rec, level=0.9)
    assert content["deviation"] == expected.kind
    np.testing.assert_allclose(content["times"], expected.times, rtol=1e-15)
    for name, one in content["channels"].items():
        np.testing.assert_allclose(one["deviation"], expected[name].deviation, rtol=1e-15)
        np.testing.assert_allclose(one["nominal_high"], expected[name].ci_high, rtol=1e-15)
        assert one["unit"] == expected[name].units[0]
    assert list(content["channels"]) == list(rec.channels)


def test_one_deviation_at_a_time(npz):
    assert "--allan and --hadamard are two results" in call("wv", npz, "--allan", "--hadamard", code=2).stderr
    stderr = call("wv", npz, "--hadamard", "--robust", "--levels", 5, code=2).stderr
    assert "takes no --levels or --robust" in stderr


MAGIC = {".png": b"\x89PNG\r\n\x1a\n", ".pdf": b"%PDF-", ".svg": b"<?xml"}


@pytest.mark.slow
@pytest.mark.parametrize("suffix", MAGIC)
@pytest.mark.parametrize("allan", [[], ["--allan"], ["--modified-allan"], ["--hadamard"]])
def test_wv_figures(npz, tmp_path, suffix, allan):
    call("wv", npz, *allan, "--plot", tmp_path / "new" / f"a{suffix}")
    assert (tmp_path / "new" / f"a{suffix}").read_bytes().startswith(MAGIC[suffix])


# fit


def test_fit_prints_each_channel_and_all_together(npz):
    stdout = call("fit", npz, "--model", MODEL).stdout
    for name in ("gyro_x [rad/s]", "gyro_y [rad/s]", "accel_x [m/s^2]"):
        assert f"GMWM fit of WN + RW to {name}, 3000 samples at 100 Hz" in stdout
    for title in ("Parameters per sample", "Continuous time, SI (at 100 Hz)", "Datasheet units (at 100 Hz)"):
        assert stdout.count(title) == 3
    assert "GMWM fits, parameters per sample" in stdout
    assert "deg/sqrt(h)" in stdout
    assert "ug/sqrt(Hz)" in stdout


@pytest.mark.slow
def test_fit_to_json_and_figure(npz, tmp_path, wv):
    arguments = ["fit", npz, "--model", MODEL, "--datasheet", "N=0.05 deg/s/sqrt(Hz)"]
    printed = call(*arguments, "--json", tmp_path / "f.json", "--plot", tmp_path / "f.png").stdout
    assert printed.startswith("GMWM fit of")
    assert (tmp_path / "f.png").read_bytes().startswith(MAGIC[".png"])
    written = json.loads((tmp_path / "f.json").read_text())
    assert written == json.loads(call(*arguments, "--json", "-").stdout)
    assert [one["channel"] for one in written] == ["gyro_x", "gyro_y", "accel_x"]
    one = written[0]
    assert (one["model"], one["unit"], one["rate"], one["num_samples"]) == ("WN + RW", "rad/s", 100.0, 3000)
    np.testing.assert_allclose(one["variance"], wv["gyro_x"].variance, rtol=1e-15)
    np.testing.assert_allclose(np.sum([*one["components"].values()], axis=0), one["fitted"], rtol=1e-12)
    assert [p["kind"] for p in one["processes"]] == ["WN", "RW"]
    sigma2 = one["parameters"][0]
    assert one["processes"][0]["sigma2"] == sigma2["value"]
    assert (sigma2["symbol"], sigma2["component"]) == ("sigma2", "WN")
    N = next(e for e in one["datasheet"] if e["symbol"] == "N")
    assert N["unit"] == "deg/sqrt(h)"
    assert N["value"] == pytest.approx(np.rad2deg(np.sqrt(sigma2["value"] / 100)) * 60, rel=1e-12, abs=0)


def test_fit_of_one_channel(npz):
    content = json.loads(call("fit", npz, "--channels", "accel_x", "--model", "WN", "--json", "-").stdout)
    assert [one["channel"] for one in content] == ["accel_x"]


@pytest.mark.slow
def test_fit_with_replicates_and_without_outliers(npz, tmp_path):
    arguments = ("fit", npz, "--channels", "accel_x", "--model", MODEL, "--weights", "two-step", "--robust")
    done = call(*arguments, "--bootstrap", "250", "--seed", "3", "--json", "-", "--plot", tmp_path / "f.png")
    one = json.loads(done.stdout)[0]
    assert (one["weights"], one["efficiency"]) == ("two-step", 0.6)
    assert one["bootstrap"]["num_replicates"] == 250
    assert one["bootstrap"]["parameters"][0]["ci_low"] < one["parameters"][0]["value"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["f.png", "f_bootstrap_accel_x.png"]
    again = json.loads(call(*arguments, "--bootstrap", "250", "--seed", "3", "--json", "-").stdout)[0]
    assert again == one
    other = json.loads(call(*arguments, "--bootstrap", "250", "--seed", "4", "--json", "-").stdout)[0]
    assert other["bootstrap"]["parameters"] != one["bootstrap"]["parameters"]


def test_wv_without_outliers(npz, rec):
    content = json.loads(call("wv", npz, "--robust", "--efficiency", "0.9", "--json", "-").stdout)
    robust = wavelet_variance(rec["gyro_x"], efficiency=0.9)
    np.testing.assert_allclose(content["channels"]["gyro_x"]["variance"], robust.variance, rtol=1e-12)


def test_fit_exports(npz, tmp_path, wv):
    """The files are those of the library; the screen takes one, too."""
    arguments = ["fit", npz, "--model", MODEL]
    kalibr, px4 = tmp_path / "imu.yaml", tmp_path / "ekf2.params"
    stdout = call(*arguments, "--export", f"kalibr={kalibr}", "--export", f"px4={px4}", "--export", "vins=-").stdout
    fits = fit(wv, MODEL)
    assert kalibr.read_text() == fits.export("kalibr")
    assert px4.read_text() == fits.export("px4")
    assert fits.export("vins") in stdout
    assert "White noise and bias of a filter with a step of 0.01 s" in stdout
    call(*arguments, "--export", f"kalibr={kalibr}", "--step", "0.02", "--interval", "1")
    assert kalibr.read_text() == fits.export("kalibr", step=0.02, interval=1.0)
    call(*arguments, "--channels", "gyro_x", "--export", f"ros={kalibr}")
    assert "angular_velocity_covariance" in kalibr.read_text()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--export", "matlab=a"], "There is no format 'matlab' to export to; there are kalibr, openvins"),
        (["--export", "kalibr"], "Cannot read --export kalibr: expected --export kalibr=FILE"),
        (["--export", "kalibr={source}"], "would be written over"),
        (["--export", "kalibr=a", "--export", "vins=a"], "a would be written twice"),
        (["--export", "gtsam=-"], "There are gyro_x, gyro_y"),
        (["--export", "ros=-", "--step", "0.001"], "--step is 0.001 s, and the samples of the model are 0.01 s apart"),
        (["--export", "kalibr=-", "--channels", "gyro"], "of accelerometers there are none: there is gyro_x, gyro_y"),
    ],
)
def test_exports_that_do_not_suit(npz, options, message):
    before = npz.read_bytes()
    result = call("fit", npz, "--model", MODEL, *(o.format(source=npz) for o in options), code=2)
    assert message in result.stderr
    assert npz.read_bytes() == before


# select


def test_select(npz, tmp_path):
    done = call(
        "select",
        npz,
        "--channels",
        "gyro",
        "--model",
        MODEL,
        "--json",
        tmp_path / "s.json",
        "--plot",
        tmp_path / "s.png",
    )
    assert done.stdout.count("Model selection for gyro_") == 2
    assert "Model selections, of 3 models each" in done.stdout
    one = json.loads((tmp_path / "s.json").read_text())[0]
    assert {c["name"] for c in one["candidates"]} == {"WN", "RW", "WN + RW"}
    assert one["recommended"] in {"WN", "WN + RW"}
    assert one["fit"]["objective"] == next(c for c in one["candidates"] if c["name"] == one["recommended"])["objective"]
    assert (tmp_path / "s.png").read_bytes().startswith(MAGIC[".png"])
    listed = call("select", npz, "--channels", "gyro_x", "--model", "WN", "--model", "RW", "--weights", "default")
    assert "2 models within WN + RW, default weights" in listed.stdout


def test_a_search_that_did_not_converge_is_told(npz, wv, monkeypatch):
    stalled = replace(gj.fit(wv["gyro_x"], MODEL), status=Status.stalled)
    monkeypatch.setattr(gj, "fit", lambda *arguments, **options: stalled)
    assert "Warning: gyro_x: stopped at the step limit" in call("fit", npz, "--model", MODEL).stderr


@pytest.mark.slow
def test_a_public_file_needs_no_option(shared, tmp_path):
    file = shared / "data" / "adis_16405_imu1.rda"
    stdout = call("fit", file, "--channels", "all", "--model", "WN + 2*GM + RW", "--json", tmp_path / "a.json").stdout
    assert stdout.count("1000000 samples at 100 Hz") == 6
    written = json.loads((tmp_path / "a.json").read_text())
    assert [(one["channel"], one["unit"], one["rate"]) for one in written] == [
        (f"{sensor}_{axis}", unit, 100.0) for sensor, unit in (("gyro", "rad/s"), ("accel", "m/s^2")) for axis in "xyz"
    ]
    assert all(one["status"] == "converged" for one in written)


def test_public_data_by_name(shared, monkeypatch):
    monkeypatch.setenv("GMWM_JAX_DATA", str(shared / "data"))
    content = json.loads(call("wv", "cont.imu1", "--json", "-").stdout)
    assert content["num_samples"] == 500_000
    assert call("data", "fetch", "cont.imu1").stdout == f"{shared / 'data' / 'cont.imu1.rda'}\n"


# units


def test_units_of_a_number():
    assert call("units", "0.15", "deg/sqrt(h)", "rad/s/sqrt(Hz)").stdout == (
        "0.15 deg/sqrt(h) = 4.36332313e-05 rad/s/sqrt(Hz)\n"
    )


def test_units_of_a_model():
    stdout = call("units", "--model", "WN(sigma2=1e-4) + GM(beta=0.01, variance=1e-6)", "--rate", "100").stdout
    tables = [[cell for cell in line.split("  ") if cell.strip()] for line in stdout.splitlines()]
    rows = {(row[0].strip(), row[1].strip()): row for row in tables if len(row) > 2}
    assert float(rows["WN", "q"][2]) == 1e-6
    assert float(rows["GM", "beta"][2]) == 1.0
    assert float(rows["GM", "tau_c"][2]) == 1.0
    assert float(rows["WN", "N"][2]) == pytest.approx(1e-3 * 180 / np.pi * 60, rel=1e-4, abs=0)
    assert "(rad/s)^2/Hz" in stdout
    accel = call("units", "--model", "WN(sigma2=1e-4)", "--rate", "100", "--signal", "m/s^2").stdout
    assert "(m/s^2)^2/Hz" in accel


def test_units_as_json():
    assert json.loads(call("units", "1", "deg", "rad", "--json", "-").stdout) == {"value": np.pi / 180, "unit": "rad"}
    content = json.loads(call("units", "--model", "WN(sigma2=1e-4)", "--rate", "100", "--json", "-").stdout)
    assert (content["model"], content["rate"]) == ("WN(sigma2=0.0001)", 100.0)
    assert content["continuous"][0]["value"] == pytest.approx(1e-6, rel=1e-12, abs=0)


def test_units_of_a_datasheet():
    stdout = call("units", "--datasheet", "N=0.15 deg/sqrt(h), K=2 deg/h/sqrt(h)", "--rate", "400").stdout
    sigma2 = (0.15 * np.pi / 180 / 60) ** 2 * 400
    assert stdout.startswith(f"WN(sigma2={sigma2:.6g}) + RW(")
    assert "per sample at 400 Hz" in stdout
    assert "m/s^2" in call("units", "--datasheet", "N=50 ug/sqrt(Hz)", "--rate", "100").stdout


# data, demo


def test_data_list():
    lines = call("data", "list").stdout.splitlines()
    assert [line.split()[0] for line in lines] == [*datasets.names(), *datasets.sensors()]
    content = json.loads(call("data", "list", "--json", "-").stdout)
    assert [known["name"] for known in content["recordings"]] == list(datasets.names())
    assert list(content["simulated"]) == list(datasets.sensors())


def test_data_simulate(tmp_path):
    stdout = call("data", "simulate", "ln200", "--samples", "500", "--seed", "3", "--out", tmp_path / "l.npz").stdout
    rec = read_recording(tmp_path / "l.npz")
    assert stdout == f"{replace(rec, understood=None)}\n{tmp_path / 'l.npz'}\n"
    assert (rec.data.shape, rec.rate, rec.name) == ((500, 6), 400.0, "simulated ln200")
    call("data", "simulate", "ln200", "--samples", "500", "--seed", "4", "--out", tmp_path / "m.npz")
    assert not np.any(read_recording(tmp_path / "m.npz").data == rec.data)


# Bad input


@pytest.fixture
def bad(tmp_path, rec):
    """Files with one fault each."""
    x = rec.data.copy()
    np.save(tmp_path / "bare.npy", x)
    x[17, 1] = np.nan
    np.save(tmp_path / "nan.npy", x)
    return tmp_path


STATED = ("--rate", "100", "--unit", "rad/s")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("wv", "{npz}", "--channels", "mag"), "no channel or group 'mag'; the channels are: gyro_x, gyro_y, accel_x"),
        (("wv", "{npz}", "--method", "cwt"), "method must be 'modwt' or 'dwt', and is 'cwt'"),
        (("wv", "{npz}", "--levels", "40"), "40"),
        (("wv", "{npz}", "--rate", "50"), "Wrong rate"),
        (("wv", "{bad}/bare.npy", "--unit", "rad/s"), "sampling rate is missing"),
        (
            ("wv", "{bad}/bare.npy", "--rate", "100"),
            'missing: give --units, one unit or as in "gyro=deg/s,accel=g". It',
        ),
        (("wv", "{bad}/bare.npy", "--rate", "100", "--unit", "deg/w"), "Unknown unit 'deg/w'. Known ones near it"),
        (("wv", "{bad}/bare.npy", "--rate", "100", "--unit", "gyro=deg/s,g"), "Cannot read 'g': expected name=value"),
        (("wv", "{bad}/bare.npy", "--time", "0", "--unit", "rad/s"), "Time does not increase"),
        (
            ("wv", "{bad}/nan.npy", *STATED),
            ". If they are missing samples, --gaps nan takes them for such, and --gaps",
        ),
        (("wv", "{bad}/none.csv", *STATED), "There is no file"),
        (("wv", "{npz}", "--level", "95"), "level lies between 0 and 1"),
        (("wv", "{npz}", "--columns", "gyro_w"), "There is no column 'gyro_w'"),
        (("fit", "{npz}", "--model", "WN + XY"), "Unknown process 'XY' in the model 'WN + XY'. Known: WN, QN, RW"),
        (("fit", "{npz}", "--model", "6*GM + WN"), "13 free parameters and the wavelet variance 10 scales"),
        (("fit", "{npz}", "--model", MODEL, "--datasheet", "N=5"), "'5' has no unit"),
        (("fit", "{npz}", "--model", MODEL, "--datasheet", "X=5 deg/h"), "Unknown datasheet entry 'X'"),
        (("fit", "{bad}/nan.npy", *STATED, "--model", MODEL), "(nan) at index 17"),
        (
            ("fit", "{npz}", "--model", MODEL, "--weights", "best"),
            "--weights is default, two-step, covariance, iterated",
        ),
        (("fit", "{npz}", "--model", MODEL, "--robust", "--efficiency", "2"), "efficiency"),
        (("fit", "{npz}", "--model", MODEL, "--bootstrap", "-1"), "--bootstrap must be"),
        (("select", "{npz}", "--model", "WN"), "nothing to choose from"),
        (("select", "{npz}", "--model", "2*WN"), "cannot be told apart"),
        (("units",), "Give a number with two units, or --model, or --datasheet"),
        (("units", "1", "deg/h"), "from one unit to another"),
        (("units", "1", "deg/h", "g"), "deg/h measures rad/s and g measures m/s^2"),
        (("units", "--model", "WN(sigma2=1)"), "sampling rate is missing"),
        (("units", "--model", "WN(sigma2=1)", "--rate", "1", "--signal", "deg/s"), "--signal is rad/s, m/s^2 or 1"),
        (("units", "--model", "WN(sigma2=1)", "--rate", "1", "--signal", "m/s"), "--signal is rad/s, m/s^2 or 1"),
        (("units", "--model", "WN", "--rate", "1"), "WN has no value for sigma2"),
        (("units", "--model", "WN(sigma2=-1)", "--rate", "1"), "sigma2 must be one number in [0, inf), and is -1"),
        (("units", "--model", "WN(sigma2=1)", "--rate", "0"), "positive number of Hz"),
        (("data", "fetch", "nothing"), "There is no data set 'nothing'"),
        (("data", "simulate", "mti-h", "--out", "{bad}/a.npz"), "There is no sensor 'mti-h'; there are: mti-g"),
        (("data", "simulate", "mti-g", "--out", "{bad}/a.csv", "--samples", "100"), "Recordings are saved as .npz"),
        (
            ("data", "simulate", "mti-g", "--out", "{bad}/a.npz", "--samples", "0"),
            "integer of 1 or more, and is 0",
        ),
        (("demo", "--samples", "1", "--out", "{bad}/out"), "one sample"),
        (("demo", "--samples", "1", "--out", "{bad}/bare.npy"), "a file, and a folder is needed"),
        (("wv", "{bad}", *STATED), "is a folder, not a file"),
        (("wv", "{bad}/bare.npy", "--unit", "1"), "give --rate in Hz, or --time to name"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(bad, npz, arguments, message):
    result = call(*(a.format(bad=bad, npz=npz) for a in arguments), code=2)
    understood, _, error = result.stderr.partition("Error: ")
    assert understood == "" or understood.startswith("Read as ")  # what was understood before it
    assert message in error
    assert "Traceback" not in result.stderr
    assert result.stdout == ""


def test_a_target_that_is_a_folder_is_named(npz, tmp_path):
    assert "is a folder, and a file is to be written" in call("wv", npz, "--json", tmp_path, code=2).stderr


def test_allan_as_json(npz, wv):
    content = json.loads(call("wv", npz, "--allan", "--json", "-").stdout)
    one = content["channels"]["gyro_x"]
    np.testing.assert_allclose(one["deviation"], np.sqrt(2 * wv["gyro_x"].variance), rtol=1e-14)
    assert [e["symbol"] for e in one["read_off"]] == ["N", "B", "K"]
    assert content["times"][0] == 0.01


@pytest.mark.parametrize(
    "arguments", [("fit", "{npz}"), ("wv",), ("wv", "{npz}", "--rate", "fast"), ("wv", "{npz}", "--plot", "a.bmp")]
)
def test_bad_use_shows_how_to_use_it(npz, arguments):
    result = call(*(a.format(npz=npz) for a in arguments), code=2)
    assert "Usage" in result.stderr
    assert result.stdout == ""


# python -m gmwm_jax


@pytest.mark.slow
def test_the_command_turns_64_bits_on_itself():
    """In a process of its own, where no test has done so."""
    code = "import sys; sys.argv[1:] = ['units', '--model', 'WN(sigma2=1e-4)', '--rate', '100']; "
    code += "from gmwm_jax.__main__ import main; main()"
    environment = {k: v for k, v in os.environ.items() if k != "JAX_ENABLE_X64"}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=120)
    assert run.returncode == 0, run.stderr
    assert "Continuous time, SI (at 100 Hz)" in run.stdout


@pytest.mark.parametrize("command", ["gmwm_jax", "nav_jax"])
def test_help_is_there_at_once(command):
    """JAX, NumPy and what reads files are imported by no page of help."""
    program = (
        f"import sys; sys.argv[1:] = sys.argv[1].split(); from {command}.__main__ import main\n"
        "try: main()\n"
        "finally: print([m for m in ('jax', 'numpy', 'matplotlib') if m in sys.modules])"
    )
    pages = [
        "--help",
        "--version",
        *{"gmwm_jax": ["fit --help", "data simulate --help"], "nav_jax": ["design --help"]}[command],
    ]
    for page in pages:
        run = subprocess.run([sys.executable, "-c", program, page], capture_output=True, text=True, timeout=60)
        assert (run.returncode, run.stderr) == (0, "")
        assert run.stdout.splitlines()[-1] == "[]"
    assert (
        f"{command.replace('_', '-')} {gj.__version__}"
        in subprocess.run(
            [sys.executable, "-m", command, "--version"], capture_output=True, text=True, timeout=60
        ).stdout
    )


def test_help_names_what_there_is():
    """The tables of formats and weights are not loaded for help, which says their names."""
    pages = [re.sub(r"[│\s]+", " ", CliRunner().invoke(app, [name, "--help"]).stdout) for name in ("fit", "select")]
    assert all(re.search(rf"[ :]{name}[,;]", pages[0]) for name in FORMATS)
    assert all(name in page for page in pages for name in NAMED)


@pytest.mark.parametrize("command", ["gmwm_jax", "nav_jax"])
def test_no_word_of_help_is_taken_for_markup(command):
    """Text in square brackets would be missing from the page."""
    cli = importlib.import_module(f"{command}.app.cli")
    main = typer.main.get_command(cli.app)
    commands = [main, *main.commands.values()]
    commands += [c for group in commands[1:] for c in getattr(group, "commands", {}).values()]
    assert len(commands) > 8
    for c in commands:
        for text in (c.help, *(getattr(p, "help", None) for p in c.params)):
            assert rich.text.Text.from_markup(text or "").plain == (text or "")


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "typer", None)
    with pytest.raises(SystemExit, match=r'needs the package typer: pip install "gmwm-jax\[app\]"'):
        __main__.main()


def test_an_error_of_the_package_itself_is_not_hidden(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmwm_jax.app.options", None)
    monkeypatch.delitem(sys.modules, "gmwm_jax.app.cli")
    monkeypatch.setattr("signal.signal", lambda *_: None)  # interrupts are for pytest
    with pytest.raises(ModuleNotFoundError, match=r"gmwm_jax\.app\.options"):
        __main__.main()


# outputs onto inputs


@pytest.mark.parametrize("command", [("wv",), ("fit", "--model", MODEL), ("select", "--model", MODEL)])
@pytest.mark.parametrize("link", [False, True])
def test_the_input_is_never_written_over(tmp_path, monkeypatch, npz, command, link):
    """By its name or by a link, and before it is read."""
    source = tmp_path / "rec.npz"
    source.write_bytes(npz.read_bytes())
    target = tmp_path / "out.json" if link else source
    if link:
        target.symlink_to(source)
    monkeypatch.setattr(gj, "read_recording", lambda *a, **k: pytest.fail("It was read."))
    result = call(command[0], source, *command[1:], "--json", target, code=2)
    assert "would be written over" in result.stderr
    assert source.read_bytes() == npz.read_bytes()


def test_two_outputs_are_two_files(tmp_path, npz):
    out = tmp_path / "a.png"
    assert "would be written twice" in call("wv", npz, "--json", out, "--plot", out, code=2).stderr
    assert not out.exists()


def test_options_of_reading_reach_the_reader(tmp_path, rec):
    """Those of text files, and of archives of several objects."""
    text = "Logger 7\nx;y\nu;v\n" + "".join(f"{a!r};{b!r}\n" for a, b in rec.data[:, :2].tolist())
    (tmp_path / "a.txt").write_text(text)
    options = ("--rate", 100, "--unit", "rad/s", "--json", "-", "--levels", 3)
    by_text = json.loads(call("wv", tmp_path / "a.txt", "--header", 3, *options).stdout)
    np.savez(tmp_path / "a.npz", a=rec.data[:, :2], b=rec.data)
    by_name = json.loads(call("wv", tmp_path / "a.npz", "--variable", "a", *options).stdout)
    assert [c["variance"] for c in by_text["channels"].values()] == [
        c["variance"] for c in by_name["channels"].values()
    ]


def test_how_far_a_file_may_unfold_is_an_option(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "FREE", 100_000)
    np.savez_compressed(tmp_path / "a.npz", x=np.append(np.zeros(100_000), 1.0))
    with pytest.raises(ValueError, match=r'max_bytes="801kB" reads it') as refused:
        Source(tmp_path / "a.npz", rate=1.0, units="rad/s").read()
    assert "--max-bytes 801kB reads it" in _as_options(str(refused.value))
    assert len(Source(tmp_path / "a.npz", rate=1.0, units="rad/s", max_bytes="801kB").read().data) == 100_001
