"""A reference trajectory: position, velocity and attitude over time, in the local frame north, east, down."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from gmwm_jax._internal.checks import increasing, number, real_array, require_x64, sampling_rate
from gmwm_jax._internal.drawing import Drawable, Figure, GivenAxes
from gmwm_jax._internal.states import saved
from gmwm_jax._internal.text_table import format_table
from gmwm_jax._internal.typing import Quaternions, Real, Times, Vectors
from nav_jax.kinematics import rotation
from nav_jax.kinematics.geodetic import checked_origin

_NORM_TOLERANCE = 1e-6
_DEGREES = 180 / np.pi
_DEGREE = 5
"""Of smoothing splines: the specific force is then twice differentiable."""

_STILL = 0.2
"""Velocity in m/s that is noise of a reference at rest."""

_GAP = 10.0
"""Usual steps in one from which on interpolation is invention."""

_ON_GRID = 1e-6
"""Fraction of a sample by which a time may miss the grid: what rounding to microseconds leaves."""


@saved(added=("origin",))
@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Drawable):
    """Position, velocity and attitude at N + 1 epochs. Build it with `from_euler`, a reader or a generator.

    Attributes
    ----------
    time
        Seconds, increasing, shape (N+1,).
    position
        North, east, down in m, shape (N+1, 3).
    velocity
        North, east, down in m/s, shape (N+1, 3).
    quaternion
        Unit quaternion q_nb, scalar first, shape (N+1, 4); stored without jumps of sign.
    name
        For tables and figures.
    origin
        Latitude, longitude (rad) and ellipsoidal height (m) of the point where positions are zero, shape (3,); None
        where nobody knows it.

    Raises
    ------
    ValueError
        Shapes that do not match, fewer than two epochs, time that does not increase, NaN or infinite values,
        quaternions that are not of unit length, an origin that is no place on the Earth.

    Examples
    --------
    >>> time = np.arange(0.0, 10.0, 0.1)
    >>> position = np.stack([5.0 * time, 0.0 * time, 0.0 * time], axis=1)
    >>> reference = nj.Trajectory.from_euler(time, position, np.zeros((100, 3)))
    >>> reference.rate, reference.velocity[0].round(6).tolist()
    (10.0, [5.0, 0.0, 0.0])
    """

    time: Times
    position: Vectors
    velocity: Vectors
    quaternion: Quaternions
    name: str = ""
    origin: Float64[np.ndarray, "3"] | None = None

    def __post_init__(self) -> None:
        time = real_array("The time of a trajectory", self.time, (None,))
        increasing("The time of a trajectory", time)
        arrays = {"time": time}
        for field, width in {"position": 3, "velocity": 3, "quaternion": 4}.items():
            arrays[field] = real_array(f"The {field} of a trajectory", getattr(self, field), (len(time), width))
        arrays["quaternion"] = _smooth_unit(arrays["quaternion"])
        if self.origin is not None:
            arrays["origin"] = checked_origin(self.origin)
        for field, value in arrays.items():
            object.__setattr__(self, field, value)

    @classmethod
    def from_euler(cls, time: Any, position: Any, euler: Any, *, velocity: Any = None, name: str = "") -> "Trajectory":
        """Make a trajectory from roll, pitch and yaw.

        Parameters
        ----------
        time
            Seconds, shape (N+1,).
        position
            North, east, down in m, shape (N+1, 3).
        euler
            Roll, pitch, yaw in rad, shape (N+1, 3); wrapped or not, through 90 deg of pitch or not.
        velocity
            North, east, down in m/s, shape (N+1, 3); derivative of a cubic spline through the positions unless given.
        name
            Name of the trajectory.

        Raises
        ------
        ValueError
            See the class; and velocities that are not the rate of the positions.
        """
        require_x64()
        angles = real_array("Roll, pitch, yaw of a trajectory", euler, (None, 3))
        q = np.asarray(rotation.quat_from_euler(angles.T)).T
        return cls.from_quaternion(time, position, q, velocity=velocity, name=name)

    @classmethod
    def from_quaternion(
        cls, time: Any, position: Any, quaternion: Any, *, velocity: Any = None, name: str = ""
    ) -> "Trajectory":
        """Make a trajectory as `from_euler` does, from unit quaternions q_nb, scalar first, shape (N+1, 4)."""
        require_x64()
        t = real_array("The time of a trajectory", time, (None,))
        increasing("The time of a trajectory", t)
        p = real_array("The position of a trajectory", position, (len(t), 3))
        if velocity is None:
            v = _derivative(_spline(t, p), t)
        else:
            v = real_array("The velocity of a trajectory", velocity, (len(t), 3))
            _check_velocity(t, p, v)
        return cls(t, p, v, quaternion, name)

    @property
    def duration(self) -> float:
        """Seconds from the first epoch to the last."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Mean number of epochs a second, in Hz; rounded to 12 digits, beyond which time is rounding."""
        return float(f"{(len(self) - 1) / self.duration:.12g}")

    @property
    def euler(self) -> Vectors:
        """Roll, pitch, yaw in rad, shape (N+1, 3); roll and yaw without jumps of 360 deg."""
        require_x64()
        angles = np.array(rotation.euler_from_quat(self.quaternion.T)).T
        angles[:, [0, 2]] = np.unwrap(angles[:, [0, 2]], axis=0)
        return angles

    @property
    def is_even(self) -> bool:
        """Whether all steps of time are the same, to a millionth of a step."""
        grid = self.time[0] + np.arange(len(self)) / self.rate
        return bool(np.abs(self.time - grid).max() * self.rate < _ON_GRID)

    def resampled(self, rate: Real) -> "Trajectory":
        """Interpolate to another rate, from the first epoch to the last that the new rate reaches.

        Positions follow a cubic spline and velocities are its derivative. Quaternions follow a cubic spline too, scaled
        to unit length, which knows no singular attitude. Both are twice differentiable, as a smooth specific force and
        body rate need.

        Parameters
        ----------
        rate
            In Hz.

        Raises
        ------
        ValueError
            The rate is not positive, or leaves fewer than two epochs; a gap of more than ten usual steps.
        """
        f = sampling_rate(rate)
        self._check_gaps()
        num_steps = int(np.floor(self.duration * f + _ON_GRID * max(1.0, f / self.rate)))
        if num_steps < 1:
            raise ValueError(f"At {f:g} Hz there are no two epochs in the {self.duration:g} s of this trajectory.")
        time = np.minimum(self.time[0] + np.arange(num_steps + 1) / f, self.time[-1])
        return self._from_splines(time, _spline(self.time, self.position), _spline(self.time, self.quaternion))

    def at(self, time: Any) -> "Trajectory":
        """Interpolate at given times, by cubic splines through positions, velocities and quaternions.

        Parameters
        ----------
        time
            s, increasing, none of them outside the trajectory.

        Raises
        ------
        ValueError
            Fewer than two times, times that do not increase or lie outside; a gap of more than ten usual steps.

        Examples
        --------
        >>> nj.motions.straight(duration=10.0, rate=20.0, speed=2.0).at([1.0, 2.5]).position.round(6).tolist()
        [[2.0, 0.0, 0.0], [5.0, 0.0, 0.0]]
        """
        wanted = real_array("The times at which a trajectory is asked for", time, (None,))
        increasing("The times at which a trajectory is asked for", wanted)
        self._check_gaps()
        slack = _ON_GRID / self.rate
        if wanted[0] < self.time[0] - slack or wanted[-1] > self.time[-1] + slack:
            raise ValueError(
                f"The trajectory is known from {self.time[0]:.9g} to {self.time[-1]:.9g} s, and is asked for from "
                f"{wanted[0]:.9g} to {wanted[-1]:.9g} s."
            )
        inside = wanted.clip(self.time[0], self.time[-1])
        p, v, q = (_spline(self.time, a)(inside) for a in (self.position, self.velocity, self.quaternion))
        return Trajectory(wanted, p, v, q / np.linalg.norm(q, axis=1, keepdims=True), self.name, self.origin)

    def smoothed(self, knots: Real, *, attitude_knots: Real | None = None) -> "Trajectory":
        """Remove the noise of a recorded reference: the least-squares spline of degree 5 with evenly spaced knots.

        Motion of a period above twice the spacing of the knots is kept, faster motion is averaged out. White noise of
        the positions of standard deviation s at f Hz leaves 4.5 s / (spacing^2 sqrt(spacing f)) of specific force, and
        eight times that at the very ends. The times stay the same.

        Parameters
        ----------
        knots
            Spacing of the knots for the positions in s, such as 0.5 for an aircraft.
        attitude_knots
            The same for the attitude; the attitude stays as it is unless given.

        Raises
        ------
        ValueError
            A spacing of fewer than two epochs, or of more than the trajectory; fewer than six epochs.
        """
        position = _smoothing_spline(self.time, self.position, knots)
        if attitude_knots is None:
            velocity = _derivative(position, self.time)
            return Trajectory(self.time, position(self.time), velocity, self.quaternion, self.name, self.origin)
        return self._from_splines(self.time, position, _smoothing_spline(self.time, self.quaternion, attitude_knots))

    def _check_gaps(self) -> None:
        steps = np.diff(self.time)
        usual = np.median(steps)
        if steps.max() > _GAP * usual:
            i = int(steps.argmax())
            raise ValueError(
                f"The trajectory has a gap of {steps[i]:.6g} s after {self.time[i]:.9g} s (index {i}), where the usual "
                f"step is {usual:.6g} s: no spline knows the motion there. Cut the trajectory at the gap."
            )

    def _from_splines(self, time: Times, position: BSpline, quaternion: BSpline) -> "Trajectory":
        q = quaternion(time)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        return Trajectory(time, position(time), _derivative(position, time), q, self.name, self.origin)

    def __len__(self) -> int:
        return len(self.time)

    def plot(self, *, attitude: bool = True, axes: GivenAxes | None = None) -> Figure:
        """Draw plan, height and attitude.

        Parameters
        ----------
        attitude
            Whether roll, pitch and yaw are drawn too.
        axes
            Two Axes to draw into, with the attitude three; a new figure if left out.

        Returns
        -------
        Figure
            See `nav_jax.plotting.plot_trajectory`.
        """
        return self._draw(attitude=attitude, axes=axes)

    def __repr__(self) -> str:
        speed = np.linalg.norm(self.velocity, axis=1)
        axes = {
            **dict(zip(("north [m]", "east [m]", "down [m]"), self.position.T, strict=True)),
            "speed [m/s]": speed,
            **dict(zip(("roll [deg]", "pitch [deg]", "yaw [deg]"), _DEGREES * self.euler.T, strict=True)),
        }
        rows = [[name, *(f"{v + 0.0:.6g}" for v in (x.min(), x.max()))] for name, x in axes.items()]
        title = f"Trajectory {self.name!r}" if self.name else "Trajectory"
        what = f"{len(self)} epochs at {self.rate:g} Hz, {self.duration:g} s from {self.time[0]:g} s"
        if self.origin is not None:
            lat, lon = np.rad2deg(self.origin[:2])
            what += f"; origin {lat:.8f} deg, {lon:.8f} deg, {self.origin[2]:.3f} m"
        return f"{title}: {what}\n{format_table(['', 'least', 'most'], rows)}"


