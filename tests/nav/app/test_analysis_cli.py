"""The commands budget, design and tune: what they print and write, and one line for errors.

Filters compile for each model: two tests compute, along one small configuration; all others have results already.
"""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from nav.synthetic import make_runs
from nav.synthetic_analysis import (
    make_analysis,
    make_budget,
    make_design,
    make_noise_in_motion,
    make_sensitivities,
    make_tuning,
)
from typer.testing import CliRunner

import nav_jax as nj
from nav_jax.app import cli
from nav_jax.app import record_file as config_record
from nav_jax.app.comparison_file import Config, read_config
from nav_jax.app.record_file import read_record
from nav_jax.app.reports import filter_section
from nav_jax.app.sections import ModelErrors
from nav_jax.lincov.filter_design import OBJECTIVES
from nav_jax.trajectory import motions
from nav_jax.trajectory.maps import MAPS

TEXT = """
[trajectory]
motion = "circle"
duration = "4 s"

[truth]
accel = "WN(sigma2=1e-4)"
gyro = "WN(sigma2=1e-6)"
rate = "20 Hz"

[filters]
right = "truth"

[[aiding]]
type = "gnss_position"
horizontal = "1 m"
vertical = "2 m"
outages = [[1.5, 3.5]]

[initial]
position_sd = "1 m"
velocity_sd = "0.1 m/s"
attitude_sd = "1 deg"
"""

