"""A recorded drive: its configuration and the files that it names, which commands of the shell navigate and study.

A command runs in a process of its own, with limits of memory and time, since the files are a visitor's.
"""

import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from gmwm_jax._internal.limits import as_bytes
from gmwm_jax._internal.saved import load
from gmwm_jax.app.web.limits import Limits
from nav_jax.app.comparison_file import names_of_files
from nav_jax.recorded.navigation import Navigation
from nav_jax.recorded.study import OutageStudy

T = TypeVar("T")

_BETWEEN = 0.2
"""Seconds between two looks at the process."""
_CONFIGURATION = 1_000_000
"""Bytes of a configuration, which is parsed in the process of the server, where nothing ends it."""
_NAME = 255
"""Bytes of the name of a file, in most file systems."""
_CONFIG, _FOUND = "drive.toml", "found.npz"
"""The files that a command reads and writes."""

_PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_DATA, ({memory}, {memory}))
resource.setrlimit(resource.RLIMIT_CPU, ({seconds}, {seconds} + 1))
sys.argv = {words!r}
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


class Filtering(NamedTuple):
    """By which filter of the configuration, and of what it takes notice; what is None is as the configuration says."""

    name: str | None = None
    gate: float | None = None
    vibration: float | None = None

    def options(self) -> tuple[str, ...]:
        """As the shell gives them."""
        given = {"filter": self.name, "gate": self.gate, "vibration": self.vibration}
        return tuple(f"--{option}={value}" for option, value in given.items() if value is not None)


AS_CONFIGURED = Filtering()


class StudiedDrive(NamedTuple):
    """What the command says, and its study."""

    text: str
    study: OutageStudy


class _Command(NamedTuple):
    """A command that takes a configuration and saves what it finds."""

    name: str
    options: tuple[str, ...] = ()
    undone: str = "The drive was not navigated"
    """With what the sentence begins that says why there is no result."""

    def words(self) -> list[str]:
        """All of it, as the shell gives it."""
        return ["nav-jax", self.name, _CONFIG, *self.options, "--save", _FOUND]


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


def navigate(
    files: Iterable[Sent],
    limits: Limits,
    tell: Callable[[int, int | None], None],
    *,
    filtering: Filtering = AS_CONFIGURED,
) -> Drive:
    """Navigate a drive.

    Parameters
    ----------
    files
        The configuration, and those that it names.
    limits
        Of memory and time.
    tell
        Told that it goes on; cancels by raising.
    filtering
        See there.

    Raises
    ------
    ValueError
        See `configuration_of` and `check`; what the command says.
    """
    return Drive(*_found(_Command("navigate", filtering.options()), Navigation, files, limits, tell))


def study_outages(
    files: Iterable[Sent],
    limits: Limits,
    tell: Callable[[int, int | None], None],
    *,
    last: float,
    every: float,
    runs: int = 2,
    filtering: Filtering = AS_CONFIGURED,
) -> StudiedDrive:
    """Simulate outages all over a drive.

    Parameters
    ----------
    files, limits, tell
        See `navigate`.
    last, every
        Seconds: of each outage, and from the beginning of one to that of the next.
    runs
        So many, whose outages are shifted against each other.
    filtering
        See there.

    Raises
    ------
    ValueError
        See `navigate`.
    """
    options = (f"--last={last!r}", f"--every={every!r}", f"--runs={runs}", *filtering.options())
    command = _Command("outages", options, "The outages were not studied")
    return StudiedDrive(*_found(command, OutageStudy, files, limits, tell))


def _found(
    command: _Command, kind: type[T], files: Iterable[Sent], limits: Limits, tell: Callable[[int, int | None], None]
) -> tuple[str, T]:
    """What a command says of a drive, and what it saves."""
    files = list(files)
    chosen = configuration_of(files)
    sent = [file for file in files if file is not chosen]
    _check_names([file.name for file in sent])
    text = _text_of(chosen)
    check(text, [file.name for file in sent])
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for file in sent:
            (folder / file.name).symlink_to(Path(file.path).resolve())
        (folder / _CONFIG).write_text(text, encoding="utf-8")
        said = _run(command, folder, limits, tell)
        found = load(folder / _FOUND)
    assert isinstance(found, kind)  # the command has written it
    return said, found


def _check_names(names: Sequence[str]) -> None:
    """Raise unless a folder can have files of all these names: what it would say instead names a path of the server."""
    for name in names:
        if Path(name).name != name or name in ("", ".", "..") or "\0" in name or len(name.encode()) > _NAME:
            raise ValueError(f"{name!r:.80} is no name of a file.")
        if names.count(name) > 1:
            raise ValueError(f"Two files have the name {name!r}: send each once.")


def _text_of(chosen: Sent) -> str:
    path = Path(chosen.path)
    if path.stat().st_size > _CONFIGURATION:
        raise ValueError(f"{chosen.name!r:.80} is larger than {as_bytes(_CONFIGURATION)}, the most of a configuration.")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{chosen.name!r:.80} is no text.") from None


def _run(command: _Command, folder: Path, limits: Limits, tell: Callable[[int, int | None], None]) -> str:
    seconds = int(limits.job_seconds) + 1
    program = _PROGRAM.format(memory=limits.read_memory, seconds=seconds, words=command.words())
    pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", program], cwd=folder, **pipes) as process:
        try:
            out, wrong = _followed(process, tell)
        finally:
            process.kill()
    if process.returncode:
        raise ValueError(_reason(command, process.returncode, wrong, limits))
    return out.replace(f"Saved as {_FOUND}", "").strip()


def _reason(command: _Command, code: int, wrong: str, limits: Limits) -> str:
    """Why there is no result: what ended the command, else the last line that it wrote."""
    if code < 0 and -code == signal.SIGXCPU:  # at the lower of its two limits; a lack of memory has another signal
        return f"{command.undone} within {limits.job_seconds:g} s of a processor, the most that it gets."
    lines = wrong.strip().splitlines()
    if code < 0 or not lines:
        return f"{command.undone}: it took more than the {as_bytes(limits.read_memory)} of memory it gets."
    return lines[-1]


def _followed(process: subprocess.Popen[str], tell: Callable[[int, int | None], None]) -> tuple[str, str]:
    """What a process writes until it ends."""
    while True:
        tell(0, None)
        try:
            return process.communicate(timeout=_BETWEEN)
        except subprocess.TimeoutExpired:
            continue
