"""The case of the navigation benchmarks: R's example, 300 s of lemniscate at 100 Hz with an outage of 40 s.

Noise, aiding and trajectory are those of the example that ships with the R package navigation (facts, not code): three
AR1 processes on each accelerometer, two on each gyro, 24 states in the right filter.
"""

from typing import Any

import jax

from gmwm_jax import AR1, WN
from nav_jax import Barometer, FlatEarth, GnssPosition, GnssVelocity, ImuErrors, Scenario
from nav_jax.trajectory.motions import lemniscate

ACCEL = ((0.9982454, 1.848297e-10), (0.9999121, 2.435414e-11), (0.9999998, 1.026718e-12))
GYRO = ((0.9968999, 2.42898e-11), (0.9999001, 1.238142e-12))
GRAVITY = 9.8056


def errors(num_accel: int = 3, num_gyro: int = 2, repeat: int = 1, **more: Any) -> ImuErrors:
    """White noise and the first processes of each sensor; `repeat` > 1 for filters with more states.

    And what else an `ImuErrors` takes.
    """
    accel, gyro = WN(5.989778e-5), WN(1.503793e-6)
    for phi, sigma2 in ACCEL[:num_accel] * repeat:
        accel = accel + AR1(phi, sigma2 / repeat)
    for phi, sigma2 in GYRO[:num_gyro] * repeat:
        gyro = gyro + AR1(phi, sigma2 / repeat)
    return ImuErrors(accel, gyro, 100.0, start="zero", **more)


def aiding(duration: float = 300.0, **of_position: Any) -> tuple:
    out = [(duration - 40.0, duration)]
    return (
        GnssPosition(horizontal=0.025, vertical=0.05, outages=out, **of_position),
        GnssVelocity(horizontal=0.01, vertical=0.02, outages=out),
        Barometer(height=0.5),
    )


def reference(duration: float = 300.0):
    return lemniscate(duration, 100.0, attitude="navigation", gravity=GRAVITY)


def scenario(duration: float = 300.0, every: int = 1, earth=None) -> Scenario:
    return Scenario(reference(duration), aiding(duration), earth=earth or FlatEarth(GRAVITY), every=every)


def options(num_runs: int) -> dict:
    return {"num_runs": num_runs, "key": jax.random.key(2023)}


FILTERS = {"right": errors(), "WN only": errors(0, 0), "WN + 1 AR1": errors(1, 1)}
