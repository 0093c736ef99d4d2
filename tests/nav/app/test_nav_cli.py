"""The command line: tables, JSON, figures and results of a configuration, the demonstration, and one line for errors.

Filters compile for each model: all tests share one small configuration and its two filters.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from nav.synthetic import make_runs, with_failures
from typer.testing import CliRunner

import nav_jax as nj
from nav_jax import __main__
from nav_jax.app import cli, comparison_file, demo, reports
from nav_jax.app.cli import app
from nav_jax.app.comparison_file import Config, read_config
from nav_jax.imu.imu import perfect_imu
from nav_jax.simulation.comparison import Comparison
from nav_jax.trajectory import motions
from nav_jax.trajectory.trajectory import Trajectory

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
[filters.optimist]
accel = "WN(sigma2=1e-6)"
gyro = "WN(sigma2=1e-8)"
rate = "20 Hz"

[[aiding]]
type = "gnss_position"
horizontal = "1 m"
vertical = "2 m"
outages = [[2, 4]]

[initial]
position_sd = "1 m"
velocity_sd = "0.1 m/s"
attitude_sd = "1 deg"

[run]
num_runs = 6
"""
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    """Somebody works where the files are, and folders below are made."""
    monkeypatch.chdir(tmp_path)


def call(*arguments, code=0):
    """Run a command; the result's stdout and stderr are separate."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """What the configuration gives, without the command line."""
    path = tmp_path_factory.mktemp("nav_cli") / "a.toml"
    path.write_text(TEXT)
    return read_config(path).compare()


@pytest.fixture
def no_filter_runs(monkeypatch, known):
    """The comparison is there already: for tests of what is done with it."""

    def compare(self, *, num_runs=None, seed=None, only=(), stop=None, progress=False):
        return Comparison(known.reference, {n: r for n, r in known.runs.items() if not only or n in only}, known.truth)

    monkeypatch.setattr(Config, "compare", compare)


# run, compare


@pytest.mark.slow
def test_compare_prints_the_table_and_writes_nothing(config, known, tmp_path):
    """The only test that computes: the same numbers as without the command line."""
    result = call("compare", config)
    assert result.stdout == f"{known!r}\n"
    assert list(tmp_path.iterdir()) == [config]


def test_num_runs_and_seed(config, monkeypatch, known):
    asked = []
    monkeypatch.setattr(Config, "compare", lambda self, **named: asked.append(named) or known)
    call("compare", config, "--num-runs", 9, "--seed", 5, "--stop", "anytime")
    call("run", config, "--filter", "right", "--num-runs", 8)
    assert asked == [
        {"num_runs": 9, "seed": 5, "stop": "anytime", "progress": True},
        {"num_runs": 8, "seed": None, "only": ["right"], "progress": True},
    ]


def test_run_shows_one_filter(config, known, no_filter_runs):
    stdout = call("run", config, "--filter", "optimist").stdout
    assert repr(known["optimist"]) in stdout
    assert "right" not in stdout
    assert "mean over 6 common runs" in stdout


def test_json_to_the_screen_and_to_a_file(config, known, tmp_path, no_filter_runs):
    content = json.loads(call("compare", config, "--json", "-").stdout)
    call("compare", config, "--json", tmp_path / "new" / "a.json")
    assert content == json.loads((tmp_path / "new" / "a.json").read_text())
    table = known.table()
    assert content["time"] == table.time
    assert [one["model"] for one in content["ranking"]] == [one.model for one in table]
    assert content["ranking"][0]["mean_position"] == table[0].mean_position
    assert content["models"]["right"] == {
        "num_runs": 6, "num_requested": 6, "num_failed": 0, "outages": {"gnss_position": [[2.0, 4.0]]}, "notes": [],
    }  # fmt: skip


FIGURES = [
    "comparison.png", "trajectory.png", "mean_errors.png", "consistency.png", "innovations.png",
    *(f"{what}_{model}.png" for model in ("right", "optimist") for what in ("realisations", "errors", "sensor_states")),
]  # fmt: skip


@pytest.mark.slow
def test_a_folder_gets_tables_and_figures(config, known, tmp_path, no_filter_runs):
    stdout = call("compare", config, "--out", tmp_path / "out").stdout
    files = {p.name: p for p in (tmp_path / "out").iterdir()}
    assert sorted(files) == sorted(["comparison.txt", "comparison.json", *FIGURES])
    assert all(name in stdout for name in files)
    assert all(files[name].read_bytes().startswith(PNG) for name in FIGURES)
    text = files["comparison.txt"].read_text()
    assert text.startswith(repr(known))
    assert all(repr(r) in text for r in known.runs.values())
    assert json.loads(files["comparison.json"].read_text())["num_common"] == 6


def test_the_folder_of_the_file_and_no_plot(config, tmp_path, no_filter_runs):
    config.write_text(TEXT + '[output]\nfolder = "mine"\nplot = false\nsave = "runs.nc"\n')
    call("compare", config)
    assert sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["comparison.json", "comparison.txt"]
    assert (tmp_path / "runs.nc").exists()
    config.write_text(TEXT + '[output]\nfolder = "yours"\n')
    call("compare", config, "--no-plot")
    assert sorted(p.name for p in (tmp_path / "yours").iterdir()) == ["comparison.json", "comparison.txt"]


@pytest.mark.parametrize("suffix", [".zarr", ".nc"])
def test_saved_runs_come_back(config, known, tmp_path, no_filter_runs, suffix):
    target = tmp_path / f"runs{suffix}"
    stdout = call("compare", config, "--save", target).stdout
    assert f"Saved as {target}" in stdout
    again = Comparison.load(target)
    for name, r in known.runs.items():
        np.testing.assert_array_equal(again[name].error, r.error)


# two levels


@pytest.mark.slow
def test_two_levels_print_and_write_means(config, tmp_path):
    config.write_text(TEXT.replace("num_runs = 6", 'num_runs = 6\ngains = "two-level"'))
    expected = read_config(config).two_level()
    folder, saved = tmp_path / "out", tmp_path / "levels.nc"
    result = call("compare", config, "--out", folder, "--save", saved)
    assert result.stdout.startswith(f"{expected!r}\n")
    assert repr(nj.load(saved)) == repr(expected)
    assert sorted(p.name for p in folder.iterdir()) == ["comparison.json", "comparison.txt", "two_levels.png"]
    models = json.loads((folder / "comparison.json").read_text())["models"]
    k = expected.shared.epoch()
    assert models["optimist"]["nees"]["value"] == pytest.approx(expected.mean("optimist", "nees").value[k])
    (alone,) = json.loads(call("run", config, "--filter", "right", "--json", "-").stdout)["models"]
    assert alone == "right"


def test_two_levels_are_said_where_there_is_one(config, tmp_path):
    config.write_text(TEXT.replace("num_runs = 6", 'num_runs = 6\ngains = "two-level"'))
    stderr = call("campaign", config, "--store", tmp_path / "a.zarr", code=2).stderr
    assert "[run] gains is two-level, and a campaign has one level" in stderr
    with pytest.raises(ValueError, match="gives means and no runs to compare"):
        read_config(config).compare()
    assert "gains is two-level, which gives means" in call("compare", config, "--stop", "anytime", code=2).stderr


# runs that fail or are stopped


def a_comparison(**runs):
    reference = motions.static(10.0, 10.0)
    return Comparison(reference, {name: r for name, r in runs.items()})


def test_failed_runs_are_told(config, monkeypatch):
    failing = with_failures(name="right", failed=[1])
    monkeypatch.setattr(Config, "compare", lambda self, **named: a_comparison(right=failing))
    stderr = call("compare", config).stderr
    assert stderr.startswith("Warning: right: 40 runs, 1 failed")


def test_an_interrupted_run_writes_what_is_done(config, monkeypatch, tmp_path):
    some = make_runs(num_runs=5, num_requested=100)
    monkeypatch.setattr(Config, "compare", lambda self, **named: a_comparison(right=some))
    result = call("compare", config, "--out", tmp_path / "out", "--no-plot", code=cli.INTERRUPTED)
    assert "5 of 100 runs were done" in result.stderr
    content = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert content["models"]["right"]["num_requested"] == 100


def test_interrupted_before_anything_was_done(config, monkeypatch):
    def stopped(self, **named):
        raise KeyboardInterrupt("Interrupted before the first chunk of runs was done.")

    monkeypatch.setattr(Config, "compare", stopped)
    result = call("compare", config, code=cli.INTERRUPTED)
    assert result.stderr == "Interrupted before the first chunk of runs was done.\n"


def test_one_good_run_has_tables_and_no_figures(tmp_path):
    names = reports.comparison_report(a_comparison(right=make_runs(num_runs=1))).write(tmp_path)
    assert names == ["comparison.txt", "comparison.json"]
    content = json.loads((tmp_path / "comparison.json").read_text())
    assert (content["ranking"], content["time"], content["num_common"]) == ([], None, 0)


def test_file_names_of_models_are_plain_and_each_once():
    assert reports._file_names(["WN + 1 GM", "wn 1 gm", "Σ", "a"]) == ["wn_1_gm", "wn_1_gm_2", "model", "a"]


@pytest.mark.filterwarnings("default")
def test_a_noisy_reference_is_a_line(config, monkeypatch, known):
    """As `perfect_imu` warns, and with its advice in the words of the configuration."""

    def compare(self, **named):
        time = np.arange(101) / 20
        position = np.stack([5 * time, np.round(np.sin(time), 2), 0 * time], axis=1)
        perfect_imu(Trajectory.from_euler(time, position, 0 * position))
        return known

    monkeypatch.setattr(Config, "compare", compare)
    stderr = call("compare", config).stderr
    assert stderr.startswith("Warning: The specific force along this trajectory has noise")
    assert "Smooth them first, by smooth = 0.5 in [trajectory], or use a lower rate.\n" in stderr
    assert stderr.count("\n") == 1


# demo


@pytest.mark.slow
def test_demo(tmp_path, monkeypatch):
    """What it makes of three files of fits, with runs that are there already."""
    (tmp_path / "fits").mkdir()
    channels = [f"{s}_{axis}" for s in ("accel", "gyro") for axis in "xyz"]
    for k, name in enumerate(demo.FITS):
        white = [{"kind": "WN", "sigma2": 1e-5 * (k + 1) + 1e-7 * i} for i in range(6)]
        fits = [{"channel": c, "rate": 100.0, "processes": [w]} for c, w in zip(channels, white, strict=True)]
        (tmp_path / "fits" / name).write_text(json.dumps(fits))
    seen = []

    def compare(self, **named):
        seen.append(self)
        return a_comparison(right=make_runs(), wrong=make_runs(seed=2))

    monkeypatch.setattr(Config, "compare", compare)
    stdout = call("demo", "--fits", tmp_path / "fits", "--out", tmp_path / "out", "--num-runs", 3).stdout
    assert "Configuration, tables and figures are in" in stdout
    (config,) = seen
    reference = config.scenario.reference
    assert (config.run.num_runs, reference.duration, reference.rate) == (3, 300.0, 100.0)
    assert list(config.filters) == ["fitted model", "WN + 1 GM", "WN only"]
    assert [(s.name, s.outages) for s in config.scenario.aiding] == [
        ("gnss_position", ((260.0, 300.0),)), ("gnss_velocity", ((260.0, 300.0),)), ("barometer", ()),
    ]  # fmt: skip
    for k, name in enumerate(("fitted model", "WN only", "WN + 1 GM")):
        variances = [float(m.processes[0].sigma2) for m in config.filters[name].models]
        np.testing.assert_allclose(variances, 1e-5 * (k + 1) + 1e-7 * np.arange(6), rtol=1e-15)
    assert (tmp_path / "out" / "comparison.png").read_bytes().startswith(PNG)
    # what it leaves can be run again from anywhere
    again = read_config(tmp_path / "out" / "comparison.toml")
    assert again.output.folder == "."


def test_demo_without_fits_says_how_to_make_them(tmp_path):
    result = call("demo", "--fits", tmp_path, "--out", tmp_path, code=2)
    assert f'make the fits first, by "gmwm-jax demo --out {tmp_path}"' in result.stderr


# bad input


@pytest.mark.parametrize(
    ("by", "arguments", "message"),
    [
        ({"[run]": "[runs]"}, ["compare"], "there is no section [runs]"),
        ({'"4 s"': '"4 m"'}, ["compare"], "[trajectory], duration: '4 m' has a unit that is no s"),
        ({}, ["run"], "There are several filters (right, optimist): choose by --filter, or use compare."),
        ({}, ["run", "--filter", "left"], "There is no filter 'left'; there are right, optimist."),
        ({'right = "truth"': ""}, ["compare"], "takes two filters or more, and"),
        ({'1e-8)"\nrate = "20 Hz"': '1e-8)"\nrate = "10 Hz"'}, ["compare"], "write rate = 20 in that section"),
        ({"[[2, 4]]": "[[2, 5]]"}, ["compare"], "The outage 2 to 5 s of gnss_position lies outside the run"),
        ({}, ["compare", "--plot"], "Figures need a folder: give --out, or folder in [output]."),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, monkeypatch, by, arguments, message):
    text = TEXT
    for old, new in by.items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "a.toml"
    path.write_text(text)
    command, *rest = arguments
    result = call(command, path, *rest, code=2)
    assert result.stderr.startswith("Error: ")
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
    assert "Traceback" not in result.stderr


def test_a_file_that_is_not_there(tmp_path):
    assert "none.toml" in call("compare", tmp_path / "none.toml", code=2).stderr


@pytest.mark.parametrize(
    "arguments", [[], ["--num-runs", "0"], ["--num-runs", "many"], ["--save", "runs.csv"], ["--seed", "-1"]]
)
def test_bad_use_shows_how_to_use_it(config, arguments):
    result = call("compare", *([config, *arguments] if arguments else []), code=2)
    assert "Usage" in result.stderr
    assert result.stdout == ""


# python -m nav_jax


@pytest.mark.slow
def test_the_command_turns_64_bits_on_itself(config):
    """In a process of its own, where no test has done so; a bad option ends it after the reading, which needs them."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_ENABLE_X64"}
    command = [sys.executable, "-m", "nav_jax", "run", config, "--filter", "left"]
    run = subprocess.run(
        command, capture_output=True, text=True, env=environment, timeout=120, cwd=Path(__main__.__file__).parents[1]
    )
    assert run.returncode == 2
    assert run.stderr == "Error: There is no filter 'left'; there are right, optimist.\n"


