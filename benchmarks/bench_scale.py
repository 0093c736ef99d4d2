"""Thousands of runs: loops that are compiled as a whole, chunks by cache, and two levels. R's example, as in bench_nav.

Every row is a process of its own, in turns, and the best of its later calls. "as a command" is what `nav-jax compare`
does and what `nj.fast_loops()` does to a script; "as a library" is without. A former commit, in the folder that
``--before`` names (its nav_case with a `scenario` and a `compare` as here), runs beside both. Two levels are means of
5,000 runs, each with gains of its own; beside them are 2,000 such runs with other keys. R's navigation 0.0.2: 1.75 s a
run (1.25 s every 10th), quoted.
"""

import sys
from pathlib import Path

from common import ROOT, Report, fresh, seconds

MODES = {"every step": ("estimate", 1, 1.75), "every 10th": ("estimate", 10, 1.25), "reference": ("reference", 1, 1.75)}
BARS = {"every step": 0.5, "every 10th": 0.6, "reference": 0.5}
SCRIPT = "benchmarks/bench_scale_process.py"


def speed(report: Report, before: str | None) -> dict[str, float]:
    """Whole calls of 200 runs; returns seconds of a run with a covariance at every step."""
    num_runs, every_step = 32 if report.quick else 200, {}
    ways = {"before": (before, "")} if before else {}
    ways |= {"as a library": (ROOT, ""), "as a command": (ROOT, "fast")}
    rows = []
    for name, (gains, every, peer) in MODES.items():
        first, later = {}, {}
        for way, (folder, loops) in ways.items():
            done = fresh(SCRIPT, str(folder), loops, gains, str(every), str(num_runs), "1").answer
            first[way], later[way] = done["first"], done["later"] / num_runs
        every_step = every_step or later
        for way in ways:
            ratio = f"{later[way] / later['before']:.2f}" if before else ""
            rows.append([name, way, seconds(first[way]), seconds(later[way]), ratio, f"{peer / later[way]:.0f}"])
        if before:
            what = f"24 states, 30,001 epochs, {num_runs} runs, covariance {name}, as a command: per run"
            ratio = f"{later['as a command'] / later['before']:.2f}"
            report.bar(what, f"<= {BARS[name]} x", seconds(later["as a command"]), seconds(later["before"]), ratio)
    head = ["covariance", "how", "first call", "later, per run", "of the former commit", "times faster than R"]
    report.table(f"24 states, whole calls of {num_runs} runs, two threads", head, rows)
    return every_step


def two_levels(report: Report, every_step: dict[str, float]) -> None:
    """Means of 5,000 runs with gains of their own."""
    many, other = (200, 200) if report.quick else (5000, 2000)
    rows = []
    for name, loops in (("as a library", ""), ("as a command", "fast")):
        level = fresh(SCRIPT, str(ROOT), loops, "two-level", "1", str(many), "1").answer
        rate = every_step[name]
        ratio = level["later"] / (rate * many)
        rows.append([name, level["num_own"], seconds(level["later"]), seconds(rate * many), f"{ratio:.2f}"])
        what = f"means of {many} runs with gains of their own, by two levels, {name}"
        report.bar(
            what, "<= 1/3 x", seconds(level["later"]), f"{seconds(rate * many)} (all with their own)", f"{ratio:.2f}"
        )
    head = ["how", "runs with their own gains", "two levels", "all with their own, extrapolated", "ratio"]
    report.table(f"Two levels, {many} runs, covariance every step", head, rows)
    if not report.quick:
        own, rows = fresh(SCRIPT, str(ROOT), "fast", "estimate", "1", str(other), "2").answer, []
        for of in ("position", "nees"):
            value, se, correction, correction_se = level[of]
            mean, mean_se = own[of]
            apart = (value - mean) / (se**2 + mean_se**2) ** 0.5
            excess = se**2 / (mean_se**2 * other / many)
            rows.append(
                [of, f"{value:.4f} +- {se:.4f}", f"{mean:.4f} +- {mean_se:.4f}", f"{apart:+.1f}", f"{excess:.3f}"]
            )
            rows[-1].append(f"{correction:+.2g} +- {correction_se:.1g}")
        head = [
            "at the judged epoch",
            "two levels",
            f"{other} other runs",
            "sigmas apart",
            "variance, of one level",
            "own - shared",
        ]
        report.table("The same means", head, rows)


def main() -> None:
    before = sys.argv[sys.argv.index("--before") + 1] if "--before" in sys.argv else None
    if before is not None:
        before = str(Path(before).resolve())
        del sys.argv[sys.argv.index("--before") : sys.argv.index("--before") + 2]
    report = Report("scale", __doc__)
    two_levels(report, speed(report, before))
    report.save()


if __name__ == "__main__":
    main()
