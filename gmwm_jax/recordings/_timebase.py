"""The sampling rate that a column of time tells, and the gaps and resets that it shows."""

import numpy as np

from gmwm_jax._internal.checks import finite_record
from gmwm_jax.units import time_size

_GAP = 1.5
"""A step of more than so many median steps misses at least one sample, which jitter does not explain."""


def rate_of_time(time: np.ndarray, unit: str = "s") -> float:
    """Return the sampling rate in Hz that a column of time tells: the number of steps over their sum.

    Jitter is tolerated; it averages out.

    Parameters
    ----------
    time
        Shape (N,), numbers in `unit` or NumPy timestamps, increasing in even steps.
    unit
        ``s``, ``ms``, ``us``, ``ns``, ``min`` or ``h``.

    Raises
    ------
    ValueError
        Time that does not increase, has a gap (a step above 1.5 median steps), is not finite or no number; fewer than
        two values; or an unknown unit.
    """
    size = time_size(unit)
    if time.dtype.kind not in "iufM":
        raise ValueError(f"The column of time holds {time.dtype} ({time[:1].tolist()} ...), and no numbers.")
    if len(time) < 2:
        raise ValueError(f"The column of time has {len(time)} value: a rate needs two.")
    if time.dtype.kind == "M":
        seconds = (time - time[0]) / np.timedelta64(1, "s")
    else:
        # the first is subtracted while integers are exact, and in 64 bits, where a counter that fell back shows
        ticks = time.astype(np.float64 if time.dtype.kind == "f" else np.int64)
        seconds = (ticks - ticks[0]) * size
    finite_record(seconds, "the column of time")
    steps = np.diff(seconds)
    median = np.median(steps)
    back, gap = steps <= 0, steps > _GAP * median
    if back.any():
        i = int(back.argmax()) + 1
        raise ValueError(
            f"Time does not increase at index {i}: {time[i - 1]} is followed by {time[i]}. The clock was reset, times "
            "were written with too few digits, or this is not the column of time."
        )
    if gap.any():
        i = int(gap.argmax()) + 1
        raise ValueError(
            f"Time has a gap of {steps[i - 1]:.6g} s before index {i}, where the usual step is {median:.6g} s. Cut the "
            "record there: a gap that is closed silently changes every scale."
        )
    return float(len(steps) / seconds[-1])
