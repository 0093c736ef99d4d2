"""The Python file and the commands do again what was done, in an empty folder."""

import ast
import json
import runpy
import shlex

import jax
import numpy as np
import pytest
from programs import MEDIUM, RATE, TRUTH, fitted
from typer.testing import CliRunner

import gmwm_jax as gj
from gmwm_jax.app.cli import app
from gmwm_jax.app.web import script
from gmwm_jax.app.web.script import Analysis, OwnFile, Public, Published, Simulated

HOSTILE = "-a'); import os; os.remove('x') # \n.npy"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder, in which programs run."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_the_file_and_the_command_give_the_same_numbers(folder, capsys):
    np.save(folder / "static.npy", np.asarray(gj.simulate(TRUTH, MEDIUM, key=jax.random.key(5))))
    own = OwnFile("static.npy", {"rate": RATE, "units": "1", "time": None})
    analysis = Analysis(own, ("channel_0",), "WN + GM", weights="two-step")
    (folder / "analysis.py").write_text(script.python(analysis))
    runpy.run_path(str(folder / "analysis.py"))
    assert "GMWM fit of WN + GM to channel_0" in capsys.readouterr().out
    (by_file,) = json.loads((folder / "fit.json").read_text())
    (folder / "fit.json").unlink()
    result = CliRunner().invoke(app, shlex.split(script.command(analysis))[1:])
    assert result.exit_code == 0, result.output
    (by_command,) = json.loads((folder / "fit.json").read_text())
    expected = [e.value for e in fitted().parameters()]
    for found in (by_file, by_command):
        assert found["objective"] == pytest.approx(fitted().objective, rel=1e-9)
        assert [e["value"] for e in found["parameters"]] == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_published_variances_need_no_file(folder):
    (folder / "analysis.py").write_text(script.python(Analysis(Published("mti-g"), ("gyro_x",), "WN + RW")))
    runpy.run_path(str(folder / "analysis.py"))
    (found,) = json.loads((folder / "fit.json").read_text())
    assert found["objective"] == pytest.approx(537.8544, rel=1e-6)


ANALYSES = [
    Analysis(Simulated("mti-g", 5000, 3), ("gyro_x", "accel_x"), "WN + RW", masked=True, efficiency=0.6, level=0.9),
    Analysis(Public("adis_16405_imu1"), ("gyro_x",), "WN", bootstrap=200, route="records", superset="WN + RW"),
    Analysis(OwnFile(HOSTILE, {"rate": 1.0, "units": {HOSTILE: "deg/s"}}), (HOSTILE,), "WN", exports=("px4", "gtsam")),
]


@pytest.mark.parametrize("analysis", ANALYSES)
def test_every_choice_is_written(analysis):
    """As calls with these arguments and no others; a name is a text, whatever is in it."""
    calls = [ast.unparse(n) for n in ast.walk(ast.parse(script.python(analysis))) if isinstance(n, ast.Call)]
    written = "\n".join(calls)
    assert repr(analysis.model) in written
    assert ("mask_outliers" in written) == analysis.masked
    assert ("efficiency" in written) == (analysis.efficiency is not None)
    assert ("gj.bootstrap" in written) == bool(analysis.bootstrap)
    assert ("gj.select" in written) == bool(analysis.superset)
    assert written.count("export_of") == len(analysis.exports)
    assert not [c for c in calls if c.startswith("os.")]


def test_the_commands_are_those_of_the_shell():
    own = OwnFile(HOSTILE, {"rate": 10.0, "units": {"gyro": "deg/s"}, "columns": [0, 1], "header": None})
    line = script.command(Analysis(own, ("a", "b"), "WN + RW", bootstrap=500, weights="two-step"))
    assert shlex.split(line) == [
        *("gmwm-jax", "fit", f"./{HOSTILE}", "--rate", "10.0", "--units", "gyro=deg/s", "--columns", "0,1"),
        *("--channels", "a,b", "--model", "WN + RW", "--weights", "two-step", "--bootstrap", "500", "--seed", "0"),
        *("--json", "fit.json"),
    ]
    simulated, fit, select = script.command(
        Analysis(Simulated("mti-g", 5000, 3), ("gyro_x",), "WN", efficiency=0.7, level=0.9, superset="WN + RW")
    ).splitlines()
    assert simulated == "gmwm-jax data simulate mti-g --samples 5000 --seed 3 --out mti-g.npz"
    assert "--robust --efficiency 0.7" in fit
    assert "--level 0.9" in select


def test_what_cannot_be_written_is_said():
    for analysis, complaint in (
        (Analysis(Published("mti-g"), ("gyro_x",), "WN", efficiency=0.6), "no samples"),
        (Analysis(Published("mti-g"), (), "WN"), "no channel"),
    ):
        with pytest.raises(ValueError, match=complaint):
            script.python(analysis)
    for analysis in (Analysis(Published("mti-g"), ("gyro_x",), "WN"), *ANALYSES[:2]):
        with pytest.raises(ValueError, match="command line does not know"):
            script.command(analysis)
