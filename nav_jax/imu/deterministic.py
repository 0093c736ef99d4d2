"""Errors of an IMU that are no noise: constants of a unit whose effect depends on what it senses.

A calibration leaves them unknown by so much. They are drawn for every run, and a filter estimates them: each is a state
that does not move, of which an axis of the IMU reads a multiple, by the reading of this axis, of another, or of a
thermometer.

    sensed_i = (1 + s_i) u_i + sum_j m_ij u_j        scale factors s, misalignments m, for accelerometers and gyros
    sensed_i = u_i + sum_j g_ij f_j                  g-sensitivities g of gyros, by the specific force f
    sensed_i = u_i + c_i (T - T_0)                   biases by temperature c, T_0 that at the start

One more kind is a class here and a row of `DETERMINISTIC`.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register
from nav_jax.imu.channels import CHANNELS, TEMPERATURE, SensorState


class Constant(NamedTuple):
    """One of the constants."""

    state: SensorState
    sd: Float[Array, ""]


class AbstractDeterministic(eqx.Module):
    """Constants with one standard deviation for each axis.

    Parameters
    ----------
    accel_sd, gyro_sd
        Standard deviations, one number or three (x, y, z): relative for a scale factor, rad for a misalignment. Zero
        where there is none.

    Raises
    ------
    ValueError
        A negative standard deviation, or another number of them.
    """

    label: ClassVar[str]
    """The first word of the labels of its states."""
    units: ClassVar[Mapping[str, str]]
    """Parameter -> SI unit of its standard deviations."""
    effect: ClassVar[str]
    """A sentence on what it does to navigation."""

    sd: Float[Array, " ch"]
    present: tuple[bool, ...] = eqx.field(static=True)
    """Of each channel: may it be other than zero?"""

    def __init__(self, accel_sd: Any = 0.0, gyro_sd: Any = 0.0):
        parts = []
        for name, value in (("accel_sd", accel_sd), ("gyro_sd", gyro_sd)):
            positive(f"{type(self).__name__}: {name}", value, zero_ok=True)
            if np.shape(value) not in ((), (3,)):
                raise ValueError(f"{type(self).__name__}: {name} is one number or three, and is {value!r}.")
            parts.append(as_float(value))
        parts = known(*parts)
        xp = namespace(*parts)
        self.sd = as_float(xp.concatenate([xp.broadcast_to(sd, (3,)) for sd in parts]))
        seen = concrete(self.sd)
        self.present = (True,) * len(CHANNELS) if seen is None else tuple(bool(s) for s in seen > 0)

    def __repr__(self) -> str:
        sd = concrete(self.sd)
        sizes = "" if sd is None else f": sd accel {sd[:3]}, gyro {sd[3:]}"
        return f"{type(self).__name__}{sizes}"

    @abstractmethod
    def constants(self, channel: int) -> Iterator[Constant]:
        """Those that a channel reads."""


class ScaleFactor(AbstractDeterministic):
    """A channel reads s times what it senses more; the parameters are those of `AbstractDeterministic`.

    Examples
    --------
    >>> scale = nj.imu.ScaleFactor(accel_sd=300e-6, gyro_sd=300e-6)
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, deterministic=[scale])
    >>> len(errors.bank().states)  # one constant state on each axis
    6
    """

    label: ClassVar[str] = "scale"
    units: ClassVar[Mapping[str, str]] = {"accel_sd": "1", "gyro_sd": "1"}
    effect: ClassVar[str] = (
        "A scale factor is felt where the body turns and speeds up: a whole turn is off by that part of it, and a part "
        "of gravity is taken for an acceleration."
    )

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        yield Constant(SensorState(channel, self.label, reads=channel), self.sd[channel])


class Misalignment(AbstractDeterministic):
    """A channel reads m_j times what the others of its sensor sense; parameters as of `AbstractDeterministic`.

    Examples
    --------
    >>> bent = nj.imu.Misalignment(gyro_sd=1e-3)
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, deterministic=[bent])
    >>> len(errors.bank().states)  # each gyro reads a little of the other two
    6
    """

    label: ClassVar[str] = "misalignment"
    units: ClassVar[Mapping[str, str]] = {"accel_sd": "rad", "gyro_sd": "rad"}
    effect: ClassVar[str] = (
        "Axes that are not orthogonal let a turn about one axis show on the others: a part of the heading of each "
        "curve becomes roll and pitch."
    )

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        first = channel - channel % 3
        for other in range(first, first + 3):
            if other != channel:
                name = f"{self.label} {_axis(other)}"
                yield Constant(SensorState(channel, name, reads=other), self.sd[channel])


class GSensitivity(AbstractDeterministic):
    """A gyro reads g_j times the specific force on each accelerometer: nine constants.

    Parameters
    ----------
    gyro_sd
        Standard deviation of each, one number or three (gyro x, y, z), in (rad/s)/(m/s^2). 1 deg/h/g is
        4.94e-7 of them.

    Raises
    ------
    ValueError
        A negative standard deviation, or another number of them.

    Examples
    --------
    >>> bent = nj.imu.GSensitivity(gyro_sd=np.deg2rad(10.0) / 3600 / 9.80665)  # 10 deg/h/g
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, deterministic=[bent])
    >>> len(errors.bank().states)  # each gyro reads a little of three accelerometers
    9
    """

    label: ClassVar[str] = "g-sensitivity"
    units: ClassVar[Mapping[str, str]] = {"gyro_sd": "rad/s/(m/s^2)"}
    effect: ClassVar[str] = (
        "A gyro that feels forces drifts by gravity as by a bias, and more where the body speeds up: the bias of a "
        "record at rest holds in one position only."
    )

    def __init__(self, gyro_sd: Any):
        super().__init__(gyro_sd=gyro_sd)

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        for force in range(3):
            yield Constant(SensorState(channel, f"{self.label} {_axis(force)}", reads=force), self.sd[channel])


class TemperatureBias(AbstractDeterministic):
    """The bias of a channel changes by c for each kelvin that it is warmer than at the start.

    How the temperature goes is stated of a scenario (``temperature=``), or recorded beside the samples of an `Imu`. The
    bias at the start is the turn-on bias.

    Parameters
    ----------
    accel_sd, gyro_sd
        Standard deviations of c, one number or three (x, y, z), (m/s^2)/K and (rad/s)/K. Zero where there is none.

    Raises
    ------
    ValueError
        A negative standard deviation, or another number of them.

    Examples
    --------
    >>> warming = nj.imu.TemperatureBias(accel_sd=1e-3, gyro_sd=1e-5)
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, deterministic=[warming])
    >>> str(errors.states[0])
    'accel x temperature'
    """

    label: ClassVar[str] = "temperature"
    units: ClassVar[Mapping[str, str]] = {"accel_sd": "m/s^2/K", "gyro_sd": "rad/s/K"}
    effect: ClassVar[str] = (
        "A bias that goes with the temperature drifts while the sensor warms up, in all runs at the same time: no "
        "random walk of the same size is as well known."
    )

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        yield Constant(SensorState(channel, self.label, reads=TEMPERATURE), self.sd[channel])


def _axis(channel: int) -> str:
    return CHANNELS[channel].split()[1]


DETERMINISTIC: dict[str, type[AbstractDeterministic]] = {
    "scale_factor": ScaleFactor, "misalignment": Misalignment, "g_sensitivity": GSensitivity,
    "temperature_bias": TemperatureBias,
}  # fmt: skip
"""By the names that configuration files know them by: one row a kind."""


class _State(NamedTuple):
    sd: Float64[np.ndarray, "6"]


for _cls in (ScaleFactor, Misalignment, TemperatureBias):
    register(_cls, _State, lambda d: _State(np.asarray(d.sd)), lambda state, cls=_cls: cls(state.sd[:3], state.sd[3:]))
register(GSensitivity, _State, lambda d: _State(np.asarray(d.sd)), lambda state: GSensitivity(state.sd[3:]))
