"""The bridge from noise models to a filter and an emulation: with `noise_models` the only file that sees gmwm_jax.

An IMU has six channels (accelerometer x, y, z, gyro x, y, z), each with a model of its own. What a process is to a
filter follows from its state-space form: white noise goes into Q, Markov processes are states (RW, GM, AR1 one, DR and
MAT32 two, MAT52 three), a turn-on bias is a state that stays. Quantisation noise is no state of a filter: its integral
does not grow. A filter that leaves it out misses sqrt(2 q2)/f of angle or velocity at any time, and the notes say how
much that is. Noise of long memory (BI, FGN) has no state; `gmwm_jax.processes.flicker_ladder` approximates BI by GM.
Each process says of itself what it is to a filter, see `gmwm_jax.processes.AbstractProcess`.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax import QN, WN, Composite, datasets, read_recording
from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.checks import as_float, concrete, of_kind, positive, sampling_rate
from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from gmwm_jax.processes import AbstractProcess, StateSpace, from_continuous, to_continuous
from nav_jax.imu.bank import SensorBank, Travel
from nav_jax.imu.channels import CHANNELS, SensorState
from nav_jax.imu.deterministic import AbstractDeterministic, Constant
from nav_jax.imu.gravity import GravityDisturbance
from nav_jax.imu.noise_models import as_model, block_diagonal, complete_form, constant_form, states_in_filter
from nav_jax.imu.output import Output
from nav_jax.imu.recorded import RecordedErrors


class ImuErrors(eqx.Module):
    """The noise of the six channels of an IMU: what is emulated, or what a filter believes.

    Parameters
    ----------
    accel, gyro
        A model for all three axes, or three of them (a sequence, or a mapping with the keys x, y, z). A model is one of
        gmwm_jax (a process, a sum, a text, parameters per sample in SI) or a fit of it.
    rate
        Sampling rate in Hz that the parameters belong to. Fits know theirs, models do not.
    accel_bias_sd, gyro_bias_sd
        Standard deviation of a turn-on bias, constant in each run (m/s^2, rad/s); one number or three. A filter has a
        state for each that is not zero; for a traced one, of which nobody knows whether it is, always.
    deterministic
        Constants of the unit that a calibration has left unknown: `ScaleFactor`, `Misalignment`, `GSensitivity`,
        `TemperatureBias`.
    gravity
        What gravity is other than the Earth's, which accelerometers feel: a `GravityDisturbance`; none if not given.
    start
        ``stationary``: every process starts from its stationary distribution, if it has one (a random walk starts with
        its first step). ``zero``: all states are zero before the first sample, so that this is their first innovation,
        as in R's navigation; but for what is nothing else than its start: a drift, a sinusoid, a turn-on bias.
    output
        Bandwidth, range and step of what is said. All of it is emulated; a filter, and a covariance, takes the step for
        the noise that it is.

    Raises
    ------
    ValueError
        No rate or a contradicting one, a parameter without value, a negative variance, an unknown sensor or axis.

    Notes
    -----
    A drift DR(omega) has a known size but no known sign: its slope is drawn from N(0, omega^2), which is also what a
    filter assumes.

    Examples
    --------
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4) + RW(gamma2=1e-9)", "WN(sigma2=1e-8)", rate=20.0)
    >>> len(errors.bank().states)  # a random walk on each axis of the accelerometer
    3
    """

    models: tuple[Composite, ...]
    """Of the channels, in the order of `nav_jax.imu.channels.CHANNELS`; None-free, zero components left out."""
    bias_sd: Float[Array, " ch"]
    biased: tuple[int, ...] = eqx.field(static=True)
    """Channels with a turn-on bias."""
    deterministic: tuple[AbstractDeterministic, ...]
    """Errors that are no noise."""
    gravity: GravityDisturbance | None
    rate: float = eqx.field(static=True)
    start: str = eqx.field(static=True)
    output: Output | None

    def __init__(
        self,
        accel: Any,
        gyro: Any,
        rate: Real | None = None,
        *,
        accel_bias_sd: Any = 0.0,
        gyro_bias_sd: Any = 0.0,
        deterministic: Sequence[Any] = (),
        gravity: Any = None,
        start: str = "stationary",
        output: Any = None,
    ):
        given = [*_per_axis("accel", accel), *_per_axis("gyro", gyro)]
        rates = {float(r) for r in (getattr(m, "rate", None) for m in given) if r is not None}
        if rate is not None:
            rates.add(sampling_rate(rate))
        if not rates:
            raise ValueError("The rate of the models is missing: give rate=... in Hz. It is never guessed.")
        if max(rates) / min(rates) > 1 + 1e-6:
            seen = ", ".join(f"{r:g}" for r in sorted(rates))
            raise ValueError(f"The models belong to different rates ({seen} Hz): convert with at_rate() first.")
        if start not in ("stationary", "zero"):
            raise ValueError(f'start is "stationary" or "zero", and is {start!r}.')
        self.models = tuple(as_model(m, channel) for m, channel in zip(given, CHANNELS, strict=True))
        bias_sd = _three("accel_bias_sd", accel_bias_sd), _three("gyro_bias_sd", gyro_bias_sd)
        # asked of what was given: inside of a trace an array of JAX is traced, whatever it is made of
        nonzero = [np.ones(3) if (seen := concrete(sd)) is None else seen for sd in bias_sd]
        self.biased = tuple(int(i) for i in np.flatnonzero(np.concatenate(nonzero)))
        self.bias_sd = as_float(namespace(*bias_sd).concatenate(bias_sd))
        self.deterministic = tuple(deterministic)
        for d in self.deterministic:
            of_kind("An error that is no noise", d, AbstractDeterministic)
        for channel in range(len(CHANNELS)):
            states = [str(c.state) for c in self.constants(channel)]
            if len(set(states)) < len(states):
                kinds = ", ".join(type(d).__name__ for d in self.deterministic)
                raise ValueError(f"Two errors have the same constants ({kinds}): give one of a kind for a sensor.")
        if output is not None:
            of_kind("The output", output, Output)
        if gravity is not None:
            of_kind("gravity", gravity, GravityDisturbance)
        self.gravity = gravity
        self.rate = rates.pop()
        self.start = start
        self.output = output

    def at_rate(self, rate: Real) -> "ImuErrors":
        """Return the same physical noise, that is the same continuous-time densities, sampled at another rate.

        Raises
        ------
        ValueError
            An AR1 with phi <= 0 has no continuous-time form.
        """
        rate = sampling_rate(rate)
        return self._with(models=[resampled(m, self.rate, rate) for m in self.models], rate=rate)

    def adding(self, *deterministic: AbstractDeterministic, gravity: GravityDisturbance | None = None) -> "ImuErrors":
        """Return the same with more errors that are no noise: what the datasheet of a device leaves open, for one.

        Raises
        ------
        ValueError
            It has one of that kind already.

        Examples
        --------
        >>> errors = nj.devices["LSM6DSO"].truth(rate=100.0).adding(nj.imu.Misalignment(5e-3, 5e-3))
        >>> [type(d).__name__ for d in errors.deterministic]
        ['ScaleFactor', 'Misalignment']
        """
        if gravity is not None and self.gravity is not None:
            raise ValueError(f"There is a disturbance of gravity already: {self.gravity!r}.")
        return self._with(
            deterministic=(*self.deterministic, *deterministic), gravity=self.gravity if gravity is None else gravity
        )

    def _with(
        self, *, models: Sequence[Composite] | None = None, rate: float | None = None, **other: Any
    ) -> "ImuErrors":
        (bias_sd,) = known(self.bias_sd)
        models = self.models if models is None else models
        kept = {name: getattr(self, name) for name in ("deterministic", "gravity", "start", "output")}
        biases = {"accel_bias_sd": bias_sd[:3], "gyro_bias_sd": bias_sd[3:]}
        return ImuErrors(models[:3], models[3:], self.rate if rate is None else rate, **biases, **kept | other)

    @property
    def sensed(self) -> "ImuErrors":
        """Those of the sensing element, without what its output does to them."""
        return self if self.output is None else eqx.tree_at(lambda e: e.output, self, None)

    @property
    def linear(self) -> "ImuErrors":
        """The same, with noise in place of the rounding of the output, and nothing in place of the rest."""
        if self.output is None or not self.output.is_rounded:
            return self.sensed
        # of increments the error is the difference of two roundings, else a rounding
        kind = QN if self.output.increments else WN
        variances = self.output.rounding(self.rate)
        models = tuple(_noisier(m, kind, v) for m, v in zip(self.models, variances, strict=True))
        return eqx.tree_at(lambda e: e.models, self.sensed, models)

    def bank(self, *, complete: bool = False) -> SensorBank:
        """Return the states of a filter, or of an emulation, that knows this model.

        Parameters
        ----------
        complete
            With all processes: quantisation noise has two states then.

        Raises
        ------
        ValueError
            All are wanted, and one has no state-space form.
        """
        return _bank(self, complete)

    @property
    def states(self) -> tuple[SensorState, ...]:
        """Those of `bank`, which is not computed."""
        return jax.eval_shape(_bank, self).states

    def constants(self, channel: int) -> list[Constant]:
        """Errors of a channel that are no noise."""
        return [c for d in self.deterministic if d.present[channel] for c in d.constants(channel)]

    def stateless(self, channel: int) -> Composite | None:
        """Return the processes of a channel that have no state (quantisation noise); None if there are none."""
        rest = [p for p in self.models[channel].processes if states_in_filter(p) is None]
        return Composite(rest) if rest else None

    def notes(self) -> tuple[str, ...]:
        """Return what a filter that believes this model leaves out, in a sentence each."""
        notes = []
        for channel, model in zip(CHANNELS, self.linear.models, strict=True):
            for process in model.processes:
                if states_in_filter(process) is not None:
                    continue
                note = f"{process.kind} of {channel} has no state and is left out of the filter"
                integral = process.bounded_integral()
                if integral is None:
                    notes.append(f"{note}.")
                elif (variance := concrete(integral)) is not None:
                    unit = "m/s" if channel.startswith("accel") else "rad"
                    notes.append(
                        f"{note}; its integral is bounded, with a standard deviation of "
                        f"{np.sqrt(variance) / self.rate:.3g} {unit}."
                    )
        return tuple(notes)

    def __repr__(self) -> str:
        lines = [f"ImuErrors at {self.rate:g} Hz, started from {self.start.replace('stationary', 'stationarity')}"]
        for sensor, unit, at in (("accel", "m/s^2", 0), ("gyro", "rad/s", 3)):
            texts = [repr(m) for m in self.models[at : at + 3]]
            if len(set(texts)) == 1:
                lines.append(f"  {sensor} x, y, z [{unit}]: {texts[0]}")
            else:
                lines += [f"  {sensor} {axis} [{unit}]: {text}" for axis, text in zip("xyz", texts, strict=True)]
        sd = concrete(self.bias_sd)
        if sd is not None and sd.any():
            lines.append(f"  turn-on bias, sd: accel {sd[:3]} m/s^2, gyro {sd[3:]} rad/s")
        lines += [f"  {d!r}" for d in (*self.deterministic, self.gravity, self.output) if d is not None]
        return "\n".join(lines)


class _State(NamedTuple):
    models: tuple[Composite, ...]
    bias_sd: Float64[np.ndarray, "6"]
    deterministic: tuple[AbstractDeterministic, ...]
    rate: float
    start: str
    output: Output | None = None
    gravity: GravityDisturbance | None = None


def _to_state(errors: ImuErrors) -> _State:
    bias_sd = np.asarray(errors.bias_sd)
    rest = errors.rate, errors.start, errors.output, errors.gravity
    return _State(errors.models, bias_sd, errors.deterministic, *rest)


def _from_state(state: _State) -> ImuErrors:
    return ImuErrors(
        state.models[:3],
        state.models[3:],
        state.rate,
        accel_bias_sd=state.bias_sd[:3],
        gyro_bias_sd=state.bias_sd[3:],
        deterministic=state.deterministic,
        gravity=state.gravity,
        start=state.start,
        output=state.output,
    )


register(ImuErrors, _State, _to_state, _from_state, added=("output", "gravity"))


@compiled_quickly(static_argnums=(1,))
def _bank(errors: ImuErrors, complete: bool = False) -> SensorBank:
    """See `ImuErrors.bank`: one program for all models of one structure, and none where it is part of another."""
    errors = errors.linear
    forms: list[StateSpace] = []
    states: list[SensorState] = []
    white = [jnp.zeros(())] * len(CHANNELS)
    for channel, model in enumerate(errors.models):
        for label, process in zip(model.labels, model.processes, strict=True):
            form = complete_form(process, CHANNELS[channel]) if complete else process.filter_form()
            if form is None:
                continue
            white[channel] = white[channel] + form.white
            # zero is the state before the first sample, which is then the first innovation
            if errors.start == "zero" and process.driven and process.in_filter:
                form = form._replace(initial=form.driving)
            names = process.state_names(len(form.readout))
            states += [SensorState(channel, f"{label} {name}".rstrip(), process.in_filter) for name in names]
            forms.append(form)
        if channel in errors.biased:
            forms.append(constant_form(errors.bias_sd[channel]))
            states.append(SensorState(channel, "bias"))
        states += [c.state for c in errors.constants(channel)]
        forms += [constant_form(c.sd) for c in errors.constants(channel)]
    travel = None
    if errors.gravity is not None and errors.gravity.axes:
        at, size = jnp.array(errors.gravity.axes), sum(len(f.readout) for f in forms)
        sd, none = errors.gravity.sd[at], jnp.zeros(size)
        states += errors.gravity.states
        forms += [constant_form(x) for x in sd]
        travel = Travel(*(jnp.concatenate([none, a]) for a in (1 / errors.gravity.distance[at], sd**2)))
    return SensorBank(
        transition=block_diagonal([f.transition for f in forms]),
        driving=block_diagonal([f.driving for f in forms]),
        readout=jnp.concatenate([jnp.zeros(0), *(f.readout for f in forms)]),
        initial=block_diagonal([f.initial for f in forms]),
        white=jnp.stack(white),
        rate=as_float(errors.rate),
        states=tuple(states),
        diagonal=all(len(f.readout) <= 1 for f in forms),  # white noise has no state
        travel=travel,
    )


def sensor_errors(sensor: str, **options: Any) -> ImuErrors:
    """Errors of a known IMU, with the values of `gmwm_jax.datasets.sensor_models`.

    Parameters
    ----------
    sensor
        Such as ``mti-g``.
    options
        Turn-on biases and start, see `ImuErrors`.

    Raises
    ------
    ValueError
        No sensor has this name, or it has no accelerometers.
    """
    accel, gyro = (_axes(datasets.sensor_models(sensor), s, sensor) for s in ("accel", "gyro"))
    return ImuErrors(accel, gyro, datasets.sensor_rate(sensor), **options)


def fitted_errors(path: str | os.PathLike[str], **options: Any) -> ImuErrors:
    """Errors as fitted: a file that ``gmwm-jax fit --json`` has written.

    Parameters
    ----------
    path
        With channels ``accel_x`` to ``gyro_z``, or one of accelerometers and one of gyros, which then serve three axes.
    options
        Turn-on biases and start, see `ImuErrors`.

    Raises
    ------
    ValueError
        No such file, channels that are missing, or a fit without rate.
    """
    try:
        fits = json.loads(Path(path).read_text())
        models = {f["channel"]: " + ".join(map(_term, f["processes"])) for f in fits}
        rates = [f["rate"] for f in fits]
    except (KeyError, TypeError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is no file of fits as gmwm-jax fit --json writes it ({error!r}).") from error
    if None in rates or len(set(rates)) != 1:
        raise ValueError(f"{path}: the fits belong to one rate, and theirs are {rates} Hz.")
    accel, gyro = (_axes(models, sensor, path) for sensor in ("accel", "gyro"))
    return ImuErrors(accel, gyro, rates[0], **options)


def recorded_errors(path: str | os.PathLike[str], **options: Any) -> RecordedErrors:
    """Errors of a static recording in a file, see `gmwm_jax.read_recording`, whose options these are.

    Raises
    ------
    ValueError
        As of `gmwm_jax.read_recording`; not three accelerometers and three gyros; no rate.
    """
    recording = read_recording(path, **options)
    accel, gyro = (
        np.stack([recording.column(channel) for channel in _axes({c: c for c in recording.channels}, sensor, path)], 1)
        for sensor in ("accel", "gyro")
    )
    return RecordedErrors(accel, gyro, sampling_rate(recording.rate))


def _term(process: Mapping[str, Any]) -> str:
    """One process of a file of fits, as text of a model, with all digits."""
    values = ", ".join(f"{name}={float(value)!r}" for name, value in process.items() if name != "kind")
    return f"{process['kind']}({values})"


def _axes(by_channel: Mapping[str, Any], sensor: str, source: Any) -> list[Any]:
    """What belongs to the axes of a sensor; one channel serves all three."""
    found = [value for channel, value in by_channel.items() if channel.startswith(sensor)]
    named = [by_channel.get(f"{sensor}_{axis}") for axis in "xyz"]
    if len(found) == 3 and None not in named:
        return named
    if len(found) != 1:
        raise ValueError(
            f"{source}: channels {sensor}_x, {sensor}_y and {sensor}_z are wanted, or one for all axes; there are "
            f"{', '.join(by_channel)}."
        )
    return found * 3


def _per_axis(sensor: str, given: Any) -> list[Any]:
    if isinstance(given, Channels):
        given = list(given.values())
    elif isinstance(given, Mapping):
        unknown = sorted(set(given) - set("xyz"))
        if unknown or len(given) != 3:
            raise ValueError(f"{sensor}: a mapping has the keys x, y, z, and this one {', '.join(map(str, given))}.")
        return [given[axis] for axis in "xyz"]
    if isinstance(given, Sequence) and not isinstance(given, str):
        if len(given) != 3:
            raise ValueError(
                f"{sensor}: one model for all axes or three of them are wanted, and these are {len(given)}."
            )
        return list(given)
    return [given] * 3


def _three(name: str, value: Any) -> Float[Array | np.ndarray, "3"]:
    positive(name, value, zero_ok=True)
    (value,) = known(value)
    value = value.astype(np.float64)
    if value.shape not in ((), (3,)):
        raise ValueError(f"{name} is one number or three, and has the shape {value.shape}.")
    return namespace(value).broadcast_to(value, (3,))


def _noisier(model: Composite, kind: type[WN] | type[QN], variance: Any) -> Composite:
    """A model with so much more of a noise that has one parameter, and of which there may be one."""
    same = [p for p in model.processes if isinstance(p, kind)]
    rest = [p for p in model.processes if not isinstance(p, kind)]
    return Composite([kind(variance + sum(p.amplitude for p in same)), *rest])


def resampled(model: Composite, old: Real, new: Real) -> Composite:
    """The same continuous-time noise, per sample at another rate.

    Raises
    ------
    ValueError
        An AR1 with phi <= 0 has no continuous-time form.
    """
    continuous, values = _converted(model.processes, old, new)
    for p, quantities in zip(model.processes, continuous, strict=True):
        if any((seen := concrete(q)) is not None and not np.isfinite(seen) for q in quantities):
            raise ValueError(f"{p!r} has no continuous-time form, and so none at another rate.")
    kinds: list[Any] = [type(p) for p in model.processes]
    return Composite([kind(*v) for kind, v in zip(kinds, values, strict=True)])


@compiled_quickly(static_argnums=(1, 2))
def _converted(processes: tuple[AbstractProcess, ...], old: Real, new: Real) -> tuple[Any, Any]:
    """Quantities in continuous time of processes, and the parameters that these have at another rate."""
    continuous = [to_continuous(type(p), p.values, old) for p in processes]
    return continuous, [from_continuous(type(p), c, new) for p, c in zip(processes, continuous, strict=True)]
