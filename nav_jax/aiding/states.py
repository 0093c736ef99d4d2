"""States of an aiding sensor's own, such as a scale factor: what they are, and how they join those of a filter.

A state is a constant with a standard deviation, a model of gmwm_jax, or their sum. In a filter and in covariances it is
a part of the bank of sensor states, and moves with the samples of the IMU; no axis of the IMU reads it. What is
emulated is drawn at the fixes, in the same steps all at once.
"""

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg
import numpy as np
from jaxtyping import Array, Float, Int, Key

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.imu.bank import SensorBank
from nav_jax.imu.channels import NO_CHANNEL, SensorState
from nav_jax.imu.errors import resampled
from nav_jax.imu.noise_models import NoiseModel, as_model, block_diagonal, constant_form, markov_form
from nav_jax.kinematics.linalg import factor


class OwnState(eqx.Module):
    """One state of an aiding sensor.

    Parameters
    ----------
    name
        Such as ``scale``, or ``lever_arm x``: what comes first is the `group` that it belongs to.
    unit
        SI.
    sd
        Standard deviation of a constant part, drawn for every run.
    noise
        A model of a part that changes, per sample at the rate of the sensor; none if not given.

    Raises
    ------
    ValueError
        A negative standard deviation, or no model.
    """

    sd: Float[Array, ""]
    noise: NoiseModel | None
    name: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    is_constant: bool = eqx.field(static=True)
    """Has it a constant part?"""

    def __init__(self, name: str, unit: str, sd: Any = 0.0, noise: Any = None):
        positive(f"The standard deviation of {name}", sd, zero_ok=True)
        self.name, self.unit, self.sd = name, unit, as_float(sd)
        self.noise = None if noise is None else as_model(noise, name)
        for process in () if self.noise is None else self.noise.processes:
            form = jax.eval_shape(process.state_space)
            if form is None or not len(form.readout):
                raise ValueError(f"{name} cannot be {process!r}, which is no Markov process: add it to the noise.")
        seen = concrete(self.sd)
        self.is_constant = seen is None or bool(seen > 0) or noise is None

    @property
    def group(self) -> str:
        """What the state and others of its kind are one of, such as ``lever_arm``."""
        return self.name.split(" ")[0]

    def parts(self, sensor_rate: Real, rate: Real) -> list[tuple[str, Any]]:
        """Labels, with the standard deviation of the constant part and the models of the others at another rate."""
        parts: list[tuple[str, Any]] = [("constant", self.sd)] if self.is_constant else []
        if self.noise is not None:
            model = resampled(self.noise, sensor_rate, rate)
            parts += [(label, NoiseModel((p,))) for label, p in zip(model.labels, model.processes, strict=True)]
        return parts


class _State(NamedTuple):
    name: str
    unit: str
    sd: float
    noise: NoiseModel | None


register(OwnState, _State, lambda s: _State(s.name, s.unit, float(s.sd), s.noise), lambda state: OwnState(*state))


def own_state(name: str, unit: str, sd: Any = 0.0, noise: Any = None) -> OwnState | None:
    """The state, or None where it is zero: without a model, and with a standard deviation that is known to be zero."""
    seen = concrete(sd)
    is_zero = noise is None and seen is not None and not seen.any()
    return None if is_zero else OwnState(name, unit, sd, noise)


def own_states_of(sensor: str, name: str, unit: str, axes: Sequence[str], sd: Any) -> tuple[OwnState, ...]:
    """A constant state of each axis, by one standard deviation or one of each; none where all are known to be zero."""
    if np.shape(sd) not in ((), (len(axes),)):
        raise ValueError(f"{sensor}: {name}_sd is one number or {len(axes)} ({', '.join(axes)}), and is {sd!r}.")
    seen = concrete(sd)
    if seen is not None and not seen.any():
        return ()
    positive(f"{sensor}: {name}_sd", sd, zero_ok=True)
    each = [sd] * len(axes) if np.shape(sd) == () else list(sd)
    return tuple(OwnState(f"{name} {axis}", unit, value) for axis, value in zip(axes, each, strict=True))


def arguments(name: str, state: OwnState | None) -> dict[str, Any]:
    """The arguments ``name_sd`` and ``name_noise`` that made it; a constant has no noise."""
    if state is None:
        return {}
    return {f"{name}_sd": state.sd} | ({} if state.noise is None else {f"{name}_noise": state.noise})


