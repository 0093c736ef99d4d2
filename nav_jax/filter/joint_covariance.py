r"""Linear covariance analysis: what a filter's errors are, and what it says of them, without one random number.

A filter that believes another model than the truth has two covariances: the one that it computes, and that of its
errors. To first order in the errors both follow from its gains along the reference. With the navigation error e, the
filter's sensor states xh and the true ones x (of another number and kind), the vector (e, xh, x) is Markov:

- the error of a sensor after compensation is h' x + v - hh' xh, so (xh, x) acts like one bank of states with the
  readout (hh, -h): its transition over a step is `error_model.propagate`; the noise of the truth drives x and not xh;
- an update adds K (v - H e) to (e, xh) and leaves x.

Its second moment is propagated with the noise of the truth and the gains K of the filter (Gelb 1974, ch. 7; Maybeck
1979, sec. 6.8). States of an aiding sensor's own noise come last, and move from fix to fix. All is differentiable in
every parameter of the truth, the filter, the aiding noise and the initial covariance; reverse mode keeps one carry a
segment and goes through the segments twice.
"""

from functools import reduce
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.linalg import block_diag
from jaxtyping import Bool, Float, Int

from gmwm_jax._internal.programs import bounded
from nav_jax.aiding.states import joined, power
from nav_jax.filter.between import Between
from nav_jax.filter.ekf import mechanise_with_motion, update
from nav_jax.filter.error_model import Covariance, Motion, blocks, covariance_under_earth, full
from nav_jax.filter.experiment import Experiment
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.layout import NAVIGATION
from nav_jax.filter.loop import time_loop
from nav_jax.filter.measurement import Measurements, Partials, measurements
from nav_jax.filter.score import Claim, Truth, claim
from nav_jax.filter.timeline import Timeline, start_covariance
from nav_jax.imu.bank import SensorBank, Travel, alone, step_noises
from nav_jax.imu.channels import CHANNELS, NO_CHANNEL, SensorState
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import markov_form
from nav_jax.kinematics.linalg import symmetrise, transpose
from nav_jax.kinematics.state import NavState


class Lincov(NamedTuple):
    """The covariances at the end of each of the M segments of an experiment, after the update there."""

    true: Claim
    """Second moments of the errors: navigation (M, nav, nav), channels (M, ch, ch)."""
    claimed: Claim
    """What the filter says of them."""
    innovation: Float[Array, "M K"]
    """True variance of the innovations, each given those before; 0 where there is no fix."""
    innovation_claimed: Float[Array, "M K"]
    """What the filter says of it."""
    valid: Bool[Array, " M"]
    """Whether no variance was negative or not finite by then, of what was given and of what came out."""


@bounded
@eqx.filter_jit
def motion_of(experiment: Experiment) -> Motion:
    """Compute the motion over each covariance step, arrays (M, G, ...): all that covariances ask of a reference.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    >>> motion = nj.lincov.motion_of(experiment)  # once, for many filters along one reference
    >>> result = nj.lincov.linear_covariance(experiment, truth, truth, motion=motion)
    """
    timeline = experiment.timeline
    none = _no_states()

    def segment(state, given):
        pull = timeline.earth.pull(state.p)

        def step(state, given):
            kind, imu = given
            dt, ends = timeline.dt[kind], timeline.ends[kind]
            return mechanise_with_motion(state, imu[:, :, None], dt, ends, none, timeline.earth, pull, with_all=True)

        return jax.lax.scan(step, state, given)

    return jax.lax.scan(segment, experiment.start, (timeline.pattern, timeline.imu))[1]


