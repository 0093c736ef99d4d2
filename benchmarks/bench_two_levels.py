"""Two levels on the examples of the project: which way they go, what they cost, and whether they are right.

Each example is a process of its own: two levels as sure as 2,000 runs with gains of their own, and 1,000 such runs with
other keys; times are processor time of later calls, of all runs extrapolated. Sigmas apart: of both means at the judged
epoch, the largest of position, attitude and NEES of all filters. Share of the variance: of the differences, over that
of the runs, of the worst position or NEES. Cover: of 95 % intervals over 40 keys, about the mean of all of them, where
that takes seconds.
"""

import json
import sys

from common import Report, fresh, seconds

SCRIPT = "benchmarks/bench_two_levels_process.py"


def main() -> None:
    report = Report("two_levels", __doc__)
    num_runs = 100 if report.quick else 2000
    rows, told = [], {}
    for name in json.loads(fresh(SCRIPT, "names").stdout.strip().splitlines()[-1]):
        told[name] = one = fresh(SCRIPT, name, str(num_runs)).answer
        cover = "" if one["cover"] is None else f"{100 * one['cover']:.0f} %"
        share = f"{one['ratio']:.1e}"
        cost = f"{one['two'] / one['all']:.2f}"
        apart = f"{one['apart']:.1f}"
        row = [name, one["cheap"], one["own"], share, seconds(one["two"]), seconds(one["all"]), cost, apart, cover]
        rows.append(row)
        print(row, file=sys.stderr, flush=True)
    head = ["example", "cheap level", "runs with own gains", "share of the variance", "two levels"]
    head += ["all their own", "ratio", "sigmas apart", "cover"]
    report.table(f"As sure as {num_runs} runs", head, rows)
    linear = [one for one in told.values() if one["cheap"] == "linear"]
    ratios = sorted(one["two"] / one["all"] for one in linear)
    what = f"two levels on {len(told)} examples: means at the judged epoch from those of other runs"
    report.bar(what, "<= 4 sigma", f"{max(one['apart'] for one in told.values()):.1f} sigma, the largest")
    what = f"two levels that know the mean of linear runs ({len(linear)} examples), over all runs with their own gains"
    report.bar(what, "<= 1/3 x", f"{ratios[len(ratios) // 2]:.2f}, median; {ratios[-1]:.2f}, largest")
    report.save()


if __name__ == "__main__":
    main()
