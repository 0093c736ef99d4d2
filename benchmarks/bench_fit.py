"""GMWM fits: compile, run, fresh process, standard errors; and how low the objective comes, over models and keys.

The peer is R (simts and the branch gmwm2 of gmwm), run earlier on 2 cores: its objectives, estimates and seconds are
those in ../shared/reference, quoted. An objective is sum_j (nu_hat_j - nu_j)^2/(ci_high_j - ci_low_j)^2 in both.
"""

import json
import sys
import time

STARTED = time.perf_counter()
import jax

jax.config.update("jax_enable_x64", True)
from collections import Counter
from dataclasses import replace

import gmwm_jax as gj
from gmwm_jax.variance.replicates import theory_draws

IMPORTED = time.perf_counter()
import numpy as np
from common import Process, Report, compilations, fresh, interleaved, median_process, repeated, seconds, shared, timed

SIX = "WN + RW + 3*GM"
R_SECONDS = 3.086
"""R, GUI fit of 3GM+WN+RW from a wavelet variance, one channel."""
UNITS = {"Gyro": "rad/s", "Accel": "m/s^2"}


def mti_g() -> gj.variance.WaveletVariances:
    """The published wavelet variances of the MTi-G's six channels."""
    library = json.loads(shared("reference", "imu_wv_library.json").read_text())["MTiG"]
    columns = {k: np.column_stack([c[k] for c in library.values()]) for k in ("variance", "ci_low", "ci_high")}
    one = next(iter(library.values()))
    units = tuple(UNITS[name.split(".")[0]] for name in library)
    return gj.variance.WaveletVariances(
        np.array(one["scales"], dtype=float),
        **columns,
        num_samples=one["N"],
        rate=float(one["freq"]),
        channels=tuple(library),
        units=units,
    )


def series() -> dict[str, tuple[gj.variance.WaveletVariance, dict[str, tuple[float, float]]]]:
    """Every wavelet variance that R fitted: name -> (it, model as R writes it -> (R's objective, R's seconds))."""
    published = json.loads(shared("reference", "gmwm_published.json").read_text())["models"]
    result = {
        "MTi-G Gyro.X": (mti_g()["Gyro.X"], {m: (v["R_objective"], v["R_seconds"]) for m, v in published.items()})
    }
    for name, fits in json.loads(shared("reference", "gmwm_fits.json").read_text()).items():
        table = fits["WN"]
        wv = gj.variance.WaveletVariance.from_table(
            table["scales"], table["wv"], table["ci_low"], table["ci_high"], num_samples=1_000_000, rate=100
        )
        result[name] = wv, {m: (v["obj"], v["seconds"]) for m, v in fits.items()}
    return result


def as_text(model: str) -> str:
    """R's ``3GM+WN`` as ``3*GM + WN``."""
    terms = [t if t[0].isalpha() else f"{t[0]}*{t[1:]}" for t in model.split("+")]
    return " + ".join(terms)


def kinds(model: str) -> Counter:
    return Counter({t.lstrip("0123456789"): int(t[0]) if t[0].isdigit() else 1 for t in model.split("+")})


def violations(objectives: dict[str, float]) -> tuple[int, int]:
    """How many pairs of nested models have the larger one with the larger objective, and of how many."""
    pairs = [(a, b) for a in objectives for b in objectives if a != b and kinds(a) <= kinds(b)]
    return sum(objectives[b] > objectives[a] * (1 + 1e-9) for a, b in pairs), len(pairs)


def child(intervals: bool) -> None:
    """A fresh process: six channels, compile and fit, and their intervals."""
    parts = {"import": IMPORTED - STARTED}
    wv = mti_g()
    parts["fit"], fits = timed(lambda: gj.fit(wv, SIX))
    if intervals:
        parts["intervals"], _ = timed(lambda: [f.parameters() for f in fits.values()])
    print(json.dumps(parts))


def main() -> None:
    report = Report("fit", __doc__)
    if shared("reference") is None:
        return
    speed(report)
    batches(report)
    standard_errors(report)
    quality(report)
    keys(report)
    report.save()