@pytest.mark.parametrize("package", ["typer", "pydantic"])
def test_a_missing_package_is_named(monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SystemExit, match=rf'needs the package {package}: pip install "gmwm-jax\[app\]"'):
        __main__.main()


# outputs onto inputs


OVER = {
    "--json": lambda d: ("--json", d / "a.toml"),
    "link": lambda d: ("--json", d / "link"),
    "fits": lambda d: ("--json", d / "fits.json"),
    "folder": lambda d: ("--out", d),
    "save": lambda d: ("--save", d / "runs.nc"),
}


@pytest.mark.parametrize("how", OVER)
@pytest.mark.parametrize("command", ["run", "compare"])
def test_no_input_is_written_over(tmp_path, monkeypatch, command, how):
    """The configuration, and what it names; before anything of it is read."""
    named = {"folder": "comparison.json", "save": "runs.nc"}.get(how, "fits.json")
    config = tmp_path / "a.toml"
    config.write_text(TEXT + f'[filters.fitted]\nfit = "{named}"\n')
    (tmp_path / named).write_text("precious")
    (tmp_path / "link").symlink_to(config)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(comparison_file, "read_config", lambda path: pytest.fail("It was read."))
    result = call(command, config, *OVER[how](tmp_path), code=2)
    assert "would be written over" in result.stderr
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_what_the_configuration_says_of_its_output_is_looked_at(tmp_path):
    config = tmp_path / "a.toml"
    config.write_text(TEXT + '[output]\nfolder = "."\n[filters.fitted]\nfit = "comparison.json"\n')
    assert "would be written over" in call("compare", config, code=2).stderr
    config.write_text(TEXT + '[output]\nsave = "a.toml"\n')
    assert "would be written over" in call("compare", config, code=2).stderr


@pytest.mark.parametrize("command", ["design", "tune"])
def test_a_configuration_called_as_its_report(tmp_path, command):
    """The filters that are found are written as design.toml or tuning.toml."""
    config = tmp_path / {"design": "design.toml", "tune": "tuning.toml"}[command]
    config.write_text(TEXT)
    assert "would be written over" in call(command, config, "--out", tmp_path, code=2).stderr
    assert config.read_text() == TEXT
