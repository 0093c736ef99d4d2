"""Several records: joint fit of six units, what follows from it, and the size, power and coverage of the tests.

The peer is R's mgmwm 0.1.0 on the same kind of machine (quoted): six ADIS 16405 units x 1e6, gyro X. Its optimiser is
Nelder-Mead from one start a record; its resampling has 50 sets of AR1 + WN + RW, its model selection 4 units x 5e4 and
7 nested models (a deliberate pause of 1 s included). Compile time is that of XLA in the first call.
"""

import time
from collections.abc import Callable
from itertools import combinations
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np
from common import Report, compilations, seconds, shared

import gmwm_jax as gj

MODEL = "WN + RW + 2*GM"
R_OBJECTIVES = {"AR1 + WN + RW": 637.0969, "2*AR1 + WN + RW": 630.3238}
TRUTH = "WN(sigma2=1.0) + GM(beta=0.03, variance=0.2)"
NUM_SAMPLES, NUM_RECORDS = 20_000, 4
LEVEL = 0.05


def main() -> None:
    report = Report("records", __doc__)
    files = [shared("data", f"adis_16405_imu{i}.rda") for i in range(1, 7)]
    if all(files):
        recordings = [gj.read_recording(file)["gyro_x"] for file in files]
        objectives(report, recordings)
        speed(report, recordings)
        selection_speed(report, recordings)
    size_and_power(report)
    coverage(report)
    recommended(report)
    report.save()


def thrice(function: Callable[[], Any]) -> tuple[Any, list[str], float]:
    """The result; first call, compilation in it, and the faster of two more as text; and that as a number."""
    spans = []
    with compilations() as compiled:
        for _ in range(3):
            start = time.perf_counter()
            result = function()
            spans.append(time.perf_counter() - start)
    again = min(spans[1:])
    return result, [seconds(spans[0]), seconds(compiled.seconds), seconds(again)], again


def objectives(report: Report, recordings: list[gj.Recording]) -> None:
    wvs = [gj.wavelet_variance(r) for r in recordings]
    rows = []
    for model, theirs in R_OBJECTIVES.items():
        ours = gj.fit_records(wvs, model).objective
        rows.append([model, f"{theirs:.4f}", f"{ours:.7f}"])
        report.bar(f"joint objective, six units, {model}", f"<= {theirs} (R)", f"{ours:.4f}")
    report.table("Joint objectives of six units, gyro X, 18 scales", ["model", "R", "here"], rows)


def speed(report: Report, recordings: list[gj.Recording]) -> None:
    rows = []

    def row(what: str, function: Callable[[], Any], bar: str = "", peer: float | None = None) -> Any:
        result, texts, again = thrice(function)
        rows.append([what, *texts])
        if bar:
            quoted, ratio = (f"{peer:g} s (R, quoted)", f"{again / peer:.4f}") if peer else ("", "")
            report.bar(what, bar, texts[-1], quoted, ratio)
        return result

    wvs = row("wavelet variances of 6 x 1e6", lambda: [gj.wavelet_variance(r) for r in recordings], "-", 2.7)
    joint = row(f"joint fit of 6 units, {MODEL}, from their wavelet variances", lambda: gj.fit_records(wvs, MODEL))
    what = f"joint fit of 6 x 1e6, {MODEL}, wavelet variances included"
    row(what, lambda: gj.fit_records(recordings, MODEL), "3 s", 20.63)  # 2.70 + 17.93
    two_step = gj.fit_records(wvs, MODEL, weights="two-step")
    row("the same with two-step weights", lambda: gj.fit_records(wvs, MODEL, weights="two-step"))
    row("tables with intervals by theory", lambda: str(gj.fit_records(wvs, MODEL)))
    small = gj.fit_records(wvs, "WN + RW + GM")
    row("all 462 sets of 6 records, WN + RW + GM", lambda: gj.multisignal.resample_records(small), "-", 18.6)
    row(f"all 462 sets of 6 records, {MODEL}", lambda: gj.multisignal.resample_records(joint))
    row("each record alone, Cochran", lambda: gj.multisignal.compare_records(gj.fit_records(wvs, MODEL)))
    key = jax.random.key(1)
    test = row("near-stationarity, 500 replicates", lambda: gj.multisignal.near_stationarity(two_step, 500, key=key))
    report.table(
        "Six ADIS 16405 units, gyro X, 1e6 samples each", ["what", "first call", "of it XLA", "later call"], rows
    )
    report.say(f"```\n{gj.multisignal.compare_records(two_step)}\n\n{test}\n```")


def selection_speed(report: Report, recordings: list[gj.Recording]) -> None:
    """R's case: four units of 5e4 samples, all sub-models of one."""
    wvs = [gj.wavelet_variance(r.data[:50_000, 0], rate=r.rate) for r in recordings[:4]]
    parts = ("WN", "RW", "GM")
    models = [" + ".join(c) for n in (1, 2, 3) for c in combinations(parts, n)]
    cv, texts, again = thrice(lambda: gj.multisignal.cross_validate(wvs, models))
    head = ["models", "splits", "first call", "of it XLA", "later call"]
    report.table("Cross-validation of 4 units x 5e4", head, [[len(models), len(cv.splits), *texts]])
    report.bar("cross-validation, 4 x 5e4, 7 models", "-", texts[-1], "22.8 s (R, quoted)", f"{again / 22.8:.4f}")
    report.say(f"```\n{cv}\n```")


