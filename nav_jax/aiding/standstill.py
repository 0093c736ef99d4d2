"""What is known of a vehicle that stands: its velocity is zero, and so is its body rate relative to the Earth."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, Window, noises, spread, timing
from nav_jax.imu.noise_models import NoiseModel

_MEAN = 0.4
"""s, before an update, over which rates are averaged."""


class AbstractStandstill(AbstractAiding):
    """An update by zero wherever the vehicle stands.

    Along a known trajectory that is where the reference is slower than a limit. What is measured is zero with noise,
    and not what the reference does there. Of a recorded drive `nav_jax.recorded.stops` tells where it stands.

    Parameters
    ----------
    rate
        Hz, of the updates during a stop.
    sd
        Noise: a standard deviation in the unit of the sensor (white), or a model per sample at `rate`.
    slower
        m/s: the speed of the reference below which it stands.
    outages
        Intervals (start, end) in s without updates, ends included.
    first
        s after the start of the run, of the first; one period unless told otherwise.
    believed
        Standard deviation that the filter believes; that of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation, speed or rate that is not positive, an outage that is no interval.
    """

    default_name: ClassVar[str]

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    slower: float = eqx.field(static=True)
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        sd: Any,
        slower: Real = 0.02,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str | None = None,
    ):
        self.name = self.default_name if name is None else name
        self.slower = number(f"{self.name}: slower", slower)
        self.rate, self.first, self.outages = timing(self.name, rate, first, outages)
        same = None if believed is None else spread(self.name, believed, (self.axes,))
        self.noise, self.believed = noises(self.name, (sd, sd, sd), same)

    def applies(self, speed):  # noqa: D102
        return speed < self.slower

    def emulate(self, track, time, x):  # noqa: D102
        return jnp.zeros((3, len(time), 1))

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        raise ValueError(f"{self.name} is measured by nothing: nav_jax.recorded.stops finds where a drive stands.")


def _settings(unit: str) -> Mapping[str, Setting]:
    return {"sd": Setting(unit, or_model=True, required=True), "slower": Setting("m/s"), "believed": Setting(unit)}


class ZeroVelocity(AbstractStandstill):
    """Zero-velocity updates (ZUPT) in m/s: north, east, down. The parameters are those of `AbstractStandstill`.

    Examples
    --------
    >>> nj.aiding.ZeroVelocity(rate=5.0, sd=0.02).unit
    'm/s'
    """

    unit: ClassVar[str] = "m/s"
    settings: ClassVar[Mapping[str, Setting]] = _settings("m/s")
    default_name: ClassVar[str] = "zero_velocity"

    @property
    def axes(self) -> tuple[str, ...]:
        """North, east, down."""
        return ("n", "e", "d")

    @property
    def linear(self) -> bool:
        """The velocity itself."""
        return True

    def predict(self, state, body):  # noqa: D102
        return state.v

    def jacobian(self, state, body, layout):  # noqa: D102
        return jnp.zeros((3, layout.size, 1)).at[:, layout["velocity"], 0].set(jnp.eye(3))


class ZeroRate(AbstractStandstill):
    """Zero-rate updates (ZARU) in rad/s: zero body rate relative to the Earth. Parameters as of `AbstractStandstill`.

    It is the mean of the compensated gyros over the 0.4 s before, less the rate of the Earth, and shows their biases.
    White noise of sigma_w a sample leaves sigma_w / sqrt(0.4 f) in that mean at a rate of f, and the vibration of an
    engine more; neither is in a variance that the filter states, so that ``sd`` has to contain them. Updates are best
    that far apart or more, since means over the same samples have the same noise.

    Examples
    --------
    >>> nj.aiding.ZeroRate(rate=2.0, sd=1e-4).unit
    'rad/s'
    """

    unit: ClassVar[str] = "rad/s"
    settings: ClassVar[Mapping[str, Setting]] = _settings("rad/s")
    default_name: ClassVar[str] = "zero_rate"

    @property
    def axes(self) -> tuple[str, ...]:
        """Front, right, down."""
        return ("x", "y", "z")

    @property
    def uses_body(self) -> bool:
        """Its rate."""
        return True

    @property
    def windows(self) -> tuple[Window, ...]:
        """Before the update."""
        return (Window(-_MEAN, 0.0),)

    def predict(self, state, body: Any):  # noqa: D102
        return body.means[0, 3:]


class _State(NamedTuple):
    sd: NoiseModel
    believed: Float64[np.ndarray, "3"]
    slower: float
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: AbstractStandstill) -> _State:
    return _State(s.noise[0], np.asarray(s.believed), s.slower, s.rate, s.first, s.outages, s.name)


for _cls in (ZeroVelocity, ZeroRate):
    register(_cls, _State, _to_state, partial(lambda cls, state: cls(**state._asdict()), _cls))
