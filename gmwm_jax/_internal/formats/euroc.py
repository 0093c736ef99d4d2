"""``data.csv`` of the IMUs of EuRoC and other data sets in the ASL layout.

Source: Burri et al. (2016), "The EuRoC micro aerial vehicle datasets": ns, then rad/s and m/s^2 in the sensor's axes.
"""

from collections.abc import Sequence

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, described
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import seconds_of
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource


def _is_certain(lines: Sequence[str]) -> bool:
    return any("w_RS_S_x" in line and "a_RS_S_x" in line for line in lines[:20])


def _open(source: TextSource, how: Reading) -> Columns:
    table = open_text(source, how.delimiter, how.header)
    table = described(table, "euroc", {"gyro": "rad/s", "accel": "m/s^2"})
    stamps = Stamps((0,), lambda c: seconds_of(c[0], 1e-9), "timestamp [ns]", lambda c: float(c[0][0]) * 1e-9)
    return table._replace(stamps=stamps)


EUROC = Format("euroc", _is_certain, _open)
