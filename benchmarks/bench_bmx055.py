"""The published simulation of a BMX055 gyro, 12 h at 400 Hz: simulate, wavelet variance, fit with intervals.

17 280 000 samples; white noise 1.064e-4 rad/s/sqrt(Hz) and a Gauss-Markov bias with the correlation time 530.8 s that
is driven by 1.148e-6 rad/s/sqrt(s). A fresh process does all of it: at most 10 s and 2 GB (1907 MiB).
"""

import json
import sys
import time

from common import Report, fresh, median_process, seconds

RATE = 400.0
NUM_SAMPLES = int(12 * 3600 * RATE)
TRUTH = {"WN N": 1.064e-4, "GM tau_c": 530.8, "GM sqrt(q)": 1.148e-6}


def child(num_samples: int, seed: int) -> None:
    started = time.perf_counter()
    import jax

    jax.config.update("jax_enable_x64", True)
    import resource

    import numpy as np

    import gmwm_jax as gj

    parts = {}

    def part(name: str) -> None:
        nonlocal started
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        parts[name] = (time.perf_counter() - started, peak)
        started = time.perf_counter()

    part("import")
    beta, variance = gj.processes.from_continuous("GM", (1 / TRUTH["GM tau_c"], TRUTH["GM sqrt(q)"] ** 2), RATE)
    (sigma2,) = gj.processes.from_continuous("WN", (TRUTH["WN N"] ** 2,), RATE)
    truth = gj.WN(sigma2) + gj.GM(beta, variance)
    x = np.asarray(gj.simulate(truth, num_samples, key=jax.random.key(seed)))
    part("simulate")
    wv = gj.wavelet_variance(x, rate=RATE, unit="rad/s")
    part("wavelet variance")
    fit = gj.fit(wv, "WN + GM")
    part("fit")
    table = fit.continuous()
    part("intervals")
    q_wn, q_gm, tau_c = table["WN", "q"], table["GM", "q"], table["GM", "tau_c"]
    root = {"WN N": q_wn, "GM sqrt(q)": q_gm}
    estimates = {k: [v**0.5 for v in (e.value, e.ci_low, e.ci_high)] for k, e in root.items()}
    estimates["GM tau_c"] = [tau_c.value, tau_c.ci_low, tau_c.ci_high]
    # Q at the truth: how much the fit gained on it
    at_truth = gj.fitting.objective(wv, truth)
    answer = {
        "parts": parts,
        "estimates": estimates,
        "objective": [fit.objective, at_truth],
        "status": fit.status.value,
    }
    print(json.dumps(answer))


def main() -> None:
    report = Report("bmx055", __doc__)
    num = NUM_SAMPLES // 4 if report.quick else NUM_SAMPLES
    repeats = 1 if report.quick else 5
    runs = [fresh(__file__, "--child", str(num), str(seed)) for seed in range(repeats)]
    one = median_process(runs)
    wall, peak = one.wall, max(p.peak_mib for p in runs)
    answer = one.answer
    rows = [[name, seconds(took), f"{mib:.0f} MiB"] for name, (took, mib) in answer["parts"].items()]
    rows.append(["whole process, start and end included", seconds(wall), f"{one.peak_mib:.0f} MiB"])
    rows.append(["- of it CPU time", seconds(one.cpu), ""])
    report.table(
        f"Parts of a fresh process, N = {num} (the median of {repeats})", ["", "time", "peak RSS so far"], rows
    )
    rows, inside = [], 0
    for seed, p in enumerate(runs):
        for name, truth in TRUTH.items():
            value, low, high = p.answer["estimates"][name]
            inside += low <= truth <= high
            rows.append([seed, name, f"{truth:.5g}", f"{value:.5g}", f"{low:.5g} .. {high:.5g}", low <= truth <= high])
        fitted, at_truth = p.answer["objective"]
        rows.append([seed, "objective", f"{at_truth:.5g}", f"{fitted:.5g}", p.answer["status"], ""])
    report.table("Estimates beside the truth (SI)", ["seed", "", "truth", "estimate", "95 % interval", "inside"], rows)
    report.bar(
        f"BMX055, {num / RATE / 3600:g} h at 400 Hz, simulate + WV + fit + intervals, fresh",
        "10 s, 1907 MiB (2 GB)",
        f"{seconds(wall)} (CPU {seconds(one.cpu)}), {peak:.0f} MiB",
        f"{inside} of {len(TRUTH) * repeats} intervals hold the truth",
    )
    report.save()


if __name__ == "__main__":
    child(*map(int, sys.argv[2:])) if "--child" in sys.argv else main()
