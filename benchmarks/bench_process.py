"""Whole processes: the command line fits the six channels of an ADIS16405 recording, from file to JSON and figure.

``python -m gmwm_jax fit FILE --channels all --model "WN + 2*GM + RW" --json X --plot Y``, each run a fresh process
without JAX's persistent cache; nothing is dropped from the cache of the file system. CPU is user + system time: on a
machine that is shared, the wall time cannot be less than it by more than the number of cores.
"""

import json
import tempfile
from pathlib import Path

from common import Report, fresh, median_process, seconds, shared

MODEL = "WN + 2*GM + RW"


def main() -> None:
    report = Report("process", __doc__)
    file = shared("data", "adis_16405_imu1.rda")
    if file is None:
        return
    repeats = 1 if report.quick else 5
    rows, bars = [], {}
    with tempfile.TemporaryDirectory() as folder:
        json_file, figure = Path(folder) / "fit.json", Path(folder) / "fit.png"
        fit = ("-m", "gmwm_jax", "fit", file, "--channels", "all", "--model", MODEL)
        ways = {
            "import gmwm_jax": ("-c", "import gmwm_jax"),
            "gmwm-jax --help": ("-m", "gmwm_jax", "--help"),
            "gmwm-jax wv": ("-m", "gmwm_jax", "wv", file, "--json", json_file),
            "gmwm-jax fit --json": (*fit, "--json", json_file),
            "gmwm-jax fit --json --plot": (*fit, "--json", json_file, "--plot", figure),
        }
        runs = {name: [] for name in ways}
        for _ in range(repeats):
            for name, arguments in ways.items():
                runs[name].append(fresh(*arguments))
        fits = json.loads(json_file.read_text())
        size = figure.stat().st_size
    for name, done in runs.items():
        one, walls = median_process(done), [p.wall for p in done]
        peak = max(p.peak_mib for p in done)
        rows.append([name, f"{seconds(one.wall)} ({seconds(min(walls))} .. {seconds(max(walls))})", seconds(one.cpu)])
        rows[-1].append(f"{peak:.0f} MiB")
        bars[name] = f"{seconds(one.wall)} (CPU {seconds(one.cpu)}), {peak:.0f} MiB"
    report.table(f"Fresh processes, {repeats} each in turn", ["", "wall, median (range)", "CPU", "peak RSS"], rows)
    rows = []
    for f in fits:
        intervals = f"{sum(p['ci_low'] is not None for p in f['parameters'])} of {len(f['parameters'])}"
        rows.append([f["channel"], f"{f['objective']:.8g}", f["status"], f"{f['agreement']:.2f}", intervals])
    head = ["channel", "objective", "status", "agreement", "parameters with an interval"]
    report.table(f"What the JSON holds (the figure has {size // 1000} kB)", head, rows)
    for name in ("gmwm-jax fit --json", "gmwm-jax fit --json --plot"):
        report.bar(f"`{name}`, six channels x 1e6, fresh", "15 s, 1431 MiB (1.5 GB)", bars[name])
    report.save()


if __name__ == "__main__":
    main()
