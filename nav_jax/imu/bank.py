"""All Markov states of a sensor error model, stacked, and what they do over a covariance step.

Sample and hold: sample k of an error lasts from t_k to t_{k+1}, in the emulation and in the filter alike. The integral
of a state over a step is then a finite sum and its discretisation exact, without a series: over samples of length dt_i,

    y = sum_i dt_i (h' x_i + v_i),    x_{i+1} = Phi x_i + w_i,

and `step_noise` adds up the weights of x_0 in y and the covariances of the noise in y and x, sample by sample. White
noise has the density r/f, also over a part of a sample (where a fix lies between two samples).

States of gravity move with the distance travelled (`Travel`), in which a step is short: over it they are held.
"""

from functools import cache
from itertools import groupby
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from nav_jax.imu.channels import CHANNELS, GRAVITY, TEMPERATURE, SensorState


class Travel(NamedTuple):
    """States that fade with the distance travelled s, by exp(-s/D), and are driven back to their variance."""

    inverse: Float[Array, "*Q M"]
    """1/D in 1/m; 0 for a state that does not."""
    variance: Float[Array, "*Q M"]
    """That they are driven to; 0 for a state that nothing drives."""


class SensorBank(eqx.Module):
    """The states of the six channels, per sample: x' = Phi x + w, error of a channel = sum of h x + v."""

    transition: Float[Array, "M M"]
    driving: Float[Array, "M M"]
    """Covariance of w."""
    readout: Float[Array, " M"]
    initial: Float[Array, "M M"]
    """Covariance of x at the start."""
    white: Float[Array, " ch"]
    """Variance of v of each channel."""
    rate: Float[Array, ""]
    """Hz."""
    states: tuple[SensorState, ...] = eqx.field(static=True)
    diagonal: bool = eqx.field(static=True)
    """Does every state go its own way? Then products with Phi are elementwise."""
    travel: Travel | None = None
    """None where no state moves with the distance."""

    @property
    def channels(self) -> tuple[int, ...]:
        """The channel of each state."""
        return tuple(s.channel for s in self.states)

    @property
    def depends(self) -> bool:
        """Does what a state does depend on what the IMU senses, or on its temperature?"""
        return any(s.reads is not None for s in self.states)

    def readout_at(self, sensed: Float[Array, "seen _"] | None) -> Float[Array, "M _"]:
        """What each state adds to its channel, at a reading of the IMU; that is not looked at unless `depends`."""
        if not self.depends:
            return self.readout[:, None]
        return self.readout[:, None] * multiples(self.states, sensed)

    def errors(self, x: Float[Array, "M R"], sensed: Float[Array, "seen _"] | None = None) -> Float[Array, "ch R"]:
        """The error of each channel without its white part, where it senses that."""
        return by_channel(self.channels, self.readout_at(sensed) * x)

    def steady(self, x: Float[Array, "M R"]) -> Float[Array, "ch R"]:
        """The part of `errors` that is the same whatever is sensed."""
        return by_channel(self.channels, self._part(changing=False)[:, None] * x)

    def changing(self, x: Float[Array, "M R"], sensed: Float[Array, "seen _"]) -> Float[Array, "ch R"]:
        """The other part."""
        return by_channel(self.channels, self._part(changing=True)[:, None] * multiples(self.states, sensed) * x)

    def _part(self, *, changing: bool) -> Float[Array, " M"]:
        if not self.depends:
            return self.readout
        return self.readout * np.array([float((s.reads is not None) == changing) for s in self.states])

    def compensated(self, sample: Float[Array, "seen _"], x: Float[Array, "M R"]) -> Float[Array, "seen R"]:
        """What the IMU has sensed, from what it says: its sample without the errors of these states."""
        if not self.depends:
            return with_errors(sample, -self.errors(x))
        # errors are multiples of what is sensed: once more, and what is left is of third order in them
        return with_errors(sample, -self.errors(x, with_errors(sample, -self.errors(x, sample))))

    def gravity(self, x: Float[Array, "M R"]) -> Float[Array, "3 R"]:
        """What gravity is more than that of the Earth's model, in n."""
        return by_channel(self.channels, self.readout[:, None] * x, of=GRAVITY)

    def advance(
        self, x: Float[Array, "M R"], ends: Float[Array, ""], distance: Float[Array, " *R"] | None = None
    ) -> Float[Array, "M R"]:
        """Phi x where a sample ends (1), x where it does not (0), after a distance that is asked for if states fade."""
        if self.travel is not None:
            x = self.fading(distance) * x
        if self.diagonal:
            phi = jnp.diag(self.transition)
            return (1.0 + ends * (phi - 1.0))[:, None] * x
        return x + ends * (self.transition @ x - x)

    def fading(self, distance: Any) -> Float[Array, "M _"]:
        """What is left of each state after a distance, of R runs or one for all."""
        assert self.travel is not None
        return jnp.exp(-self.travel.inverse[:, None] * jnp.atleast_1d(distance)[None])


