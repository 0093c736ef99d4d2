"""What a vehicle on wheels does whatever else it does, as fixes for a recorded drive."""

import numpy as np
from jaxtyping import Float64

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.non_holonomic import NonHolonomic
from nav_jax.imu.imu import Imu

_CALM = 0.2
"""s, over which body rates are averaged."""

_BUMP = 1.0
"""s: wheels, springs and a speed bump throw a body up and down faster than this, a road rises more slowly."""


def constrained(sensor: NonHolonomic, imu: Imu, *, slip: Real = 0.5, bumps: Real = 1.0) -> Fixes:
    """Make the fixes of a non-holonomic constraint along a whole drive: zero, and less sure in turns and over bumps.

    Wheels slip in turns, by about what pulls the vehicle sideways: the standard deviations grow as 1 + slip |w_z| with
    the body rate w_z about the axis down, which the gyros tell without the filter.

    Over a bump wheels and body do move up and down. How fast the accelerometers tell, since that is over within a
    second: the integral of the specific force along the axis down, less what is slower. Its root mean square over that
    time is added, in squares, to the standard deviation of the component down. A few updates that state 4 cm/s where
    the axle is thrown up by 50 would turn the pitch of a filter by a degree, and its speed by metres a second.

    Parameters
    ----------
    sensor
        Its rate and what is believed of it where the vehicle goes straight on.
    imu
        The record, along the axes of the body.
    slip
        s.
    bumps
        By which that velocity is multiplied; 0 to trust wheels on every road.

    Raises
    ------
    ValueError
        A negative slip or factor of bumps; a record shorter than a period of the sensor.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.circle(duration=4.0, rate=20.0))
    >>> fixes = nj.recorded.constrained(nj.aiding.NonHolonomic(5.0, right=0.03, down=0.04), samples)
    >>> fixes.value.shape
    (20, 2)
    """
    grows, thrown = number("slip", slip, zero_ok=True), number("bumps", bumps, zero_ok=True)
    time = sensor.fixes(float(imu.time[0]), float(imu.epochs[-1]))
    turning = np.abs(_mean(imu.gyro[:, 2], _CALM, imu.rate))
    sd = np.asarray(sensor.believed) * (1.0 + grows * np.interp(time, imu.time, turning))[:, None]
    sd[:, 1] = np.hypot(sd[:, 1], thrown * np.interp(time, imu.time, _thrown(imu)))
    return Fixes(sensor, time, np.zeros(sd.shape), np.einsum("fi,ij->fij", sd**2, np.eye(2)))


def _thrown(imu: Imu) -> Float64[np.ndarray, " N"]:
    """Root mean square, about each sample, of the vertical velocity that is none of the road's own rise, m/s."""
    force = imu.accel[:, 2]
    velocity = np.cumsum(force - _mean(force, _BUMP, imu.rate)) / imu.rate
    return np.sqrt(_mean((velocity - _mean(velocity, _BUMP, imu.rate)) ** 2, _BUMP, imu.rate))


def _mean(x: Float64[np.ndarray, " N"], seconds: float, rate: float) -> Float64[np.ndarray, " N"]:
    """About each sample, of fewer at the ends."""
    width = max(round(seconds * rate), 1)
    total = np.concatenate([[0.0], np.cumsum(x)])
    first = np.clip(np.arange(len(x)) - width // 2, 0, None)
    last = np.clip(first + width, None, len(x))
    return (total[last] - total[first]) / (last - first)
