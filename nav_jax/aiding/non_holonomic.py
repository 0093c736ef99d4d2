"""The non-holonomic constraint: wheels that do not slip go where they point, neither sideways nor up."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, Window, lever, noises, spread, timing
from nav_jax.aiding.mounting import PITCH_AND_YAW, along_vehicle, pair_of_states
from nav_jax.aiding.states import OwnState
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.rotation import cross, rotate_back

_CALM = 0.1
"""s about an update, over which body rates are averaged: a vehicle turns slowly, and its IMU vibrates."""


class NonHolonomic(AbstractAiding):
    r"""The velocity of the rear axle to the right and down of the vehicle, which is zero (Dissanayake et al. 2001).

    With the velocity u = C' v + w x r of a point r of the body, in b, and the vehicle's axes turned from those of b by
    a pitch theta and a yaw psi,

        right   (-sin psi, cos psi, 0) u
        down    (cos psi sin theta, sin psi sin theta, cos theta) u

    Both angles of the mounting are states on demand, see `nav_jax.aiding.mounting`. What is emulated is what the
    reference does at that point, which is taken for that of a vehicle, with noise.

    Parameters
    ----------
    rate
        Hz; any, also one that is no divisor of the IMU's.
    right, down
        Noise: side slip and suspension, a standard deviation in m/s (white), or a model per sample at `rate`.
        Vehicles have 2 to 10 cm/s at 10 Hz, and more in turns.
    lever_arm
        From the IMU to the middle of the rear axle, front, right, down in m; zero unless given.
    lever_arm_sd
        Standard deviations in m of the front and the down component of its error, one number or two: constant, drawn
        for every run, and estimated. The other one moves nothing sideways.
    mount_sd
        Standard deviations in rad of pitch and yaw of the mounting, one number or two, likewise.
    mount_noise
        A model of changes of both angles, such as a random walk ``"RW(gamma2=5e-8)"``, per sample at `rate`.
    faster
        m/s: the speed of the reference above which there are updates.
    outages
        Intervals (start, end) in s without updates, ends included.
    first
        s after the start of the run, of the first update; one period unless told otherwise.
    believed
        Standard deviations in m/s that the filter believes; those of the noise if not given.
    name
        Of the sensor, where there are several.

    Raises
    ------
    ValueError
        A standard deviation, speed or rate that is not positive, an outage that is no interval, another number of
        standard deviations.

    Examples
    --------
    >>> axle = nj.aiding.NonHolonomic(10.0, right=0.03, down=0.04, lever_arm=(-1.5, 0.0, 0.4), mount_sd=0.02)
    >>> [state.name for state in axle.states]
    ['mount pitch', 'mount yaw']
    """

    unit: ClassVar[str] = "m/s"
    settings: ClassVar[Mapping[str, Setting]] = {
        "right": Setting("m/s", or_model=True, required=True), "down": Setting("m/s", or_model=True, required=True),
        "lever_arm": Setting("m", (3,)), "lever_arm_sd": Setting("m", (1, 2)), "mount_sd": Setting("rad", (1, 2)),
        "mount_noise": Setting("rad", or_model=True), "faster": Setting("m/s"), "believed": Setting("m/s", (2,)),
    }  # fmt: skip

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "2"]
    lever_arm: Float[Array, "3"] | None
    arm: tuple[OwnState, ...]
    """Errors of the lever arm, front and down."""
    mount: tuple[OwnState, ...]
    """Pitch and yaw."""
    faster: float = eqx.field(static=True)
    rate: float = eqx.field(static=True)
    first: float = eqx.field(static=True)
    outages: tuple[tuple[float, float], ...] = eqx.field(static=True)
    name: str = eqx.field(static=True)

    def __init__(
        self,
        rate: Real = 1.0,
        *,
        right: Any,
        down: Any,
        lever_arm: Any = None,
        lever_arm_sd: Any = 0.0,
        mount_sd: Any = 0.0,
        mount_noise: Any = None,
        faster: Real = 1.0,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str = "non_holonomic",
    ):
        self.name = name
        self.rate, self.first, self.outages = timing(name, rate, first, outages)
        self.faster = number(f"{name}: faster", faster, zero_ok=True)
        self.lever_arm = lever(name, lever_arm)
        self.arm = pair_of_states(name, "lever_arm_sd", ("lever_arm x", "lever_arm z"), "m", lever_arm_sd)
        self.mount = pair_of_states(name, "mount_sd", PITCH_AND_YAW, "rad", mount_sd, mount_noise)
        sd = None if believed is None else spread(name, believed, tuple((axis,) for axis in self.axes))
        self.noise, self.believed = noises(name, (right, down), sd)

    @property
    def axes(self) -> tuple[str, ...]:
        """Right, down."""
        return ("right", "down")

    @property
    def uses_body(self) -> bool:
        """An axle on an arm moves with the body rate."""
        return self.lever_arm is not None or bool(self.arm)

    @property
    def windows(self) -> tuple[Window, ...]:
        """For that rate."""
        return (Window(-_CALM, _CALM),) if self.uses_body else ()

    @property
    def states(self) -> tuple[OwnState, ...]:
        """What is not known of the lever arm and of the mounting."""
        return (*self.arm, *self.mount)

    def applies(self, speed):  # noqa: D102
        return speed > self.faster

    def predict(self, state, body: Any):  # noqa: D102
        u = rotate_back(state.q, state.v)
        if self.uses_body:
            arm = jnp.zeros_like(u) if self.lever_arm is None else jnp.broadcast_to(self.lever_arm[:, None], u.shape)
            if self.arm:
                arm = arm.at[0].add(state.x[0]).at[2].add(state.x[1])
            u = u + cross(body.means[0, 3:], arm)
        if not self.mount:
            return u[1:]
        return along_vehicle(u, state.x[-2], state.x[-1])[1:]

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        raise ValueError(f"{self.name} is measured by nothing: nav_jax.recorded.constrained makes fixes for a drive.")


class _State(NamedTuple):
    right: NoiseModel
    down: NoiseModel
    believed: Float64[np.ndarray, "2"]
    lever_arm: Float64[np.ndarray, "3"] | None
    lever_arm_sd: Float64[np.ndarray, "2"] | None
    mount_sd: Float64[np.ndarray, "2"] | None
    mount_noise: NoiseModel | None
    faster: float
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: NonHolonomic) -> _State:
    arm = None if s.lever_arm is None else np.asarray(s.lever_arm)
    arm_sd, mount_sd = (np.array([float(x.sd) for x in pair]) if pair else None for pair in (s.arm, s.mount))
    noise = s.mount[0].noise if s.mount else None
    right, down = s.noise
    sd = np.asarray(s.believed)
    return _State(right, down, sd, arm, arm_sd, mount_sd, noise, s.faster, s.rate, s.first, s.outages, s.name)


def _from_state(state: _State) -> NonHolonomic:
    options = state._asdict()
    return NonHolonomic(**{name: value for name, value in options.items() if value is not None})


register(NonHolonomic, _State, _to_state, _from_state)
