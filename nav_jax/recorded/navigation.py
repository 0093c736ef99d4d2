"""Plain integrated navigation: the filter of the Monte Carlo on given sensor arrays, without a reference."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64, Int

from gmwm_jax._internal.checks import integer, of_kind, real_array
from gmwm_jax._internal.programs import bound_programs
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.states import joined
from nav_jax.filter.history import Estimates, histories, smoothed_history
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.layout import JUDGED, NAVIGATION, ON_CHANNELS
from nav_jax.filter.loop import run_estimate
from nav_jax.filter.measurement import decorrelated
from nav_jax.filter.scenario import EVERY, OUTPUT_INTERVAL, output_times, require_names
from nav_jax.filter.schedule import Schedule, make_schedule
from nav_jax.filter.score import Truth
from nav_jax.filter.smoother import smoothed
from nav_jax.filter.status import Status
from nav_jax.filter.timeline import Estimate, Inputs, Outcome, Timeline, start_covariance, timeline_of
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.emulation import AtEnd, GivenErrors
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu
from nav_jax.kinematics.earth import AbstractEarth, FlatEarth
from nav_jax.kinematics.state import NavState
from nav_jax.trajectory.trajectory import Trajectory


@dataclass(frozen=True, eq=False, repr=False)
class Navigation:
    """The result of `navigate`: an integrated navigation solution.

    At an epoch with fixes they are what the filter says after the update by all fixes of that epoch, also at the last
    epoch; what it said before that is in `before`. Estimate and standard deviation are always of the same side.

    Attributes
    ----------
    trajectory
        The estimate at the start and after every covariance step; of a smoother, at every output and fix.
    sd
        Standard deviations of position N, E, D (m), velocity (m/s), attitude (rad, rotation vector in n) and of the
        estimated errors of accelerometers (m/s^2) and gyros (rad/s), shape (E, 15).
    sensor_errors
        Estimated errors of accelerometer x, y, z and gyro x, y, z, shape (E, 6).
    before
        The same at the epochs with fixes, before their update. Without epochs for a smoother, which knows all fixes.
    innovation, nis
        Sensor -> innovations (F, K) and their normalised squares (F,), each component given those before it.
    status
        How it ended.
    """

    trajectory: Trajectory
    sd: Float64[np.ndarray, "E 15"]
    sensor_errors: Float64[np.ndarray, "E 6"]
    before: Estimates
    innovation: Mapping[str, Float64[np.ndarray, "_ _"]]
    nis: Mapping[str, Float64[np.ndarray, " _"]]
    status: Status

    @property
    def time(self) -> Float64[np.ndarray, " E"]:
        """Epochs, s."""
        return self.trajectory.time

    def __repr__(self) -> str:
        last = self.sd[-1]
        rows = [[b.name, b.unit, *(f"{x:.3g}" for x in last[JUDGED[b.name]])] for b in NAVIGATION.blocks]
        lines = [
            f"Navigation from {self.trajectory.time[0]:g} to {self.trajectory.time[-1]:g} s: {self.status.sentence}",
            f"standard deviations at {self.time[-1]:g} s",
            format_table(["", "unit", "N", "E", "D"], rows, left=2),
            *(f"NIS of {s}: mean {x.mean():.3g} over {len(x)} fixes of {self.innovation[s].shape[1]} components"
              for s, x in self.nis.items()),
        ]  # fmt: skip
        return "\n".join(lines)


class Prepared(NamedTuple):
    """A record as the filter takes it."""

    timeline: Timeline
    sensors: tuple[AbstractAiding, ...]
    inputs: Inputs
    """Of one run, without sensor states."""
    schedule: Schedule
    start: float
    """Of the record, s."""
    outputs: Int[np.ndarray, " E"]
    """The segments that end at the epochs asked for."""
    fixes: list[Int[np.ndarray, " _"]]
    """Of each sensor, the segments that end with a fix."""
    columns: Int[np.ndarray, " _"]
    """Where the scalars of each sensor begin, and their number."""
    whitening: list[Float64[np.ndarray, "_ K K"] | None]
    """Of each sensor, what takes the components of each fix to the scalars of the filter; None where it is one."""


def prepare_navigation(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    every: int,
    output_interval: Real,
    earth: AbstractEarth | None,
) -> Prepared:
    """Check and arrange a record; parameters and errors as of `navigate`."""
    if abs(filter.rate / imu.rate - 1) > 1e-6:
        raise ValueError(
            f"The errors belong to {filter.rate:g} Hz and the record to {imu.rate:g} Hz: use at_rate({imu.rate:g})."
        )
    sensors = tuple(f.sensor for f in aiding)
    require_names([s.name for s in sensors])
    earth = FlatEarth() if earth is None else earth
    of_kind("earth", earth, AbstractEarth)
    bound_programs()
    epochs = imu.epochs
    times = output_times(float(epochs[0]), float(epochs[-1]), output_interval, "record")
    schedule = make_schedule(epochs, np.concatenate([times, *(f.time for f in aiding)]), integer("every", every, 1))
    lengths = [len(times), *(len(f.time) for f in aiding)]
    outputs, *fixes = np.split(schedule.event, np.cumsum(lengths)[:-1])
    M = len(schedule.time)
    start = {
        name: real_array(name, value, (size,))
        for name, value, size in (("position", position, 3), ("velocity", velocity, 3), ("quaternion", quaternion, 4))
    }
    if abs(np.linalg.norm(start["quaternion"]) - 1) > 1e-6:
        raise ValueError(f"The quaternion must have length 1, and has {np.linalg.norm(start['quaternion']):g}.")
    p, v, q = (jnp.asarray(a[:, None]) for a in start.values())
    begin = NavState(p, v, q, jnp.zeros((0, 1)))
    # nothing is known to compare with: the errors of the channels are then what the filter estimates
    nothing = Truth(jnp.zeros((M, 3, 1)), jnp.zeros((M, 3, 1)), jnp.broadcast_to(jnp.eye(4)[None, :, :1], (M, 4, 1)))
    timeline = timeline_of(
        imu, schedule, sensors, [s[f.given] for s, f in zip(fixes, aiding, strict=True)], nothing, earth
    )
    z = np.zeros((M, timeline.valid.shape[1], 1))
    columns = np.cumsum([0, *(len(s.axes) for s in sensors)])
    spans = list(zip(aiding, fixes, columns[:-1], columns[1:], strict=True))
    for f, segments, a, b in spans:
        z[segments, a:b, 0] = decorrelated(f.sensor, jnp.asarray(f.value.T)).T
    whitening = [_whitening(f) for f in aiding]
    if any(w is not None for w in whitening):
        # on top of what the sensor decorrelates by itself
        on_top = np.broadcast_to(np.eye(z.shape[1]), (M, z.shape[1], z.shape[1])).copy()
        for w, (f, segments, a, b) in zip(whitening, spans, strict=True):
            if w is not None:
                on_top[segments, a:b, a:b] = w if f.sensor.mixing is None else w @ np.asarray(f.sensor.mixing)
        timeline = eqx.tree_at(lambda t: t.whitening, timeline, jnp.asarray(on_top), is_leaf=lambda x: x is None)
    zero = jnp.zeros((M, len(CHANNELS), 1))
    none = GivenErrors(jnp.zeros((*timeline.imu.shape, 1)), AtEnd(zero, zero))
    return Prepared(
        timeline,
        sensors,
        Inputs(begin, none, jnp.asarray(z)),
        schedule,
        float(epochs[0]),
        outputs,
        fixes,
        columns,
        whitening,
    )


def _whitening(fixes: Fixes) -> Float64[np.ndarray, "F K K"] | None:
    """What makes the noise of each fix that of the sensor's scalars, which have the believed standard deviations.

    So that a factor on what is believed, which is what `tune` seeks, is one on what the fixes state.
    """
    if fixes.covariance is None:
        return None
    believed = np.asarray(fixes.sensor.believed)
    return believed[:, None] * np.linalg.inv(np.linalg.cholesky(fixes.covariance))


@eqx.filter_jit
def run_record(
    timeline: Timeline,
    sensors: tuple[AbstractAiding, ...],
    inputs: Inputs,
    filter: ImuErrors,
    initial: InitialUncertainty,
    *,
    trace: bool = False,
    smooth: bool = False,
) -> Outcome:
    """Run the filter over a prepared record."""
    bank = joined(filter.bank(), timeline.own)
    inputs = inputs._replace(start=inputs.start._replace(x=jnp.zeros((len(bank.states), 1))))
    P = start_covariance(initial, bank)
    outcome = run_estimate(timeline, bank, sensors, inputs, P, trace=trace, remember=smooth)
    return smoothed(timeline, bank, sensors, outcome) if smooth else outcome


def navigate(
    imu: Imu,
    aiding: Sequence[Fixes],
    filter: ImuErrors,
    *,
    position: Any,
    velocity: Any,
    quaternion: Any,
    initial: InitialUncertainty,
    every: int = EVERY,
    output_interval: Real = OUTPUT_INTERVAL,
    earth: AbstractEarth | None = None,
    smooth: bool = False,
    throw: bool = True,
) -> Navigation:
    """Run the filter on recorded sensors.

    Parameters
    ----------
    imu
        The record.
    aiding
        Fixes of each sensor; may be empty (free inertial navigation).
    filter
        What it believes of the errors of the IMU; their rate must be that of the record.
    position, velocity, quaternion
        The start: NED in m and m/s, q_nb scalar-first.
    initial
        How well the start is known.
    every
        Number of IMU samples in a covariance step.
    output_interval
        s between epochs at which there is an estimate whatever the covariance steps and fixes are.
    earth
        Gravity; a `FlatEarth` unless given.
    smooth
        Give the estimate of the fixed-interval smoother, from all fixes of the record, at every output and fix.
    throw
        Raise if the filter fails; else its status says so.

    Returns
    -------
    Navigation

    Raises
    ------
    ValueError
        Another rate, fixes outside the record, arrays of wrong shape, two sensors of one name, a start or an Earth of
        another class.
    RuntimeError
        The filter failed, and ``throw``.

    Examples
    --------
    >>> samples, exact = nj.perfect_imu(nj.motions.lemniscate(duration=10.0, rate=20.0))  # in place of a recorded drive
    >>> rng = np.random.default_rng(0)
    >>> imu = nj.Imu(samples.time, samples.gyro, samples.accel + rng.normal(0.0, 0.2, (200, 3)), 20.0)
    >>> gnss = nj.GnssPosition(horizontal=0.02, vertical=0.02)
    >>> fixes = nj.Fixes(gnss, exact.time[20::20], exact.position[20::20] + rng.normal(0.0, 0.02, (10, 3)))
    >>> filter = nj.ImuErrors("WN(sigma2=0.04)", "WN(sigma2=1e-8)", rate=20.0)
    >>> start = {name: getattr(exact, name)[0] for name in ("position", "velocity", "quaternion")}
    >>> start["initial"] = nj.InitialUncertainty(position_sd=0.1, velocity_sd=0.1, attitude_sd=0.01)
    >>> solution = nj.navigate(imu, [fixes], filter, **start)
    >>> solution.status.name
    'ok'
    """
    of_kind("initial", initial, InitialUncertainty)
    done = prepare_navigation(
        imu,
        aiding,
        filter,
        position=position,
        velocity=velocity,
        quaternion=quaternion,
        every=every,
        output_interval=output_interval,
        earth=earth,
    )
    outcome = run_record(done.timeline, done.sensors, done.inputs, filter, initial, trace=not smooth, smooth=smooth)
    status = Status(int(outcome.status[0]))
    if throw and status is not Status.ok:
        raise RuntimeError(
            f"The filter failed: {status.sentence}. Look at the start, the units of the sensors and the noise model; "
            "with throw=False the solution up to there is returned."
        )
    names = [s.name for s in done.sensors]
    parts = list(zip(names, done.fixes, done.columns[:-1], done.columns[1:], strict=True))
    innovation, variances = (np.asarray(a)[..., 0] for a in (outcome.innovation, outcome.variance))
    nu = {n: innovation[s, a:b] for n, s, a, b in parts}
    variance = {n: variances[s, a:b] for n, s, a, b in parts}
    after, before = _estimates(done, outcome)
    label = "smoothed navigation" if smooth else "navigation"
    return Navigation(
        Trajectory(after.time, after.position, after.velocity, after.quaternion, label),
        after.sd,
        after.sensor_errors,
        before,
        nu,
        {n: (nu[n] ** 2 / variance[n]).sum(axis=1) for n in names},
        status,
    )


def _estimates(done: Prepared, outcome: Outcome) -> tuple[Estimates, Estimates]:
    """At all epochs and after the updates, and before them; of a smoother at outputs and fixes."""
    if outcome.trace is not None:
        return histories(done.schedule, done.start, done.timeline.valid, outcome.trace)[0]
    # nothing is known to compare with: errors of the channels are what is estimated of them
    sensors = outcome.judgement.error[:, ON_CHANNELS]
    events = Estimate(outcome.state.p, outcome.state.v, outcome.state.q, sensors, outcome.judgement.sd)
    return smoothed_history(done.schedule, events, np.unique(np.concatenate([done.outputs, *done.fixes])))