class StepNoise(eqx.Module):
    """What a covariance step needs of Q banks, 1 or as many as runs; see the head of this file for y."""

    duration: Float[Array, ""]
    inverse_duration: Float[Array, ""]
    """0 for an empty step."""
    transition: Float[Array, "*M Q"]
    """Phi over the step: its diagonal where `diagonal`."""
    weights: Float[Array, "M Q"]
    """Of the states in y."""
    integrated: Float[Array, "ch Q"]
    """Variance of the noise in y."""
    cross: Float[Array, "ch M Q"]
    """Covariance of the noise in y with that in x."""
    driving: Float[Array, "M M Q"]
    """Covariance of the noise in x."""
    second_integral: Float[Array, ""]
    """Variance of the second integral of white noise over that of the first, less T^2/2: negative."""
    states: tuple[SensorState, ...] = eqx.field(static=True)
    diagonal: bool = eqx.field(static=True)
    several: bool = eqx.field(static=True)
    """More than one sample in a step."""
    travel: Travel | None = None
    """Arrays (M, Q)."""

    def after(self, distance: Float[Array, " _"] | None) -> "StepNoise":
        """The same where the states that do fade with a distance, which Q banks or one travel."""
        if self.travel is None or distance is None:
            return self
        s = self.travel.inverse * distance[None]
        left, new = jnp.exp(-s), -jnp.expm1(-2 * s) * self.travel.variance
        M = len(self.states)
        driving = self.driving * (left[:, None] * left[None]) + jnp.eye(M)[:, :, None] * new[None]
        transition = self.transition * (left if self.diagonal else left[:, None])
        return eqx.tree_at(lambda n: (n.transition, n.driving), self, (transition, driving))

    def integrate(self, X: Float[Array, "M K R"], reading: Float[Array, "seen _"] | None) -> Float[Array, "_ K R"]:
        """Weighted sum over the states of each channel, and behind the six those of gravity if there are such states.

        `reading` is the mean of the step, if states depend on it.
        """
        weights = self.weights
        if any(s.reads is not None for s in self.states):
            weights = weights * multiples(self.states, reading)
        channels, each = tuple(s.channel for s in self.states), weights[:, None] * X
        of_imu = by_channel(channels, each)
        return of_imu if self.travel is None else jnp.concatenate([of_imu, by_channel(channels, each, of=GRAVITY)])

    def carry(self, S: Float[Array, "J M R"]) -> Float[Array, "J M R"]:
        """S Phi'."""
        if self.diagonal:
            return S * self.transition[None]
        return jnp.einsum("jmr,kmr->jkr", S, self.transition)

    def advance(self, B: Float[Array, "M M R"]) -> Float[Array, "M M R"]:
        """Phi B Phi' + Q."""
        Phi = self.transition
        if self.diagonal:
            return B * (Phi[:, None] * Phi[None]) + self.driving
        return jnp.einsum("imr,mnr,jnr->ijr", Phi, B, Phi) + self.driving


def multiples(states: tuple[SensorState, ...], sensed: Any) -> Float[Array, "M R"]:
    """The reading of which the effect of each state is a multiple, 1 where it is of none.

    Raises
    ------
    ValueError
        A state depends on the temperature, and nobody knows that.
    """
    if len(sensed) <= TEMPERATURE and any(s.reads == TEMPERATURE for s in states):
        raise ValueError(
            "A bias by temperature depends on the temperature, which nobody has stated: a Scenario takes the series "
            "as temperature=..., a recorded Imu likewise, and [run] of a file its rise as temperature_rise."
        )
    one = jnp.ones((1, sensed.shape[1]))
    at = np.array([0 if s.reads is None else 1 + s.reads for s in states], dtype=int)
    return jnp.concatenate([one, sensed])[at]


IMU = tuple(range(len(CHANNELS)))
"""The channels of an IMU."""


def with_errors(sensed: Float[Array, "*n seen _"], errors: Float[Array, "*n ch R"]) -> Float[Array, "*n seen R"]:
    """What is said of what is sensed: its channels with errors, a temperature behind them without."""
    channels = sensed[..., : len(CHANNELS), :] + errors
    if sensed.shape[-2] == len(CHANNELS):
        return channels
    rest = sensed[..., len(CHANNELS) :, :]
    return jnp.concatenate([channels, jnp.broadcast_to(rest, (*rest.shape[:-1], channels.shape[-1]))], axis=-2)


def by_channel(channels: tuple[int, ...], X: Float[Array, "M *K"], of: tuple[int, ...] = IMU) -> Float[Array, "_ *K"]:
    """Sum over the states of each of consecutive channels; 0 for one without state. Other states are left out."""
    rest = X.shape[1:]
    total = jnp.zeros((len(of), *rest), X.dtype)
    for run in _runs(channels, of):
        # channels with as many states each, one after the other: one slice, whose gradient is one padded array
        part = jnp.sum(X[run.start : run.stop].reshape(run.channels, -1, *rest), axis=1)
        first = run.first - of[0]
        total = total.at[first : first + run.channels].add(part)
    return total


