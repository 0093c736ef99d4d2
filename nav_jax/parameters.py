"""Parameters of noise models on the real line, by name: what is differentiated, optimised, estimated and drawn.

A positive parameter is its logarithm, so that derivatives are per relative change; one between two bounds (phi, H) its
logit. Coefficients of AR(2) and higher orders share their lines, which are those of the partial autocorrelations. A
model that three axes share has its parameters once, and a channel without noise has none.
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
from nav_jax.noise_models import NoiseModel


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
    sizes: tuple[int, ...] = eqx.field(static=True)
    """Number of lines of the model of each group, without its bias: none where the amplitude is zero."""
    names: tuple[str, ...] = eqx.field(static=True)
    """Such as ``accel GM_1 beta``, ``accel AR(2) phi partial 1`` or ``gyro bias sd``."""

    def __init__(self, errors: ImuErrors):
        self.errors, self.groups = errors, shared_channels(errors)
        names, start, sizes = [], [jnp.zeros(0)], []
        for group in self.groups:
            model = errors.models[group.channels[0]]
            sizes.append(0 if _is_silent(model) else model.num_parameters)
            if sizes[-1]:
                for label, process in zip(model.labels, model.processes, strict=True):
                    names += [f"{group.name} {label} {name}" for name in process.per_line()]
                start.append(model.unconstrained())
            if group.channels[0] in errors.biased:
                names.append(f"{group.name} bias sd")
                start.append(jnp.log(errors.bias_sd[group.channels[0]])[None])
        self.names, self.start, self.sizes = tuple(names), jnp.concatenate(start), tuple(sizes)

    def build(self, vector: Float[Array, " P"]) -> ImuErrors:
        """The errors with these parameters."""
        models, bias, at = list(self.errors.models), self.errors.bias_sd, 0
        for group, size in zip(self.groups, self.sizes, strict=True):
            if size:
                model = models[group.channels[0]].with_unconstrained(vector[at : at + size])
                for channel in group.channels:
                    models[channel] = model
            at += size
            if group.channels[0] in self.errors.biased:
                bias = bias.at[jnp.array(group.channels)].set(jnp.exp(vector[at]))
                at += 1
        return eqx.tree_at(lambda e: (e.models, e.bias_sd), self.errors, (tuple(models), bias))

    def values(self, vector: Any) -> Float[np.ndarray, " P"]:
        """What is on the lines, per sample: each number is a function of its own line."""
        built, out = self.build(jnp.asarray(vector)), []
        for group, size in zip(self.groups, self.sizes, strict=True):
            if size:
                out += [float(v) for p in built.models[group.channels[0]].processes for v in p.per_line().values()]
            if group.channels[0] in built.biased:
                out.append(float(built.bias_sd[group.channels[0]]))
        return np.array(out)


def _is_silent(model: NoiseModel) -> bool:
    """Of one process without amplitude, which stands for no noise: others of amplitude zero are left out."""
    return all((a := concrete(p.amplitude)) is not None and a == 0 for p in model.processes)


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
