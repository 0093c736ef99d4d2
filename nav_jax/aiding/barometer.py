"""Barometric height."""

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
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.earth import AbstractEarth


class Barometer(AbstractAiding):
    """A barometer, which measures the height above the origin: that of the Earth on which it is, -p_D on a flat one.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    height
        Noise: a standard deviation in m (white), or a model per sample at `rate`.
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
        A standard deviation or rate that is not positive, an outage that is no interval.

    Examples
    --------
    >>> nj.Barometer(rate=1.0, height=0.5).axes
    ('height',)
    """

    unit: ClassVar[str] = "m"
    settings: ClassVar[Mapping[str, Setting]] = {
        "height": Setting("m", or_model=True, required=True),
        "believed": Setting("m"),
    }

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "1"]
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

    @property
    def axes(self) -> tuple[str, ...]:
        """Height."""
        return ("height",)

    @property
    def linear(self) -> bool:
        """Height is a position where the Earth is flat."""
        return self.earth is None

    def on(self, earth: AbstractEarth) -> "Barometer":  # noqa: D102
        curved = None if earth.is_flat else earth
        return eqx.tree_at(lambda s: s.earth, self, curved, is_leaf=lambda leaf: leaf is None)

    def predict(self, state, body):  # noqa: D102
        return -state.p[2:3] if self.earth is None else self.earth.height(state.p)[None]

    def jacobian(self, state, body, layout):  # noqa: D102
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
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: Barometer) -> _State:
    return _State(s.noise[0], np.asarray(s.believed), s.rate, s.first, s.outages, s.name)


register(Barometer, _State, _to_state, lambda state: Barometer(**state._asdict()))
