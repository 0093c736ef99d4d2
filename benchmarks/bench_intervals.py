"""Coverage of 95 % intervals and size and power of the tests of fit: 500 records of each of three models, fixed keys.

Records are simulated, fitted with two-step weights, and replicated 300 times each by their wavelet variances. *theory*
are the intervals of the fit, the others those of the bootstrap; a parameter of a component estimated as zero or at a
limit may have none (*without*), and a fit beside a boundary has percentiles only. The binomial standard error of a
coverage is 1.0 %. *size* is the share of right models rejected at 5 %, by theory and by replicates; *power* the share
of a model rejected that lacks a component.
"""

import time
from concurrent.futures import ThreadPoolExecutor

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from common import Report, seconds

import gmwm_jax as gj
from gmwm_jax._internal.cores import num_threads

CASES = (
    ("WN(sigma2=1.0) + RW(gamma2=1e-6)", "WN + GM"),
    ("WN(sigma2=1.0) + GM(beta=0.01, variance=0.1)", "WN + RW"),
    ("WN(sigma2=1.0) + GM(beta=0.1, variance=0.3) + GM(beta=0.002, variance=0.1) + RW(gamma2=1e-6)", "WN + GM + RW"),
)
"""Truth, and a wrong model."""
KINDS = ("percentile", "basic", "studentised")
REPLICATES = 300
TOGETHER = 50
KEY = jax.random.key(20201231)


def main() -> None:
    report = Report("intervals", __doc__)
    num = 20 if report.quick else 500
    outside: dict[str, list[str]] = {"theory": [], **{kind: [] for kind in KINDS}}
    sizes: list[str] = []
    started = time.perf_counter()
    for num_samples in (20_000,) if report.quick else (100_000, 1_000_000):
        for c, (text, wrong) in enumerate(CASES):
            start = time.perf_counter()
            truth = gj.parse_model(text)
            kinds = " + ".join(p.kind for p in truth.processes)
            wvs = wavelet_variances(truth, num_samples, num, jax.random.fold_in(KEY, c))
            fits = fit_all(wvs, kinds)
            table, by_theory, by_replicates = study(fits, truth, outside)
            power = np.mean([gj.goodness_of_fit(f).p_value < 0.05 for f in fit_all(wvs, wrong)])
            head = ["parameter", "truth", "without", "theory", *KINDS]
            report.table(f"{kinds}, N = {num_samples:,}: coverage in % of {num} records", head, table)
            report.say(
                f"Test of fit at 5 %: size {100 * by_theory:.1f} % by theory, {100 * by_replicates:.1f} % by "
                f"replicates; power against {wrong} {100 * power:.0f} %. Took {seconds(time.perf_counter() - start)}."
            )
            sizes += [f"{100 * by_theory:.1f} / {100 * by_replicates:.1f}"]
    for kind, found in outside.items():
        bar = "91 .. 98.5 %" if kind == "theory" else "92.5 .. 97.5 %"
        report.bar(f"coverage of 95 % intervals, {num} records, {kind}", bar, "; ".join(found) or "all inside")
    report.bar("size of the tests of fit at 5 %, theory / replicates", "3 .. 7.5 %", "; ".join(sizes))
    report.bar("time of the study", "", seconds(time.perf_counter() - started))
    report.save()


def wavelet_variances(
    truth: gj.Composite, num_samples: int, num: int, key: jax.Array
) -> list[gj.variance.WaveletVariance]:
    def one(i: int) -> gj.variance.WaveletVariance:
        return gj.wavelet_variance(np.asarray(gj.simulate(truth, num_samples, key=jax.random.fold_in(key, i))))

    with ThreadPoolExecutor(num_threads()) as pool:
        return list(pool.map(one, range(num)))


def fit_all(wvs: list[gj.variance.WaveletVariance], model: str) -> list[gj.Fit]:
    fits: list[gj.Fit] = []
    for i in range(0, len(wvs), TOGETHER):
        part = wvs[i : i + TOGETHER]
        stacked = {k: np.column_stack([getattr(w, k) for w in part]) for k in ("variance", "ci_low", "ci_high")}
        names = tuple(f"record_{i}" for i in range(len(part)))
        known = {k: getattr(part[0], k) for k in ("scales", "num_samples", "level", "rate")}
        together = gj.variance.WaveletVariances(**known, **stacked, channels=names, units=("1",) * len(part))
        fits += gj.fit(together, model, weights="two-step", throw=False).values()
    return fits


def ends_of(boot: gj.inference.Bootstrap, kind: str) -> np.ndarray:
    """Both ends for all parameters; NaN where the kind has none, as beside a boundary all but percentiles."""
    try:
        return np.array(boot.interval(kind))
    except ValueError:
        return np.full((2, boot.fit.model.num_parameters), np.nan)


def study(
    fits: list[gj.Fit], truth: gj.Composite, outside: dict[str, list[str]]
) -> tuple[list[list[str]], float, float]:
    """Rows of the table, and the sizes of both tests of fit."""
    true = np.array([float(v) for p in truth.processes for v in p.values])
    names = [f"{label} {q.name}" for label, p in zip(truth.labels, truth.processes, strict=True) for q in p.parameters]
    held: dict[str, list[np.ndarray]] = {kind: [] for kind in outside}
    p_theory, p_replicates = [], []
    for i, f in enumerate(fits):
        boot = gj.bootstrap(f, REPLICATES, key=jax.random.fold_in(KEY, 1_000_000 + i))
        theory = [(e.ci_low, e.ci_high) for e in f.parameters()]
        ends = {"theory": np.array(theory).T, **{kind: ends_of(boot, kind) for kind in KINDS}}
        for kind, (low, high) in ends.items():
            known = np.isfinite(ends["theory"][0]) & np.isfinite(low)
            held[kind].append(np.where(known, (low <= true) & (true <= high), np.nan))
        p_theory.append(gj.goodness_of_fit(f).p_value)
        p_replicates.append(boot.p_value)
    rows = []
    coverage = {kind: 100 * np.nanmean(np.array(h), axis=0) for kind, h in held.items()}
    without = np.isnan(np.array(held["theory"])).sum(axis=0)
    for k, name in enumerate(names):
        rows.append([name, f"{true[k]:g}", str(without[k]), *(f"{coverage[kind][k]:.1f}" for kind in held)])
        for kind in held:
            low, high = (91, 98.5) if kind == "theory" else (92.5, 97.5)
            if not low <= coverage[kind][k] <= high:
                outside[kind].append(f"{' + '.join(truth.labels)} {name} {coverage[kind][k]:.1f} %")
    return rows, float(np.mean(np.array(p_theory) < 0.05)), float(np.mean(np.array(p_replicates) < 0.05))


if __name__ == "__main__":
    main()
