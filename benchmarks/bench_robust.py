"""Robust wavelet variance (efficiency 0.6) at all octaves beside the classic one and R's: time, digits, bias.

R's time is quoted from the project's notes (wv::wvar, robust, on 2 cores, N = 1e6); it is not run here.
"""

import jax

jax.config.update("jax_enable_x64", True)
import numpy as np
from bench_wavelet import record
from common import Report, interleaved, seconds
from scipy.optimize import brentq

import gmwm_jax as gj
from gmwm_jax.robust import biweight

R_SECONDS = {10**6: 6.489}


def brute_force(x: np.ndarray, variance: np.ndarray, efficiency: float) -> np.ndarray:
    """The estimating equation from its definition, solved by bisection around the root."""
    c, a, _ = biweight(efficiency)
    S, result = x - x.mean(), []
    for j, nu in enumerate(variance):
        n = 2**j
        W = (S[n:] - S[:-n]) / (2 * n)

        def excess(log_v: float, W: np.ndarray = W) -> float:
            r = W / np.exp(log_v / 2)
            return float(np.mean(np.where(np.abs(r) <= c, r**2 * (1 - (r / c) ** 2) ** 4, 0.0))) - a

        result.append(np.exp(brentq(excess, np.log(nu) - 0.01, np.log(nu) + 0.01, xtol=1e-14)))
        S = S[n:] + S[:-n]
    return np.array(result)


def main() -> None:
    report = Report("robust", __doc__)
    rows = []
    for num in (10**4, 10**5) if report.quick else (10**5, 10**6, 10**7):
        x = record(num)
        times = interleaved(
            {
                "robust": lambda x=x: gj.wavelet_variance(x, efficiency=0.6),
                "classic": lambda x=x: gj.wavelet_variance(x),
            },
            3 if num > 10**6 else 7,
        )
        variance = gj.wavelet_variance(x, efficiency=0.6).variance
        fine = variance[:-5]  # where a root is certain
        error = f"{np.max(np.abs(fine / brute_force(x, fine, 0.6) - 1)):.1e}" if num <= 10**6 else ""
        r = R_SECONDS.get(num)
        ratio = f"{times['robust'].median / r:.3f}" if r else ""
        rows.append([f"{num:.0e}", times["robust"], times["classic"], f"{r} s" if r else "", ratio, error])
        if r:
            measured = seconds(times["robust"].median)
            report.bar(f"robust WV, {num:.0e} samples, all octaves", "<= 0.7 s", measured, "R 6.489 s (quoted)", ratio)
    report.table(
        "One channel: `gj.wavelet_variance(array, efficiency=0.6)`, median (range)",
        ["N", "robust", "classic", "R wv (quoted, 2 cores)", "ratio to R", "rel. error against bisection"],
        rows,
    )

    rows, num, repeats = [], 10**4, 20 if report.quick else 500
    rng = np.random.default_rng(1)
    for efficiency in (0.6, 0.75, 0.9):
        draws = []
        for _ in range(repeats):
            x = rng.standard_normal(num)
            spread, burst = x.copy(), x.copy()
            spread[rng.choice(num, num // 100, replace=False)] += 10.0
            first = rng.integers(num - num // 100)
            burst[first : first + num // 100] *= 10.0
            classic = gj.wavelet_variance(x, num_levels=1).variance[0]
            robust = [
                gj.wavelet_variance(y, num_levels=1, efficiency=efficiency).variance[0] for y in (x, spread, burst)
            ]
            draws.append([classic, *robust])
        logs = np.log(draws) - np.log(0.5)
        bias = [f"{100 * np.expm1(b):+.2f} %" for b in logs.mean(axis=0)[1:]]
        rows.append([efficiency, f"{np.var(logs[:, 0]) / np.var(logs[:, 1]):.3f}", *bias])
    report.table(
        f"Span 2 of white noise, N = {num:.0e}, {repeats} records: variance of the classic over the robust one, bias",
        ["efficiency", "variance ratio", "clean", "1 % of samples + 10 sigma", "1 % in one burst of 10 sigma"],
        rows,
    )
    if report.bars:
        report.save()


if __name__ == "__main__":
    main()
