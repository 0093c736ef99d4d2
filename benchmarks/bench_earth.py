"""What the real Earth and calibration states cost: WGS-84 beside a flat Earth, 60 states beside 24.

R's example, 75 s of it, one thread, in turns within a process. "as a command" and "as a library" as in bench_scale.
Ratios are of processor time, which other programs on the machine lengthen least.
"""

from typing import Any

from common import Report, fresh, seconds

SCRIPT = "benchmarks/bench_earth_process.py"
MODES = {("estimate", 1): "every step", ("estimate", 10): "every 10th", ("reference", 1): "reference"}


def main() -> None:
    report = Report("earth", __doc__)
    num_runs, turns = (16, 1) if report.quick else (64, 4)
    rows = []
    for how, loops in (("as a library", ""), ("as a command", "fast")):
        done: list[list[Any]] = fresh(SCRIPT, loops, str(num_runs), str(turns)).answer
        cpu = {(states, gains, every, earth): c for states, gains, every, earth, c, _ in done}
        for states, gains, every, earth, c, wall in done:
            flat, few = cpu[states, gains, every, "flat"], cpu[24, gains, every, earth]
            of_flat = f"{c / flat:.2f}" if earth != "flat" else ""
            of_few = f"{c / few:.2f}" if states != 24 else ""
            rows.append([how, states, MODES[gains, every], earth, seconds(c), seconds(wall), of_flat, of_few])
            if of_flat and (gains, every) == ("estimate", 1):
                what = f"{earth} beside a flat Earth, {states} states, covariance every step, {how}: processor time"
                report.bar(what, "<= 1.25 x", seconds(c), f"{seconds(flat)} (flat)", of_flat)
            if of_few:
                what = f"60 states beside 24, {earth}, covariance every step, {how}: processor time"
                report.bar(what, "<= 4 x", seconds(c), f"{seconds(few)} (24 states)", of_few)
    head = ["how", "states", "covariance", "Earth", "CPU, per run", "wall", "of the flat Earth's", "of 24 states'"]
    report.table(f"Whole calls of {num_runs} runs of 75 s on one thread", head, rows)
    report.save()


if __name__ == "__main__":
    main()
