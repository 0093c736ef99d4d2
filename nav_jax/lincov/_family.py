"""The filters that a design chooses from: white noise and first-order processes, as a function of a vector."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from nav_jax.filter.parameters import Shared, shared_channels
from nav_jax.imu.bank import SensorBank, Travel
from nav_jax.imu.channels import CHANNELS, SensorState
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import correlation_time, filter_form, markov_model

_TINY = 1e-30
"""A variance for white noise where the truth has none."""
_LONGEST = 1e6
"""Samples: a correlation time for what has none."""

Structure = tuple[int, int]
"""Processes on each accelerometer and on each gyro."""


class Line(NamedTuple):
    """A first-order process per sample: x' = phi x + w."""

    log_beta: float
    """phi = exp(-beta); without effect in a random walk."""
    log_q: float
    """Of the variance of w."""
    walks: float = 0.0
    """1 for a random walk, phi = 1, which starts with its first step; 0 for a Gauss-Markov process."""


class Start(NamedTuple):
    """A filter from which a search may start."""

    vector: Float64[np.ndarray, " P"]
    walks: Float64[np.ndarray, " S"]
    """Of each slot, see `Line`."""
    is_part: bool
    """Is it a part of the truth as it is?"""


class Family(eqx.Module):
    """Filters with white noise and some first-order processes on each channel, as a function of a vector.

    For each group of channels that share a model: log r of the white noise, and of each process log beta and log q (the
    inverse correlation time and the variance of the driving noise, per sample). Two masks of 0 and 1 over the slots
    take processes out (a state without noise stays zero), and make random walks of them.
    """

    truth: ImuErrors
    groups: tuple[Shared, ...] = eqx.field(static=True)
    slots: tuple[int, ...] = eqx.field(static=True)
    """Most processes of each group."""

    def __init__(self, truth: ImuErrors, max_accel: int, max_gyro: int):
        self.truth, self.groups = truth, shared_channels(truth)
        self.slots = tuple(max_accel if g.channels[0] < 3 else max_gyro for g in self.groups)

    def counts(self, structure: Structure) -> list[int]:
        """Processes of each group."""
        return [structure[0] if g.channels[0] < 3 else structure[1] for g in self.groups]

    def num_states(self, structure: Structure) -> int:
        """Sensor states of a filter, turn-on biases and other constants included."""
        constants = sum(len(self.truth.constants(channel)) for channel in range(len(CHANNELS)))
        gravity = 0 if self.truth.gravity is None else len(self.truth.gravity.axes)
        return 3 * sum(structure) + len(self.truth.biased) + constants + gravity

    def mask(self, structure: Structure) -> Float[Array, " S"]:
        """1 for the processes of a structure."""
        pairs = zip(self.counts(structure), self.slots, strict=True)
        return jnp.array([float(i < n) for n, most in pairs for i in range(most)])

    def starts(self, structure: Structure) -> list[Start]:
        """Every part of the truth's first-order processes that has this structure, made up where it has too few."""
        per_group = [self._parts(g, n) for g, n in zip(self.groups, self.counts(structure), strict=True)]
        # the same choice for all groups of a sensor: else there would be too many
        by_sensor = [
            [p for g, p in zip(self.groups, per_group, strict=True) if (g.channels[0] < 3) is accel]
            for accel in (True, False)
        ]
        whites = [np.log(self._white(g)) for g in self.groups]
        wanted = zip(self.groups, self.counts(structure), strict=True)
        is_part = all(n <= len(_first_order(self._processes(g))) for g, n in wanted)
        return [
            self._start(whites, [p[i % len(p)] for p in by_sensor[0]] + [p[j % len(p)] for p in by_sensor[1]], is_part)
            for i in range(max(len(p) for p in by_sensor[0]))
            for j in range(max(len(p) for p in by_sensor[1]))
        ]

    def extended(self, smaller: Start, of: Structure, structure: Structure) -> Start:
        """A filter of a smaller structure, with weak processes more."""
        whites, lines = [], []
        parts = zip(self.groups, self.counts(of), self.counts(structure), self._split(smaller), strict=True)
        for group, had, wanted, (log_r, known) in parts:
            whites.append(float(log_r))
            lines.append(_filled(known[:had], wanted, float(np.exp(log_r)), self._processes(group)))
        return self._start(whites, lines, is_part=False)

    def _processes(self, group: Shared) -> Sequence[Any]:
        return self.truth.models[group.channels[0]].processes

    def _white(self, group: Shared) -> float:
        return max(float(self.truth.bank().white[group.channels[0]]), _TINY)

    def _parts(self, group: Shared, count: int) -> list[list[Line]]:
        white, processes = self._white(group), self._processes(group)
        known = _first_order(processes)
        return [list(c) for c in combinations(_filled(known, max(count, len(known)), white, processes), count)]

    def _start(self, whites: Sequence[float], lines: Sequence[list[Line]], is_part: bool) -> Start:
        vector, walks = [], []
        for log_r, mine, slots in zip(whites, lines, self.slots, strict=True):
            filled = [*mine, *[Line(0.0, log_r)] * (slots - len(mine))]
            vector += [log_r, *(x for line in filled for x in line[:2])]
            walks += [line.walks for line in filled]
        return Start(np.array(vector), np.array(walks), is_part)

    def _split(self, start: Start) -> list[tuple[Any, list[Line]]]:
        """Of each group log r and the processes of all slots."""
        out, at, slot = [], 0, 0
        for slots in self.slots:
            pairs = np.asarray(start.vector[at + 1 : at + 1 + 2 * slots]).reshape(-1, 2)
            walks = start.walks[slot : slot + slots]
            lines = [Line(float(b), float(q), float(w)) for (b, q), w in zip(pairs, walks, strict=True)]
            out.append((float(start.vector[at]), lines))
            at, slot = at + 1 + 2 * slots, slot + slots
        return out

    def bank(self, vector: Float[Array, " P"], mask: Float[Array, " S"], walks: Float[Array, " S"]) -> SensorBank:
        """The states of the filter."""
        phi, driving, initial, white, states = [], [], [], [jnp.zeros(())] * len(CHANNELS), []
        at, slot = 0, 0
        for group, slots in zip(self.groups, self.slots, strict=True):
            log_r, lines = vector[at], vector[at + 1 : at + 1 + 2 * slots]
            present, walk = mask[slot : slot + slots], walks[slot : slot + slots]
            at, slot = at + 1 + 2 * slots, slot + slots
            beta, q = jnp.exp(lines[0::2]), present * jnp.exp(lines[1::2])
            for channel in group.channels:
                white[channel] = jnp.exp(log_r)
                phi.append(jnp.where(walk > 0, 1.0, jnp.exp(-beta)))
                driving.append(q)
                first_is_driving = (walk > 0) | (self.truth.start == "zero")
                initial.append(jnp.where(first_is_driving, q, q / -jnp.expm1(-2 * beta)))
                states += [SensorState(channel, f"process {i + 1}") for i in range(slots)]
                if channel in self.truth.biased:
                    phi.append(jnp.ones(1))
                    driving.append(jnp.zeros(1))
                    initial.append(self.truth.bias_sd[channel][None] ** 2)
                    states.append(SensorState(channel, "bias"))
                for constant in self.truth.constants(channel):
                    phi.append(jnp.ones(1))
                    driving.append(jnp.zeros(1))
                    initial.append(constant.sd[None] ** 2)
                    states.append(constant.state)
        own = self.truth.bank().travel
        travel = None
        if self.truth.gravity is not None and own is not None:
            fresh = self.truth.gravity.states
            phi.append(jnp.ones(len(fresh)))
            driving.append(jnp.zeros(len(fresh)))
            initial.append(own.variance[-len(fresh) :])
            travel = Travel(*(jnp.concatenate([jnp.zeros(len(states)), a[-len(fresh) :]]) for a in own))
            states += fresh
        return SensorBank(
            transition=jnp.diag(jnp.concatenate(phi)),
            driving=jnp.diag(jnp.concatenate(driving)),
            readout=jnp.ones(len(states)),
            initial=jnp.diag(jnp.concatenate(initial)),
            white=jnp.stack(white),
            rate=jnp.asarray(self.truth.rate),
            states=tuple(states),
            diagonal=True,
            travel=travel,
        )

    def errors(self, start: Start, structure: Structure) -> ImuErrors:
        """The filter as noise models."""
        models: list[Any] = [None] * len(CHANNELS)
        for group, count, (log_r, lines) in zip(self.groups, self.counts(structure), self._split(start), strict=True):
            markov = [(float(np.exp(b)), float(np.exp(q))) for b, q, walks in lines[:count] if not walks]
            walks = [float(np.exp(q)) for _, q, walks in lines[:count] if walks]
            for channel in group.channels:
                models[channel] = markov_model(float(np.exp(log_r)), sorted(markov, reverse=True), walks)
        sd = self.truth.bias_sd
        return ImuErrors(
            models[:3],
            models[3:],
            self.truth.rate,
            accel_bias_sd=sd[:3],
            gyro_bias_sd=sd[3:],
            deterministic=self.truth.deterministic,
            gravity=self.truth.gravity,
            start=self.truth.start,
        )


