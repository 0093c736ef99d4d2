"""Work that ends with `os._exit` after each of its file operations in turn, and is gone on with by another process.

The processes are forks of one that has imported and computed all that the work needs: JAX computes in none of them.
"""

import os
import shutil
import sys
import traceback
from pathlib import Path

EXITED, FAILED = 70, 71

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


def _at(path, fd=-1):
    """An absolute path; of one that is below an open folder, too."""
    folder = os.getcwd() if fd in (-1, None) else os.readlink(f"/proc/self/fd/{fd}")
    return os.path.join(folder, os.fsdecode(path))


_OPERATIONS = {
    "open": lambda path, mode, flags: (_at(path), lambda: os.open(path, flags, 0o666)),
    "os.mkdir": lambda path, mode, fd: (_at(path, fd), lambda: os.mkdir(_at(path, fd), mode)),
    "os.rename": lambda old, new, fd, of: (_at(new, of), lambda: os.replace(_at(old, fd), _at(new, of))),
    "os.link": lambda old, new, fd, of: (_at(new, of), lambda: os.link(_at(old, fd), _at(new, of))),
    "os.remove": lambda path, fd: (_at(path, fd), lambda: os.remove(_at(path, fd))),
    "os.rmdir": lambda path, fd: (_at(path, fd), lambda: os.rmdir(_at(path, fd))),
}
"""Event of `sys.audit` -> from its arguments: what it is about, and a call that does the same."""

_IF_THERE = {"os.mkdir": False, "os.remove": True, "os.rmdir": True}
"""Otherwise they change nothing."""


class Exits:
    """Counts what is done to files below a folder, and ends the process after so much; never where it is 0."""

    def __init__(self, folder, after):
        self.count, self._folder, self._after, self._on = 0, str(folder), after, True
        sys.addaudithook(self)

    def __call__(self, event, arguments):
        if not self._on or event not in _OPERATIONS or isinstance(arguments[0], int):
            return
        if event == "open" and not arguments[2] & _WRITES:
            return
        path, do = _OPERATIONS[event](*arguments)
        changes_nothing = event in _IF_THERE and os.path.lexists(path) != _IF_THERE[event]
        if changes_nothing or not path.startswith(self._folder):
            return
        self.count += 1
        if self.count == self._after:
            self._on = False
            try:
                do()  # or it fails, as it would have
            finally:
                os._exit(EXITED)


def forked(work, *arguments):
    """Do a piece of work in a process of its own, and say how that ended."""
    pid = os.fork()
    if pid:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    try:
        work(*arguments)
    except BaseException:
        traceback.print_exc()
        os._exit(FAILED)
    os._exit(0)


def counted(work, path):
    """Number of file operations that a piece of work does below a path."""
    reading, writing = os.pipe()

    def count():
        exits = Exits(path, 0)
        work(path)
        os.write(writing, str(exits.count).encode())

    assert forked(count) == 0
    return int(os.read(reading, 100))


def after_each(work, go_on, step, found):
    """End the work after every so many file operations, go on, and compare with work that was never ended.

    Parameters
    ----------
    work
        Called with a path.
    go_on
        Called with it by another process, after the first has ended.
    step
        Of the numbers of operations.
    found
        What is there at a path, to be compared.

    Returns
    -------
    Number of operations that the work has.
    """
    undisturbed, path = Path.cwd() / "undisturbed", Path.cwd() / "store"
    total = counted(work, undisturbed)
    expected = found(undisturbed)
    assert counted(go_on, undisturbed) == 0, "what is done is touched"

    def ends(after):
        Exits(path, after)
        work(path)

    for after in range(1, total + 1, step):
        assert forked(ends, after) == EXITED, after
        assert forked(go_on, path) == 0, after
        assert found(path) == expected, after
        shutil.rmtree(path)
    return total
