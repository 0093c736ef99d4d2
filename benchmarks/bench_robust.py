"""Robust wavelet variance (efficiency 0.6) at all octaves beside the classic one and R's: time, digits, bias.

Then what masking outliers and a wavelet variance by pairs of the samples left costs, and what the parameters gain.

R's time is quoted from the project's notes (wv::wvar, robust, on 2 cores, N = 1e6); it is not run here.
"""

import jax

jax.config.update("jax_enable_x64", True)
from dataclasses import replace

import numpy as np
from bench_wavelet import record
from common import Report, interleaved, seconds
from scipy.optimize import brentq

import gmwm_jax as gj
from gmwm_jax.variance.robust import biweight

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


def contaminated(x: np.ndarray, length: int, seed: int) -> np.ndarray:
    """1 % of the samples 10 off, in bursts of a length."""
    rng, y = np.random.default_rng(seed), x.copy()
    first = length * rng.choice(len(x) // length, len(x) // 100 // length, replace=False)
    y[(first[:, None] + np.arange(length)).ravel()] += np.repeat(10.0 * rng.choice([-1, 1], len(first)), length)
    return y


def cleaned_records(report: Report) -> None:
    """Cost of cleaning, and the bar of the parameters."""
    rows = []
    for num in (10**4, 10**5) if report.quick else (10**5, 10**6):
        rec = gj.Recording.from_array(
            contaminated(np.random.default_rng(0).standard_normal(num), 1, 0), rate=1.0, units="1"
        )
        cleaned = gj.recordings.mask_outliers(rec).recording
        fit = gj.fit(cleaned, "WN")
        times = interleaved(
            {
                "mask": lambda rec=rec: gj.recordings.mask_outliers(rec),
                "pairs": lambda cleaned=cleaned: gj.wavelet_variance(cleaned),
                "classic": lambda rec=rec: gj.wavelet_variance(rec),
                "covariance": lambda fit=fit: replace(fit).wv_covariance,
            },
            3,
        )
        rows.append([f"{num:.0e}", *times.values()])
    report.table(
        "One channel with 1 % of its samples missing, median (range)",
        ["N", "mask_outliers", "wavelet variance by pairs", "of the complete record", "its covariance, 2 draws"],
        rows,
    )

    rows, runs, inside = [], 2 if report.quick else 10, 0
    num = 50_000 if report.quick else 200_000
    for text in ("WN(sigma2=1.0) + RW(gamma2=1e-4)", "WN(sigma2=1.0) + GM(beta=0.02, variance=0.5) + RW(gamma2=1e-5)"):
        model = " + ".join(p.kind for p in gj.parse_model(text).processes)
        for length in (1, 5):
            seen: dict[str, list] = {"classic": [], "robust 0.6": [], "cleaned": []}
            for seed in range(runs):
                x = np.asarray(gj.simulate(text, num, key=jax.random.key(seed)))
                y = contaminated(x, length, seed)
                clean = list(gj.fit(gj.wavelet_variance(x), model).parameters())
                waves = [
                    gj.wavelet_variance(y),
                    gj.wavelet_variance(y, efficiency=0.6),
                    gj.wavelet_variance(
                        gj.recordings.mask_outliers(gj.Recording.from_array(y, rate=1.0, units="1")).recording
                    ),
                ]
                for name, wv in zip(seen, waves, strict=True):
                    values = [float(v) for p in gj.fit(wv, model).model.processes for v in p.values]
                    pairs = list(zip(clean, values, strict=True))
                    kept = all(e.ci_low < v < e.ci_high for e, v in pairs)
                    seen[name].append([kept, *(v / e.value - 1 for e, v in pairs)])
            for name, draws in seen.items():
                kept, *shifts = np.array(draws).T
                symbols = [f"{e.symbol} {100 * np.median(s):+.2f} %" for e, s in zip(clean, shifts, strict=True)]
                rows.append([model, length, name, f"{int(kept.sum())} of {runs}", ", ".join(symbols)])
            inside += int(sum(d[0] for d in seen["cleaned"]))
    report.table(
        f"N = {num:.0e}, 1 % of the samples 10 sigma off: all parameters in their clean intervals, median shift",
        ["model", "burst", "estimate", "all inside", "shift from the clean estimate"],
        rows,
    )
    total = 4 * runs
    report.bar("cleaned parameters inside their clean intervals", "all records", f"{inside} of {total}", "none", "")


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
    cleaned_records(report)
    if report.bars:
        report.save()


if __name__ == "__main__":
    main()
