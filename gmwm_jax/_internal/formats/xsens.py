"""Text exports of Xsens MT Manager: lines of ``// key: value``, then names, then rows.

Source: Xsens, MT Manager user manual, and MTw user manual, table of exported data: ``Acc`` in m/s^2, ``Gyr`` in rad/s,
``PacketCounter`` wraps at 65535, ``SampleTimeFine`` in ticks of 0.1 ms.
"""

import re
from collections.abc import Sequence

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, described
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import unwrapped
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_RATE = re.compile(r"//\s*(?:update|sampling|sample) rate\s*:\s*([\d.]+)\s*Hz", re.IGNORECASE)
_TICK = 1e-4


def _is_certain(lines: Sequence[str]) -> bool:
    return any(line.startswith("//") for line in lines) and any(
        line.startswith(("PacketCounter", '"PacketCounter', "// PacketCounter")) for line in lines
    )


def _open(source: TextSource, how: Reading) -> Columns:
    table = described(open_text(source, how.delimiter, how.header), "xsens", {"gyro": "rad/s", "accel": "m/s^2"}, _role)
    found = next(filter(None, map(_RATE.match, source.head())), None)
    rate = None if found is None else float(found[1])
    names = [name.strip() for name in table.names or ()]
    usable = {name: i for i, name in enumerate(names) if i not in table.text}
    if rate is not None and "PacketCounter" in usable:
        label = "PacketCounter over the update rate"
        stamps = Stamps((usable["PacketCounter"],), lambda c: unwrapped(c[0], 1 << 16) / rate, label)
    elif "SampleTimeFine" in usable:
        stamps = Stamps((usable["SampleTimeFine"],), lambda c: unwrapped(c[0], 1 << 32) * _TICK, "SampleTimeFine")
    else:
        stamps = None
    return table._replace(rate=rate, stamps=stamps)


def _role(name: str) -> str | None:
    found = re.fullmatch(r"(Acc|Gyr)_([XYZ])", name)
    return None if found is None else f"{'accel' if found[1] == 'Acc' else 'gyro'}_{found[2].lower()}"


XSENS = Format("xsens", _is_certain, _open)
