"""The demonstration: what it prints and writes."""

import json

from typer.testing import CliRunner

from gmwm_jax.app.cli import app
from gmwm_jax.recordings import datasets


def call(*arguments, code=0):
    """Run a command; the result's stdout and stderr are separate."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200", "TERM": "dumb"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


MAGIC = {".png": b"\x89PNG\r\n\x1a\n", ".pdf": b"%PDF-", ".svg": b"<?xml"}


def test_demo(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    stdout = call("demo", "--samples", "4096", "--out", tmp_path / "out").stdout
    assert "Recording 'simulated mti-g': 4096 samples at 100 Hz" in stdout
    assert "Simulated truth against estimate, datasheet units" in stdout
    files = {p.name: p for p in (tmp_path / "out").iterdir()}
    assert sorted(files) == [
        "allan_deviation.png", "fit_accel_x.png", "fit_all_channels.png", "fit_gyro_x.png", "noise_model.json",
        "noise_model.txt", "noise_model_wn.json", "noise_model_wn_gm.json", "recording.png",
    ]  # fmt: skip
    for name, path in files.items():
        if name.endswith(".png"):
            assert path.read_bytes().startswith(MAGIC[".png"])
        assert name in stdout
    content = json.loads(files["noise_model.json"].read_text())
    assert [one["channel"] for one in content] == list(datasets.sensor_models("mti-g"))
    assert files["noise_model.txt"].read_text().count("Datasheet units") == 6
    for name, model in {"noise_model_wn.json": "WN", "noise_model_wn_gm.json": "WN + GM"}.items():
        assert [one["model"] for one in json.loads(files[name].read_text())] == [model] * 6
