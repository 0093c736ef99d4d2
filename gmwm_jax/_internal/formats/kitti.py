"""OXTS records of KITTI: a folder of one text file a frame beside ``timestamps.txt``, or all frames in one text file.

Source: Geiger et al. (2013), "Vision meets robotics: the KITTI dataset", and ``dataformat.txt`` of the data: 30 values,
m/s^2 and rad/s, axes front, left, up.
"""

from pathlib import Path

import numpy as np

from gmwm_jax._internal.columns import Columns, Stamps
from gmwm_jax._internal.formats.base import Format, named, not_told
from gmwm_jax._internal.limits import LONGEST_LINE
from gmwm_jax._internal.reading import Reading
from gmwm_jax._internal.stamps import from_text, since_first
from gmwm_jax._internal.text_files import open_text
from gmwm_jax._internal.text_source import TextSource

_NAMES = (
    "lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "accel_x", "accel_y", "accel_z",
    "af", "al", "au", "gyro_x", "gyro_y", "gyro_z", "wf", "wl", "wu", "pos_accuracy", "vel_accuracy", "navstat",
    "numsats", "posmode", "velmode", "orimode",
)  # fmt: skip
_UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


def _open_text(source: TextSource, how: Reading) -> Columns:
    return named(open_text(source, how.delimiter, 0), "kitti", _NAMES, _UNITS)


def _is_folder(file: Path) -> bool:
    return (file / "timestamps.txt").is_file() and (file / "data").is_dir()


def _open_folder(folder: Path, how: Reading) -> Columns:
    """Open a folder ``oxts``; frames that are not there are missing samples."""
    frames = sorted((folder / "data").glob("*.txt"))
    stamps = [line for line in (folder / "timestamps.txt").read_text().splitlines() if line.strip()]
    if not frames or int(frames[-1].stem) >= len(stamps):
        raise ValueError(f"{len(frames)} frames and {len(stamps)} lines of timestamps.txt do not belong together.")
    rows = [[] if f.stat().st_size > LONGEST_LINE else f.read_text().split() for f in frames]
    short = next((f.name for f, row in zip(frames, rows, strict=True) if len(row) != len(_NAMES)), None)
    if short is not None:
        raise ValueError(f"Frame {short} does not hold {len(_NAMES)} values.")
    values = np.array(rows, dtype=np.float64)
    times = from_text(np.array([stamps[int(frame.stem)] for frame in frames]))
    seconds, first = since_first(times), float(times[0].astype(np.int64)) * 1e-9
    columns = [*values.T, seconds]
    table = Columns(None, len(columns), lambda picked: [columns[i] for i in picked])
    stamped = Stamps((len(_NAMES),), lambda c: c[0], "timestamps.txt", lambda c: first)
    return named(table, "kitti", [*_NAMES, "seconds"], _UNITS)._replace(stamps=stamped)


KITTI = Format("kitti", not_told, _open_text, _is_folder, _open_folder)
