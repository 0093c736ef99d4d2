"""What aiding sensors measure and how that depends on the error state, scalar under scalar.

Where all sensors are linear their derivative is one constant, over the errors of navigation only. Else it is taken at
the estimate (or along the reference) at every event, over the whole error state: what a sensor states of it or what
autodiff finds, along the errors of navigation, of the sensor's own states, and, through the compensated specific force
and body rate, of the states of the IMU. Where the Earth turns, the body rate relative to it depends on the attitude,
by C' (psi x w), which is added to what a sensor makes of the body rate.

Correlated components are decorrelated by the Cholesky factor of their covariance, so that a filter may take them one
after the other.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Float

from nav_jax.aiding.base import AbstractAiding, Window
from nav_jax.aiding.states import OwnStates
from nav_jax.filter.ekf import inject
from nav_jax.filter.layout import ATTITUDE, JUDGED, NAVIGATION, Block, Layout
from nav_jax.filter.timeline import Timeline
from nav_jax.imu.bank import SensorBank, with_errors
from nav_jax.imu.channels import CHANNELS
from nav_jax.kinematics.earth import EarthInLoops
from nav_jax.kinematics.rotation import cross, rotate_back
from nav_jax.kinematics.state import BodyMotion, NavState, body_motion

Sensors = tuple[AbstractAiding, ...]

_FORCE, _RATE = (JUDGED.block(name).components for name in ("accel", "gyro"))


class Partials(NamedTuple):
    """Derivatives of K scalars."""

    navigation: Float[Array, "K nav #R"]
    own: Float[Array, "K A #R"]
    """By the states of all aiding sensors."""
    body: Float[Array, "K ch #R"]
    """By the specific force and the body rate."""


class Measurements(eqx.Module):
    """All aiding sensors of a run: K scalars."""

    sensors: Sensors
    own: OwnStates
    earth_rate: Float[Array, "3 1"] | None
    """In n, rad/s; None where the Earth does not turn."""
    earth: EarthInLoops | None = None
    """Needed where a sensor wants means, for the acceleration in n."""

    @property
    def linear(self) -> bool:
        """Is the derivative one constant?"""
        return all(s.linear for s in self.sensors)

    @property
    def uses_body(self) -> bool:
        """Does a sensor depend on the motion of the body?"""
        return any(s.uses_body for s in self.sensors)

    @property
    def windows(self) -> tuple[Window, ...]:
        """Over which sensors want means, one sensor after the other."""
        return tuple(w for s in self.sensors for w in s.windows)

    @property
    def counts(self) -> Float[np.ndarray, " W"]:
        """Samples in each."""
        return np.array([w.count(self.own.rate) for w in self.windows])

    @property
    def variance(self) -> Float[Array, " K"]:
        """What the filter believes of each scalar."""
        return jnp.concatenate([jnp.zeros(0), *(s.believed**2 for s in self.sensors)])

    def constant(self) -> Float[Array, "K nav 1"] | None:
        """The derivative over the errors of navigation where it is one constant, else None."""
        if not self.linear:
            return None
        none = jnp.zeros((0, NAVIGATION.size, 1))
        return jnp.concatenate([none, *(decorrelated(s, _stated(s, NAVIGATION)) for s in self.sensors)])

    def predict(
        self,
        state: NavState,
        reading: Float[Array, "seen R"] | None,
        means: Float[Array, "W seen R"] | None = None,
    ) -> Float[Array, "K R"]:
        """What is measured without noise.

        Parameters
        ----------
        state
            With all sensor states of the filter.
        reading
            Of the IMU, compensated; None if no sensor uses the motion of the body.
        means
            Of readings in the `windows`, compensated; None if there are none.
        """
        none = jnp.zeros((0, state.p.shape[1]))
        seen = [
            decorrelated(s, s.predict(self.seen_by(i, state), self.body(i, state, reading, means)))
            for i, s in enumerate(self.sensors)
        ]
        return jnp.concatenate([none, *seen])

    def seen_by(self, sensor: int, state: NavState) -> NavState:
        """The state as a sensor sees it, with its own states only."""
        return state._replace(x=self.own.values(state.x, sensor))

    def partials(
        self,
        state: NavState,
        reading: Float[Array, "seen R"] | None,
        means: Float[Array, "W seen R"] | None = None,
    ) -> Partials:
        """Derivatives at a state; parameters as of `predict`."""
        num_runs, num_own = state.p.shape[1], self.own.readout.shape[0]
        parts = [jnp.zeros((0, NAVIGATION.size + num_own + len(CHANNELS), num_runs))]
        for i, sensor in enumerate(self.sensors):
            a, b = self.own.rows[i]
            layout, body = layout_of(sensor), self.body(i, state, reading, means)
            H = sensor.jacobian(self.seen_by(i, state), body, layout)
            H = derived(sensor, self.seen_by(i, state), body) if H is None else H
            H = jnp.broadcast_to(decorrelated(sensor, H), (*H.shape[:2], num_runs))
            whole = jnp.zeros((H.shape[0], num_own, num_runs)).at[:, a:b].set(H[:, layout["own"]])
            parts.append(jnp.concatenate([H[:, : NAVIGATION.size], whole, H[:, layout["force"].start :]], axis=1))
        found = jnp.concatenate(parts)
        n = NAVIGATION.size
        navigation, own, of_body = found[:, :n], found[:, n : n + num_own], found[:, n + num_own :]
        if reading is not None and self.earth_rate is not None:
            axes = jnp.eye(3)[:, :, None]
            turned = jnp.stack([rotate_back(state.q, cross(psi, self.earth_rate)) for psi in axes], axis=1)
            navigation = navigation.at[:, ATTITUDE].add(jnp.einsum("kir,ijr->kjr", of_body[:, 3:], turned))
        return Partials(navigation, own, of_body)

    def over_state(
        self, partials: Partials, bank: SensorBank, reading: Float[Array, "seen _"] | None
    ) -> Float[Array, "K n R"]:
        """Derivatives along the error state of a filter with these states, the aiding sensors' own ones last.

        `reading` is that of the IMU, where the effect of states depends on it.
        """
        states = bank.states[: len(bank.states) - self.own.size]
        channels = jnp.array([s.channel if s.is_of_imu else 0 for s in states], dtype=int)
        felt = np.array([[float(s.is_of_imu)] for s in states]).reshape(-1, 1)
        # what the filter takes for an error of the IMU it takes off the motion of the body
        imu = -partials.body[:, channels] * (felt * bank.readout_at(reading)[: len(states)])[None]
        own = jnp.einsum("kar,as->ksr", partials.own, self.own.readout)
        return jnp.concatenate([partials.navigation, imu, own], axis=1)

    def derivative(
        self,
        state: NavState,
        reading: Float[Array, "seen R"] | None,
        bank: SensorBank,
        means: Float[Array, "W seen R"] | None = None,
    ) -> Float[Array, "K n R"]:
        """Derivatives at a state, along the error state; parameters as of `predict`."""
        return self.over_state(self.partials(state, reading, means), bank, reading)

    def body(
        self,
        sensor: int,
        state: NavState,
        reading: Float[Array, "seen R"] | None,
        means: Float[Array, "W seen R"] | None,
    ) -> BodyMotion | None:
        """The motion of the body as a sensor sees it."""
        if reading is None:
            return None
        now, first = body_motion(reading, state.q, self.earth_rate), sum(len(s.windows) for s in self.sensors[:sensor])
        last = first + len(self.sensors[sensor].windows)
        if first == last or means is None or self.earth is None:
            return now
        both = [jnp.concatenate(body_motion(m, state.q, self.earth_rate)[:2]) for m in means[first:last]]
        fall = self.earth.gravity(state.p, state.v, jnp.zeros(()), None)
        if self.earth_rate is not None:
            fall = fall - 2 * cross(self.earth_rate, state.v)
        return now._replace(means=jnp.stack(both), fall=fall)


def measurements(timeline: Timeline, sensors: Sensors, *, drawn: bool = False) -> Measurements:
    """What sensors measure in a run, with the states that filters have, or with those that are there (drawn)."""
    own, earth = timeline.drawn if drawn else timeline.own, timeline.earth
    return Measurements(sensors, own, earth.rate, None if timeline.means is None else earth)


def compensated_means(
    means: Float[Array, "W seen"] | None,
    errors: Float[Array, "W ch R"] | None,
    bank: SensorBank,
    x: Float[Array, "M R"],
) -> Float[Array, "W seen R"] | None:
    """Means of readings without the errors that a filter estimates, from those of perfect ones and their errors."""
    if means is None:
        return None
    given = means[:, :, None] if errors is None else with_errors(means[:, :, None], errors)
    return jnp.stack([bank.compensated(m, x) for m in given])


def layout_of(sensor: AbstractAiding) -> Layout:
    """The error vector of which a sensor states derivatives."""
    own = Block("own", tuple(s.name for s in sensor.states), "SI")
    return NAVIGATION.followed_by(own, Block("force", _FORCE, "m/s^2", "b"), Block("rate", _RATE, "rad/s", "b"))


def derived(sensor: AbstractAiding, state: NavState, body: BodyMotion | None) -> Float[Array, "K n R"]:
    """The derivative by autodiff, over `layout_of` a sensor; `state` as it sees it."""
    layout = layout_of(sensor)
    zero = jnp.zeros((layout.size, state.p.shape[1]))
    n = layout["own"].stop

    def h(c: Array) -> Array:
        moved = body and body.moved(c[layout["force"]], c[layout["rate"]])
        return sensor.predict(inject(state, c[:n]), moved)

    def along(direction: Array) -> Array:
        return jax.jvp(h, (zero,), (jnp.broadcast_to(direction[:, None], zero.shape),))[1]

    return jax.vmap(along, out_axes=1)(jnp.eye(layout.size))


def decorrelated(sensor: AbstractAiding, x: Float[Array, "K *R"]) -> Float[Array, "K *R"]:
    """Components of a sensor, or derivatives of them, as the scalars that a filter takes."""
    if sensor.mixing is None:
        return x
    return solve_triangular(sensor.mixing, x.reshape(x.shape[0], -1), lower=True).reshape(x.shape)


def whitened(W: Float[Array, "K K"] | None, x: Float[Array, "K *R"]) -> Float[Array, "K *R"]:
    """Scalars, or derivatives of them, of an event with a noise of its own; W of None leaves them as they are."""
    return x if W is None else jnp.einsum("kl,l...->k...", W, x)


def _stated(sensor: AbstractAiding, layout: Layout) -> Float[Array, "K n 1"]:
    """The derivative of a linear sensor."""
    H = sensor.jacobian(None, None, layout)  # type: ignore[arg-type]
    if H is None or H.shape[2:] != (1,):
        raise ValueError(f"{sensor.name} says that it is linear: its derivative must be one constant, (K, n, 1).")
    return H
