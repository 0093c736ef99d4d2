"""An output is never written onto an input."""

from collections.abc import Iterable
from itertools import combinations
from pathlib import Path


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


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)
    return one.resolve() == other.resolve()
