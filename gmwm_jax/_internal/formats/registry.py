"""Every format of a logger that is known; a new one is one file and one row here."""

from collections.abc import Sequence

from gmwm_jax._internal.formats.base import Format
from gmwm_jax._internal.formats.euroc import EUROC
from gmwm_jax._internal.formats.kf_gins import KF_GINS
from gmwm_jax._internal.formats.kitti import KITTI
from gmwm_jax._internal.formats.novatel import NOVATEL
from gmwm_jax._internal.formats.ros import ROS
from gmwm_jax._internal.formats.rtklibexplorer import RTKLIBEXPLORER
from gmwm_jax._internal.formats.vectornav import VECTORNAV
from gmwm_jax._internal.formats.xsens import XSENS

TEXT = "text"
"""The name of text files of no logger's format."""

FORMATS = {row.name: row for row in (XSENS, VECTORNAV, ROS, NOVATEL, EUROC, KITTI, KF_GINS, RTKLIBEXPLORER)}
"""By name."""


def recognise(lines: Sequence[str]) -> Format | None:
    """Return the format that the first lines of a text file tell beyond doubt."""
    return next((row for row in FORMATS.values() if row.is_certain(lines)), None)
