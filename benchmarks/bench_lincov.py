"""Linear covariance analysis: against Monte Carlo, its derivatives, and how long it takes.

R's example: 300 s of lemniscate at 100 Hz (30,000 steps), 40 s without GNSS, filters with 24, 9 and 15 states against a
truth with 15 sensor states. The peer has no such analysis: what it replaces is a Monte Carlo of some 500 runs, for
which R's navigation takes 14 min a filter.
"""

import sys
import time

import jax

jax.config.update("jax_enable_x64", True)
if "--many" in sys.argv:
    jax.config.update("jax_num_cpu_devices", 2)

import equinox as eqx
import jax.numpy as jnp
import nav_case as case
import numpy as np
from common import Report, fresh, interleaved, repeated, seconds

import gmwm_jax as gj
import nav_jax as nj

R_SECONDS = 840.0
"""R's navigation, 500 runs of one filter on two cores."""
BLOCKS = ("position", "velocity", "attitude")


def main() -> None:
    if "--memory" in sys.argv:
        return memory()
    if "--many" in sys.argv:
        return time_many()
    report = Report("lincov", __doc__)
    duration = 60.0 if report.quick else 300.0
    accuracy(report, duration, 200 if report.quick else 2000)
    truth, right = case.FILTERS["right"], case.FILTERS["right"]
    times = {}
    for every in (1, 10):
        e = nj.filter.prepare(case.scenario(duration, every), rate=100.0)
        motion = nj.lincov.motion_of(e)
        times[every] = repeated(lambda e=e, m=motion: nj.lincov.linear_covariance(e, truth, right, motion=m))
        if every == 10:
            many(report)
        else:
            derivatives(report, e, motion)
    rows = [[f"every {n}", seconds(t.first), str(t), f"{R_SECONDS / t.median:,.0f}"] for n, t in times.items()]
    report.table(
        "One analysis, 24 + 15 states", ["covariance step", "first call", "later calls", "R's Monte Carlo / this"], rows
    )
    peer = seconds(R_SECONDS)
    for n, goal in ((1, "1.5 s"), (10, "0.3 s")):
        ratio = f"{R_SECONDS / times[n].median:,.0f}"
        report.bar(
            f"covariance analysis, every {n}", f"<= {goal}", seconds(times[n].median), f"R Monte Carlo {peer}", ratio
        )
    report.save()


def accuracy(report: Report, duration: float, num: int) -> None:
    """True RMS and NEES against runs."""
    scenario = case.scenario(duration, every=10)
    analysis = nj.analyse(scenario, case.FILTERS["right"], case.FILTERS)
    start = time.perf_counter()
    runs = nj.compare(scenario, case.FILTERS["right"], case.FILTERS, **case.options(num))
    wall = time.perf_counter() - start
    rows, worst = [], {"within": 1.0, "end": 0.0, "nees": 0.0}
    for name, c in analysis.items():
        r, k = runs[name], c.epoch()
        for block in BLOCKS:
            squares = np.sum(r.errors(block) ** 2, axis=2)
            seen = np.sqrt(squares.mean(axis=0))
            z = (squares.mean(axis=0) - c.rms(block) ** 2) / (squares.std(axis=0) / np.sqrt(num))
            within, end = np.mean(np.abs(z) < 4), c.rms(block)[k] / seen[k] - 1
            rows.append(
                [
                    name,
                    block,
                    f"{100 * within:.1f} %",
                    f"{seen[k]:.5g}",
                    f"{c.rms(block)[k]:.5g}",
                    f"{100 * end:+.1f} %",
                ]
            )
            worst["within"], worst["end"] = min(worst["within"], within), max(worst["end"], abs(end))
        late = c.time >= min(20.0, duration / 2)  # before, errors are those of a start that is known nearly exactly
        ratio = c.nees("navigation")[late] / r.nees["navigation"].mean(axis=0)[late] - 1
        worst["nees"] = max(worst["nees"], np.abs(ratio).max())
        values = [r.nees["navigation"].mean(axis=0)[k], c.nees("navigation")[k]]
        rows.append(
            [name, "NEES of 9", "", *(f"{x:.4g}" for x in values), f"{100 * np.abs(ratio).max():.1f} % at most"]
        )
    head = ["filter", "", "epochs within 4 SE", f"{num} runs (EKF)", "analysis", "difference at the end"]
    report.table("Against Monte Carlo", head, rows)
    c = analysis["right"]
    sd = np.sqrt(np.diagonal(c.claimed[:, :9, :9], axis1=1, axis2=2))
    off = np.max(np.abs(c.true - c.claimed)[:, :9, :9] / (sd[:, :, None] * sd[:, None, :]))
    report.bar("analysis against Monte Carlo: epochs within 4 SE", ">= 95 %", f"{100 * worst['within']:.1f} %", "", "")
    report.bar("RMS at the end of the outage", "within 5 %", f"{100 * worst['end']:.1f} %", "", "")
    report.bar(
        "expected NEES after 20 s",
        "within 5 %",
        f"{100 * worst['nees']:.1f} %",
        f"{num} runs: {seconds(wall)}",
        "",
    )
    report.bar("right model: claimed = true", "1e-9", f"{off:.1e}", "", "")


