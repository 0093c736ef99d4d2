"""Where a record starts, by its configuration: as [record] states, by the course of the fixes, or by [align]."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.gnss import AbstractReceiver
from nav_jax.aiding.states import own_states
from nav_jax.app.sections import AlignSection
from nav_jax.filter.initial import InitialUncertainty
from nav_jax.imu.imu import Imu
from nav_jax.kinematics import rotation
from nav_jax.kinematics.earth import AbstractEarth
from nav_jax.recorded.alignment import Start, align_by_course, between
from nav_jax.recorded.at_rest import StartAtRest, align_at_rest
from nav_jax.recorded.gnss.record import GnssRecord
from nav_jax.recorded.on_the_move import StartOnTheMove, align_on_the_move

_CALM = 0.2
"""s, over which the motion at a start is averaged."""


@dataclass(frozen=True)
class Stated:
    """What [record] says of the start, None where it does not.

    Attributes
    ----------
    position, velocity
        NED in m and m/s.
    attitude
        Roll, pitch, yaw in rad.
    course_speed
        See `align_by_course`.
    """

    position: Sequence[float] | None
    velocity: Sequence[float] | None
    attitude: Sequence[float] | None
    course_speed: float | None


@dataclass(frozen=True)
class Begun:
    """A record from where it starts.

    Attributes
    ----------
    imu
        From there on, without the biases that an alignment found.
    start, initial
        What is known there, and how well.
    used_until
        s, of the last fix that has been used for it; None where none was.
    notes
        What a reader of the results should know of it.
    """

    imu: Imu
    start: Start
    initial: InitialUncertainty
    used_until: float | None = None
    notes: tuple[str, ...] = ()


def begun(
    stated: Stated,
    sure: InitialUncertainty | AlignSection,
    imu: Imu,
    records: Sequence[GnssRecord | None],
    fixes: Sequence[Fixes],
    earth: AbstractEarth,
) -> Begun:
    """Find the start of a record.

    Parameters
    ----------
    stated
        By [record].
    sure
        How well the start is known, by [initial]; or how to find it.
    imu
        The whole record.
    records, fixes
        Of each aiding sensor: the file of a receiver it is from, if it is, and its fixes.
    earth
        Of [run].

    Returns
    -------
    Begun
        How well an alignment on the move knows the start takes in what is unknown of the receiver.

    Raises
    ------
    ValueError
        Sections that do not go together, or a record that does not tell its start.
    """
    gnss = next((r for r in records if r is not None), None)
    if isinstance(sure, AlignSection):
        if stated.attitude is not None or stated.velocity is not None:
            raise ValueError("[initial] has align = true, and [record] an attitude or velocity: leave one out.")
        arm = _arm(fixes)
        receiver = {"lever_arm": arm, "averaged": averaged_by(fixes)}
        found = aligned(sure, imu, gnss, receiver, stated.position, earth, ends=True)
        return _of_alignment(found, imu, fixes, stated, earth)
    if stated.attitude is not None and stated.velocity is not None:
        quaternion = np.asarray(rotation.quat_from_euler(np.array(stated.attitude)))
        position = np.zeros(3) if stated.position is None else np.array(stated.position)
        return Begun(imu, Start(float(imu.time[0]), position, np.array(stated.velocity), quaternion), sure)
    if gnss is None:
        raise ValueError(
            "the keys 'velocity' and 'attitude' are missing, and no file of a GNSS receiver in [[aiding]] tells where "
            "the vehicle heads."
        )
    speed = {} if stated.course_speed is None else {"speed": stated.course_speed}
    begin = align_by_course(imu, gnss, gravity=gravity_at(earth, gnss), **speed)
    velocity = begin.velocity if stated.velocity is None else np.array(stated.velocity)
    begin = _of_imu(replace(begin, velocity=velocity), _arm(fixes), stated)
    return Begun(between(imu, begin.time), begin, sure)


def aligned(
    asked: AlignSection,
    imu: Imu,
    gnss: GnssRecord | None,
    receiver: dict[str, Any],
    position: Sequence[float] | None,
    earth: AbstractEarth,
    *,
    ends: bool = False,
) -> StartAtRest | StartOnTheMove:
    """Align a record by the section [align].

    Parameters
    ----------
    asked
        The section.
    imu
        The whole record.
    gnss
        Fixes of a receiver, on the clock of the IMU, if there are any.
    receiver
        Its lever arm and the age of its velocities, which hold unless [align] has them.
    position
        Of [record], if it has one.
    earth
        Of [run].
    ends
        Whether the record goes on after an alignment at rest, which has to say how long it is, then.

    Raises
    ------
    ValueError
        See `align_at_rest` and `align_on_the_move`; an alignment on the move without fixes.
    """
    options = asked.arguments()
    if asked.motion == "at rest":
        window = options.pop("window", None)
        if window is None and ends:
            raise ValueError(
                'motion = "at rest" needs window here: how long the vehicle stands at the beginning, in s.'
            )
        still = imu if window is None else between(imu, end=float(imu.time[0]) + window)
        there = {} if position is None else {"position": position}
        return align_at_rest(still, **there, **options, earth=earth)
    if gnss is None:
        raise ValueError("an alignment on the move needs the file of a GNSS receiver in [[aiding]], and there is none.")
    return align_on_the_move(imu, gnss, **{**receiver, **options}, earth=earth)


def _of_alignment(
    found: StartAtRest | StartOnTheMove, imu: Imu, fixes: Sequence[Fixes], stated: Stated, earth: AbstractEarth
) -> Begun:
    """The record from the end of an alignment on, without the biases that it found."""
    rest = between(imu, found.time)
    moving = isinstance(found, StartOnTheMove)
    biases = {"gyro": found.gyro_bias, "accel": found.accel_bias if moving else np.zeros(3)}
    rest = replace(rest, **{name: getattr(rest, name) - bias for name, bias in biases.items()})
    start = Start(found.time, found.position, found.velocity, found.quaternion)
    notes = [f"Starts at {found.time:.10g} s, where the alignment {'on the move' if moving else 'at rest'} ends."]
    for name, factor, unit in (("gyro", np.rad2deg(1) * 3600, "deg/h"), ("accel", 1.0, "m/s^2")):
        if biases[name].any():
            said = ", ".join(f"{b:.4g}" for b in factor * biases[name])
            notes.append(f"Biases of the alignment are taken off the {name}: {said} {unit}.")
    if not moving:
        return Begun(rest, _of_imu(start, _arm(fixes), stated), found.initial, None, tuple(notes))
    receiver = next((f.sensor for f in fixes if isinstance(f.sensor, AbstractReceiver)), None)
    initial = found.initial
    if receiver is not None and receiver.states:
        used = between(imu, end=found.time)
        used = replace(used, **{name: getattr(used, name) - bias for name, bias in biases.items()})
        P = np.asarray(initial.covariance) + _of_receiver(receiver, found, used, earth)
        initial = InitialUncertainty(covariance=(P + P.T) / 2)
    return Begun(rest, start, initial, found.time, tuple(notes))


def _of_receiver(receiver: AbstractReceiver, start: Start, used: Imu, earth: AbstractEarth) -> np.ndarray:
    """Covariance (9, 9) of what an alignment by the fixes of a receiver takes for known, and a filter does not.

    Fixes of another moment tell the position and velocity of that moment, fixes of an antenna that is elsewhere those
    of another point, and errors that last are in all of them. Headings of another moment are off by turns, this way and
    that: by what is usual in the samples that were used.
    """
    C = np.asarray(rotation.dcm_from_quat(jnp.asarray(start.quaternion)[:, None]))[:, :, 0]
    gravity = np.asarray(earth.gravity_n(jnp.asarray(start.position)[:, None]))[:, 0]
    last = max(round(_CALM * used.rate), 1)
    force, rate = used.accel[-last:].mean(axis=0), used.gyro[-last:].mean(axis=0)
    slope = [np.concatenate([C @ e, C @ np.cross(rate, e), np.zeros(3)]) for e in np.eye(3)[: len(receiver.arm_states)]]
    if receiver.clock is not None:
        slope.append(np.concatenate([start.velocity, C @ force + gravity, np.zeros(3)]))
    first = 0 if "position" in receiver.parts else 3
    if receiver.drifts:
        slope += [np.eye(9)[first + component] for component in receiver.drifting]
    own = own_states([receiver], used.rate)
    J = np.stack(slope, axis=1) @ np.asarray(own.readout)
    P = J @ np.asarray(own.initial) @ J.T
    if receiver.clock is not None:
        turns = used.gyro @ C.T
        P[6:, 6:] += float(receiver.clock.sd) ** 2 * turns.T @ turns / len(turns)
    return P


def gravity_at(earth: AbstractEarth, gnss: GnssRecord) -> float:
    """Where the first fix is, m/s^2."""
    return float(np.linalg.norm(earth.gravity_n(jnp.asarray(gnss.position[:1].T))))


def averaged_by(fixes: Sequence[Fixes]) -> float:
    """Seconds over which the first receiver that says so averages its velocities, or 0."""
    ages = (getattr(f.sensor, "averaged", 0.0) for f in fixes)
    return next((float(age) for age in ages if age), 0.0)


def _arm(fixes: Sequence[Fixes]) -> Any:
    """From the IMU to the antenna of the first receiver, in b."""
    stated = (f.sensor.lever_arm for f in fixes if isinstance(f.sensor, AbstractReceiver))
    return next((np.asarray(arm) for arm in stated if arm is not None), np.zeros(3))


def _of_imu(start: Start, arm: Any, stated: Stated) -> Start:
    """From where the antenna is to where the IMU is, unless [record] states that."""
    if stated.position is not None:
        return replace(start, position=np.array(stated.position))
    q = jnp.asarray(start.quaternion)[:, None]
    return replace(start, position=start.position - np.asarray(rotation.rotate(q, jnp.asarray(arm)[:, None]))[:, 0])
