"""Design of small filters by the navigation error: the best with 0, 1 and 2 processes an axis, and Monte Carlo runs.

R's example (lemniscate, published noise of an MTi-G, 40 s without GNSS). R's `partial` filter believes white noise and
the fastest process of each sensor: in R's 50 runs its mean error at the end is 9.25 m against 8.20 m of the right one.
The filters of the same size that are designed here are judged by runs on fresh noise, on the same noise as `partial`.
"""

import time

import jax

jax.config.update("jax_enable_x64", True)

import nav_case as case
import numpy as np
from common import Report, seconds

import nav_jax as nj


def main() -> None:
    report = Report("design", __doc__)
    duration, num = (60.0, 100) if report.quick else (300.0, 2000)
    truth, scenario = case.FILTERS["right"], case.scenario(duration, every=10)
    most = 1 if report.quick else 2
    start = time.perf_counter()
    design = nj.design(scenario, truth, max_accel=most, max_gyro=most, num_starts=2)
    wall = time.perf_counter() - start
    report.say(f"## The design ({seconds(wall)}, compilation included)", f"```\n{design!r}\n```")
    best = {
        k: min((c for c in design.candidates if c.num_states <= 6 * k), key=lambda c: c.loss) for k in range(most + 1)
    }
    filters = {f"designed, {k} an axis": c.errors for k, c in best.items()}
    filters |= {"partial (1 an axis)": case.FILTERS["WN + 1 AR1"], "right": truth, "WN only": case.FILTERS["WN only"]}
    runs = nj.compare(scenario, truth, filters, num_runs=num, key=jax.random.key(1905))
    k = runs["right"].epoch()
    rows, error = [], {}
    for name, r in runs.runs.items():
        norm = np.linalg.norm(r.errors("position")[:, k], axis=1)
        error[name] = norm
        nees = [r.nees[g][:, k].mean() / d for g, d in (("position", 3), ("pose", 6), ("navigation", 9))]
        se = norm.std() / np.sqrt(len(norm))
        rows.append([name, f"{norm.mean():.3f} +- {se:.3f}", *(f"{x:.3f}" for x in nees)])
    head = ["filter", "mean position error [m]", "NEES / 3", "pose / 6", "navigation / 9"]
    report.table(f"At the end of the outage, {num} runs on fresh noise (every filter the same)", head, rows)
    for i in range(1, most + 1):
        name = f"designed, {i} an axis"
        gain = error["partial (1 an axis)"] - error[name]
        z = gain.mean() / (gain.std() / np.sqrt(len(gain)))
        r = runs[name]
        nees = [r.nees[g][:, k].mean() / d for g, d in (("position", 3), ("pose", 6), ("navigation", 9))]
        task = f"{name}: mean error below that of R's partial filter"
        report.bar(
            task,
            "significant",
            f"{error[name].mean():.2f} m, {z:.1f} sigma",
            f"{error['partial (1 an axis)'].mean():.2f} m",
        )
        partial = runs["partial (1 an axis)"].nees["navigation"][:, k].mean() / 9
        span = f"{min(nees):.2f} .. {max(nees):.2f}"
        report.bar(f"{name}: NEES / dof (position, pose, navigation)", "0.8 .. 1.25", span, f"{partial:.2f}")
    report.save()


if __name__ == "__main__":
    main()
