"""GNSS: fixes of position and of velocity, three components, two of them horizontal."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.checks import as_float, concrete
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, lever, noises, spread, timing
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.geodetic import ned_from_geodetic
from nav_jax.kinematics.rotation import cross, dcm_from_quat, matvec
from nav_jax.trajectory.columns import POSITION, VELOCITY


class AbstractNed(AbstractAiding):
    """Fixes in north, east, down.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    horizontal, vertical
        Noise of north and east, and of down: a standard deviation in SI (white), or a model per sample at `rate`.
    covariance
        Instead of them the covariance (3, 3) of white noise whose components are correlated. Innovations and their
        variances are then those of the fixes multiplied by the inverse of its Cholesky factor.
    lever_arm
        From the IMU to the antenna, front, right, down in m; zero unless given.
    outages
        Intervals (start, end) in s without fixes, ends included.
    first
        s after the start of the run, of the first fix; one period unless told otherwise.
    believed
        Standard deviations that the filter believes, (horizontal, vertical) or (north, east, down); those of the noise
        if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, an outage that is no interval; noise that is given twice or
        not at all, or is believed twice.
    """

    default_name: ClassVar[str]

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    factor: Float[Array, "3 3"] | None
    """Cholesky factor of the covariance."""
    lever_arm: Float[Array, "3"] | None
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        horizontal: Any = None,
        vertical: Any = None,
        covariance: Any = None,
        lever_arm: Any = None,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str | None = None,
    ):
        self.name = self.default_name if name is None else name
        self.rate, self.first, self.outages = timing(self.name, rate, first, outages)
        self.lever_arm = lever(self.name, lever_arm)
        if covariance is None:
            if horizontal is None or vertical is None:
                raise ValueError(f"{self.name}: give its noise as horizontal and vertical, or as a covariance.")
            sd = None if believed is None else spread(self.name, believed, (("n", "e"), ("d",)))
            self.noise, self.believed = noises(self.name, (horizontal, horizontal, vertical), sd)
            self.factor = None
            return
        if horizontal is not None or vertical is not None or believed is not None:
            raise ValueError(f"{self.name}: a covariance is the noise, and what is believed of it; give nothing else.")
        self.noise, self.believed = noises(self.name, (1.0, 1.0, 1.0), None)
        self.factor = _factor(self.name, covariance)

    @property
    def axes(self) -> tuple[str, ...]:
        """North, east, down."""
        return ("n", "e", "d")

    @property
    def linear(self) -> bool:
        """Unless there is a lever arm."""
        return self.lever_arm is None

    @property
    def mixing(self) -> Float[Array, "3 3"] | None:
        """See `AbstractAiding`."""
        return self.factor


def _settings(unit: str) -> Mapping[str, Setting]:
    noise = Setting(unit, or_model=True, required=True)
    believed, arm = Setting(unit, (2, 3)), Setting("m", (3,))
    return {"horizontal": noise, "vertical": noise, "believed": believed, "lever_arm": arm}


class GnssPosition(AbstractNed):
    """A GNSS receiver's fixes of position in m: north, east, down. The parameters are those of `AbstractNed`.

    Examples
    --------
    >>> gnss = nj.GnssPosition(rate=1.0, horizontal=0.1, vertical=0.2, outages=[(5.0, 8.0)])
    >>> gnss.available(np.arange(4.0, 10.0)).tolist()
    [True, False, False, False, False, True]
    """

    unit: ClassVar[str] = "m"
    settings: ClassVar[Mapping[str, Setting]] = _settings("m")
    default_name: ClassVar[str] = "gnss_position"

    def predict(self, state, body):  # noqa: D102
        if self.lever_arm is None:
            return state.p
        return state.p + self._arm_n(state)

    def jacobian(self, state, body, layout):  # noqa: D102
        if self.lever_arm is None:
            return jnp.zeros((3, layout.size, 1)).at[:, layout["position"], 0].set(jnp.eye(3))
        # the arm turns with the attitude: psi x (C l)
        arm = self._arm_n(state)
        turned = jnp.stack([cross(jnp.eye(3)[:, i, None], arm) for i in range(3)], axis=1)
        H = jnp.zeros((3, layout.size, arm.shape[1])).at[:, layout["position"]].set(jnp.eye(3)[:, :, None])
        return H.at[:, layout["attitude"]].set(turned)

    def _arm_n(self, state: Any) -> Float[Array, "3 R"]:
        return matvec(dcm_from_quat(state.q), jnp.asarray(self.lever_arm)[:, None])

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        return POSITION["geodetic" if geodetic else "ned"]

    def measured(self, values, origin):  # noqa: D102
        return values if origin is None else ned_from_geodetic(values, origin)


class GnssVelocity(AbstractNed):
    """A GNSS receiver's fixes of velocity in m/s: north, east, down. The parameters are those of `AbstractNed`.

    Examples
    --------
    >>> nj.GnssVelocity(rate=1.0, horizontal=0.01, vertical=0.02).unit
    'm/s'
    """

    unit: ClassVar[str] = "m/s"
    settings: ClassVar[Mapping[str, Setting]] = _settings("m/s")
    default_name: ClassVar[str] = "gnss_velocity"

    @property
    def uses_body(self) -> bool:
        """An antenna on an arm moves with the body rate."""
        return self.lever_arm is not None

    def predict(self, state, body):  # noqa: D102
        if self.lever_arm is None or body is None:
            return state.v
        return state.v + matvec(dcm_from_quat(state.q), cross(body.rate, self.lever_arm[:, None]))

    def jacobian(self, state, body, layout):  # noqa: D102
        if self.lever_arm is not None:
            return None
        return jnp.zeros((3, layout.size, 1)).at[:, layout["velocity"], 0].set(jnp.eye(3))

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        if geodetic:
            raise ValueError("Velocities have no origin: leave origin out.")
        return VELOCITY


def _factor(name: str, covariance: Any) -> Float[Array, "3 3"]:
    """The Cholesky factor of a covariance."""
    C = as_float(covariance)
    seen = concrete(C)
    if C.shape != (3, 3):
        raise ValueError(f"{name}: the covariance of its noise is (3, 3), and this one {C.shape}.")
    if seen is not None and not (np.isfinite(seen).all() and np.allclose(seen, seen.T, rtol=1e-9, atol=0)):
        raise ValueError(f"{name}: the covariance of its noise must be finite and symmetric.")
    if seen is not None and np.linalg.eigvalsh(seen).min() <= 0:
        raise ValueError(f"{name}: the covariance of its noise must be positive definite.")
    return jnp.linalg.cholesky(C)


class _State(NamedTuple):
    noise: tuple[NoiseModel, ...]
    believed: Float64[np.ndarray, "3"]
    factor: Float64[np.ndarray, "3 3"] | None
    lever_arm: Float64[np.ndarray, "3"] | None
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: AbstractNed) -> _State:
    factor, arm = (None if a is None else np.asarray(a) for a in (s.factor, s.lever_arm))
    return _State(s.noise, np.asarray(s.believed), factor, arm, s.rate, s.first, s.outages, s.name)


def _from_state(cls: type[AbstractNed], state: _State) -> AbstractNed:
    options: dict[str, Any] = state._asdict()
    north, east, down = options.pop("noise")
    believed, factor = options.pop("believed"), options.pop("factor")
    if repr(north) != repr(east):
        raise ValueError(f"{state.name} has one noise of north and another one of east.")
    if factor is None:
        return cls(horizontal=north, vertical=down, believed=believed, **options)
    sensor = cls(covariance=factor @ factor.T, **options)
    # to the last bit: a factor of a product is not that of before; a tuning may believe other standard deviations
    return eqx.tree_at(lambda s: (s.factor, s.believed), sensor, (as_float(factor), as_float(believed)))


for _cls in (GnssPosition, GnssVelocity):
    register(_cls, _State, _to_state, partial(_from_state, _cls))