RECORD = """
[record]
imu = "imu.csv"
units = { gyro = "deg/s", accel = "g" }
velocity = ["36 km/h", 0, 0]
attitude = [0, 0, "90 deg"]

[filters.static]
accel = "WN(sigma2=1e-4)"
gyro = "WN(sigma2=1e-6)"
rate = "20 Hz"

[filters.other]
accel = "WN(sigma2=1e-3)"
gyro = "WN(sigma2=1e-5)"
rate = "20 Hz"

[[aiding]]
type = "gnss_position"
file = "gnss.npz"
horizontal = "1 m"
vertical = "2 m"
outages = [[3, 4]]

[[aiding]]
type = "barometer"
file = "baro.csv"
height = "0.5 m"

[initial]
attitude_sd = "1 deg"

[run]
every = 5
"""
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Somebody works where the files are, and folders below are made."""
    monkeypatch.chdir(tmp_path)


def call(*arguments, code=0):
    """Run a command; the result's stdout and stderr are separate."""
    result = CliRunner().invoke(cli.app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(TEXT)
    return path


@pytest.fixture
def record(tmp_path):
    """Ten seconds at rest, heading east, in other units than SI."""
    time, still = np.arange(200) / 20, np.zeros(200)
    imu = np.stack([time, still + 3.6, still, still, still, still, still - 1.0], axis=1)
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(tmp_path / "imu.csv", imu, delimiter=",", header=names, comments="")
    seconds = np.arange(1.0, 10.0)
    np.savez(tmp_path / "gnss.npz", time_s=seconds, east_m=2 * seconds, north_m=seconds, down_km=-1e-3 * seconds)
    (tmp_path / "baro.csv").write_text("time_ms,height_m\n1000,5\n2500,6\n")
    path = tmp_path / "record.toml"
    path.write_text(RECORD)
    return path


def answers(monkeypatch, **results):
    """Let functions of the command line return what is there already; returns what they are asked."""
    asked = {name: [] for name in results}

    def answer(name):
        return lambda *given, **named: asked[name].append((given, named)) or results[name]

    for name in results:
        monkeypatch.setattr(nj, name, answer(name))
    return asked


# budget


@pytest.mark.slow
def test_budget_computes_what_the_functions_do(config, tmp_path):
    result = call("budget", config, "--json", tmp_path / "a.json")
    known = read_config(config)
    analysis = nj.analyse(known.scenario, known.truth, known.filters)
    assert result.stdout.startswith(f"{analysis!r}\n\nright: Error budget at 3 s")
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["filters"]["right"]["position_rms"] == analysis["right"].rms("position")[2]
    assert sum(one["position"] for one in content["shares"].values()) == pytest.approx(1.0)
    assert content["rms"]["position"] == pytest.approx(content["filters"]["right"]["position_rms"])


@pytest.mark.slow
def test_budget_writes_tables_and_figures(config, tmp_path, monkeypatch):
    b, s = make_budget(), make_sensitivities()
    config.write_text(TEXT + "[filters.optimist]\nsensor = 'mti-g'\nrate = '20 Hz'\n[run]\nevery = 4\ngravity = 9.8\n")
    asked = answers(monkeypatch, analyse=make_analysis(), error_budget=b, sensitivities=s)
    stdout = call("budget", config, "--filter", "optimist", "--out", tmp_path / "out").stdout
    for name in ("error_budget", "sensitivities"):
        (((scenario, truth, believed), _),) = asked[name]
        assert (len(truth.bank().states), len(believed.bank().states)) == (0, 18)
        assert (scenario.every, scenario.earth.gravity, scenario.output_interval) == (4, 9.8, 1.0)
    files = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert sorted(files) == ["analysis.png", "budget.json", "budget.png", "budget.txt", "sensitivities.png"]
    assert all(name in stdout for name in files)
    assert all(content.startswith(PNG) for name, content in files.items() if name.endswith("png"))
    assert files["budget.txt"].decode() == f"{make_analysis()!r}\n\noptimist: {b!r}\n\noptimist: {s!r}\n"
    content = json.loads(files["budget.json"])
    assert content["time"] == 20.0
    assert content["filters"]["optimist"]["position_nees_over_dof"] == pytest.approx(4.0)
    assert content["shares"]["source 9"]["tilt"] == pytest.approx(512 / 1023)
    (second,) = [d for d in content["derivatives"] if (d["parameter"], d["of"]) == ("accel p1", "filter")]
    assert second["position"] == s.derivative["position"][19, 7]


def test_json_to_the_screen_has_no_numbers_that_are_none(config, monkeypatch):
    b = make_budget()
    b.part[:] = 0.0
    answers(monkeypatch, analyse=make_analysis(), error_budget=b, sensitivities=make_sensitivities())
    content = json.loads(call("budget", config, "--json", "-").stdout)
    assert content["shares"]["source 0"]["position"] is None


# design


@pytest.mark.slow
def test_design_computes_and_its_filter_can_be_compared(config, tmp_path):
    stdout = call("design", config, "--max-accel", 0, "--max-gyro", 0, "--max-steps", 1, "--out", tmp_path).stdout
    assert stdout.startswith("Filters designed for circle by score")
    text = (tmp_path / "design.toml").read_text()
    assert text in stdout
    config.write_text(TEXT + text)
    known = read_config(config)
    assert list(known.filters) == ["right", "designed"]
    content = json.loads((tmp_path / "design.json").read_text())
    assert content["best"] == "0 GM accel, 0 GM gyro"
    (candidate,) = content["candidates"]
    assert candidate["designed"]["filter"] == {k: v for k, v in tomllib.loads(text)["filters"]["designed"].items()}
    assert candidate["designed"]["loss"] <= candidate["truncated"]["loss"]


@pytest.mark.slow
def test_a_design_is_confirmed_on_request(config, tmp_path, monkeypatch):
    runs = {name: make_runs(name) for name in ("designed", "truncated", "right")}
    result = nj.simulation.Comparison(motions.static(10.0, 10.0), runs)
    seen = []
    monkeypatch.setattr(Config, "compare", lambda self, **named: seen.append((self.filters, named)) or result)
    d = make_design()
    asked = answers(monkeypatch, design=d)
    options = ["--objective", "error", "--max-states", 6, "--confirm", 40, "--seed", 7, "--out", tmp_path / "out"]
    stdout = call("design", config, *options).stdout
    (((scenario, _), named),) = asked["design"]
    assert (named["objective"], named["max_states"], named["max_accel"], scenario.every) == ("error", 6, 2, 1)
    assert [s.name for s in scenario.aiding] == ["gnss_position"]
    ((filters, named),) = seen
    assert filters["designed"] is d.best().errors
    assert filters["truncated"] is d.best().naive
    assert named == {"num_runs": 40, "seed": 7, "progress": True}
    assert f"Monte Carlo of the best filter\n{result!r}" in stdout
    files = {p.name for p in (tmp_path / "out").iterdir()}
    assert files == {"design.txt", "design.json", "design.toml", "design.png", "confirmed.png"}
    content = json.loads((tmp_path / "out" / "design.json").read_text())
    assert [c["pareto"] for c in content["candidates"]] == [True, True, False, True]
    assert [c["converged"] for c in content["candidates"]] == [True, True, True, False]
    assert {one["model"] for one in content["confirmed"]} == set(runs)


def test_an_interrupted_confirmation_ends_with_its_code(config, monkeypatch):
    result = nj.simulation.Comparison(
        motions.static(10.0, 10.0), {"designed": make_runs(num_runs=5, num_requested=100)}
    )
    monkeypatch.setattr(Config, "compare", lambda self, **named: result)
    answers(monkeypatch, design=make_design())
    stderr = call("design", config, "--confirm", 100, code=cli.INTERRUPTED).stderr
    assert "5 of 100 runs were done" in stderr


def test_a_filter_as_a_section_has_all_digits():
    """Also of axes that differ, of biases and of another start."""
    x, y = "WN(sigma2=0.00012345678901234567)", "AR1(phi=0.99999123456789, sigma2=1e-09) + WN(sigma2=1e-06)"
    errors = nj.ImuErrors([x, y, x], y, 50.0, accel_bias_sd=[0.1, 0.2, 0.3], start="zero")
    table = tomllib.loads(filter_section("a", errors, "a comment"))["filters"]["a"]
    again = ModelErrors.model_validate(table).build(Path())
    assert [repr(m) for m in again.models] == [repr(m) for m in errors.models]
    values = [[float(v) for p in m.processes for v in p.values] for m in (*errors.models, *again.models)]
    assert values[:6] == values[6:]
    assert (again.rate, again.start, again.biased) == (50.0, "zero", (0, 1, 2))
    np.testing.assert_array_equal(again.bias_sd, errors.bias_sd)


@pytest.mark.parametrize("name", ["plain", "WN + 1 GM", 'a "quoted" one', "back\\slash", "dotted.name", "Größe"])
def test_a_section_is_read_back_as_it_was_written(name):
    """Any name and comment, numbers to the last digit, one text for all axes or a table of them."""
    first, third = "WN(sigma2=1e-300)", "WN(sigma2=0.1) + RW(gamma2=5e-324)"
    errors = nj.ImuErrors([first, first, third], first, 1 / 0.3, gyro_bias_sd=[0.0, 2 / 3, 1e-17])
    table = tomllib.loads(filter_section(name, errors, 'of "quotes" = and [brackets]'))
    assert table == {
        "filters": {
            name: {
                "accel": {"x": first, "y": first, "z": third},
                "gyro": first,
                "rate": 1 / 0.3,
                "gyro_bias_sd": [0.0, 2 / 3, 1e-17],
            }
        }
    }


# tune


def test_tune_reads_the_record_and_starts_from_the_filter(record, tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(config_record, "tune", lambda *given, **named: seen.append((given, named)) or make_tuning())
    options = ["--filter", "other", "--tune-aiding", "--hold", "a", "--hold", "b", "--prior", 0.5, "--max-steps", 3]
    stdout = call("tune", record, *options, "--out", tmp_path / "out").stdout
    (((imu, (gnss, baro), errors), named),) = seen
    assert (imu.rate, len(imu)) == (pytest.approx(20.0), 200)
    np.testing.assert_allclose(imu.gyro[0], [np.deg2rad(3.6), 0, 0])
    np.testing.assert_allclose(imu.accel[0], [0, 0, -9.80665])
    np.testing.assert_array_equal(gnss.time, np.arange(1, 10))
    np.testing.assert_array_equal(gnss.time[~gnss.given], [3, 4])
    np.testing.assert_allclose(gnss.value, gnss.time[:, None] * [1, 2, -1])
    np.testing.assert_allclose(baro.time, [1.0, 2.5])
    np.testing.assert_allclose(baro.value, [[5], [6]])
    assert "0.001" in repr(errors)
    np.testing.assert_allclose(named["velocity"], [10, 0, 0])
    np.testing.assert_allclose(named["quaternion"], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert {k: named[k] for k in ("tune_aiding", "hold", "prior", "every", "max_steps")} == {
        "tune_aiding": True, "hold": ["a", "b"], "prior": 0.5, "every": 5, "max_steps": 3,
    }  # fmt: skip
    assert stdout.startswith(repr(make_tuning()))
    files = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert set(files) == {"tuning.txt", "tuning.json", "tuning.toml", "tuning.png"}
    content = json.loads(files["tuning.json"])
    assert content["log_likelihood_gain"] == 12.0
    assert [p["se"] for p in content["parameters"]] == [0.1, None, 0.2, None]
    assert [p["held"] for p in content["parameters"]] == [False, False, False, True]
    assert [p["sought"] for p in content["parameters"]] == [True, False, True, False]
    assert not any(p["lost"] for p in content["parameters"])
    assert content["aiding"] == {"gnss_position": {"n": 1.0, "e": 1.0, "d": 2.0}}
    assert content["filter"] == tomllib.loads(files["tuning.toml"].decode())["filters"]["tuned"]


def test_vibration_reads_the_record_and_gives_the_lines_for_it(record, tmp_path, monkeypatch):
    seen = []
    found = make_noise_in_motion()
    monkeypatch.setattr(config_record, "noise_in_motion", lambda *given, **named: seen.append((given, named)) or found)
    stdout = call("vibration", record, "--filter", "other", "--window", 0.5, "--out", tmp_path / "out").stdout
    (((imu, aiding, errors), named),) = seen
    assert (imu.rate, len(aiding)) == (pytest.approx(20.0), 2)
    assert "0.001" in repr(errors)
    assert {k: named[k] for k in ("window", "every")} == {"window": 0.5, "every": 5}
    assert stdout.startswith(f"other: {found!r}")
    files = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert set(files) == {"vibration.txt", "vibration.json", "vibration.toml", "vibration.png"}
    content = json.loads(files["vibration.json"])
    assert content["axes"][5] == {"name": "gyro z", "factor": 0.1, "ci_low": 0.05, "ci_high": 1.0, "ratio": 4.0,
                                  "p": pytest.approx(0.02275, rel=1e-3)}  # fmt: skip
    assert content["window"] == 0.25
    lines = tomllib.loads(files["vibration.toml"].decode())
    assert lines == {"run": {"vibration": {"accel": [0.1, 0.2, 0.1], "gyro": [0.0, 0.3, 0.1]}}}
    text = record.read_text().replace("[run]\n", files["vibration.toml"].decode())
    record.write_text(text)
    given = config_record.read_record(record)._noticed()["vibration"]
    assert given == nj.imu.VibrationNoise((0.1, 0.2, 0.1), (0.0, 0.3, 0.1))


def test_geodetic_fixes_in_columns_of_other_names(record, tmp_path):
    where = 'origin = ["45 deg", "7 deg", "100 m"]\n'
    text = RECORD.replace("velocity", f"{where}velocity", 1).replace('"gnss.npz"', '"gnss.csv"\nangles = "deg"')
    record.write_text(text.replace('angles = "deg"', 'angles = "deg"\ncolumns = { height = "up" }'))
    (tmp_path / "gnss.csv").write_text("time,lat,lon,up\n1,45,7,100\n2,45.001,7,90\n")
    gnss, _ = read_record(record).aiding
    np.testing.assert_allclose(gnss.value[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(gnss.value[1], [111.13, 0.0, 10.0], atol=0.05)


# bad input


CHANGES = [
    ("budget", {"[truth]": "[truths]"}, [], "there is no section [truths]"),
    ("budget", {}, ["--filter", "left"], "There is no filter 'left'; there are right."),
    ("budget", {"[[1.5, 3.5]]": "[[1.5, 5]]"}, [], "lies outside the run"),
    ("budget", {}, ["--plot"], "Figures need a folder: give --out, or folder in [output]."),
    ("budget", {"accel = \"WN(sigma2=1e-4)\"": "accel = \"FLK(sigma2=1e-4)\""}, [], "FLK"),
    ("design", {}, ["--objective", "beauty"], "The objective is one of score, error, and is 'beauty'."),
    ("tune", {'imu = "imu.csv"\n': ""}, [], "[record]: the key 'imu' is missing."),
    ("tune", {"[record]": "[records]"}, [], "there is no section [records]"),
    ("tune", {"[initial]\nattitude_sd": "[run]\nattitude_sd", "[run]\nevery = 5": ""}, [], "[initial] is missing"),
    ("tune", {'imu = "imu.csv"': 'imu = "none.csv"'}, [], "There is no file"),
    ("tune", {"units =": "# units ="}, [], 'The unit of gyro_x is not stated: give units={"gyro": ...}.'),
    ("tune", {'"deg/s"': '"deg/fortnight"'}, [], "and is 'deg/fortnight'."),
    ("tune", {'"90 deg"]': "0, 1]"}, [], "[record], attitude"),
    ("tune", {'file = "baro.csv"\n': ""}, [], "[[aiding]] 2: the key 'file' is missing."),
    ("tune", {'file = "baro.csv"': 'file = "baro.csv"\nrate = 1'}, [], "rate and first follow from the times"),
    ("tune", {'file = "baro.csv"': 'file = "imu.csv"'}, [], "[[aiding]] 2: "),
    ("tune", {'type = "barometer"': 'type = "sonar"'}, [], "type is one of gnss, gnss_position, gnss_velocity,"),
    ("tune", {"[filters.static]": "[filters]\nstatic = \"truth\"\n[filters.more]"}, [], "nobody knows the truth"),
    ("tune", {}, ["--filter", "left"], "There is no filter 'left'; there are static, other."),
    ("tune", {'1e-6)"\nrate = "20 Hz"': '1e-6)"\nrate = "10 Hz"'}, [], "write rate = 20"),
]  # fmt: skip


@pytest.mark.parametrize(("command", "by", "arguments", "message"), CHANGES)
def test_bad_input_is_one_line_and_exit_code_2(config, record, command, by, arguments, message):
    path = record if command == "tune" else config
    text = path.read_text()
    for old, new in by.items():
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    result = call(command, path, *arguments, code=2)
    assert result.stderr.startswith("Error: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr


def test_a_recording_has_no_covariance(config, tmp_path):
    samples = np.random.default_rng(0).standard_normal((200, 6))
    names = "accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z"
    np.savetxt(tmp_path / "still.csv", samples, delimiter=",", header=names, comments="")
    model = 'accel = "WN(sigma2=1e-4)"\ngyro = "WN(sigma2=1e-6)"\nrate = "20 Hz"'
    recorded = 'recording = "still.csv"\nrate = "20 Hz"\nunits = { accel = "m/s^2", gyro = "rad/s" }'
    text = TEXT.replace(model, recorded).replace('[filters]\nright = "truth"', f"[filters.right]\n{model}")
    config.write_text(text)
    for command in ("budget", "design"):
        stderr = call(command, config, code=2).stderr
        assert stderr == "Error: [truth] is a recording, and covariances follow from a model: state one.\n"


def test_help_names_what_there_is():
    page = re.sub(r"[│\s]+", " ", CliRunner().invoke(cli.app, ["design", "--help"]).stdout)
    assert f"{' or '.join(OBJECTIVES)}." in page
    assert set(cli.MAPS) == set(MAPS)
