"""Monte Carlo of INS/GNSS/baro filters: R's example (300 s, 30,001 epochs, GNSS and baro at 1 Hz, 40 s outage).

The peer is R's navigation 0.0.2 on the same kind of machine with OpenBLAS on two processes, 1.75 s per run (quoted; its
covariance every step; 1.25 s with every 10th, where it reuses a stale transition). A run here is a whole one: errors
drawn, filter, statistics; the columns say what each part takes. Compile time is that of XLA in the first call.
"""

import time

import jax

jax.config.update("jax_enable_x64", True)

from common import Report, compilations, fresh, seconds
from nav_case import errors, options, scenario

from nav_jax.filter.experiment import draw_inputs, gains_of, prepare, run_filter, run_keys
from nav_jax.imu.emulation import write_out
from nav_jax.simulation.campaign import monte_carlo

PEER = {1: 1.75, 10: 1.25}
MODES = {"every step": ("estimate", 1), "every 10th": ("estimate", 10), "reference": ("reference", 1)}
BARS = {"every step": 0.02, "every 10th": 0.006, "reference": 0.0012}


def timed_runs(num_runs, gains, every, believed=None, **extra):
    """Seconds of a first and the best of two later calls, and seconds of XLA's compilation in the first."""
    where, truth = scenario(every=every), errors()
    spans = []
    with compilations() as compiled:
        for _ in range(3):
            start = time.perf_counter()
            runs = monte_carlo(where, truth, believed, gains=gains, **options(num_runs), **extra)
            spans.append(time.perf_counter() - start)
            assert runs.num_good == num_runs
    return spans[0], min(spans[1:]), compiled.seconds


def parts(report: Report) -> None:
    """One chunk on one thread: what each filter takes with errors given as arrays, and what drawing them adds."""
    size = 64
    rows = []
    truth, case = errors(), options(size)
    for name, (gains, every) in MODES.items():
        experiment = prepare(scenario(every=every), rate=100.0)
        keys = run_keys(case["key"], 0, size)
        shared = gains_of(experiment, truth) if gains == "reference" else None

        def best(f):
            jax.block_until_ready(f())
            spans = []
            for _ in range(1 if report.quick else 4):
                start = time.perf_counter()
                jax.block_until_ready(f())
                spans.append(time.perf_counter() - start)
            return min(spans)

        inputs = draw_inputs(experiment, truth, keys)
        timeline = experiment.timeline
        given = inputs._replace(errors=write_out(inputs.errors, timeline.ends[timeline.pattern]))
        alone, run = (best(lambda e=experiment, i=i, s=shared: run_filter(e, truth, i, s)) for i in (given, inputs))
        rows.append([name, *(seconds(t / size) for t in (alone, run)), f"{run / size / 30000 * 1e6:.3f} us"])
    head = ["covariance", "errors given, per run", "errors drawn, per run", "drawn, per step and run"]
    report.table(f"One chunk of {size} runs in one call, on one core", head, rows)


def main() -> None:
    report = Report("nav", __doc__)
    num_runs = 64 if report.quick else 200
    rows = []
    for name, (gains, every) in MODES.items():
        first, again, compiling = timed_runs(num_runs, gains, every)
        per_run, peer = again / num_runs, PEER[every]
        rows.append([name, num_runs, seconds(first), seconds(compiling), seconds(again), seconds(per_run)])
        rows[-1] += [f"{peer:g} s", f"{peer / per_run:.0f}"]
        what = f"24 states, 30,001 epochs, {num_runs} runs, covariance {name}: per run, errors drawn"
        report.bar(what, f"{BARS[name]:g} s", seconds(per_run), f"{peer:g} s (R, quoted)", f"{per_run / peer:.4f}")
    head = ["covariance", "runs", "first call", "of it XLA", "second call", "per run", "R", "times faster"]
    report.table("24 states, whole runs through monte_carlo", head, rows)
    parts(report)

    rows = []
    cases = {9: errors(0, 0), 24: errors(), 39: errors(3, 2, repeat=2)}
    for states, believed in cases.items():
        for chunk in (16, 32, 64):
            if report.quick and (states, chunk) != (24, 32):
                continue
            runs = 4 * chunk if report.quick else 128
            _, again, _ = timed_runs(runs, "estimate", 1, believed, chunk_size=chunk)
            rows.append([states, runs, chunk, seconds(again), seconds(again / runs)])
    report.table("States x chunk, covariance every step", ["states", "runs", "chunk", "second call", "per run"], rows)

    rows = []
    for runs, duration in ((64, 300.0), (256, 300.0), (128, 75.0), (128, 150.0)):
        if report.quick and runs > 64:
            continue
        _, again, _ = timed_runs(runs, "estimate", 1, duration=duration)
        epochs = int(100 * duration)
        rows.append([runs, epochs, seconds(again), f"{again / runs / epochs * 1e6:.3f} us"])
    report.table("Linear in runs and epochs", ["runs", "epochs", "second call", "per run and epoch"], rows)

    rows = []
    for gains, every in (("estimate", 1), ("estimate", 10), ("reference", 1)):
        runs = 32 if report.quick else 500
        done = fresh("benchmarks/bench_nav_process.py", str(runs), gains, str(every))
        peer = PEER[every] * 3 * runs
        rows.append([gains, every, runs, seconds(done.wall), seconds(done.cpu), f"{done.peak_mib:.0f} MiB"])
        if gains == "estimate":
            what = f"three models x {runs} runs, whole process, covariance every {every}"
            measured = f"{seconds(done.wall)}, {done.peak_mib:.0f} MiB"
            report.bar(what, "45 s, 1907 MiB (2 GB)", measured, f"{peer:.0f} s (R, quoted)", f"{done.wall / peer:.4f}")
    head = ["gains", "every", "runs", "wall", "CPU", "peak RSS"]
    report.table("Comparison of three models in a fresh process, compilation included", head, rows)
    report.say("```\n" + "\n".join(done.stdout.strip().splitlines()[:-1]) + "\n```")
    report.save()


if __name__ == "__main__":
    main()
