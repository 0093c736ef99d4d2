"""IMU text of KF-GINS and the data sets of its group: seconds of week, increments of angle and velocity, no names.

Source: documentation of KF-GINS (i2Nav group, Wuhan University): s, rad, m/s; axes front, right, down.
"""

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, named, not_told
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import over_weeks, seconds_of
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def _open(source: TextSource, how: Reading) -> Columns:
    table = open_text(source, how.delimiter, 0 if how.header is None else how.header)
    table = named(table, "kf-gins", _NAMES, {"gyro": "rad", "accel": "m/s"})
    return table._replace(
        stamps=Stamps((0,), lambda c: seconds_of(over_weeks(c[0])), "seconds of the week", lambda c: float(c[0][0]))
    )


KF_GINS = Format("kf-gins", not_told, _open)
