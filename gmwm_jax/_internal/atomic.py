"""Writing files and folders so that they are there whole or not at all, whatever happens to the process meanwhile.

What is to be at a path is made in a work folder beside it, ``.NAME.1a2b3c4d.part``, and renamed. Its writer holds a
lock in there, of which the system lets go when the process ends: the next writer of the same path knows by it which
work folders nobody will finish, and removes them. A folder takes two renames to be replaced; who is killed in between
leaves both the former and the new one in the work folder, and the next writer or reader puts the new one in its place.
"""

import contextlib
import errno
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

from gmwm_jax._internal.outputs import is_device, make_folder

try:
    import fcntl
except ImportError:  # where there are no such locks, nobody knows what was left behind, and it stays
    fcntl = None

_LOCK, _NEW, _OLD = "lock", "new", "old"

_TRIES, _PAUSE = 20, 0.05
"""To remove a work folder, and s between them."""

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


def write_atomically(path: str | os.PathLike, write: Callable[[IO[bytes]], Any]) -> Path:
    """Call ``write`` with a file in a work folder, then rename it to `path`.

    Parameters
    ----------
    path
        Target; its folder is made if it is not there, below the working folder. A device or pipe is written as it is.
    write
        Writes bytes into the open file.

    Returns
    -------
    `path`.

    Raises
    ------
    OSError
        `path` is a folder, or cannot be written, as where the disk is full; what was there is still there.
    """

    def write_file(new: Path) -> None:
        with new.open("xb") as file:
            write(file)

    path = Path(path)
    if is_device(path):  # a rename would put a file in its place
        with path.open("wb") as device:
            write(device)
        return path
    if path.is_dir():
        raise IsADirectoryError(f"{path} is a folder, and a file is to be written.")
    return make_atomically(path, write_file)


def make_atomically(path: Path, make: Callable[[Path], Any]) -> Path:
    """Call ``make`` with a path in a work folder, then rename to `path` what it has made there, a file or a folder.

    Parameters
    ----------
    path
        Target, a former file or folder of the same kind is replaced, where a link leads to; its folder is made if it
        is not there, below the working folder.
    make
        Makes a file or a folder at the path that it is given.

    Raises
    ------
    OSError
        `path` cannot be written.
    """
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    with _work_folder(target) as folder:
        try:
            make(folder / _NEW)
        except OSError as error:
            if error.errno in _FULL:
                raise OSError(f"{path} cannot be written: {os.strerror(error.errno)}.") from error
            raise
        if target.is_dir():  # one rename does not replace a folder; `_settle` ends what is ended here
            target.rename(folder / _OLD)
            (folder / _NEW).rename(target)
        else:
            os.replace(folder / _NEW, target)
    return path


@contextlib.contextmanager
def as_sentence(path: Path) -> Iterator[None]:
    """Say what a system that refuses to write means for a store of parts."""
    try:
        yield
    except OSError as error:
        if error.errno is None:  # it is a sentence of ours
            raise
        raise OSError(
            f"{path} cannot be written ({os.strerror(error.errno)}): what is whole in it is kept, and the same call "
            "continues when it can be."
        ) from error


def settle_abandoned(path: Path) -> None:
    """Finish or remove what killed writers of a path have left beside it; what live ones are at is left alone."""
    name = re.compile(rf"\.{re.escape(path.name)}\.[0-9a-f]{{8}}\.part")
    for folder in [p for p in path.parent.iterdir() if name.fullmatch(p.name)] if path.parent.is_dir() else []:
        with contextlib.suppress(OSError), _lock(folder) as lock:
            if lock is not None:
                _settle(folder, path)


@contextlib.contextmanager
def _work_folder(path: Path) -> Iterator[Path]:
    make_folder(path.parent)
    with contextlib.ExitStack() as held:
        try:
            settle_abandoned(path)
            folder = _taken(path, held)
        except OSError as error:
            raise OSError(f"{path} cannot be written: {error.strerror}.") from error
        try:
            yield folder
        finally:
            _settle(folder, path)


def _taken(path: Path, held: contextlib.ExitStack) -> Path:
    """A new work folder whose lock is held."""
    while True:
        folder = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
        folder.mkdir()
        # between the two another writer may have taken it for abandoned
        with contextlib.suppress(BlockingIOError, FileNotFoundError):
            held.enter_context(_lock(folder))
            return folder


@contextlib.contextmanager
def _lock(folder: Path) -> Iterator[IO[bytes] | None]:
    """Hold the lock of a work folder; nothing where the system or the file system has no locks.

    Raises
    ------
    BlockingIOError, FileNotFoundError
        Another process or thread has it, or the folder is gone.
    """
    if fcntl is None:
        yield None
        return
    with (folder / _LOCK).open("ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS):
                raise
            yield None
            return
        # who had it before may have removed the folder, and this is then a file without a name
        if not os.path.samestat(os.fstat(lock.fileno()), (folder / _LOCK).stat()):
            raise FileNotFoundError(folder)
        yield lock


def _settle(folder: Path, path: Path) -> None:
    """End the work in a folder: one rename that may be missing, then it goes."""
    new, old = folder / _NEW, folder / _OLD
    if old.exists() and new.exists() and not path.exists():
        try:
            new.rename(path)
        except OSError:
            old.rename(path)
    for _ in range(_TRIES):  # threads of Zarr may still write after an error
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(_PAUSE)
