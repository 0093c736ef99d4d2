"""First use: what waits who starts a process, with nothing compiled before and with what the one before has kept.

A single fit from import to print, against R's whole process for the same model (simts, quoted); the demonstrations and
commands, the second start of each with the programs that the first kept in a folder of caches of its own.
"""

import os
import tempfile
from pathlib import Path

from common import Process, Report, fresh, seconds, shared

MODEL = "WN + RW + 3*GM"
R_SECONDS = 5.65
"""R's whole process: load, read, fit 3GM+WN+RW to one channel, print."""

ONE_FIT = """
import json
import sys
import jax
jax.config.update("jax_enable_x64", True)
import numpy as np
import gmwm_jax as gj
if sys.argv[2] == "kept":
    gj.keep_compiled()
one = json.loads(open(sys.argv[1]).read())["MTiG"]["Gyro.X"]
columns = [np.array(one[name], float) for name in ("scales", "variance", "ci_low", "ci_high")]
wv = gj.variance.WaveletVariance.from_table(*columns, num_samples=one["N"], rate=float(one["freq"]), unit="rad/s")
print(gj.fit(wv, sys.argv[3]))
"""


def main() -> None:
    report = Report("first", __doc__)
    file = shared("reference", "imu_wv_library.json")
    if file is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "record.npz"
        out = Path(folder) / "out"
        out.mkdir()
        samples = "20000" if report.quick else "1000000"
        commands = {
            "gmwm-jax fit": ("-m", "gmwm_jax", "fit", record, "--model", "WN + RW + 2*GM"),
            "gmwm-jax demo": ("-m", "gmwm_jax", "demo", "--out", out, "--samples", samples),
            "nav-jax demo": ("-m", "nav_jax", "demo", "--fits", out, "--out", out),
        }
        save = "import gmwm_jax as gj; gj.save_recording(gj.datasets.simulated('mti-g', 100_000, channels=['gyro_x']), "
        enable = "import jax; jax.config.update('jax_enable_x64', True); "
        fresh("-c", f"{enable}{save}{str(record)!r})")
        # import alone; the fit with nothing kept; the fit with what was kept
        alone = ("-c", "import jax, gmwm_jax; gmwm_jax.fit")
        ways = {"import": alone} | {name: ("-c", ONE_FIT, file, name, MODEL) for name in ("cold", "kept")}
        repeats = 1 if report.quick else 5
        caches = Path(folder) / "caches"
        runs: dict[str, list[Process]] = {name: [] for name in ways}
        with_caches(caches)
        fresh(*ways["kept"])
        for _ in range(repeats):
            for name, arguments in ways.items():
                runs[name].append(fresh(*arguments))
        best = {name: min(done, key=lambda p: p.cpu) for name, done in runs.items()}
        rows = [[name, seconds(p.wall), seconds(p.cpu), f"{p.peak_mib:.0f} MiB"] for name, p in best.items()]
        report.table(f"A single fit of {MODEL}, best of {repeats} in turn", ["", "wall", "CPU", "peak RSS"], rows)
        rows, halves = [], {}
        for name, arguments in commands.items():
            starts = []
            for i in range(1 if report.quick else 3):
                with_caches(Path(folder) / f"{name}-{i}")
                starts.append((fresh(*arguments), fresh(*arguments)))
            first, second = (min((s[k] for s in starts), key=lambda p: p.cpu) for k in (0, 1))
            times = [seconds(x) for p in (first, second) for x in (p.wall, p.cpu)]
            halves[name] = second.wall / first.wall
            rows.append([name, *times, f"{halves[name]:.2f}"])
            if name == "gmwm-jax demo":
                report.bar("`gmwm-jax demo`, first start", "60 s", f"{times[0]} (CPU {times[1]})")
    head = ["", "first start, wall", "CPU", "second start, wall", "CPU", "second / first"]
    report.table("Commands, nothing kept before the first start", head, rows)
    for name, bar in (("cold", R_SECONDS), ("kept", 2.0)):
        p, peer = best[name], f"R {R_SECONDS} s (quoted)"
        what = f"one fit of {MODEL}, fresh process, import to print, {name}"
        report.bar(what, f"{bar} s", f"{seconds(p.wall)} (CPU {seconds(p.cpu)})", peer, f"{p.wall / R_SECONDS:.2f}")
    for name, half in halves.items():
        report.bar(f"`{name}`, second start / first", "<= 0.5", f"{half:.2f}")
    report.save()


def with_caches(folder: Path) -> None:
    """Where the processes that follow keep what they compile."""
    os.environ["XDG_CACHE_HOME"] = str(folder)


if __name__ == "__main__":
    main()
