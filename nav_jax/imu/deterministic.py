"""Errors of an IMU that are no noise: constants of a unit whose effect depends on what it senses.

A calibration leaves them unknown by so much. They are drawn for every run, and a filter estimates them: each is a state
that does not move, of which an axis of the IMU reads a multiple, by the reading of this axis or of another.

    sensed_i = (1 + s_i) u_i + sum_j m_ij u_j        scale factors s, misalignments m, for accelerometers and gyros

One more kind is a class here and a row of `DETERMINISTIC`.
"""

from abc import abstractmethod
from collections.abc import Iterator
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register
from nav_jax.imu.channels import CHANNELS, SensorState


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

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        yield Constant(SensorState(channel, "scale", reads=channel), self.sd[channel])


class Misalignment(AbstractDeterministic):
    """A channel reads m_j times what the others of its sensor sense; parameters as of `AbstractDeterministic`.

    Examples
    --------
    >>> bent = nj.imu.Misalignment(gyro_sd=1e-3)
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, deterministic=[bent])
    >>> len(errors.bank().states)  # each gyro reads a little of the other two
    6
    """

    def constants(self, channel: int) -> Iterator[Constant]:  # noqa: D102
        first = channel - channel % 3
        for other in range(first, first + 3):
            if other != channel:
                name = f"misalignment {CHANNELS[other].split()[1]}"
                yield Constant(SensorState(channel, name, reads=other), self.sd[channel])


DETERMINISTIC: dict[str, type[AbstractDeterministic]] = {"scale_factor": ScaleFactor, "misalignment": Misalignment}
"""By the names that configuration files know them by: one row a kind."""


class _State(NamedTuple):
    sd: Float64[np.ndarray, "6"]


for _cls in DETERMINISTIC.values():
    register(_cls, _State, lambda d: _State(np.asarray(d.sd)), lambda state, cls=_cls: cls(state.sd[:3], state.sd[3:]))
