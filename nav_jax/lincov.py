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

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jax.scipy.linalg import block_diag
from jaxtyping import Float, Int

from nav_jax.ekf import mechanise_with_motion, update
from nav_jax.error_model import Motion, blocks, full, propagate
from nav_jax.experiment import Experiment, start_covariance
from nav_jax.filter import stacked, time_loop
from nav_jax.initial import InitialUncertainty
from nav_jax.judge import Claim, claim
from nav_jax.layout import SensorState
from nav_jax.linalg import symmetrise
from nav_jax.noise import ImuErrors
from nav_jax.noise_models import markov_form
from nav_jax.sensor_bank import SensorBank, step_noise

NO_CHANNEL = -1
"""Channel of a state that no IMU channel reads."""


class Lincov(NamedTuple):
    """Covariances at the end of each of the M segments of an experiment, after the update there."""

    true: Claim
    """Second moments of the errors: navigation (M, 9, 9), channels (M, 6, 6)."""
    claimed: Claim
    """What the filter says of them."""
    innovation: Float[Array, "M K"]
    """True variance of the innovations, each given those before; 0 where there is no fix."""
    innovation_claimed: Float[Array, "M K"]
    """What the filter says of it."""


@eqx.filter_jit
def motion_of(experiment: Experiment) -> Motion:
    """The motion over each covariance step of the reference, arrays (M, G, ...): all that the covariances ask of it."""
    timeline = experiment.timeline
    none = _no_states()

    def step(state, given):
        kind, imu = given
        dt, ends = timeline.dt[kind], timeline.ends[kind]
        return mechanise_with_motion(state, imu[:, :, None], dt, ends, none, timeline.g_n)

    def segment(state, given):
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
        many = [_power(f, elapsed[i], num) for i, (f, num) in enumerate(zip(self.forms, self.num_fixes, strict=True))]
        rest = J.shape[0] - self.size
        A = block_diag(jnp.eye(rest), *(a for a, _ in many))
        return A @ J @ A.T + block_diag(jnp.zeros((rest, rest)), *(q for _, q in many))


class Noise(eqx.Module):
    """All that is random in truth."""

    start: Float[Array, "9 9"]
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
    return Noise(experiment.initial.covariance, truth.bank(complete=True), aiding)


@eqx.filter_jit
def linear_covariance(
    experiment: Experiment,
    truth: ImuErrors,
    believed: ImuErrors,
    *,
    believed_initial: InitialUncertainty | None = None,
    motion: Motion | None = None,
) -> Lincov:
    """True and claimed covariance of a filter along the reference.

    Parameters
    ----------
    experiment
        See `prepare`; its sensors know the true noise and the standard deviations that the filter believes.
    truth, believed
        Errors of the IMU as they are, and as the filter believes them.
    believed_initial
        What the filter believes of its start; the true uncertainty if not given.
    motion
        See `motion_of`; computed if not given.

    Raises
    ------
    ValueError
        A true process has no state-space form (BI, FLK, FGN).
    """
    motion = motion_of(experiment) if motion is None else motion
    initial = experiment.initial if believed_initial is None else believed_initial
    return covariances_along(experiment, motion, noise_of(experiment, truth), believed.bank(), initial)


def covariances_along(
    experiment: Experiment, motion: Motion, noise: Noise, ours: SensorBank, initial: InitialUncertainty
) -> Lincov:
    """As `linear_covariance`, from what it is made of: a filter with the states `ours` that believes this start."""
    timeline, aiding = experiment.timeline, noise.aiding
    joint = _joint(ours, noise)
    H, variance = stacked(experiment.sensors)
    H_joint = jnp.concatenate([H, jnp.zeros((len(H), len(joint.states) - aiding.size)), aiding.readout], axis=1)
    kinds = jax.vmap(lambda dt, ends: (step_noise(ours, dt, ends), step_noise(joint, dt, ends)))(
        timeline.dt, timeline.ends
    )

    def step(carry, given):
        kind, motion = given
        noises = jax.tree.map(lambda a: a[kind], kinds)
        return tuple(propagate(P, motion, noise) for P, noise in zip(carry, noises, strict=True)), None

    def event(carry, given):
        P, J = carry
        valid, elapsed = given
        whole, done = update(full(P), H, variance, valid)
        both, innovation = _update_joint(full(J)[:, :, 0], H_joint, aiding.white, done.gain[:, :, 0])
        P, J = blocks(whole), blocks(aiding.advance(both, elapsed)[:, :, None])
        out = Lincov(claim(J, joint), claim(P, ours), valid * innovation, valid * done.variance[:, 0])
        return (P, J), jax.tree.map(lambda a: a[..., 0] if a.ndim == 3 else a, out)

    J = aiding.advance(block_diag(noise.start, joint.initial), aiding.first)
    carry = (blocks(start_covariance(initial, ours)[:, :, None]), blocks(J[:, :, None]))
    return time_loop(step, event, carry, (timeline.pattern, motion), (timeline.valid, aiding.elapsed))[1][1]


def _power(form: Any, count: Int[Array, ""], largest: int) -> tuple[Array, Array]:
    """Transition and noise of `count` steps, by doubling."""
    A, Q = form.transition, form.driving
    total_A, total_Q = jnp.eye(A.shape[0]), jnp.zeros_like(Q)
    for bit in range(max(largest, 1).bit_length()):
        take = (count >> bit) & 1
        total_Q = jnp.where(take, A @ total_Q @ A.T + Q, total_Q)
        total_A = jnp.where(take, A @ total_A, total_A)
        A, Q = A @ A, A @ Q @ A.T + Q
    return total_A, total_Q


def _update_joint(
    J: Float[Array, "n n"],
    H: Float[Array, "K n"],
    white: Float[Array, " K"],
    gain: Float[Array, "K m"],
) -> tuple[Float[Array, "n n"], Float[Array, " K"]]:
    """Second moment after the filter has taken K scalars with its gains, and the variances of the innovations.

    An innovation given those before is h (e, xh, x) + v for the errors after those before: what `J` then is of.
    """
    gain = jnp.pad(gain, ((0, 0), (0, J.shape[0] - gain.shape[1])))

    def scalar(J, inputs):
        h, r, K = inputs
        u = J @ h
        s = h @ u + r
        # (1 - K h) J (1 - K h)' + K r K'; a gain is 0 where there is no fix
        J = J - jnp.outer(K, u) - jnp.outer(u, K) + s * jnp.outer(K, K)
        return symmetrise(J), s

    return jax.lax.scan(scalar, J, (H, white, gain))


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
        states=(*ours.states, *truth.states, *(SensorState(NO_CHANNEL, "aiding") for _ in range(aiding.size))),
        diagonal=ours.diagonal and truth.diagonal,
    )


def _no_states() -> SensorBank:
    none = jnp.zeros((0, 0))
    return SensorBank(none, none, jnp.zeros(0), none, jnp.zeros(6), jnp.ones(()), states=(), diagonal=True)
