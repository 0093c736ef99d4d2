"""The noise of the six channels of an IMU, of the fits of the page."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import gmwm_jax as gj
from nav_jax.imu.errors import ImuErrors, sensor_errors

_SENSORS = {"accel": "m/s^2", "gyro": "rad/s"}


class OfPage(NamedTuple):
    """Errors of an IMU, and what stands for channels that the page does not have."""

    errors: ImuErrors
    remarks: tuple[str, ...] = ()


def fits_of(wv: Any, model: str, weights: str = "default") -> tuple[gj.Fit, ...]:
    """Fit a model to every channel of a wavelet variance.

    Parameters
    ----------
    wv
        Of one channel or several.
    model
        As text.
    weights
        Of `gmwm_jax.fit`.

    Examples
    --------
    >>> from nav_jax.app.web.models import fits_of
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x", "accel_x"]))
    >>> [fit.wv.channels[0] for fit in fits_of(wv, "WN")]
    ['gyro_x', 'accel_x']
    """
    found = gj.fit(wv, model, weights=weights, throw=False)
    return (found,) if isinstance(found, gj.Fit) else tuple(found.values())


def errors_of(fits: Sequence[gj.Fit], sensor: str) -> OfPage:
    """Make the errors of an IMU of fits of its channels.

    Three channels of a kind serve the axes x, y, z in their order; of one or two, the first serves all axes.

    Parameters
    ----------
    fits
        One a channel.
    sensor
        What the page has no accelerometer or no gyro of, is that of this sensor.

    Raises
    ------
    ValueError
        No rate, no channel in m/s^2 or rad/s; no such sensor.

    Examples
    --------
    >>> from nav_jax.app.web.models import errors_of, fits_of
    >>> wv = gj.wavelet_variance(gj.datasets.simulated("mti-g", 2000, channels=["gyro_x"]))
    >>> errors_of(fits_of(wv, "WN"), "mti-g").remarks[0]
    'There is no accelerometer in m/s^2: those of mti-g stand for it.'
    """
    rate = fits[0].rate
    if rate is None:
        raise ValueError("A filter runs at a rate, and the recording has none.")
    made: dict[str, Any] = {}
    remarks = []
    for kind, unit in _SENSORS.items():
        mine = [fit for fit in fits if fit.wv.units[0] == unit]
        if len(mine) == 3:
            made[kind] = [fit.model for fit in mine]
        elif mine:
            made[kind] = mine[0].model
            remarks.append(f"All axes have the model of {mine[0].wv.channels[0]}.")
    if not made:
        raise ValueError("No channel is in m/s^2 or rad/s: say the unit in the room Data.")
    for kind, first in (("accel", 0), ("gyro", 3)):
        if kind not in made:
            name = {"accel": "accelerometer", "gyro": "gyro"}[kind]
            remarks.append(f"There is no {name} in {_SENSORS[kind]}: those of {sensor} stand for it.")
            made[kind] = sensor_errors(sensor).at_rate(rate).models[first : first + 3]
    return OfPage(ImuErrors(made["accel"], made["gyro"], rate), tuple(remarks))
