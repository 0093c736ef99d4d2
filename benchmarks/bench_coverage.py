"""Monte Carlo of the estimator: bias, standard errors and coverage of the 95 % intervals, fixed keys.

Every case is simulated (`gj.simulate`, one key a replicate), its wavelet variance taken by the host path, and fitted
50 replicates at a time as the channels of one `WaveletVariance`, so that a case compiles once.

How to read the tables. *bias* is the mean error in % of the truth, on the natural scale; *t* is the mean error in units
of its own standard error (|t| > 3 is no chance), on the natural scale over all replicates that have a value and on the
log scale over those inside the boundaries. *sd/SE* is the scatter of the log estimates over the median reported
standard error, *SE(truth)* the first-order standard error of the log at the true parameters: where it is not small, the
parameter is hardly identified and normal theory is not expected to hold. *coverage* is the share of intervals that hold
the truth, with its binomial standard error, of the *n* that exist (an amplitude estimated as zero has none, nor has the
correlation time beside it); *low* and *high* split the misses into intervals wholly below and above the truth.

The default weights, 1/(ci_high - ci_low)^2, are random: a scale that came out low weighs more. The first model of each
case is fitted once more with ``weights="two-step"``, where they come from a first fit.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import jax

jax.config.update("jax_enable_x64", True)
import numpy as np
from common import Report, compilations, seconds, timed

import gmwm_jax as gj
from gmwm_jax._internal.cores import num_threads

TOGETHER = 50
THREADS = num_threads()
KEY = jax.random.key(20130901)


@dataclass(frozen=True)
class Case:
    """A truth, a record length, and the models fitted to it."""

    name: str
    truth: gj.Composite
    num_samples: int
    models: tuple[str, ...]
    why: str


def cases() -> list[Case]:
    mti = gj.datasets.sensor_models("mti-g")
    return [
        Case(
            "WN + GM",
            gj.parse_model("WN(sigma2=1) + GM(beta=0.01, variance=0.1)"),
            100_000,
            ("WN + GM",),
            "correlation time 100 samples; at its hump (span 380) the GM has 7 times the wavelet variance of the WN",
        ),
        Case(
            "MTi-G gyro_x",
            mti["gyro_x"],
            1_000_000,
            ("RW + 2*GM", "WN + RW + 2*GM"),
            "2.8 h at 100 Hz; the second model has a WN too much, whose true variance is zero",
        ),
        Case("MTi-G accel_x", mti["accel_x"], 1_000_000, ("WN + RW + 2*GM",), "2.8 h at 100 Hz"),
    ]


def wavelet_variances(case: Case, replicates: int) -> list[gj.variance.WaveletVariance]:
    def one(i: int) -> gj.variance.WaveletVariance:
        return gj.wavelet_variance(
            np.asarray(gj.simulate(case.truth, case.num_samples, key=jax.random.fold_in(KEY, i)))
        )

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(one, range(replicates)))


def parameters(fits: list[gj.Fit]) -> list[gj.fitting.EstimateTable]:
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(lambda f: f.parameters(), fits))


def together(wvs: list[gj.variance.WaveletVariance]) -> gj.variance.WaveletVariances:
    """Replicates as the channels of one wavelet variance."""
    stacked = {k: np.column_stack([getattr(w, k) for w in wvs]) for k in ("variance", "ci_low", "ci_high")}
    names = tuple(f"replicate_{i}" for i in range(len(wvs)))
    one = wvs[0]
    return gj.variance.WaveletVariances(
        one.scales,
        **stacked,
        num_samples=one.num_samples,
        level=one.level,
        rate=one.rate,
        channels=names,
        units=("1",) * len(wvs),
    )


def fit_all(wvs: list[gj.variance.WaveletVariance], model: str, omega: str | None = None) -> list[gj.Fit]:
    fits: list[gj.Fit] = []
    for i in range(0, len(wvs), TOGETHER):
        fits += gj.fit(together(wvs[i : i + TOGETHER]), model, weights=omega, throw=False).values()
    return fits


def true_values(case: Case, fit: gj.Fit) -> dict[tuple[str, str], float]:
    """True value of each parameter of the fit, by label and symbol; what the truth lacks has amplitude 0."""
    known = {}
    for label, p in zip(case.truth.labels, case.truth.processes, strict=True):
        known |= {(label, q.name): float(v) for q, v in zip(p.parameters, p.values, strict=True)}
    return {(e.component, e.symbol): known.get((e.component, e.symbol), 0.0) for e in fit.parameters()}


def errors_at_truth(case: Case, fit: gj.Fit) -> dict[tuple[str, str], float]:
    """First-order standard errors of the logs at the true parameters; none where the model is not the true one."""
    if fit.model.labels != case.truth.labels:
        return {}
    width = (fit.wv.ci_high - fit.wv.ci_low) / fit.wv.variance
    omega = np.diag(1 / (width * np.asarray(case.truth.wavelet_variance(fit.wv.scales))) ** 2)
    table = replace(fit, model=case.truth, at_boundary={}, omega=omega).parameters()
    return {(e.component, e.symbol): float(np.log(e.ci_high / e.ci_low) / (2 * 1.959964)) for e in table}


def rows_of(case: Case, fits: list[gj.Fit], tables: list[gj.fitting.EstimateTable]) -> list[list[str]]:
    truths, first_order = true_values(case, fits[0]), errors_at_truth(case, fits[0])
    rows = []
    for key, truth in truths.items():
        entries = [t[key] for t in tables]
        values = np.array([e.value for e in entries])
        low, high = np.array([e.ci_low for e in entries]), np.array([e.ci_high for e in entries])
        has_value, inside = np.isfinite(values), np.array([not e.note for e in entries])
        v, n = values[has_value], int(inside.sum())
        row = [" ".join(key), f"{truth:.4g}", str(n), f"{len(values) - n}"]
        if truth == 0:
            rows.append([*row, f"mean {v.mean():.2g}", *[""] * 7])
            continue
        t_natural = (v.mean() - truth) / (v.std(ddof=1) / np.sqrt(len(v)))
        logs = np.log(values[inside] / truth)
        t_log = logs.mean() / (logs.std(ddof=1) / np.sqrt(n))
        se = np.log(high[inside] / low[inside]) / (2 * 1.959964)
        below, above = np.mean(high[inside] < truth), np.mean(low[inside] > truth)
        c = 1 - below - above
        intervals = [f"{logs.std(ddof=1) / np.median(se):.2f}", f"{first_order[key]:.3g}" if key in first_order else ""]
        intervals += [
            f"{100 * c:.1f} +- {100 * np.sqrt(c * (1 - c) / n):.1f} %",
            f"{100 * below:.1f} / {100 * above:.1f}",
        ]
        rows.append(
            [
                *row,
                f"{100 * (v.mean() / truth - 1):+.2f} %",
                f"{t_natural:+.1f}",
                f"{t_log:+.1f}",
                f"{logs.std(ddof=1):.3g}",
                *intervals,
            ]
        )
    return rows


HEAD = ["parameter", "truth", "n", "without", "bias", "t", "t (log)", "sd (log)", "sd/SE", "SE(truth)", "coverage"]
HEAD.append("missed low / high, %")


def main() -> None:
    report = Report("coverage", __doc__)
    replicates = 20 if report.quick else 200
    started = time.perf_counter()
    judged: dict[str, list[tuple[str, list[str]]]] = {}
    for case in cases():
        if report.quick:
            case = replace(case, num_samples=min(case.num_samples, 100_000))
        took, wvs = timed(lambda case=case: wavelet_variances(case, replicates))
        report.say(
            f"# {case.name}: {case.truth}, N = {case.num_samples}, {replicates} replicates",
            f"{case.why[0].upper()}{case.why[1:]}. Simulation and wavelet variance took {seconds(took)}.",
        )
        ways = [(model, None) for model in case.models]
        for model, omega in [ways[0], (case.models[0], "two-step"), *ways[1:]]:
            fit_seconds, fits = timed(lambda m=model, o=omega, w=wvs: fit_all(w, m, o))
            with compilations() as first:
                first_seconds, head = timed(lambda f=fits: parameters(f[:1]))
            with compilations() as later:
                later_seconds, tail = timed(lambda f=fits: parameters(f[1:]))
            rows = rows_of(case, fits, head + tail)
            weights = f"weights={omega!r}" if omega else "default weights"
            report.table(f"{case.name}: fit of {model}, {weights}", HEAD, rows)
            statuses = [f.status.value.split(":")[0] for f in fits]
            ends = {status: statuses.count(status) for status in dict.fromkeys(statuses)}
            report.say(
                f"Status {ends}; {sum(bool(f.at_boundary) for f in fits)} of {len(fits)} with a component at a "
                f"boundary. Fits {seconds(fit_seconds)}; intervals {seconds(first_seconds)} for the first one "
                f"(compiled {first.count} programs), {seconds(later_seconds)} for the others ({later.count})."
            )
            if model == case.models[0]:
                judged.setdefault(weights, []).extend((case.name, row) for row in rows)
    total = time.perf_counter() - started
    report.say(f"All of it took {seconds(total)}.")
    for weights, rows in judged.items():
        outside = [f"{name} {row[0]} {row[10]}" for name, row in rows if not 90 <= float(row[10].split(" +-")[0]) <= 98]
        biased = [f"{name} {row[0]} {row[4]} (t {row[5]})" for name, row in rows if abs(float(row[5])) > 3]
        found = "; ".join(outside) or f"all {len(rows)} parameters inside"
        report.bar(f"coverage of 95 % intervals, {replicates} replicates, {weights}", "90 .. 98 %", found)
        report.bar(f"bias, {weights}", "abs(t) <= 3", "; ".join(biased) or "none beyond")
    report.bar("time of the Monte Carlo", "240 s", seconds(total))
    report.save()


if __name__ == "__main__":
    main()
