"""The magnetometer: the field of the Earth along the axes of the body, and the iron of the vehicle beside it."""

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
from nav_jax.kinematics.rotation import rotate_back
from nav_jax.trajectory.columns import MAGNETIC


class Magnetometer(AbstractAiding):
    """The magnetic field in b in tesla, C' m + b with the field m of the Earth in n and that of hard iron b.

    The field of the Earth is a constant: with the intensity F, the inclination I and the declination D of a place it is
    F (cos I cos D, cos I sin D, sin I), 20 to 65 microtesla. Soft iron and scales are taken to be calibrated.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    sd
        Noise: a standard deviation in T (white), or a model per sample at `rate`.
    field
        Of the Earth, north, east, down in T.
    hard_iron_sd
        Standard deviations in T of a constant field of the vehicle along x, y, z, one number or three, drawn for every
        run and estimated.
    outages
        Intervals (start, end) in s without readings, ends included.
    first
        s after the start of the run, of the first reading; one period unless told otherwise.
    believed
        Standard deviations in T that the filter believes, one number or three; those of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, a field of zero, an outage that is no interval.

    Examples
    --------
    >>> compass = nj.aiding.Magnetometer(10.0, sd=2e-7, field=(22e-6, 1e-6, 43e-6), hard_iron_sd=1e-6)
    >>> [state.name for state in compass.states]
    ['hard_iron x', 'hard_iron y', 'hard_iron z']
    """

    unit: ClassVar[str] = "T"
    settings: ClassVar[Mapping[str, Setting]] = {
        "sd": Setting("T", or_model=True, required=True), "field": Setting("T", (3,), required=True),
        "hard_iron_sd": Setting("T", (1, 3)), "believed": Setting("T", (1, 3)),
    }  # fmt: skip

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    field: Float[Array, "3"]
    iron: tuple[OwnState, ...]
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        sd: Any,
        field: Any,
        hard_iron_sd: Any = 0.0,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "magnetometer",
    ):
        self.name = name
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.field = direction(name, "a field", "north, east, down, in T", field)
        self.iron = own_states_of(name, "hard_iron", "T", "xyz", hard_iron_sd)
        same = None if believed is None else spread(name, believed, (self.axes,))
        self.noise, self.believed = noises(name, (sd, sd, sd), same)

    @property
    def axes(self) -> tuple[str, ...]:
        """Front, right, down."""
        return ("x", "y", "z")

    @property
    def states(self) -> tuple[OwnState, ...]:
        """Hard iron, if it is not known."""
        return self.iron

    def predict(self, state, body):  # noqa: D102
        seen = rotate_back(state.q, jnp.broadcast_to(self.field[:, None], state.v.shape))
        return seen + state.x if self.iron else seen

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        return MAGNETIC

    def measured(self, values, origin):  # noqa: D102
        check_size(self.name, values, float(np.linalg.norm(self.field)), "the field of the Earth", "T")
        return values


class _State(NamedTuple):
    sd: NoiseModel
    field: Float64[np.ndarray, "3"]
    believed: Float64[np.ndarray, "3"]
    hard_iron_sd: Float64[np.ndarray, "3"] | None
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: Magnetometer) -> _State:
    iron = np.array([float(x.sd) for x in s.iron]) if s.iron else None
    return _State(
        s.noise[0], np.asarray(s.field), np.asarray(s.believed), iron, s.rate, s.first, s.outages, s.name
    )  # fmt: skip


def _from_state(state: _State) -> Magnetometer:
    return Magnetometer(**{name: value for name, value in state._asdict().items() if value is not None})


register(Magnetometer, _State, _to_state, _from_state)
