"""Public recordings whose rate and units are documented: facts about exact files, told by their SHA-256."""

import hashlib
from pathlib import Path
from typing import NamedTuple

IMUDATA = "https://raw.githubusercontent.com/SMAC-Group/imudata/master/data/"
"""Folder of the public imudata recordings (repository SMAC-Group/imudata)."""


class KnownFile(NamedTuple):
    """What is documented about one public file.

    Attributes
    ----------
    name
        Name of the data set.
    file
        File name in the source folder.
    sha256
        Of the whole file: a copy under any name is recognised.
    rate
        Sampling rate in Hz.
    channels
        Channel names, in the order of the file's columns.
    units
        Unit of each channel's samples in the file.
    description
        Sensor, setting and length, in one line.
    source
        Address of the folder that holds it.
    """

    name: str
    file: str
    sha256: str
    rate: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    description: str
    source: str = IMUDATA


_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")

_ADIS_SHA256 = (
    "1eb09074beabd7cfc15b402cb8043b5302f6e4edfd9e4ebfbf8117436f8b9fa9",
    "de95fc0bcf854b3bcbda77e176841dcd4ec389d2676ba814d4f54dcdbe460fc0",
    "aaf972eb6ded35bad4ad2d46c44b0bfefd6665d485aabec4a417fc14259c18af",
    "6f1dd1f5d3fd565ead7ad0d45e0d89d058dc3498cde0c7984702ef89333205d4",
    "4967b52057106ebf0960f81f08fc47ac1bdd96ce842a802b8ee5fceecac8d8ee",
    "58d35eae5c930fba9ae2110d90c14328c4ed29c71d943f757d1b941f412b3115",
)

KNOWN_FILES = (
    *(
        KnownFile(
            name=f"adis_16405_imu{number}",
            file=f"adis_16405_imu{number}.rda",
            sha256=sha256,
            rate=100.0,
            channels=_AXES,
            units=("deg/s",) * 3 + ("g",) * 3,
            description=f"Analog Devices ADIS16405, unit {number} of 6, static, 1,000,000 x 6 (Univ. of Calgary)",
        )
        for number, sha256 in enumerate(_ADIS_SHA256, start=1)
    ),
    KnownFile(
        name="cont.imu1",
        file="cont.imu1.rda",
        sha256="0c177912a952df1142d847373e3fa7030129d6b42ef1ecad56f507ba3aaf01f6",
        rate=100.0,
        channels=("gyro_x",),
        units=("rad/s",),
        description="XSens MTi-G gyro X contaminated by outliers, 500,000 x 1: the case for robust estimation",
    ),
)
"""Every public file that is known."""


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file as 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def recognise(path: Path) -> KnownFile | None:
    """Return what is known about a file by its content; None for a file of the user's own."""
    digest = sha256(path)
    return next((known for known in KNOWN_FILES if known.sha256 == digest), None)