def _first_order(processes: Sequence[Any]) -> list[Line]:
    """Those of a model that belong to the family as they are: random walks, and Markov processes with 0 < phi < 1."""
    lines = []
    for form in map(filter_form, processes):
        if form is None or len(form.readout) != 1:
            continue
        phi, q = float(form.transition[0, 0]), float(form.driving[0, 0] * form.readout[0] ** 2)
        if phi > 0 and q > 0:
            lines.append(Line(np.log(-np.log(phi)), np.log(q)) if phi < 1 else Line(0.0, np.log(q), 1.0))
    return lines


def _filled(lines: Sequence[Line], count: int, white: float, processes: Sequence[Any]) -> list[Line]:
    """Lines with others added until there are as many.

    First what is like the processes of the truth that are of higher order, then ones between its own, and weak.
    """
    lines = list(lines)
    for form in map(filter_form, processes):
        if form is not None and len(form.readout) > 1 and len(lines) < count:
            variance, time = correlation_time(form, _LONGEST)
            lines.append(Line(-np.log(time), np.log(max(variance, _TINY) * -np.expm1(-2 / time))))
    while len(lines) < count:
        last = lines[-1] if lines else Line(np.log(1e-3) - 2.0, np.log(1e-4 * white) + 3.0)
        lines.append(Line(min(last.log_beta + 2.0, 0.0), last.log_q - 3.0))
    return lines
