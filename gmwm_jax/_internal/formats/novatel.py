"""Logs of NovAtel receivers with raw IMU data: RAWIMU, RAWIMUS, RAWIMUX and RAWIMUSX in ASCII.

Increments of velocity and angle are counts; their sizes depend on the type of IMU, which the extended logs name by its
number. The order is z, -y, x. Source: NovAtel, OEM7 Commands and Logs Reference Manual, logs RAWIMUS and RAWIMUSX with
the table of raw IMU scale factors, INSCONFIG with the numbers of types, and 32-bit CRC.
"""

import io
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, described
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import week_and_seconds
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource


class _Counts(NamedTuple):
    """Units of the counts of a type of IMU, and how many of them a count is."""

    gyro: float
    accel: float
    gyro_unit: str = "rad"
    accel_unit: str = "m/s"


_FOOT = 0.3048
_HG = _Counts(2.0**-33, _FOOT * 2.0**-27)
_HG_62 = _Counts(2.0**-33, _FOOT * 2.0**-26)
_HG_4930 = _Counts(2.0**-33, 2.0**-29)
_LITEF = _Counts(1e-9, 2e-8)
_STIM = _Counts(2.0**-21, 2.0**-22, "deg")
_FSAS = _Counts(0.1 * 2.0**-8, 0.05 * 2.0**-15, "arcsec")
_TYPES = {
    "hg1700-ag11": ((1,), _HG), "hg1700-ag17": ((4,), _HG_62), "hg1700-ag58": ((11,), _HG),
    "hg1700-ag62": ((12,), _HG_62), "hg1900": ((5, 27), _HG), "hg1930": ((20, 28), _HG),
    "hg4930": ((58, 68, 69), _HG_4930), "ln200": ((8,), _Counts(2.0**-19, 2.0**-14)), "fsas": ((13,), _FSAS),
    "isa100c": ((26,), _LITEF), "uimu": ((52,), _LITEF), "stim300": ((32, 56), _STIM),
    "adis16488": ((31,), _Counts(720 * 2.0**-31, 200 * 2.0**-31, "deg")),
    "g320": ((41, 62), _Counts(0.008 * 2.0**-16, 0.2 * 2.0**-16, "deg/s", "mg")),
    "g370": ((61,), _Counts(0.0151515 * 2.0**-16, 0.4 * 2.0**-16, "deg/s", "mg")),
}  # fmt: skip
"""Type of IMU -> its numbers in INSCONFIG, and its counts."""

_LOG = re.compile(rb"[%#](RAWIMU(S?)(X?))A,[^;]*;([^*]*)\*([0-9a-fA-F]{8})")
_NAMES = ("week", "seconds", "accel_z", "accel_y", "accel_x", "gyro_z", "gyro_y", "gyro_x")


def _is_certain(lines: Sequence[str]) -> bool:
    return any(line.startswith(("%RAWIMU", "#RAWIMU")) for line in lines)


def _open(source: TextSource, how: Reading) -> Columns:
    table = open_text(source.then(_rows), ",", 0)._replace(names=_NAMES)
    if how.scale is not None and how.scale.lower() not in _TYPES:
        raise ValueError(f"Unknown type of IMU {how.scale!r}; known are {', '.join(_TYPES)}, or give its counts.")
    kind = _type_of(source.head())
    name = how.scale.lower() if how.scale else next((name for name, (ids, _) in _TYPES.items() if kind in ids), None)
    counts = None if name is None else _TYPES[name][1]
    table = described(table, "novatel", {"gyro": "", "accel": ""})
    units = {} if counts is None else {a: counts.gyro_unit if a[0] == "g" else counts.accel_unit for a in table.roles}
    return table._replace(
        units=units,
        load=_turned(table.load, counts),
        stamps=Stamps((0, 1), lambda c: week_and_seconds(*c), "week and seconds", lambda c: float(c[1][0])),
        notes=() if name is None else (f"Counts of the IMU {name}.",),
        hint="The type of IMU is missing, which tells what a count is: give scale=..., one of "
        f'{", ".join(_TYPES)}, or the counts as in {{"gyro": "1e-9 rad", "accel": "2e-8 m/s"}}.',
    )


def _type_of(lines: Sequence[str]) -> int | None:
    """The type of IMU that an extended log names."""
    for line in lines:
        found = _LOG.match(line.encode("latin-1", "replace"))
        if found is not None and found[3]:
            return int(found[4].split(b",")[1])
    return None


def _turned(
    load: Callable[[list[int]], Sequence[np.ndarray]], counts: _Counts | None
) -> Callable[[list[int]], list[np.ndarray]]:
    """Load columns with y as y, and not as its negative, and in units in place of counts."""

    def turned(column: np.ndarray, name: str) -> np.ndarray:
        if not name.startswith(("gyro", "accel")):
            return column
        size = 1.0 if counts is None else counts.gyro if name.startswith("gyro") else counts.accel
        return column * (-size if name.endswith("_y") else size)

    return lambda picked: [turned(column, _NAMES[i]) for i, column in zip(picked, load(picked), strict=True)]


def _rows(stream: io.BufferedIOBase) -> Iterator[bytes]:
    """Week, seconds and six counts of each log; damaged ones are left out, and so missing."""
    for line in stream:
        if not line.startswith((b"%RAWIMU", b"#RAWIMU")):
            continue
        found = _LOG.match(line)
        if found is None or _crc(line[1 : found.start(5) - 1]) != int(found[5], 16):
            continue
        fields = found[4].split(b",")
        if found[3]:
            fields = fields[2:]  # without what the IMU says of itself
        yield b",".join([fields[0], fields[1], *fields[3:9]]) + b"\n"


def _crc(text: bytes) -> int:
    """The CRC of NovAtel: that of zlib, which starts from and ends on the complement, without both."""
    return zlib.crc32(text, 0xFFFFFFFF) ^ 0xFFFFFFFF


NOVATEL = Format("novatel", _is_certain, _open)
