"""The whole history of a run: the estimate after every covariance step with what the filter claims of it, on a host.

At an epoch with fixes there are two estimates, one before and one after the update by all fixes of that epoch, each
with a covariance of its own. A history is after the update, at all epochs; the side before it is kept beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int

from gmwm_jax._internal.states import saved
from nav_jax.filter.schedule import Schedule
from nav_jax.filter.timeline import Estimate, Trace

ESTIMATES = ("position", "velocity", "quaternion", "sensor_errors", "sd")
"""NaN where a filter has failed."""


@saved(not_finite=ESTIMATES)
@dataclass(frozen=True, eq=False)
class Estimates:
    """What a filter made of one run at E epochs, and what it claims of it: row k of everything is of ``time[k]``.

    Attributes
    ----------
    time
        s, shape (E,).
    position, velocity, quaternion
        NED in m and m/s, and q_nb, shape (E, 3), (E, 3) and (E, 4).
    sensor_errors
        Estimated errors of accelerometer x, y, z (m/s^2) and gyro x, y, z (rad/s), shape (E, 6).
    sd
        Standard deviations that the filter states of position, velocity, attitude (rad, rotation vector in n) and
        sensor errors, shape (E, 15).
    """

    time: Float64[np.ndarray, " E"]
    position: Float64[np.ndarray, "E 3"]
    velocity: Float64[np.ndarray, "E 3"]
    quaternion: Float64[np.ndarray, "E 4"]
    sensor_errors: Float64[np.ndarray, "E 6"]
    sd: Float64[np.ndarray, "E 15"]

    def __len__(self) -> int:
        return len(self.time)


def histories(schedule: Schedule, start: float, valid: Any, trace: Trace) -> list[tuple[Estimates, Estimates]]:
    """Of each run, the estimates at all epochs after their update, and those before the update at epochs with fixes.

    Parameters
    ----------
    schedule
        Of M segments.
    start
        Time of the first epoch, s.
    valid
        1 where a scalar is measured at the end of a segment, shape (M, K).
    trace
        Of R runs, see `run_filter`.
    """
    length = schedule.dt.sum(axis=1)[schedule.pattern]
    real = length > 0  # steps that fill up a segment are no epochs
    ends = np.cumsum(real.sum(axis=1))  # a segment of length zero ends at the start
    time = np.append(start, start + np.cumsum(length[real]))
    time[ends] = schedule.time
    first, steps, events = ([np.asarray(a) for a in part] for part in trace)
    before = [np.concatenate([a[None], b[real]]) for a, b in zip(first, steps, strict=True)]
    after = [a.copy() for a in before]
    for whole, known in zip(after, events, strict=True):
        whole[ends] = known
    fixed = ends[(np.asarray(valid) > 0).any(axis=1)]
    return [
        (_of_run(time, after, run), _of_run(time[fixed], [a[fixed] for a in before], run))
        for run in range(first[0].shape[-1])
    ]


def smoothed_history(
    schedule: Schedule, events: Estimate, segments: Int[np.ndarray, " E"]
) -> tuple[Estimates, Estimates]:
    """As `histories`, of one run of a smoother at the ends of some segments: it has no side before the updates."""
    arrays = [np.asarray(a)[segments] for a in events]
    return _of_run(schedule.time[segments], arrays, 0), _of_run(np.zeros(0), [a[:0] for a in arrays], 0)


def _of_run(time: np.ndarray, arrays: Sequence[np.ndarray], run: int) -> Estimates:
    """From arrays (E, components, runs); what all runs share has a last axis of one."""
    return Estimates(time, *(np.ascontiguousarray(a[..., run if a.shape[-1] > 1 else 0]) for a in arrays))
