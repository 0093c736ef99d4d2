"""Results of tasks in a folder, one file each, from which work that was interrupted continues.

Whoever gives the tasks out writes what comes back; nobody else needs to see the folder. A file is there whole or not at
all, has a sum over all that is in it, and says of which piece of work and of which task it is: what is damaged, or of
something else, was not done.
"""

import os
import warnings
from pathlib import Path
from typing import Any

from gmwm_jax._internal.atomic import as_sentence
from gmwm_jax._internal.environment import differences, environment
from gmwm_jax._internal.outputs import make_folder
from gmwm_jax._internal.specification import Specification, require_same
from gmwm_jax._internal.state_files import Content, NewerVersionError, read_state, write_state
from gmwm_jax._internal.states import State

_ROOT = "parts.json"
_PART = "part"


class Parts:
    """The folder of a piece of work; it is made, or taken as it is if it is of the same one.

    Parameters
    ----------
    path
        Of the folder.
    work
        What it is, as messages call it: ``bootstrap``.
    specification
        What defines it.

    Raises
    ------
    FileExistsError
        There is something else at the path.
    ValueError
        It is of another piece of work, whose first field that differs is named, has other numbers, or is of a newer
        version.
    OSError
        It cannot be written.
    """

    def __init__(self, path: str | os.PathLike, work: str, specification: Specification):
        self.path, self._work, self._specification = Path(path), work, specification
        with as_sentence(self.path):
            former = self._former()
            if former is None:
                make_folder(self.path.absolute().parent)
                self.path.mkdir(exist_ok=True)
                self._write(_ROOT, work, State({"text": specification.text, "environment": environment()}, {}))
                return
        require_same(path, work, former["text"], specification.text)
        if differing := differences(former["environment"], environment()):
            warnings.warn(
                f"{path} was begun elsewhere ({differing}): new parts agree with those that are there to rounding, not "
                "to the last bit.",
                stacklevel=3,
            )

    def _former(self) -> Any:
        """What the folder says of itself; None where there is nothing, or that is damaged."""
        begun = f".{_ROOT}."  # work folders of a first writer that was killed, which the next one removes
        if not self.path.exists() or (
            self.path.is_dir() and all(work.name.startswith(begun) for work in self.path.iterdir())
        ):
            return None
        if not (self.path.is_dir() and ((self.path / _ROOT).exists() or any(self.path.glob("*.npz")))):
            raise FileExistsError(f"{self.path} is there and is no store of a {self._work}: it stays. Choose another.")
        try:
            content = read_state(self.path / _ROOT)
        except NewerVersionError:
            raise
        except (ValueError, FileNotFoundError):
            warnings.warn(f"{self.path / _ROOT} was damaged and is restored.", stacklevel=4)
            return None
        if content.kind != self._work:
            raise FileExistsError(f"{self.path} is the store of a {content.kind:.50}: it stays. Choose another.")
        return content.state.tree

    def write(self, name: str, state: State) -> None:
        """Write the result of a task.

        Parameters
        ----------
        name
            Of the task, which a file can have.
        state
            The result.

        Raises
        ------
        OSError
            It cannot be written.
        """
        of = {"of": self._specification.digest, "name": name, "result": state.tree}
        with as_sentence(self.path):
            self._write(f"{name}.npz", _PART, State(of, state.arrays))

    def read(self, name: str) -> State | None:
        """Read the result of a task; None if it is not there as it was written, with a warning if it was once."""
        file = self.path / f"{name}.npz"
        try:
            kind, state = read_state(file)
            if (kind, state.tree["of"], state.tree["name"]) == (_PART, self._specification.digest, name):
                return State(state.tree["result"], state.arrays)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, TypeError, KeyError):
            pass
        warnings.warn(f"{file} is damaged, and computed again.", stacklevel=3)
        return None

    def _write(self, name: str, kind: str, state: State) -> None:
        write_state(self.path.absolute() / name, Content(kind, state))
