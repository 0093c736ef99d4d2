"""What runs take and give: the schedule with what all of them share, their inputs, their outcome, as arrays."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from gmwm_jax._internal.checks import as_float
from nav_jax.aiding.base import AbstractAiding
from nav_jax.aiding.states import OwnStates, own_states
from nav_jax.filter.ekf import Update
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.filter.schedule import Schedule
from nav_jax.filter.score import Claim, Judgement, Truth
from nav_jax.filter.windows import window_means
from nav_jax.imu.bank import SensorBank
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.emulation import AbstractErrors
from nav_jax.imu.imu import Imu
from nav_jax.kinematics.earth import AbstractEarth, EarthInLoops
from nav_jax.kinematics.state import NavState


class Timeline(eqx.Module):
    """A run's schedule and what all runs share, as arrays; M segments of G steps of n pieces."""

    imu: Float[Array, "M G n seen"]
    """Perfect sensors, and behind them the temperature less that at the start, in K, where it is known."""
    pattern: Int[Array, "M G"]
    dt: Float[Array, "U n"]
    ends: Float[Array, "U n"]
    truth: Truth
    """At the end of each segment."""
    valid: Float[Array, "M K"]
    """1 where a scalar is measured at the end of a segment."""
    earth: EarthInLoops
    sensed: Float[Array, "M seen"]
    """The perfect sample that begins at the end of each segment, or goes on there."""
    own: OwnStates
    """States of the aiding sensors that filters have."""
    drawn: OwnStates
    """Those that are there."""
    whitening: Float[Array, "M K K"] | None = None
    """What is multiplied onto residuals and derivatives of scalars whose noise is another at every event; None where
    it is the same at all."""
    means: Float[Array, "M W seen"] | None = None
    """Of perfect samples about the end of each segment, in the windows of all sensors; None if there are none."""
    shaken: Float[Array, "M G ch #R"] | None = None
    """Variance of further white noise in the integral of each channel over each step; None for none."""
    gates: Float[Array, " S"] | None = None
    """Of each sensor, the normalised innovation squared beyond which its fixes are refused; None where all are taken.
    Of filters with a covariance of their own."""

    @property
    def halves(self) -> Float[Array, "M 2"] | None:
        """Half of the length of each segment and of the next, s; None where errors feel the Earth at every step."""
        if not self.earth.by_segment:
            return None
        half = jnp.sum(jnp.sum(self.dt, axis=1)[self.pattern], axis=1) / 2
        return jnp.stack([half, jnp.append(half[1:], 0.0)], axis=1)


class Inputs(NamedTuple):
    """What R runs are given."""

    start: NavState
    errors: AbstractErrors
    """Added to the perfect sensors."""
    z: Float[Array, "M K R"]
    """Measurements; anything where there are none."""


class Memory(NamedTuple):
    """What a smoother wants of each of the M segments."""

    P: Float[Array, "M n n Q"]
    """Covariance at its end, after the update."""
    gain: Float[Array, "M K n Q"]
    """Of that update, see `Update`."""
    transition: Float[Array, "M n n Q"]
    """From its beginning to its end, before the update."""
    H: Float[Array, "M K n Q"] | None
    """Derivative of the scalars, where it is not one constant."""


class Estimate(NamedTuple):
    """What filters estimate, and what they claim of it."""

    p: Float[Array, "*E 3 R"]
    v: Float[Array, "*E 3 R"]
    q: Float[Array, "*E 4 R"]
    sensors: Float[Array, "*E ch R"]
    """Errors of the channels."""
    sd: Float[Array, "*E judged Q"]
    """Standard deviations, columns `JUDGED`."""


class Trace(NamedTuple):
    """All estimates of a run."""

    start: Estimate
    steps: Estimate
    """After each of the (M, G) covariance steps, before any update."""
    events: Estimate
    """After the update at the end of each of the M segments, if there is one."""


