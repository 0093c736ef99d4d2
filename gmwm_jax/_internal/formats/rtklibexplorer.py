"""IMU logs of the data sets of rtklibexplorer: accelerations in g, rates in deg/s, milliseconds; commas, no names.

Source: public data of the repository rtklibexplorer/GNSS_IMU.
"""

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, named, not_told
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import seconds_of
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_NAMES = ("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "time")


def _open(source: TextSource, how: Reading) -> Columns:
    table = open_text(source, how.delimiter, 0 if how.header is None else how.header)
    table = named(table, "rtklibexplorer", _NAMES, {"gyro": "deg/s", "accel": "g"})
    return table._replace(
        stamps=Stamps((6,), lambda c: seconds_of(c[0], 1e-3), "milliseconds", lambda c: float(c[0][0]) * 1e-3)
    )


RTKLIBEXPLORER = Format("rtklibexplorer", not_told, _open)