def _smooth_unit(q: np.ndarray) -> np.ndarray:
    """Scale to unit length exactly, and choose the signs so that neighbours are close."""
    norm = np.linalg.norm(q, axis=1)
    off = np.abs(norm - 1)
    if off.max() > _NORM_TOLERANCE:
        i = int((off > _NORM_TOLERANCE).argmax())
        raise ValueError(
            f"Quaternions have unit length, and that at index {i} has {norm[i]:.9g}. They are scalar first, w x y z."
        )
    flips = np.einsum("ij,ij->i", q[1:], q[:-1]) < 0
    signs = np.concatenate([[1.0], np.where(flips, -1.0, 1.0).cumprod()])
    # lengths that are right to rounding are left alone, so that a saved trajectory comes back the same
    smooth = q * signs[:, None] / np.where(off < 1e-14, 1.0, norm)[:, None]
    smooth.flags.writeable = False
    return smooth


def _spline(time: np.ndarray, values: np.ndarray) -> BSpline:
    """Interpolate by a spline of degree 3, or lower where there are too few points."""
    return make_interp_spline(time, values, k=min(3, len(time) - 1))


def _smoothing_spline(time: np.ndarray, values: np.ndarray, spacing: Real) -> BSpline:
    """Fit a spline of degree 5 with evenly spaced knots by least squares."""
    wanted, span = number("The spacing of knots (s)", spacing), time[-1] - time[0]
    count = round(span / wanted)
    per_knot = np.histogram(time, np.linspace(time[0], time[-1], count + 1))[0] if 0 < count < len(time) else [0]
    if np.min(per_knot) < 2 or len(time) <= _DEGREE:
        raise ValueError(
            f"Knots every {wanted:g} s do not fit a trajectory of {len(time)} epochs in {span:g} s: each interval "
            "needs two epochs or more."
        )
    # the first and the last three intervals are one piece: a free end has a hundredfold noise in its specific force
    interior = np.linspace(time[0], time[-1], count + 1)[3:-3]
    knots = np.concatenate([[time[0]] * (_DEGREE + 1), interior, [time[-1]] * (_DEGREE + 1)])
    return make_lsq_spline(time, values, knots, k=_DEGREE)


def _derivative(spline: BSpline, time: np.ndarray) -> np.ndarray:
    return spline.derivative()(time)


def _check_velocity(time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
    """Raise where velocities are no rates of positions: another unit, sign, order or frame."""
    from_position = np.diff(position, axis=0) / np.diff(time)[:, None]
    between = 0.5 * (velocity[1:] + velocity[:-1])
    for axis, moved, stated in zip(("north", "east", "down"), from_position.T, between.T, strict=True):
        off, size = (float(np.median(np.abs(x))) for x in (moved - stated, moved))
        if off > 0.5 * size + _STILL:
            raise ValueError(
                f"The velocities {axis} differ from the rate of the positions by {off:.3g} m/s in the median, which is "
                f"{size:.3g} m/s itself. Velocities are north, east, down in m/s; leave them out to derive them from "
                "the positions."
            )
