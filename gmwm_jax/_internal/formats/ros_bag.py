"""Bags of ROS 1 and ROS 2 with messages of type sensor_msgs/Imu, read by the package rosbags.

Source: the message definition sensor_msgs/Imu. Its last 296 bytes are 37 float64 in ROS 1 and in CDR: orientation (4)
and covariance (9), angular velocity (3) and covariance, linear acceleration (3) and covariance; bytes 4 to 12 are the
stamp, after a sequence number or the header of CDR. So all messages are taken apart at once; the first and the last are
taken apart by rosbags, too, and must be the same.
"""

from pathlib import Path
from typing import Any

import numpy as np

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.bag_chunks import require_chunks
from gmwm_jax._internal.limits import require_stream
from gmwm_jax._internal.optional import import_optional
from gmwm_jax._internal.reading import Reading

BAGS = (".bag", ".mcap", ".db3")
"""Suffixes of files."""

_TAIL = 37 * 8
_TYPE = "sensor_msgs/msg/Imu"
_NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


_NO_BAG = "This is no bag, or it is truncated or corrupt: record or save it again. ({})"


def is_bag(file: Path) -> bool:
    """Is this a bag: a file, or a folder of rosbag2?"""
    if file.is_dir():
        return (file / "metadata.yaml").is_file()
    return file.suffix.lower() in BAGS or Path(file.stem).suffix.lower() in BAGS


def open_bag(file: Path, how: Reading) -> Columns:
    """Open the messages of one topic.

    Raises
    ------
    ImportError
        The extra ``ros`` is not installed.
    ValueError
        No bag; no topic of that type, or several and none is named.
    """
    highlevel = import_optional("rosbags.highlevel", extra="ros")
    typesys = import_optional("rosbags.typesys", extra="ros")
    try:
        for part in sorted(file.iterdir()) if file.is_dir() else [file]:
            if part.is_file():
                require_chunks(part, how.max_bytes)
        with highlevel.AnyReader([file], default_typestore=typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)) as bag:
            topic, connections = _topic(bag, how.variable)
            received, stamped, values, note = _messages(bag, connections, how)
    except UnicodeError as error:  # where a bag of ROS 1 begins with text
        raise ValueError(_NO_BAG.format("it does not start as bags do")) from error
    except (ValueError, PermissionError, MemoryError):
        raise
    except Exception as error:  # one of a dozen of rosbags and what it reads with
        raise ValueError(_NO_BAG.format(f"{type(error).__name__}: {error}")) from error
    clock = stamped if np.any(stamped) else received
    columns = [clock, *values.T]
    label = "header.stamp" if clock is stamped else "the time of receipt"
    return Columns(
        _NAMES, len(_NAMES), lambda picked: [columns[i] for i in picked],
        {name: "rad/s" if name.startswith("gyro") else "m/s^2" for name in _NAMES[1:]},
        format="ros", roles={name: i for i, name in enumerate(_NAMES) if i},
        stamps=Stamps((0,), lambda c: (c[0] - c[0][:1]) * 1e-9, label, lambda c: float(c[0][0]) * 1e-9),
        notes=(f"Topic {topic}.", *note),
    )  # fmt: skip


def _topic(bag: Any, asked: str | None) -> tuple[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for connection in bag.connections:
        if connection.msgtype == _TYPE:
            found.setdefault(connection.topic, []).append(connection)
    if asked in found:
        return str(asked), found[str(asked)]
    if asked is None and len(found) == 1:
        return next(iter(found.items()))
    listed = ", ".join(found) or "none"
    others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in bag.connections})[:10])
    if not found:
        raise ValueError(f"The bag has no topic of type {_TYPE}; it has {others or 'no messages'}.")
    what = "several topics" if asked is None else f"no topic {asked!r}"
    raise ValueError(f"The bag has {what} of type {_TYPE}: {listed}; variable=... names one.")


def _messages(bag: Any, connections: list[Any], how: Reading) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple]:
    """Time of receipt and stamp in ns, and angular velocity and linear acceleration, (N, 6)."""
    received, heads, tails, raws = [], [], [], []
    parts = [part for path in bag.paths for part in (path.rglob("*") if path.is_dir() else [path])]
    of, total = sum(part.stat().st_size for part in parts), 0  # a folder's own size is that of its list of files
    for connection, time, raw in bag.messages(connections=connections):
        total += len(raw)
        require_stream(total, of, how.max_bytes)
        received.append(time)
        heads.append(bytes(raw[4:12]))
        tails.append(bytes(raw[-_TAIL:]))
        raws = [*raws[:1], (connection, raw)]
    if not received:
        raise ValueError("The topic has no messages.")
    stamps = np.frombuffer(b"".join(heads), dtype="<u4").reshape(-1, 2).astype(np.int64)
    numbers = np.frombuffer(b"".join(tails), dtype="<f8").reshape(-1, 37)
    values = np.concatenate([numbers[:, 13:16], numbers[:, 25:28]], axis=1)
    ns = stamps[:, 0] * 1_000_000_000 + stamps[:, 1]
    for at, (connection, raw) in zip((0, -1), (raws[0], raws[-1]), strict=True):
        message = bag.deserialize(raw, connection.msgtype)
        w, a, stamp = message.angular_velocity, message.linear_acceleration, message.header.stamp
        same = np.array_equal(values[at], [w.x, w.y, w.z, a.x, a.y, a.z], equal_nan=True)
        if not same or ns[at] != stamp.sec * 1_000_000_000 + stamp.nanosec:
            raise ValueError("The messages of the bag are not laid out as those of type sensor_msgs/Imu are.")
    first, order = np.array(received, dtype=np.int64), np.argsort(ns, kind="stable") if np.any(ns) else slice(None)
    moved = int(np.count_nonzero(np.diff(ns) < 0))
    note = (f"{moved} messages were received out of order, and are sorted by their stamps.",) if moved else ()
    return first[order], ns[order], values[order], note