class OwnStates(eqx.Module):
    """The states of all aiding sensors at the rate of the IMU: A of them, of S states of Markov processes."""

    transition: Float[Array, "S S"]
    driving: Float[Array, "S S"]
    initial: Float[Array, "S S"]
    readout: Float[Array, "A S"]
    states: tuple[SensorState, ...] = eqx.field(static=True)
    rows: tuple[tuple[int, int], ...] = eqx.field(static=True)
    """Of each sensor: the first and the last but one of the A."""
    parts: tuple[tuple[int, int], ...] = eqx.field(static=True)
    """The same of the S."""
    groups: tuple[str, ...] = eqx.field(static=True)
    """Of each of the S: the sensor and the group, see `OwnState`."""
    without: tuple[str, ...] = eqx.field(static=True)
    """Groups of states that are left out, and zero."""
    rate: float = eqx.field(static=True)
    """Of the IMU, Hz."""
    diagonal: bool = eqx.field(static=True)
    """Does every state go its own way?"""

    @property
    def size(self) -> int:
        """S."""
        return len(self.states)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the groups, each once."""
        return tuple(dict.fromkeys(self.groups))

    def scaled(self, factors: Float[Array, " groups"]) -> "OwnStates":
        """The same with standard deviations so many times as large, group by group of `names`."""
        if not self.size:
            return self
        factor = factors[np.array([self.names.index(g) for g in self.groups])]
        both = factor[:, None] * factor[None, :]  # states of two groups are independent
        return eqx.tree_at(lambda o: (o.driving, o.initial), self, (both * self.driving, both * self.initial))

    def values(self, x: Float[Array, "M R"], sensor: int) -> Float[Array, "a R"]:
        """The states of one sensor from all states of a filter, of which these are the last."""
        (a, b), (s, t) = self.rows[sensor], self.parts[sensor]
        at = x.shape[0] - self.size
        return self.readout[a:b, s:t] @ x[at + s : at + t]

    def draw(self, sensor: int, steps: Int[Array, " F"], largest: int, keys: Key[Array, " R"]) -> Float[Array, "F a R"]:
        """The states of one sensor in R runs at its fixes.

        Parameters
        ----------
        sensor
            Which.
        steps
            Samples of the IMU from one fix to the next, and from the start to the first.
        largest
            What they do not exceed.
        keys
            One a run.
        """
        (a, b), (s, t) = self.rows[sensor], self.parts[sensor]
        A, Q, h = self.transition[s:t, s:t], self.driving[s:t, s:t], self.readout[a:b, s:t]
        moves = jax.vmap(lambda n: power(A, Q, n, largest))(steps)
        e = jax.vmap(lambda k: jax.random.normal(k, (len(steps) + 1, t - s)), out_axes=-1)(keys)

        def fix(x, given):
            Phi, noise, e = given
            x = Phi @ x + factor(noise) @ e
            return x, h @ x

        return jax.lax.scan(fix, factor(self.initial[s:t, s:t]) @ e[0], (*moves, e[1:]))[1]


def group_names(sensors: Sequence[Any]) -> tuple[str, ...]:
    """Sensor and group of all states of aiding sensors, as ``gnss_position lever_arm``, each once."""
    return tuple(dict.fromkeys(f"{sensor.name} {state.group}" for sensor in sensors for state in sensor.states))


def own_states(sensors: Sequence[Any], rate: Real, without: Collection[str] = ()) -> OwnStates:
    """The states of aiding sensors, at the rate of an IMU.

    Those of the groups `without` (see `group_names`) have no state that moves, and are zero.
    """
    states, rows, parts, groups, found, is_diagonal = [], [], [], [], [], True
    for sensor in sensors:
        first, begin = len(found), len(states)
        for state in sensor.states:
            group = f"{sensor.name} {state.group}"
            labelled = [] if group in without else state.parts(sensor.rate, rate)
            for label, part in labelled:
                num = len(jax.eval_shape(_form, part).readout)
                name = f"{sensor.name} {state.name}{f' {label}' * (label != 'constant')}"
                is_diagonal = is_diagonal and num == 1
                names = (name,) if num == 1 else tuple(f"{name} {i}" for i in range(num))
                states += [SensorState(NO_CHANNEL, n) for n in names]
                groups += [group] * num
            found.append([part for _, part in labelled])
        rows.append((first, len(found)))
        parts.append((begin, len(states)))
    none = as_float(np.zeros((0, 0)))
    return OwnStates(
        *(_stacked(found) if found else (none,) * 4),
        states=tuple(states),
        rows=tuple(rows),
        parts=tuple(parts),
        groups=tuple(groups),
        without=tuple(without),
        rate=float(rate),
        diagonal=is_diagonal,
    )


@jax.jit
def _form(part: Any) -> Any:
    """The state-space form of a part of a state, see `OwnState.parts`."""
    return markov_form(part, "a state") if isinstance(part, NoiseModel) else constant_form(part)


@compiled_quickly()
def _stacked(found: list[list[Any]]) -> tuple[Array, Array, Array, Array]:
    """Transition, driving noise, initial covariance and readout, from the parts of each state."""
    forms = [[_form(part) for part in parts] for parts in found]
    flat = [form for parts in forms for form in parts]
    return (
        block_diagonal([f.transition for f in flat]),
        block_diagonal([f.driving for f in flat]),
        block_diagonal([f.initial for f in flat]),
        jax.scipy.linalg.block_diag(
            *[jnp.concatenate([jnp.zeros(0), *(f.readout for f in parts)])[None] for parts in forms]
        ),
    )


def joined(bank: SensorBank, own: OwnStates) -> SensorBank:
    """The bank of an IMU with the states of aiding sensors behind its own."""
    if not own.size:
        return bank
    return SensorBank(
        transition=block_diagonal([bank.transition, own.transition]),
        driving=block_diagonal([bank.driving, own.driving]),
        readout=jnp.concatenate([bank.readout, jnp.zeros(own.size)]),
        initial=block_diagonal([bank.initial, own.initial]),
        white=bank.white,
        rate=bank.rate,
        states=(*bank.states, *own.states),
        diagonal=bank.diagonal and own.diagonal,
        travel=jax.tree.map(lambda a: jnp.concatenate([a, jnp.zeros(own.size)]), bank.travel),
    )


def power(A: Array, Q: Array, count: Int[Array, ""], largest: int) -> tuple[Array, Array]:
    """Transition and noise of `count` steps, of at most so many, by doubling."""
    total_A, total_Q = jnp.eye(A.shape[0]), jnp.zeros_like(Q)
    for bit in range(max(largest, 1).bit_length()):
        take = (count >> bit) & 1
        total_Q = jnp.where(take, A @ total_Q @ A.T + Q, total_Q)
        total_A = jnp.where(take, A @ total_A, total_A)
        A, Q = A @ A, A @ Q @ A.T + Q
    return total_A, total_Q