def simulated(num_records: int, seed: int, spread: float = 0.0) -> list[gj.variance.WaveletVariance]:
    """Wavelet variances of simulated records; correlation times scatter by `spread` in the log."""
    keys = jax.random.split(jax.random.key(seed), num_records)
    betas = 0.03 * np.exp(spread * np.random.default_rng(seed).normal(size=num_records))

    @jax.jit
    @jax.vmap
    def draw(key: Any, beta: Any) -> Any:
        return gj.simulate(gj.WN(1.0) + gj.GM(beta=beta, variance=0.2), NUM_SAMPLES, key=key)

    wvs = []
    for first in range(0, num_records, 100):
        x = np.asarray(draw(keys[first : first + 100], betas[first : first + 100]))
        wvs += [gj.wavelet_variance(row) for row in x]
    return wvs


def groups(wvs: list[gj.variance.WaveletVariance], size: int) -> list[list[gj.variance.WaveletVariance]]:
    return [wvs[i : i + size] for i in range(0, len(wvs), size)]


def size_and_power(report: Report) -> None:
    num, replicates = (50, 99) if report.quick else (500, 199)
    rows = []
    for spread, sets in ((0.0, num), (0.2, num // 5), (0.5, num // 5)):
        near, together, alone = [], [], []
        for b, wvs in enumerate(groups(simulated(NUM_RECORDS * sets, 3 + round(10 * spread), spread), NUM_RECORDS)):
            joint = gj.fit_records(wvs, "WN + GM", weights="two-step")
            key = jax.random.fold_in(jax.random.key(5), b)
            near.append(gj.multisignal.near_stationarity(joint, replicates, key=key).p_value <= LEVEL)
            comparison = gj.multisignal.compare_records(joint)
            together.append(comparison.p_value <= LEVEL)
            alone.append(comparison["GM", "beta"].p_value <= LEVEL)
        shares = [f"{100 * np.mean(x):.1f} %" for x in (near, together, alone)]
        rows.append([f"{spread:g}", sets, *shares])
        if spread == 0:
            report.bar(f"near-stationarity: size at 5 %, {sets} sets of {NUM_RECORDS} records", "3-7.5 %", shares[0])
            report.bar("Cochran, all parameters: size at 5 %, the same sets", "3-7.5 %", shares[1])
    head = ["scatter of the correlation time", "sets", "near-stationarity", "Cochran, all", "Cochran, GM beta"]
    report.table(f"Rejected at 5 %: {NUM_RECORDS} records x {NUM_SAMPLES}, WN + GM", head, rows)


def coverage(report: Report) -> None:
    """Intervals of sets of records with the same parameters."""
    num, truth = 50 if report.quick else 1000, np.array([1.0, 0.03, 0.2])
    inside = {"theory": np.zeros(3), "resampling, t": np.zeros(3), "resampling, percentile": np.zeros(3)}
    for wvs in groups(simulated(NUM_RECORDS * num, 2), NUM_RECORDS):
        joint = gj.fit_records(wvs, "WN + GM", weights="two-step")
        sets = gj.multisignal.resample_records(joint)
        theory = np.array([[e.ci_low, e.ci_high] for e in joint.parameters()]).T
        for kind, (low, high) in zip(inside, (theory, sets.interval("t"), sets.interval("percentile")), strict=True):
            inside[kind] += (low < truth) & (truth < high)
    head = ["95 % intervals", "WN sigma2", "GM beta", "GM variance"]
    covered = [[kind, *(f"{100 * c / num:.1f} %" for c in counts)] for kind, counts in inside.items()]
    report.table(f"Coverage, {num} sets of {NUM_RECORDS} records with the same parameters", head, covered)
    report.say(
        f"Percentiles of {NUM_RECORDS} records state a coverage of {100 * sets.percentile_coverage(0.95):.0f} %. One "
        f"standard error: {100 * np.sqrt(0.95 * 0.05 / num):.1f} %."
    )
    for kind, bar in (("theory", "91-98.5 %"), ("resampling, t", "92.5-97.5 %")):
        low, high = 100 * min(inside[kind]) / num, 100 * max(inside[kind]) / num
        what = f"95 % intervals of a joint fit, {kind}: coverage of three parameters, {num} sets"
        report.bar(what, bar, f"{low:.1f}-{high:.1f} %")


def recommended(report: Report) -> None:
    """How often cross-validation recommends the model that made the records."""
    num = 5 if report.quick else 50
    models = ["WN", "WN + RW", "WN + GM", "WN + RW + GM", "WN + 2*GM"]
    counts = dict.fromkeys(models, 0)
    equivalent = 0
    for wvs in groups(simulated(6 * num, 9), 6):
        cv = gj.multisignal.cross_validate(wvs, models)
        counts[cv.recommended.model] += 1
        equivalent += cv["WN + GM"].equivalent
    rows = [[model, count] for model, count in counts.items()]
    report.table(f"Recommended by cross-validation over 6 records made by WN + GM, {num} sets", ["model", "sets"], rows)
    report.bar(
        f"cross-validation recommends the truth, {num} sets of 6 records",
        "90 %",
        f"{100 * counts['WN + GM'] / num:.0f} %",
    )
    report.say(f"The truth is marked as equivalent to the best in {100 * equivalent / num:.0f} %.")


if __name__ == "__main__":
    main()
