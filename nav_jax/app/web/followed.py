"""A trajectory that is sent: read in a process of its own, and kept as a table that needs no options."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax

from gmwm_jax.app.web.limits import Limits
from gmwm_jax.app.web.uploads import read_apart
from nav_jax.app.comparison_file import checked
from nav_jax.app.sections import TrajectoryFile
from nav_jax.app.web.study import Followed, value_of
from nav_jax.trajectory.files import read_trajectory, save_trajectory
from nav_jax.trajectory.trajectory import Trajectory

_NAMED = 12
"""Digits of the content in the name of a file."""


def follow(path: Path, name: str, options: Mapping[str, str], limits: Limits, folder: Path) -> Followed:
    """Read the file of a trajectory.

    Parameters
    ----------
    path, name
        Where it was stored, and its own name, which is never a path here.
    options
        Key of the section ``[trajectory]`` -> what is typed; "" for what is found in the file.
    limits
        Of the server.
    folder
        Where it is kept.

    Raises
    ------
    ValueError
        What `nav_jax.read_trajectory` says of the file; a key that is wrong; a limit.
    """
    given = {key: value_of(text) for key, text in options.items() if text.strip()}
    section = checked(TrajectoryFile, {"file": name, **given}, "[trajectory]")
    found = read_apart(read_in_64_bits, path, name, section.given("file"), limits)
    kept = save_trajectory(found, folder / f"trajectory-{_digest(found)}.npz")
    return Followed(folder, kept.name, found.duration, found.origin)


def _digest(of: Trajectory) -> str:
    """Of all that the file has: results are kept by its name."""
    arrays = of.time, of.position, of.velocity, of.quaternion
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest()[:_NAMED]


def read_in_64_bits(path: Path, **options: Any) -> Trajectory:
    """Read a trajectory where nothing has been computed yet: in a process of its own."""
    jax.config.update("jax_enable_x64", True)
    return read_trajectory(path, **options)
