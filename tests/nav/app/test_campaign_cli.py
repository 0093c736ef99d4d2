"""``nav-jax campaign``: a store that is made, continued and refused, by threads and by processes."""

import builtins

import pytest
from nav.app.test_nav_cli import TEXT
from nav.campaigns import files_of
from typer.testing import CliRunner

import nav_jax as nj
from nav_jax.app.cli import app
from nav_jax.campaign import tasks

pytest.importorskip("zarr")


@pytest.fixture(autouse=True)
def config(tmp_path, monkeypatch):
    """Somebody works where the files are."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.toml"
    path.write_text(TEXT + "chunk_size = 3\n")
    return path


def call(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


@pytest.mark.slow
def test_a_campaign_is_run_and_continued(config):
    stdout = call("campaign", config, "--store", "s.zarr").stdout
    study = nj.Campaign.open("s.zarr")
    assert stdout == f"{study.comparison()!r}\n"
    assert study.num_runs == 6
    before = files_of("s.zarr")
    assert "9 common runs" in call("campaign", config, "--store", "s.zarr", "--num-runs", 9).stdout
    after = files_of("s.zarr")
    assert all(content == after[name] for name, content in before.items() if "/c/" in name)
    said = call("campaign", config, "--store", "s.zarr", "--seed", 1, code=2)
    assert "s.zarr is the store of another campaign: key is 0 in the store, and 1" in said.stderr
    assert "s of CPU time" in call("campaign", config, "--store", "t.zarr", "--cost").stdout


@pytest.mark.slow
def test_the_folder_of_the_file_and_whole_chunks(config):
    config.write_text(config.read_text() + '[output]\nfolder = "results"\nplot = true\n')
    said = call("campaign", config, "--store", "s.zarr", "--num-runs", 4)
    assert "6 runs in place of 4: whole chunks of 3." in said.stderr
    figures = {"comparison.png", "trajectory.png", "statistics.png"}
    assert {p.name for p in (config.parent / "results").iterdir()} == {"comparison.txt", "comparison.json"} | figures
    said = call("campaign", config, "--store", "s.npz", code=2)
    assert "a campaign is kept in a folder *.zarr, not 's.npz'" in said.stderr


@pytest.mark.slow
def test_a_rule_of_the_file_and_one_of_the_command_line(config):
    """The file's is about a precision that any runs have; the other needs as many as there are."""
    config.write_text(config.read_text() + 'stop = {position = "1 km", least = 18}\n')
    stopped = call("campaign", config, "--store", "s.zarr", "--num-runs", 36).stdout
    assert "18 of at most 36 runs" in stopped
    assert call("campaign", config, "--store", "s.zarr", "--num-runs", 36).stdout == stopped
    assert "36 of at most 36 runs" in call("compare", config, "--num-runs", 36, "--stop", "anytime").stdout
    said = call("compare", config, "--stop", "soon", code=2)
    assert "stop is 'significant', 'anytime'" in said.stderr


@pytest.mark.slow
def test_processes_that_know_nothing(config, monkeypatch):
    """They are told neither the precision nor the campaign: both are in the task and its store."""
    monkeypatch.delenv("JAX_ENABLE_X64", raising=False)
    call("campaign", config, "--store", "s.zarr", "--workers", 1, "--num-runs", 3, "--keep", "judged")
    assert nj.Campaign.open("s.zarr").status().complete


def test_what_failed_is_told(config, monkeypatch):
    def fails(self, chunk):
        raise FloatingPointError("bad luck")

    monkeypatch.setattr(tasks.Bench, "compute", fails)
    said = call("campaign", config, "--store", "s.zarr", code=1)
    assert "scenario 0 failed: FloatingPointError: bad luck" in said.stderr


def test_engines_exclude_each_other(config, monkeypatch):
    both = call("campaign", config, "--store", "s.zarr", "--workers", 2, "--scheduler", "tcp://127.0.0.1:1", code=2)
    assert "Either --workers or --scheduler" in both.stderr
    imported = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("distributed"):
            raise ImportError(name)
        return imported(name, *args, **kwargs)

    monkeypatch.setattr("importlib.import_module", lambda name: without(name))
    missing = call("campaign", config, "--store", "s.zarr", "--scheduler", "tcp://127.0.0.1:1", code=2)
    assert 'pip install "gmwm-jax[cluster]"' in missing.stderr
