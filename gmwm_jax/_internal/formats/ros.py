"""ROS: bags of ``sensor_msgs/Imu``, and their exports as text (``rostopic echo -p``, PlotJuggler and the like).

Source: the message definition sensor_msgs/Imu: angular_velocity in rad/s, linear_acceleration in m/s^2.
"""

import re
from collections.abc import Sequence

import numpy as np

from gmwm_jax._internal.columns import Columns, Stamps, plain_name
from gmwm_jax._internal.formats.base import Format, described
from gmwm_jax._internal.formats.ros_bag import is_bag, open_bag
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import seconds_and_nanoseconds, seconds_of
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_AXIS = re.compile(r"(?:.*_)?(angular_velocity|linear_acceleration)_([xyz])")
_WHOLE = re.compile(r"(?:.*_)?stamp_secs?")
_PART = re.compile(r"(?:.*_)?stamp_n(?:ano)?secs?")
_ONE = (re.compile(r"(?:.*_)?stamp"), re.compile(r"(?:.*_)?(?:time|timestamp)"))
_NANOSECONDS = 1e17
"""Stamps since 1970 beyond this are in ns, others in s."""


def _is_certain(lines: Sequence[str]) -> bool:
    return any("angular_velocity" in line and "linear_acceleration" in line for line in lines[:20])


def _open(source: TextSource, how: Reading) -> Columns:
    table = open_text(source, how.delimiter, how.header)
    table = described(table, "ros", {"gyro": "rad/s", "accel": "m/s^2"}, _role)
    usable = {i: plain_name(name) for i, name in enumerate(table.names or ()) if i not in table.text}

    def first(pattern: re.Pattern) -> int | None:
        return next((i for i, name in usable.items() if pattern.fullmatch(name)), None)

    whole, part = first(_WHOLE), first(_PART)
    names = table.names or ()
    if whole is not None and part is not None:
        label = f"{names[whole]!r} and {names[part]!r}"
        stamps = Stamps(
            (whole, part), lambda c: seconds_and_nanoseconds(*c), label, lambda c: float(c[0][0]) + c[1][0] * 1e-9
        )
        return table._replace(stamps=stamps)
    for pattern in _ONE:
        if (i := first(pattern)) is not None:
            stamps = Stamps((i,), lambda c: seconds_of(c[0], _size(c[0])), repr(names[i]), _first)
            return table._replace(stamps=stamps)
    return table


def _size(stamps: np.ndarray) -> float:
    return 1e-9 if len(stamps) and stamps[0] > _NANOSECONDS else 1.0


def _first(columns: Sequence[np.ndarray]) -> float:
    return float(columns[0][0]) * _size(columns[0])


def _role(name: str) -> str | None:
    found = _AXIS.fullmatch(plain_name(name))
    if found is None:
        return None
    return f"{'gyro' if found[1] == 'angular_velocity' else 'accel'}_{found[2]}"


ROS = Format("ros", _is_certain, _open, is_bag, open_bag)
