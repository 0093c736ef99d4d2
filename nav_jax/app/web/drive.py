"""A recorded drive: its configuration and the files that it names, navigated by the command of the shell.

The command runs in a process of its own, with limits of memory and time, since the files are a visitor's.
"""

import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from gmwm_jax._internal.saved import load
from gmwm_jax.app.web.limits import Limits
from nav_jax.app.comparison_file import names_of_files
from nav_jax.recorded.navigation import Navigation

_BETWEEN = 0.2
"""Seconds between two looks at the process."""

_PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, ({memory}, {memory}))
resource.setrlimit(resource.RLIMIT_CPU, ({seconds}, {seconds}))
sys.argv = ["nav-jax", "navigate", "drive.toml", "--save", "solution.npz"]
from nav_jax.__main__ import main
main()
"""


class Sent(NamedTuple):
    """A file that was sent."""

    name: str
    path: str


class Drive(NamedTuple):
    """What the command says, and its solution."""

    text: str
    solution: Navigation


def configuration_of(files: Iterable[Sent]) -> Sent:
    """Find the one file of TOML.

    Raises
    ------
    ValueError
        There is none, or there are several.

    Examples
    --------
    >>> from nav_jax.app.web.drive import Sent, configuration_of
    >>> configuration_of([Sent("imu.csv", "0.csv"), Sent("drive.toml", "1.toml")]).name
    'drive.toml'
    """
    found = [file for file in files if file.name.lower().endswith(".toml")]
    if len(found) != 1:
        raise ValueError(f"A drive is one configuration, .toml, with the files that it names; there are {len(found)}.")
    return found[0]


def check(text: str, names: Iterable[str]) -> None:
    """Raise unless a configuration names files that were sent, and none that is written.

    Parameters
    ----------
    text
        The configuration.
    names
        Of the files that were sent.

    Raises
    ------
    ValueError
        No TOML, an output, a file that was not sent.

    Examples
    --------
    >>> from nav_jax.app.web.drive import check
    >>> check('record.imu = "imu.csv"', ["imu.csv"])
    """
    try:
        tables = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"The configuration is no TOML: {error}.") from error
    if "output" in tables:
        raise ValueError("The section [output] is not for the page, which gives all results: leave it out.")
    known = set(names)
    for named in names_of_files(tables):
        if named not in known:
            raise ValueError(f"The configuration names the file {named!r:.80}, which was not sent: send both together.")


def navigate(files: Iterable[Sent], limits: Limits, tell: Callable[[int, int | None], None]) -> Drive:
    """Navigate a drive.

    Parameters
    ----------
    files
        The configuration, and those that it names.
    limits
        Of memory and time.
    tell
        Told that it goes on; cancels by raising.

    Raises
    ------
    ValueError
        See `configuration_of` and `check`; what the command says.
    """
    files = list(files)
    chosen = configuration_of(files)
    try:
        text = Path(chosen.path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{chosen.name} is no text.") from None
    sent = [file for file in files if file is not chosen]
    for file in sent:
        if Path(file.name).name != file.name or file.name in ("", ".", ".."):
            raise ValueError(f"{file.name!r:.80} is no name of a file.")
    check(text, [file.name for file in sent])
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file in sent:
            (folder / file.name).symlink_to(Path(file.path).resolve())
        (folder / "drive.toml").write_text(text, encoding="utf-8")
        said = _run(folder, limits, tell)
        solution = load(folder / "solution.npz")
    assert isinstance(solution, Navigation)  # the command has written it
    return Drive(said, solution)


def _run(folder: Path, limits: Limits, tell: Callable[[int, int | None], None]) -> str:
    program = _PROGRAM.format(memory=limits.read_memory, seconds=int(limits.job_seconds) + 1)
    pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", program], cwd=folder, **pipes) as process:
        try:
            out, wrong = _followed(process, tell)
        finally:
            process.kill()
    if process.returncode:
        raise ValueError((wrong.strip().splitlines() or ["The drive was not navigated: it took too much memory."])[-1])
    return out.replace("Saved as solution.npz", "").strip()


def _followed(process: subprocess.Popen[str], tell: Callable[[int, int | None], None]) -> tuple[str, str]:
    """What a process writes until it ends."""
    while True:
        tell(0, None)
        try:
            return process.communicate(timeout=_BETWEEN)
        except subprocess.TimeoutExpired:
            continue