def many(report: Report) -> None:
    """64 filters at once, in a process with a device for each core."""
    seen = fresh(__file__, "--many").answer
    names = {"1": "one", "64, jax.vmap": "mapped", "64, stacked": "all", "64, stacked, on both cores": "shared"}
    rows = [[n, seconds(seen[k])] for n, k in names.items()]
    report.table("Filters with 6 states in one call, a truth with 15, every 10", ["filters", "later calls"], rows)
    for name, k in (("one core", "all"), ("both cores", "shared")):
        report.bar(f"64 filters in one call over one, {name}", "<= 20", f"{seen[k] / seen['one']:.1f}", "", "")


def time_many() -> None:
    """In a fresh process: seconds for one filter, for 64, and for 64 that two devices share."""
    import json

    e = nj.filter.prepare(case.scenario(every=10), rate=100.0)
    motion = nj.lincov.motion_of(e)

    def build(s):
        accel, gyro = gj.WN(s * 6e-5) + gj.GM(1e-4, 2e-7), gj.WN(1.5e-6 * s) + gj.GM(1e-4, 7e-9)
        return nj.ImuErrors(accel, gyro, 100.0, start="zero")

    @eqx.filter_jit
    def positions(scale):
        filters = jax.vmap(build)(scale)
        return nj.lincov.linear_covariance(e, case.FILTERS["right"], filters, motion=motion).true.navigation[:, -1]

    @eqx.filter_jit
    def mapped(scale):
        def one(s):
            return nj.lincov.linear_covariance(e, case.FILTERS["right"], build(s), motion=motion).true.navigation[-1]

        return jax.vmap(one)(scale)

    scale = jnp.linspace(0.5, 2.0, 64)
    mesh = jax.make_mesh((2,), ("filters",), axis_types=(jax.sharding.AxisType.Auto,))
    shared = jax.device_put(scale, jax.NamedSharding(mesh, jax.P("filters")))
    given = {"one": scale[:1], "all": scale, "shared": shared}
    functions = {name: lambda x=x: positions(x) for name, x in given.items()} | {"mapped": lambda: mapped(scale)}
    print(json.dumps({name: time.median for name, time in interleaved(functions, 9).items()}))


def cost(e: nj.filter.Experiment, motion: object):
    """A scalar of all 11 + 11 parameters of truth and filter, and where it is taken."""
    white, shapes = jnp.log(jnp.array([5.99e-5, 1.504e-6])), [*case.ACCEL, *case.GYRO]
    start = jnp.concatenate([white, jnp.array([x for phi, q in shapes for x in (np.log(-np.log(phi)), np.log(q))])])

    def errors(x):
        phi, q = jnp.exp(-jnp.exp(x[2::2])), jnp.exp(x[3::2])
        accel, gyro = gj.WN(jnp.exp(x[0])), gj.WN(jnp.exp(x[1]))
        for i in range(len(shapes)):
            if i < len(case.ACCEL):
                accel = accel + gj.AR1(phi[i], q[i])
            else:
                gyro = gyro + gj.AR1(phi[i], q[i])
        return nj.ImuErrors(accel, gyro, 100.0, start="zero")

    def value(x):
        true, believed = jnp.split(x, 2)
        found = nj.lincov.linear_covariance(e, errors(true), errors(believed), motion=motion)
        return jnp.log(jnp.trace(found.true.navigation[-1, :3, :3]))

    # the filter beside its optimum, where all derivatives would vanish
    return value, jnp.concatenate([start, start + 0.3])


def derivatives(report: Report, e: nj.filter.Experiment, motion: object) -> None:
    """Reverse mode by all parameters of truth and filter against forward mode and differences."""
    value, at = cost(e, motion)
    forward = np.asarray(jax.jit(jax.jacfwd(value))(at))
    plain, backward = jax.jit(value), jax.jit(jax.grad(value))
    t_plain, t_back = repeated(lambda: plain(at), 3), repeated(lambda: backward(at), 3)
    reverse, h = np.asarray(backward(at)), 2e-2
    steps = h * np.eye(len(at))
    differences = np.array(
        [(8 * (plain(at + d) - plain(at - d)) - plain(at + 2 * d) + plain(at - 2 * d)) / (12 * h) for d in steps]
    )
    scale = np.abs(differences).max()
    off = [np.max(np.abs(a - b) / (np.abs(b) + 1e-4 * scale)) for a, b in ((reverse, forward), (forward, differences))]
    ratio = t_back.median / t_plain.median
    peak = fresh(__file__, "--memory").answer
    rows = [["value", seconds(t_plain.first), str(t_plain)], ["gradient, reverse", seconds(t_back.first), str(t_back)]]
    report.table(f"Derivatives by {len(at)} parameters, 30,000 steps", ["", "first call", "later calls"], rows)
    report.bar("reverse = forward", "1e-5", f"{off[0]:.1e}", "", "")
    report.bar("forward = central differences", "1e-5", f"{off[1]:.1e}", "", "")
    report.bar("gradient over value", "<= 6", f"{ratio:.1f}", "", "")
    report.bar("peak memory of a process that takes it", "<= 2 GB", f"{peak['peak_mib'] / 1024:.2f} GiB", "", "")


def memory() -> None:
    """In a fresh process: its peak memory after one gradient."""
    import json
    import resource

    e = nj.filter.prepare(case.scenario(), rate=100.0)
    value, at = cost(e, nj.lincov.motion_of(e))
    jax.block_until_ready(jax.jit(jax.grad(value))(at))
    print(json.dumps({"peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}))


if __name__ == "__main__":
    main()
