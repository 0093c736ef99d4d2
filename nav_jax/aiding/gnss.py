"""GNSS: fixes of position and of velocity, with what a filter may estimate of the receiver.

With the antenna at l in b, a receiver whose clock makes the fix of t one of t + tau, and errors d that change slowly:

    z_p = p + C l + (v + C (w x l)) tau + d_p
    z_v = v + C (w x l) + (a + C (w x (w x l))) tau + d_v

where w is the body rate and a the acceleration in n, C f + g - 2 w_ie x v. What multiplies tau has to be known better
than from one sample of the IMU: with a vibration in it the estimated tau is too small by one plus the ratio of the
powers of vibration and motion. f and w are hence means over `_CALM`, or over the interval of which a velocity is the
mean.

Receivers that difference carrier phases, and programs such as RTKLIB, give for a velocity the mean over the past T:

    z_v = (r(t) - r(t - T))/T,  r = p + C l

which is v - T/2 a for an acceleration that is weighted with what has passed of the interval, by 2 u/T^2 at t - T + u:
exactly, whatever the motion. So no buffer of states is needed, and the derivative along attitude and accelerometer
biases is that of the measurement. (The velocity of half an interval ago, with an even mean of the acceleration, is off
by T^2/12 times the jerk.)
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Float, Float64

from gmwm_jax._internal.checks import as_float, concrete, number
from gmwm_jax._internal.states import register
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.base import AbstractAiding, Setting, Window, lever, noises, spread, timing
from nav_jax.aiding.states import OwnState, own_state, own_states_of
from nav_jax.imu.noise_models import NoiseModel
from nav_jax.kinematics.geodetic import ned_from_geodetic
from nav_jax.kinematics.reference import ReferenceMotion
from nav_jax.kinematics.rotation import cross, dcm_from_quat, matvec, quat_from_rotvec, rotate
from nav_jax.trajectory.columns import POSITION, VELOCITY

_CALM = 0.2
"""s, over which the motion is smoothed: several periods of engines and roads, a fraction of a manoeuvre."""

_NED = ("n", "e", "d")


class AbstractReceiver(AbstractAiding):
    """What `GnssPosition`, `GnssVelocity` and `Gnss` have in common: an antenna, a clock, and errors that last."""

    parts: ClassVar[tuple[str, ...]]
    """``position``, ``velocity``, or both."""
    default_name: ClassVar[str]

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, " K"]
    factor: Float[Array, "K K"] | None
    """Cholesky factor of the covariance."""
    lever_arm: Float[Array, "3"] | None
    arm_states: tuple[OwnState, ...]
    """Errors of the lever arm x, y, z, if it is not known."""
    clock: OwnState | None
    """tau."""
    drifts: tuple[OwnState, ...]
    """Errors that last, of some or all of the components."""
    drifting: eqx.AbstractVar[tuple[int, ...]]
    """Which."""
    averaged: eqx.AbstractVar[float]
    rate: eqx.AbstractVar[float]
    first: eqx.AbstractVar[float]
    outages: eqx.AbstractVar[tuple[tuple[float, float], ...]]
    name: eqx.AbstractVar[str]

    @property
    def linear(self) -> bool:
        """Unless there is a lever arm, something to be estimated, or an age."""
        return self.lever_arm is None and not self.states and not self.averaged

    @property
    def uses_body(self) -> bool:
        """An antenna on an arm moves with the body rate, and at another time it is where the body goes."""
        on_arm = self.lever_arm is not None or bool(self.arm_states)
        return bool(self.windows) or ("velocity" in self.parts and on_arm)

    @property
    def windows(self) -> tuple[Window, ...]:
        """For a time offset and for the age of a velocity: even weights, and for the age growing ones too."""
        T = self.averaged
        if not T:
            return () if self.clock is None else (Window(-_CALM / 2, _CALM / 2),)
        spare = max(_CALM - T, 0.0) / 2  # about the middle of the interval
        return (Window(-T - spare, spare), Window(-T, 0.0, rises=True), Window(-T, 0.0))

    @property
    def states(self) -> tuple[OwnState, ...]:
        """Lever arm, time offset, and errors that last, those of them that are not known."""
        return (*self.arm_states, *(() if self.clock is None else (self.clock,)), *self.drifts)

    @property
    def mixing(self) -> Float[Array, "K K"] | None:
        """See `AbstractAiding`."""
        return self.factor

    def predict(self, state, body):  # noqa: D102
        arm, late, drift = self._own(state.x)
        motion: Any = body  # which a sensor with windows is always given
        moved, turned = state, arm
        if late is not None:
            a = motion.acceleration(state.q, 0)
            moved = state._replace(p=state.p + late * (state.v + late / 2 * a), v=state.v + late * a)
            turned = None if arm is None else rotate(quat_from_rotvec(late * motion.means[0, 3:]), arm)
        seen = []
        if "position" in self.parts:
            seen.append(moved.p if turned is None else moved.p + rotate(state.q, turned))
        if "velocity" in self.parts:
            seen.append(self._velocity(moved, body, arm, late))
        return jnp.concatenate(seen) + drift

    def _velocity(self, state: Any, body: Any, arm: Any, late: Any) -> Float[Array, "3 R"]:
        """Of the antenna, or its mean over the past interval."""
        T, v = self.averaged, state.v
        if T:
            v = v - T / 2 * body.acceleration(state.q, 1)
        if arm is None or body is None:
            return v
        # the arm where it was a while ago
        swept = (arm - rotate(quat_from_rotvec(-T * body.means[2, 3:]), arm)) / T if T else cross(body.rate, arm)
        if late is not None:
            swept = rotate(quat_from_rotvec(late * body.means[0, 3:]), swept)
        return v + rotate(state.q, swept)

    def emulate(
        self, track: ReferenceMotion, time: Float[Array, " F"], x: Float[Array, "F a _"]
    ) -> Float[Array, "K F R"] | None:
        """What is measured where the fix is late or the velocity a mean: from the reference at the times that count."""
        if not self.windows:
            return None
        arm, late, drift = self._own(jnp.moveaxis(x, 1, 0))
        now = time[:, None] + (0.0 if late is None else late[0])

        def antenna(t: Array) -> Array:
            there = track.at(t)
            return there.p if arm is None else there.p + rotate(there.q, arm)

        seen = [antenna(now)] if "position" in self.parts else []
        if "velocity" in self.parts:
            there, T = track.at(now), self.averaged
            if T:
                seen.append((antenna(now) - antenna(now - T)) / T)
            elif arm is None:
                seen.append(there.v)
            else:
                seen.append(there.v + rotate(there.q, cross(there.rate, arm)))
        return jnp.concatenate(seen) + drift

    def _own(self, x: Float[Array, "a *R"]) -> tuple[Array | None, Array | None, Array | float]:
        """Lever arm (3, ...), time offset (1, ...) and what drifts, (K, ...) or 0, from the states of its own."""
        rest = (1,) * (x.ndim - 1)
        known = None if self.lever_arm is None else self.lever_arm.reshape(3, *rest)
        n = len(self.arm_states)
        arm = known if not n else x[:n] + (0.0 if known is None else known)
        late = None if self.clock is None else x[n : n + 1]
        if not self.drifts:
            return arm, late, 0.0
        slow = jnp.zeros((len(self.noise), *x.shape[1:])).at[jnp.array(self.drifting)].set(x[-len(self.drifts) :])
        return arm, late, slow


class AbstractNed(AbstractReceiver):
    """Fixes in north, east, down.

    A receiver has one antenna and one clock. Where it gives position and velocity at once, `Gnss` has both, with one
    lever arm and one time offset to be estimated; two sensors have such errors each for itself, as two receivers do.

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
    lever_arm_sd
        Standard deviations in m of its error, one number or three: constant, drawn for every run, and estimated.
    time_offset_sd
        Standard deviation in s of a constant time offset, drawn for every run and estimated: a fix that says t is of
        t + tau. Known offsets are taken off the times.
    drift
        A model of errors that change slowly, such as ``"GM(beta=0.01, variance=0.25)"``, per sample at `rate`, beside
        the noise: drawn for each axis, and estimated. One for all axes, or (horizontal, vertical), or one each.
    averaged
        Interval in s of which a velocity is the mean: it then ends at the time of the fix. Of a moment unless given.
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
        not at all, or is believed twice; a drift that is no Markov process; an interval of a position.
    """

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "3"]
    factor: Float[Array, "3 3"] | None
    lever_arm: Float[Array, "3"] | None
    arm_states: tuple[OwnState, ...]
    clock: OwnState | None
    drifts: tuple[OwnState, ...]
    averaged: float = eqx.field(static=True)
    """s; 0 for a moment."""
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
        lever_arm_sd: Any = 0.0,
        time_offset_sd: Any = 0.0,
        drift: Any = None,
        averaged: Real = 0.0,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str | None = None,
    ):
        self.name = self.default_name if name is None else name
        self.rate, self.first, self.outages = timing(self.name, rate, first, outages)
        self.lever_arm, self.arm_states = (
            lever(self.name, lever_arm),
            own_states_of(self.name, "lever_arm", "m", "xyz", lever_arm_sd),
        )
        self.clock = own_state("time_offset", "s", time_offset_sd)
        self.averaged = _interval(self.name, averaged)
        if self.averaged and "velocity" not in self.parts:
            raise ValueError(f"{self.name}: averaged is the interval of which a velocity is the mean; leave it out.")
        self.drifts = _drifts(self.name, "drift", self.unit, drift)
        given = (("horizontal", horizontal), ("vertical", vertical))
        self.noise, self.believed, self.factor = _noise(self.name, given, _AXES, covariance, believed)

    @property
    def axes(self) -> tuple[str, ...]:
        """North, east, down."""
        return _NED

    @property
    def drifting(self) -> tuple[int, ...]:
        """All components, or none."""
        return (0, 1, 2)


def _settings(unit: str, **more: Setting) -> Mapping[str, Setting]:
    noise = Setting(unit, or_model=True, required=True)
    return {
        "horizontal": noise, "vertical": noise, "believed": Setting(unit, (2, 3)), "lever_arm": Setting("m", (3,)),
        "lever_arm_sd": Setting("m", (1, 3)), "time_offset_sd": Setting("s"),
        "drift": Setting(unit, (1, 2, 3), or_model=True), **more,
    }  # fmt: skip


class GnssPosition(AbstractNed):
    """A GNSS receiver's fixes of position in m: north, east, down. The parameters are those of `AbstractNed`.

    Examples
    --------
    >>> gnss = nj.GnssPosition(rate=1.0, horizontal=0.1, vertical=0.2, outages=[(5.0, 8.0)])
    >>> gnss.available(np.arange(4.0, 10.0)).tolist()
    [True, False, False, False, False, True]
    >>> slow = nj.GnssPosition(horizontal=0.1, vertical=0.2, lever_arm_sd=0.05, drift="GM(beta=0.01, variance=0.25)")
    >>> [state.name for state in slow.states]
    ['lever_arm x', 'lever_arm y', 'lever_arm z', 'drift n', 'drift e', 'drift d']
    """

    parts: ClassVar[tuple[str, ...]] = ("position",)
    unit: ClassVar[str] = "m"
    settings: ClassVar[Mapping[str, Setting]] = _settings("m")
    default_name: ClassVar[str] = "gnss_position"

    def jacobian(self, state, body, layout):  # noqa: D102
        if self.states:
            return None
        if self.lever_arm is None:
            return jnp.zeros((3, layout.size, 1)).at[:, layout["position"], 0].set(jnp.eye(3))
        # the arm turns with the attitude: psi x (C l)
        arm = matvec(dcm_from_quat(state.q), jnp.asarray(self.lever_arm)[:, None])
        turned = jnp.stack([cross(jnp.eye(3)[:, i, None], arm) for i in range(3)], axis=1)
        H = jnp.zeros((3, layout.size, arm.shape[1])).at[:, layout["position"]].set(jnp.eye(3)[:, :, None])
        return H.at[:, layout["attitude"]].set(turned)

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

    parts: ClassVar[tuple[str, ...]] = ("velocity",)
    unit: ClassVar[str] = "m/s"
    settings: ClassVar[Mapping[str, Setting]] = _settings("m/s", averaged=Setting("s"))
    default_name: ClassVar[str] = "gnss_velocity"

    def jacobian(self, state, body, layout):  # noqa: D102
        if not self.linear:
            return None
        return jnp.zeros((3, layout.size, 1)).at[:, layout["velocity"], 0].set(jnp.eye(3))

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        if geodetic:
            raise ValueError("Velocities have no origin: leave origin out.")
        return VELOCITY


class Gnss(AbstractReceiver):
    """A receiver's fixes of position and velocity at once, with one antenna and one clock.

    Parameters
    ----------
    rate, horizontal, vertical, lever_arm, lever_arm_sd, time_offset_sd, drift, outages, first, name
        See `GnssPosition`; the drift is that of the positions.
    horizontal_velocity, vertical_velocity
        Noise of the velocities: a standard deviation in m/s (white), or a model per sample at `rate`.
    covariance
        Instead of the noise of both a covariance (6, 6), positions first.
    averaged
        Interval in s before the fix, of which the velocity is the mean; of a moment unless given.
    drift_velocity
        As `drift`, of the velocities.
    believed
        Standard deviations that the filter believes, of (horizontal, vertical, horizontal velocity, vertical velocity)
        or of all six components; those of the noise if not given.

    Raises
    ------
    ValueError
        As of `GnssPosition`.

    Examples
    --------
    >>> rtk = nj.Gnss(4.0, horizontal=0.02, vertical=0.03, horizontal_velocity=0.05, vertical_velocity=0.08,
    ...               lever_arm=(0.0, 0.0, -1.2), lever_arm_sd=0.05, time_offset_sd=0.1, averaged=0.25)
    >>> [state.name for state in rtk.states]
    ['lever_arm x', 'lever_arm y', 'lever_arm z', 'time_offset']
    """

    parts: ClassVar[tuple[str, ...]] = ("position", "velocity")
    unit: ClassVar[str] = "m, m/s"
    settings: ClassVar[Mapping[str, Setting]] = _settings(
        "m",
        horizontal_velocity=Setting("m/s", or_model=True, required=True),
        vertical_velocity=Setting("m/s", or_model=True, required=True),
        averaged=Setting("s"),
        drift_velocity=Setting("m/s", (1, 2, 3), or_model=True),
        believed=Setting("1", (4, 6)),
    )
    default_name: ClassVar[str] = "gnss"

    noise: tuple[NoiseModel, ...]
    believed: Float[Array, "6"]
    factor: Float[Array, "6 6"] | None
    lever_arm: Float[Array, "3"] | None
    arm_states: tuple[OwnState, ...]
    clock: OwnState | None
    drifts: tuple[OwnState, ...]
    drifting: tuple[int, ...] = eqx.field(static=True)
    averaged: float = eqx.field(static=True)
    """s; 0 for a moment."""
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
        horizontal_velocity: Any = None,
        vertical_velocity: Any = None,
        covariance: Any = None,
        lever_arm: Any = None,
        lever_arm_sd: Any = 0.0,
        time_offset_sd: Any = 0.0,
        drift: Any = None,
        averaged: Real = 0.0,
        drift_velocity: Any = None,
        outages: Sequence[Sequence[Real]] = (),
        first: Real | None = None,
        believed: Any = None,
        name: str | None = None,
    ):
        self.name = self.default_name if name is None else name
        self.rate, self.first, self.outages = timing(self.name, rate, first, outages)
        self.lever_arm, self.arm_states = (
            lever(self.name, lever_arm),
            own_states_of(self.name, "lever_arm", "m", "xyz", lever_arm_sd),
        )
        self.clock = own_state("time_offset", "s", time_offset_sd)
        self.averaged = _interval(self.name, averaged)
        both = (
            _drifts(self.name, "drift", "m", drift),
            _drifts(self.name, "drift_velocity", "m/s", drift_velocity),
        )
        self.drifts = tuple(d for drifts in both for d in drifts)
        self.drifting = tuple(3 * i + k for i, drifts in enumerate(both) for k in range(len(drifts)))
        given = (
            ("horizontal", horizontal),
            ("vertical", vertical),
            ("horizontal_velocity", horizontal_velocity),
            ("vertical_velocity", vertical_velocity),
        )
        groups = (*_AXES, ("v_n", "v_e"), ("v_d",))
        self.noise, self.believed, self.factor = _noise(self.name, given, groups, covariance, believed)

    @property
    def axes(self) -> tuple[str, ...]:
        """North, east, down, and those of the velocity."""
        return (*_NED, *(f"v_{axis}" for axis in _NED))

    def jacobian(self, state, body, layout):  # noqa: D102
        if not self.linear:
            return None
        H = jnp.zeros((6, layout.size, 1)).at[:3, layout["position"], 0].set(jnp.eye(3))
        return H.at[3:, layout["velocity"], 0].set(jnp.eye(3))

    def columns(self, *, geodetic: bool) -> Sequence[str]:  # noqa: D102
        return (*POSITION["geodetic" if geodetic else "ned"], *VELOCITY)

    def measured(self, values, origin):  # noqa: D102
        if origin is None:
            return values
        return np.concatenate([ned_from_geodetic(values[:, :3], origin), values[:, 3:]], axis=1)


_AXES = (("n", "e"), ("d",))


def _noise(
    name: str,
    given: Sequence[tuple[str, Any]],
    groups: Sequence[Sequence[str]],
    covariance: Any,
    believed: Any,
) -> tuple[tuple[NoiseModel, ...], Float[Array, " K"], Float[Array, "K K"] | None]:
    """Emulated noise, standard deviations that are believed, and the factor of a covariance."""
    if covariance is None:
        if missing := [argument for argument, value in given if value is None]:
            raise ValueError(
                f"{name}: give its noise as {' and '.join(argument for argument, _ in given)}, or as a covariance; "
                f"{missing[0]} is missing."
            )
        sd = None if believed is None else spread(name, believed, groups)
        each = [value for (_, value), group in zip(given, groups, strict=True) for _ in group]
        return (*noises(name, each, sd), None)
    if believed is not None or any(value is not None for _, value in given):
        raise ValueError(f"{name}: a covariance is the noise, and what is believed of it; give nothing else.")
    size = sum(map(len, groups))
    return (*noises(name, (1.0,) * size, None), _factor(name, covariance, size))


def _drifts(name: str, what: str, unit: str, given: Any) -> tuple[OwnState, ...]:
    """Errors that last, of north, east, down."""
    if given is None:
        return ()
    several = list(given) if isinstance(given, list | tuple) else [given]
    each = {1: [*several] * 3, 2: [several[0], *several], 3: several}.get(len(several))
    if each is None or any(isinstance(model, int | float) for model in several):
        raise ValueError(
            f"{name}: {what} is a model, one for all axes, (horizontal, vertical) or one each, and this is {given!r}."
        )
    return tuple(OwnState(f"{what} {axis}", unit, noise=model) for axis, model in zip(_NED, each, strict=True))


def _interval(name: str, averaged: Real) -> float:
    return float(number(f"{name}: averaged", averaged, zero_ok=True))


def _factor(name: str, covariance: Any, size: int) -> Float[Array, "K K"]:
    """The Cholesky factor of a covariance."""
    C = as_float(covariance)
    seen = concrete(C)
    if C.shape != (size, size):
        raise ValueError(f"{name}: the covariance of its noise is ({size}, {size}), and this one {C.shape}.")
    if seen is not None and not (np.isfinite(seen).all() and np.allclose(seen, seen.T, rtol=1e-9, atol=0)):
        raise ValueError(f"{name}: the covariance of its noise must be finite and symmetric.")
    if seen is not None and np.linalg.eigvalsh(seen).min() <= 0:
        raise ValueError(f"{name}: the covariance of its noise must be positive definite.")
    return jnp.linalg.cholesky(C)


class _State(NamedTuple):
    noise: tuple[NoiseModel, ...]
    believed: Float64[np.ndarray, " K"]
    factor: Float64[np.ndarray, "K K"] | None
    lever_arm: Float64[np.ndarray, "3"] | None
    lever_arm_sd: Float64[np.ndarray, "3"] | None
    time_offset_sd: float
    drift: tuple[NoiseModel, ...]
    drift_velocity: tuple[NoiseModel, ...]
    averaged: float
    rate: float
    first: float
    outages: tuple[tuple[float, float], ...]
    name: str


def _to_state(s: AbstractReceiver) -> _State:
    factor, arm = (None if a is None else np.asarray(a) for a in (s.factor, s.lever_arm))
    drifts = {
        name: tuple(d.noise for d in s.drifts if d.group == name and d.noise is not None)
        for name in ("drift", "drift_velocity")
    }
    return _State(
        noise=s.noise,
        believed=np.asarray(s.believed),
        factor=factor,
        lever_arm=arm,
        lever_arm_sd=np.array([float(a.sd) for a in s.arm_states]) if s.arm_states else None,
        time_offset_sd=0.0 if s.clock is None else float(s.clock.sd),
        **drifts,
        averaged=s.averaged,
        rate=s.rate,
        first=s.first,
        outages=s.outages,
        name=s.name,
    )


def _from_state(cls: type[AbstractReceiver], state: _State) -> AbstractReceiver:
    make: Any = cls
    options: dict[str, Any] = state._asdict()
    if options["lever_arm_sd"] is None:
        del options["lever_arm_sd"]
    for drift in ("drift", "drift_velocity"):
        options[drift] = options[drift] or None
    if "drift_velocity" not in cls.settings:
        del options["drift_velocity"]
    noise, believed, factor = (options.pop(name) for name in ("noise", "believed", "factor"))
    if len(noise) != 3 * len(cls.parts) or any(repr(noise[i]) != repr(noise[i + 1]) for i in range(0, len(noise), 3)):
        raise ValueError(f"{state.name} has one noise of north and another one of east.")
    if factor is None:
        names = ("horizontal", "vertical", "horizontal_velocity", "vertical_velocity")
        each = [noise[i] for k in range(len(cls.parts)) for i in (3 * k, 3 * k + 2)]
        return make(**dict(zip(names, each, strict=False)), believed=believed, **options)
    sensor = make(covariance=factor @ factor.T, **options)
    # to the last bit: a factor of a product is not that of before; a tuning may believe other standard deviations
    return eqx.tree_at(lambda s: (s.factor, s.believed), sensor, (as_float(factor), as_float(believed)))


for _cls in (GnssPosition, GnssVelocity, Gnss):
    register(_cls, _State, _to_state, partial(_from_state, _cls))
