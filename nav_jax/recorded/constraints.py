"""What a vehicle on wheels does whatever else it does, as fixes for a recorded drive."""

import numpy as np

from gmwm_jax._internal.checks import number
from gmwm_jax._internal.typing import Real
from nav_jax.aiding.fixes import Fixes
from nav_jax.aiding.non_holonomic import NonHolonomic
from nav_jax.imu.imu import Imu

_CALM = 0.2
"""s, over which body rates are averaged."""


def constrained(sensor: NonHolonomic, imu: Imu, *, slip: Real = 0.5) -> Fixes:
    """Make the fixes of a non-holonomic constraint along a whole drive: zero, and less sure the faster it turns.

    Wheels slip in turns, by about what pulls the vehicle sideways: the standard deviations grow as 1 + slip |w_z| with
    the body rate w_z about the axis down, which the gyros tell without the filter.

    Parameters
    ----------
    sensor
        Its rate and what is believed of it where the vehicle goes straight on.
    imu
        The record, along the axes of the body.
    slip
        s.

    Raises
    ------
    ValueError
        A negative slip; a record shorter than a period of the sensor.

    Examples
    --------
    >>> samples, _ = nj.perfect_imu(nj.motions.circle(duration=4.0, rate=20.0))
    >>> fixes = nj.recorded.constrained(nj.aiding.NonHolonomic(5.0, right=0.03, down=0.04), samples)
    >>> fixes.value.shape
    (20, 2)
    """
    grows = number("slip", slip, zero_ok=True)
    time = sensor.fixes(float(imu.time[0]), float(imu.epochs[-1]))
    width = max(round(_CALM * imu.rate), 1)
    # the mean about each sample, of fewer at the ends
    total = np.concatenate([[0.0], np.cumsum(imu.gyro[:, 2])])
    first = np.clip(np.arange(len(imu)) - width // 2, 0, None)
    last = np.clip(first + width, None, len(imu))
    turning = np.abs((total[last] - total[first]) / (last - first))
    sd = np.asarray(sensor.believed) * (1.0 + grows * np.interp(time, imu.time, turning))[:, None]
    return Fixes(sensor, time, np.zeros(sd.shape), np.einsum("fi,ij->fij", sd**2, np.eye(2)))
