"""Reference motions with exact derivatives: functions of time, differentiated by JAX.

Each generator samples its path at ``rate`` Hz over ``duration`` s. The annotation of a parameter says what it measures;
configuration files take its unit from there, and know the generators that stand in `GENERATORS`. Attitude follows from
the motion or is given:

- ``"coordinated"``: the nose along the velocity, and the wings banked until the specific force has no lateral
  component, as in a turn without slip. Vertical flight and loops are no special case.
- ``"level"``: the nose along the horizontal velocity, roll and pitch zero.
- an array: roll, pitch, yaw in rad, one for all epochs (3,) or one each (N+1, 3).
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import make_interp_spline

from gmwm_jax._internal.checks import as_float, number, real_array, require_x64, sampling_rate
from gmwm_jax._internal.compiling import compiled_quickly
from gmwm_jax._internal.memory import FLOAT, require_memory
from gmwm_jax._internal.programs import bounded
from gmwm_jax._internal.typing import Real
from gmwm_jax.units import STANDARD_GRAVITY
from nav_jax.trajectory.attitudes import attitude_of_navigation, coordinated_attitude
from nav_jax.trajectory.trajectory import Trajectory

Path = Callable[..., Float[Array, "3 epochs"]]

Seconds = Annotated[Real, "s"]
Metres = Annotated[Real, "m"]
MetresPerSecond = Annotated[Real, "m/s"]
MetresPerSecondSquared = Annotated[Real, "m/s^2"]
Radians = Annotated[Real, "rad"]
Attitude = str | Sequence[Radians] | np.ndarray

_PER_EPOCH = 56
"""Numbers in memory for each epoch while a motion is made, measured: time, position, velocity, acceleration and
attitude, their checked copies, and the derivatives on the way."""

_ENDS = 1e-6
"""Fraction of a sample by which the duration may miss a whole number of them."""


def from_path(
    path: Path,
    *parameters: Any,
    duration: Seconds,
    rate: Real,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "",
) -> Trajectory:
    """Sample any path that is a JAX function of time.

    Parameters
    ----------
    path
        ``path(time, *parameters)``: times (N+1,) in s -> north, east, down (3, N+1) in m, twice differentiable.
    *parameters
        Numbers that `path` takes.
    duration, rate
        In s and Hz; their product is a whole number of samples.
    attitude
        ``"coordinated"``, ``"level"`` or roll, pitch, yaw in rad, see the file.
    gravity
        In m/s^2, for the bank angle.
    name
        Name of the trajectory.

    Raises
    ------
    ValueError
        Duration, rate or attitude that make no trajectory; an attitude from a motion that stands still.

    Examples
    --------
    >>> def path(t):
    ...     return jnp.stack([10.0 * t, 0.0 * t, -(t**2)])
    >>> nj.motions.from_path(path, duration=10.0, rate=20.0).velocity[-1].round(6).tolist()
    [10.0, 0.0, -20.0]
    """
    time = _times(duration, rate)
    p, v, a = _derivatives(path, time, *map(as_float, parameters))
    return _trajectory(time, np.asarray(p).T, np.asarray(v).T, np.asarray(a).T, attitude, gravity, name)


def lemniscate(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    size: Metres = 50.0,
    period: Seconds = 60.0,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "lemniscate",
) -> Trajectory:
    """Generate a figure of eight, N = size sin wt, E = size sin wt cos wt with w = 2 pi / period, at one height.

    With ``attitude="navigation"`` the attitude is that of ``lemniscate_traj_ned`` of the R package navigation, to
    1e-9 rad in its 600 s: roll -45 deg times the curvature over its maximum (it banks out of the turn, so that the
    specific force is no longer that of a coordinated turn), pitch 20 deg times the absolute curvature, interpolated
    between whole seconds, yaw along the central difference of its positions at 100 Hz. The default is a coordinated
    turn: roll up to 6.7 deg, pitch zero.

    Examples
    --------
    >>> nj.motions.lemniscate(duration=10.0, rate=20.0).time.shape
    (201,)
    """
    w = 2 * np.pi / number("period (s)", period)
    motion = partial(from_path, _lemniscate, number("size (m)", size), w, duration=duration, rate=rate, name=name)
    if isinstance(attitude, str) and attitude == "navigation":
        return motion(attitude=attitude_of_navigation(_times(duration, rate), w))
    return motion(attitude=attitude, gravity=gravity)


def static(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    euler: Sequence[Radians] = (0.0, 0.0, 0.0),
    position: Sequence[Metres] = (0.0, 0.0, 0.0),
    name: str = "static",
) -> Trajectory:
    """Generate a trajectory at rest, with a given roll, pitch, yaw (rad) and north, east, down (m).

    Examples
    --------
    >>> nj.motions.static(duration=10.0, rate=20.0).velocity.max().item()
    0.0
    """
    return from_path(_still, np.asarray(position, float), duration=duration, rate=rate, attitude=euler, name=name)


def straight(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    speed: MetresPerSecond = 10.0,
    heading: Radians = 0.0,
    angle: Radians = 0.0,
    acceleration: MetresPerSecondSquared = 0.0,
    attitude: Attitude = "coordinated",
    name: str = "straight",
) -> Trajectory:
    """Generate a straight line along a heading and climb angle (rad), at a speed (m/s) or accelerated (m/s^2).

    Examples
    --------
    >>> nj.motions.straight(duration=10.0, rate=20.0, speed=3.0).position[-1].round(6).tolist()
    [30.0, 0.0, ...0.0]
    """
    heading, angle, acceleration = (
        number(what, x, negative_ok=True)
        for what, x in (("heading (rad)", heading), ("angle (rad)", angle), ("acceleration (m/s^2)", acceleration))
    )
    level = np.cos(angle)
    direction = np.array([level * np.cos(heading), level * np.sin(heading), -np.sin(angle)])
    parameters = (direction, number("speed (m/s)", speed), acceleration)
    return from_path(_straight, *parameters, duration=duration, rate=rate, attitude=attitude, name=name)


def circle(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    radius: Metres = 100.0,
    speed: MetresPerSecond = 10.0,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "circle",
) -> Trajectory:
    """Generate a horizontal circle, clockwise seen from above, from the origin northwards.

    Examples
    --------
    >>> east = nj.motions.circle(duration=10.0, rate=20.0, radius=100.0, speed=10.0).position[:, 1]
    >>> bool((east[1:] > 0).all())  # northwards, and to the right
    True
    """
    return helix(duration, rate, radius=radius, speed=speed, climb=0.0, attitude=attitude, gravity=gravity, name=name)


def helix(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    radius: Metres = 100.0,
    speed: MetresPerSecond = 10.0,
    climb: MetresPerSecond = 1.0,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "helix",
) -> Trajectory:
    """Generate a circle of a horizontal speed (m/s) that climbs at a constant rate (m/s upwards).

    Examples
    --------
    >>> round(float(nj.motions.helix(duration=10.0, rate=20.0, climb=2.0).position[-1, 2]), 6)
    -20.0
    """
    parameters = (
        number("radius (m)", radius),
        number("speed (m/s)", speed),
        number("climb (m/s)", climb, negative_ok=True),
    )
    return from_path(_helix, *parameters, duration=duration, rate=rate, attitude=attitude, gravity=gravity, name=name)


def climb(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    speed: MetresPerSecond = 20.0,
    climb: MetresPerSecond = 2.0,
    start: Seconds | None = None,
    end: Seconds | None = None,
    ramp: Seconds = 5.0,
    attitude: Attitude = "coordinated",
    name: str = "climb",
) -> Trajectory:
    """Generate a level flight northwards that climbs and levels off again, at constant horizontal speed.

    Parameters
    ----------
    duration, rate
        In s and Hz.
    speed, climb
        Horizontal and vertical (upwards) in m/s.
    start, end
        When the climb begins and when it is over, in s; a quarter and three quarters of the duration unless given.
    ramp
        Seconds in which the rate of climb changes; its acceleration is twice differentiable throughout.
    attitude
        See the file.
    name
        Name of the trajectory.

    Examples
    --------
    >>> nj.motions.climb(duration=60.0, rate=20.0).position[-1, 2] < 0  # down is positive
    np.True_
    """
    begin = 0.25 * duration if start is None else number("start (s)", start, zero_ok=True)
    finish = 0.75 * duration if end is None else number("end (s)", end)
    ramp = number("ramp (s)", ramp)
    if finish - begin < 2 * ramp:
        raise ValueError(f"A climb from {begin:g} to {finish:g} s has no room for two ramps of {ramp:g} s.")
    rates = (number("speed (m/s)", speed), number("climb (m/s)", climb, negative_ok=True))
    return from_path(_climb, *rates, begin, finish, ramp, duration=duration, rate=rate, attitude=attitude, name=name)


def racetrack(
    duration: Seconds = 300.0,
    rate: Real = 100.0,
    *,
    speed: MetresPerSecond = 20.0,
    straight: Seconds = 20.0,
    turn: Seconds = 20.0,
    ramp: Seconds = 5.0,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "racetrack",
) -> Trajectory:
    """Generate a closed track, at first northwards, of two straights and two half turns right at constant speed.

    The turn rate rises and falls smoothly, so that acceleration and its first two derivatives are continuous. Velocity
    and acceleration are exact, and position is their Gauss-Legendre integral to 1e-12 m.

    Parameters
    ----------
    duration, rate
        In s and Hz.
    speed
        In m/s.
    straight, turn
        Seconds on each straight and in each half turn.
    ramp
        Seconds in which the turn rate rises from zero, and in which it falls; at most half of `turn`.
    attitude, gravity, name
        See `from_path`.

    Examples
    --------
    >>> lap = nj.motions.racetrack(duration=80.0, rate=20.0, straight=20.0, turn=20.0)
    >>> bool(abs(lap.position[-1]).max() < 1e-6)
    True
    """
    time = _times(duration, rate)
    speed, straight, turn, ramp = (
        number(f"{what} of the racetrack", x)
        for what, x in (("speed (m/s)", speed), ("straight (s)", straight), ("turn (s)", turn), ("ramp (s)", ramp))
    )
    if 2 * ramp > turn:
        raise ValueError(f"A turn of {turn:g} s has no room for two ramps of {ramp:g} s.")
    parameters = [as_float(x) for x in (speed, straight, turn, ramp)]
    v, a, _ = _derivatives(_racetrack_velocity, time, *parameters)
    node, weight = np.polynomial.legendre.leggauss(6)
    steps = np.diff(time)
    inner = time[:-1, None] + 0.5 * steps[:, None] * (1 + node)
    sampled = np.asarray(_racetrack_velocity(inner.ravel(), *parameters)).reshape(3, *inner.shape)
    moved = 0.5 * steps * (sampled @ weight)
    p = np.concatenate([np.zeros((3, 1)), np.cumsum(moved, axis=1)], axis=1)
    return _trajectory(time, p.T, np.asarray(v).T, np.asarray(a).T, attitude, gravity, name)


def waypoints(
    points: Sequence[Sequence[Metres]] | np.ndarray,
    rate: Real = 100.0,
    *,
    speed: MetresPerSecond | None = None,
    times: Sequence[Seconds] | np.ndarray | None = None,
    attitude: Attitude = "coordinated",
    gravity: MetresPerSecondSquared = STANDARD_GRAVITY,
    name: str = "waypoints",
) -> Trajectory:
    """Generate a spline of degree 5 through given points (3 where there are fewer than 6).

    Parameters
    ----------
    points
        North, east, down in m, shape (K, 3), at least four.
    rate
        In Hz. The last sample is the last of the grid before the last point.
    speed
        In m/s, from which the times of the points follow by the distances between them; or
    times
        of the points in s, shape (K,), increasing.
    attitude, gravity, name
        See `from_path`.

    Raises
    ------
    ValueError
        Fewer than four points, two equal ones in succession, or not exactly one of `speed` and `times`.

    Examples
    --------
    >>> points = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [80.0, 40.0, 0.0], [80.0, 90.0, -5.0]])
    >>> nj.motions.waypoints(points, rate=20.0, times=[0.0, 6.0, 12.0, 18.0]).duration
    18.0
    """
    p = real_array("points", points, (None, 3))
    if len(p) < 4:
        raise ValueError(f"A spline needs at least four waypoints, and there are {len(p)}.")
    if (speed is None) == (times is None):
        raise ValueError("Give either speed=... in m/s or times=... of the waypoints in s.")
    if speed is None:
        t = real_array("times", times, (len(p),))
        t = t - t[0]
    else:
        steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
        t = np.concatenate([[0.0], np.cumsum(steps)]) / number("speed (m/s)", speed)
    if (np.diff(t) <= 0).any():
        i = int((np.diff(t) <= 0).argmax()) + 1
        raise ValueError(f"Waypoint {i} is not later than the one before it, or at the same place.")
    spline = make_interp_spline(t, p, k=5 if len(p) > 5 else 3)
    time = np.arange(np.floor(t[-1] * sampling_rate(rate) + _ENDS) + 1) / rate
    v, a = (spline.derivative(k)(time) for k in (1, 2))
    return _trajectory(time, spline(time), v, a, attitude, gravity, name)


GENERATORS: dict[str, Callable[..., Trajectory]] = {
    f.__name__: f for f in (static, straight, circle, racetrack, climb, helix, lemniscate, waypoints)
}
"""The motions that configuration files know, by name."""


@bounded
@compiled_quickly(static_argnums=(0,))
def _derivatives(path: Path, time: Float[Array, " epochs"], *parameters: Any) -> Any:
    """A path and its first two derivatives; every epoch depends on its own time only."""
    one = jnp.ones_like(time)

    def value(t):
        return path(t, *parameters)

    def with_rate(t):
        return jax.jvp(value, (t,), (one,))

    (p, v), (_, a) = jax.jvp(with_rate, (time,), (one,))
    return p, v, a


def _times(duration: Real, rate: Real) -> np.ndarray:
    require_x64()
    f = sampling_rate(rate)
    samples = number("duration (s)", duration) * f
    count = round(samples)
    if count < 1 or abs(samples - count) > _ENDS:
        raise ValueError(
            f"{duration:g} s at {f:g} Hz are {samples:.6g} samples: the duration is a whole number of them."
        )
    what = f"A trajectory of {duration:g} s at {f:g} Hz"
    require_memory(FLOAT * _PER_EPOCH * count, what, "take a shorter duration or a lower rate")
    return np.arange(count + 1) / f


def _trajectory(time, p, v, a, attitude: Attitude, gravity: Real, name: str) -> Trajectory:
    if not isinstance(attitude, str):
        angles = np.asarray(attitude, dtype=np.float64)
        if angles.shape not in ((3,), p.shape):
            raise ValueError(f"Roll, pitch, yaw have the shape (3,) or {p.shape}, and these {angles.shape}.")
        return Trajectory.from_euler(time, p, np.broadcast_to(angles, p.shape), velocity=v, name=name)
    if attitude == "coordinated":
        return Trajectory(time, p, v, coordinated_attitude(v, a, gravity), name)
    if attitude == "level":
        horizontal = v * np.array([1.0, 1.0, 0.0])
        return Trajectory(time, p, v, coordinated_attitude(horizontal, np.zeros_like(v), 1.0), name)
    raise ValueError(f'attitude is "coordinated", "level" or an array of roll, pitch, yaw, and is {attitude!r}.')


def _rise(u: Float[Array, "..."]) -> Float[Array, "..."]:
    """Integral of the step 10 u^3 - 15 u^4 + 6 u^5 that rises from 0 at u = 0 to 1 at u = 1, and stays there."""
    inside = jnp.clip(u, 0.0, 1.0)
    return inside**4 * (2.5 + inside * (inside - 3.0)) + jnp.maximum(u - 1.0, 0.0)


def _lemniscate(t, size, w):
    return jnp.stack([size * jnp.sin(w * t), size * jnp.sin(w * t) * jnp.cos(w * t), 0.0 * t])


def _still(t, position):
    return position[:, None] + 0.0 * t[None]


def _straight(t, direction, speed, acceleration):
    return direction[:, None] * (speed * t + 0.5 * acceleration * t**2)[None]


def _helix(t, radius, speed, climb):
    angle = speed / radius * t
    return jnp.stack([radius * jnp.sin(angle), radius * (1.0 - jnp.cos(angle)), -climb * t])


def _climb(t, speed, climb, begin, finish, ramp):
    height = climb * ramp * (_rise((t - begin) / ramp) - _rise((t - finish + ramp) / ramp))
    return jnp.stack([speed * t, 0.0 * t, -height])


@jax.jit
def _racetrack_velocity(t, speed, straight, turn, ramp):
    """Velocity of a racetrack: its heading turns by pi in every half round."""
    half = straight + turn
    rounds = jnp.floor(t / half)
    u = t - rounds * half - straight
    ramps = _rise(u / ramp) - _rise((u - turn + ramp) / ramp)
    heading = jnp.pi * (rounds + ramps * ramp / (turn - ramp))
    return speed * jnp.stack([jnp.cos(heading), jnp.sin(heading), 0.0 * t])
