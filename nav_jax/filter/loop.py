"""The time loop: over segments that end with an update or an output, and over the covariance steps inside.

`run_estimate`: every run has its own covariance, about its own estimate (an EKF). `run_reference`: one covariance along
the reference, whose gains all runs share; to first order in the errors the same filter, at a fraction of the cost.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float, Int

from nav_jax.filter.between import Between
from nav_jax.filter.ekf import correction, inject, mechanise, mechanise_with_motion, residual_covariance, update
from nav_jax.filter.error_model import Covariance, blocks, covariance_under_earth, full, under_earth
from nav_jax.filter.gating import gated_update
from nav_jax.filter.measurement import Measurements, Sensors, compensated_means, measurements, whitened
from nav_jax.filter.score import Judgement, Truth, claim, judge
from nav_jax.filter.status import Status
from nav_jax.filter.timeline import Comparison, Estimate, Gains, Inputs, Memory, Outcome, Timeline, Trace
from nav_jax.imu.bank import SensorBank, alone, step_noises, with_errors
from nav_jax.kinematics.earth import Pull
from nav_jax.kinematics.state import NavState


def run_estimate(
    timeline: Timeline,
    bank: SensorBank,
    sensors: Sensors,
    inputs: Inputs,
    P_start: Float[Array, "n n"],
    *,
    trace: bool = False,
    remember: bool = False,
    predict: bool = False,
) -> Outcome:
    """Run R filters, each with a covariance about its own estimate.

    Parameters
    ----------
    timeline
        The schedule and the reference.
    bank
        What the filters believe of the sensor errors.
    sensors
        Aiding sensors, K scalars in all.
    inputs
        Of the R runs.
    P_start
        Covariance of the error state at the start.
    trace
        Keep the estimate, and what is claimed of it, after every covariance step and every update.
    remember
        Keep what a smoother wants.
    predict
        Keep what is predicted of all scalars after each update, for those that are kept from the filter.
    """
    aiding = measurements(timeline, sensors)
    constant, variance = aiding.constant(), aiding.variance
    varies = constant is None or timeline.whitening is not None
    moves = aiding.uses_body or bank.depends
    alike = alone(bank)
    kinds = step_noises(alike, timeline.dt, timeline.ends)
    between = Between(bank, kinds, timeline.earth, at_every_step=trace)
    one = _identity(P_start, inputs.start.p.shape[1]) if remember else None

    def step(carry, given):
        state, at, status, noise, pull = carry
        kind, imu, own, shaken = given
        ends = timeline.ends[kind]
        noise, errors = inputs.errors.step(noise, ends, own)
        sensed = with_errors(imu[:, :, None], errors)
        state, motion = mechanise_with_motion(state, sensed, timeline.dt[kind], ends, bank, timeline.earth, pull)
        at = between.step(at, motion, kind, shaken)
        kept = _estimate(state, bank, claim(at.P, alike, imu[0, :, None]).sd, imu[0, :, None]) if trace else None
        return (state, at, status, noise, pull), kept

    def event(carry, given):
        state, underway, status, noise, pull = carry
        at, z, own = given
        P, Phi = _under_earth(*between.end(underway), timeline, pull, at.halves, 0)
        sensed = at.sensed[:, None]
        reading = bank.compensated(with_errors(sensed, inputs.errors.sample(noise, own)), state.x) if moves else None
        means = compensated_means(at.means, _of_means(inputs, aiding, noise, own), bank, state.x)
        H = whitened(at.whitening, aiding.derivative(state, reading, bank, means) if constant is None else constant)
        residual, passed = whitened(at.whitening, z - aiding.predict(state, reading, means)), None
        if timeline.gates is None:
            whole, done = update(full(P), H, variance, at.valid)
            c, innovation = correction(done.gain, residual, H)
        else:
            sizes = [len(s.axes) for s in sensors]
            whole, done, c, innovation, passed = gated_update(
                full(P), H, residual, variance, at.valid, sizes, timeline.gates
            )
        state, P = inject(state, c), blocks(whole)
        status = jnp.where(status == Status.ok, _check(state, whole), status)
        judgement = judge(state, claim(P, alike, sensed), bank, at.truth, inputs.errors.lasting(noise, own), sensed)
        memory = None if Phi is None else Memory(full(P), done.gain, Phi, _over_all(H, len(whole)) if varies else None)
        left = None
        if predict:  # the derivative is that of the update: what it has moved is of second order
            residual = whitened(at.whitening, z - aiding.predict(state, reading, means))
            left = Comparison(residual, residual_covariance(whole, H, variance))
        pull = timeline.earth.pull(state.p)
        P, begin = _under_earth(P, one, timeline, pull, at.halves, 1)
        kept = judgement, innovation, done.variance, state, memory, left, passed
        return (state, between.begin(P, begin), status, noise, pull), kept

    num_runs = inputs.start.p.shape[1]
    P = blocks(jnp.broadcast_to(P_start[:, :, None], (*P_start.shape, num_runs)))
    # the gradient of gravity is that where a segment begins: on the Earth it changes by 5e-7 of itself with each metre
    pull = timeline.earth.pull(inputs.start.p)
    sd = claim(P, alike, _first(timeline)).sd if trace else None
    P, begin = _under_earth(P, one, timeline, pull, _events(timeline).halves, (0, 0))
    good = jnp.zeros(num_runs, dtype=jnp.int32)
    start = (inputs.start, between.begin(P, begin), good, inputs.errors.begin(), pull)
    steps = (timeline.pattern, timeline.imu, inputs.errors.per_step, timeline.shaken)
    events = (_events(timeline), inputs.z, inputs.errors.per_segment)
    last, (kept, out) = time_loop(step, event, start, steps, events)
    judgement, innovation, variance_of, states, memory, left, passed = out
    whole = None if sd is None else _trace(timeline, inputs.start, states, bank, sd, kept, judgement)
    return Outcome(judgement, innovation, variance_of, last[2], states, whole, memory, left, passed)


def reference_gains(
    timeline: Timeline,
    bank: SensorBank,
    sensors: Sensors,
    start: NavState,
    P_start: Float[Array, "n n"],
    *,
    trace: bool = False,
    remember: bool = False,
) -> Gains:
    """Covariance and gains along the reference, for `run_reference`.

    Parameters
    ----------
    timeline, bank, sensors, P_start, trace, remember
        As in `run_estimate`; of a trace, what does not depend on the run.
    start
        The reference at the start, one run, with sensor states of zero.
    """
    aiding = measurements(timeline, sensors)
    constant, variance = aiding.constant(), aiding.variance
    moves = aiding.uses_body or bank.depends
    alike = alone(bank)
    kinds = step_noises(alike, timeline.dt, timeline.ends)
    between = Between(bank, kinds, timeline.earth, at_every_step=trace)
    one = _identity(P_start, 1) if remember else None

    def step(carry, given):
        state, at, pull = carry
        kind, imu = given
        state, motion = mechanise_with_motion(
            state, imu[:, :, None], timeline.dt[kind], timeline.ends[kind], bank, timeline.earth, pull
        )
        at = between.step(at, motion, kind)
        return (state, at, pull), claim(at.P, alike, imu[0, :, None]).sd if trace else None

    def event(carry, at):
        state, underway, pull = carry
        P, Phi = _under_earth(*between.end(underway), timeline, pull, at.halves, 0)
        sensed = at.sensed[:, None]
        reading = bank.compensated(sensed, state.x) if moves else None
        means = compensated_means(at.means, None, bank, state.x)
        H = aiding.derivative(state, reading, bank, means) if constant is None else constant
        whole, done = update(full(P), H, variance, at.valid)
        P = blocks(whole)
        kept = H if constant is None else None
        memory = None if Phi is None else Memory(whole, done.gain, Phi, kept)
        pull = timeline.earth.pull(state.p)
        claimed = claim(P, alike, sensed)
        P, begin = _under_earth(P, one, timeline, pull, at.halves, 1)
        return (state, between.begin(P, begin), pull), Gains(done, claimed, memory, kept, None)

    P = blocks(P_start[:, :, None])
    events = _events(timeline)
    at_start, pull = claim(P, alike, _first(timeline)).sd, timeline.earth.pull(start.p)
    P, begin = _under_earth(P, one, timeline, pull, events.halves, (0, 0))
    begin = start, between.begin(P, begin), pull
    _, (sd, gains) = time_loop(step, event, begin, (timeline.pattern, timeline.imu), events)
    return gains._replace(sd=(at_start, sd)) if trace else gains


def run_reference(
    timeline: Timeline, bank: SensorBank, sensors: Sensors, inputs: Inputs, gains: Gains, *, trace: bool = False
) -> Outcome:
    """Run R filters with gains that were computed along the reference; parameters as in `run_estimate`.

    Raises
    ------
    ValueError
        A trace is asked for, and the gains have none.
    """
    if trace and gains.sd is None:
        raise ValueError("A trace needs what is claimed at every step: gains_of(experiment, filter, trace=True).")
    aiding = measurements(timeline, sensors)
    constant, moves = aiding.constant(), aiding.uses_body or bank.depends

    def step(carry, given):
        state, status, noise, pull = carry
        kind, imu, own, sd = given
        ends = timeline.ends[kind]
        noise, errors = inputs.errors.step(noise, ends, own)
        sensed = with_errors(imu[:, :, None], errors)
        state = mechanise(state, sensed, timeline.dt[kind], ends, bank, timeline.earth, pull)
        kept = None if sd is None else _estimate(state, bank, sd, imu[0, :, None])
        return (state, status, noise, pull), kept

    def event(carry, given):
        state, status, noise, _ = carry
        at, known, z, own = given
        sensed = at.sensed[:, None]
        reading = bank.compensated(with_errors(sensed, inputs.errors.sample(noise, own)), state.x) if moves else None
        means = compensated_means(at.means, _of_means(inputs, aiding, noise, own), bank, state.x)
        H = known.H if constant is None else constant
        c, innovation = correction(known.update.gain, z - aiding.predict(state, reading, means), H)
        state = inject(state, c)
        status = jnp.where(status == Status.ok, _check(state, known.claim.navigation), status)
        judgement = judge(state, known.claim, bank, at.truth, inputs.errors.lasting(noise, own), sensed)
        return (state, status, noise, timeline.earth.pull(state.p)), (judgement, innovation, state)

    good = jnp.zeros(inputs.start.p.shape[1], dtype=jnp.int32)
    start = (inputs.start, good, inputs.errors.begin(), timeline.earth.pull(inputs.start.p))
    begin, sds = gains.sd if trace and gains.sd is not None else (None, None)
    steps = (timeline.pattern, timeline.imu, inputs.errors.per_step, sds)
    known = gains._replace(memory=None, sd=None)
    events = (_events(timeline), known, inputs.z, inputs.errors.per_segment)
    (_, status, _, _), (kept, (judgement, innovation, states)) = time_loop(step, event, start, steps, events)
    whole = None if begin is None else _trace(timeline, inputs.start, states, bank, begin, kept, judgement)
    return Outcome(judgement, innovation, gains.update.variance, status, states, whole, gains.memory)


def _of_means(inputs: Inputs, aiding: Measurements, noise: Any, own: Any) -> Float[Array, "W ch R"] | None:
    """Errors of the means that sensors want; None if they want none."""
    return inputs.errors.mean(noise, own, aiding.counts) if aiding.windows else None


def _estimate(
    state: NavState, bank: SensorBank, sd: Float[Array, "judged Q"], sensed: Float[Array, "seen 1"]
) -> Estimate:
    return Estimate(state.p, state.v, state.q, bank.errors(state.x, sensed), sd)


def _first(timeline: Timeline) -> Float[Array, "seen 1"]:
    """What the IMU senses at the start."""
    return timeline.imu[0, 0, 0, :, None]


def _trace(
    timeline: Timeline,
    start: NavState,
    states: NavState,
    bank: SensorBank,
    sd: Float[Array, "judged Q"],
    steps: Estimate,
    judgement: Judgement,
) -> Trace:
    """The trace of runs from their start, the estimates at the events, what is claimed at both, and the steps."""
    events = jax.vmap(lambda s, sd, sensed: _estimate(s, bank, sd, sensed))
    at_events = events(states, judgement.sd, timeline.sensed[:, :, None])
    return Trace(_estimate(start, bank, sd, _first(timeline)), steps, at_events)


class _Event(NamedTuple):
    truth: Truth
    valid: Float[Array, "M K"]
    sensed: Float[Array, "M seen"]
    whitening: Float[Array, "M K K"] | None
    means: Float[Array, "M W seen"] | None
    halves: Float[Array, "M 2"] | None


def _events(timeline: Timeline) -> _Event:
    shared = timeline.truth, timeline.valid, timeline.sensed, timeline.whitening, timeline.means
    return _Event(*shared, timeline.halves)


def _under_earth(
    P: Covariance,
    Phi: Float[Array, "n n Q"] | None,
    timeline: Timeline,
    pull: Pull | None,
    halves: Float[Array, "*M 2"] | None,
    which: int | tuple[int, int],
) -> tuple[Covariance, Float[Array, "n n Q"] | None]:
    """Covariance, and transition if it is remembered, after half a segment of what the Earth does to errors."""
    if halves is None:
        return P, Phi
    earth = None if pull is None else pull.gradient, timeline.earth.rate, halves[which]
    return covariance_under_earth(P, *earth), None if Phi is None else under_earth(Phi, *earth)


def _over_all(H: Float[Array, "K m Q"], n: int) -> Float[Array, "K n Q"]:
    """Derivatives along the first m errors, along all n."""
    return jnp.pad(H, ((0, 0), (0, n - H.shape[1]), (0, 0)))


def time_loop(step: Any, event: Any, carry: Any, steps: Any, events: Any) -> Any:
    """Both loops. Reverse mode keeps the carry of each segment only, and goes through a segment twice."""

    def segment(carry, given):
        steps, at = given
        carry, kept = jax.lax.scan(step, carry, steps)
        carry, out = event(carry, at)
        return carry, (kept, out)

    return jax.lax.scan(jax.checkpoint(segment, prevent_cse=False), carry, (steps, events))


def _identity(P: Float[Array, "n n"], num: int) -> Float[Array, "n n Q"]:
    return jnp.broadcast_to(jnp.eye(P.shape[0])[:, :, None], (*P.shape, num))


def _check(state: NavState, P: Float[Array, "n n Q"]) -> Int[Array, " R"]:
    """Status of each run at an event."""
    sums = sum(jnp.sum(a, axis=0) for a in state)
    variances = jnp.stack([P[i, i] for i in range(P.shape[0])])
    finite = jnp.isfinite(sums + jnp.sum(variances, axis=0))
    positive = jnp.all(variances >= 0, axis=0)
    bad = jnp.where(finite & positive, int(Status.ok), int(Status.not_positive))
    return jnp.where(finite, bad, int(Status.non_finite)).astype(jnp.int32)
