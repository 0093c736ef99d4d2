"""The attitude of a record by its section [align]: what ``nav-jax align`` reads."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from nav_jax.aiding.gnss import AbstractReceiver
from nav_jax.app.comparison_file import aiding_sections, check_sections, checked, from_toml, place
from nav_jax.app.record_file import FIXES, SECTIONS, RecordRunSection, RecordSection
from nav_jax.app.record_start import aligned
from nav_jax.app.sections import AlignSection
from nav_jax.recorded.at_rest import StartAtRest
from nav_jax.recorded.on_the_move import StartOnTheMove

_OF_RECEIVERS = ("lever_arm", "averaged")
"""Keys of a receiver that hold unless [align] has them."""


def align_file(path: str | os.PathLike[str]) -> tuple[StartAtRest | StartOnTheMove, list[str]]:
    """Align by a configuration, of which [record], [align], [[aiding]] and the Earth of [run] are read.

    Beside the start are lines that a reader of it should know.

    Raises
    ------
    FileNotFoundError, ValueError
        See `read_record`; a record that does not tell its attitude.
    """
    return from_toml(Path(path), _aligned)


def _aligned(tables: Mapping[str, Any], folder: Path) -> tuple[StartAtRest | StartOnTheMove, list[str]]:
    check_sections(tables, SECTIONS, ("record", "align"))
    run = checked(RecordRunSection, tables.get("run", {}), "[run]")
    asked = checked(AlignSection, tables["align"], "[align]")
    record = checked(RecordSection, tables["record"], "[record]")
    listed = aiding_sections(tables.get("aiding", []), FIXES)
    with place("[align]"):
        asked.arguments()  # before any file is read
    with place("[record]"):
        imu = record.build(folder)
    gnss, receiver = None, {}
    for i, section in enumerate(listed):
        if gnss is None:
            with place(f"[[aiding]] {i + 1}"):
                gnss = section.gnss(folder, record.origin)
            gnss = gnss if gnss is None else gnss.shifted(record.time_offset + section.time_offset)
        if issubclass(section.sensor, AbstractReceiver):  # the first that says so, as for navigation
            receiver = {k: getattr(section, k) for k in _OF_RECEIVERS if k in section.model_fields_set} | receiver
    origin = np.array(record.origin) if record.origin is not None else None if gnss is None else gnss.origin
    with place("[run]"):
        earth = run.build_earth(origin, "[record]")
    averaged = float(receiver.get("averaged", 0.0) if asked.averaged is None else asked.averaged)
    with place("[record]"):
        imu, notes = record.placed(imu, gnss, averaged, earth)
    with place("[align]"):
        return aligned(asked, imu, gnss, receiver, record.position, earth), notes
