"""The odometer: speed over ground in the direction of the wheels, with a scale factor that a filter estimates."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, lever, noises, spread, timing
from nav_jax.aiding.mounting import PITCH_AND_YAW, along_vehicle, pair_of_states
from nav_jax.aiding.states import OwnState, own_state, own_states_of
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.rotation import cross, rotate_back


class Odometer(AbstractAiding):
    """Speed of a wheel along the front axis of a vehicle, (1 + s) times the true one; to the sides it does not slip.

    The velocity of the wheel in b is C' v + rate x lever arm, with the rate relative to the Earth. The vehicle's axes
    are those of b, unless a pitch and a yaw of the mounting are asked for as states (`nav_jax.aiding.mounting`). A
    small pitch theta takes theta times the downward velocity off the speed and adds theta times the speed to what goes
    down: without sideways components it is hardly seen, and a yaw is not. What is emulated of
    the sideways components are those of the reference, with noise: the reference is taken to be what the vehicle does.

    The rate is what the gyros say without the errors that the filter estimates. Their white noise, of sigma_w a sample,
    is left in it and moves the wheel by sigma_w times the arm, which no filter's variance counts: 1 mm/s for 1 m and
    1e-3 rad/s. Believe more where that is not small against the noise of the wheel.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    speed
        Noise of the speed: a standard deviation in m/s (white), or a model per sample at `rate`.
    sideways
        The same of the components right and down, which are measured as zero (non-holonomic constraints): one number
        or model, or one each. Not measured unless given.
    lever_arm
        From the IMU to the wheel's point of contact, front, right, down in m; zero unless given.
    lever_arm_sd
        Standard deviations in m of the front, right and down component of its error, one number or three: constant,
        drawn for every run, and estimated. The speed alone does not see the first.
    mount_sd
        Standard deviations in rad of pitch and yaw of the mounting, one number or two, likewise.
    mount_noise
        A model of changes of both angles, such as a random walk ``"RW(gamma2=5e-9)"``, per sample at `rate`.
    scale_sd
        Standard deviation of a constant scale factor s, drawn for every run and estimated.
    scale_noise
        A model of changes of s, such as a random walk ``"RW(gamma2=1e-10)"``, per sample at `rate`.
    outages
        Intervals (start, end) in s without readings, ends included.
    first
        s after the start of the run, of the first reading; one period unless told otherwise.
    believed
        Standard deviations in m/s that the filter believes: (speed, sideways) or one of each component; those of the
        noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation or rate that is not positive, an outage that is no interval, another number of standard
        deviations.

    Examples
    --------
    >>> wheel = nj.Odometer(rate=10.0, speed=0.05, sideways=0.02, lever_arm=(-1.0, 0.0, 0.5), scale_sd=0.01)
    >>> wheel.believed.tolist()  # of the speed, and of what goes right and down
    [0.05, 0.02, 0.02]
    >>> wheel = nj.Odometer(10.0, speed=0.05, sideways=0.02, scale_sd=0.01, mount_sd=0.02)
    >>> [state.name for state in wheel.states]
    ['scale', 'mount pitch', 'mount yaw']
    """

    unit: ClassVar[str] = "m/s"
    settings: ClassVar[Mapping[str, Setting]] = {
        "speed": Setting("m/s", or_model=True, required=True), "sideways": Setting("m/s", (1, 2), or_model=True),
        "lever_arm": Setting("m", (3,)), "lever_arm_sd": Setting("m", (1, 3)), "mount_sd": Setting("rad", (1, 2)),
        "mount_noise": Setting("rad", or_model=True), "scale_sd": Setting("1"),
        "scale_noise": Setting("1", or_model=True), "believed": Setting("m/s", (1, 2, 3)),
    }  # fmt: skip

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, " K"]
    lever_arm: Float[Array, "3"] | None
    scale: OwnState | None
    arm: tuple[OwnState, ...]
    """Errors of the lever arm, front, right and down."""
    mount: tuple[OwnState, ...]
    """Pitch and yaw."""
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        speed: Any,
        sideways: Any = None,
        lever_arm: Any = None,
        lever_arm_sd: Any = 0.0,
        mount_sd: Any = 0.0,
        mount_noise: Any = None,
        scale_sd: Any = 0.0,
        scale_noise: Any = None,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "odometer",
    ):
        self.name = name
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.lever_arm = lever(name, lever_arm)
        pair = isinstance(sideways, list | tuple | np.ndarray) and np.ndim(sideways) == 1
        if pair and len(sideways) != 2:
            raise ValueError(f"{name}: sideways is the noise of right and down, and this is {sideways!r}.")
        rest = () if sideways is None else tuple(sideways) if pair else (sideways, sideways)
        groups = (("speed",), ("right", "down")) if rest else (("speed",),)
        sd = None if believed is None else spread(name, believed, groups)
        self.noise, self.believed = noises(name, (speed, *rest), sd)
        self.scale = own_state("scale", "1", scale_sd, scale_noise)
        self.arm = own_states_of(name, "lever_arm", "m", ("x", "y", "z"), lever_arm_sd)
        self.mount = pair_of_states(name, "mount_sd", PITCH_AND_YAW, "rad", mount_sd, mount_noise)

    @property
    def axes(self) -> tuple[str, ...]:
        """Speed, and right and down if they are measured."""
        return ("speed", "right", "down")[: len(self.noise)]

    @property
    def uses_body(self) -> bool:
        """A wheel on an arm moves with the body rate."""
        return self.lever_arm is not None or bool(self.arm)

    @property
    def states(self) -> tuple[OwnState, ...]:
        """What is not known of the scale factor, the lever arm and the mounting."""
        return (*(() if self.scale is None else (self.scale,)), *self.arm, *self.mount)

    def predict(self, state, body):  # noqa: D102
        moved = rotate_back(state.q, state.v)
        if self.uses_body and body is not None:
            arm = jnp.zeros((3, 1)) if self.lever_arm is None else self.lever_arm[:, None]
            if self.arm:
                first = len(self.states) - len(self.mount) - len(self.arm)
                arm = arm + state.x[first : first + len(self.arm)]
            moved = moved + cross(body.rate, arm)
        if self.mount:
            moved = along_vehicle(moved, state.x[-2], state.x[-1])
        factor = 1.0 if self.scale is None else 1.0 + state.x[:1]
        return jnp.concatenate([factor * moved[:1], moved[1 : len(self.noise)]])

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        if geodetic:
            raise ValueError("Speeds have no origin: leave origin out.")
        return ("speed",)

    def measured(self, values, origin):  # noqa: D102
        # sideways zero is measured whenever the speed is
        return np.pad(values, ((0, 0), (0, len(self.noise) - 1)))


class _State(NamedTuple):
    noise: tuple[NoiseModel, ...]
    believed: Float64[np.ndarray, " K"]
    lever_arm: Float64[np.ndarray, "3"] | None
    scale: OwnState | None
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str
    lever_arm_sd: Float64[np.ndarray, "3"] | None = None
    mount_sd: Float64[np.ndarray, "2"] | None = None
    mount_noise: NoiseModel | None = None


def _to_state(s: Odometer) -> _State:
    arm = None if s.lever_arm is None else np.asarray(s.lever_arm)
    arm_sd, mount_sd = (np.array([float(x.sd) for x in states]) if states else None for states in (s.arm, s.mount))
    noise = s.mount[0].noise if s.mount else None
    shared = s.rate, s.first, s.outages, s.name
    return _State(s.noise, np.asarray(s.believed), arm, s.scale, *shared, arm_sd, mount_sd, noise)


def _from_state(state: _State) -> Odometer:
    options: dict[str, Any] = {name: value for name, value in state._asdict().items() if value is not None}
    speed, *rest = options.pop("noise")
    scale: OwnState | None = options.pop("scale", None)
    if scale is not None:
        options |= {"scale_sd": scale.sd, "scale_noise": scale.noise}
    return Odometer(speed=speed, sideways=tuple(rest) or None, **options)


register(Odometer, _State, _to_state, _from_state)
