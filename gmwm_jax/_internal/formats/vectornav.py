"""VectorNav: exports with a line of names (``UncompGyro X [rad/s]``), and logs of ``$VNIMU`` sentences.

Source: VectorNav, VN-100 and VN-200 user manuals: ``VNIMU`` is uncompensated magnetic (Gauss), acceleration (m/s^2) and
angular rate (rad/s), temperature and pressure; the checksum is the exclusive or of the characters between ``$`` and
``*``. Times since startup and of GPS are in ns.
"""

import io
import re
from collections.abc import Iterator, Sequence

import numpy as np

from gmwm_jax._internal.columns import Columns, Stamps, plain_name
from gmwm_jax._internal.formats.base import Format, described, named, without_unit
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import seconds_of
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_UNITS = {"gyro": "rad/s", "accel": "m/s^2"}
_SENTENCE = re.compile(rb"\$VNIMU,([^*]*)\*([0-9A-Fa-f]{2}|XX)\s*$")
_NAMES = ("mag_x", "mag_y", "mag_z", "accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z", "temperature",
          "pressure")  # fmt: skip
_CLOCKS = ("timestartup", "timegps", "timegpstow", "gpstow", "tow", "time")
_SIZES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def _is_certain(lines: Sequence[str]) -> bool:
    return any(_SENTENCE.match(line.encode("latin-1", "replace")) for line in lines) or any(
        "uncompgyro" in plain_name(line).replace("_", "") for line in lines[:20]
    )


def _open(source: TextSource, how: Reading) -> Columns:
    if any(line.startswith("$VN") for line in source.head()):
        table = open_text(source.then(_sentences), ",", 0)
        note = "Sentences whose checksum is wrong are NaN."
        return named(table, "vectornav", _NAMES, _UNITS)._replace(notes=(note,))
    table = open_text(source, how.delimiter, how.header)
    raw = any("uncomp" in plain_name(name) for name in table.names or ())
    table = described(table, "vectornav", _UNITS, lambda name: _role(name, raw))
    plain = [plain_name(without_unit(name)).replace("_", "") for name in table.names or ()]
    clock = next((plain.index(name) for name in _CLOCKS if name in plain), None)
    if clock is None or clock in table.text:
        return table
    column = (table.names or ())[clock]
    unit = re.search(r"\[(\w+)\]", column)
    size = _SIZES[unit[1]] if unit and unit[1] in _SIZES else 1e-9 if plain[clock].startswith(_CLOCKS[:3]) else 1.0
    stamps = Stamps((clock,), lambda c: seconds_of(c[0], size), repr(column), lambda c: float(c[0][0]) * size)
    return table._replace(stamps=stamps)


def _role(name: str, raw: bool) -> str | None:
    """The uncompensated sensors where there are such: the others have the bias taken out that a filter estimated."""
    found = re.fullmatch(r"(?:imu_?)?(uncomp)?_?(gyro|angular_?rate|acc(?:el)?)_?([xyz])(?:_axis)?", plain_name(name))
    if found is None or bool(found[1]) != raw:
        return None
    return f"{'accel' if found[2].startswith('acc') else 'gyro'}_{found[3]}"


def _sentences(stream: io.BufferedIOBase) -> Iterator[bytes]:
    """The fields of each ``$VNIMU``; other sentences are left out."""
    damaged = b",".join([b"nan"] * len(_NAMES)) + b"\n"
    for line in stream:
        if not line.startswith(b"$VNIMU,"):
            continue
        found = _SENTENCE.match(line)
        good = found is not None and found[1].count(b",") == len(_NAMES) - 1 and _checked(line, found[2])
        yield found[1] + b"\n" if good and found else damaged


def _checked(line: bytes, told: bytes) -> bool:
    between = np.frombuffer(line[1 : line.index(b"*")], dtype=np.uint8)
    return told == b"XX" or int(np.bitwise_xor.reduce(between)) == int(told, 16)


VECTORNAV = Format("vectornav", _is_certain, _open)
