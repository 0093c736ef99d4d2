"""The filters that a design chooses from: white noise and Gauss-Markov processes, as a function of a vector."""

from itertools import combinations
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from nav_jax.layout import CHANNELS, SensorState
from nav_jax.noise import ImuErrors
from nav_jax.noise_models import markov_model
from nav_jax.parameters import Shared, shared_channels
from nav_jax.sensor_bank import SensorBank

_TINY = 1e-30
"""A variance for white noise where the truth has none."""
_SLOWEST = 1e-9
"""beta per sample that stands for a random walk."""


class Family(eqx.Module):
    """Filters with white noise and some Gauss-Markov processes on each channel, as a function of a vector.

    For each group of channels that share a model: log r of the white noise, and of each process log beta and log q (the
    inverse correlation time and the variance of the driving noise, per sample). A mask of 0 and 1 takes processes out:
    a state without noise stays zero.
    """

    truth: ImuErrors
    groups: tuple[Shared, ...] = eqx.field(static=True)
    slots: tuple[int, ...] = eqx.field(static=True)
    """Most processes of each group."""

    def __init__(self, truth: ImuErrors, max_accel: int, max_gyro: int):
        self.truth, self.groups = truth, shared_channels(truth)
        self.slots = tuple(max_accel if g.channels[0] < 3 else max_gyro for g in self.groups)

    def counts(self, structure: tuple[int, int]) -> list[int]:
        """Processes of each group."""
        return [structure[0] if g.channels[0] < 3 else structure[1] for g in self.groups]

    def num_states(self, structure: tuple[int, int]) -> int:
        """Sensor states of a filter, turn-on biases included."""
        return 3 * sum(structure) + len(self.truth.biased)

    def mask(self, structure: tuple[int, int]) -> Float[Array, " S"]:
        """1 for the processes of a structure."""
        pairs = zip(self.counts(structure), self.slots, strict=True)
        return jnp.array([float(i < n) for n, most in pairs for i in range(most)])

    def starts(self, structure: tuple[int, int]) -> list[Float[Array, " P"]]:
        """Every part of the truth's first-order processes that has this structure."""
        per_group = [
            self._parts(g, n, most) for g, n, most in zip(self.groups, self.counts(structure), self.slots, strict=True)
        ]
        # the same choice for all groups of a sensor: else there would be too many
        by_sensor = [
            [p for g, p in zip(self.groups, per_group, strict=True) if (g.channels[0] < 3) is accel]
            for accel in (True, False)
        ]
        return [
            jnp.concatenate([p[i % len(p)] for p in by_sensor[0]] + [p[j % len(p)] for p in by_sensor[1]])
            for i in range(max(len(p) for p in by_sensor[0]))
            for j in range(max(len(p) for p in by_sensor[1]))
        ]

    def _parts(self, group: Shared, count: int, most: int) -> list[Float[Array, " k"]]:
        bank, channel = self.truth.bank(), group.channels[0]
        known = [
            (float(bank.transition[i, i]), float(bank.driving[i, i]))
            for i, s in enumerate(bank.states)
            if s.channel == channel and s.label != "bias" and float(bank.driving[i, i]) > 0
        ]
        white = max(float(bank.white[channel]), _TINY)
        lines = [(np.log(max(-np.log(min(phi, 1.0)) if phi > 0 else 1.0, _SLOWEST)), np.log(q)) for phi, q in known]
        # more processes than the truth has: between its own, and weak
        while len(lines) < count:
            lines.append((lines[-1][0] + 2.0, lines[-1][1] - 3.0) if lines else (np.log(1e-3), np.log(1e-4 * white)))
        chosen = list(combinations(lines, count))
        spare = [lines[0] if lines else (0.0, np.log(white))] * (most - count)
        return [jnp.array([np.log(white), *(x for pair in (*c, *spare) for x in pair)]) for c in chosen]

    def _split(self, vector: Any) -> list[tuple[Any, Any, Any]]:
        """Of each group log r, log beta and log q."""
        out, at = [], 0
        for slots in self.slots:
            rest = vector[at + 1 : at + 1 + 2 * slots]
            out.append((vector[at], rest[0::2], rest[1::2]))
            at += 1 + 2 * slots
        return out

    def bank(self, vector: Float[Array, " P"], mask: Float[Array, " S"]) -> SensorBank:
        """The states of the filter."""
        phi, driving, initial, white, states = [], [], [], [jnp.zeros(())] * len(CHANNELS), []
        first = np.cumsum([0, *self.slots])
        for g, (log_r, log_beta, log_q) in enumerate(self._split(vector)):
            beta, q = jnp.exp(log_beta), mask[first[g] : first[g + 1]] * jnp.exp(log_q)
            for channel in self.groups[g].channels:
                white[channel] = jnp.exp(log_r)
                phi.append(jnp.exp(-beta))
                driving.append(q)
                initial.append(q / -jnp.expm1(-2 * beta) * float(self.truth.start != "zero"))
                states += [SensorState(channel, f"GM_{i + 1}") for i in range(self.slots[g])]
                if channel in self.truth.biased:
                    phi.append(jnp.ones(1))
                    driving.append(jnp.zeros(1))
                    initial.append(self.truth.bias_sd[channel][None] ** 2)
                    states.append(SensorState(channel, "bias"))
        return SensorBank(
            transition=jnp.diag(jnp.concatenate(phi)),
            driving=jnp.diag(jnp.concatenate(driving)),
            readout=jnp.ones(len(states)),
            initial=jnp.diag(jnp.concatenate(initial)),
            white=jnp.stack(white),
            rate=jnp.asarray(self.truth.rate),
            states=tuple(states),
            diagonal=True,
        )

    def errors(self, vector: Float64[np.ndarray, " P"], structure: tuple[int, int]) -> ImuErrors:
        """The filter as noise models."""
        models: list[Any] = [None] * len(CHANNELS)
        for group, count, (log_r, log_beta, log_q) in zip(
            self.groups, self.counts(structure), self._split(vector), strict=True
        ):
            pairs = sorted(zip(np.exp(log_beta[:count]), np.exp(log_q[:count]), strict=True), reverse=True)
            for channel in group.channels:
                models[channel] = markov_model(float(np.exp(log_r)), [(float(b), float(q)) for b, q in pairs])
        sd = self.truth.bias_sd
        return ImuErrors(
            models[:3], models[3:], self.truth.rate, accel_bias_sd=sd[:3], gyro_bias_sd=sd[3:], start=self.truth.start
        )