def to_states(channels: tuple[int, ...], Y: Float[Array, "_ *K"], of: tuple[int, ...] = IMU) -> Float[Array, "M *K"]:
    """What the channel of each state has, for states that all have one of some consecutive channels."""
    rest, parts = Y.shape[1:], [jnp.zeros((0, *Y.shape[1:]))]
    for run in _runs(channels, of):
        first, num = run.first - of[0], run.stop - run.start
        each = Y[first : first + run.channels][:, None]
        parts.append(jnp.broadcast_to(each, (run.channels, num // run.channels, *rest)).reshape(num, *rest))
    return parts[1] if len(parts) == 2 else jnp.concatenate(parts)


class _Run(NamedTuple):
    start: int
    stop: int
    first: int
    """The first of the channels."""
    channels: int


@cache
def _runs(channels: tuple[int, ...], of: tuple[int, ...]) -> tuple[_Run, ...]:
    """States start .. stop that belong to consecutive ones of some channels, with as many states each."""
    counts = [(c, len(list(same))) for c, same in groupby(channels)]
    runs: list[_Run] = []
    at = 0
    for channel, count in counts:
        last = runs[-1] if runs else None
        if (
            last
            and channel in of
            and last.first in of
            and channel == last.first + last.channels
            and (last.stop - last.start) == count * last.channels
        ):
            runs[-1] = last._replace(stop=at + count, channels=last.channels + 1)
        else:
            runs.append(_Run(at, at + count, channel, 1))
        at += count
    return tuple(r for r in runs if r.first in of)


def alone(bank: Any) -> Any:
    """One bank (or anything else) as many of which there is one: arrays with a leading axis of 1."""
    return jax.tree.map(lambda a: a[None], bank)


def step_noises(banks: SensorBank, dt: Float[Array, "U n"], ends: Float[Array, "U n"]) -> StepNoise:
    """What each kind of covariance step does, see `step_noise`; arrays (U, ..., Q)."""
    return jax.vmap(lambda dt, ends: step_noise(banks, dt, ends))(dt, ends)


def step_noise(banks: SensorBank, dt: Float[Array, " n"], ends: Float[Array, " n"]) -> StepNoise:
    """Accumulate a covariance step.

    Parameters
    ----------
    banks
        Q of them: arrays with a leading axis.
    dt
        Length in s of each piece of the step; 0 for a piece that pads.
    ends
        1 where the piece ends its IMU sample and the error goes on to the next, 0 where it does not.
    """
    T = jnp.sum(dt)
    inverse = jnp.where(T > 0, 1 / jnp.where(T > 0, T, 1.0), 0.0)
    # a pulse at s moves the position by T - s: its mean square
    middle = jnp.cumsum(dt) - dt / 2
    spread = jnp.sum(dt * (T - middle) ** 2) * inverse - T**2 / 2
    parts = jax.vmap(lambda bank: _accumulate(bank, dt, ends), out_axes=-1)(banks)
    return StepNoise(
        T, inverse, *parts, spread, states=banks.states, diagonal=banks.diagonal, several=len(dt) > 1,
        travel=jax.tree.map(jnp.transpose, banks.travel),
    )  # fmt: skip


def _accumulate(
    bank: SensorBank, dt: Float[Array, " n"], ends: Float[Array, " n"]
) -> tuple[Array, Array, Array, Array, Array]:
    """From `transition` to `driving` of `StepNoise`, of one bank."""
    size = len(bank.states)
    select = jnp.asarray(np.equal.outer(np.arange(len(CHANNELS)), np.array(bank.channels, dtype=int)).astype(float))
    h = bank.readout

    def piece(carry, inputs):
        # row: h' Phi^i; V_.. covariances of the noise so far
        row, phi, weights, V_yy, V_yx, V_xx = carry
        length, end = inputs
        weights = weights + length * row
        V_yy = V_yy + select @ (2 * length * h * V_yx + length**2 * h * (V_xx @ h)) + length / bank.rate * bank.white
        V_yx = V_yx + length * (V_xx @ h)
        Phi = jnp.eye(size) + end * (bank.transition - jnp.eye(size))
        V_xx = Phi @ V_xx @ Phi.T + end * bank.driving
        return (row @ Phi, Phi @ phi, weights, V_yy, Phi @ V_yx, V_xx), None

    zero, none = jnp.zeros(size), jnp.zeros((size, size))
    start = (h, jnp.eye(size), zero, jnp.zeros(len(CHANNELS)), zero, none)
    (_, phi, weights, V_yy, V_yx, V_xx), _ = jax.lax.scan(piece, start, (dt, ends))
    return jnp.diag(phi) if bank.diagonal else phi, weights, V_yy, select * V_yx[None, :], V_xx
