"""The README is true: its Python runs, its commands print what it shows, its table has every process."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from gmwm_jax.app.cli import app
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.recordings import datasets
from nav_jax.app.cli import app as nav_app
from nav_jax.app.comparison_file import read_config

pytestmark = pytest.mark.usefixtures("quick_compilation")

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to run in, with the text file that the README speaks of."""
    rec = datasets.simulated("mti-g", 500, channels=["gyro_x", "accel_x"])
    table = np.column_stack([rec.time(), np.rad2deg(rec.column("gyro_x")), rec.column("accel_x") / 9.80665])
    np.savetxt(tmp_path / "static.csv", table, delimiter=",", header="time,gyro_x,accel_x", comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_python(folder):
    """All blocks in order, in one namespace."""
    python = blocks("python")
    assert len(python) >= 3
    namespace = {}
    for block in python:
        exec(compile(block, "README.md", "exec"), namespace)
    assert namespace["rec"].channels == ("gyro_x", "accel_x")
    assert (folder / "accel_x.png").stat().st_size > 0


def close(shown, printed):
    """The same words; numbers to three digits, the last of which differ between machines."""
    shown, printed = shown.split(), printed.split()
    return len(shown) == len(printed) and all(map(same, shown, printed))


def same(shown, printed):
    try:
        return float(printed) == pytest.approx(float(shown), rel=2e-3, abs=0)
    except ValueError:
        return shown == printed


def test_commands(folder):
    """What a console block shows is printed, line by line and in order; at `...` lines are left out."""
    commands = [part for block in blocks("console") for part in block.split("$ gmwm-jax ")[1:]]
    assert len(commands) >= 4
    for command in commands:
        line, *shown = command.strip().splitlines()
        result = CliRunner().invoke(app, shlex.split(line))
        assert result.exit_code == 0, result.output
        printed = iter(result.stdout.splitlines())
        for expected in shown:
            if expected.strip() not in ("", "..."):
                assert any(close(expected, seen) for seen in printed), expected
    assert (folder / "fit.png").exists()


def test_shell_blocks_use_options_that_exist():
    for line in (line for block in blocks("sh") for line in block.splitlines() if line.startswith("gmwm-jax")):
        command, *rest = shlex.split(line)[1:]
        usage = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"}).output
        for option in (word for word in rest if word.startswith("--")):
            assert option in usage


def test_nav_jax_shell_lines_use_options_that_exist():
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("nav-jax")]
    assert len(lines) >= 2
    for line in lines:
        command, *rest = shlex.split(line)[1:]
        usage = CliRunner().invoke(nav_app, [command, "--help"], env={"COLUMNS": "200"}).output
        for option in (word for word in rest if word.startswith("--")):
            assert option in usage


def test_configuration(folder):
    """The TOML that is shown says what it seems to."""
    shown = next(b for b in blocks("toml") if "[trajectory]" in b)
    path = folder / "comparison.toml"
    path.write_text(shown)
    comparison = read_config(path).compare(num_runs=2)
    assert list(comparison.runs) == ["right", "WN only"]
    assert comparison["right"].outages == {"gnss_position": ((260.0, 300.0),)}
    assert comparison.reference.duration == 300.0


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"make (\w+)", " ".join([*blocks("sh"), *re.findall(r"`(make \w+)`", README)])):
        assert f"\n{target}:" in makefile


def test_the_table_has_every_process():
    rows = {row.split("|")[1].strip(): row for row in README.splitlines() if row.startswith("| `")}
    for kind, cls in PROCESSES.items():
        for parameter in cls.parameters:
            assert f"`{parameter.name}`" in rows[f"`{kind}`"]


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(((?!https?:)[^)]+)\)", README):
        assert (ROOT / target).exists(), target
