"""Tuning by the innovations likelihood on 20 simulated drives of 20 minutes, and the smoother against the filter.

Truth: white noise and a Gauss-Markov process of accelerometers and gyros; the search starts from values that are two to
four times off. Parameters that a drive does not determine are held and marked, and do not count. The smoother: R's
example with the outage in the middle, all runs from stationarity.
"""

import dataclasses
import time

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp
import nav_case as case
import numpy as np
from common import Report, seconds

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.kinematics.rotation import quat_from_rotvec, quat_multiply

RATE = 100.0
TRUTH = nj.ImuErrors(gj.WN(6e-5) + gj.GM(5e-4, 4e-7), gj.WN(1.5e-6) + gj.GM(3e-4, 1e-8), RATE)
GUESS = nj.ImuErrors(gj.WN(1.5e-4) + gj.GM(1e-3, 2e-7), gj.WN(1e-6) + gj.GM(2e-4, 3e-8), RATE)
START = nj.InitialUncertainty(0.05, 0.02, np.deg2rad([0.1, 0.1, 0.5]))
SENSORS = (
    nj.GnssPosition(1.0, horizontal=0.025, vertical=0.05),
    nj.GnssVelocity(1.0, horizontal=0.01, vertical=0.02),
    nj.Barometer(1.0, height=0.5),
)


def drive(seed: int, imu: nj.Imu, reference: nj.Trajectory) -> tuple:
    """A record: IMU, fixes, and the start as far as it is known."""
    keys = jax.random.split(jax.random.key(seed), 6)
    noise = np.stack([np.asarray(gj.simulate(m, len(imu), key=k)) for m, k in zip(TRUTH.models, keys, strict=True)], 1)
    imu = dataclasses.replace(imu, accel=imu.accel + noise[:, :3], gyro=imu.gyro + noise[:, 3:])
    rng = np.random.default_rng(seed)
    t = np.arange(1.0, imu.duration + 0.5)
    at = np.round(t * RATE).astype(int)
    exact = (reference.position[at], reference.velocity[at], -reference.position[at, 2:])
    fixes = [
        nj.Fixes(s, t, x + rng.standard_normal(x.shape) * np.asarray(s.believed))
        for s, x in zip(SENSORS, exact, strict=True)
    ]
    e = rng.standard_normal(9) * np.sqrt(np.diag(START.covariance))
    q = quat_multiply(quat_from_rotvec(jnp.asarray(e[6:])), jnp.asarray(reference.quaternion[0]))
    begin = {"position": reference.position[0] + e[:3], "velocity": reference.velocity[0] + e[3:6]}
    return imu, fixes, {**begin, "quaternion": np.asarray(q), "initial": START}


def main() -> None:
    report = Report("tuning", __doc__)
    tuning(report)
    smoother(report)
    report.save()


def tuning(report: Report) -> None:
    duration, num = (120.0, 2) if report.quick else (1200.0, 20)
    imu, reference = nj.perfect_imu(nj.motions.lemniscate(duration, RATE), RATE, nj.FlatEarth())
    truth = np.array([float(v) for m in (TRUTH.models[0], TRUTH.models[3]) for p in m.processes for v in p.values])
    found, times = [], []
    for i in range(num):
        record, fixes, begin = drive(i, imu, reference)
        start = time.perf_counter()
        found.append(nj.tune(record, fixes, GUESS, every=10, **begin))
        times.append(time.perf_counter() - start)
    rows, z_all = [], []
    for j, name in enumerate(found[0].names):
        seen = [t for t in found if t.observable[j]]
        z = np.array([np.log(t.value[j] / truth[j]) / t.se[j] for t in seen])
        z_all += z.tolist()
        values = [t.value[j] for t in seen]
        inside = f"{np.mean(np.abs(z) < 2) * 100:.0f} %" if len(z) else "-"
        median, se = (f"{np.median(x):.3g}" if seen else "-" for x in (values, [t.se[j] for t in seen]))
        rows.append([name, f"{truth[j]:.3g}", f"{found[0].start[j]:.3g}", f"{len(seen)} of {num}", median, se, inside])
    head = ["parameter", "truth", "start", "observable", "median estimate", "median se (log)", "within 2 se"]
    report.table(f"{num} drives of {duration / 60:g} min", head, rows)
    inside = np.mean(np.abs(z_all) < 2)
    report.say(f"Converged: {sum(t.converged for t in found)} of {num}. First call {seconds(times[0])}.")
    report.bar("tuning: observable parameters within 2 SE", ">= 90 %", f"{100 * inside:.1f} % of {len(z_all)}")
    report.bar("tuning of one drive of 20 min, later calls", "", seconds(float(np.median(times[1:]))))


def smoother(report: Report) -> None:
    duration, num = (90.0, 100) if report.quick else (300.0, 1000)
    outage = (duration - 80.0, duration - 40.0)
    aiding = (
        nj.GnssPosition(horizontal=0.025, vertical=0.05, outages=[outage]),
        nj.GnssVelocity(horizontal=0.01, vertical=0.02, outages=[outage]),
        nj.Barometer(height=0.5),
    )
    scenario = nj.Scenario(case.reference(duration), aiding, START, nj.FlatEarth(case.GRAVITY), every=10)
    full = case.FILTERS["right"]
    errors = nj.ImuErrors(full.models[:3], full.models[3:], RATE)
    both, times = [], []
    for smooth in (False, True):
        start = time.perf_counter()
        both.append(nj.monte_carlo(scenario, errors, smooth=smooth, **case.options(num)))
        times.append(time.perf_counter() - start)
    plain, smooth = both
    inside = (plain.time > outage[0]) & (plain.time < outage[1])
    rms = [np.sqrt(np.mean(np.sum(r.errors("position") ** 2, axis=2), axis=0))[inside] for r in both]
    rows = [[name, f"{x.max():.3f}", seconds(t)] for name, x, t in zip(("filter", "smoother"), rms, times, strict=True)]
    report.table(
        f"Through an outage of 40 s, {num} runs",
        ["", "largest position RMS [m]", "all runs, compilation included"],
        rows,
    )
    below = np.mean(rms[1] < rms[0])
    report.bar("smoother: RMS below the filter's inside the outage", ">= 99 % of epochs", f"{100 * below:.0f} %")
    for group in ("position", "navigation"):
        nees, dof = smooth.nees[group], smooth.dof[group]
        z = (nees.mean(axis=0) - dof) / np.sqrt(2 * dof / num)
        share = np.mean(np.abs(z) < 1.96)
        measured = f"{nees.mean() / dof:.3f} of dof, {100 * share:.0f} % of epochs inside"
        report.bar(f"smoother: NEES of {group} in its 95 % band", "consistent", measured)


if __name__ == "__main__":
    main()
