"""The README and the tours at the heads of the rooms are true: Python runs, commands print what is shown.

The tours suppose the imports of the examples in docstrings, see test_examples.py.
"""

import importlib
import re
import shlex
from pathlib import Path

import jax
import jax.numpy as jnp
import matplotlib.image
import numpy as np
import pytest
from typer.testing import CliRunner

import gmwm_jax
import nav_jax
from gmwm_jax.app.cli import app
from gmwm_jax.processes.registry import PROCESSES
from gmwm_jax.recordings import datasets
from nav_jax.app.cli import app as nav_app
from nav_jax.app.comparison_file import read_config
from nav_jax.trajectory.files import to_geodetic

pytestmark = pytest.mark.usefixtures("quick_compilation")

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()
ROOMS = {
    f"{package}.{path.parent.name}": importlib.import_module(f"{package}.{path.parent.name}").__doc__ or ""
    for package in ("gmwm_jax", "nav_jax")
    for path in sorted((ROOT / package).glob("*/__init__.py"))
}
"""Room -> its docstring."""

SHELL = README + ROOMS["gmwm_jax.app"] + ROOMS["nav_jax.app"]


def blocks(language, text=README):
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


TOURS = [room for room, text in ROOMS.items() if blocks("python", text)]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to run in, with the text file that the README and the room of recordings speak of."""
    rec = datasets.simulated("mti-g", 500, channels=["gyro_x", "accel_x"])
    table = np.column_stack([rec.time(), np.rad2deg(rec.column("gyro_x")), rec.column("accel_x") / 9.80665])
    np.savetxt(tmp_path / "static.csv", table, delimiter=",", header="time,gyro_x,accel_x", comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(sources, name, namespace):
    for source in sources:
        exec(compile(source, name, "exec"), namespace)
    return namespace


def write_drive(folder):
    """Two minutes along a lemniscate on WGS-84: the IMU has white noise and biases, the receiver errors of 5 cm."""
    earth, rng = nav_jax.Wgs84((np.deg2rad(46.5), np.deg2rad(6.6), 400.0)), np.random.default_rng(5)
    exact, truth = nav_jax.perfect_imu(nav_jax.motions.lemniscate(duration=120.0, rate=50.0), earth=earth)
    errors = rng.normal(size=(len(exact), 6)) * np.repeat([2e-3, 0.015], 3) + np.repeat([0.003, 0.1], 3)
    samples = np.column_stack(
        [exact.time, np.rad2deg(exact.gyro + errors[:, :3]), (exact.accel + errors[:, 3:]) / 9.80665]
    )
    names = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt(folder / "imu.csv", samples, "%.9f", delimiter=",", header=names, comments="")
    second = slice(50, None, 50)
    there = to_geodetic(truth, np.asarray(earth.origin))[second] + 0.05 * rng.normal(size=(120, 3)) / [
        6.4e6,
        4.4e6,
        1.0,
    ]
    speed = truth.velocity[second] + 0.05 * rng.normal(size=(120, 3))
    fixes = np.column_stack([truth.time[second], np.rad2deg(there[:, :2]), there[:, 2], speed])
    names = "time,lat_deg,lon_deg,height,vn,ve,vd"
    np.savetxt(folder / "fixes.csv", fixes, "%.10f", delimiter=",", header=names, comments="")


def test_python(folder):
    """All blocks in order, in one namespace; the figures that are shown are those that it makes."""
    python = blocks("python")
    assert len(python) == 3
    write_drive(folder)
    namespace = run(python, "README.md", {})
    assert namespace["rec"].channels == ("gyro_x", "accel_x")
    for made, shown in (("accel_x.png", "fit.png"), ("comparison.png", "comparison.png")):
        assert f'src="notebooks/{shown}"' in README
        new, stored = (matplotlib.image.imread(path)[:, :, :3] for path in (folder / made, ROOT / "notebooks" / shown))
        assert new.shape == stored.shape
        assert np.mean(np.abs(new - stored)) < 0.05, "make it again by the code of the README"
    # biases that were added are found: 0.1 m/s^2 on the vertical axis, and 3 mrad/s of roll and pitch
    assert namespace["start"].accel_bias[2] == pytest.approx(0.1, abs=0.01)
    np.testing.assert_allclose(namespace["start"].gyro_bias[:2], 0.003, atol=1e-3)


def test_there_are_tours():
    assert {"gmwm_jax.processes", "gmwm_jax.inference", "gmwm_jax.multisignal", "nav_jax.filter"} <= set(TOURS)
    assert len(TOURS) >= 9


@pytest.mark.parametrize("room", TOURS)
def test_tour(room, folder):
    """All blocks of a room in order, in one namespace."""
    names = {"gj": gmwm_jax, "nj": nav_jax, "np": np, "jax": jax, "jnp": jnp}
    run(blocks("python", ROOMS[room]), room, names)


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
    commands = [part for block in blocks("console", SHELL) for part in block.split("$ gmwm-jax ")[1:]]
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


def shell_lines(program):
    return [line for block in blocks("sh", SHELL) for line in block.splitlines() if line.startswith(program)]


@pytest.mark.parametrize(("program", "cli", "least"), [("gmwm-jax", app, 5), ("nav-jax", nav_app, 4)])
def test_shell_blocks_use_options_that_exist(program, cli, least):
    lines = shell_lines(program)
    assert len(lines) >= least
    for line in lines:
        command, *rest = shlex.split(line)[1:]
        usage = CliRunner().invoke(cli, [command, "--help"], env={"COLUMNS": "200"}).output
        for option in (word for word in rest if word.startswith("--")):
            assert option in usage


def test_configuration(folder):
    """The TOML that is shown says what it seems to."""
    shown = next(b for b in blocks("toml", ROOMS["nav_jax.app"]) if "[trajectory]" in b)
    path = folder / "comparison.toml"
    path.write_text(shown)
    comparison = read_config(path).compare(num_runs=2)
    assert list(comparison.runs) == ["right", "WN only"]
    assert comparison["right"].outages == {"gnss_position": ((260.0, 300.0),)}
    assert comparison.reference.duration == 300.0


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    shown = re.findall(r"make (\w+)", " ".join([*blocks("sh"), *re.findall(r"`(make \w+)`", README)]))
    assert {"demo", "test", "validate", "check", "docs"} <= set(shown)
    for target in shown:
        assert f"\n{target}:" in makefile


def test_the_table_has_every_process():
    rows = {row.split("|")[1].strip(): row for row in ROOMS["gmwm_jax.processes"].splitlines() if row.startswith("| `")}
    for kind, cls in PROCESSES.items():
        for parameter in cls.parameters:
            assert f"`{parameter.name}`" in rows[f"`{kind}`"]


def test_the_tables_have_every_room():
    for room in ROOMS:
        name = room.split(".")[1]
        assert name.startswith("_") or f"`{name}`" in README, room


def test_links_lead_somewhere():
    targets = [*re.findall(r"\]\(((?!https?:)[^)]+)\)", README), *re.findall(r'src="([^"]+)"', README)]
    assert len(targets) > 15
    for target in targets:
        assert (ROOT / target).exists(), target
