"""One comparison, prepared: the schedule, the perfect sensors and the truth, and runs of it as a pure function of keys.

`draw_inputs` and `run_filter` are what everything else is made of: jitted, vectorised over runs, and differentiable in
the parameters of the emulated errors, of the filter, of the aiding noise and of the initial covariance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int, Key

from gmwm_jax._internal.checks import as_float, of_kind
from gmwm_jax._internal.chunks import numbered_keys
from gmwm_jax._internal.compiling import compiled_quickly, compiled_sooner
from gmwm_jax._internal.programs import bound_programs, bounded
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.states import joined, own_states
from nav_jax.filter.ekf import inject, travelled
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.layout import NAVIGATION
from nav_jax.filter.loop import reference_gains, run_estimate, run_reference
from nav_jax.filter.measurement import decorrelated, measurements
from nav_jax.filter.scenario import Scenario, output_times
from nav_jax.filter.schedule import Schedule, make_schedule
from nav_jax.filter.score import Truth
from nav_jax.filter.smoother import smoothed
from nav_jax.filter.timeline import Gains, Inputs, Outcome, Timeline, start_covariance, timeline_of
from nav_jax.imu.emulation import Path, emulate, stream
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.imu import Imu, perfect_imu
from nav_jax.imu.recorded import RecordedErrors
from nav_jax.kinematics import strapdown
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.kinematics.linalg import factor
from nav_jax.kinematics.reference import ReferenceMotion
from nav_jax.kinematics.state import NavState
from nav_jax.trajectory.trajectory import Trajectory

GAINS = ("estimate", "reference")


class Experiment(eqx.Module):
    """A prepared scenario: what all runs of a comparison share."""

    timeline: Timeline
    sensors: tuple[AbstractAiding, ...]
    start: NavState
    """The truth at the start, one run."""
    initial: InitialUncertainty
    time: Float[Array, " M"]
    """Of the end of each segment, s."""
    track: ReferenceMotion
    """The reference at any time."""
    fixes: tuple[Int[Array, "2 _"], ...]
    """Of each sensor: the fixes that are used, by number of the fix and of the segment that ends there."""
    num_samples: int = eqx.field(static=True)
    num_fixes: tuple[int, ...] = eqx.field(static=True)

    def with_sensors(self, sensors: Sequence[AbstractAiding]) -> "Experiment":
        """The same with other numbers in its sensors: their noise, what is believed of it, their own states.

        A pure function, that may be differentiated by what the sensors are made of; rates, outages and kinds of states
        stay as they are.

        Examples
        --------
        >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
        >>> gnss = lambda sd: nj.GnssPosition(horizontal=0.1, vertical=0.2, lever_arm=(1.0, 0.0, 0.0), lever_arm_sd=sd)
        >>> experiment = nj.filter.prepare(nj.Scenario(reference, [gnss(0.1)]), rate=20.0)
        >>> other = experiment.with_sensors([gnss(0.2)])
        """
        own, drawn = self.timeline.own, self.timeline.drawn
        on_earth = tuple(s.on(self.timeline.earth.earth) for s in sensors)
        both = tuple(own_states(on_earth, o.rate, o.without) for o in (own, drawn))
        timeline = eqx.tree_at(lambda t: (t.own, t.drawn), self.timeline, both)
        return eqx.tree_at(lambda e: (e.timeline, e.sensors), self, (timeline, on_earth))


class Setup:
    """An `Experiment` and what a host needs to name its results: times, reference, outages."""

    def __init__(self, scenario: Scenario, rate: Real):
        of_kind("scenario", scenario, Scenario)
        bound_programs()
        self.scenario, self.rate = scenario, rate
        self.aiding = tuple(s.on(scenario.earth) for s in scenario.aiding)
        imu, self.reference = perfect_imu(scenario.reference, rate, scenario.earth)
        self.imu = replace(imu, temperature=scenario.temperature_at(imu.time + 0.5 / imu.rate))
        # resampled, it may end a little earlier
        epochs = self.reference.time
        start, end = float(epochs[0]), float(epochs[-1])
        self.output_times = output_times(start, end, scenario.output_interval)
        fix_times = [s.fixes(start, end) for s in self.aiding]
        used = [_used(s, t, self.reference) for s, t in zip(self.aiding, fix_times, strict=True)]
        self.fix_times = [t[u] for t, u in zip(fix_times, used, strict=True)]
        events = np.concatenate([self.output_times, *self.fix_times])
        schedule = make_schedule(epochs, events, scenario.every)
        numbers = np.split(schedule.event, np.cumsum([len(self.output_times), *map(len, self.fix_times)])[:-1])
        self.output_segments, self.fix_segments = numbers[0], numbers[1:]
        self.schedule = schedule
        self.experiment = self._experiment(schedule, used)

    @property
    def outages(self) -> dict[str, tuple[tuple[float, float], ...]]:
        """Sensor -> (start, end) of each, in s."""
        return {s.name: s.outages for s in self.aiding if s.outages}

    @property
    def fixes(self) -> dict[str, Float[np.ndarray, " _"]]:
        """Sensor -> times of its fixes, in s."""
        return dict(zip((s.name for s in self.aiding), self.fix_times, strict=True))

    def _experiment(self, schedule: Schedule, used: list[np.ndarray]) -> Experiment:
        reference, earth = self.reference, self.scenario.earth
        p, v, q = (as_float(a[:1].T) for a in (reference.position, reference.velocity, reference.quaternion))
        fixes = (np.stack([np.flatnonzero(u), s]) for u, s in zip(used, self.fix_segments, strict=True))
        truth = truth_at(reference, self.imu, schedule.time, earth)
        return Experiment(
            timeline_of(
                self.imu,
                schedule,
                self.aiding,
                self.fix_segments,
                truth,
                earth,
                neglected=self.scenario.neglected,
                suspected=self.scenario.suspected,
            ),
            self.aiding,
            NavState(p, v, q, as_float(np.zeros((0, 1)))),
            self.scenario.initial,
            as_float(schedule.time),
            _track(reference),
            jax.device_put(tuple(fixes)),
            len(self.imu),
            tuple(len(u) for u in used),
        )


def _track(reference: Trajectory) -> ReferenceMotion:
    step = (reference.time[-1] - reference.time[0]) / (len(reference) - 1)
    arrays = (a.T for a in (reference.position, reference.velocity, reference.quaternion))
    return ReferenceMotion(*map(as_float, (reference.time[0], step, *arrays)))


def _used(sensor: AbstractAiding, times: Float[np.ndarray, " F"], reference: Trajectory) -> Bool[np.ndarray, " F"]:
    """Which of the fixes there are."""
    speed = np.interp(times, reference.time, np.linalg.norm(reference.velocity, axis=1))
    used = sensor.available(times) & sensor.applies(speed)
    if not used.any():
        raise ValueError(
            f"{sensor.name} has no fix: all of its {len(times)} lie in outages or where it does not hold, at speeds of "
            f"{speed.min():.3g} to {speed.max():.3g} m/s. Leave the sensor out, or take another trajectory."
        )
    return used


def prepare(scenario: Scenario, *, rate: Real) -> Experiment:
    """Prepare runs along a reference, for use inside JAX programs.

    ``draw_inputs(experiment, truth, run_keys(key, 0, n))`` and ``run_filter(experiment, filter, inputs)`` are then
    pure functions of what they are given: they may be differentiated, in parameters of the emulated errors, of the
    filter, of ``experiment.sensors`` and ``experiment.initial``.

    Parameters
    ----------
    scenario
        Trajectory, aiding, start and Earth.
    rate
        Of the IMU in Hz.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    """
    return Setup(scenario, rate).experiment


def _path(track: ReferenceMotion, num_samples: int) -> Path:
    """The way over the samples of an IMU, of which the reference has one epoch more."""
    middle = track.start + track.step * jnp.arange(0.5, num_samples)
    return Path(travelled(track.v[:, :-1], track.step), track.at(middle[:, None]).q[..., 0].T)


def truth_at(reference: Trajectory, imu: Imu, times: Float[np.ndarray, " E"], earth: AbstractEarth) -> Truth:
    """The reference at any times: mechanised from the epoch before each."""
    step = (reference.time[-1] - reference.time[0]) / len(imu.time)
    position = (times - reference.time[0]) / step
    near = np.abs(position - np.rint(position)) < 1e-6
    index = np.where(near, np.rint(position), np.floor(position)).astype(int)
    past = np.where(near, 0.0, position - index) * step
    sample = np.minimum(index, len(imu.time) - 1)
    state = (a[index].T for a in (reference.position, reference.velocity, reference.quaternion))
    truth = _step(*state, imu.gyro[sample].T, imu.accel[sample].T, past[None], earth)
    axes = earth.local(np.asarray(truth.p)[:, :, 0])
    return truth if axes is None else truth._replace(axes=as_float(axes[..., None]))


@bounded
@compiled_quickly()
def _step(p: Array, v: Array, q: Array, gyro: Array, accel: Array, dt: Array, earth: AbstractEarth) -> Truth:
    """One step from each of many states, as one program."""
    rate_n = earth.rate_n(p) if earth.is_turning else None
    p, v, q = strapdown.step(p, v, q, gyro, accel, dt, earth.gravity_n(p + dt / 2 * v), rate_n)
    return Truth(*(a.T[:, :, None] for a in (p, v, q)))


@bounded
@partial(compiled_sooner, level=1)
def draw_inputs(experiment: Experiment, truth: ImuErrors | RecordedErrors, keys: Key[Array, " R"]) -> Inputs:
    """Draw the inputs of R runs, the same for every filter: initial errors, sensor errors, measurements.

    Errors of the sensors that a model describes are drawn only when a filter comes to them (`emulation.DrawnErrors`).

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    >>> inputs = nj.filter.draw_inputs(experiment, truth, nj.filter.run_keys(jax.random.key(0), 0, 4))
    """
    timeline = experiment.timeline
    M, num_runs = timeline.pattern.shape[0], keys.shape[0]
    sensed = (timeline.imu, timeline.sensed)
    ends = timeline.ends[timeline.pattern]
    errors = emulate(truth, keys, experiment.num_samples, ends, sensed, _path(experiment.track, experiment.num_samples))
    deviation = jax.vmap(lambda k: jax.random.normal(stream(k, "initial"), (NAVIGATION.size,)), out_axes=1)(keys)
    begin = jax.tree.map(lambda a: jnp.broadcast_to(a, (a.shape[0], num_runs)), experiment.start)
    begin = inject(begin, factor(experiment.initial.covariance) @ deviation)
    z, aiding = [jnp.zeros((M, 0, num_runs))], measurements(timeline, experiment.sensors, drawn=True)
    passed = jnp.cumsum(timeline.ends[timeline.pattern].sum(axis=(1, 2))).astype(int)
    for i, (sensor, fixes, num) in enumerate(
        zip(experiment.sensors, experiment.fixes, experiment.num_fixes, strict=True)
    ):
        number_of, segment = fixes
        keys_of = jax.vmap(lambda k, name=sensor.name: stream(k, name))(keys)
        noise = sensor.draw(num, keys_of)[number_of]
        x = jnp.zeros((len(number_of), 0, 1))
        if sensor.states:
            steps, of_states = jnp.diff(passed[segment], prepend=0), jax.vmap(lambda k: stream(k, "states"))(keys_of)
            x = timeline.drawn.draw(i, steps, experiment.num_samples, of_states)
        runs = x.shape[2]
        exact = sensor.emulate(experiment.track, experiment.time[segment], x)
        if exact is None:
            there = timeline.truth
            known = (there.p, there.v, there.q, timeline.sensed[:, :, None])
            p, v, q, reading = (jnp.repeat(a[segment], runs, axis=2) for a in known)
            means = None if timeline.means is None else jnp.repeat(timeline.means[segment, :, :, None], runs, axis=3)
            body = jax.vmap(partial(aiding.body, i))(NavState(p, v, q, x), reading, means)
            exact = jax.vmap(sensor.predict)(NavState(p, v, q, x), body)
        else:
            exact = jnp.moveaxis(exact, 0, 1)
        measured = jax.vmap(lambda h, sensor=sensor: decorrelated(sensor, h))(exact) + noise
        z.append(jnp.zeros((M, len(sensor.axes), num_runs)).at[segment].set(measured))
    return Inputs(begin, errors, jnp.concatenate(z, axis=1))


@bounded
@compiled_sooner
def gains_of(experiment: Experiment, filter: ImuErrors, *, trace: bool = False, smooth: bool = False) -> Gains:
    """Compute covariance and gains of a filter along the reference; `smooth` adds what a smoother needs.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    >>> gains = nj.filter.gains_of(experiment, truth)
    """
    bank = joined(filter.bank(), experiment.timeline.own)
    start = experiment.start._replace(x=jnp.zeros((len(bank.states), 1)))
    P = start_covariance(experiment.initial, bank)
    return reference_gains(experiment.timeline, bank, experiment.sensors, start, P, trace=trace, remember=smooth)


@bounded
@compiled_sooner
def run_filter(
    experiment: Experiment,
    filter: ImuErrors,
    inputs: Inputs,
    gains: Gains | None = None,
    *,
    trace: bool = False,
    smooth: bool = False,
) -> Outcome:
    """Run a filter over R runs, with `gains` of the reference, or else each run with its own.

    Parameters
    ----------
    experiment
        What all runs share.
    filter
        What the filter believes of the sensor errors.
    inputs
        Of the runs, see `draw_inputs`.
    gains
        See `gains_of`.
    trace
        Keep the estimate, and what is claimed of it, after every covariance step and every update, see `histories`.
    smooth
        Judge the estimate of the smoother, from all measurements of the run; innovations are those of the filter.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    >>> inputs = nj.filter.draw_inputs(experiment, truth, nj.filter.run_keys(jax.random.key(0), 0, 4))
    >>> outcome = nj.filter.run_filter(experiment, truth, inputs)
    >>> outcome.judgement.error.shape[-1]  # runs are the last axis
    4
    """
    bank = joined(filter.bank(), experiment.timeline.own)
    num_runs = inputs.start.p.shape[1]
    inputs = inputs._replace(start=inputs.start._replace(x=jnp.zeros((len(bank.states), num_runs))))
    timeline, sensors = experiment.timeline, experiment.sensors
    if gains is None:
        P = start_covariance(experiment.initial, bank)
        outcome = run_estimate(timeline, bank, sensors, inputs, P, trace=trace, remember=smooth)
    else:
        outcome = run_reference(timeline, bank, sensors, inputs, gains, trace=trace)
    return smoothed(timeline, bank, sensors, outcome) if smooth else outcome


def run_keys(key: Key[Array, ""], first: int, last: int) -> Key[Array, " R"]:
    """Return the keys of the runs first to last - 1: a run has its key whatever the number of runs.

    Examples
    --------
    >>> nj.filter.run_keys(jax.random.key(0), 0, 4).shape
    (4,)
    """
    return numbered_keys(key, range(first, last))


def named_filters(
    truth: ImuErrors | RecordedErrors, filters: Mapping[str, ImuErrors] | ImuErrors | None
) -> dict[str, ImuErrors]:
    """Name -> what that filter believes: one filter alone is called ``filter``, and is the truth if none is given.

    Raises
    ------
    ValueError
        No filter; or none given, and a truth that is a recording.
    """
    if filters is None:
        if isinstance(truth, RecordedErrors):
            raise ValueError("Errors of a recording say nothing of a model: state what the filter believes.")
        filters = truth
    named = {"filter": filters} if isinstance(filters, ImuErrors) else dict(filters)
    if not named:
        raise ValueError("Give at least one filter: {name: ImuErrors}.")
    return named


def check_rates(truth: Any, filters: Mapping[str, ImuErrors]) -> float:
    """Return the rate that emulation and filters share, or raise."""
    if not isinstance(truth, ImuErrors | RecordedErrors):
        raise ValueError(f"truth is ImuErrors or RecordedErrors, and this is {truth!r}.")
    for name, f in filters.items():
        if not isinstance(f, ImuErrors):
            raise ValueError(f"The filter {name!r} believes ImuErrors, and this is {f!r}.")
        if abs(f.rate / truth.rate - 1) > 1e-6:
            raise ValueError(
                f"The filter {name!r} belongs to {f.rate:g} Hz and the emulated errors to {truth.rate:g} Hz. "
                f"Parameters are per sample: use at_rate({truth.rate:g}), which keeps the noise in continuous time."
            )
    return truth.rate