class AidingNoise(eqx.Module):
    """True noise of the aiding sensors, scalar by scalar: its states, and how they move from fix to fix.

    They move at every fix, used or not: after one that is used by as many as there are to the next that is.
    """

    forms: tuple[Any, ...]
    """State-space form of each scalar."""
    elapsed: Int[Array, "M K"]
    """Fixes to the next that is used."""
    first: Int[Array, " K"]
    """Fixes before the first that is used."""
    num_fixes: tuple[int, ...] = eqx.field(static=True)

    @property
    def size(self) -> int:
        """Number of states."""
        return sum(len(f.readout) for f in self.forms)

    @property
    def readout(self) -> Float[Array, "K S"]:
        """What the states add to each scalar."""
        return block_diag(jnp.zeros((0, 0)), *(f.readout[None] for f in self.forms))

    @property
    def white(self) -> Float[Array, " K"]:
        """Variance of the part without memory."""
        return jnp.stack([f.white for f in self.forms]) if self.forms else jnp.zeros(0)

    @property
    def initial(self) -> Float[Array, "S S"]:
        """Covariance of the states at the first fix."""
        return block_diag(jnp.zeros((0, 0)), *(f.initial for f in self.forms))

    def advance(self, J: Float[Array, "n n"], elapsed: Int[Array, " K"]) -> Float[Array, "n n"]:
        """Joint covariance, these states last, after as many fixes of each scalar's sensor."""
        if not self.size:
            return J
        of_scalars = enumerate(zip(self.forms, self.num_fixes, strict=True))
        many = [power(f.transition, f.driving, elapsed[i], num) for i, (f, num) in of_scalars]
        rest = J.shape[0] - self.size
        A = block_diag(jnp.eye(rest), *(a for a, _ in many))
        return A @ J @ A.T + block_diag(jnp.zeros((rest, rest)), *(q for _, q in many))


class Noise(eqx.Module):
    """All that is random in truth."""

    start: Float[Array, "nav nav"]
    """Covariance of the navigation error at the start."""
    imu: SensorBank
    aiding: AidingNoise


def noise_of(experiment: Experiment, truth: ImuErrors) -> Noise:
    """What is random in an experiment whose IMU has these errors.

    Raises
    ------
    ValueError
        A process has no state-space form (BI, FLK, FGN).
    """
    forms, elapsed, first, nums = [], [], [], []
    num_segments = experiment.timeline.valid.shape[0]
    zero = jnp.zeros(num_segments, dtype=int)
    for sensor, (fix, segment), num in zip(experiment.sensors, experiment.fixes, experiment.num_fixes, strict=True):
        to_next = zero.at[segment].set(jnp.diff(fix, append=fix[-1:]))
        for axis, model in zip(sensor.axes, sensor.noise, strict=True):
            forms.append(markov_form(model, f"{sensor.name} {axis}"))
            elapsed.append(to_next)
            first.append(fix[0])
            nums.append(num)
    aiding = AidingNoise(
        tuple(forms),
        jnp.stack(elapsed, axis=1) if forms else zero[:, None][:, :0],
        jnp.stack(first) if forms else zero[:0],
        tuple(nums),
    )
    bank = joined(truth.bank(complete=True), experiment.timeline.drawn)
    return Noise(experiment.initial.covariance, bank, aiding)


@bounded
@eqx.filter_jit
def linear_covariance(
    experiment: Experiment,
    truth: ImuErrors,
    filter: ImuErrors,
    *,
    believed_initial: InitialUncertainty | None = None,
    motion: Motion | None = None,
) -> Lincov:
    """Compute the true and the claimed covariance of a filter along the reference, or of many filters at once.

    Parameters
    ----------
    experiment
        See `prepare`; its sensors know the true noise and the standard deviations that the filter believes.
    truth, filter
        Errors of the IMU as they are, and as the filter believes them. Either may be L of them, as ``jax.vmap(build)(
        parameters)`` gives them: with a leading axis of L in every array. All results have it then. That is as pure as
        ``jax.vmap(linear_covariance)``, and twice as fast, since it keeps the L filters as the last axis.
    believed_initial
        What the filter believes of its start; the true uncertainty if not given.
    motion
        See `motion_of`; computed if not given.

    Raises
    ------
    ValueError
        A true process has no state-space form (BI, FLK, FGN); several truths and another number of filters.

    Examples
    --------
    >>> reference = nj.motions.lemniscate(duration=10.0, rate=20.0)
    >>> scenario = nj.Scenario(reference, [nj.GnssPosition(horizontal=0.1, vertical=0.2)])
    >>> truth = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> experiment = nj.filter.prepare(scenario, rate=20.0)
    >>> result = nj.lincov.linear_covariance(experiment, truth, truth)
    >>> bool(jnp.allclose(result.true.navigation, result.claimed.navigation))  # a filter that believes the truth
    True
    """
    motion = motion_of(experiment) if motion is None else motion
    initial = experiment.initial if believed_initial is None else believed_initial
    several = [e.bias_sd.ndim == 2 for e in (truth, filter)]
    noises = jax.vmap(lambda t: noise_of(experiment, t))(truth) if several[0] else alone(noise_of(experiment, truth))
    ours = jax.vmap(lambda f: f.bank())(filter) if several[1] else alone(filter.bank())
    found = covariances_of_many(experiment, motion, noises, ours, initial)
    return found if any(several) else jax.tree.map(lambda a: a[0], found)


