"""Two antennas of a receiver: the way from one to the other, which shows a heading at rest too."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, check_size, direction, noises, spread, timing
from nav_jax.aiding.states import OwnState, own_states_of
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.rotation import rotate
from nav_jax.trajectory.columns import BASELINE


class DualAntenna(AbstractAiding):
    """The baseline of two antennas in n in m: north, east, down of C b for the baseline b in the body.

    All three components, and not a heading, which would have no meaning for a body that points up. A baseline of 1 m
    with 5 mm shows the heading to 0.3 deg.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    horizontal, vertical
        Noise of north and east, and of down: a standard deviation in m (white), or a model per sample at `rate`.
    baseline
        From the first antenna to the second, front, right, down in m.
    offset_sd
        Standard deviations in m of a constant error of the baseline along x, y, z, one number or three, drawn for every
        run and estimated.
    outages
        Intervals (start, end) in s without fixes, ends included.
    first
        s after the start of the run, of the first fix; one period unless told otherwise.
    believed
        Standard deviations in m that the filter believes, (horizontal, vertical) or one of each component; those of the
        noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, a baseline of zero, an outage that is no interval.

    Examples
    --------
    >>> pair = nj.aiding.DualAntenna(5.0, horizontal=0.005, vertical=0.01, baseline=(1.0, 0.0, 0.0))
    >>> pair.believed.tolist()
    [0.005, 0.005, 0.01]
    """

    unit: ClassVar[str] = "m"
    settings: ClassVar[Mapping[str, Setting]] = {
        "horizontal": Setting("m", or_model=True, required=True),
        "vertical": Setting("m", or_model=True, required=True),
        "baseline": Setting("m", (3,), required=True),
        "offset_sd": Setting("m", (1, 3)),
        "believed": Setting("m", (2, 3)),
    }

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    baseline: Float[Array, "3"]
    offset: tuple[OwnState, ...]
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        horizontal: Any,
        vertical: Any,
        baseline: Any,
        offset_sd: Any = 0.0,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "dual_antenna",
    ):
        self.name = name
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.baseline = direction(name, "a baseline", "front, right, down, in m", baseline)
        self.offset = own_states_of(name, "offset", "m", "xyz", offset_sd)
        sd = None if believed is None else spread(name, believed, (("n", "e"), ("d",)))
        self.noise, self.believed = noises(name, (horizontal, horizontal, vertical), sd)

    @property
    def axes(self) -> tuple[str, ...]:
        """North, east, down."""
        return ("n", "e", "d")

    @property
    def states(self) -> tuple[OwnState, ...]:
        """What is not known of the baseline."""
        return self.offset

    def predict(self, state, body):  # noqa: D102
        way = jnp.broadcast_to(self.baseline[:, None], state.v.shape)
        return rotate(state.q, way + state.x if self.offset else way)

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        return BASELINE

    def measured(self, values, origin):  # noqa: D102
        check_size(self.name, values, float(np.linalg.norm(self.baseline)), "the baseline", "m")
        return values


class _State(NamedTuple):
    horizontal: NoiseModel
    vertical: NoiseModel
    baseline: Float64[np.ndarray, "3"]
    believed: Float64[np.ndarray, "3"]
    offset_sd: Float64[np.ndarray, "3"] | None
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: DualAntenna) -> _State:
    offset = np.array([float(x.sd) for x in s.offset]) if s.offset else None
    north, _, down = s.noise
    sd, way = np.asarray(s.believed), np.asarray(s.baseline)
    return _State(north, down, way, sd, offset, s.rate, s.first, s.outages, s.name)


def _from_state(state: _State) -> DualAntenna:
    return DualAntenna(**{name: value for name, value in state._asdict().items() if value is not None})


register(DualAntenna, _State, _to_state, _from_state)
