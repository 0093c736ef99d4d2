"""Figures, tables and files of the room are those of the library."""

import csv
import io
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from nav.synthetic import make_runs

import nav_jax as nj
from nav_jax.app.web import figures, files, steps, tables
from nav_jax.app.web.state import NavigationState
from nav_jax.app.web.study import config_of_text, tables_of, toml_of
from nav_jax.simulation.comparison import Comparison
from nav_jax.simulation.stopping import Stopped, rule_of

STATE = NavigationState(
    nav_truth="text", nav_accel="WN(sigma2=1e-4)", nav_gyro="WN(sigma2=1e-6)", nav_rate="20", nav_motion="circle",
    nav_circle_duration="4", nav_aiding="gnss_position", nav_gnss_position_outages="[[2, 4]]", nav_run_every="1",
    nav_own_accel="WN(sigma2=1e-6)", nav_own_gyro="WN(sigma2=1e-8)", nav_run_num_runs="4",
)  # fmt: skip


@pytest.fixture(scope="module")
def text():
    return toml_of(tables_of(STATE, {}))


@pytest.fixture(scope="module")
def analysis(text):
    config = config_of_text(text)
    return nj.analyse(config.scenario, config.truth, config.filters)


@pytest.fixture(scope="module")
def runs():
    models = {"right": make_runs(num_runs=12), "sure": make_runs("sure", 12, inflation=3.0, noise=2)}
    return Comparison(nj.motions.circle(duration=100.0, rate=1.0), models)


def curves(figure):
    return {trace.name: trace for trace in figure.data if trace.name}


def test_the_analysis_is_drawn_and_tabulated_as_it_is(analysis):
    table = tables.analysis(analysis)
    k = analysis["right"].epoch()
    assert {row[0] for row in table.rows} == {"right", "own"}
    for row in table.rows:
        of = analysis[row[0]]
        assert row[1] == of.rms("position")[k]
        assert row[3] == np.rad2deg(of.rms("attitude")[k])
    for columns in (1, 2):
        figure = figures.analysis(analysis, columns=columns)
        drawn = curves(figure)
        assert {"right", "right, as claimed", "own", "own, as claimed", "outage"} <= set(drawn)
        position = next(t for t in figure.data if t.name == "own, as claimed")
        assert np.allclose(np.asarray(position.y, float), analysis["own"].rms_claimed("position"), equal_nan=True)
    assert "RMS position error" in figure.layout.meta["alt"]


def test_runs_are_drawn_and_ranked(runs):
    table = tables.comparison(runs)
    assert [row[0] for row in table.rows] == [one.model for one in runs.table()]
    assert [row[1] for row in table.rows] == [one.verdict for one in runs.table()]
    assert "12 common runs;" in table.text
    drawn = curves(figures.comparison(runs))
    assert {"right", "sure", "consistent"} <= set(drawn)
    for figure in (figures.errors(runs["right"]), figures.sensor_states(runs["right"])):
        assert len(figure.data) > 10
    assert figures.trajectory(runs.reference).layout.yaxis.scaleanchor == "x"


@pytest.mark.slow
def test_steps_of_the_tutorial():
    said, table = steps.compared()
    assert said.startswith("Printed: [66 %, 74 %] about 70 %")
    right, wrong = ({row[0]: row for row in table.rows}[name] for name in ("right", "own"))
    assert right[1] == pytest.approx(right[2])
    assert right[5] == pytest.approx(1.0)
    assert wrong[1] > wrong[2]
    assert wrong[6] < 0.8 < right[6]
    (switches,) = steps.left_out()
    alone, *more = (row[1] for row in switches.rows)
    assert all(with_it > alone for with_it in more)
    assert [row[3] for row in switches.rows] == pytest.approx([1.0] * len(steps.NAMED))


def test_cancelled_runs_are_said_to_be_fewer():
    cut = Comparison(nj.motions.circle(duration=100.0, rate=1.0), {"right": make_runs(num_runs=5, num_requested=40)})
    assert "5 common runs of 40 that were asked for" in tables.comparison(cut).text


def test_runs_that_end_early_say_why(runs):
    stopped = Stopped(rule_of("significant", len(runs.runs)), (12,), 40, True, runs.table().time)
    text = tables.comparison(replace(runs, stopped=stopped)).text
    assert "12 of at most 40 runs" in text
    assert "biased away from zero" in text


def test_files_of_runs_are_what_is_shown(analysis, runs, text, monkeypatch):
    monkeypatch.setattr(files, "FORMATS", ())  # figures are those of the reports
    made = files.downloads(files.Parts(text, analysis, runs))
    assert json.loads(made["comparison.json"])["num_common"] == 12
    assert made["comparison.csv"].decode().count("\n") == 4
    assert b"config.compare()" in made["navigation.py"]


@pytest.mark.slow
def test_files_are_what_is_shown_and_the_program_gives_it_again(analysis, text, tmp_path):
    made = files.downloads(files.Parts(text, analysis))
    assert made["comparison.toml"].decode() == text
    rows = list(csv.reader(io.StringIO(made["analysis.csv"].decode())))
    assert float(rows[2][1]) == pytest.approx(tables.analysis(analysis).rows[0][1], rel=1e-12)
    for name, start in (("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")):
        assert made[f"analysis.{name}"].startswith(start)
    (tmp_path / "navigation.py").write_text(files.python(text, runs=False))
    done = subprocess.run([sys.executable, "navigation.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == repr(analysis).strip()
    assert (tmp_path / "comparison.toml").read_text() == text
    assert files.commands(several=True).startswith("nav-jax compare comparison.toml")
