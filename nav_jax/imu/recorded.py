"""Errors of a static recording, as they are."""

from typing import Any

import numpy as np

from gmwm_jax._internal.checks import real_array, sampling_rate
from gmwm_jax._internal.typing import Real


class RecordedErrors:
    """The errors in a static recording: every run takes a slice of it, the six channels together.

    Parameters
    ----------
    accel, gyro
        The errors (N, 3) in m/s^2 and rad/s at a sampling rate: a static recording, whose mean over the whole record is
        taken off, since gravity, Earth rate and bias are in it.
    rate
        Hz.

    Raises
    ------
    ValueError
        NaN, wrong shapes, records of different length.

    Notes
    -----
    Slices of a short record overlap: runs are then not independent, and the intervals of statistics too short. Nobody
    knows the true states behind a recording, so nothing is said about the filter's sensor states.

    Examples
    --------
    >>> noise = np.random.default_rng(0).normal(size=(1000, 6))
    >>> nj.RecordedErrors(accel=noise[:, :3], gyro=noise[:, 3:], rate=20.0).rate
    20.0
    """

    def __init__(self, accel: Any, gyro: Any, rate: Real):
        both = [real_array("accel", accel, (None, 3)), real_array("gyro", gyro, (None, 3))]
        if len(both[0]) != len(both[1]):
            raise ValueError(f"accel has {len(both[0])} samples and gyro {len(both[1])}: give both of one recording.")
        record = np.concatenate(both, axis=1)
        self.record = record - record.mean(axis=0)
        self.rate = sampling_rate(rate)