class Comparison(NamedTuple):
    """What a filter says of all K scalars at the end of each of the M segments, after its update there.

    Of a scalar that was kept from it, that is a prediction.
    """

    residual: Float[Array, "M K R"]
    """Measured - predicted."""
    covariance: Float[Array, "M K K Q"]
    """Of that, as the filter states it, noise of the scalars included."""


class Outcome(NamedTuple):
    """What comes out, at the end of each of the M segments."""

    judgement: Judgement
    innovation: Float[Array, "M K R"]
    variance: Float[Array, "M K Q"]
    """Of the innovations."""
    status: Int[Array, " R"]
    state: NavState
    """The estimate."""
    trace: Trace | None
    """If it was asked for."""
    memory: Memory | None
    """If it was asked for."""
    comparison: Comparison | None = None
    """If it was asked for."""
    passed: Bool[Array, "M S R"] | None = None
    """Which of the sensors' fixes passed their gates, where there are gates."""


class Gains(NamedTuple):
    """What all runs share with `run_reference`, at the end of each of the M segments."""

    update: Update
    claim: Claim
    memory: Memory | None
    H: Float[Array, "M K n 1"] | None
    """Derivative of the scalars, where it is not one constant."""
    sd: tuple[Float[Array, "judged 1"], Float[Array, "M G judged 1"]] | None
    """Claimed at the start and after each covariance step, if it was asked for."""


def timeline_of(
    imu: Imu,
    schedule: Schedule,
    sensors: Sequence[AbstractAiding],
    fix_segments: Sequence[Int[np.ndarray, " _"]],
    truth: Truth,
    earth: AbstractEarth,
    *,
    neglected: Sequence[str] = (),
    suspected: Sequence[str] = (),
    shaken: Float[np.ndarray, "samples ch"] | None = None,
) -> Timeline:
    """The schedule of a run with its IMU, as arrays.

    For `neglected` and `suspected` see `Scenario`; `shaken` are densities of further white noise, of each sample, in SI
    units squared per Hz.
    """
    M, G = schedule.pattern.shape
    # pieces that fill up after the last sample take any
    samples = np.minimum(schedule.samples, len(imu) - 1)
    sizes = [len(s.axes) for s in sensors]
    valid = np.zeros((M, sum(sizes)))
    for at, size, segments in zip(np.cumsum([0, *sizes]), sizes, fix_segments, strict=False):
        valid[segments, at : at + size] = 1.0
    after = np.minimum(np.cumsum(schedule.ends[schedule.pattern].sum(axis=(1, 2))).astype(int), len(imu) - 1)
    warmer = [] if imu.temperature is None else [(imu.temperature - imu.temperature[0])[:, None]]
    seen = np.concatenate([imu.accel, imu.gyro, *warmer], axis=1)
    means = window_means(imu, schedule.time, [w for s in sensors for w in s.windows])
    if means is not None and warmer:
        now = jnp.broadcast_to(as_float(warmer[0][after])[:, None], (*means.shape[:2], 1))
        means = jnp.concatenate([means, now], axis=2)
    added = None
    if shaken is not None:
        lengths = schedule.dt[schedule.pattern]
        densities = shaken[samples].reshape(M, G, -1, len(CHANNELS))
        added = as_float(np.einsum("mgn,mgnc->mgc", lengths, densities)[..., None])
    return Timeline(
        imu=as_float(seen[samples].reshape(M, G, -1, seen.shape[1])),
        pattern=jax.device_put(schedule.pattern),
        dt=as_float(schedule.dt),
        ends=as_float(schedule.ends),
        truth=truth,
        valid=as_float(valid),
        earth=_in_loops(earth),
        sensed=as_float(seen[after]),
        own=own_states(sensors, imu.rate, neglected),
        drawn=own_states(sensors, imu.rate, suspected),
        means=means,
        shaken=added,
    )


_in_loops = jax.jit(EarthInLoops)


def start_covariance(initial: InitialUncertainty, bank: SensorBank) -> Float[Array, "n n"]:
    """Covariance of the error state at the start."""
    return jax.scipy.linalg.block_diag(initial.covariance, bank.initial)
