"""What gravity is other than that of the Earth's model, along a track: no error of an IMU, but it acts like one.

An accelerometer feels gravity only as what it does not feel. Where gravity is the model's plus d, the specific force is
smaller by d along n, and a filter that knows nothing of it takes d for an acceleration. Masses under the ground make d;
along a track it is correlated over a distance and not over a time, with the same correlation at every speed, and it is
constant at rest:

    d' = -|v_h|/D d + w,   phi = exp(-|v_h| dt/D)   over a step, v_h the horizontal velocity

a Gauss-Markov process of first order in distance for each component (Jordan 1972; Nash and Jordan 1978). Its horizontal
components are deflections of the vertical times gravity, its vertical one is the gravity disturbance.
"""

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Float64

from gmwm_jax._internal.checks import as_float, concrete, positive
from gmwm_jax._internal.host import known, namespace
from gmwm_jax._internal.states import register
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.imu.channels import GRAVITY, SensorState


class GravityDisturbance(eqx.Module):
    """Deflections of the vertical and the gravity disturbance, Gauss-Markov in the distance travelled.

    Parameters
    ----------
    deflection
        Standard deviation of the deflections in rad, one number or two (north, east); 4 to 8 arcsec in most places.
    anomaly
        Standard deviation of the disturbance along down in m/s^2; 20 to 40 mGal in most places.
    distance
        Over which they are correlated, m, one number or three (north, east, down); 20 to 60 km in most places.

    Raises
    ------
    ValueError
        A negative standard deviation, a distance that is not positive, another number of them.

    Notes
    -----
    Components are along n, those of the origin: at a distance that tilts local axes by an angle, they are mixed by it.

    Examples
    --------
    >>> arcsec, mgal = np.deg2rad(1 / 3600), 1e-5
    >>> field = nj.imu.GravityDisturbance(deflection=6 * arcsec, anomaly=30 * mgal, distance=30e3)
    >>> errors = nj.ImuErrors("WN(sigma2=1e-4)", "WN(sigma2=1e-8)", rate=20.0, gravity=field)
    >>> [str(state) for state in errors.states]
    ['gravity n disturbance', 'gravity e disturbance', 'gravity d disturbance']
    """

    sd: Float[Array, "3"]
    """m/s^2, in n."""
    distance: Float[Array, "3"]
    present: tuple[bool, ...] = eqx.field(static=True)
    """Of each component: may it be other than zero?"""

    def __init__(self, *, deflection: Any = 0.0, anomaly: Any = 0.0, distance: Any):
        given = {"deflection": (deflection, 2), "anomaly": (anomaly, 1), "distance": (distance, 3)}
        for name, (value, size) in given.items():
            positive(f"GravityDisturbance: {name}", value, zero_ok=name != "distance")
            if np.shape(value) not in ((), (size,)):
                numbers = "one number" if size == 1 else f"one number or {size}"
                raise ValueError(f"GravityDisturbance: {name} is {numbers}, and is {value!r}.")
        of_plumb, of_size, length = known(*(as_float(value) for value, _ in given.values()))
        xp = namespace(of_plumb, of_size)
        level = STANDARD_GRAVITY * xp.broadcast_to(of_plumb, (2,))
        self.sd = as_float(xp.concatenate([level, xp.broadcast_to(of_size, (1,))]))
        self.distance = as_float(namespace(length).broadcast_to(length, (3,)))
        seen = concrete(self.sd)
        self.present = (True,) * 3 if seen is None else tuple(bool(s) for s in seen > 0)

    @property
    def axes(self) -> tuple[int, ...]:
        """The components that may be other than zero."""
        return tuple(i for i in range(3) if self.present[i])

    @property
    def states(self) -> tuple[SensorState, ...]:
        """One for each of `axes`."""
        return tuple(SensorState(GRAVITY[i], "disturbance") for i in self.axes)

    def __repr__(self) -> str:
        sd, distance = concrete(self.sd), concrete(self.distance)
        if sd is None or distance is None:
            return "GravityDisturbance"
        return f"GravityDisturbance: sd {sd} m/s^2 (north, east, down) over {distance} m"


class _State(NamedTuple):
    sd: Float64[np.ndarray, "3"]
    distance: Float64[np.ndarray, "3"]


def _built(state: _State) -> GravityDisturbance:
    return GravityDisturbance(deflection=state.sd[:2] / STANDARD_GRAVITY, anomaly=state.sd[2], distance=state.distance)


register(GravityDisturbance, _State, lambda g: _State(np.asarray(g.sd), np.asarray(g.distance)), _built)
