"""Units of an IMU that gravity contradicts: at rest, or over a drive, accelerometers average to 9.81 m/s^2.

Nothing is said of accelerometers between half and twice that, nor of those whose mean was taken out or that vary by
more than half of it, nor of a ratio that no mistake of units explains: a sensor may tumble, fall, or lack an axis.
"""

import warnings

import numpy as np

_GRAVITY = 9.80665
"""In m/s^2; `gmwm_jax.units` has it for those who compute with it."""

_PLAUSIBLE = 0.5, 2.0
"""Times gravity."""

_NEAR = 0.07
"""By which the mean may differ: 50 mg of bias, a few degrees of motion."""

_REMOVED = 1e-6
"""Of the standard deviation: a mean below it was taken out."""

_STEADY = 0.5
"""Of the mean: standard deviation of what rests, or drives."""

_MISTAKES = {
    ("g", "m/s^2"): 1 / _GRAVITY,
    ("m/s^2", "g"): _GRAVITY,
    ("g", "mg"): 1e-3,
    ("mg", "g"): 1e3,
    ("mg", "m/s^2"): 1e3 / _GRAVITY,
    ("m/s^2", "mg"): _GRAVITY / 1e3,
}
"""What the values look like, and as what they were read -> their mean, times gravity."""

_SWAPPED = {"rad/s": _GRAVITY, "deg/s": np.deg2rad(_GRAVITY)}
"""Unit of gyros -> their mean in rad/s, where they are accelerometers in m/s^2."""


class ImplausibleUnitsWarning(UserWarning):
    """A warning that gravity contradicts the units or the columns of an IMU."""


def doubt(gyro: np.ndarray | None, accel: np.ndarray) -> str | None:
    """Return a sentence about units or columns that gravity contradicts, or None.

    Parameters
    ----------
    gyro, accel
        In rad/s and m/s^2, shape (N, 3), NaN where samples are missing; None without gyros.
    """
    if not len(accel) or np.isnan(accel).all():
        return None
    mean, sd = _mean_norm(accel), _sd(accel)
    ratio = mean / _GRAVITY
    if _PLAUSIBLE[0] < ratio < _PLAUSIBLE[1] or mean < _REMOVED * sd:
        return None
    for (looks, read), expected in _MISTAKES.items():
        if abs(ratio / expected - 1) < _NEAR and sd < _STEADY * mean:
            return (
                f"The accelerometers, read as {read}, average {mean:.4g} m/s^2, and gravity is 9.81: their values look "
                f'like {looks}. If they are, say so: units={{"accel": "{looks}"}}.'
            )
    if gyro is None or not len(gyro) or np.isnan(gyro).all() or ratio > _PLAUSIBLE[0]:
        return None
    turn = _mean_norm(gyro)
    for read, expected in _SWAPPED.items():
        if abs(turn / expected - 1) < _NEAR and _sd(gyro) < _STEADY * turn:
            return (
                f"The gyros, read as {read}, average {turn / expected * _GRAVITY:.4g} {read}, as accelerometers "
                f"in m/s^2 do by gravity, and the accelerometers average {mean:.4g} m/s^2: their columns seem to be "
                "swapped. If they are, say which is which by columns=... or names=..."
            )
    return None


def warn_of_units(gyro: np.ndarray | None, accel: np.ndarray) -> str | None:
    """Warn if gravity contradicts units or columns; see `doubt`.

    Returns
    -------
    The sentence, if there is one.
    """
    text = doubt(gyro, accel)
    if text is not None:
        warnings.warn(text, ImplausibleUnitsWarning, stacklevel=3)
    return text


def _mean_norm(x: np.ndarray) -> float:
    return float(np.linalg.norm(np.nanmean(x, axis=0)))


def _sd(x: np.ndarray) -> float:
    return float(np.linalg.norm(np.nanstd(x, axis=0)))