def speed(report: Report) -> None:
    repeats = 1 if report.quick else 5
    imports = ("import jax", "import gmwm_jax", "import gmwm_jax.app.cli")
    ways = {f"`{statement}`": ("-c", statement) for statement in imports}
    ways[f"import, fit {SIX}, six channels"] = (__file__, "--child")
    ways["the same and their intervals"] = (__file__, "--child", "--intervals")
    runs: dict[str, list[Process]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, arguments in ways.items():
            runs[name].append(fresh(*arguments))
    rows = []
    for name, done in runs.items():
        one, peak = median_process(done), max(p.peak_mib for p in done)
        parts = one.answer if "--child" in ways[name] else {}
        rows.append([name, seconds(one.wall), seconds(one.cpu), f"{peak:.0f} MiB"])
        rows[-1].append(", ".join(f"{part} {seconds(took)}" for part, took in parts.items()))
    head = ["", "wall", "CPU", "peak RSS", "of it"]
    report.table(f"Fresh processes, median of {repeats} in turn, no persistent cache", head, rows)
    cold = {name: median_process(done) for name, done in runs.items()}
    one = cold["`import gmwm_jax`"]
    report.bar("`import gmwm_jax`, fresh", "1.5 s", f"{seconds(one.wall)} (CPU {seconds(one.cpu)})")
    r_six = f"R {6 * R_SECONDS:.1f} s (6 x {R_SECONDS:.2f}, quoted)"
    fits = f"fit {SIX}, six channels from WVs"
    one = cold[f"import, fit {SIX}, six channels"]
    measured = f"{seconds(one.wall)} (CPU {seconds(one.cpu)})"
    report.bar(f"{fits}: import + compile + fit, fresh", "5 s", measured, r_six, f"{one.wall / 6 / R_SECONDS:.2f}")

    wv = mti_g()
    adis = shared("data", "adis_16405_imu1.rda")
    with compilations() as compiled:
        first, _ = timed(lambda: gj.fit(wv, SIX, throw=False))
    single = wv["Gyro.X"]
    warm = interleaved(
        {
            "MTi-G, six channels": lambda: gj.fit(wv, SIX, throw=False),
            "MTi-G, Gyro.X alone": lambda: gj.fit(single, SIX, throw=False),
        },
        max(2 * repeats, 3),
    )
    six = warm["MTi-G, six channels"]
    rows = [["MTi-G, six channels", seconds(first), f"{seconds(compiled.seconds)} ({compiled.count})", six]]
    alone = warm["MTi-G, Gyro.X alone"]
    rows.append(["MTi-G, Gyro.X alone", seconds(alone.first), "", alone])
    if adis is not None:
        read_seconds, record = timed(lambda: gj.read_recording(adis))
        wv_timing = repeated(lambda: gj.wavelet_variance(record), repeats)
        adis_wv = gj.wavelet_variance(record)
        fit_timing = repeated(lambda: gj.fit(adis_wv, SIX, throw=False), max(repeats, 2))
        rows.append(["ADIS16405, six channels, from its wavelet variance", seconds(fit_timing.first), "", fit_timing])
        rows.append(["- its wavelet variance (6 x 1e6)", seconds(wv_timing.first), "", wv_timing])
        rows.append(["- reading the .rda", seconds(read_seconds), "", ""])
    head = ["", "first call", "of it XLA compile (programs)", "warm, median (range)"]
    report.table(f"Fit of {SIX}", head, rows)
    report.bar(f"{fits}: warm", "0.3 s", seconds(six.median), r_six, f"{six.median / 6 / R_SECONDS:.3f}")


def batches(report: Report) -> None:
    """The pure estimator over wavelet variances that scatter as the data do: compile and run apart."""
    wv, rows = mti_g()["Gyro.X"], []
    num = 100 if report.quick else 1000
    for model in ("WN + GM", "WN + RW + GM", SIX):
        f = gj.fit(wv, model, throw=False)
        draw = theory_draws(f.model, wv, np.asarray(f.wv_covariance))
        nu = draw(jax.random.split(jax.random.key(0), num))

        def one(nu, model=model):
            return gj.fitting.estimate(replace(wv, variance=nu), model).objective

        program = jax.jit(jax.vmap(one)).lower(nu)
        compiling, program = timed(program.compile)
        timing = repeated(lambda program=program, nu=nu: program(nu).block_until_ready(), 1 if report.quick else 3)
        rows.append([model, seconds(compiling), timing])
        if model == "WN + GM":
            report.bar(f"{num} fits of {model} in one vmapped call", "3 s", seconds(timing.median))
    report.table(f"`estimate`, {num} wavelet variances in one vmapped call", ["model", "compile", "run"], rows)


def standard_errors(report: Report) -> None:
    wv, rows = mti_g(), []
    fits = list(gj.fit(wv, SIX, throw=False).values())
    for what, of in (
        ("`fit.wv_covariance`", lambda f: f.wv_covariance),
        ("`fit.covariance` (given the former)", lambda f: f.covariance),
        ("`fit.parameters()` (given the former)", lambda f: f.parameters()),
        ("`fit.continuous()` (given the former)", lambda f: f.continuous()),
    ):
        with compilations() as compiled:
            first, _ = timed(lambda of=of: of(fits[0]))
        rest = [timed(lambda of=of, f=f: of(f))[0] for f in fits[1:]]
        rows.append([what, seconds(first), f"{seconds(compiled.seconds)} ({compiled.count})"])
        rows[-1] += [seconds(sorted(rest)[len(rest) // 2]), f"{seconds(min(rest))} .. {seconds(max(rest))}"]
    head = ["", "first fit", "of it XLA compile (programs)", "others, median", "range"]
    report.table(
        f"Standard errors, {SIX} on the MTi-G (N = 873684, J = 18); others compile where boundaries differ", head, rows
    )


def quality(report: Report) -> None:
    best = json.loads(shared("reference", "gmwm_published.json").read_text())["models"]
    repeats = 2 if report.quick else 5
    times, rows, counts = [], [], []
    worst_r, worst_best = (0.0, ""), (0.0, "")
    for name, (wv, models) in series().items():
        ours = {}
        for model, (r_objective, r_seconds) in models.items():
            with compilations() as compiled:
                first, f = timed(lambda wv=wv, m=model: gj.fit(wv, as_text(m), throw=False))
            ours[model] = f.objective
            if name in ("MTi-G Gyro.X", "imu1.1"):
                warm = repeated(lambda wv=wv, m=model: gj.fit(wv, as_text(m), throw=False), repeats)
                times.append([name, model, seconds(first), seconds(compiled.seconds), seconds(warm.median)])
                times[-1] += [f"{r_seconds:.2f} s", f"{warm.median / r_seconds:.4f}"]
            known = best[model]["best_known_objective"] if name == "MTi-G Gyro.X" else None
            ratio = f.objective / r_objective
            worst_r = max(worst_r, (ratio, f"{name} {model}"))
            if known:
                worst_best = max(worst_best, (f.objective / known, f"{name} {model}"))
            row = [name, model, f"{f.objective:.8g}", f"{r_objective:.8g}", f"{ratio:.6f}"]
            row += [f"{f.objective / known - 1:+.1e}" if known else "", f.status.name, f"{f.agreement:.2f}"]
            rows.append([*row, "; ".join(f"{k}: {v.name.lower().replace('_', ' ')}" for k, v in f.at_boundary.items())])
        ours_bad, pairs = violations(ours)
        r_bad, _ = violations({m: r for m, (r, _) in models.items()})
        counts.append([name, pairs, ours_bad, r_bad])
    counts.append(["all", *(sum(c[i] for c in counts) for i in (1, 2, 3))])
    head = ["series", "model", "first call", "of it XLA compile", "warm", "R (quoted)", "warm / R"]
    report.table("One channel: compile and run over the models", head, times)
    head = ["series", "model", "objective", "R's", "ratio", "over best known", "status", "agreement", "at boundary"]
    report.table("Objectives", head, rows)
    head = ["series", "pairs of nested models", "ours: larger model worse", "R: larger model worse"]
    report.table("Nestedness", head, counts)
    pairs, ours_bad, r_bad = counts[-1][1:]
    report.bar("objective over R's, worst of 39 fits", "<= 1", f"{worst_r[0]:.7f} ({worst_r[1]})")
    report.bar("objective over best known, worst of 7", "1", f"1 {worst_best[0] - 1:+.1e} ({worst_best[1]})")
    report.bar("nested models with a higher objective", "0", f"{ours_bad} of {pairs}", f"R {r_bad} of {pairs}")


def keys(report: Report) -> None:
    wv, rows, worst = mti_g(), [], 0.0
    count = 3 if report.quick else 20
    for model in ("WN + GM", "WN + RW + 2*GM", SIX, "WN + QN + RW + 3*GM", "WN + RW + 4*GM"):
        plain = gj.fit(wv, model, throw=False)
        fits = [gj.fit(wv, model, key=jax.random.key(i), throw=False) for i in range(count)]
        objectives = np.array([[f.objective for f in one.values()] for one in (plain, *fits)])
        spread = objectives.max(axis=0) / objectives.min(axis=0) - 1
        values = np.array([[[e.value for e in bare(f)] for f in one.values()] for one in fits])
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = values.max(axis=0) / values.min(axis=0) - 1
        stalled = sum(f.status.name != "converged" for one in fits for f in one.values())
        row = [model, f"{spread.max():.1e} ({wv.channels[int(spread.argmax())]})", f"{np.nanmax(moved):.1e}"]
        agreement = min(f.agreement for one in fits for f in one.values())
        rows.append([*row, f"{int(np.sum(spread > 1e-6))} of 6", f"{agreement:.2f}", stalled])
        if model == SIX:
            worst = spread.max()
    head = ["model", "objective: max/min - 1 (channel)", "parameters: max/min - 1", "channels beyond 1e-6"]
    head += ["lowest agreement", "not converged"]
    report.table(f"Agreement of {count} keys (and none) on the MTi-G's six channels", head, rows)
    report.bar(f"{count} keys, {SIX}, six channels: spread of the objective", "0", f"{worst:.1e}")


def bare(fit: gj.Fit) -> gj.fitting.EstimateTable:
    """Estimates without intervals, which take time."""
    return replace(fit, wv=replace(fit.wv, num_samples=None)).parameters()


if __name__ == "__main__":
    child("--intervals" in sys.argv) if "--child" in sys.argv else main()
