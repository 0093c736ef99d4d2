"""Parameters of noise models on the real line, by name: what is differentiated, optimised, estimated and drawn.

A positive parameter is its logarithm, so that derivatives are per relative change; one between two bounds (phi, H) its
logit. A model that three axes share has its parameters once.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float

from nav_jax._check import concrete
from nav_jax.layout import CHANNELS
from nav_jax.measurements._base import AbstractAiding
from nav_jax.noise import ImuErrors


class Shared(NamedTuple):
    """Channels with one model."""

    name: str
    channels: tuple[int, ...]


def shared_channels(errors: ImuErrors) -> tuple[Shared, ...]:
    """The three axes of a sensor together where their models and biases are the same, else one by one."""
    bias = concrete(errors.bias_sd)
    groups = []
    for sensor, first in (("accel", 0), ("gyro", 3)):
        channels = tuple(range(first, first + 3))
        same = all(bool(eqx.tree_equal(errors.models[first], errors.models[c])) for c in channels)
        if same and (bias is None or np.ptp(bias[first : first + 3]) == 0):
            groups.append(Shared(sensor, channels))
        else:
            groups += [Shared(CHANNELS[c], (c,)) for c in channels]
    return tuple(groups)


class ErrorLines(eqx.Module):
    """The parameters of an `ImuErrors`, a model with values, on the real line."""

    errors: ImuErrors
    start: Float[Array, " P"]
    """The parameters as they are."""
    groups: tuple[Shared, ...] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)
    """Such as ``accel GM_1 beta`` or ``gyro bias sd``."""

    def __init__(self, errors: ImuErrors):
        self.errors, self.groups = errors, shared_channels(errors)
        names, start = [], []
        for group in self.groups:
            model = errors.models[group.channels[0]]
            for label, process in zip(model.labels, model.processes, strict=True):
                names += [f"{group.name} {label} {p.name}" for p in process.parameters]
            start.append(model.unconstrained())
            if group.channels[0] in errors.biased:
                names.append(f"{group.name} bias sd")
                start.append(jnp.log(errors.bias_sd[group.channels[0]])[None])
        self.names, self.start = tuple(names), jnp.concatenate(start)

    def build(self, vector: Float[Array, " P"]) -> ImuErrors:
        """The errors with these parameters."""
        models, bias, at = list(self.errors.models), self.errors.bias_sd, 0
        for group in self.groups:
            old = models[group.channels[0]]
            model = old.with_unconstrained(vector[at : at + old.num_parameters])
            at += old.num_parameters
            for channel in group.channels:
                models[channel] = model
            if group.channels[0] in self.errors.biased:
                bias = bias.at[jnp.array(group.channels)].set(jnp.exp(vector[at]))
                at += 1
        return eqx.tree_at(lambda e: (e.models, e.bias_sd), self.errors, (tuple(models), bias))

    def values(self, vector: Any) -> Float[np.ndarray, " P"]:
        """The parameters themselves, per sample."""
        built, out = self.build(jnp.asarray(vector)), []
        for group in self.groups:
            out += [float(v) for p in built.models[group.channels[0]].processes for v in p.values]
            if group.channels[0] in built.biased:
                out.append(float(built.bias_sd[group.channels[0]]))
        return np.array(out)


class AidingLines(eqx.Module):
    """The standard deviations that a filter believes of aiding sensors, and their true noise, as factors.

    The start is zero: a number x multiplies the standard deviations of a component by exp(x).
    """

    sensors: tuple[AbstractAiding, ...]
    parts: tuple[tuple[int, tuple[int, ...]], ...] = eqx.field(static=True)
    """Of each number: the sensor, and its components."""
    names: tuple[str, ...] = eqx.field(static=True)

    def __init__(self, sensors: Sequence[AbstractAiding]):
        self.sensors = tuple(sensors)
        parts, names = [], []
        for i, sensor in enumerate(self.sensors):
            sd = np.asarray(sensor.believed)
            for value in dict.fromkeys(sd.tolist()):
                at = tuple(int(k) for k in np.flatnonzero(sd == value))
                parts.append((i, at))
                axes = ", ".join(sensor.axes[k] for k in at)
                names.append(f"{sensor.name} {axes} sd" if len(sensor.axes) > 1 else f"{sensor.name} sd")
        self.parts, self.names = tuple(parts), tuple(names)

    def believe(self, vector: Float[Array, " P"]) -> tuple[AbstractAiding, ...]:
        """The sensors, of which the filter believes standard deviations so many times as large."""
        believed = [s.believed for s in self.sensors]
        for x, (i, at) in zip(vector, self.parts, strict=True):
            believed[i] = believed[i] * jnp.exp(x * jnp.zeros(len(believed[i])).at[jnp.array(at)].set(1.0))
        return tuple(
            eqx.tree_at(lambda s: s.believed, sensor, sd) for sensor, sd in zip(self.sensors, believed, strict=True)
        )