def covariances_along(
    experiment: Experiment, motion: Motion, noise: Noise, ours: SensorBank, initial: InitialUncertainty
) -> Lincov:
    """As `linear_covariance`, from what it is made of: a filter with the states `ours` that believes this start."""
    return jax.tree.map(lambda a: a[0], covariances_of_many(experiment, motion, alone(noise), alone(ours), initial))


def covariances_of_many(
    experiment: Experiment, motion: Motion, noises: Noise, ours: SensorBank, initial: InitialUncertainty
) -> Lincov:
    """As `covariances_along`, for many truths, many filters or both: arrays with a leading axis of L, or of 1.

    Raises
    ------
    ValueError
        Several truths, and another number of filters.
    """
    timeline = experiment.timeline
    true_lanes, our_lanes = len(noises.start), len(ours.white)
    if 1 != true_lanes != our_lanes != 1:
        raise ValueError(f"{true_lanes} truths and {our_lanes} filters: as many of both are wanted, or one of either.")
    lanes = max(true_lanes, our_lanes)
    noises, ours = _repeated(noises, lanes), jax.vmap(lambda bank: joined(bank, timeline.own))(ours)
    joint = jax.vmap(_joint)(_repeated(ours, lanes), noises)
    aiding, elapsed = noises.aiding, noises.aiding.elapsed[0]  # all lanes have the same fixes
    sensors, true_sensors = (measurements(timeline, experiment.sensors, drawn=drawn) for drawn in (False, True))
    constant, variance = sensors.constant(), sensors.variance
    partials = None if sensors.linear else _along(experiment, sensors)
    motion = motion if joint.depends else motion._replace(reading=None)
    motion = motion if joint.travel is not None else motion._replace(distance=None)
    readout, white = jax.vmap(lambda a: (a.readout, a.white), out_axes=-1)(aiding)
    betweens = [
        Between(banks, step_noises(banks, timeline.dt, timeline.ends), timeline.earth) for banks in (ours, joint)
    ]
    # as in a Monte Carlo, rounding errors are no part of what the states stand for
    lasting = eqx.tree_at(lambda b: b.readout, joint, joint.readout * _is_lasting(joint))
    sound = _positive(joint.white.T, white, variance[:, None], *(_diagonals(b) for b in (ours, joint)))

    def move(J, elapsed):
        return jax.vmap(lambda a, J: a.advance(J, elapsed), in_axes=(0, -1), out_axes=-1)(aiding, J)

    def step(carry, given):
        kind, motion = given
        return tuple(b.step(at, motion, kind) for b, at in zip(betweens, carry, strict=True)), None

    def event(carry, given):
        valid, elapsed, sensed, partials, truth, earth = given
        P, J = (_under_earth(b.end(at)[0], timeline, earth, 0) for b, at in zip(betweens, carry, strict=True))
        sensed = sensed[:, None]
        H, of_rest = constant, readout
        if H is None:
            H = _over_states(sensors, partials, ours, sensed)
            h = _over_states(true_sensors, partials, noises.imu, sensed)
            # what the true states add to a measurement, they take off the innovation
            of_rest = jnp.concatenate([-h[:, NAVIGATION.size :], readout], axis=1)
        whole, done = update(full(P), H, variance, valid)
        both, innovation = _update_joint(full(J), H, of_rest, white, done.gain)
        P, J = blocks(whole), blocks(move(both, elapsed))
        valid = valid[:, None]
        positive = sound & _positive(done.variance, innovation, _diagonal(whole), jnp.abs(_diagonal(both)))
        out = Lincov(
            claim(J, lasting, sensed).along(truth),
            claim(P, ours, sensed).along(truth),
            valid * innovation,
            valid * done.variance,
            positive,
        )
        return tuple(b.begin(_under_earth(X, timeline, earth, 1)) for b, X in zip(betweens, (P, J), strict=True)), out

    P = jax.vmap(lambda bank: start_covariance(initial, bank), out_axes=-1)(ours)
    J = jax.vmap(lambda n, bank: n.aiding.advance(block_diag(n.start, bank.initial), n.aiding.first), out_axes=-1)(
        noises, joint
    )
    earth = _pulls(experiment)
    first = jax.tree.map(lambda a: a[0], earth)
    begin = (_under_earth(blocks(X), timeline, first, 0) for X in (P, J))
    carry = tuple(b.begin(X) for b, X in zip(betweens, begin, strict=True))
    events = (timeline.valid, elapsed, timeline.sensed, partials, timeline.truth, earth)
    found = time_loop(step, event, carry, (timeline.pattern, motion), events)[1][1]
    return jax.tree.map(lambda a: jnp.moveaxis(jnp.broadcast_to(a, (*a.shape[:-1], lanes)), -1, 0), found)


