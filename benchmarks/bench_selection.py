"""Model selection: all 63 sub-models of WN + QN + RW + DR + 3*GM on one channel, how fast and how often right.

How often: 50 records of a million samples of each of four compositions (fixed keys) are simulated, and `select` chooses
within the 47 sub-models of WN + QN + RW + DR + 2*GM. *recommended* counts the names; *equivalent* says how many of the
50 have the true composition among the models that no other is significantly better than. Published recordings follow:
the MTi-G (from its wavelet variances) and six ADIS 16405 units (from the records).

The peers have no timing of the same: R's gmwm refits every model from 10,000 random starts (3 s a model and channel).
"""

import json
import time
from collections import Counter

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from common import Report, compilations, seconds, shared

import gmwm_jax as gj

SUPERSET = "WN + QN + RW + DR + 2*GM"
LARGE = "WN + QN + RW + DR + 3*GM"
TRUTHS = (
    "WN(sigma2=1.0) + RW(gamma2=1e-7)",
    "WN(sigma2=1.0) + GM(beta=0.01, variance=0.05)",
    "WN(sigma2=0.5) + QN(q2=0.5) + GM(beta=0.01, variance=0.05)",
    "WN(sigma2=1.0) + RW(gamma2=1e-6) + GM(beta=0.1, variance=0.2) + GM(beta=1e-3, variance=0.2)",
)
KEY = jax.random.key(20180601)


def main() -> None:
    report = Report("selection", __doc__)
    speed(report)
    how_often(report, 4 if report.quick else 50, 50_000 if report.quick else 1_000_000)
    published(report)
    report.save()


def speed(report: Report) -> None:
    x = gj.simulate(TRUTHS[1], 100_000 if report.quick else 1_000_000, key=KEY)
    wv = gj.wavelet_variance(np.asarray(x))
    spans = []
    with compilations() as compiled:
        for _ in range(4):
            start = time.perf_counter()
            found = gj.select(wv, LARGE)
            spans.append(time.perf_counter() - start)
    again = min(spans[1:])
    row = [len(found), seconds(spans[0]), seconds(compiled.seconds), seconds(again), seconds(again / len(found))]
    report.table(
        f"{LARGE}, one channel",
        ["models", "first call", "of it XLA", "later calls", "per model, fits and tests"],
        [row],
    )
    quoted = f"{3 * len(found)} s (R, 3 s a model, quoted)"
    report.bar(
        f"selection over {len(found)} sub-models, one channel",
        "5 s",
        seconds(again),
        quoted,
        f"{again / 3 / len(found):.4f}",
    )


def how_often(report: Report, num: int, num_samples: int) -> None:
    rows = []
    for t, text in enumerate(TRUTHS):
        truth = gj.parse_model(text)
        want = Counter(p.kind for p in truth.processes)
        names, equivalent = Counter(), 0
        for i in range(num):
            x = gj.simulate(truth, num_samples, key=jax.random.fold_in(jax.random.fold_in(KEY, t), i))
            found = gj.select(gj.wavelet_variance(np.asarray(x)), SUPERSET)
            names[found.recommended.name] += 1
            equivalent += any(
                Counter(p.kind for p in gj.parse_model(c.name).processes) == want for c in found.equivalent
            )
        right = sum(n for name, n in names.items() if Counter(p.kind for p in gj.parse_model(name).processes) == want)
        shown = ", ".join(f"{name}: {n}" for name, n in names.most_common(4))
        rows.append([text, f"{right} of {num}", f"{equivalent} of {num}", shown])
        report.bar(f"truth recommended: {' + '.join(truth.labels)}", ">= 90 %", f"{100 * right / num:.0f} % of {num}")
    head = ["truth", "recommended", "equivalent", "names"]
    report.table(f"{num} records of {num_samples:,} samples each, within {SUPERSET}", head, rows)


def published(report: Report) -> None:
    if (file := shared("reference", "imu_wv_library.json")) is not None:
        rows = []
        for channel, row in json.loads(file.read_text())["MTiG"].items():
            columns = (row["scales"], row["variance"], row["ci_low"], row["ci_high"])
            wv = gj.variance.WaveletVariance.from_table(*columns, num_samples=row["N"], rate=float(row["freq"]))
            rows.append(described(channel, gj.select(wv, LARGE)))
        report.table(f"MTi-G, published wavelet variances, within {LARGE}", HEAD, rows)
    if report.quick:
        return
    for unit in range(1, 7):
        if (file := shared("data", f"adis_16405_imu{unit}.rda")) is None:
            return
        found = gj.select(gj.wavelet_variance(gj.read_recording(file)), LARGE)
        rows = [described(channel, s) for channel, s in found.items()]
        report.table(f"ADIS 16405, unit {unit}, within {LARGE}", HEAD, rows)


HEAD = ["channel", "recommended", "parameters", "WVIC", "p of fit", "equivalent models", "lowest"]


def described(channel: str, s: gj.inference.Selection) -> list:
    r = s.recommended
    return [channel, r.name, r.num_parameters, f"{r.criterion:.4g}", f"{r.p_value:.2g}", len(s.equivalent), s.best.name]


if __name__ == "__main__":
    main()
