"""Where results go is looked at before any work: never onto an input, and to a place that can be written."""

import os
import tempfile
from collections.abc import Iterable
from itertools import combinations
from pathlib import Path


def check_outputs(files: Iterable[Path], inputs: Iterable[Path], folders: Iterable[Path] = ()) -> None:
    """Raise unless all outputs can be written and none is an input: `refuse_overwriting`, `require_place`."""
    files = list(files)
    refuse_overwriting(files, inputs)
    for output in files:
        require_place(output)
    for folder in folders:
        require_folder(folder)


def refuse_overwriting(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise if an output is one of the inputs, also by a link or another spelling of its path, or another output.

    Raises
    ------
    ValueError
        With both names.
    """
    outputs, inputs = list(outputs), list(inputs)
    for output in outputs:
        for source in inputs:
            if _same(output, source):
                raise ValueError(f"{output} would be written over {source}, which is read: name another file.")
    for one, other in combinations(outputs, 2):
        if _same(one, other):
            raise ValueError(f"{one} would be written twice: name another file.")


def require_place(path: Path) -> None:
    """Raise unless a file can be written at a path.

    Raises
    ------
    OSError
        There is a folder of that name; the folder that it is to be in cannot be made or written.
    """
    if path.is_dir() and path.suffix != ".zarr":  # a store of Zarr is a folder, which is replaced
        raise IsADirectoryError(f"{path} is a folder, and a file is to be written.")
    if not is_device(path):
        require_folder(path.parent)


def require_folder(folder: Path, beside: Path | None = None) -> None:
    """Raise unless files can be written in a folder, which is there or may be made.

    Parameters
    ----------
    folder
        The folder.
    beside
        Folders below this one may be made, and those below the working folder.

    Raises
    ------
    OSError
        It is a file, is missing elsewhere, or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"{folder} is a file, and a folder is needed.")
    there = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    if not there.is_dir():
        raise NotADirectoryError(f"{folder} cannot be made: {there} is a file.")
    roots = [Path.cwd(), *([] if beside is None else [beside])]
    if not folder.exists() and not any(
        Path(os.path.realpath(folder)).is_relative_to(os.path.realpath(root)) for root in roots
    ):
        # one that is misspelled would be filled, and looked for elsewhere
        raise FileNotFoundError(f"There is no folder {folder}: make it first. Those below the working folder are made.")
    try:
        with tempfile.TemporaryFile(dir=there):  # rights do not tell of file systems that are read only
            pass
    except OSError as error:
        raise OSError(f"{folder} cannot be written: {error.strerror}.") from error


def make_folder(folder: Path, beside: Path | None = None) -> None:
    """Make a folder, if it may be made, see `require_folder`."""
    require_folder(folder, beside)
    folder.mkdir(parents=True, exist_ok=True)


def is_device(path: Path) -> bool:
    """Is it neither file nor folder, such as ``/dev/null``, a terminal or a pipe?"""
    return os.path.exists(path) and not path.is_file() and not path.is_dir()


def _same(one: Path, other: Path) -> bool:
    if is_device(one):
        return False
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)  # of a loop of links too