class _Pulls(NamedTuple):
    """What the Earth does to errors in a segment (0) and in the next (1), where it is by the segment."""

    halves: Float[Array, "*M 2"]
    """Half of their lengths, s."""
    gradient: Float[Array, "*M 2 3 3 1"] | None
    """Of gravity, where they begin."""


def _pulls(experiment: Experiment) -> _Pulls | None:
    timeline = experiment.timeline
    if timeline.halves is None:
        return None
    gradient = None
    if timeline.earth.constant is None:
        begin = jnp.concatenate([experiment.start.p[None], timeline.truth.p])
        found = jax.vmap(timeline.earth.earth.gradient_n)(begin)
        gradient = jnp.stack([found[:-1], found[1:]], axis=1)
    return _Pulls(timeline.halves, gradient)


def _under_earth(P: Covariance, timeline: Timeline, earth: _Pulls | None, which: int) -> Covariance:
    """A covariance after half a segment of what the Earth does to errors."""
    if earth is None:
        return P
    gradient = None if earth.gradient is None else earth.gradient[which]
    return covariance_under_earth(P, gradient, timeline.earth.rate, earth.halves[which])


def _along(experiment: Experiment, sensors: Measurements) -> Partials:
    """Derivatives of what is measured at the end of each segment of the reference."""
    timeline = experiment.timeline
    nothing = jnp.zeros((timeline.own.size, 1))

    def at(truth: Truth, sensed: Array, means: Array | None) -> Partials:
        state = NavState(truth.p, truth.v, truth.q, nothing)
        return sensors.partials(state, sensed[:, None], None if means is None else means[:, :, None])

    return jax.vmap(at)(timeline.truth, timeline.sensed, timeline.means)


def _over_states(
    sensors: Measurements, partials: Partials, banks: SensorBank, sensed: Float[Array, "ch 1"]
) -> Float[Array, "K n L"]:
    """Derivatives along the error states of L banks."""
    return jax.vmap(lambda bank: sensors.over_state(partials, bank, sensed)[:, :, 0], out_axes=-1)(banks)


def _is_lasting(bank: SensorBank) -> Float[np.ndarray, "1 M"]:
    """0 for states that no filter holds."""
    return np.array([[float(s.in_filter) for s in bank.states]])


def _diagonals(banks: SensorBank) -> Float[Array, "_ L"]:
    """Variances of the driving noise and of the start."""
    return jnp.concatenate([_diagonal(jnp.moveaxis(a, 0, -1)) for a in (banks.driving, banks.initial)])


def _diagonal(P: Float[Array, "n n L"]) -> Float[Array, "n L"]:
    return jnp.diagonal(P).T


