"""Estimate and claim of one epoch belong together: at the start, before, at, after and between fixes, and at the end.

Forty records of six seconds at 20 Hz. GNSS comes three times a second, between the samples for the most part, a
barometer twice, from the first epoch on; both at the last epoch. Of every epoch and every one of the nine errors of
navigation the mean of (error/sd)^2 over the records is in the chi-square band of 40 degrees of freedom, at 4.8 sigma:
some 3,000 comparisons a case, none of which may be outside. The mean over all epochs of a kind, of which errors go
together, is within 4.5 standard errors of its own scatter over the records.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from nav import setups

import gmwm_jax as gj
import nav_jax as nj
from nav_jax.filter.experiment import truth_at
from nav_jax.kinematics.rotation import quat_conjugate, quat_multiply, quat_to_rotvec

pytestmark = pytest.mark.usefixtures("quick_compilation")

NUM, RATE, SECONDS = 40, 20.0, 6.0
REFERENCE = nj.motions.lemniscate(SECONDS, RATE)
ERRORS = nj.ImuErrors(gj.WN(2e-4) + gj.GM(0.01, 1e-4), gj.WN(2e-6) + gj.GM(0.01, 1e-6), RATE)
START = nj.InitialUncertainty(10.0, 0.5, 0.01)
SENSORS = (nj.GnssPosition(3.0, horizontal=0.05, vertical=0.1), nj.Barometer(2.0, height=0.5, first=0.0))
SCENARIO = nj.Scenario(REFERENCE, SENSORS, START)


@pytest.fixture(scope="module")
def records():
    """Runs of the Monte Carlo as records."""
    e = nj.filter.prepare(SCENARIO, rate=RATE)
    inputs = nj.filter.draw_inputs(e, ERRORS, nj.filter.run_keys(jax.random.key(11), 0, NUM))
    perfect, _ = nj.perfect_imu(REFERENCE, RATE)
    drawn = np.asarray(setups.given(e, inputs).errors.per_step)
    errors = np.zeros((len(perfect), 6, NUM))
    errors[setups.samples(e)] = drawn.reshape(-1, 6, NUM)
    times = np.cumsum(np.asarray(e.timeline.dt)[np.asarray(e.timeline.pattern)].sum(axis=(1, 2)))
    z, columns = np.asarray(inputs.z), np.cumsum([0, *(len(s.axes) for s in SENSORS)])
    found = []
    for run in range(NUM):
        imu = replace(perfect, accel=perfect.accel + errors[:, :3, run], gyro=perfect.gyro + errors[:, 3:, run])
        fixes = [
            nj.Fixes(s, times[np.asarray(at)], z[np.asarray(at), a:b, run])
            for s, (_, at), a, b in zip(SENSORS, e.fixes, columns[:-1], columns[1:], strict=True)
        ]
        start = zip(("position", "velocity", "quaternion"), inputs.start[:3], strict=True)
        found.append((imu, fixes, {name: np.asarray(a)[:, run] for name, a in start}))
    return found


def squares(time, position, velocity, quaternion, sd):
    """(error/sd)^2 of the nine errors of navigation, of runs (R, E, ...) with one time."""
    imu, reference = nj.perfect_imu(REFERENCE, RATE)
    p, v, q = (np.asarray(a)[:, :, 0] for a in truth_at(reference, imu, time, nj.FlatEarth())[:3])
    ours, theirs = (jnp.moveaxis(jnp.asarray(a), -1, 0) for a in (quaternion, np.broadcast_to(q, quaternion.shape)))
    psi = np.moveaxis(np.asarray(quat_to_rotvec(quat_multiply(ours, quat_conjugate(theirs)))), 0, -1)
    return (np.concatenate([position - p, velocity - v, psi], axis=-1) / sd[..., :9]) ** 2


def assert_consistent(time, seen, kinds):
    """Every epoch and component in the band, and the mean of each kind of epoch."""
    sigma = scipy.stats.norm.sf(4.8)
    low, high = scipy.stats.chi2.ppf([sigma, 1 - sigma], NUM) / NUM
    mean = seen.mean(axis=0)
    out = np.argwhere((mean < low) | (mean > high))
    assert not len(out), f"{len(out)} outside, first {mean[tuple(out[0])]:.3g} at {time[out[0][0]]:.4g} s"
    for kind, chosen in kinds.items():
        assert chosen.any(), kind
        of_run = seen[:, chosen].mean(axis=(1, 2))
        z = (of_run.mean() - 1) / (of_run.std(ddof=1) / np.sqrt(NUM))
        assert abs(z) < 4.5, (kind, z)


def kinds_of(time, before):
    """Kinds of epochs."""
    at_fix = np.isin(np.round(time, 6), np.round(before, 6))
    just_before = np.append(at_fix[1:], False) & ~at_fix
    gnss = np.isclose(time, 1 / 3, rtol=0, atol=1e-6)
    last = np.arange(len(time)) == len(time) - 1
    return {
        "first fix": gnss, "other fixes": at_fix & ~gnss & ~last, "last epoch, a fix": at_fix & last,
        "just before": just_before, "between": ~at_fix & ~just_before,
    }  # fmt: skip


@pytest.mark.parametrize("every", [1, 10])
def test_a_filter_on_records(records, every):
    solutions = [nj.navigate(i, f, ERRORS, initial=START, every=every, **start) for i, f, start in records]
    first = solutions[0]
    whole = squares(
        first.time,
        *(np.stack([getattr(s.trajectory, n) for s in solutions]) for n in ("position", "velocity", "quaternion")),
        np.stack([s.sd for s in solutions]),
    )
    kinds = kinds_of(first.time, first.before.time)
    if every == 10:  # a step that ends between fixes and outputs is the exception
        kinds = {name: chosen for name, chosen in kinds.items() if chosen.any()}
    assert_consistent(first.time, whole, kinds)
    assert first.before.time[0] == 0.0
    assert first.before.time[-1] == first.time[-1] == SECONDS
    names = ("position", "velocity", "quaternion", "sd")
    sides = squares(first.before.time, *(np.stack([getattr(s.before, n) for s in solutions]) for n in names))
    start, rest = np.arange(len(first.before)) == 0, np.arange(len(first.before)) > 0
    assert_consistent(first.before.time, sides, {"before the first": start, "before others": rest})


@pytest.mark.parametrize("every", [1, 10])
def test_a_smoother_on_records(records, every):
    solutions = [nj.navigate(i, f, ERRORS, initial=START, every=every, smooth=True, **s) for i, f, s in records]
    first = solutions[0]
    whole = squares(
        first.time,
        *(np.stack([getattr(s.trajectory, n) for s in solutions]) for n in ("position", "velocity", "quaternion")),
        np.stack([s.sd for s in solutions]),
    )
    last = first.time == first.time[-1]
    assert_consistent(first.time, whole, {"last": last, "others": ~last})
    assert len(first.before) == 0


@pytest.mark.parametrize("gains", ["estimate", "reference"])
@pytest.mark.parametrize("every", [1, 10])
def test_whole_trajectories_of_a_monte_carlo(gains, every):
    runs = nj.monte_carlo(
        replace(SCENARIO, every=every), ERRORS, num_runs=NUM, key=jax.random.key(12), gains=gains, keep=range(NUM)
    )
    tracks = list(runs.tracks.values())
    names = ("position", "velocity", "quaternion", "sd")
    for side, of in (("after", tracks), ("before", [t.before for t in tracks])):
        time = of[0].time
        seen = squares(time, *(np.stack([getattr(t, n) for t in of]) for n in names))
        kinds = kinds_of(time, tracks[0].before.time) if side == "after" else {"before": time >= 0}
        assert_consistent(time, seen, {name: chosen for name, chosen in kinds.items() if chosen.any()})
