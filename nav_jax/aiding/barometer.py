"""Barometric height, with an offset and a scale error that a filter estimates."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, noises, spread, timing
from nav_jax.aiding.states import OwnState, arguments, own_state
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.earth import AbstractEarth


class Barometer(AbstractAiding):
    """A barometer, which measures the height above the origin: that of the Earth on which it is, -p_D on a flat one.

    The pressure at the surface and its drift with the weather are an offset b, a column of air of another temperature
    than that of the standard atmosphere is a scale error s: z = h + b + s h.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    height
        Noise: a standard deviation in m (white), or a model per sample at `rate`.
    offset_sd
        Standard deviation in m of a constant offset b, drawn for every run and estimated.
    offset_noise
        A model of changes of b, such as ``"GM(beta=1e-3, variance=4.0)"``, per sample at `rate`.
    scale_sd
        Standard deviation of a constant scale error s: 1e-3 to 1e-2 for the temperature of a day.
    outages
        Intervals (start, end) in s without readings, ends included.
    first
        s after the start of the run, of the first reading; one period unless told otherwise.
    believed
        Standard deviation in m that the filter believes; that of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, an outage that is no interval, an offset that is no Markov
        process.

    Examples
    --------
    >>> nj.Barometer(rate=1.0, height=0.5).axes
    ('height',)
    >>> weather = nj.Barometer(height=0.5, offset_sd=5.0, offset_noise="GM(beta=1e-3, variance=4.0)", scale_sd=5e-3)
    >>> [state.name for state in weather.states]
    ['offset', 'scale']
    """

    unit: ClassVar[str] = "m"
    settings: ClassVar[Mapping[str, Setting]] = {
        "height": Setting("m", or_model=True, required=True),
        "offset_sd": Setting("m"),
        "offset_noise": Setting("m", or_model=True),
        "scale_sd": Setting("1"),
        "believed": Setting("m"),
    }

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "1"]
    offset: OwnState | None
    scale: OwnState | None
    earth: AbstractEarth | None
    """Where heights are those of a surface that is not flat."""
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        height: Any,
        offset_sd: Any = 0.0,
        offset_noise: Any = None,
        scale_sd: Any = 0.0,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "barometer",
    ):
        self.name, self.earth = name, None
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.noise, self.believed = noises(
            name, (height,), None if believed is None else spread(name, believed, (self.axes,))
        )
        self.offset = own_state("offset", "m", offset_sd, offset_noise)
        self.scale = own_state("scale", "1", scale_sd)

    @property
    def axes(self) -> tuple[str, ...]:
        """Height."""
        return ("height",)

    @property
    def linear(self) -> bool:
        """Height is a position where the Earth is flat; unless there are errors to be estimated."""
        return self.earth is None and not self.states

    @property
    def states(self) -> tuple[OwnState, ...]:
        """Offset and scale error, if they are not known."""
        return tuple(s for s in (self.offset, self.scale) if s is not None)

    def on(self, earth: AbstractEarth) -> "Barometer":  # noqa: D102
        curved = None if earth.is_flat else earth
        return eqx.tree_at(lambda s: s.earth, self, curved, is_leaf=lambda leaf: leaf is None)

    def predict(self, state, body):  # noqa: D102
        height = -state.p[2:3] if self.earth is None else self.earth.height(state.p)[None]
        offset = 0.0 if self.offset is None else state.x[:1]
        return height + offset + (0.0 if self.scale is None else state.x[-1:] * height)

    def jacobian(self, state, body, layout):  # noqa: D102
        if self.states:
            return None
        if self.earth is None:
            return jnp.zeros((1, layout.size, 1)).at[:, layout["position"], 0].set(-jnp.eye(3)[2:])
        height = self.earth.height
        upward = jax.grad(lambda p: jnp.sum(height(p)))(state.p)
        return jnp.zeros((1, layout.size, upward.shape[1])).at[0, layout["position"]].set(upward)

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        return ("height",)

    def measured(self, values, origin):  # noqa: D102
        return values if origin is None else values - origin[2]


class _State(NamedTuple):
    height: NoiseModel
    believed: Float64[np.ndarray, "1"]
    offset: OwnState | None
    scale: OwnState | None
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: Barometer) -> _State:
    return _State(s.noise[0], np.asarray(s.believed), s.offset, s.scale, s.rate, s.first, s.outages, s.name)


def _from_state(state: _State) -> Barometer:
    options: dict[str, Any] = state._asdict()
    for name in ("offset", "scale"):
        options |= arguments(name, options.pop(name))
    return Barometer(**options)


register(Barometer, _State, _to_state, _from_state)