def _positive(*variances: Float[Array, "_ #L"]) -> Bool[Array, " _"]:
    """Is none negative or not finite?"""
    return reduce(jnp.logical_and, (jnp.all((v >= 0) & jnp.isfinite(v), axis=0) for v in variances))


def _repeated(lanes: Any, num: int) -> Any:
    """Arrays with a leading axis of `num` where it is that or 1."""
    return jax.tree.map(lambda a: jnp.broadcast_to(a, (num, *a.shape[1:])), lanes)


def _update_joint(
    J: Float[Array, "n n L"],
    H: Float[Array, "K h #L"],
    readout: Float[Array, "K S L"],
    white: Float[Array, "K L"],
    gain: Float[Array, "K m Q"],
) -> tuple[Float[Array, "n n L"], Float[Array, "K L"]]:
    """Second moment after the filter has taken K scalars with its gains, and the variances of the innovations.

    An innovation given those before is h (e, xh, x) + v for the errors after those before: what `J` then is of. The
    first m, (e, xh), are corrected; h is `H` on the first of them and `readout` on the last S of all states, those of
    the aiding sensors' noise or all true ones.
    """
    m, aiding, seen = gain.shape[1], J.shape[0] - readout.shape[1], H.shape[1]

    def scalar(carry, inputs):
        A, B = carry  # the first m rows of J: [A B]
        h, c, r, K = inputs
        u = jnp.sum(A[:, :seen] * h[None], axis=1) + jnp.sum(B[:, aiding - m :] * c[None], axis=1)
        w = jnp.sum(B[:seen] * h[:, None], axis=0) + jnp.sum(rest[:, aiding - m :] * c[None], axis=1)
        s = jnp.sum(h * u[:seen], axis=0) + jnp.sum(c * w[aiding - m :], axis=0) + r
        # (1 - K h) J (1 - K h)' + K r K'; a gain is 0 where there is no fix
        Ku = K[:, None] * u[None]
        A = A - (Ku + transpose(Ku) - K[:, None] * (s[None] * K)[None])
        return (A, B - K[:, None] * w[None]), s

    rest = J[m:, m:]
    (A, B), s = jax.lax.scan(scalar, (J[:m, :m], J[:m, m:]), (H, readout, white, gain))
    return full(Covariance(symmetrise(A), B, rest)), s


def _joint(ours: SensorBank, noise: Noise) -> SensorBank:
    """The filter's states, the true ones, and those of the aiding sensors, which rest between fixes."""
    truth, aiding = noise.imu, noise.aiding
    nothing, rest = jnp.zeros_like(ours.transition), jnp.eye(aiding.size)
    return SensorBank(
        transition=block_diag(ours.transition, truth.transition, rest),
        driving=block_diag(nothing, truth.driving, jnp.zeros_like(rest)),
        readout=jnp.concatenate([ours.readout, -truth.readout, jnp.zeros(aiding.size)]),
        initial=block_diag(nothing, truth.initial, aiding.initial),
        white=truth.white,
        rate=truth.rate,
        states=(*ours.states, *truth.states, *(SensorState(NO_CHANNEL, "aiding noise") for _ in range(aiding.size))),
        diagonal=ours.diagonal and truth.diagonal,
        travel=_both_travel(ours, truth, aiding.size),
    )


def _both_travel(ours: SensorBank, truth: SensorBank, others: int) -> Travel | None:
    """Of the filter's states, which nothing drives in truth, the true ones, and others that do not fade."""
    if ours.travel is None and truth.travel is None:
        return None
    none = jnp.zeros(others)
    mine, true = (
        Travel(*2 * (jnp.zeros(len(bank.states)),)) if bank.travel is None else bank.travel for bank in (ours, truth)
    )
    return Travel(
        jnp.concatenate([mine.inverse, true.inverse, none]),
        jnp.concatenate([jnp.zeros_like(mine.variance), true.variance, none]),
    )


def _no_states() -> SensorBank:
    none = jnp.zeros((0, 0))
    return SensorBank(none, none, jnp.zeros(0), none, jnp.zeros(len(CHANNELS)), jnp.ones(()), states=(), diagonal=True)
