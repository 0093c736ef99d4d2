"""Parametric bootstrap of 2*GM + WN + RW: replicates by records and by their wavelet variances, refits included.

The peer is R's simts 0.2.4 on the same kind of machine, summary with its bootstraps, B = 100 at N = 1e5 (quoted: 7.7 to
9.1 s, with refits that barely move). Compile time is that of XLA in the first call.
"""

import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from common import Report, compilations, seconds

import gmwm_jax as gj

TRUTH = "WN(sigma2=1.0) + RW(gamma2=1e-7) + GM(beta=0.1, variance=0.3) + GM(beta=0.002, variance=0.05)"
MODEL = "WN + RW + 2*GM"
CASES = (
    ("records", 100_000, 100, 2.5, 9.1),
    ("records", 1_000_000, 100, 25.0, None),
    ("variances", 100_000, 1000, 2.0, None),
    ("variances", 1_000_000, 1000, 2.0, None),
)


def main() -> None:
    report = Report("bootstrap", __doc__)
    rows = []
    for route, num_samples, replicates, bar, peer in CASES:
        if report.quick and num_samples > 100_000:
            continue
        x = np.asarray(gj.simulate(TRUTH, num_samples, key=jax.random.key(1)))
        fit = gj.fit(gj.wavelet_variance(x), MODEL)
        spans = []
        with compilations() as compiled:
            for i in range(3):
                start = time.perf_counter()
                boot = gj.bootstrap(fit, replicates, key=jax.random.key(i), route=route)
                spans.append(time.perf_counter() - start)
        again = min(spans[1:])
        rows.append(
            [route, f"{num_samples:,}", replicates, seconds(spans[0]), seconds(compiled.seconds), seconds(again)]
        )
        rows[-1] += [f"{replicates / again:.0f}", boot.num_failed]
        quoted, ratio = (f"{peer:g} s (R, quoted)", f"{again / peer:.3f}") if peer else ("", "")
        report.bar(
            f"{replicates} replicates by {route}, N = {num_samples:,}", f"{bar:g} s", seconds(again), quoted, ratio
        )
    head = ["route", "N", "replicates", "first call", "of it XLA", "second call", "per second", "failed"]
    report.table(f"{MODEL}", head, rows)
    report.save()


if __name__ == "__main__":
    main()
