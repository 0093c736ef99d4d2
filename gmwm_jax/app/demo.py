"""The main job on a default that needs no data: simulated MTi-G recording, noise model, units, and the truth."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gmwm_jax._internal.atomic import write_atomically
from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.outputs import make_folder
from gmwm_jax._internal.text_table import format_table, number
from gmwm_jax.fitting.estimator import fit
from gmwm_jax.fitting.result import Fit
from gmwm_jax.fitting.slopes import read_off
from gmwm_jax.fitting.tables import Estimate, continuous_table
from gmwm_jax.recordings import datasets
from gmwm_jax.variance.allan import allan_deviation
from gmwm_jax.variance.wavelet import WaveletVariances, wavelet_variance

_SENSOR = "mti-g"
_MODEL = "WN + RW + 2*GM"
_SIMPLER = {"noise_model_wn.json": "WN", "noise_model_wn_gm.json": "WN + GM"}
"""What a hasty user would fit to the same wavelet variances, for a comparison of filters."""


def run_demo(out: Path, num_samples: int, say: Callable[[str], Any]) -> Channels[Fit]:
    """Simulate, estimate, compare; write figures, tables and JSON to a folder.

    Parameters
    ----------
    out
        Folder, made if it is not there.
    num_samples
        Length of the simulated recording at 100 Hz.
    say
        Receives the text for the screen.

    Returns
    -------
    Channels
        One fit a channel.
    """
    rec = datasets.simulated(_SENSOR, num_samples)
    make_folder(out)
    say(f"{rec}\n")
    wv = wavelet_variance(rec)
    assert isinstance(wv, WaveletVariances)  # of the sensor's channels
    fits = fit(wv, _MODEL, throw=False)
    gyro, accel = fits["gyro_x"], fits["accel_x"]
    say(f"{gyro}\n\n{fits}\n")
    say(f"{read_off(allan_deviation(wv['gyro_x']))}\n")
    comparison = compare_with_truth(fits)
    say(comparison)

    figures = {
        "recording.png": rec.plot(),
        "allan_deviation.png": allan_deviation(wv).plot(),
        "fit_gyro_x.png": gyro.plot(datasheet=datasets.sensor_datasheet(_SENSOR, "gyro")),
        "fit_accel_x.png": accel.plot(datasheet=datasets.sensor_datasheet(_SENSOR, "accel")),
        "fit_all_channels.png": fits.plot(),
    }
    for name, figure in figures.items():
        write_atomically(out / name, lambda file, figure=figure: figure.savefig(file, format="png", dpi=140))
    tables = "\n\n".join([*(f.summary() for f in fits.values()), repr(fits), comparison])
    write_atomically(out / "noise_model.txt", lambda file: file.write(f"{tables}\n".encode()))
    models = {"noise_model.json": fits} | {name: fit(wv, model, throw=False) for name, model in _SIMPLER.items()}
    for name, of_model in models.items():
        content = json.dumps([f.to_dict() for f in of_model.values()], indent=1, allow_nan=False)
        write_atomically(out / name, lambda file, content=content: file.write(content.encode()))
    say(f"\nFigures and tables are in {out}/: {', '.join([*figures, 'noise_model.txt', *models])}")
    return fits


def compare_with_truth(fits: Channels[Fit]) -> str:
    """Tabulate the estimates of a simulated sensor beside the values it was simulated with, in datasheet units."""
    truth = datasets.sensor_models(_SENSOR)
    rows, inside, total = [], 0, 0
    for channel, f in fits.items():
        unit = f.unit
        true_table = {
            (e.component, e.symbol): e for e in continuous_table(truth[channel], f.wv.rate or 1.0, unit, datasheet=True)
        }
        for e in f.datasheet():
            true = true_table.get((e.component, e.symbol), Estimate(e.component, e.symbol, 0.0, e.unit))
            covered = e.ci_low <= true.value <= e.ci_high
            if e.ci_low == e.ci_low:
                inside, total = inside + covered, total + 1
            verdict = e.note or ("yes" if covered else "no")
            values = (number(x, 4) for x in (true.value, e.value, e.ci_low, e.ci_high))
            rows.append([channel, e.component, e.symbol, *values, e.unit, verdict])
    head = ["channel", "component", "quantity", "truth", "estimate", "95 % low", "high", "unit", "inside"]
    title = "Simulated truth against estimate, datasheet units"
    foot = f"{inside} of {total} intervals hold the truth (95 % intended)"
    return f"{title}\n{format_table(head, rows, left=3)}\n{foot}"
