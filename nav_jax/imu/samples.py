r"""What the numbers of an IMU are means of, and what the mechanisation makes of a sample: coning and sculling.

The mechanisation holds body rate and specific force through a sample. An IMU says something else: integrals over the
sample, or means of it (increments divided by their length), or values at an instant. Where the motion changes within a
sample, the axis of rotation cones and the specific force turns while it changes, and both rectify: a cone of 1 deg at
10 Hz, sampled at 100 Hz, is a drift of 127 deg/h if it is neglected.

With the increments dtheta = int omega, dv = int f over a sample and those of the sample before (of lines through both),

    phi = dtheta + (dtheta_- x dtheta)/12,
    dv' = dv + (dtheta_- x dv + dv_- x dtheta)/12

the mechanisation turns by phi and, with phi/dt and dv'/dt held, adds the rotation within the sample, dtheta x dv/2 and
the higher terms, by itself (Savage 1998; Ignagni 1990, 1998). What is left of the cone above is 9.8 deg/h.

These are functions of what was sensed, not of the estimate: a bias changes them by its product with the change of rate
between two samples, a twelfth of it, which nothing could see. They are hence computed once, before the filter runs.
"""

from typing import Any

import numpy as np

from gmwm_jax._internal.checks import real_array, sampling_rate
from gmwm_jax._internal.typing import Real, Vectors
from nav_jax.imu.imu import Imu

SAMPLES = ("held", "averages", "instants")
STAMPS = {"begin": 0.0, "middle": 0.5, "end": 1.0}
"""Of a stamp, in samples from the beginning of its own."""


def imu_of_samples(
    time: Any,
    gyro: Any,
    accel: Any,
    rate: Real,
    *,
    samples: str = "averages",
    stamps: str = "begin",
    temperature: Any = None,
) -> Imu:
    """Make the IMU whose held samples lead where recorded ones say that the body went.

    Parameters
    ----------
    time
        Stamps in s, in even steps, shape (N,).
    gyro, accel
        Body rate (rad/s) and specific force (m/s^2), shape (N, 3); increments times the rate.
    rate
        Hz.
    samples
        ``averages`` (increments too): means over the sample, corrected for coning and sculling. ``instants``: values at
        the stamps; a sample is then the mean of two, corrected likewise, and there is one less. ``held``: they are
        taken as they are, as `Imu` does.
    stamps
        What of its sample a stamp marks: ``begin``, ``middle`` or ``end``, as increments have it that have just been
        read out.
    temperature
        Of the IMU at the stamps, see `Imu`.

    Raises
    ------
    ValueError
        See `Imu`; samples or stamps of another name; instants with another stamp than ``begin``; fewer than three
        samples to be corrected.

    Examples
    --------
    >>> time, turning = np.arange(100) / 100.0, np.zeros((100, 3))
    >>> turning[:, 0], turning[:, 1] = np.cos(60.0 * time), np.sin(60.0 * time)  # a cone
    >>> imu = nj.imu.imu_of_samples(time, turning, np.zeros((100, 3)), 100.0)
    >>> imu.gyro[5].round(5).tolist()  # what it turns about the axis of the cone
    [-0.98999, 0.14112, 0.00047]
    """
    if samples not in SAMPLES:
        raise ValueError(f"samples is one of {', '.join(SAMPLES)}, and is {samples!r}.")
    if stamps not in STAMPS:
        raise ValueError(f"stamps is one of {', '.join(STAMPS)}, and is {stamps!r}.")
    if samples == "instants" and stamps != "begin":
        raise ValueError("The stamps of instants mark nothing but these: leave stamps out.")
    t, f = real_array("The time of an IMU", time, (None,)), float(sampling_rate(rate))
    w, a = (real_array(f"The {name}", x, (len(t), 3)) for name, x in (("gyro", gyro), ("accel", accel)))
    warm = None if temperature is None else real_array("The temperature", temperature, (len(t),))
    if samples == "held":
        return Imu(t - STAMPS[stamps] / f, w, a, f, warm)
    if samples == "instants":
        t, w, a = t[:-1], (w[1:] + w[:-1]) / 2, (a[1:] + a[:-1]) / 2
        warm = None if warm is None else (warm[1:] + warm[:-1]) / 2
    if len(t) < 2:
        raise ValueError(f"The record has {len(t)} samples, and a correction needs the one before.")
    return Imu(t - STAMPS[stamps] / f, *corrected(w, a, f), f, warm)


def corrected(gyro: Vectors, accel: Vectors, rate: float) -> tuple[Vectors, Vectors]:
    """Rates and specific forces to be held, from means over samples; both (N, 3). See the head of this file."""
    turned, pushed = gyro / rate, accel / rate
    # before the first sample lies what a line through the first two has there
    turned_before, pushed_before = (np.concatenate([2 * x[:1] - x[1:2], x[:-1]]) for x in (turned, pushed))
    phi = turned + np.cross(turned_before, turned) / 12
    dv = pushed + (np.cross(turned_before, pushed) + np.cross(pushed_before, turned)) / 12
    return phi * rate, dv * rate
