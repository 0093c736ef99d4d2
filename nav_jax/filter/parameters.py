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

from gmwm_jax._internal.checks import concrete
from nav_jax.aiding.base import AbstractAiding
from nav_jax.imu.channels import CHANNELS
from nav_jax.imu.errors import ImuErrors
from nav_jax.imu.noise_models import NoiseModel

SENSORS = {"accel": (0, 1, 2), "gyro": (3, 4, 5)}
"""Their channels."""


class Shared(NamedTuple):
    """Channels with one model."""

    name: str
    channels: tuple[int, ...]


def shared_channels(errors: ImuErrors) -> tuple[Shared, ...]:
    """The three axes of a sensor together where their models are the same, else one by one."""
    groups = []
    for sensor, channels in SENSORS.items():
        first = errors.models[channels[0]]
        same = all(bool(eqx.tree_equal(first, errors.models[c])) for c in channels)
        groups += _together(sensor, channels, same)
    return tuple(groups)


def shared_biases(errors: ImuErrors) -> tuple[Shared, ...]:
    """As `shared_channels`, of the turn-on biases, of those channels that have one."""
    sd, groups = concrete(errors.bias_sd), []
    for sensor, channels in SENSORS.items():
        biased = tuple(c for c in channels if c in errors.biased)
        same = biased == channels and (sd is None or len({*sd[list(channels)].tolist()}) == 1)
        groups += _together(sensor, biased, same)
    return tuple(groups)


def _together(sensor: str, channels: tuple[int, ...], same: bool) -> list[Shared]:
    return [Shared(sensor, channels)] if same else [Shared(CHANNELS[c], (c,)) for c in channels]


class Constants(NamedTuple):
    """Numbers of an error that is no noise, or of gravity, with one value."""

    name: str
    of: int
    """Which of the arrays of `constants_of`."""
    at: tuple[int, ...]


def constants_of(errors: ImuErrors, num: int) -> list[Any]:
    """Arrays of positive numbers besides those of noise and turn-on biases: of so many errors that are no noise."""
    # inside of `tree_at` arrays are wrapped, and an empty tuple is a leaf: by number, and not those that there are
    of_imu = [errors.deterministic[i].sd for i in range(num)]
    return of_imu if errors.gravity is None else [*of_imu, errors.gravity.sd, errors.gravity.distance]


def shared_constants(errors: ImuErrors) -> tuple[Constants, ...]:
    """As `shared_biases`, of the numbers of `constants_of`."""
    found = []
    for i, kind in enumerate(errors.deterministic):
        sd = concrete(kind.sd)
        for sensor, channels in SENSORS.items():
            present = tuple(c for c in channels if kind.present[c])
            same = present == channels and (sd is None or len({*sd[list(channels)].tolist()}) == 1)
            found += [Constants(f"{g.name} {kind.label} sd", i, g.channels) for g in _together(sensor, present, same)]
    if errors.gravity is not None:
        first, parts = len(errors.deterministic), {"deflection": (0, 1), "anomaly": (2,)}
        for of, name in ((first, "sd"), (first + 1, "distance")):
            numbers = concrete(constants_of(errors, first)[of])
            for part, axes in parts.items():
                present = tuple(i for i in axes if errors.gravity.present[i])
                same = present == axes and (numbers is None or len({*numbers[list(axes)].tolist()}) == 1)
                each = [(f" {'ned'[i]}", (i,)) for i in present] if len(axes) > 1 and not same else [("", present)]
                found += [Constants(f"gravity {part}{axis} {name}", of, at) for axis, at in each if at]
    return tuple(found)


class ErrorLines(eqx.Module):
    """The parameters of an `ImuErrors`, a model with values, on the real line."""

    errors: ImuErrors
    start: Float[Array, " P"]
    """The parameters as they are."""
    groups: tuple[Shared, ...] = eqx.field(static=True)
    sizes: tuple[int, ...] = eqx.field(static=True)
    """Number of lines of the model of each group: none where the amplitude is zero."""
    biases: tuple[Shared, ...] = eqx.field(static=True)
    """Their standard deviations come behind the models."""
    constants: tuple[Constants, ...] = eqx.field(static=True)
    """And those of other constants behind them."""
    names: tuple[str, ...] = eqx.field(static=True)
    """Such as ``accel GM_1 beta``, ``accel AR(2) phi partial 1`` or ``gyro bias sd``."""

    def __init__(self, errors: ImuErrors):
        self.errors, self.groups, self.biases = errors, shared_channels(errors), shared_biases(errors)
        names, start, sizes = [], [jnp.zeros(0)], []
        for group in self.groups:
            model = errors.models[group.channels[0]]
            sizes.append(0 if _is_silent(model) else model.num_parameters)
            if sizes[-1]:
                for label, process in zip(model.labels, model.processes, strict=True):
                    names += [f"{group.name} {label} {name}" for name in process.per_line()]
                start.append(model.unconstrained())
        names += [f"{group.name} bias sd" for group in self.biases]
        start += [jnp.log(errors.bias_sd[group.channels[0]])[None] for group in self.biases]
        self.constants = shared_constants(errors)
        names += [c.name for c in self.constants]
        known = constants_of(errors, len(errors.deterministic))
        start += [jnp.log(known[c.of][c.at[0]])[None] for c in self.constants]
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
        sizes = jnp.exp(vector[at:])
        for sd, group in zip(sizes[: len(self.biases)], self.biases, strict=True):
            bias = bias.at[jnp.array(group.channels)].set(sd)
        num = len(self.errors.deterministic)
        known = constants_of(self.errors, num)
        for size, c in zip(sizes[len(self.biases) :], self.constants, strict=True):
            known[c.of] = known[c.of].at[jnp.array(c.at)].set(size)
        new = [tuple(models), bias, *known]
        return eqx.tree_at(lambda e: [e.models, e.bias_sd, *constants_of(e, num)], self.errors, new)

    def values(self, vector: Any) -> Float[np.ndarray, " P"]:
        """What is on the lines, per sample: each number is a function of its own line."""
        built, out = self.build(jnp.asarray(vector)), []
        for group, size in zip(self.groups, self.sizes, strict=True):
            if size:
                out += [float(v) for p in built.models[group.channels[0]].processes for v in p.per_line().values()]
        out += [float(built.bias_sd[group.channels[0]]) for group in self.biases]
        known = constants_of(built, len(built.deterministic))
        return np.array(out + [float(known[c.of][c.at[0]]) for c in self.constants])


def _is_silent(model: NoiseModel) -> bool:
    """Of one process without amplitude, which stands for no noise: others of amplitude zero are left out."""
    return all((a := concrete(p.amplitude)) is not None and a == 0 for p in model.processes)


class AidingLines(eqx.Module):
    """The standard deviations that a filter believes of aiding sensors, and their true noise, as factors.

    The start is zero: a number x multiplies the standard deviations of a component by exp(x). Those of a
    sensor's own states, such as a scale factor, are none of them: see `nav_jax.aiding.states.OwnStates.scaled`.
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
